"""The dense Jacobian of a problem, scattered block by block, in the plainest way."""

import numpy as np

from support.plain_residuals import inertial_term, visual_term
from vigauge.model.problem import Problem
from vigauge.model.state import State
from vigauge.solver.residuals import inertial_residual, visual_residual


def columns_of(state: State, kind: str, index: int) -> slice:
    """Columns of one block: kind is one of :func:`kinds_of` or landmark."""
    kinds = (*kinds_of(state), "landmark")
    first = 3 * state.n_keyframes * kinds.index(kind) + 3 * index
    return slice(first, first + 3)


def kinds_of(state: State) -> tuple[str, ...]:
    """Kinds of motion parameters in their order."""
    return ("position", "rotation", "velocity", "gyroscope bias", "accelerometer bias")[: state.width // 3]


def dense_residual(problem: Problem, state: State) -> np.ndarray:
    """(2M + 9F,), with biases (2M + 15F,), whitened residuals, the visual ones first."""
    return np.concatenate(
        [visual_residual(problem, state).ravel(), inertial_residual(problem, state).ravel()]
    )


def dense_jacobian(problem: Problem, state: State) -> np.ndarray:
    """(m, n) Jacobian of :func:`dense_residual` from the analytic terms."""
    visual, inertial = visual_term(problem, state), inertial_term(problem, state)
    count = len(visual.residual)
    J = np.zeros((2 * count + inertial.residual.size, state.n_parameters))
    for row in range(count):
        block = J[2 * row : 2 * row + 2]
        keyframe = problem.obs_keyframe[row]
        block[:, columns_of(state, "position", keyframe)] = visual.by_pose[row, :, :3]
        block[:, columns_of(state, "rotation", keyframe)] = visual.by_pose[row, :, 3:]
        block[:, columns_of(state, "landmark", problem.obs_landmark[row])] = visual.by_landmark[row]
    width = state.width
    for row in range(len(inertial.residual)):
        block = J[2 * count + width * row : 2 * count + width * row + width]
        for keyframe, by in (
            (problem.inertial.first[row], inertial.by_first[row]),
            (problem.inertial.second[row], inertial.by_second[row]),
        ):
            for part, kind in enumerate(kinds_of(state)):
                block[:, columns_of(state, kind, keyframe)] = by[:, 3 * part : 3 * part + 3]
    return J
