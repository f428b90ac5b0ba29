"""Poses from one camera, up to scale."""

from dataclasses import replace

import numpy as np
import pytest

from support.stereo_tracks import World, make_world
from vigauge.errors import DataError
from vigauge.geometry import so3
from vigauge.recordings.frontend.mapping import Map
from vigauge.recordings.frontend.monocular import pose_up_to_scale
from vigauge.recordings.frontend.settings import OutlierSettings, PoseSettings, TriangulationSettings
from vigauge.recordings.frontend.tracks import LEFT, Tracks


def mapped(world: World, tracks: Tracks | None = None) -> Map:
    tracks = tracks or world.tracks
    rules = PoseSettings(), TriangulationSettings(), OutlierSettings()
    return pose_up_to_scale(world.cameras[0], tracks.where(tracks.camera == LEFT), len(world.p_M), *rules)


def camera_errors(world: World, result: Map) -> tuple[np.ndarray, np.ndarray]:
    """(N,) m at the best scale, and (N,) rad, of the camera along the axes of the first body."""
    p_MC = world.p_M + world.R_MB @ world.cameras[0].p_BC
    true = (p_MC - p_MC[0]) @ world.R_MB[0]
    scale = np.sum(true * result.p_M) / np.sum(result.p_M**2)
    turned = so3.log((world.R_MB[0].T @ world.R_MB).swapaxes(1, 2) @ result.R_MB)
    return np.linalg.norm(scale * result.p_M - true, axis=1), np.linalg.norm(turned, axis=1)


def test_exact_tracks_give_the_exact_shape_of_the_path() -> None:
    """Poses of the body for the camera's, whose lever is in metres; or the extrinsics on the wrong side."""
    world = make_world(0, 12, 250)
    position, turn = camera_errors(world, mapped(world))
    assert position.max() < 1e-5 and turn.max() < 1e-5


def test_noise_and_wrong_matches_make_errors_of_millimetres() -> None:
    """Drift from keyframe to keyframe that no adjustment takes out; wrong matches that bend the map."""
    world = make_world(1, 12, 300, sigma_px=0.3)
    wrong = (world.tracks.keyframe == 6) & (world.tracks.track % 9 == 0)
    uv = world.tracks.uv + np.where(wrong[:, None], [14.0, -9.0], 0.0)
    result = mapped(world, replace(world.tracks, uv=uv))
    position, turn = camera_errors(world, result)
    assert position.max() < 0.01 and turn.max() < np.radians(0.3)
    assert result.n_refused >= 0.6 * np.count_nonzero(wrong & (world.tracks.camera == LEFT))


def test_turning_on_the_spot_is_refused() -> None:
    """A map out of noise: without parallax there are no depths, and any scale fits."""
    world = make_world(2, 8, 250, depth_m=(500.0, 900.0), sigma_px=0.3)
    with pytest.raises(DataError, match="hardly moves, or only turns"):
        mapped(world)
