"""A recording through a bag and back: every stamp, pixel and number where it was."""

import subprocess
import sys
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml

from support.bags import Messages, Row
from vigauge.errors import DataError
from vigauge.recordings.asl.calibration import read_camera
from vigauge.recordings.asl.ground_truth import read_ground_truth
from vigauge.recordings.asl.images import read_image
from vigauge.recordings.asl.kalibr import camera_chain, imu_description
from vigauge.recordings.asl.rosbag import TRUTH_FOLDER, Imported, Topics, import_rosbag
from vigauge.recordings.asl.sequence import Sequence, read_sequence

START_NS = 1_600_000_000_123_456_789
SHIFT_NS = 2_500_000
TOPICS = Topics("/cam0/image_raw", "/cam1/image_raw", "/imu0", "/truth")
BIASES = np.array([0.01, 0.02, 0.03]), np.array([0.1, 0.2, 0.3])
R = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]


class WithoutAnchors(yaml.SafeDumper):
    """Kalibr writes every matrix out, also one that two cameras share."""

    def ignore_aliases(self, data: object) -> bool:
        return True


def kalibr_files(
    folder: Path,
    cam1: Mapping[str, Any] | None = None,
    imu: Mapping[str, Any] | None = None,
    mono: bool = False,
    **changes: Any,
) -> tuple[Path, Path]:
    """camchain and imu.yaml; body to camera as Kalibr has it: x_C = R x_B + (0.05, 0.02, 0.01)."""
    camera = {
        "camera_model": "pinhole",
        "distortion_coeffs": [-0.28, 0.07, 2e-4, 1.7e-5],
        "distortion_model": "radtan",
        "intrinsics": [30.0, 31.0, 19.5, 14.5],
        "resolution": [40, 30],
        "timeshift_cam_imu": SHIFT_NS * 1e-9,
    }
    T_C0B = [[*R[0], 0.05], [*R[1], 0.02], [*R[2], 0.01], [0.0, 0.0, 0.0, 1.0]]
    T_C1C0 = [[1.0, 0.0, 0.0, -0.11], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
    chain = {"cam0": camera | {"T_cam_imu": T_C0B} | changes}
    if not mono:
        chain["cam1"] = camera | {"T_cn_cnm1": T_C1C0} | dict(cam1 or {})
    noise = {
        "gyroscope_noise_density": 1.7e-4,
        "gyroscope_random_walk": 2e-5,
        "accelerometer_noise_density": 2e-3,
        "accelerometer_random_walk": 3e-3,
        "update_rate": 200.0,
        **(imu or {}),
    }
    paths = folder / "camchain.yaml", folder / "imu.yaml"
    for path, content in zip(paths, (chain, noise), strict=True):
        path.write_text(yaml.dump(content, Dumper=WithoutAnchors))
    return paths


def picture(k: int, camera: int) -> np.ndarray:
    return np.random.default_rng(10 * camera + k).integers(0, 256, (30, 40), dtype=np.uint8)


Change = Callable[[list[Row], dict[str, Any]], list[Row]]


@pytest.fixture(params=["ROS1_NOETIC", "ROS2_HUMBLE"])
def bag(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    return write_bag(tmp_path, request.param)


def write_bag(folder: Path, release: str = "ROS2_HUMBLE", change: Change = lambda rows, types: rows) -> Path:
    """4 stereo frames, 40 inertial samples, 20 poses; arrival times differ from the headers' stamps.

    ``change`` spoils the messages before they are written.
    """
    messages = Messages(release)
    rows: list[Row] = []
    for k in range(4):
        t_ns = START_NS + 50_000_000 * k
        for camera, topic in enumerate((TOPICS.left, str(TOPICS.right))):
            rows.append((t_ns, topic, messages.image(t_ns, picture(k, camera), padding=8)))
    for k in range(40):
        t_ns = START_NS + 5_000_000 * k
        rows.append((t_ns, TOPICS.imu, messages.imu(t_ns, (0.1, -0.2, k / 100), (9.7, 0.4, 1 / 3))))
    for k in range(20):
        t_ns = START_NS + 10_000_000 * k
        pose = messages.pose(t_ns, (0.5 * k * 0.01, 1.0, 2.0), (0.6, 0.0, 0.0, 0.8))
        rows.append((t_ns, str(TOPICS.truth), pose))
    return messages.write(folder / "flight", change(rows, messages.types))


def convert(bag: Path, tmp_path: Path, topics: Topics = TOPICS) -> Sequence:
    camchain, imu_yaml = kalibr_files(tmp_path, mono=topics.right is None)
    biases = BIASES if topics.truth else ()
    import_rosbag(bag, topics, camchain, imu_yaml, tmp_path / "asl" / "flight", *biases)
    return read_sequence(tmp_path / "asl" / "flight")


def test_bag_becomes_the_recording_that_it_holds(bag: Path, tmp_path: Path) -> None:
    """Arrival times for stamps, a lost digit, padding in images, axes exchanged, an inverted T_BS."""
    sequence = convert(bag, tmp_path)
    assert sequence.frames.t_ns.tolist() == [START_NS + SHIFT_NS + 50_000_000 * k for k in range(4)]
    assert sequence.imu.t_ns.tolist() == [START_NS + 5_000_000 * k for k in range(40)]
    assert sequence.imu.gyro[7].tolist() == [0.1, -0.2, 0.07]
    assert sequence.imu.accel[7].tolist() == [9.7, 0.4, 1 / 3]
    for camera, paths in enumerate((sequence.frames.left, sequence.frames.right)):
        for k, path in enumerate(paths):
            assert np.array_equal(read_image(path, sequence.cameras[camera]), picture(k, camera))
    left, right = sequence.cameras
    np.testing.assert_allclose(left.R_BC, np.array(R).T)
    np.testing.assert_allclose(left.p_BC, -np.array(R).T @ [0.05, 0.02, 0.01], atol=1e-15)
    # The right camera sits 0.11 m along the left one's x axis.
    np.testing.assert_allclose(left.R_BC.T @ (right.p_BC - left.p_BC), [0.11, 0.0, 0.0], atol=1e-15)
    assert sequence.imu_noise.gyro_density == 1.7e-4


def test_bag_of_one_camera_becomes_a_recording_of_one(bag: Path, tmp_path: Path) -> None:
    """A second camera that is asked for though neither bag nor calibration has one."""
    sequence = convert(bag, tmp_path, replace(TOPICS, right=None))
    assert len(sequence.cameras) == 1 and len(sequence.frames.t_ns) == 4 and sequence.frames.right == ()
    assert np.array_equal(read_image(sequence.frames.left[1], sequence.cameras[0]), picture(1, 0))
    assert not (tmp_path / "asl" / "flight" / "mav0" / "cam1").exists()


@pytest.mark.parametrize(("right", "mono"), [(None, False), (TOPICS.right, True)])
def test_cameras_of_the_topics_and_of_the_camchain_must_be_as_many(
    tmp_path: Path, right: str | None, mono: bool
) -> None:
    """A camera that is dropped without a word, or one without calibration."""
    error = refusal(write_bag(tmp_path), tmp_path, replace(TOPICS, right=right), mono=mono)
    assert (error.file, error.field) == (str(tmp_path / "camchain.yaml"), "cam1")


def test_truth_gets_velocities_and_known_biases(bag: Path, tmp_path: Path) -> None:
    convert(bag, tmp_path)
    truth = read_ground_truth(tmp_path / "asl" / "flight" / "mav0" / TRUTH_FOLDER)
    assert truth.v_W is not None and truth.gyro_bias is not None and truth.accel_bias is not None
    np.testing.assert_allclose(truth.v_W, np.tile([0.5, 0.0, 0.0], (20, 1)), atol=1e-12)
    assert truth.gyro_bias[3].tolist() == [0.01, 0.02, 0.03]
    assert truth.accel_bias[3].tolist() == [0.1, 0.2, 0.3]
    np.testing.assert_allclose(truth.R_WB[0] @ [0.0, 1.0, 0.0], [0.0, 0.28, 0.96], atol=1e-12)


def test_missing_topic_is_named_and_nothing_is_left(bag: Path, tmp_path: Path) -> None:
    with pytest.raises(DataError, match="must have the topic .*it has: /cam0/image_raw"):
        convert(bag, tmp_path, Topics("/left", TOPICS.right, TOPICS.imu))
    assert not list((tmp_path / "asl" / "flight").iterdir())


def test_recording_is_never_overwritten(bag: Path, tmp_path: Path) -> None:
    convert(bag, tmp_path)
    with pytest.raises(DataError, match="must not exist"):
        convert(bag, tmp_path)


def test_program_converts_and_refuses_in_one_line(bag: Path, tmp_path: Path) -> None:
    camchain, imu_yaml = kalibr_files(tmp_path)
    command = [sys.executable, "-m", "vigauge.cli.import_rosbag", "--camchain", str(camchain)]
    command += ["--imu-yaml", str(imu_yaml), "--output", str(tmp_path / "out"), "--truth", "/truth"]
    command += ["--gyro-bias", "0", "0", "0", "--accel-bias", "0", "0", "0", "--bag"]
    done = subprocess.run([*command, str(bag)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "4 of /cam0/image_raw, 4 of /cam1/image_raw, 40 of /imu0, 20 of /truth" in done.stderr
    broken = tmp_path / "broken.bag"
    broken.write_bytes(b"#ROSBAG V2.0\nnothing else")
    command[command.index(str(tmp_path / "out"))] = str(tmp_path / "other")
    refused = subprocess.run([*command, str(broken)], capture_output=True, text=True, check=False)
    assert refused.returncode == 2, refused.stderr
    assert refused.stderr.startswith(f"error: {broken}: must be a readable bag")


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"camera_model": "omni"}, "cam0.camera_model"),
        ({"distortion_model": "fov"}, "cam0.distortion_model"),
        ({"T_cam_imu": [[1.0, 0.0], [0.0, 1.0]]}, "cam0.T_cam_imu"),
        ({"T_cam_imu": np.diag([1.0, 1.0, 2.0, 1.0]).tolist()}, "cam0.T_cam_imu"),
        ({"T_cam_imu": [*np.eye(4)[:3].tolist(), [0.0, 0.0, 0.0, 0.0]]}, "cam0.T_cam_imu"),
        ({"timeshift_cam_imu": 2.5e6}, "cam0.timeshift_cam_imu"),
    ],
)
def test_calibration_that_cannot_be_used_is_named(tmp_path: Path, changes: dict, field: str) -> None:
    """A fisheye read as a pinhole, or nanoseconds as seconds."""
    with pytest.raises(DataError) as caught:
        camera_chain(kalibr_files(tmp_path, **changes)[0])
    assert caught.value.field == field


