"""Rendered recordings with exact truth, made once for all tests of recordings."""

from dataclasses import dataclass
from pathlib import Path

import pytest

from vigauge.recordings.asl.ground_truth import GroundTruth, read_ground_truth
from vigauge.recordings.asl.sequence import Sequence, read_sequence
from vigauge_paper.stand_in.asl_folder import write_asl_folder
from vigauge_paper.stand_in.rendering import RenderedSequence, RenderSettings, render_sequence


@pytest.fixture(scope="session")
def fisheye_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """2 s of flight through the room at 10 Hz, seen by TUM-VI's lenses."""
    folder = tmp_path_factory.mktemp("fisheye") / "room"
    settings = RenderSettings(
        seed=7, duration_s=2.0, frame_spacing_min_s=0.1, frame_spacing_max_s=0.1, lens="equidistant"
    )
    write_asl_folder(render_sequence("room", settings), "room", folder, versions={})
    return folder


@pytest.fixture(scope="session")
def good_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """2.4 s of lively motion at 20 Hz, inertial data and truth at 200 Hz for a second more at both ends."""
    folder = tmp_path_factory.mktemp("checks") / "flight"
    write_asl_folder(
        render_sequence("room", RenderSettings(seed=5, duration_s=2.4)), "room", folder, versions={}
    )
    return folder


@dataclass(frozen=True)
class RenderedFolder:
    """A sequence on disk, and the exact world that it shows."""

    exact: RenderedSequence
    folder: Path
    sequence: Sequence
    truth: GroundTruth


@pytest.fixture(scope="session")
def rendered(tmp_path_factory: pytest.TempPathFactory) -> RenderedFolder:
    """1.5 s of flight through the room at 20 Hz: 31 stereo frames."""
    folder = tmp_path_factory.mktemp("rendered") / "room"
    exact = render_sequence("room", RenderSettings(seed=7, duration_s=1.5))
    write_asl_folder(exact, "room", folder, versions={})
    truth = read_ground_truth(folder / "mav0" / "state_groundtruth_estimate0")
    return RenderedFolder(exact, folder, read_sequence(folder), truth)
