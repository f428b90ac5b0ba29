"""Each fault that a recording may have, made on purpose: the check must say so in words that help."""

import json
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from vigauge.errors import DataError
from vigauge.geometry import so3
from vigauge.model.imu import ImuSamples
from vigauge.recordings.asl.ground_truth import read_ground_truth
from vigauge.recordings.asl.images import read_image
from vigauge.recordings.asl.sequence import read_sequence
from vigauge.recordings.checks.findings import Findings
from vigauge.recordings.checks.inertial import Rest
from vigauge.recordings.checks.rig import check_motion
from vigauge.recordings.checks.sequence import Window, check_sequence
from vigauge.recordings.checks.turning import GyroRotation, Turns
from vigauge.recordings.checks.vision import Effort
from vigauge_paper.stand_in.rendering import START_NS

# Fewer images than usual: these recordings are short, and what is wrong with them is plain.
QUICK = Effort(stereo_frames=2, turns=11)
TRUTH = "state_groundtruth_estimate0"


def check(folder: Path, **options: object) -> Findings:
    return check_sequence(folder, effort=QUICK, **options)  # type: ignore[arg-type]


def messages(found: Findings, severity: str) -> list[str]:
    return [f"[{finding.check}] {finding.message}" for finding in found.of(severity)]


def edit_rows(folder: Path, sensor: str, change: Callable[[list[str]], list[str] | None]) -> None:
    """Rewrite the rows of a data.csv; ``change`` gets the fields of one and gives them back, or None."""
    path = folder / "mav0" / sensor / "data.csv"
    head, *rows = path.read_text().splitlines()
    changed = [change(row.split(",")) for row in rows]
    path.write_text("\n".join([head, *(",".join(row) for row in changed if row is not None)]) + "\n")


def scale(columns: slice, factor: float) -> Callable[[list[str]], list[str]]:
    def change(row: list[str]) -> list[str]:
        row[columns] = [repr(float(text) * factor) for text in row[columns]]
        return row

    return change


def edit_sensor(folder: Path, sensor: str, change: Callable[[dict], None]) -> None:
    path = folder / "mav0" / sensor / "sensor.yaml"
    content = yaml.safe_load(path.read_text())
    change(content)
    path.write_text(yaml.safe_dump(content))


def edit_pose(folder: Path, sensor: str, change: Callable[[np.ndarray], np.ndarray]) -> None:
    def new(content: dict) -> None:
        T = change(np.array(content["T_BS"]["data"]).reshape(4, 4))
        content["T_BS"]["data"] = [float(x) for x in T.ravel()]

    edit_sensor(folder, sensor, new)


def image_files(folder: Path, camera: str) -> list[Path]:
    return sorted((folder / "mav0" / camera / "data").glob("*.png"))


def replace_image(path: Path, data: bytes) -> None:
    path.unlink()  # a link to the good recording, which must stay as it is
    path.write_bytes(data)


def redraw(path: Path, change: Callable[[np.ndarray], np.ndarray]) -> None:
    done, data = cv2.imencode(".png", change(cv2.imread(str(path), cv2.IMREAD_UNCHANGED)))
    assert done
    replace_image(path, data.tobytes())


def run_program(folder: Path, *options: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "vigauge.cli.check_sequence", str(folder), *options]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_good_recording_has_nothing_to_complain_about(good_folder: Path) -> None:
    """A false alarm, or numbers that are not those of the recording."""
    found = check(good_folder)
    assert found.exit_status == 0, found.lines()
    facts = found.facts
    assert facts["imu0"]["rate_hz"] == pytest.approx(200.0)
    assert facts["cam0"]["rate_hz"] == pytest.approx(20.0)
    assert facts["calibration"]["baseline_m"] == pytest.approx(0.1101, abs=1e-4)
    assert facts["calibration"]["epipolar_px"] < 0.3
    assert facts["imu0"]["gravity_mps2"] == pytest.approx(9.81, abs=0.8)
    seen = facts["camera against gyro"]
    assert abs(seen["offset_ms"]) < 3.0 * seen["offset_sigma_ms"] < 5.0
    assert seen["gyro_bias_radps"] == pytest.approx([-0.002, 0.021, 0.077], abs=3e-3)
    assert facts[TRUTH]["gyro_axes_deg"] < 0.1
    assert facts[TRUTH]["force_residual_mps2"] < 0.05


