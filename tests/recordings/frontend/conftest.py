"""A short rendered sequence with exact truth, made once for all tests of the front-end."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import pytest

from vigauge.recordings.asl.ground_truth import GroundTruth, read_ground_truth
from vigauge.recordings.asl.sequence import Sequence, read_sequence
from vigauge_paper.stand_in.asl_folder import write_asl_folder
from vigauge_paper.stand_in.rendering import RenderedSequence, RenderSettings, render_sequence


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