def test_fisheye_of_a_camchain_stays_one(tmp_path: Path) -> None:
    """Catches a fisheye written as another lens, which reads without complaint and bends every ray."""
    path = tmp_path / "sensor.yaml"
    for model, lens in (("equidistant", "equidistant"), ("radtan", "radial-tangential")):
        chain = camera_chain(kalibr_files(tmp_path, distortion_model=model)[0])
        path.write_text(yaml.safe_dump(chain.descriptions[0]))
        camera = read_camera(path)
        assert (camera.lens, camera.distortion) == (lens, (-0.28, 0.07, 2e-4, 1.7e-5))


def test_missing_density_is_named(tmp_path: Path) -> None:
    path = kalibr_files(tmp_path)[1]
    path.write_text("gyroscope_noise_density: 1.0e-3\n")
    with pytest.raises(DataError, match="gyroscope_random_walk: must be given"):
        imu_description(path)


def test_colour_images_become_grey() -> None:
    """Red read as blue."""
    from types import SimpleNamespace

    from vigauge.recordings.asl.messages import grey

    colour = np.zeros((2, 3, 3), dtype=np.uint8)
    colour[:, :, 0] = 200
    message = SimpleNamespace(encoding="rgb8", height=2, width=3, step=9, data=colour.ravel())
    assert grey(Path("bag"), "/left", message)[0, 0] == cv2.cvtColor(colour, cv2.COLOR_RGB2GRAY)[0, 0] == 60
    message.encoding = "mono16"
    with pytest.raises(DataError, match="must be mono8"):
        grey(Path("bag"), "/left", message)


