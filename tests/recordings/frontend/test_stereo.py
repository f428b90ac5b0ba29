"""Geometry of the stereo pair, and the search along rectified rows."""

import numpy as np
import pytest

from support.stereo_tracks import pixels, texture
from vigauge.geometry.camera import undistort_pixels
from vigauge.recordings.frontend.settings import StereoSettings
from vigauge.recordings.frontend.stereo import StereoGeometry, raw_pixels, search_disparity
from vigauge_paper.stand_in.flight import euroc_cameras

GEOMETRY = StereoGeometry(*euroc_cameras())
SETTINGS = StereoSettings()


def seen_points(seed: int = 0, n: int = 200) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points in the left camera (m, 3) m and their ideal pixels in both images."""
    rng = np.random.default_rng(seed)
    points_C = rng.uniform([-2, -1.5, 1.0], [2, 1.5, 8.0], (n, 3))
    body = points_C @ GEOMETRY.left.R_BC.T + GEOMETRY.left.p_BC
    left, right = (pixels(c, np.zeros(3), np.eye(3), body) for c in (GEOMETRY.left, GEOMETRY.right))
    both = np.isfinite(left[:, 0]) & np.isfinite(right[:, 0])
    assert np.count_nonzero(both) > 30
    return points_C[both], left[both], right[both]


def test_true_matches_lie_on_epipolar_lines_and_offsets_are_in_pixels() -> None:
    """An essential matrix transposed or scaled, or extrinsics inverted."""
    _, left, right = seen_points()
    assert GEOMETRY.epipolar_distance(left, right).max() < 1e-8
    # The baseline is nearly along x, so a shift along y is a shift across the lines.
    off = GEOMETRY.epipolar_distance(left, right + [0.0, 2.0])
    np.testing.assert_allclose(off, 2.0, rtol=0.05)


def test_rectified_matches_share_their_row_and_disparity_gives_depth() -> None:
    """Rectification that turns the wrong way: rows differ, and the search looks in the wrong place."""
    points_C, left, right = seen_points()
    V_left, V_right = GEOMETRY.to_rectified(left, 0), GEOMETRY.to_rectified(right, 1)
    np.testing.assert_allclose(V_left[:, 1], V_right[:, 1], atol=1e-8)
    R_VL, K_V = GEOMETRY.rectified.R_VC[0], GEOMETRY.rectified.K_V
    depth_V = (points_C @ R_VL.T)[:, 2]
    baseline = np.linalg.norm(GEOMETRY.left.p_BC - GEOMETRY.right.p_BC)
    np.testing.assert_allclose(GEOMETRY.disparity(left, right), K_V[0, 0] * baseline / depth_V, rtol=1e-9)


@pytest.mark.parametrize("camera", [0, 1])
def test_rectified_pixel_comes_back_from_the_raw_image(camera: int) -> None:
    """Distortion applied twice or not at all on the way between raw and rectified image."""
    uv_V = np.random.default_rng(1).uniform([100, 80], [650, 400], (50, 2))
    raw = raw_pixels(GEOMETRY, uv_V, camera)
    ideal = undistort_pixels((GEOMETRY.left, GEOMETRY.right)[camera], raw)
    np.testing.assert_allclose(GEOMETRY.to_rectified(ideal, camera), uv_V, atol=1e-7)


def test_rectified_image_shows_at_a_pixel_what_the_raw_image_shows_there() -> None:
    """Maps of left and right exchanged, or half a pixel off."""
    columns, rows = np.meshgrid(np.arange(752.0), np.arange(480.0))
    ramp = np.clip(columns / 4.0 + rows / 8.0, 0, 255).astype(np.uint8)
    uv_V = np.random.default_rng(2).integers([150, 100], [600, 380], (40, 2))
    for camera in (0, 1):
        raw = raw_pixels(GEOMETRY, uv_V.astype(float), camera)
        shown = GEOMETRY.rectified_image(ramp, camera)[uv_V[:, 1], uv_V[:, 0]]
        np.testing.assert_allclose(shown, raw @ [0.25, 0.125], atol=1.1)


def shifted_pair(shift: int) -> tuple[np.ndarray, np.ndarray]:
    wide = texture(3, 120, 500)
    return wide[:, :400].copy(), wide[:, shift : 400 + shift].copy()


POINTS = np.array([[200.25, 60.0], [250.0, 61.5], [300.0, 40.0]])


@pytest.mark.parametrize("shift", [5, 37, 110])
@pytest.mark.parametrize("known", [False, True])
def test_search_finds_the_shift(shift: int, known: bool) -> None:
    """A sign error, or a range of the search that leaves out what lies in it."""
    left, right = shifted_pair(shift)
    expected = np.full(len(POINTS), 0.9 * shift if known else np.nan)
    np.testing.assert_allclose(search_disparity(left, right, POINTS, expected, SETTINGS), shift, atol=0.3)


def test_search_is_held_to_what_is_expected() -> None:
    """An expected disparity that guides nothing: on repetitive texture the wrong repeat would be taken."""
    period = 40
    left = np.tile(texture(4, 120, period), (1, 10))
    right = np.roll(left, -12, axis=1)
    guided = search_disparity(left, right, POINTS, np.full(len(POINTS), 14.0), SETTINGS)
    np.testing.assert_allclose(guided, 12.0, atol=0.3)
    blind = search_disparity(left, right, POINTS, np.full(len(POINTS), np.nan), SETTINGS)
    assert np.all(np.isnan(blind)), "two equal matches: none may be chosen"


def test_search_refuses_flat_and_foreign_patches() -> None:
    """A match claimed where there is nothing to match."""
    left, _ = shifted_pair(0)
    nothing = np.full(len(POINTS), np.nan)
    grey = np.full_like(left, 128)
    assert np.all(np.isnan(search_disparity(grey, grey, POINTS, nothing, SETTINGS)))
    assert np.all(np.isnan(search_disparity(left, texture(9, 120, 400), POINTS, nothing, SETTINGS)))
    at_rim = np.array([[2.0, 60.0], [200.0, 1.0], [200.0, 119.0], [399.0, 60.0]])
    assert np.all(np.isnan(search_disparity(left, left, at_rim, nothing, SETTINGS)))
