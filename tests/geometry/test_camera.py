"""Cameras: projection, distortion, their Jacobians, and the inverse of the distortion."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from support.derivatives import central_differences, row_error
from support.random_problem import stereo_rig
from vigauge.errors import DataError, VigaugeError
from vigauge.geometry.camera import (
    EQUIDISTANT,
    FIELD_DEG,
    Camera,
    distort,
    distort_pixels,
    ideal_size,
    in_field,
    project,
    undistort,
    undistort_pixels,
    undistort_where,
)

EUROC = (-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05)
CAMERA = stereo_rig(np.random.default_rng(0))[0]
TUM_VI = (0.0034823894022493434, 0.0007150348452162257, -0.0020532361418706202, 0.00020293673591811182)
FISHEYE = Camera(
    190.97847715128717,
    190.9733070521226,
    254.93170605935475,
    256.8974428996504,
    512,
    512,
    TUM_VI,
    np.eye(3),
    np.zeros(3),
    EQUIDISTANT,
)
fisheye_coefficients = st.tuples(*[st.floats(-0.03, 0.03)] * 4)
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


@given(fisheye_coefficients, st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
def test_fisheye_jacobian(distortion, x, y):
    """Catches a wrong derivative along or across the radius, and a division by zero in the middle."""
    for xy in (np.array([x, y]), np.array([1e-5 * x, 1e-5 * y]), np.zeros(2)):
        _, analytic = distort(xy, distortion, EQUIDISTANT)
        numeric = central_differences(lambda d, xy=xy: distort(xy + d, distortion, EQUIDISTANT)[0], 2)
        assert np.abs(analytic - numeric).max() < 1e-8


@pytest.mark.parametrize("k", [(-0.28, 0.07, 3e-3, -2e-3), (-0.28, 0.07, 3e-3, -2e-3, -0.012)])
def test_distortion_follows_opencv(k):
    """Catches p1 and p2 exchanged, k3 before them, or another radial model."""
    cv2 = pytest.importorskip("cv2")
    xy = np.random.default_rng(3).uniform(-0.8, 0.8, (40, 2))
    expected, _ = cv2.projectPoints(
        np.column_stack([xy, np.ones(40)]), np.zeros(3), np.zeros(3), np.eye(3), np.array(k)
    )
    assert np.allclose(distort(xy, k)[0], expected[:, 0], rtol=0, atol=1e-14)


@given(coefficients, st.floats(-0.8, 0.8), st.floats(-0.55, 0.55))
def test_undistortion_inverts(distortion, x, y):
    """Catches an inverse that stops early: fixed-point iteration leaves 1e-4 at the image corners."""
    xy = np.array([x, y])
    assert np.abs(undistort(distort(xy, distortion)[0], distortion) - xy).max() < 1e-11


def test_fisheye_follows_opencv_both_ways():
    """Catches another polynomial, or an inverse that stops early: OpenCV's own is good to 1e-8 by default."""
    cv2 = pytest.importorskip("cv2")
    uv = np.stack(np.meshgrid(np.arange(512.0), np.arange(512.0)), axis=-1).reshape(-1, 2)[::7]
    uv = uv[in_field(FISHEYE, uv)]
    ideal = undistort_pixels(FISHEYE, uv)
    # Without a limit on its steps OpenCV gives up near 85 degrees, so the field is compared.
    criteria = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 100, 1e-15)
    expected = cv2.fisheye.undistortPoints(
        uv[:, None], FISHEYE.K, np.array(TUM_VI), P=FISHEYE.K, criteria=criteria
    )
    assert np.abs(ideal - expected[:, 0]).max() < 1e-11
    xy = (ideal - [FISHEYE.cx, FISHEYE.cy]) / [FISHEYE.fx, FISHEYE.fy]
    back = cv2.fisheye.distortPoints(xy[:, None], FISHEYE.K, np.array(TUM_VI))
    assert np.abs(distort_pixels(FISHEYE, ideal) - back[:, 0]).max() < 1e-11
    assert np.abs(back[:, 0] - uv).max() < 1e-11


@given(fisheye_coefficients, st.floats(0.0, 1.48), st.floats(-3.2, 3.2))
def test_fisheye_inverts_to_rounding_or_says_so(distortion, theta, direction):
    """Catches a root beyond the fold, and one of a ray that the lens does not image."""
    xy = np.tan(theta) * np.array([np.cos(direction), np.sin(direction)])
    seen, _ = distort(xy, distortion, EQUIDISTANT)
    back, good = undistort_where(seen, distortion, EQUIDISTANT)
    if good:
        again, jacobian = distort(back, distortion, EQUIDISTANT)
        assert np.abs(again - seen).max() < 1e-15 * max(np.linalg.norm(xy), 4.0)
        assert np.linalg.eigvalsh(jacobian).min() > -1e-7
    else:
        with pytest.raises(VigaugeError, match="cannot be inverted"):
            undistort(seen, distortion, EQUIDISTANT)
        path = np.tan(np.linspace(0.0, theta, 500))[:, None] * [np.cos(direction), np.sin(direction)]
        radius = np.linalg.norm(distort(path, distortion, EQUIDISTANT)[0], axis=1)
        assert np.diff(radius).min() < 1e-5


def test_field_of_a_fisheye_ends_at_its_angle():
    """Catches a mask in ideal pixels, or one that keeps the corners, which lie beyond 90 degrees."""
    for angle, seen in ((FIELD_DEG - 0.1, True), (FIELD_DEG + 0.1, False)):
        xy = np.tan(np.radians(angle)) * np.array([0.6, -0.8])
        raw = distort_pixels(FISHEYE, xy * [FISHEYE.fx, FISHEYE.fy] + [FISHEYE.cx, FISHEYE.cy])
        assert in_field(FISHEYE, raw) == seen
    assert not np.any(in_field(FISHEYE, np.array([[0.0, 0.0], [511.0, 511.0]])))
    assert np.all(in_field(CAMERA, np.array([[0.0, 0.0], [751.0, 479.0]])))


def test_size_of_a_pixel_on_the_ideal_plane():
    """Catches the inverse of it: noise of one measured pixel, undistorted, has this deviation."""
    rng = np.random.default_rng(4)
    for angle in (5.0, 45.0, 65.0):
        ideal = np.tan(np.radians(angle)) * np.array([0.6, 0.8]) * FISHEYE.fx + [FISHEYE.cx, FISHEYE.cy]
        noisy = distort_pixels(FISHEYE, ideal) + 0.01 * rng.normal(size=(20_000, 2))
        deviation = np.sqrt(0.5 * np.sum((undistort_pixels(FISHEYE, noisy) - ideal) ** 2, axis=1).mean())
        assert deviation / 0.01 == pytest.approx(ideal_size(FISHEYE, ideal), rel=0.02)


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"lens": "omni"}, "lens"),
        ({"distortion": TUM_VI[:3]}, "distortion"),
        ({"distortion": (*TUM_VI, 0.0)}, "distortion"),
        ({"distortion": (np.nan, *TUM_VI[:3])}, "distortion"),
    ],
)
def test_lens_that_is_none_is_refused(change, field):
    """Catches a fifth coefficient of another model taken for one of this."""
    with pytest.raises(DataError) as caught:
        replace(FISHEYE, **change)
    assert caught.value.field == field


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