def imported(bag: Path, tmp_path: Path, topics: Topics = TOPICS, **kalibr: Any) -> Imported:
    camchain, imu_yaml = kalibr_files(tmp_path, **kalibr)
    return import_rosbag(bag, topics, camchain, imu_yaml, tmp_path / "asl" / "flight", *BIASES)


def refusal(bag: Path, tmp_path: Path, topics: Topics = TOPICS, **kalibr: Any) -> DataError:
    """The error, which names a file of the user's; nothing is left behind."""
    with pytest.raises(DataError) as caught:
        imported(bag, tmp_path, topics, **kalibr)
    assert caught.value.file in [str(bag), *(str(tmp_path / name) for name in ("camchain.yaml", "imu.yaml"))]
    assert not list((tmp_path / "asl").rglob("*.*"))
    return caught.value


def later_cam1(by_ns: int) -> Change:
    """cam1's clock is behind: its stamps are too small."""

    def change(rows: list[Row], types: dict[str, Any]) -> list[Row]:
        for _, topic, message in rows:
            if topic == TOPICS.right:
                message.header.stamp.nanosec -= by_ns
        return rows

    return change


def test_each_camera_is_moved_by_its_own_time_shift(tmp_path: Path) -> None:
    """cam0's shift for both, which leaves the right images without partners."""
    bag = write_bag(tmp_path, change=later_cam1(5_000_000))
    done = imported(bag, tmp_path, cam1={"timeshift_cam_imu": (SHIFT_NS + 5_000_000) * 1e-9})
    frames = read_sequence(tmp_path / "asl" / "flight").frames
    assert frames.t_ns.tolist() == [START_NS + SHIFT_NS + 50_000_000 * k for k in range(4)]
    assert [path.name for path in frames.right] == [path.name for path in frames.left]
    assert not done.notes