def test_program_prints_text_and_json_and_gives_the_status(folder: Path, tmp_path: Path) -> None:
    """A status that scripts cannot rely on, or JSON with something else around it."""
    good = run_program(folder)
    assert good.returncode == 0 and "nothing wrong found" in good.stdout, good.stderr
    edit_rows(folder, "cam1", lambda row: None if row[0].endswith("0" * 9) else row)
    odd = run_program(folder, "--json")
    report = json.loads(odd.stdout)
    assert odd.returncode == report["exit_status"] == 1, odd.stderr
    assert [w["check"] for w in report["warnings"]] == ["missing frame"]
    assert run_program(folder, "--accept-warnings").returncode == 0
    bad = run_program(tmp_path / "nowhere", "--json")
    assert bad.returncode == 2
    assert "sequence folder must exist" in json.loads(bad.stdout)["errors"][0]["message"]


def test_report_is_written_unless_the_recording_is_unusable(folder: Path, tmp_path: Path) -> None:
    """A rule whose result says "fine" although it failed."""
    report = tmp_path / "out" / "report.json"
    assert run_program(folder, "--output", str(report)).returncode == 0
    assert json.loads(report.read_text())["facts"]["imu0"]["gaps"] == 0
    report.unlink()
    edit_rows(folder, "imu0", scale(slice(4, 7), 1.0 / 9.81))
    log = tmp_path / "log.txt"
    assert run_program(folder, "--output", str(report), "--log", str(log)).returncode == 2
    assert not report.exists()
    assert "specific force must be in m/s^2" in log.read_text()
    assert run_program(folder, "--output", str(report), "--accept-errors").returncode == 0
    assert json.loads(report.read_text())["exit_status"] == 2


# Case 7
def test_inertial_gap_is_an_error_with_stamp_and_length(folder: Path) -> None:
    """Integration over what was not measured."""
    begin = START_NS + 1_000_000_000
    edit_rows(folder, "imu0", lambda row: None if begin < int(row[0]) < begin + 100_000_000 else row)
    (message,) = messages(check(folder), "error")
    assert f"first follows {begin} ns and is 0.1 s long" in message
    apart = check(folder, window=Window(start_s=1.2))
    assert not messages(apart, "error"), "a window without the gap is usable"


