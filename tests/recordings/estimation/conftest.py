"""An estimate of the rendered flight, made once, from a copy that has no ground truth."""

import os
import shutil
from pathlib import Path

import pytest

from vigauge.recordings import Estimate, estimate

KEYFRAMES = 7


def copy_of(folder: Path, target: Path) -> Path:
    """The rendered flight by hard links, without its truth."""
    ignore = shutil.ignore_patterns("state_groundtruth_*")
    return Path(shutil.copytree(folder, target, copy_function=os.link, ignore=ignore))


@pytest.fixture
def folder(rendered, tmp_path: Path) -> Path:
    """A copy that a test may spoil file by file: unlink, then write anew."""
    return copy_of(rendered.folder, tmp_path / "flight")


@pytest.fixture(scope="session")
def made(rendered, tmp_path_factory: pytest.TempPathFactory) -> Estimate:
    return estimate(copy_of(rendered.folder, tmp_path_factory.mktemp("made") / "flight"), keyframes=KEYFRAMES)
