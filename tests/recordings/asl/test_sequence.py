"""A whole ASL folder: read as it is, refused with file and line when any part of it is bad."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from support.asl import FRAME_NS, IMU_NS
from vigauge.errors import DataError
from vigauge.recordings.asl.ground_truth import read_ground_truth
from vigauge.recordings.asl.images import read_image
from vigauge.recordings.asl.sequence import read_imu, read_sequence


def change(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


def refused(folder: Path) -> DataError:
    with pytest.raises(DataError) as caught:
        read_sequence(folder)
    return caught.value


def test_valid_folder_is_read_whole(sequence_folder):
    """Catches cameras exchanged, columns exchanged, or frames lost."""
    sequence = read_sequence(sequence_folder)
    assert sequence.name == "flight"
    assert sequence.frames.t_ns.tolist() == FRAME_NS
    assert len(sequence.frames.dropped_ns) == 0
    assert [p.parent.parent.name for p in (sequence.frames.left[0], sequence.frames.right[0])] == [
        "cam0",
        "cam1",
    ]
    assert sequence.imu.t_ns.tolist() == IMU_NS
    assert sequence.imu.gyro[3].tolist() == [0.1, -0.2, 0.3]
    assert sequence.imu.accel[3].tolist() == [9.7, 0.4, 0.03]
    assert sequence.n_repeated_imu == 0
    assert [camera.p_BC[0] for camera in sequence.cameras] == [0.0, 0.11]
    image = read_image(sequence.frames.right[2], sequence.cameras[1])
    assert image.shape == (30, 40)


def test_folder_without_cam1_is_of_one_camera(sequence_folder):
    """Catches a second camera made up, or frames counted as lost for want of a partner."""
    shutil.rmtree(sequence_folder / "mav0" / "cam1")
    sequence = read_sequence(sequence_folder)
    assert len(sequence.cameras) == 1 and sequence.frames.right == ()
    assert sequence.frames.t_ns.tolist() == FRAME_NS and len(sequence.frames.dropped_ns) == 0


def test_folder_without_mav0_is_refused(tmp_path):
    """Catches a traceback about some file deep inside where the folder itself is wrong."""
    assert "mav0" in refused(tmp_path / "nowhere").file
    assert "mav0" in refused(tmp_path).file


@pytest.mark.parametrize(
    "name",
    [
        "cam0/sensor.yaml",
        "cam0/data.csv",
        "cam1/sensor.yaml",
        "cam1/data.csv",
        "imu0/data.csv",
        "imu0/sensor.yaml",
    ],
)
def test_each_missing_file_is_named(sequence_folder, name):
    (sequence_folder / "mav0" / name).unlink()
    error = refused(sequence_folder)
    assert error.file == str(sequence_folder / "mav0" / name)
    assert error.rule == "file must exist"


def test_missing_image_is_named_by_its_line(sequence_folder):
    """Catches a gap in the download that shows only when the front-end comes to it."""
    (sequence_folder / "mav0" / "cam1" / "data" / f"{FRAME_NS[2]}.png").unlink()
    error = refused(sequence_folder)
    assert error.file.endswith("cam1/data.csv")
    assert (error.row, error.value) == (4, f"{FRAME_NS[2]}.png")


@pytest.mark.parametrize(
    "name",
    ["../../imu0/data.csv", "/etc/hostname", "..\\x.png", "a/../../x.png", "C:\\x.png", "C:x.png", "\\x.png"],
)
def test_image_name_outside_the_data_folder_is_refused(sequence_folder, name):
    """Catches a file list that makes the reader open any file of the machine."""
    change(sequence_folder / "mav0" / "cam0" / "data.csv", f"{FRAME_NS[1]}.png", name)
    error = refused(sequence_folder)
    assert "inside the data folder" in error.rule
    assert (error.row, error.value) == (3, name)


def test_image_in_a_folder_below_and_behind_a_link_is_read(sequence_folder):
    """Catches the guard above refusing what is meant: sub-folders, and links that the user made."""
    data = sequence_folder / "mav0" / "cam0" / "data"
    (data / "part").mkdir()
    (data / "part" / "one.png").symlink_to(data / f"{FRAME_NS[1]}.png")
    change(data.parent / "data.csv", f"{FRAME_NS[1]}.png", "part/one.png")
    assert read_sequence(sequence_folder).frames.left[1] == data / "part" / "one.png"


def test_left_frames_without_a_right_one_are_dropped_and_counted(sequence_folder):
    """Catches pairs shifted by one after a missing frame."""
    path = sequence_folder / "mav0" / "cam1" / "data.csv"
    change(path, f"{FRAME_NS[1]},{FRAME_NS[1]}.png\n", "")
    frames = read_sequence(sequence_folder).frames
    assert frames.dropped_ns.tolist() == [FRAME_NS[1]]
    assert frames.t_ns.tolist() == [FRAME_NS[0], FRAME_NS[2], FRAME_NS[3]]
    assert [p.name for p in frames.left] == [p.name for p in frames.right]


def test_stereo_stamps_may_differ_by_rounding(sequence_folder):
    path = sequence_folder / "mav0" / "cam1" / "data.csv"
    change(path, f"{FRAME_NS[1]},", f"{FRAME_NS[1] + 256},")
    frames = read_sequence(sequence_folder).frames
    assert (len(frames.dropped_ns), frames.right[1].name) == (0, f"{FRAME_NS[1]}.png")


def test_cameras_without_a_common_stamp_are_refused(sequence_folder):
    path = sequence_folder / "mav0" / "cam1" / "data.csv"
    rows = path.read_text().splitlines()
    path.write_text("\n".join([rows[0], *(f"{t + 25_000_000},{t}.png" for t in FRAME_NS)]))
    assert "share stamps" in refused(sequence_folder).rule


def test_cameras_at_one_place_are_refused(sequence_folder):
    """Catches a calibration file copied twice: stereo without a baseline has no depth."""
    mav = sequence_folder / "mav0"
    shutil.copy(mav / "cam0" / "sensor.yaml", mav / "cam1" / "sensor.yaml")
    assert refused(sequence_folder).field == "T_BS"


def test_repeated_inertial_rows_are_counted(sequence_folder):
    path = sequence_folder / "mav0" / "imu0" / "data.csv"
    rows = path.read_text().splitlines()
    path.write_text("\n".join([*rows[:5], rows[4], *rows[5:]]))
    sequence = read_sequence(sequence_folder)
    assert (len(sequence.imu.t_ns), sequence.n_repeated_imu) == (len(IMU_NS), 1)


def rewrite_imu(folder: Path, change_row) -> None:
    """Apply a function to the list of values of every inertial row."""
    path = folder / "mav0" / "imu0" / "data.csv"
    header, *rows = path.read_text().splitlines()
    split = [row.split(",") for row in rows]
    path.write_text("\n".join([header, *(",".join([r[0], *map(str, change_row(r[1:]))]) for r in split)]))


def test_accelerometer_in_g_is_refused(sequence_folder):
    rewrite_imu(sequence_folder, lambda r: [*r[:3], *(float(a) / 9.81 for a in r[3:])])
    assert "m/s^2" in refused(sequence_folder).rule


def test_gyroscope_and_accelerometer_exchanged_are_refused(sequence_folder):
    """Catches exchanged columns, by their values and by their header."""
    rewrite_imu(sequence_folder, lambda r: [*r[3:], *r[:3]])
    assert "last three columns" in refused(sequence_folder).rule
    change(sequence_folder / "mav0" / "imu0" / "data.csv", "w_RS_S_x", "a_RS_S_x")
    assert refused(sequence_folder).field == "header"


@pytest.mark.parametrize(
    "names",
    [
        "ang_vel_{},lin_acc_{}",
        "angular_velocity_{},linear_acceleration_{}",
        "field.angular_velocity.{},field.linear_acceleration.{}",
        "gyro_{} [rad/s],accel_{} [m/s^2]",
        "omega_{},f_{}",
    ],
)
def test_imu_columns_have_names_in_many_spellings(sequence_folder, names):
    """Catches an angular velocity refused because its name begins with an a, and exchanged ones let pass."""
    path = sequence_folder / "mav0" / "imu0" / "data.csv"
    rows = path.read_text().splitlines()[1:]
    gyro, accel = (",".join(name.format(axis) for axis in "xyz") for name in names.split(","))
    path.write_text("\n".join([f"#timestamp,{gyro},{accel}", *rows]))
    assert len(read_imu(path)[0].t_ns) == 40
    path.write_text("\n".join([f"#timestamp,{accel},{gyro}", *rows]))
    with pytest.raises(DataError, match="columns must be stamp, angular velocity") as caught:
        read_imu(path)
    assert (caught.value.row, caught.value.field) == (1, "header")


def test_gyroscope_in_degrees_is_refused_when_it_shows(sequence_folder):
    rewrite_imu(sequence_folder, lambda r: [60.0, *r[1:]])
    error = refused(sequence_folder)
    assert "rad/s" in error.rule
    assert error.row == 2


@pytest.mark.euroc
@pytest.mark.parametrize(("name", "n_frames"), [("MH_01_easy", 2), ("V1_01_easy", 2)])
def test_real_sequences_are_read(euroc_root, name, n_frames):
    """Catches what only the dataset's own files have: %YAML:1.0, JPEG names, 8 and 17 columns."""
    sequence = read_sequence(euroc_root / name)
    assert len(sequence.frames.t_ns) >= n_frames
    assert abs(np.linalg.norm(sequence.cameras[1].p_BC - sequence.cameras[0].p_BC) - 0.11) < 0.001
    assert (sequence.imu_noise.gyro_density, sequence.imu_noise.accel_density) == (1.6968e-4, 2e-3)
    assert sequence.imu.period() == pytest.approx(0.005, abs=1e-6)
    for paths, camera in zip((sequence.frames.left, sequence.frames.right), sequence.cameras, strict=True):
        assert read_image(paths[0], camera).std() > 20.0
    truths = sorted((sequence.folder / "mav0").glob("state_groundtruth_*"))
    assert truths
    for folder in truths:
        truth = read_ground_truth(folder)
        inside = (sequence.frames.t_ns > truth.t_ns[0]) & (sequence.frames.t_ns < truth.t_ns[-1])
        assert np.all(
            np.abs(truth.t_ns[truth.nearest(sequence.frames.t_ns[inside])] - sequence.frames.t_ns[inside])
            <= 256
        )
