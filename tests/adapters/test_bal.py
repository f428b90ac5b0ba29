"""BAL files through the adapter, against residuals differenced as BAL's page defines them."""

from pathlib import Path

import numpy as np
import pytest

import vigauge as vg
from benchmarks.long_double import pseudo_inverse
from support.foreign_files import CAMERAS, POINTS, Adjustment
from vigauge.adapters import bal


@pytest.fixture
def adjustment() -> Adjustment:
    return Adjustment()


@pytest.mark.parametrize("intrinsics", [True, False])
def test_cameras_and_points(tmp_path: Path, intrinsics: bool) -> None:
    """Catches a sign of the camera's axis, a transposed rotation, an order of columns, lost digits.

    The oracle has 18 digits. An SVD in double of a differenced Jacobian agrees with both to 1e-6 only: its
    null vectors are as good as the differences, and are taken out of the covariance.
    """
    adjustment = Adjustment(cameras=10, points=60)
    found = bal.covariance(adjustment.write(tmp_path / "bal.txt"), sigma=0.5, intrinsics=intrinsics)
    J, T = adjustment.jacobian() / 0.5, adjustment.null_space()
    if not intrinsics:
        known = [9 * n + k for n in range(10) for k in (6, 7, 8)]
        J, T = np.delete(J, known, axis=1), np.delete(T, known, axis=0)
    expected = pseudo_inverse(J, T)
    assert found.open == vg.Similarity().directions
    sigmas = np.sqrt(np.diagonal(expected))
    assert np.abs((found.matrix() - expected) / np.outer(sigmas, sigmas)).max() < 1e-10
    known = found.in_gauge((vg.KeyframeGauge(1), vg.Distance(1, 3)))
    assert np.abs(known.block(1, 1)[:6, :6]).max() < 1e-9 * known.block(3, 3)[:3, :3].max()
    assert known.landmarks(keys=[7]).shape == (1, 3, 3)


@pytest.mark.parametrize(
    ("line", "text", "words"),
    [
        (1, "4 25", "must start with the numbers of cameras, points and observations"),
        (1, "4 25.5 100", "points: must be a whole number, 1 or more"),
        (1, "4 25 1000000000", "must have .* numbers, as its first line says"),
        (9, "4 7 1.0 2.0", r"camera: must be an index in 0..3 \(found 4"),
        (9, "0 -1 1.0 2.0", r"point: must be an index in 0..24 \(found -1"),
        (9, "0 1 1.0 two", r"must be a finite number \(found 'two'\)"),
    ],
)
def test_broken_files_are_refused(
    tmp_path: Path, adjustment: Adjustment, line: int, text: str, words: str
) -> None:
    path = adjustment.write(tmp_path / "bal.txt")
    lines = path.read_text().splitlines()
    lines[line - 1] = text
    path.write_text("\n".join(lines))
    with pytest.raises(vg.DataError, match=words) as refused:
        bal.covariance(path)
    assert refused.value.file == str(path) and refused.value.row in (line, None)


def test_a_point_seen_once_is_named_with_its_line(tmp_path: Path, adjustment: Adjustment) -> None:
    path = adjustment.write(tmp_path / "bal.txt")
    lines = path.read_text().splitlines()
    for n in range(1, CAMERAS):  # its other sights go to point 8
        lines[1 + n * POINTS + 3] = lines[1 + n * POINTS + 3].replace(" 3 ", " 8 ", 1)
    path.write_text("\n".join(lines))
    with pytest.raises(vg.DataError, match="point 3: must have two observations") as refused:
        bal.covariance(path)
    assert lines[refused.value.row - 1] == repr(float(adjustment.X[3, 0]))
