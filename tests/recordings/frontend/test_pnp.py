"""Camera poses by RANSAC PnP."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vigauge.geometry import so3
from vigauge.recordings.frontend.pnp import estimate_pose, reprojection_error
from vigauge_paper.stand_in.flight import euroc_cameras

K = euroc_cameras()[0].K


def view(seed: int, n: int = 80) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """R_CM, p_CM, points (n, 3) and their exact pixels (n, 2)."""
    rng = np.random.default_rng(seed)
    R_CM, p_CM = so3.exp(rng.uniform(-1, 1, 3)), rng.uniform(-1, 1, 3)
    points_C = rng.uniform([-2, -1.5, 2], [2, 1.5, 8], (n, 3))
    uv = points_C[:, :2] / points_C[:, 2:] * [K[0, 0], K[1, 1]] + [K[0, 2], K[1, 2]]
    return R_CM, p_CM, (points_C - p_CM) @ R_CM, uv


@given(st.integers(0, 1000))
def test_exact_points_give_the_exact_pose(seed: int) -> None:
    """A frame turned round: body for camera, or the map seen from the wrong side."""
    R_CM, p_CM, points, uv = view(seed)
    pose = estimate_pose(points, uv, K, 2.0, 100)
    assert pose is not None and pose.n_inliers == len(points)
    np.testing.assert_allclose(pose.R_CM, R_CM, atol=1e-6)
    np.testing.assert_allclose(pose.p_CM, p_CM, atol=1e-5)


@given(st.integers(0, 1000))
def test_wrong_matches_are_found(seed: int) -> None:
    """Outliers that pull the pose, or good points thrown away with them."""
    R_CM, p_CM, points, uv = view(seed)
    rng = np.random.default_rng(seed)
    noisy = uv + 0.3 * rng.standard_normal(uv.shape)
    wrong = np.zeros(len(uv), dtype=bool)
    wrong[rng.choice(len(uv), 30, replace=False)] = True
    noisy[wrong] += rng.uniform(10, 60, (30, 2)) * rng.choice([-1, 1], (30, 2))
    pose = estimate_pose(points, noisy, K, 2.0, 300)
    assert pose is not None
    np.testing.assert_array_equal(pose.inlier, ~wrong)
    assert np.linalg.norm(so3.log(pose.R_CM @ R_CM.T)) < 2e-3
    assert np.linalg.norm(pose.p_CM - p_CM) < 1e-2


def test_same_input_same_pose_whatever_was_drawn_before() -> None:
    """RANSAC that goes on from a global random state: the second run of a pipeline would differ."""
    _, _, points, uv = view(5)
    uv = uv + np.random.default_rng(5).normal(0.0, 1.5, uv.shape)
    poses = []
    for seed in (1, 12345):
        cv2.setRNGSeed(seed)
        poses.append(estimate_pose(points, uv, K, 1.5, 50))
    first, second = poses
    assert first is not None and second is not None
    assert np.array_equal(first.R_CM, second.R_CM) and np.array_equal(first.p_CM, second.p_CM)


@pytest.mark.parametrize("n", [0, 3, 4])
def test_too_few_points_give_no_pose(n: int) -> None:
    """OpenCV's own exception, which says nothing about the keyframe, instead of a clear refusal."""
    _, _, points, uv = view(0)
    assert estimate_pose(points[:n], uv[:n], K, 2.0, 100) is None


def test_points_that_agree_on_nothing_give_few_inliers() -> None:
    """A pose believed although matches are random."""
    _, _, points, _ = view(0)
    uv = np.random.default_rng(0).uniform([0, 0], [752, 480], (len(points), 2))
    pose = estimate_pose(points, uv, K, 2.0, 100)
    assert pose is None or pose.n_inliers < 15


def test_point_behind_the_camera_has_infinite_error() -> None:
    """A point behind the camera that projects onto its pixel counts as an inlier."""
    points = np.array([[0.1, 0.2, 2.0], [-0.1, -0.2, -2.0]])
    uv = np.repeat([[K[0, 2] + K[0, 0] * 0.05, K[1, 2] + K[1, 1] * 0.1]], 2, axis=0)
    error = reprojection_error(K, np.eye(3), np.zeros(3), points, uv)
    assert error[0] < 1e-9 and np.isinf(error[1])


@given(st.integers(0, 1000))
def test_rounding_of_the_input_does_not_grow(seed: int) -> None:
    """A pose that stops short of its minimum: on another processor an inlier becomes an outlier."""
    _, _, points, uv = view(seed)
    rng = np.random.default_rng(seed)
    uv = uv + rng.normal(0.0, 1.0, uv.shape)
    rounding = 1e-12 * rng.standard_normal(points.shape)
    one, other = (estimate_pose(points + d, uv + d[:, :2], K, 3.0, 100) for d in (0.0 * rounding, rounding))
    assert one is not None and other is not None
    np.testing.assert_array_equal(one.inlier, other.inlier)
    np.testing.assert_allclose(one.p_CM, other.p_CM, rtol=0, atol=1e-10)
