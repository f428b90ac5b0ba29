"""A rendered recording with exact truth, and copies of it to spoil."""

import os
import shutil
from pathlib import Path

import pytest

from vigauge_paper.stand_in.asl_folder import write_asl_folder
from vigauge_paper.stand_in.rendering import RenderSettings, render_sequence


def _copy(source: str, target: str) -> str:
    """Images are linked, since a test replaces them as a whole; text is copied, to be edited."""
    if source.endswith(".png"):
        os.link(source, target)
        return target
    return shutil.copy2(source, target)


@pytest.fixture(scope="session")
def good_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """2.4 s of lively motion at 20 Hz, inertial data and truth at 200 Hz for a second more at both ends."""
    folder = tmp_path_factory.mktemp("checks") / "flight"
    write_asl_folder(
        render_sequence("room", RenderSettings(seed=5, duration_s=2.4)), "room", folder, versions={}
    )
    return folder


@pytest.fixture
def folder(good_folder: Path, tmp_path: Path) -> Path:
    """A copy that a test may spoil."""
    return Path(shutil.copytree(good_folder, tmp_path / "flight", copy_function=_copy))
