"""Scenes and trials: repeatable, independent of each other, and disturbed by what Section V-B says."""

from dataclasses import replace

import numpy as np
import pytest

from support.simulated import SETTINGS, scene, trial
from vigauge.geometry import so3
from vigauge.model.archive import save_problems
from vigauge.model.state import State
from vigauge.solver.residuals import inertial_residual, visual_residual
from vigauge.synthetic import scenario
from vigauge.synthetic.scenario import make_scene, make_trial, make_trials, perturbed, pinhole


def archive_bytes(tmp_path, settings) -> bytes:
    save_problems(tmp_path / "p.npz", list(make_trials(make_scene("sine", "plane", settings))))
    return (tmp_path / "p.npz").read_bytes()


def test_same_seed_same_bytes(tmp_path):
    """Catches a global random state or an order of drawing that changes; another seed must differ."""
    small = replace(SETTINGS, n_trials=2)
    first = archive_bytes(tmp_path, small)
    np.random.default_rng(0).normal()
    assert archive_bytes(tmp_path, small) == first
    assert archive_bytes(tmp_path, replace(small, seed=2019)) != first


def test_trials_do_not_depend_on_each_other():
    """Catches one generator shared by all trials: trial 2 alone is trial 2 of many."""
    world = scene("arc", "plane")
    many = list(make_trials(world))
    assert len(many) == SETTINGS.n_trials
    alone = make_trial(world, 2)
    assert np.array_equal(many[2].obs_uv, alone.obs_uv)
    assert np.array_equal(many[2].initial.p_W, alone.initial.p_W)
    assert np.array_equal(many[2].inertial.dp, alone.inertial.dp)


def test_trials_differ():
    """Catches a start or noise that is drawn once; without redraw only the start differs."""
    a, b = trial(0), trial(1)
    assert not np.array_equal(a.obs_uv, b.obs_uv)
    assert not np.array_equal(a.inertial.dp, b.inertial.dp)
    assert not np.array_equal(a.initial.p_W, b.initial.p_W)
    a, b = trial(0, redraw_noise=False), trial(1, redraw_noise=False)
    assert np.array_equal(a.obs_uv, b.obs_uv)
    assert np.array_equal(a.inertial.dp, b.inertial.dp)
    assert not np.array_equal(a.initial.p_W, b.initial.p_W)


def test_random_streams_are_told_apart(monkeypatch):
    """Catches one stream used twice: landmarks of a scene drawn from the numbers that the noise of a
    trial is made of. Entropies that differ in trailing zeros only are the same to NumPy."""
    used, world = [], scene()
    default_rng = np.random.default_rng

    def recorded(entropy):
        used.append(tuple(entropy) + (0,) * (4 - len(entropy)))
        return default_rng(entropy)

    monkeypatch.setattr(scenario.np.random, "default_rng", recorded)
    for shape in ("sine", "arc", "rec"):
        for points in ("plane", "random"):
            make_scene(shape, points, SETTINGS)
    scenes = set(used)
    assert len(scenes) == len(used) == 6
    used.clear()
    for number in range(5):
        make_trial(world, number)
    assert len(set(used)) == 10
    assert not scenes & set(used)


@pytest.mark.parametrize("number", range(3))
def test_perturbations_are_those_of_the_paper(number):
    """Catches a disturbance per axis instead of in length, in degrees for radians, or on the wrong
    side: 5 cm, 6 deg, +-0.05 m/s, +-7.5 cm (Section V-B)."""
    truth, start = scene("rec").truth, trial(number, "rec").initial
    assert np.allclose(np.linalg.norm(start.p_W - truth.p_W, axis=1), 0.05, rtol=1e-9)
    turned = so3.log(start.R_WB @ truth.R_WB.swapaxes(1, 2))
    assert np.allclose(np.degrees(np.linalg.norm(turned, axis=1)), 6.0, rtol=1e-9)
    assert np.array_equal(start.dphi_0, np.zeros(3))
    for moved, bound in ((start.v_W - truth.v_W, 0.05), (start.X_W - truth.X_W, 0.075)):
        assert np.abs(moved).max() <= bound
        assert np.abs(moved).max() > 0.8 * bound


