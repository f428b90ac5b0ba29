"""The examples, and the Python of the README, as a reader runs them."""

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import vigauge as vg
from support import ROOT, foreign

EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
SNIPPETS = re.findall(
    r"^```python\n(.*?)^```", (ROOT / "README.md").read_text("utf-8"), re.MULTILINE | re.DOTALL
)


def printed(code: str, folder: Path) -> str:
    """What a script prints, run from an empty folder with warnings as errors."""
    environment = os.environ | {"PYTHONPATH": str(ROOT / "src")}
    command = [sys.executable, "-W", "error", "-c", code]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def numbers_of(text: str) -> list[float]:
    return [float(number) for number in re.findall(r"(?<![\w.])-?\d+(?:\.\d*)?(?:e[-+]\d+)?", text)]


def example(name: str, folder: Path) -> list[str]:
    return printed((ROOT / "examples" / name).read_text("utf-8"), folder).splitlines()


def test_from_arrays(tmp_path: Path) -> None:
    first, second = example("from_arrays.py", tmp_path)
    assert re.fullmatch(r"function tolerance: 76 landmarks, 366 pixels, [4-8] iterations", first)
    np.testing.assert_allclose(numbers_of(second), [0.0461, 0.0102, 0.0071], rtol=0.01)


def test_my_hessian(tmp_path: Path) -> None:
    first, second = example("my_hessian.py", tmp_path)
    np.testing.assert_allclose(numbers_of(first)[1:], [0.05949, 0.05845, 0.05477, 0.01065], rtol=1e-3)
    assert numbers_of(second)[-1] < 1e-12


def test_right_increments(tmp_path: Path) -> None:
    (line,) = example("right_increments.py", tmp_path)
    assert numbers_of(line)[-1] < 1e-9


def test_ellipsoids(tmp_path: Path) -> None:
    """Catches ellipsoids of another gauge, and a picture that is not written."""
    pytest.importorskip("matplotlib", reason="needs Matplotlib")
    first, _, centroid, _ = example("ellipsoids.py", tmp_path)
    np.testing.assert_allclose(numbers_of(first), [0.0, 0.0823], rtol=0.02, atol=1e-4)
    np.testing.assert_allclose(numbers_of(centroid), [0.0432, 0.0419], rtol=0.02)
    assert (tmp_path / "ellipsoids.png").stat().st_size > 10_000


def test_gnss_factor(tmp_path: Path) -> None:
    rows = [numbers_of(line) for line in example("gnss_factor.py", tmp_path)]
    assert [row[:2] for row in rows] == [[0, 4], [1, 1], [2, 0]]
    np.testing.assert_allclose([row[2] for row in rows], [0.0028, 0.0264, 0.0153], rtol=0.02)


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.name)
def test_examples_are_short_and_tested(path: Path) -> None:
    assert len(path.read_text("utf-8").splitlines()) < 40
    assert f'example("{path.name}"' in Path(__file__).read_text("utf-8")


def test_python_of_the_readme_runs(tmp_path: Path) -> None:
    """Catches a call in the README that the library no longer has, or that needs a file; other numbers."""
    first, own = SNIPPETS
    shown = first.splitlines()[-1]
    np.testing.assert_allclose(numbers_of(printed(first, tmp_path)), numbers_of(shown), rtol=1e-3)
    layout = vg.Layout.by_keyframe(6, ["position", "rotation", "velocity"], side="right")
    at, _, J = foreign.problem(layout, vg.YawTranslation(), np.random.default_rng(7))
    names = {"np": np, "vg": vg, "H": J.T @ J, "R": at.R, "p": at.p, "v": at.v}
    exec(own, names)
    assert np.linalg.eigvalsh(names["block"]).min() > 0.0
    assert np.abs(names["covariance"].block(0, 0, vg.KeyframeGauge(0))[:3, :3]).max() < 1e-12
