"""A scratch project that shares the sources, and one smoke run of the whole pipeline in it."""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from recovery.kill import TIMEOUT_S, make_project

Run = Callable[..., subprocess.CompletedProcess[str]]


def snakemake(
    folder: Path, *arguments: str, smoke: bool = True, **environment: str
) -> subprocess.CompletedProcess[str]:
    """Run Snakemake in a project, without EuRoC unless ``environment`` says otherwise."""
    env = {key: value for key, value in os.environ.items() if key not in ("EUROC_ROOT", "PYTHONPATH")}
    command = [sys.executable, "-m", "snakemake", "--cores", "2", *arguments]
    if smoke:
        command += ["--configfile", "config/smoke.yaml"]
    return subprocess.run(
        command, cwd=folder, env=env | environment, capture_output=True, text=True, timeout=TIMEOUT_S
    )


@pytest.fixture(scope="session")
def smoke_project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A project in which the smoke pipeline has run. Tests must leave its results as they are."""
    folder = make_project(tmp_path_factory.mktemp("smoke") / "project")
    done = snakemake(folder)
    assert done.returncode == 0, done.stderr[-5000:]
    return folder


@pytest.fixture
def scratch_project(smoke_project: Path, tmp_path: Path) -> Path:
    """A copy of the smoke project, results and Snakemake's records included, to change at will."""
    return Path(shutil.copytree(smoke_project, tmp_path / "project", symlinks=True))
