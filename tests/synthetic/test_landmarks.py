"""Landmarks: on planes or at random depths, and seen often enough."""

import numpy as np
import pytest

from support.simulated import SETTINGS, scene
from vigauge.errors import DataError
from vigauge.synthetic.landmarks import LAYOUTS, PLANES, draw_landmarks
from vigauge.synthetic.scenario import make_scene, pinhole

CONFIGURATIONS = [(shape, points) for shape in ("sine", "arc", "rec") for points in LAYOUTS]


@pytest.mark.parametrize(("shape", "points"), CONFIGURATIONS)
def test_every_landmark_is_seen_often_enough(shape, points):
    """Catches landmarks that no keyframe can triangulate."""
    world = scene(shape, points)
    views = np.bincount(world.landmark, minlength=world.truth.n_landmarks)
    assert world.truth.n_landmarks == SETTINGS.n_landmarks
    assert views.min() >= SETTINGS.minimum_views


@pytest.mark.parametrize("shape", ["sine", "arc", "rec"])
def test_plane_landmarks_lie_on_planes(shape):
    """Catches points off the planes, all on one plane, or roughness of another size."""
    X_W = scene(shape, "plane", n_landmarks=200, minimum_views=2).truth.X_W
    distance = np.array([X_W @ normal - offset for normal, offset in PLANES]).T
    nearest = np.abs(distance).argmin(axis=1)
    off = distance[np.arange(len(X_W)), nearest]
    assert np.abs(off).max() < 5.0 * SETTINGS.plane_roughness_m
    assert np.std(off) == pytest.approx(SETTINGS.plane_roughness_m, rel=0.2)
    assert np.count_nonzero(np.bincount(nearest, minlength=len(PLANES)) > 5) >= 2


def test_random_landmarks_fill_the_depth_range():
    """Catches depths outside the range of the config, or all at one depth."""
    settings, world = SETTINGS, scene("sine", "random")
    rng = np.random.default_rng(0)
    camera = pinhole(settings)
    X_W = draw_landmarks("random", world.trajectory, camera, settings, rng, 500)
    assert X_W.shape == (500, 3)
    t = np.linspace(0.0, settings.duration_s, 400)
    ray = X_W[:, None] - world.trajectory.p_W(t)
    depth = np.einsum("mti,ti->mt", ray, world.trajectory.R_WB(t)[:, :, 2])
    near, far = settings.landmark_depth_m
    assert np.all((depth.min(axis=1) < far) & (depth.max(axis=1) > near))
    spread = np.linalg.norm(X_W - X_W.mean(axis=0), axis=1)
    assert spread.max() > 3.0


def test_same_generator_same_landmarks():
    """Catches a global random state."""
    world, camera = scene("arc", "random"), pinhole(SETTINGS)
    draws = [
        draw_landmarks("plane", world.trajectory, camera, SETTINGS, np.random.default_rng(seed), 50)
        for seed in (1, 1, 2)
    ]
    assert np.array_equal(draws[0], draws[1])
    assert not np.array_equal(draws[0], draws[2])


def test_unknown_layouts_are_refused():
    """Catches a misspelt configuration: the message lists what there is."""
    with pytest.raises(DataError, match="plane, random"):
        make_scene("sine", "sphere", SETTINGS)


def test_too_few_visible_landmarks_are_reported():
    """Catches a scene with fewer landmarks than asked for: the message has the count found."""
    with pytest.raises(DataError, match="seen from 11 keyframes") as caught:
        scene("sine", "plane", minimum_views=11)
    assert caught.value.field == "n_landmarks"