def test_time_shifts_that_differ_by_noise_keep_the_pairs(tmp_path: Path) -> None:
    done = imported(write_bag(tmp_path), tmp_path, cam1={"timeshift_cam_imu": SHIFT_NS * 1e-9 + 3e-5})
    assert len(read_sequence(tmp_path / "asl" / "flight").frames.t_ns) == 4
    assert "differ by 30 us, which is noise" in done.notes[0]


def test_cameras_that_the_shifts_take_apart_are_refused(tmp_path: Path) -> None:
    error = refusal(write_bag(tmp_path), tmp_path, cam1={"timeshift_cam_imu": SHIFT_NS * 1e-9 + 0.005})
    assert "must be triggered together" in error.rule and error.value == "0 pairs of 4"


@pytest.mark.parametrize(
    ("cam1", "field"),
    [
        ({"time_shift": 0.01}, "cam1.time_shift"),
        ({"T_cam_imu": np.eye(4).tolist()}, "cam1.T_cam_imu"),
        ({"rostopic": "/cam0/image_raw"}, "cam1.rostopic"),
        ({"intrinsics": [30.0, 31.0]}, "cam1, intrinsics"),
    ],
    ids=["unknown", "contradiction", "exchanged cameras", "in the written file"],
)
def test_key_of_a_camchain_without_effect_is_refused(tmp_path: Path, cam1: dict, field: str) -> None:
    """A key that is dropped, the second of two poses, cameras exchanged, a temporary file in the message."""
    error = refusal(write_bag(tmp_path), tmp_path, cam1=cam1)
    assert (error.file, error.field) == (str(tmp_path / "camchain.yaml"), field)


def test_time_shift_of_one_camera_alone_is_refused(tmp_path: Path) -> None:
    camchain = kalibr_files(tmp_path)[0]
    content = yaml.safe_load(camchain.read_text())
    del content["cam1"]["timeshift_cam_imu"]
    camchain.write_text(yaml.dump(content))
    with pytest.raises(DataError, match="cam1.timeshift_cam_imu: must be given for both cameras or for none"):
        camera_chain(camchain)


