"""Keyframe poses by PnP, one after the other."""

from dataclasses import replace

import numpy as np
import pytest

from support.stereo_tracks import World, make_world, pixels
from vigauge.errors import DataError
from vigauge.geometry import so3
from vigauge.recordings.frontend.mapping import Map, pose_keyframes
from vigauge.recordings.frontend.settings import PoseSettings, TriangulationSettings
from vigauge.recordings.frontend.tracks import RIGHT, Tracks

POSE = PoseSettings()


def mapped(world: World, tracks: Tracks | None = None, pose: PoseSettings = POSE) -> Map:
    return pose_keyframes(
        world.cameras, tracks or world.tracks, len(world.p_M), pose, TriangulationSettings()
    )


@pytest.mark.parametrize("map_keyframes", [1, 3])
def test_exact_tracks_give_exact_poses(map_keyframes: int) -> None:
    """Camera pose taken for the body's, or the extrinsics applied on the wrong side."""
    world = make_world(0, 8, 250)
    result = mapped(world, pose=replace(POSE, map_keyframes=map_keyframes))
    np.testing.assert_allclose(result.p_M, world.p_M, atol=1e-5)
    np.testing.assert_allclose(result.R_MB, world.R_MB, atol=1e-5)
    assert result.n_refused == 0
    np.testing.assert_array_equal(result.tried, result.inliers)


def test_noise_of_a_pixel_makes_errors_of_millimetres() -> None:
    """A pose found by few points although many are there."""
    world = make_world(1, 8, 400, sigma_px=0.3)
    result = mapped(world)
    assert np.linalg.norm(result.p_M - world.p_M, axis=1).max() < 0.02
    assert np.linalg.norm(so3.log(result.R_MB @ world.R_MB.swapaxes(1, 2)), axis=1).max() < np.radians(0.3)


def test_wrong_observations_are_refused_in_both_cameras() -> None:
    """A wrong match dropped in the left image only: its right partner bends the landmark."""
    world = make_world(2, 6, 250)
    tracks = world.tracks
    wrong = (tracks.keyframe == 3) & (tracks.track % 5 == 0)
    uv = tracks.uv + np.where(wrong[:, None], [14.0, -9.0], 0.0)
    result = mapped(world, replace(tracks, uv=uv))
    kept = set(zip(result.tracks.keyframe.tolist(), result.tracks.track.tolist(), strict=True))
    refused = {(3, int(t)) for t in np.unique(tracks.track[wrong])} - kept
    tried = {int(t) for t in np.unique(tracks.track[wrong & (tracks.camera == RIGHT)])}
    assert len(refused) > 0.6 * len(tried)
    # Those refused have no observation left in either camera of that keyframe.
    assert result.n_refused >= len(refused)
    np.testing.assert_allclose(result.p_M, world.p_M, atol=1e-5)


def test_map_reaches_back_where_the_last_keyframe_has_no_depth() -> None:
    """One keyframe without stereo matches ends a whole sequence."""
    world = make_world(3, 6, 250)
    blind = (world.tracks.keyframe == 2) & (world.tracks.camera == RIGHT)
    result = mapped(world, world.tracks.where(~blind))
    np.testing.assert_allclose(result.p_M, world.p_M, atol=1e-5)


def test_keyframe_that_sees_too_little_is_named() -> None:
    """A pose from a handful of points, or an error that does not say which keyframe."""
    world = make_world(4, 6, 250)
    few = (world.tracks.keyframe != 4) | (world.tracks.track < 12)
    with pytest.raises(DataError) as caught:
        mapped(world, world.tracks.where(few))
    assert caught.value.row == 4 and caught.value.field == "keyframe"
    assert "closer in time" in str(caught.value)
    with pytest.raises(DataError):
        mapped(world, world.tracks.where(np.zeros(len(few), dtype=bool)))


def test_keyframe_waits_for_a_later_one_that_shares_points_with_it() -> None:
    """A keyframe that looks elsewhere than all before it ends the sequence, though later ones see both."""
    world = make_world(5, 6, 300)
    tracks = world.tracks
    late = tracks.track % 2 == 1
    alone = np.where(tracks.keyframe <= 1, ~late, (tracks.keyframe != 2) | late)
    result = mapped(world, tracks.where(alone))
    np.testing.assert_allclose(result.p_M, world.p_M, atol=1e-5)


def test_keyframe_with_poor_depths_is_posed_by_lines() -> None:
    """Stereo depths off by metres, seen from a metre beside: few points agree, or on a wrong pose."""
    world = make_world(6, 2, 200, depth_m=(4.0, 9.0), sigma_px=0.5)
    cameras = world.cameras
    p_M, R_MB = world.p_M.copy(), world.R_MB.copy()
    centre = cameras[0].R_BC @ [0.0, 0.0, 6.0] + cameras[0].p_BC
    R_MB[1] = so3.exp(0.25 * cameras[0].R_BC[:, 1])
    # The body goes round the middle of the scene.
    p_M[1] = centre - R_MB[1] @ centre
    tracks = world.tracks
    uv, noise = tracks.uv.copy(), np.random.default_rng(6)
    for index, camera in enumerate(cameras):
        rows = np.flatnonzero((tracks.keyframe == 1) & (tracks.camera == index))
        seen = pixels(camera, p_M[1], R_MB[1], world.X_M[tracks.track[rows]])
        uv[rows] = seen + noise.normal(0.0, 0.5, seen.shape)
    seen_tracks = replace(tracks, uv=uv).where(np.isfinite(uv[:, 0]))
    result = mapped(world, seen_tracks)
    step = np.linalg.norm(p_M[1])
    assert result.inliers[1] > 0.8 * result.tried[1]
    assert step > 1.0 and np.linalg.norm(result.p_M[1] - p_M[1]) < 0.08 * step
    by_points = mapped(world, seen_tracks, pose=replace(POSE, sure_inliers=5))
    assert by_points.inliers[1] < 0.6 * by_points.tried[1]
