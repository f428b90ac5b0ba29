"""Problems with one thing changed: what is changed, and that nothing else is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from support.simulated import SETTINGS, scene, trial
from vigauge.errors import DataError
from vigauge.gauge.gauges import FixedGauge
from vigauge.geometry import so3
from vigauge.model.evaluation import trajectory_errors
from vigauge.model.imu import ImuNoise, ImuSamples, preintegrate
from vigauge.model.problem import InertialFactors, Problem
from vigauge.solver.levenberg_marquardt import Options
from vigauge.solver.residuals import cost
from vigauge.synthetic.scenario import make_scene, make_trial, measured_imu
from vigauge_paper.experiments.accuracy import (
    align_first_pose_fully,
    error_rows,
    expected_errors,
    path_length,
)
from vigauge_paper.experiments.rigid_turn import rigid_turns
from vigauge_paper.experiments.variants import (
    euler_increments,
    fewer_landmarks,
    keyframes_between,
    one_camera,
    with_bias_error,
)

NOISE = ImuNoise(1e-3, 1e-2)


def _stereo() -> Problem:
    """A trial seen by two cameras alike, but for the first three landmarks: those by the second only."""
    problem = trial()
    second = Problem.from_observations(
        initial=problem.initial,
        cameras=(problem.cameras[0], replace(problem.cameras[0], p_BC=np.array([0.1, 0.0, 0.0]))),
        keyframe=np.tile(problem.obs_keyframe, 2),
        camera=np.repeat([0, 1], len(problem.obs_uv)),
        landmark=np.tile(problem.obs_landmark, 2),
        uv=np.tile(problem.obs_uv, (2, 1)),
        sigma_px=1.0,
        inertial=problem.inertial,
        gravity=9.81,
    )
    keep = (second.obs_camera == 1) | (second.obs_landmark >= 3)
    return replace(
        second,
        obs_keyframe=second.obs_keyframe[keep],
        obs_camera=second.obs_camera[keep],
        obs_landmark=second.obs_landmark[keep],
        obs_uv=second.obs_uv[keep],
    )


def test_one_camera_keeps_its_observations_and_their_landmarks() -> None:
    """Catches landmarks paired with other observations once some have gone."""
    problem, left = trial(), one_camera(_stereo())
    assert set(left.obs_camera) == {0}
    assert np.array_equal(left.initial.X_W, problem.initial.X_W[3:])
    kept = problem.obs_landmark >= 3
    assert np.array_equal(left.obs_uv, problem.obs_uv[kept])
    assert np.array_equal(left.obs_landmark, problem.obs_landmark[kept] - 3)


def test_one_camera_without_landmarks_is_told() -> None:
    with pytest.raises(DataError, match="no landmark is left with 99 keyframes"):
        one_camera(trial(), minimum_views=99)


def test_fewer_landmarks_are_as_many_as_asked_for() -> None:
    problem = trial()
    few = fewer_landmarks(problem, 7, np.random.default_rng(1))
    assert few.initial.n_landmarks == 7
    for number, X_W in enumerate(few.initial.X_W):
        (place,) = np.flatnonzero(np.all(problem.initial.X_W == X_W, axis=1))
        assert np.array_equal(
            few.obs_uv[few.obs_landmark == number], problem.obs_uv[problem.obs_landmark == place]
        )


def test_part_of_the_keyframes_is_a_problem_of_its_own() -> None:
    """Catches indices, increments or true states of other keyframes than those that are kept."""
    whole = trial()
    part, truth = keyframes_between(whole, scene().truth, 3, 8)
    assert part.initial.n_keyframes == truth.n_keyframes == 5
    assert np.array_equal(part.initial.p_W, whole.initial.p_W[3:8])
    assert np.array_equal(truth.R_WB, scene().truth.R_WB[3:8])
    assert np.array_equal(part.inertial.dv, whole.inertial.dv[3:7])
    assert (part.obs_keyframe.min(), part.obs_keyframe.max()) == (0, 4)
    # At the truth only noise is left: one unit a residual.
    at_truth = replace(truth, X_W=scene().truth.X_W[_places(whole.initial.X_W, part.initial.X_W)])
    count = 2 * len(part.obs_uv) + 9 * 4
    assert 0.6 < 2.0 * cost(part, at_truth) / count < 1.6


def _places(among: np.ndarray, wanted: np.ndarray) -> list[int]:
    return [int(np.flatnonzero(np.all(among == row, axis=1))[0]) for row in wanted]


def test_all_keyframes_are_the_problem_itself() -> None:
    whole = trial()
    same, _ = keyframes_between(whole, scene().truth, 0, whole.initial.n_keyframes)
    assert cost(same, same.initial) == pytest.approx(cost(whole, whole.initial))


def test_rigid_turns_are_what_a_turned_truth_is_off_by() -> None:
    """Catches the wrong axis, radians for degrees, or a level axis that is not the best one."""
    truth = scene("arc").truth
    rows = {str(row["axis"]): row for row in rigid_turns("arc", truth)}

    def velocity_error(axis: np.ndarray) -> float:
        turned = truth.v_W @ so3.exp(np.radians(1.0) * axis).T - truth.v_W
        return float(np.sqrt(np.mean(np.sum(turned**2, axis=1))))

    up = np.array([0.0, 0.0, 1.0])
    assert rows["vertical"]["v_rmse_mps"] == pytest.approx(velocity_error(up), rel=1e-3)
    angles = np.radians(np.arange(180))
    level = [velocity_error(np.array([np.cos(a), np.sin(a), 0.0])) for a in angles]
    assert rows["level"]["v_rmse_mps"] == pytest.approx(min(level), rel=1e-3)


def test_bias_error_is_what_a_bias_left_in_does() -> None:
    """Catches a sign, a factor of two, or the wrong side of the rotation."""
    exact = scene()
    gyro, accel = np.array([1e-3, -2e-3, 3e-3]), np.array([0.02, 0.01, -0.03])
    start, end = int(exact.keyframe_ns[0]), int(exact.keyframe_ns[1])
    biased = ImuSamples(exact.imu.t_ns, exact.imu.gyro + gyro, exact.imu.accel + accel)
    factors = [
        InertialFactors.chain([preintegrate(samples, start, end, NOISE)]) for samples in (exact.imu, biased)
    ]
    problem = replace(trial(), inertial=factors[0])
    ours = with_bias_error(problem, gyro, accel).inertial
    for name in ("dp", "dv"):
        change = getattr(factors[1], name) - getattr(factors[0], name)
        assert np.linalg.norm(getattr(ours, name) - getattr(factors[1], name)) < 0.2 * np.linalg.norm(change)
    turn = so3.log(ours.dR @ factors[1].dR.swapaxes(1, 2))
    assert np.linalg.norm(turn) < 0.1 * np.linalg.norm(so3.log(factors[0].dR @ factors[1].dR.swapaxes(1, 2)))


def test_euler_steps_come_to_the_integral_as_the_rate_grows() -> None:
    """Catches Euler steps that are wrong by more than their order."""
    errors = []
    for rate in (200.0, 400.0):
        fine = make_scene("sine", "random", replace(SETTINGS, imu_rate_hz=rate))
        ends = [(int(a), int(b)) for a, b in zip(fine.keyframe_ns[:-1], fine.keyframe_ns[1:], strict=True)]
        exact = InertialFactors.chain([preintegrate(fine.imu, a, b, NOISE) for a, b in ends])
        errors.append(np.abs(euler_increments(fine.imu, ends, exact).dv - exact.dv).max())
    assert errors[0] == pytest.approx(2.0 * errors[1], rel=0.1)
    assert errors[0] > 1e-3


def test_samples_of_a_trial_are_those_that_its_problem_integrates() -> None:
    """Catches an experiment on the integration that draws other noise than the trial."""
    one = scene()
    samples = measured_imu(one, 1)
    increment = preintegrate(samples, int(one.keyframe_ns[0]), int(one.keyframe_ns[1]), NOISE)
    assert np.array_equal(increment.dv, make_trial(one, 1).inertial.dv[0])


def test_six_degrees_of_alignment_join_the_first_poses() -> None:
    truth = scene().truth
    turned = replace(truth, R_WB=so3.exp(np.array([0.1, 0.2, 0.3])) @ truth.R_WB)
    aligned = align_first_pose_fully(turned, truth)
    assert np.allclose(aligned.R_WB[0], truth.R_WB[0])
    assert np.allclose(aligned.p_W[0], truth.p_W[0])
    assert trajectory_errors(turned, truth).phi_rmse_deg > 10.0


def test_error_rows_follow_the_alignment() -> None:
    rows = error_rows(
        "v",
        "sine",
        [trial()],
        scene().truth,
        {"fix": FixedGauge()},
        Options(),
        ("first pose", "all positions"),
    )
    first, every = rows
    assert first["variant"] == "v" and first["converged"] is True
    assert float(str(every["p_rmse_m"])) < float(str(first["p_rmse_m"]))


def test_expected_errors_are_those_of_the_blocks() -> None:
    """Catches blocks in another order, and radians passing for degrees."""
    variance = np.concatenate([np.full(6, 4.0), np.full(6, 1.0), np.full(6, 9.0)])
    found = expected_errors("x", np.diag(variance), 2)
    assert found["p_rmse_m"] == pytest.approx(np.sqrt(12.0))
    assert found["phi_rmse_deg"] == pytest.approx(np.degrees(np.sqrt(3.0)))
    assert found["v_rmse_mps"] == pytest.approx(np.sqrt(27.0))


def test_path_length() -> None:
    assert path_length(np.array([[0.0, 0.0], [3.0, 4.0], [3.0, 5.0]])) == 6.0
