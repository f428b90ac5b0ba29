"""Copies of a rendered recording to spoil."""

import os
import shutil
from pathlib import Path

import pytest


def _copy(source: str, target: str) -> str:
    """Images are linked, since a test replaces them as a whole; text is copied, to be edited."""
    if source.endswith(".png"):
        os.link(source, target)
        return target
    return shutil.copy2(source, target)


@pytest.fixture
def folder(good_folder: Path, tmp_path: Path) -> Path:
    """A copy that a test may spoil."""
    return Path(shutil.copytree(good_folder, tmp_path / "flight", copy_function=_copy))