@pytest.mark.parametrize(
    ("imu", "field"),
    [
        ({"T_i_b": np.diag([1.0, -1.0, -1.0, 1.0]).tolist()}, "T_i_b"),
        ({"time_offset": 0.003}, "time_offset"),
        ({"model": "scale-misalignment"}, "model"),
        ({"gyroscopes": {"M": np.diag([1.0, 1.02, 1.0]).tolist()}}, "gyroscopes"),
        ({"gyro_noise_density": 1e-3}, "gyro_noise_density"),
    ],
)
def test_key_of_an_imu_yaml_without_effect_is_refused(tmp_path: Path, imu: dict, field: str) -> None:
    """A sensor that is turned, late or skew, and read as if it were not."""
    with pytest.raises(DataError) as caught:
        imu_description(kalibr_files(tmp_path, imu=imu)[1])
    assert caught.value.field == field


def test_identity_keys_of_an_imu_yaml_pass_and_the_rate_is_kept(tmp_path: Path) -> None:
    """What Kalibr writes of its reference sensor."""
    plain = {"T_i_b": np.eye(4).tolist(), "time_offset": 0.0, "model": "calibrated", "rostopic": "/imu0"}
    description, notes = imu_description(kalibr_files(tmp_path, imu=plain)[1])
    assert description["rate_hz"] == 200.0 and not notes


def test_density_in_degrees_is_warned_of_at_import(tmp_path: Path) -> None:
    done = imported(write_bag(tmp_path), tmp_path, imu={"gyroscope_noise_density": 1.7e-4 * 57.3})
    assert "gyroscope_noise_density is 0.00974" in done.notes[0] and "degrees" in done.notes[0]


def compressed(data: bytes, name: str = "jpeg") -> Change:
    """The third left image becomes a CompressedImage."""

    def change(rows: list[Row], types: dict[str, Any]) -> list[Row]:
        left = [row for row in rows if row[1] == TOPICS.left]
        for row in left:
            rows.remove(row)
        for k, (t, topic, message) in enumerate(left):
            content = (
                np.frombuffer(data, np.uint8) if k == 2 else cv2.imencode(".png", picture(0, 0))[1].ravel()
            )
            image = types["CompressedImage"](header=message.header, format=name, data=content)
            rows.append((t, topic, image))
        return rows

    return change


