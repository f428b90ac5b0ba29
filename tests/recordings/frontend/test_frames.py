"""Frames that are of no use: skipped and counted, or the segment is refused with numbers."""

import os
import shutil
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from vigauge.errors import DataError
from vigauge.recordings.asl.ground_truth import read_ground_truth
from vigauge.recordings.asl.sequence import Sequence, read_sequence
from vigauge.recordings.frontend.build import build_problem
from vigauge.recordings.frontend.frames import choose_frames
from vigauge.recordings.frontend.settings import FrontEndSettings
from vigauge_paper.stand_in.asl_folder import write_asl_folder
from vigauge_paper.stand_in.rendering import START_NS, RenderSettings, render_sequence

PERIOD_NS = 50_000_000


def settings(tracker: str = "optical_flow", count: int = 5, **keyframes: object) -> FrontEndSettings:
    return FrontEndSettings.from_mapping({"tracker": tracker, "keyframes": {"count": count, **keyframes}})


@pytest.fixture
def folder(rendered, tmp_path: Path) -> Path:
    """A copy of the rendered sequence whose files may be replaced."""

    def copy(source: str, target: str) -> None:
        (os.link if source.endswith(".png") else shutil.copy2)(source, target)

    return Path(shutil.copytree(rendered.folder, tmp_path / "room", copy_function=copy))


def darken(folder: Path, camera: str, frames: list[int]) -> None:
    files = sorted((folder / "mav0" / camera / "data").glob("*.png"))
    for k in frames:
        image = cv2.imread(str(files[k]), cv2.IMREAD_UNCHANGED)
        files[k].unlink()
        assert cv2.imwrite(str(files[k]), (image // 32).astype(np.uint8))


def test_good_frames_are_left_alone(rendered) -> None:
    sequence, keyframes, skipped = choose_frames(rendered.sequence, settings())
    assert np.array_equal(sequence.frames.t_ns, rendered.sequence.frames.t_ns)
    assert sequence.frames.left == rendered.sequence.frames.left
    assert len(keyframes) == 5
    assert set(skipped.values()) == {0}


@pytest.mark.parametrize("camera", ["cam0", "cam1"])
@pytest.mark.parametrize("tracker", ["optical_flow", "descriptors"])
def test_dark_frames_are_skipped_and_counted(folder: Path, camera: str, tracker: str) -> None:
    """A keyframe that sees nothing, which would break the chain of poses."""
    before = choose_frames(read_sequence(folder), settings(tracker))[1].tolist()
    dark = before[2]
    darken(folder, camera, [dark])
    sequence, keyframes, skipped = choose_frames(read_sequence(folder), settings(tracker))
    assert skipped == {"no right image": 0, "no contrast": 1}
    assert START_NS + dark * PERIOD_NS not in sequence.frames.t_ns
    assert len(keyframes) == 5


def test_front_end_goes_on_over_a_dark_frame(folder: Path, rendered) -> None:
    """A frame that is skipped in the choice but still breaks the tracks."""
    darken(folder, "cam0", [15])
    darken(folder, "cam1", [15])
    options = settings(count=7)
    problem, _, report = build_problem(read_sequence(folder), rendered.truth, options)
    assert report.frames_skipped == {"no right image": 0, "no contrast": 1}
    assert report.frames == 30 and problem.initial.n_keyframes == 7
    assert min(report.tracks_per_keyframe) > 30


def test_too_many_dark_frames_refuse_the_segment(folder: Path) -> None:
    darken(folder, "cam0", list(range(10, 14)))
    with pytest.raises(
        DataError, match=r"at most 3 frames between \d+ and \d+ ns may be skipped \(4 with no"
    ):
        choose_frames(read_sequence(folder), settings(most_skipped=3))


def test_missing_right_images_are_counted_in_the_window_only(folder: Path) -> None:
    """Frames lost elsewhere in the recording refusing a segment that is whole."""
    path = folder / "mav0" / "cam1" / "data.csv"
    lost = [START_NS + k * PERIOD_NS for k in (2, 3, 12, 13, 20)]
    lines = [line for line in path.read_text().splitlines() if line.split(",")[0] not in map(str, lost)]
    path.write_text("\n".join(lines) + "\n")
    sequence = read_sequence(folder)
    _, _, skipped = choose_frames(sequence, settings(window_start_s=0.4))
    assert skipped == {"no right image": 3, "no contrast": 0}
    with pytest.raises(DataError, match="3 with no right image"):
        choose_frames(sequence, settings(window_start_s=0.4, most_skipped=2))


@pytest.mark.parametrize("tracker", ["optical_flow", "descriptors"])
def test_frozen_camera_refuses_the_segment(folder: Path, rendered, tracker: str) -> None:
    """Identical images while the inertial sensor moves: tracks that stand still pull the estimate."""
    options = settings(tracker)
    first, second = choose_frames(rendered.sequence, options)[1][1:3].tolist()
    files = sorted((folder / "mav0" / "cam0" / "data").glob("*.png"))
    frozen = range(first + 1, second + 1)
    for k in frozen:
        files[k].unlink()
        shutil.copy(files[first], files[k])
    with pytest.raises(DataError, match="successive images must differ"):
        build_problem(read_sequence(folder), rendered.truth, options)


def test_camera_clock_setting_undoes_an_offset(rendered) -> None:
    """An offset applied with the wrong sign, or to the keyframes but not to their inertial factors."""
    frames = rendered.sequence.frames
    late: Sequence = replace(rendered.sequence, frames=replace(frames, t_ns=frames.t_ns + 30_000_000))
    mapping = {"tracker": "descriptors", "keyframes": {"count": 4}, "descriptors": {"features": 500}}
    told = FrontEndSettings.from_mapping(mapping | {"camera_time_offset_ns": -30_000_000})
    exact, t_ns, _ = build_problem(rendered.sequence, rendered.truth, FrontEndSettings.from_mapping(mapping))
    undone, t_undone, _ = build_problem(late, rendered.truth, told)
    assert np.array_equal(t_ns, t_undone)
    assert np.array_equal(exact.initial.p_W, undone.initial.p_W)
    assert np.array_equal(exact.inertial.dp, undone.inertial.dp)


def test_recording_of_nothing_but_still_frames_is_refused(tmp_path: Path) -> None:
    """A front-end that gives a problem without parallax."""
    folder = tmp_path / "still"
    write_asl_folder(render_sequence("room", RenderSettings(seed=3, duration_s=0.5)), "room", folder, {})
    for camera in ("cam0", "cam1"):
        files = sorted((folder / "mav0" / camera / "data").glob("*.png"))
        first = cv2.imread(str(files[0]), cv2.IMREAD_UNCHANGED)
        for k, path in enumerate(files[1:]):
            noise = np.random.default_rng(k).integers(-2, 3, first.shape)
            assert cv2.imwrite(str(path), np.clip(first + noise, 0, 255).astype(np.uint8))
    sequence = read_sequence(folder)
    truth = read_ground_truth(folder / "mav0" / "state_groundtruth_estimate0")
    with pytest.raises(DataError, match=r"some landmark must pass the checks .* [1-9]\d* parallax"):
        build_problem(sequence, truth, settings())