def test_perturbations_are_uniform():
    """Catches a direction that is preferred, or a normal instead of a uniform distribution."""
    n = 4000
    truth = State.start(np.zeros((n, 3)), np.tile(np.eye(3), (n, 1, 1)), np.zeros((n, 3)), np.zeros((n, 3)))
    start = perturbed(truth, SETTINGS, np.random.default_rng(0))
    tolerance = 4.0 / np.sqrt(n)
    for vectors, length in ((start.p_W, 0.05), (so3.log(start.R_WB), np.radians(6.0))):
        assert np.abs(vectors.mean(axis=0)).max() < tolerance * length
        second = vectors.T @ vectors / n
        assert np.allclose(second, length**2 / 3.0 * np.eye(3), atol=tolerance * length**2)
    for cubes, bound in ((start.v_W, 0.05), (start.X_W, 0.075)):
        assert np.abs(cubes.mean(axis=0)).max() < tolerance * bound
        assert np.allclose(np.mean(cubes**2, axis=0), bound**2 / 3.0, rtol=0.1)
        assert np.allclose(np.mean(cubes**4, axis=0), bound**4 / 5.0, rtol=0.15)


@pytest.mark.parametrize(("shape", "points"), [("sine", "plane"), ("arc", "random"), ("rec", "random")])
def test_without_noise_the_truth_has_no_residual(shape, points):
    """Catches a bias that is added but not removed, keyframes at other times than the images, or
    projections with another camera: with tiny noise the residuals of the truth stay tiny."""
    quiet = {"sigma_px": 1e-9, "gyro_density": 1e-12, "accel_density": 1e-12}
    world, problem = scene(shape, points, **quiet), trial(0, shape, points, **quiet)
    belief = problem.with_noise(SETTINGS.sigma_px, SETTINGS.gyro_density / 1e-12)
    assert np.abs(visual_residual(belief, world.truth)).max() < 1e-7
    # Accelerometer noise is scaled by the gyro's factor, so it weighs ten times too much here.
    assert np.abs(inertial_residual(belief, world.truth)).max() < 3.0


def test_keyframes_are_even_and_on_inertial_stamps():
    """Catches keyframes bunched together or beyond the recording."""
    world = scene("sine")
    assert len(world.keyframe_ns) == SETTINGS.n_keyframes
    assert world.keyframe_ns.dtype == np.int64
    assert world.keyframe_ns[0] == 0
    assert world.keyframe_ns[-1] == 2_500_000_000
    assert np.ptp(np.diff(world.keyframe_ns)) <= 5_000_000
    assert np.all(np.isin(world.keyframe_ns, world.imu.t_ns))


def test_truth_is_the_trajectory():
    """Catches truth at other times than the keyframes."""
    world = scene("arc")
    t = world.keyframe_ns / 1e9
    assert np.allclose(world.truth.p_W, world.trajectory.p_W(t), rtol=0, atol=1e-14)
    assert np.allclose(world.truth.R_WB, world.trajectory.R_WB(t), rtol=0, atol=1e-14)
    assert np.allclose(world.truth.v_W, world.trajectory.v_W(t), rtol=0, atol=1e-13)


def test_pinhole_has_the_field_of_view():
    """Catches half an angle taken for the whole: the image border is seen at half the angle."""
    camera = pinhole(SETTINGS)
    edge = np.degrees(np.arctan(0.5 * camera.width / camera.fx))
    assert 2.0 * edge == pytest.approx(SETTINGS.field_of_view_deg)
    assert (camera.cx, camera.cy) == (160.0, 120.0)
    assert np.array_equal(camera.T_BC, np.eye(4))