def damaged_jpeg() -> bytes:
    """A whole header and a proper end, and half of the rows between them."""
    data = cv2.imencode(".jpg", picture(0, 0))[1].tobytes()
    return data[: len(data) // 2] + b"\xff\xd9"


@pytest.mark.parametrize(
    ("data", "found"),
    [
        (cv2.imencode(".png", picture(0, 0).astype(np.uint16) << 8)[1].tobytes(), "uint16, 1 channels"),
        (cv2.imencode(".png", picture(0, 0).astype(np.uint16) << 4)[1].tobytes(), "uint16, 1 channels"),
        (cv2.imencode(".png", np.zeros((30, 40, 4), np.uint8))[1].tobytes(), "uint8, 4 channels"),
        (damaged_jpeg(), "Corrupt JPEG data: premature end of data segment"),
        (cv2.imencode(".png", picture(0, 0)[:20])[1].tobytes(), "40 x 20"),
    ],
    ids=["16 bits", "12 bits", "alpha", "damaged", "size"],
)
def test_compressed_image_that_would_change_is_refused(tmp_path: Path, data: bytes, found: str) -> None:
    """Bits cut off, or grey where the decoder found nothing."""
    error = refusal(write_bag(tmp_path, change=compressed(data)), tmp_path)
    assert (error.field, error.value) == (TOPICS.left, found)


def test_compressed_colour_becomes_grey(tmp_path: Path) -> None:
    colour = cv2.cvtColor(picture(2, 0), cv2.COLOR_GRAY2BGR)
    bag = write_bag(tmp_path, change=compressed(cv2.imencode(".png", colour)[1].tobytes(), "png"))
    imported(bag, tmp_path)
    sequence = read_sequence(tmp_path / "asl" / "flight")
    assert np.array_equal(read_image(sequence.frames.left[2], sequence.cameras[0]), picture(2, 0))


def restamped(topic: str, stamps_ns: dict[int, int]) -> Change:
    """Stamps of some messages of a topic, by their number."""

    def change(rows: list[Row], types: dict[str, Any]) -> list[Row]:
        chosen = [row for row in rows if row[1] == topic]
        for k, t_ns in stamps_ns.items():
            stamp = chosen[k][2].header.stamp
            stamp.sec, stamp.nanosec = divmod(t_ns, 10**9)
        return rows

    return change


@pytest.mark.parametrize(
    ("topic", "stamps_ns", "words"),
    [
        (TOPICS.left, dict.fromkeys(range(4), 0), "not zero (message 1)"),
        (TOPICS.imu, {7: 0}, "not zero (message 8)"),
        (TOPICS.right, {2: START_NS}, "two images must not have one stamp"),
        (str(TOPICS.truth), {3: START_NS}, "stamps must"),
    ],
    ids=["images", "inertial", "repeated image", "repeated pose"],
)
def test_stamp_that_is_zero_or_repeated_is_refused(
    tmp_path: Path, topic: str, stamps_ns: dict[int, int], words: str
) -> None:
    """Four images in one file."""
    error = refusal(write_bag(tmp_path, change=restamped(topic, stamps_ns)), tmp_path)
    assert error.file == str(tmp_path / "flight")
    assert str(error.field).startswith(topic) and words in error.rule


@pytest.mark.parametrize(
    "topics",
    [
        Topics(TOPICS.left, TOPICS.left, TOPICS.imu, TOPICS.truth),
        Topics(TOPICS.left, TOPICS.right, TOPICS.imu, TOPICS.imu),
    ],
)
def test_topic_given_twice_is_refused(tmp_path: Path, topics: Topics) -> None:
    """Both cameras see the same, and nothing has a depth."""
    assert "topics must differ" in refusal(write_bag(tmp_path), tmp_path, topics).rule


def test_topic_of_another_type_is_refused(tmp_path: Path) -> None:
    error = refusal(
        write_bag(tmp_path), tmp_path, Topics(TOPICS.imu, TOPICS.right, TOPICS.left, TOPICS.truth)
    )
    assert error.rule in ("must be Imu", "must be Image or CompressedImage")


def test_messages_out_of_order_are_counted_and_sorted(tmp_path: Path) -> None:
    def change(rows: list[Row], types: dict[str, Any]) -> list[Row]:
        """ROS 2 keeps them by arrival."""
        late = [k for k, row in enumerate(rows) if row[1] == TOPICS.imu][10:12]
        for k in late:
            rows[k] = (rows[k][0] + 41_000_000, *rows[k][1:])
        return rows

    done = imported(write_bag(tmp_path, change=change), tmp_path)
    assert done.notes == ("/imu0: 2 message(s) came after a later one and are sorted",)
    assert read_sequence(tmp_path / "asl" / "flight").imu.t_ns.tolist() == [
        START_NS + 5_000_000 * k for k in range(40)
    ]


@pytest.mark.parametrize(
    ("topics", "biases", "words"),
    [
        (TOPICS, (), "give both --gyro-bias and --accel-bias"),
        (TOPICS, (np.zeros(3),), "give both --gyro-bias and --accel-bias"),
        (Topics(TOPICS.left, TOPICS.right, TOPICS.imu), BIASES, "give its topic too"),
    ],
    ids=["none", "one", "no truth"],
)
def test_biases_are_neither_guessed_nor_dropped(
    tmp_path: Path, topics: Topics, biases: tuple, words: str
) -> None:
    """Zeros in a truth that the front-end takes as known."""
    with pytest.raises(DataError, match=words):
        import_rosbag(write_bag(tmp_path), topics, *kalibr_files(tmp_path), tmp_path / "out", *biases)
