"""The wheel: what is in it, what it needs, and what its user's type checker and Python say."""

import email
import json
import os
import shutil
import subprocess
import sys
import sysconfig
import venv
import zipfile
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from support import ROOT
from vigauge import __version__

METADATA = f"vigauge-{__version__}.dist-info"

SCRIPT = '''\
"""A user's script."""

import numpy as np
from numpy.typing import NDArray

import vigauge as vg


def estimate(problem: vg.Problem, gauge: vg.Gauge) -> vg.Solution:
    return vg.solve(problem, gauge, vg.Options(maximum_iterations=30, threads=1))


def sigmas(problem: vg.Problem, state: vg.State) -> NDArray[np.float64]:
    covariance = vg.motion_covariance(problem, state, vg.FreeGauge())
    moved, _ = vg.transform_covariance(covariance, state, vg.FixedGauge(), problem.initial)
    return np.sqrt(np.diagonal(moved))


problem: vg.Problem = vg.example_problem()
solution = estimate(problem, vg.PriorGauge(weight=1e5))
status: vg.Status = solution.status
first: vg.Iteration = solution.trace[0]
diagnosis: vg.Diagnosis = vg.diagnose(problem, solution.state)
noise = vg.ImuNoise(gyro_density=1e-3, accel_density=1e-2)
try:
    print(status, first.cost, diagnosis.sentence, sigmas(problem, solution.state)[:3])
except (vg.DegenerateError, vg.DataError) as error:
    message: str = str(error)
'''

# What an install of the library alone does not bring.
ABSENT = ("cv2", "pycolmap", "yaml", "tqdm", "pandas", "matplotlib", "snakemake")
PLAIN = f"""
import json, sys
sys.modules.update(dict.fromkeys({ABSENT}))  # None: as if not installed
import vigauge as vg
problem = vg.example_problem()
solution = vg.solve(problem, vg.FreeGauge())
covariance = vg.motion_covariance(problem, solution.state, vg.FixedGauge())
try:
    import vigauge.recordings
    told = ""
except vg.MissingExtraError as error:
    told = str(error)
print(json.dumps([vg.__file__, solution.converged, covariance.shape, told]))
"""


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory", folder]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    (built,) = folder.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def python(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Python of an environment that has the wheel; NumPy and the like are those of this environment."""
    folder = tmp_path_factory.mktemp("environment")
    venv.create(folder, with_pip=False, symlinks=True)
    site = Path(sysconfig.get_path("purelib", vars={"base": str(folder), "platbase": str(folder)}))
    pip = [sys.executable, "-m", "pip", "install", "--no-deps", "--no-index", "--target", site, wheel]
    subprocess.run(pip, check=True, capture_output=True)
    (site / "others.pth").write_text(sysconfig.get_path("purelib") + "\n", encoding="utf-8")
    # Kernels that were compiled from the same sources serve here too: a quarter of a minute less.
    for compiled in (ROOT / "src").rglob("*.nb[ci]"):
        place = site / compiled.relative_to(ROOT / "src")
        place.parent.mkdir(exist_ok=True)
        shutil.copy(compiled, place)
    return folder / "bin" / "python"


def environment() -> dict[str, str]:
    """Without the paths that lead to the sources."""
    return {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "MYPYPATH")}


def strict(script: str, python: Path, folder: Path) -> tuple[int, str]:
    """Exit status and words of `mypy --strict` on a script, with the wheel as it is installed."""
    (folder / "script.py").write_text(script, encoding="utf-8")
    flags = ["--strict", "--config-file=", f"--python-executable={python}", f"--cache-dir={python.parent}"]
    done = subprocess.run(
        [sys.executable, "-m", "mypy", *flags, "script.py"],
        cwd=folder,
        env=environment(),
        capture_output=True,
        text=True,
    )
    return done.returncode, done.stdout + done.stderr


def test_the_wheel_holds_the_library_and_nothing_else(wheel: Path) -> None:
    names = zipfile.ZipFile(wheel).namelist()
    assert {name.split("/")[0] for name in names} == {"vigauge", METADATA}
    sources = {p.relative_to(ROOT / "src").as_posix() for p in (ROOT / "src" / "vigauge").rglob("*.py")}
    others = {"vigauge/__init__.pyi", "vigauge/py.typed", "vigauge/example.npz", "vigauge/example_biases.npz"}
    assert {name for name in names if name.startswith("vigauge/")} == sources | others


def test_the_wheel_needs_four_packages(wheel: Path) -> None:
    """Catches a dependency of the artifact that everybody who installs the library would get."""
    metadata = email.message_from_bytes(zipfile.ZipFile(wheel).read(f"{METADATA}/METADATA"))
    needs = map(Requirement, metadata.get_all("Requires-Dist", []))
    plain = {need.name for need in needs if need.marker is None or need.marker.evaluate({"extra": ""})}
    assert plain == {"numpy", "scipy", "numba", "threadpoolctl"}


def test_a_strict_script_passes(python: Path, tmp_path: Path) -> None:
    status, words = strict(SCRIPT, python, tmp_path)
    assert status == 0, words


@pytest.mark.parametrize(
    ("right", "wrong", "word"),
    [
        ("vg.diagnose(", "vg.diagnoze(", "attr-defined"),
        ("vg.PriorGauge(weight=1e5)", "vg.PriorGauge(weight='1e5')", "arg-type"),
        ("vg.diagnose(problem, solution.state)", "vg.diagnose(problem, solution)", "arg-type"),
        (
            "estimate(problem, vg.PriorGauge",
            "estimate(problem, vg.ImuNoise(1, 1)); (vg.PriorGauge",
            "arg-type",
        ),
    ],
)
def test_a_strict_script_with_a_mistake_fails(
    python: Path, tmp_path: Path, right: str, wrong: str, word: str
) -> None:
    """Catches public names that are Any to a type checker."""
    assert right in SCRIPT
    status, words = strict(SCRIPT.replace(right, wrong), python, tmp_path)
    assert status == 1 and f"[{word}]" in words, words


def test_the_library_works_without_the_extras(python: Path, tmp_path: Path) -> None:
    done = subprocess.run(
        [python, "-c", PLAIN], cwd=tmp_path, env=environment(), capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    place, converged, shape, told = json.loads(done.stdout)
    assert Path(place).is_relative_to(python.parents[1]), "the sources were imported, not the wheel"
    assert converged and shape == [90, 90]
    assert "pip install vigauge[recordings]" in told
