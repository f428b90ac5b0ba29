"""A rendered recording through a fisheye, made once for all tests of recordings."""

from __future__ import annotations

from pathlib import Path

import pytest

from vigauge_paper.stand_in.asl_folder import write_asl_folder
from vigauge_paper.stand_in.rendering import RenderSettings, render_sequence


@pytest.fixture(scope="session")
def fisheye_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """2 s of flight through the room at 10 Hz, seen by TUM-VI's lenses."""
    folder = tmp_path_factory.mktemp("fisheye") / "room"
    settings = RenderSettings(
        seed=7, duration_s=2.0, frame_spacing_min_s=0.1, frame_spacing_max_s=0.1, lens="equidistant"
    )
    write_asl_folder(render_sequence("room", settings), "room", folder, versions={})
    return folder
