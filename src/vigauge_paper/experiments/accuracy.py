"""What the errors depend on: RMSE of problems with one thing changed, under several alignments."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

import numpy as np

from vigauge.gauge.gauges import Gauge
from vigauge.model.evaluation import align_all_poses, align_first_pose, trajectory_errors
from vigauge.model.problem import Problem
from vigauge.model.state import State
from vigauge.solver.levenberg_marquardt import Options, solve

Row = dict[str, object]


def align_first_pose_fully(estimate: State, truth: State) -> State:
    """``estimate`` turned about its first position until the first poses are equal: six degrees of freedom.

    Unlike the alignment of the paper it takes roll and pitch away too, which gravity makes observable.
    """
    turn = truth.R_WB[0] @ estimate.R_WB[0].T
    p_W = (estimate.p_W - estimate.p_W[0]) @ turn.T + truth.p_W[0]
    return State.start(p_W, turn @ estimate.R_WB, estimate.v_W @ turn.T, estimate.X_W)


ALIGNMENTS: Mapping[str, Callable[[State, State], State]] = {
    "first pose": align_first_pose,
    "first pose, 6 DoF": align_first_pose_fully,
    "all positions": align_all_poses,
}


def error_rows(
    variant: str,
    name: str,
    problems: Iterable[Problem],
    truth: State,
    gauges: Mapping[str, Gauge],
    options: Options,
    alignments: Iterable[str] = ("first pose",),
) -> list[Row]:
    """A row a trial, gauge and alignment: RMSE in m, deg, m/s; iterations; landmarks; level path."""
    rows: list[Row] = []
    path_m = path_length(truth.p_W[:, :2])
    for trial, problem in enumerate(problems):
        for label, gauge in gauges.items():
            solution = solve(problem, gauge, options)
            for alignment in alignments:
                errors = trajectory_errors(solution.state, truth, ALIGNMENTS[alignment])
                rows.append(
                    {
                        "experiment": name,
                        "variant": variant,
                        "alignment": alignment,
                        "trial": trial,
                        "gauge": label,
                        "converged": solution.converged,
                        "landmarks": problem.initial.n_landmarks,
                        "path_m": path_m,
                        "iterations": solution.iterations,
                        "p_rmse_m": errors.p_rmse_m,
                        "phi_rmse_deg": errors.phi_rmse_deg,
                        "v_rmse_mps": errors.v_rmse_mps,
                    }
                )
    return rows


def expected_errors(name: str, covariance: np.ndarray, keyframes: int) -> Row:
    """RMSE that a covariance of the motion in the first-pose gauge lets expect.

    ``covariance`` is (9N, 9N), ordered positions, rotations, velocities; m, rad, m/s. Root of the mean over
    the keyframes of the trace of each block.
    """
    variance = np.diagonal(covariance)[: 9 * keyframes].reshape(3, keyframes, 3).sum(axis=2)
    p, phi, v = np.sqrt(variance.mean(axis=1))
    return {
        "experiment": name,
        "p_rmse_m": float(p),
        "phi_rmse_deg": float(np.degrees(phi)),
        "v_rmse_mps": float(v),
    }


def path_length(p_W: np.ndarray) -> float:
    """Sum of the steps of (N, d) positions, metres."""
    return float(np.linalg.norm(np.diff(p_W, axis=0), axis=1).sum())