# Case 8
@pytest.mark.parametrize(
    ("unit", "divisor"), [("microseconds", 10**3), ("milliseconds", 10**6)], ids=["us", "ms"]
)
def test_stamps_from_power_on_in_another_unit_are_told_by_their_rate(
    folder: Path, unit: str, divisor: int
) -> None:
    """Dates give units away where stamps are dates; where they count from power-on, only rates do."""

    def change(row: list[str]) -> list[str]:
        row[0] = str((int(row[0]) - START_NS + 5_000_000_000) // divisor)
        return row

    for sensor in ("imu0", "cam0", "cam1", TRUTH):
        edit_rows(folder, sensor, change)
    found = messages(check(folder), "error")
    assert any(f"the stamps look like {unit}" in message for message in found), found


# Cases 11 and 12
@pytest.mark.parametrize(
    ("columns", "factor", "words"),
    [
        (slice(1, 4), 180.0 / np.pi, "angular velocity must be in rad/s"),
        (slice(1, 4), 20.0, "times as far as the camera; it must be in rad/s"),
        (slice(4, 7), 1.0 / 9.81, "specific force must be in m/s^2"),
    ],
    ids=["gyro in deg/s", "gyro of another scale", "accel in g"],
)
def test_inertial_units_are_told(folder: Path, columns: slice, factor: float, words: str) -> None:
    """Units that are wrong but pass for slow or fast motion."""
    edit_rows(folder, "imu0", scale(columns, factor))
    found = messages(check(folder), "error")
    assert any(words in message for message in found), found


@pytest.mark.parametrize("factor", [57.3, 1 / 57.3, 400.0])
def test_density_that_the_samples_do_not_have_is_warned_of(folder: Path, factor: float) -> None:
    """Degrees for radians, either way; a density per sample."""
    path = folder / "mav0" / "imu0" / "sensor.yaml"
    content = yaml.safe_load(path.read_text())
    content["gyroscope_noise_density"] *= factor
    path.write_text(yaml.safe_dump(content))
    findings = check(folder)
    assert findings.exit_status == 1
    assert any("quietest samples scatter" in f.message for f in findings.of("warning") if f.check == "noise")


def test_exchanged_columns_without_header_are_told(folder: Path) -> None:
    """Gyroscope and accelerometer exchanged where no header names them."""
    edit_rows(folder, "imu0", lambda row: [row[0], *row[4:7], *row[1:4]])
    path = folder / "mav0" / "imu0" / "data.csv"
    path.write_text("\n".join(path.read_text().splitlines()[1:]) + "\n")
    found = messages(check(folder), "error")
    assert any("in the last three columns" in message for message in found), found


# Case 13
def test_accelerometer_of_the_wrong_sign_is_told_by_propagation(folder: Path) -> None:
    """A sensor that measures -g upwards at rest: its norm is right, the world is upside down."""
    edit_rows(folder, "imu0", scale(slice(4, 7), -1.0))
    found = messages(check(folder), "error")
    assert any("accelerometer must measure +9.8 m/s^2 upwards" in message for message in found), found


# Case 14
@pytest.mark.parametrize(
    ("order", "words"),
    [([1, 2, 3, 0], "look like x y z w"), ([0, -1, -2, -3], "look like world-to-body")],
    ids=["xyzw", "inverse"],
)
def test_quaternions_in_another_convention_are_told_from_rotation(
    folder: Path, order: list[int], words: str
) -> None:
    """Unit quaternions under a good header, in the wrong order or direction."""

    def change(row: list[str]) -> list[str]:
        q = [float(text) for text in row[4 - 0 : 8]]
        row[4:8] = [repr(q[abs(k)] * (-1.0 if k < 0 else 1.0)) for k in order]
        return row

    edit_rows(folder, TRUTH, change)
    found = messages(check(folder), "error")
    assert any("[truth rotation]" in message and words in message for message in found), found


def test_quaternion_off_unit_length_is_refused_with_its_line(folder: Path) -> None:
    edit_rows(folder, TRUTH, scale(slice(4, 5), 1.01))
    found = messages(check(folder), "error")
    assert re.search(r"data\.csv, row \d+, q: quaternion must have unit length", " ".join(found)), found


# The known flaw of a published ground truth: an orientation that is off by about a degree.
def test_truth_whose_orientation_is_off_by_a_degree_is_warned_of(folder: Path) -> None:
    """A constant turn of the body axes of the truth, which its positions do not show."""
    turn = so3.exp(np.radians([0.0, 1.2, 0.0]))

    def change(row: list[str]) -> list[str]:
        q = so3.quaternion(so3.from_quaternion(np.array(row[4:8], dtype=float)) @ turn)
        row[4:8] = [repr(float(x)) for x in q]
        return row

    edit_rows(folder, TRUTH, change)
    found = check(folder)
    assert found.exit_status == 1
    assert any("its turns have axes 1.2" in message for message in messages(found, "warning")), found.lines()


# The known flaw of another: positions that jump.
def test_jump_of_the_truth_is_warned_of(folder: Path) -> None:
    """Millimetres between two samples, which enter every error and show in no plot."""
    rows = 0

    def change(row: list[str]) -> list[str]:
        nonlocal rows
        rows += 1
        if rows > 300:
            row[1] = repr(float(row[1]) + 0.004)
        return row

    assert check(folder).facts[TRUTH]["steps"] == []
    edit_rows(folder, TRUTH, change)
    found = check(folder)
    assert found.exit_status == 1
    (message,) = messages(found, "warning")
    assert "jumps 1 times between samples, by up to 4.0 mm" in message
    assert len(found.facts[TRUTH]["steps"]) == 1


def edit_columns(folder: Path, change: Callable[[np.ndarray], None]) -> None:
    """Change the numbers after the stamp of every row of the truth, in place."""

    def edit(row: list[str]) -> list[str]:
        values = np.array(row[1:], dtype=float)
        change(values)
        return [row[0], *(repr(float(x)) for x in values)]

    edit_rows(folder, TRUTH, edit)


def _exchanged(row: np.ndarray) -> None:
    row[10:16] = np.concatenate([row[13:16], row[10:13]])


def _in_body(row: np.ndarray) -> None:
    row[7:10] = so3.from_quaternion(row[3:7]).T @ row[7:10]


def _times(columns: slice, factor: float) -> Callable[[np.ndarray], None]:
    def change(row: np.ndarray) -> None:
        row[columns] *= factor

    return change


@pytest.fixture
def inertial_folder(folder: Path) -> Path:
    """The same recording without cameras, which is checked in no time."""
    for camera in ("cam0", "cam1"):
        shutil.rmtree(folder / "mav0" / camera)
    return folder


def test_inertial_sensor_and_truth_are_checked_without_images(inertial_folder: Path) -> None:
    """Errors for cameras that nobody has; or checks that do not need them left out."""
    program = run_program(inertial_folder)
    assert program.returncode == 0 and "not checked: images" in program.stdout, program.stdout
    facts = check(inertial_folder).facts
    assert facts["imu0"]["gravity_mps2"] == pytest.approx(9.81, abs=0.8)
    assert facts[TRUTH]["gyro_axes_deg"] < 0.1 and facts[TRUTH]["frames_outside"] == 0
    edit_rows(inertial_folder, TRUTH, lambda row: [*row[:4], *row[5:8], row[4], *row[8:]])
    assert run_program(inertial_folder).returncode == 2


def test_mocap_of_poses_only_is_checked_and_said(inertial_folder: Path) -> None:
    """A truth of TUM-VI's passed over, or its missing columns taken for zeros."""
    mav = inertial_folder / "mav0"
    edit_rows(inertial_folder, TRUTH, lambda row: row[:8])
    (mav / TRUTH).rename(mav / "mocap0")
    found = check(inertial_folder)
    assert found.exit_status == 0, found.lines()
    facts = found.facts["mocap0"]
    assert not facts["velocities"] and not facts["biases"] and facts["gyro_axes_deg"] < 0.1
    assert "velocities are derived from its positions" in found.skipped["columns of mocap0"]
    edit_rows(inertial_folder, "mocap0", lambda row: [*row[:4], *row[5:8], row[4]])
    assert check(inertial_folder).exit_status == 2


def test_fisheye_recording_is_checked(fisheye_folder: Path, tmp_path: Path) -> None:
    """A good recording refused for its lens; and the wrong lens, which bends every ray, not noticed."""
    found = check(fisheye_folder)
    assert found.exit_status == 0, found.lines()
    assert found.facts["calibration"]["epipolar_px"] < 0.5
    spoilt = Path(shutil.copytree(fisheye_folder, tmp_path / "fisheye"))
    for name in ("cam0", "cam1"):
        path = spoilt / "mav0" / name / "sensor.yaml"
        path.write_text(path.read_text().replace("equidistant", "radial-tangential"))
    assert check(spoilt).exit_status == 2


def test_recording_of_one_camera_is_checked(fisheye_folder: Path, tmp_path: Path) -> None:
    """A second camera asked for that nobody has; or turns, clocks and axes not compared without it."""
    one = Path(shutil.copytree(fisheye_folder, tmp_path / "one"))
    shutil.rmtree(one / "mav0" / "cam1")
    found = check(one)
    assert found.exit_status == 0, found.lines()
    assert "the inertial sensor alone has to tell the scale" in found.skipped["stereo"]
    assert found.facts["camera against gyro"]["scale"] == pytest.approx(1.0, abs=0.05)
    edit_rows(one, "imu0", scale(slice(1, 4), 2.5))
    (message,) = messages(check(one, truths=[]), "error")
    assert "[gyro units]" in message


def test_window_without_images_counts_from_the_first_sample(inertial_folder: Path) -> None:
    found = check(inertial_folder, window=Window(start_s=1.0, end_s=2.5))
    assert found.exit_status == 0, found.lines()
    (message,) = messages(check(inertial_folder, window=Window(start_s=100.0)), "error")
    assert "[window] 0 samples of imu0" in message


@pytest.mark.parametrize(
    ("spacings_ms", "words"),
    [((1, 9), "1 to 9 ms apart, 5 ms"), ((1, 1, 4), "1 to 4 ms apart, 2 ms"), ((2, 2, 2, 14), "2 to 14 ms")],
    ids=str,
)
def test_samples_in_bursts_are_warned_of(
    inertial_folder: Path, spacings_ms: tuple[int, ...], words: str
) -> None:
    """Stamps of arrival, whose mean rate is right and whose every step is wrong; no gap is made of them."""
    total, rows = sum(spacings_ms), iter(range(10**6))

    def change(row: list[str]) -> list[str]:
        k = next(rows)
        late = k // len(spacings_ms) * total + sum(spacings_ms[: k % len(spacings_ms)])
        row[0] = str(START_NS - 1_000_000_000 + late * 1_000_000)
        return row

    edit_rows(inertial_folder, "imu0", change)
    path = inertial_folder / "mav0" / "imu0" / "sensor.yaml"
    path.write_text(path.read_text().replace("rate_hz: 200", f"rate_hz: {1e3 * len(spacings_ms) / total:g}"))
    found = check(inertial_folder, truths=[])
    (message,) = messages(found, "warning")
    assert "[imu bursts]" in message and words in message
    assert found.exit_status == 1, found.lines()
    assert found.facts["imu0"]["rate_hz"] == pytest.approx(1e3 * len(spacings_ms) / total, rel=1e-6)


def test_a_second_of_bursts_is_found_in_a_steady_recording(inertial_folder: Path) -> None:
    """A median that says that most of the recording is well."""

    def change(row: list[str]) -> list[str]:
        t = int(row[0])
        if 0 <= t - START_NS < 1_000_000_000 and t // 5_000_000 % 2:
            row[0] = str(t - 4_000_000)
        return row

    edit_rows(inertial_folder, "imu0", change)
    (message,) = messages(check(inertial_folder, truths=[]), "warning")
    assert "[imu bursts]" in message and re.search("in [12] of [45] s", message), message


@pytest.mark.parametrize(
    ("column", "words"),
    [(1, "the gyroscope's x axis"), (3, "the gyroscope's z axis"), (5, "the accelerometer's y axis")],
    ids=["gyro x", "gyro z", "accel y"],
)
def test_flat_tops_of_a_saturated_sensor_are_told(inertial_folder: Path, column: int, words: str) -> None:
    """Turns cut off at the range of the sensor: every value is possible, their integral is not."""
    table = np.loadtxt(inertial_folder / "mav0" / "imu0" / "data.csv", delimiter=",")
    largest = float(np.quantile(table[:, column], 0.95))

    def change(row: list[str]) -> list[str]:
        row[column] = repr(min(float(row[column]), largest))
        return row

    edit_rows(inertial_folder, "imu0", change)
    found = messages(check(inertial_folder, truths=[]), "error")
    assert len(found) == 1 and f"[saturated] {words} stands at {largest:.4g}" in found[0], found


def test_inertial_sensor_that_hangs_is_told(inertial_folder: Path) -> None:
    """A driver that repeats its last sample under new stamps."""
    held: list[str] = []

    def change(row: list[str]) -> list[str]:
        nonlocal held
        if 0 <= int(row[0]) - START_NS <= 100_000_000:
            held = held or row[1:]
            return [row[0], *held]
        return row

    edit_rows(inertial_folder, "imu0", change)
    (message,) = messages(check(inertial_folder, truths=[]), "error")
    assert f"repeats all six values 21 times from {START_NS} ns on" in message


@pytest.mark.parametrize(
    ("change", "check_name", "words"),
    [
        (_exchanged, "truth biases", "gyroscope and accelerometer look exchanged"),
        (_times(slice(10, 13), -1.0), "truth biases", "of the other sign"),
        (_times(slice(10, 16), 0.0), "truth biases", "they are zeros"),
        (_times(slice(10, 13), 180.0 / np.pi), "truth biases", "look like deg/s"),
        (_in_body, "truth velocity", "velocities in body axes"),
        (_times(slice(7, 10), 0.0), "truth velocity", "they are zeros"),
        (_times(slice(7, 10), 1e3), "truth velocity", "look 1e+03 times too large"),
    ],
    ids=["exchanged", "sign", "no biases", "deg/s", "body axes", "no velocities", "mm/s"],
)
def test_columns_of_the_truth_are_checked_before_they_are_trusted(
    inertial_folder: Path, change: Callable[[np.ndarray], None], check_name: str, words: str
) -> None:
    """Biases and velocities that pass for good ones, and bend every result."""
    edit_columns(inertial_folder, change)
    found = [message for message in messages(check(inertial_folder), "error") if f"[{check_name}]" in message]
    assert len(found) == 1 and words in found[0], found


def test_accelerometer_biases_that_are_off_are_warned_of(inertial_folder: Path) -> None:
    """Biases of the accelerometer alone, which no turn shows."""

    def change(row: np.ndarray) -> None:
        row[13:16] += [0.2, -0.1, 0.1]

    edit_columns(inertial_folder, change)
    (message,) = messages(check(inertial_folder), "warning")
    assert "[truth biases] the accelerometer biases of" in message and "the motion says" in message


def test_coarse_truth_is_named_and_left_as_it_is(inertial_folder: Path) -> None:
    """Every update of a position with two decimals counted as a jump, and taken out."""

    def change(row: np.ndarray) -> None:
        row[:3] = np.round(row[:3], 2)

    edit_columns(inertial_folder, change)
    found = messages(check(inertial_folder), "warning")
    assert any("[truth values]" in m and "given to 0.01 m only" in m for m in found), found
    assert not any("taken out before" in m for m in found), found


@pytest.mark.parametrize(("every", "missing"), [(1, 0), (10, 0), (20, 24)], ids=["200 Hz", "20 Hz", "10 Hz"])
def test_check_says_where_the_front_end_finds_no_truth(folder: Path, every: int, missing: int) -> None:
    """Truth whose stamps lie between those of the camera: good to 55 ms, refused beyond."""
    rows = iter(range(10**6))

    def change(row: list[str]) -> list[str] | None:
        row[0] = str(int(row[0]) + 1_500_000)
        return row if next(rows) % every == 0 else None

    edit_rows(folder, TRUTH, change)
    found = check(folder)
    assert found.facts[TRUTH]["frames_outside"] >= missing, found.lines()
    said = [m for m in messages(found, "error") + messages(found, "warning") if "does not cover" in m]
    assert len(said) == (missing > 0), found.lines()
    truth = read_ground_truth(folder / "mav0" / TRUTH)
    frames = read_sequence(folder).frames.t_ns
    if missing:
        with pytest.raises(DataError, match="states 55 ms apart"):
            truth.states_at(frames)
    else:
        assert len(truth.states_at(frames).p_W) == len(frames)


# Case 15
def test_inverted_extrinsics_are_told_by_the_images(folder: Path) -> None:
    """Body-to-camera where camera-to-body is meant: rigid, with the right baseline."""
    for camera in ("cam0", "cam1"):
        edit_pose(folder, camera, np.linalg.inv)
    found = messages(check(folder), "error")
    assert any("[extrinsics]" in message and "both T_BS look inverted" in message for message in found), found


def test_turned_rig_is_told_by_the_gyroscope(folder: Path) -> None:
    """Both cameras turned alike against the inertial sensor, which stereo cannot see."""
    turn = np.eye(4)
    turn[:3, :3] = so3.exp(np.array([0.0, 0.0, np.pi / 2.0]))
    for camera in ("cam0", "cam1"):
        edit_pose(folder, camera, lambda T: turn @ T)
    found = messages(check(folder), "error")
    assert any("[extrinsics] the camera turns about axes 90" in message for message in found), found


def test_exchanged_cameras_are_told_by_the_disparity(folder: Path) -> None:
    """Left and right exchanged: epipolar lines fit, and every point lies behind the cameras."""
    mav = folder / "mav0"
    first, second = (mav / name / "sensor.yaml" for name in ("cam0", "cam1"))
    a, b = first.read_text(), second.read_text()
    first.write_text(b)
    second.write_text(a)
    found = messages(check(folder), "error")
    assert any("cam0 and cam1 look exchanged" in message for message in found), found


def test_extrinsics_that_are_not_rigid_are_refused(folder: Path) -> None:
    edit_pose(folder, "cam0", lambda T: T * 1.01)
    found = messages(check(folder), "error")
    assert any("cam0/sensor.yaml, T_BS: must be a rigid transformation" in message for message in found)


@pytest.mark.parametrize(("factor", "status"), [(1000.0, 2), (3.0, 1)], ids=["mm", "wide"])
def test_baseline_out_of_range_is_told(folder: Path, factor: float, status: int) -> None:
    def change(T: np.ndarray) -> np.ndarray:
        T[:3, 3] *= factor
        return T

    for camera in ("cam0", "cam1"):
        edit_pose(folder, camera, change)
    found = check(folder)
    assert any(finding.check == "baseline" for finding in found.found), found.lines()
    assert found.exit_status == status


# Case 16
@pytest.mark.parametrize(("offset_ms", "status"), [(8, 1), (-40, 2)], ids=["warning", "error"])
def test_clock_offset_is_measured_and_the_setting_takes_it_out(
    folder: Path, offset_ms: int, status: int
) -> None:
    """Cameras stamped late or early, which bends trajectories without making a solve fail."""

    def change(row: list[str]) -> list[str]:
        row[0] = str(int(row[0]) - offset_ms * 1_000_000)
        return row

    for camera in ("cam0", "cam1"):
        edit_rows(folder, camera, change)
    found = check(folder)
    assert found.exit_status == status, found.lines()
    measured = found.facts["camera against gyro"]["offset_ms"]
    assert measured == pytest.approx(offset_ms, abs=2.5)
    assert any("[clock offset]" in m and "camera_time_offset_ns" in m for m in messages(found, "error")) or (
        status == 1
    )
    assert check(folder, camera_time_offset_ns=offset_ms * 1_000_000).exit_status == 0


# Case 17
def test_frames_without_partner_are_counted(folder: Path) -> None:
    dropped = [START_NS + 50_000_000 * k for k in (3, 4, 9)]
    edit_rows(folder, "cam1", lambda row: None if int(row[0]) in dropped else row)
    found = check(folder)
    assert found.exit_status == 1
    assert messages(found, "warning") == [
        "[missing frame] 3 frame(s) of cam0 have no frame of cam1 and are skipped; the first is "
        f"{dropped[0]} ns"
    ]


# Case 18
def test_images_that_cannot_be_read_are_named(folder: Path) -> None:
    """Corrupt, truncated, wrong size, wrong depth: one sentence each, with the file."""
    for spoil, words in (
        (lambda path: replace_image(path, b"not an image"), "must be a whole PNG or JPEG file"),
        (lambda path: replace_image(path, path.read_bytes()[:5000]), "must be a whole PNG or JPEG file"),
        (lambda path: redraw(path, lambda image: image[:100]), "must be 752 x 480 pixels"),
        (
            lambda path: redraw(path, lambda image: image.astype(np.uint16)),
            "must use the upper 8 of its 16 bits",
        ),
    ):
        path = image_files(folder, "cam0")[0]
        kept = path.read_bytes()
        spoil(path)
        found = messages(check(folder), "error")
        assert any(str(path.name) in message and words in message for message in found), found
        replace_image(path, kept)


# Case 19
def test_frozen_camera_is_told(folder: Path) -> None:
    """The same image under new stamps."""
    files = image_files(folder, "cam0")
    for later in files[10:14]:
        replace_image(later, files[9].read_bytes())
    (message,) = messages(check(folder), "error")
    assert (
        f"4 image(s) of cam0 are the same file as the one before; the first is {files[10].stem} ns" in message
    )


def test_image_that_hangs_while_the_gyroscope_turns_is_told(folder: Path) -> None:
    """One image all the time, encoded anew with its own noise: no two files are equal."""
    first = cv2.imread(str(image_files(folder, "cam0")[0]), cv2.IMREAD_UNCHANGED)
    rng = np.random.default_rng(0)
    for path in image_files(folder, "cam0"):
        noise = rng.integers(-2, 3, first.shape)
        redraw(path, lambda _, noise=noise: np.clip(first + noise, 0, 255).astype(np.uint8))
    for path in image_files(folder, "cam1")[1:]:
        replace_image(path, image_files(folder, "cam1")[0].read_bytes())
    edit_rows(folder, "imu0", scale(slice(1, 4), 4.0))
    found = messages(check(folder), "error")
    assert any("images stand still while the gyroscope turns" in message for message in found), found


@pytest.mark.parametrize(("shift", "words"), [(1, "1 frame(s) earlier"), (-1, "1 frame(s) later")])
def test_cam1_that_slips_a_frame_midway_is_told(folder: Path, shift: int, words: str) -> None:
    """Half of the recording with another moment in the right image, and a median that sees the good half."""
    files = image_files(folder, "cam1")
    data = [file.read_bytes() for file in files]
    middle = len(files) // 2 - 4
    for k in range(middle, len(files)):
        replace_image(files[k], data[min(k + shift, len(files) - 1)])
    found = check_sequence(folder, effort=Effort(stereo_frames=5, turns=4))
    slips = [m for m in messages(found, "error") if "[stereo] the images of cam1 belong to other frames" in m]
    assert len(slips) == 1 and words in slips[0], found.lines()
    first = int(re.search(r"first seen at (\d+) ns", slips[0])[1])
    assert first >= int(files[middle].stem)


def test_repeated_images_of_cam1_are_told(folder: Path) -> None:
    """A right camera that hangs, which no look at the left one shows."""
    files = image_files(folder, "cam1")
    for later in files[10:12]:
        replace_image(later, files[9].read_bytes())
    found = messages(check(folder), "error")
    assert any(
        f"2 image(s) of cam1 are the same file as the one before; the first is {files[10].stem} ns" in m
        for m in found
    ), found


# Case 20
def test_cameras_exposed_differently_are_warned_of(folder: Path) -> None:
    for path in image_files(folder, "cam1"):
        redraw(path, lambda image: (image * 0.5).astype(np.uint8))
    found = check(folder)
    assert found.exit_status == 1
    assert any("exposed differently" in message for message in messages(found, "warning"))
    assert found.facts["images"]["stereo_matches"] > 50


# Case 21
def test_images_without_features_are_told(folder: Path) -> None:
    for camera in ("cam0", "cam1"):
        for path in image_files(folder, camera):
            redraw(path, lambda image: (image // 64 + 20).astype(np.uint8))
    found = messages(check(folder), "error")
    assert any("[images]" in message and "too dark" in message for message in found), found


# Stillness, of case 23
def test_standing_still_is_told(folder: Path) -> None:
    """One image with fresh noise, a resting sensor: nothing gets parallax."""
    rng = np.random.default_rng(0)
    for camera in ("cam0", "cam1"):
        first = cv2.imread(str(image_files(folder, camera)[0]), cv2.IMREAD_UNCHANGED)
        for path in image_files(folder, camera):
            noise = rng.integers(-2, 3, first.shape)
            redraw(path, lambda _, noise=noise, first=first: np.clip(first + noise, 0, 255).astype(np.uint8))

    def rest(row: list[str]) -> list[str]:
        noise = rng.normal(size=6) * [0.002, 0.002, 0.002, 0.03, 0.03, 0.03]
        values = np.array([-0.002, 0.021, 0.077, 9.81, 0.1, 0.05]) + noise
        return [row[0], *(repr(float(x)) for x in values)]

    edit_rows(folder, "imu0", rest)
    found = check(folder, truths=[])
    (message,) = messages(found, "error")
    assert "standing still" in message and "no covariance" in message
    assert found.facts["imu0"]["gravity_found"] == "at rest"
    assert found.facts["imu0"]["gravity_mps2"] == pytest.approx(9.81, abs=0.02)


def pairs_of(moving: np.ndarray) -> tuple[Turns, np.ndarray, int]:
    """Pairs of frames 0.5 s apart, which turn by 0.1 rad and move by 20 px, or rest."""
    first = START_NS + 500_000_000 * np.arange(len(moving), dtype=np.int64)
    phi = np.where(moving[:, None], [0.1, -0.05, 0.02], 0.0) * np.sin(np.arange(len(moving)))[:, None]
    return Turns(first, first + 200_000_000, phi, np.eye(3)), np.where(moving, 20.0, 0.2), len(moving)


@pytest.mark.parametrize(
    ("moving", "window"),
    [
        (np.arange(24) < 14, "0.00 6.70"),
        (np.arange(24) >= 14, "7.00 11.70"),
        (np.arange(24) % 12 < 5, "0.00 2.20"),
    ],
    ids=["moves 7 s, rests 5 s", "rests 7 s, moves 5 s", "rests most of the time, moves twice"],
)
def test_part_that_moves_is_proposed_as_a_window(moving: np.ndarray, window: str) -> None:
    """A recording refused as standing still since it rests for a part of the time."""
    t_ns = START_NS + 5_000_000 * np.arange(-200, 2600, dtype=np.int64)
    gyro = GyroRotation(ImuSamples(t_ns, np.zeros((2800, 3)), np.zeros((2800, 3))))
    nothing = Rest(0.4, np.empty((0, 3)), np.empty((0, 3)))
    out = Findings("flight")
    check_motion(*pairs_of(moving), gyro, nothing, START_NS, out)
    (message,) = [m for m in messages(out, "warning") if "[standing still]" in m]
    assert f"is --window {window}: choose it" in message
    assert not [m for m in messages(out, "error") if "standing still" in m]
    still = Findings("flight")
    check_motion(*pairs_of(moving & False), gyro, nothing, START_NS, still)
    assert "nothing moves" in messages(still, "error")[0]


@pytest.mark.parametrize(("keep", "status"), [(1, 0), (5, 0), (24, 2)])
def test_frames_too_far_apart_are_refused_with_the_spacing_that_would_do(
    folder: Path, keep: int, status: int
) -> None:
    """Frames between which the view turns away, and an error that blames images or calibration."""
    rows = {START_NS + 50_000_000 * k for k in range(0, 49, keep)}
    for camera in ("cam0", "cam1"):
        edit_rows(folder, camera, lambda row: row if int(row[0]) in rows else None)
    # The same flight, faster: what counts is how far the camera turns.
    edit_rows(folder, "imu0", scale(slice(1, 4), 3.0 if keep == 24 else 1.0))
    found = [m for m in messages(check(folder, truths=[]), "error") if "[frame spacing]" in m]
    assert len(found) == (status == 2), found
    assert status < 2 or re.search(r"2 of 2 neighbouring .* a frame every 0\.[125]+ s would do", found[0]), (
        found
    )


def test_everything_that_is_wrong_is_said_at_once(folder: Path) -> None:
    """A report that stops at the first of three faults."""
    (folder / "mav0" / "cam0" / "sensor.yaml").unlink()
    edit_rows(folder, "imu0", scale(slice(4, 7), 1.0 / 9.81))
    edit_rows(folder, "cam1", lambda row: [row[0], "../" + row[1]])
    found = check(folder)
    assert {finding.check for finding in found.of("error")} == {"calibration", "imu0", "frames"}
    assert found.skipped


@pytest.mark.euroc
def test_flaw_of_a_published_truth_is_found_from_data(euroc_root: Path) -> None:
    """V1_01_easy: the published orientation is off, the re-estimated one is not."""
    found = check_sequence(euroc_root / "V1_01_easy")
    about = [f.message for f in found.of("warning") if f.check == "truth rotation"]
    published = euroc_root / "V1_01_easy" / "mav0" / TRUTH
    if (published.parent / "state_groundtruth_openvins0").is_dir():
        assert found.facts["state_groundtruth_openvins0"]["gyro_axes_deg"] < 0.1
    assert len(about) == 1 and TRUTH in about[0]
    assert not found.of("error")
    # MH_01: nothing but the jumps that its positions are known for.
    other = check_sequence(euroc_root / "MH_01_easy")
    assert {f.check for f in other.of("warning")} == {"truth steps"}
    assert not other.of("error")


@pytest.mark.euroc
def test_excerpt_before_the_take_off_stands_still(euroc_root: Path) -> None:
    if not (euroc_root / "V1_01_easy_static").is_dir():
        pytest.skip("this root has no V1_01_easy_static")
    found = check_sequence(euroc_root / "V1_01_easy_static")
    assert [f.check for f in found.of("error")] == ["standing still"]


def test_images_that_are_read_do_not_grow_with_the_recording(
    good_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A check that takes as long as the recording."""
    read: list[Path] = []

    def counting(path: Path, camera: object) -> np.ndarray:
        read.append(path)
        return read_image(path, camera)  # type: ignore[arg-type]

    monkeypatch.setattr("vigauge.recordings.checks.vision.read_image", counting)
    check_sequence(good_folder, effort=Effort(stereo_frames=2, turns=3))
    assert 0 < len(read) <= 2 * 4 + 3 * 3
