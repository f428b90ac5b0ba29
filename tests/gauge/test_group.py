"""Groups: tangents are derivatives of actions, and actions leave their measurements as they are."""

from dataclasses import replace

import numpy as np
import pytest

from support.dense import dense_jacobian
from support.random_problem import random_problem
from vigauge.covariance.covariance import Covariance
from vigauge.errors import DegenerateError
from vigauge.gauge.gauges import CentroidGauge, FreeGauge
from vigauge.gauge.group import Euclidean, Group, Similarity, YawTranslation, dimension
from vigauge.model.evaluation import relative_frobenius
from vigauge.model.factors import LinearFactor
from vigauge.model.problem import InertialFactors, Problem
from vigauge.model.state import State
from vigauge.solver.residuals import inertial_residual, visual_residual

GROUPS = [YawTranslation(), Euclidean(), Similarity()]


class Still:
    """A velocity of zero: a motion factor that no turn, shift or scaling changes."""

    def __init__(self, keyframe: int) -> None:
        self.keyframes = (keyframe,)

    def at(self, state: State, reference: State) -> LinearFactor:
        first = 6 * state.n_keyframes + 3 * self.keyframes[0]
        return LinearFactor(np.arange(first, first + 3), state.v_W[self.keyframes[0]], np.eye(3))


def images_alone(cameras: int) -> Problem:
    """A problem without inertial measurements, standing still at every keyframe, at a state."""
    problem = random_problem(3)
    keep = problem.obs_camera < cameras
    none = InertialFactors.chain([])
    still = problem.initial.retract(np.zeros(problem.initial.n_parameters))
    still = replace(still, v_W=np.zeros_like(still.v_W))
    # Cameras at the body's origin, so that scaling positions scales the cameras' centres too.
    rig = tuple(replace(camera, p_BC=np.zeros(3)) for camera in problem.cameras[:cameras])
    if cameras == 2:
        rig = problem.cameras
    return replace(
        problem,
        initial=still,
        cameras=rig,
        obs_keyframe=problem.obs_keyframe[keep],
        obs_camera=problem.obs_camera[keep],
        obs_landmark=problem.obs_landmark[keep],
        obs_uv=problem.obs_uv[keep],
        inertial=none,
        factors=tuple(Still(i) for i in range(still.n_keyframes)),
    )


@pytest.mark.parametrize("biases", [False, True])
@pytest.mark.parametrize("group", GROUPS, ids=lambda group: type(group).__name__)
def test_tangent_is_the_derivative_of_the_action(group: Group, biases: bool) -> None:
    """Catches a column with a wrong sign, axis or order, or the first rotation's chart forgotten."""
    state = random_problem(5, biases=biases).initial
    step, d = 1e-6, dimension(group)
    numeric = np.stack(
        [
            (state.local(group.act(state, step * e)) - state.local(group.act(state, -step * e))) / (2 * step)
            for e in np.eye(d)
        ],
        axis=1,
    )
    assert group.tangent(state).shape == (state.n_parameters, d)
    assert np.abs(group.tangent(state) - numeric).max() < 1e-7


@pytest.mark.parametrize(
    ("group", "cameras"),
    [(YawTranslation(), 2), (Euclidean(), 2), (Similarity(), 1)],
    ids=["vi", "se3", "sim3"],
)
def test_measurements_do_not_change_along_the_orbit(group: Group, cameras: int) -> None:
    """Catches a group that belongs to other measurements."""
    problem = random_problem(4) if dimension(group) == 4 else images_alone(cameras)
    state = problem.initial
    moved = group.act(state, np.random.default_rng(1).normal(0.0, 0.3, dimension(group)))
    before, after = visual_residual(problem, state), visual_residual(problem, moved)
    assert np.abs(before - after).max() < 1e-9 * max(1.0, np.abs(before).max())
    assert np.allclose(inertial_residual(problem, state), inertial_residual(problem, moved), atol=1e-8)


def test_seven_directions() -> None:
    """Catches a four that stayed in the elimination, the projection or the held columns."""
    problem = images_alone(cameras=1)
    state = problem.initial
    J = dense_jacobian(problem, state)
    n = state.n_keyframes
    J = np.concatenate([J, np.eye(state.n_parameters)[6 * n : 9 * n]])
    covariance = Covariance.of(problem, state, group=Similarity())
    assert covariance.measured == ()
    expected = np.linalg.pinv(J.T @ J, rcond=1e-13, hermitian=True)[: 9 * n, : 9 * n]
    assert relative_frobenius(covariance.motion(FreeGauge(group=Similarity())), expected) < 1e-8
    with pytest.raises(DegenerateError):
        Covariance.of(problem, state).motion(CentroidGauge())
