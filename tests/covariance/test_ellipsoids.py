"""Ellipsoids of covariances: by their quadratic form, and what they refuse."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import vigauge as vg


@pytest.fixture
def blocks() -> np.ndarray:
    A = np.random.default_rng(3).standard_normal((5, 6, 6))
    return A @ A.swapaxes(1, 2)


def test_points_of_the_surface_are_k_sigmas_away(blocks: np.ndarray) -> None:
    """Catches axes as rows instead of columns, variances instead of sigmas, a mirror for a rotation."""
    found, centres = vg.ellipsoids(blocks, k=2.5), np.arange(15.0).reshape(5, 3)
    x = (found.surfaces(centres, 7) - centres[:, :, None, None]).reshape(5, 3, -1)
    squares = np.einsum("nik,nij,njk->nk", x, np.linalg.inv(blocks[:, :3, :3]), x)
    np.testing.assert_allclose(squares, 2.5**2)
    np.testing.assert_allclose(np.linalg.det(found.rotations), 1.0)
    np.testing.assert_allclose(Rotation.from_quat(found.quaternions).as_matrix(), found.rotations, atol=1e-12)
    assert np.all(np.diff(found.semi_axes) <= 0.0)


def test_a_keyframe_that_is_held_is_a_point() -> None:
    problem = vg.example_problem()
    blocks = vg.Covariance.of(problem, problem.initial).keyframes(vg.KeyframeGauge(4))
    lengths = vg.ellipsoids(blocks).semi_axes[:, 0]
    assert lengths[4] < 1e-6 * lengths.max() and np.delete(lengths, 4).min() > 1e-4 * lengths.max()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda C: C[0], "must have shape"),
        (lambda C: C[:, :2, :2], "must have shape"),
        (lambda C: C[:, :4], "must have shape"),
        (lambda C: -C, "must have no negative eigenvalue"),
        (lambda C: C + np.triu(np.ones(6), 1), "must be symmetric"),
        (lambda C: np.where(C[1, 0, 0] == C, np.nan, C), "must be finite"),
    ],
)
def test_what_is_no_covariance_is_refused(blocks: np.ndarray, change: object, words: str) -> None:
    with pytest.raises(vg.DataError, match=words):
        vg.ellipsoids(change(blocks))
    with pytest.raises(vg.DataError, match="k: must be positive"):
        vg.ellipsoids(blocks, k=0.0)
