"""Cameras: projection, distortion, their Jacobians, and the inverse of the distortion."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from support.derivatives import central_differences, row_error
from support.random_problem import stereo_rig
from vigauge.errors import VigaugeError
from vigauge.geometry.camera import Camera, distort, distort_pixels, project, undistort, undistort_pixels

EUROC = (-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05)
CAMERA = stereo_rig(np.random.default_rng(0))[0]
coefficients = st.tuples(
    st.floats(-0.3, 0.1), st.floats(0.05, 0.1), st.floats(-2e-3, 2e-3), st.floats(-2e-3, 2e-3)
)


def test_projection_is_the_calibration_matrix():
    """Catches swapped axes or a lost principal point: pixels are K x / depth."""
    points = np.random.default_rng(1).normal(size=(20, 3)) + np.array([0.0, 0.0, 5.0])
    uv, _ = project(points, CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy)
    homogeneous = points @ CAMERA.K.T
    assert np.allclose(uv, homogeneous[:, :2] / homogeneous[:, 2:], rtol=1e-14)


def test_projection_jacobian():
    """Catches a wrong derivative, also for a camera of its own a point."""
    rng = np.random.default_rng(2)
    points = rng.normal(size=(30, 3)) + np.array([0.0, 0.0, 4.0])
    intrinsics = rng.uniform(200.0, 600.0, (4, 30))
    _, analytic = project(points, *intrinsics)
    numeric = central_differences(lambda d: project(points + d, *intrinsics)[0], 3)
    assert row_error(analytic, numeric) < 1e-9


@given(coefficients, st.floats(-0.9, 0.9), st.floats(-0.6, 0.6))
def test_distortion_jacobian(distortion, x, y):
    """Catches a wrong derivative of the radial or tangential part."""
    xy = np.array([x, y])
    _, analytic = distort(xy, distortion)
    numeric = central_differences(lambda d: distort(xy + d, distortion)[0], 2)
    assert np.abs(analytic - numeric).max() < 1e-10


def test_distortion_follows_opencv():
    """Catches p1 and p2 exchanged, or another radial model."""
    cv2 = pytest.importorskip("cv2")
    xy = np.random.default_rng(3).uniform(-0.8, 0.8, (40, 2))
    k = (-0.28, 0.07, 3e-3, -2e-3)
    expected, _ = cv2.projectPoints(
        np.column_stack([xy, np.ones(40)]), np.zeros(3), np.zeros(3), np.eye(3), np.array(k)
    )
    assert np.allclose(distort(xy, k)[0], expected[:, 0], rtol=0, atol=1e-14)


@given(coefficients, st.floats(-0.8, 0.8), st.floats(-0.55, 0.55))
def test_undistortion_inverts(distortion, x, y):
    """Catches an inverse that stops early: fixed-point iteration leaves 1e-4 at the image corners."""
    xy = np.array([x, y])
    assert np.abs(undistort(distort(xy, distortion)[0], distortion) - xy).max() < 1e-11


def test_pixels_round_trip_over_the_whole_image():
    """Catches pixels that are not in the middle of the image: both ways, corners included."""
    camera = Camera(458.654, 457.296, 367.215, 248.375, 752, 480, EUROC, np.eye(3), np.zeros(3))
    u, v = np.meshgrid(np.linspace(0, 751, 30), np.linspace(0, 479, 20))
    measured = np.stack([u, v], axis=-1)
    ideal = undistort_pixels(camera, measured)
    assert ideal.shape == measured.shape
    assert np.abs(distort_pixels(camera, ideal) - measured).max() < 1e-9
    assert np.abs(ideal - measured).max() > 10.0


@pytest.mark.parametrize("radius", [0.71, 0.8, 1.0, 1.5, 3.0])
@pytest.mark.parametrize("direction", [(1.0, 0.0), (0.6, -0.8), (-0.7, 0.1)])
def test_points_beyond_the_fold_are_refused(radius, direction):
    """Catches an answer from the far side: with k1 < 0 alone the image folds over at radius 0.703,
    and the only root of the cubic beyond lies opposite to the point."""
    point = radius * np.array(direction) / np.linalg.norm(direction)
    with pytest.raises(VigaugeError, match="cannot be inverted"):
        undistort(point, (-0.3, 0.0, 0.0, 0.0))


def test_no_points_are_no_error():
    """Catches a maximum over nothing: a frame without features."""
    assert undistort(np.zeros((0, 2)), EUROC).shape == (0, 2)


def test_extrinsics_map_camera_to_body():
    """Catches the inverse transformation: x_B = R_BC x_C + p_BC."""
    x_C = np.array([0.3, -0.2, 4.0])
    assert np.allclose(CAMERA.T_BC @ np.append(x_C, 1.0), np.append(CAMERA.R_BC @ x_C + CAMERA.p_BC, 1.0))
