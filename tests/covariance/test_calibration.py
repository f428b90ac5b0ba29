"""NEES bands, and how well covariances are calibrated under a robust loss with outliers."""

import numpy as np
import pytest

import vigauge as vg
from vigauge.geometry import so3

HUBER = 1.0


def test_nees_of_right_and_of_small_covariances() -> None:
    """Catches a band on another count, or a rotation error on the wrong side."""
    rng = np.random.default_rng(1)
    half = rng.standard_normal((300, 6, 6)) * np.array([0.1, 0.1, 0.1, 0.01, 0.01, 0.01])[:, None]
    C = half @ half.swapaxes(1, 2)
    error = np.einsum("mij,mj->mi", half, rng.standard_normal((300, 6)))
    R, p = so3.exp(rng.normal(size=(300, 3))), rng.normal(size=(300, 3))
    estimate = so3.exp(error[:, 3:]) @ R, p + error[:, :3]
    right = vg.nees(estimate, (R, p), C)
    assert right.consistent and right.low < 1.0 < right.high
    np.testing.assert_array_equal(right.degrees_of_freedom, 6.0)
    small = vg.nees(estimate, (R, p), C / 1.5**2)
    np.testing.assert_allclose(small.mean, 1.5**2 * right.mean)
    assert not small.consistent


def test_nees_band_holds_as_often_as_it_says() -> None:
    rng = np.random.default_rng(2)
    C = np.diag([1.0, 4.0, 0.0])  # the last is held by a gauge
    inside = [
        vg.nees(rng.normal(size=(10, 3)) * [1, 2, 0], np.zeros((10, 3)), C, probability=0.8).consistent
        for _ in range(1000)
    ]
    assert abs(np.mean(inside) - 0.8) < 0.04  # three sigma


def loops(rng: np.random.Generator, n: int = 12, m: int = 120) -> np.ndarray:
    """Jacobian of differences of unknowns: nothing sees a common shift."""
    J = np.zeros((m, n))
    for row in J:
        row[rng.choice(n, 2, replace=False)] = 1.0, -1.0
    return J


def test_calibration_under_outliers() -> None:
    """With 15 % outliers ten times as large, over 200 runs: how each covariance compares with the spread.

    That of the weights has 0.7 of the variance. The sandwich with the weights for a curvature has half,
    with the curvature itself 1.1.
    """
    rng = np.random.default_rng(3)
    J = loops(rng)
    n = J.shape[1]
    estimates, by_weights, by_both, by_curvature = [], [], [], []

    def inverse(H: np.ndarray) -> np.ndarray:
        return np.linalg.pinv(H, rcond=1e-10, hermitian=True)

    for _ in range(200):
        noise = rng.standard_normal(len(J)) * np.where(rng.random(len(J)) < 0.15, 10.0, 1.0)
        x = np.zeros(n)
        for _ in range(60):
            r = noise - J @ x
            w = np.minimum(1.0, HUBER / np.maximum(np.abs(r), 1e-12))
            x = x + inverse(J.T @ (w[:, None] * J)) @ (J.T @ (w * r))
        inside = (np.abs(r) < HUBER).astype(float)
        C = inverse(J.T @ (w[:, None] * J))
        estimates.append(x)
        by_weights.append(np.trace(C))
        by_both.append(np.trace(vg.sandwich(J, w, r, C)))
        by_curvature.append(np.trace(vg.sandwich(J, w, r, inverse(J.T @ (inside[:, None] * J)))))
    spread = np.trace(np.cov(np.array(estimates).T))
    shares = [float(np.mean(part)) / spread for part in (by_weights, by_both, by_curvature)]
    np.testing.assert_allclose(shares, [0.7, 0.5, 1.1], atol=0.12)


def test_sandwich_of_groups_and_rows() -> None:
    rng = np.random.default_rng(4)
    J, w, r = rng.standard_normal((10, 3)), rng.random(10), rng.standard_normal(10)
    C = np.linalg.inv(J.T @ (w[:, None] * J))
    g = (w * r)[:, None] * J
    pairs = g[::2] + g[1::2]
    found = vg.sandwich(J, w, r, C, groups=np.repeat(np.arange(5), 2))
    np.testing.assert_allclose(found, C @ pairs.T @ pairs @ C)
    np.testing.assert_allclose(vg.sandwich(J, w, r, C[:2]), (C @ g.T @ g @ C)[:2, :2])


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: vg.nees(np.zeros((2, 3)), np.zeros((2, 3)), np.eye(2)), "shape"),
        (lambda: vg.nees(np.zeros((2, 3)), np.zeros((2, 3)), np.diag([1.0, 1.0, -1.0])), "negative variance"),
        (lambda: vg.nees(np.zeros((2, 3)), np.zeros((2, 3)), np.eye(3), probability=1.0), "below 1"),
        (lambda: vg.sandwich(np.eye(3), -np.ones(3), np.ones(3), np.eye(3)), "negative"),
        (lambda: vg.sandwich(np.eye(3), np.ones(3), np.ones(2), np.eye(3)), "shape"),
    ],
)
def test_refusals(call: object, words: str) -> None:
    with pytest.raises(vg.VigaugeError, match=words):
        call()
