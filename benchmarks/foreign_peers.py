"""The same blocks by GTSAM and Ceres, with a prior on the first keyframe that closes the gauge."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import gtsam
import numpy as np
import pyceres

import vigauge as vg
from vigauge.geometry.so3 import Array

from .foreign_problems import Chain

_SIGMA = 0.1


def prior_rows(problem: Chain) -> tuple[Array, Array]:
    """(d, 9) rows of a prior on the first keyframe, and (N, 9, 9) what it adds to each block."""
    V = vg.gauge_normal(problem.layout, problem.poses, vg.FixedGauge(), group=problem.group)
    W = (_SIGMA * problem.T @ np.linalg.inv(V.T @ problem.T)).reshape(len(problem.poses[1]), 9, -1)
    return V[:9].T / _SIGMA, W @ W.swapaxes(1, 2)


def gtsam_marginals(problem: Chain, prior: Array) -> Callable[[], Any]:
    """Marginals of the same rows, as GTSAM's own linear factors; calling it eliminates."""
    graph, zero = gtsam.GaussianFactorGraph(), gtsam.VectorValues()
    for (i, j), J in zip(problem.pairs.tolist(), problem.J, strict=True):
        unit = gtsam.noiseModel.Unit.Create(len(J))
        graph.add(gtsam.JacobianFactor(i, J[:, :9], j, J[:, 9:], np.zeros(len(J)), unit))
    graph.add(gtsam.JacobianFactor(0, prior, np.zeros(len(prior)), gtsam.noiseModel.Unit.Create(len(prior))))
    for k in range(len(problem.poses[1])):
        zero.insert(k, np.zeros(9))
    return lambda: gtsam.Marginals(graph, zero)


class _Linear(pyceres.CostFunction):
    """Residuals J x of some blocks of nine."""

    def __init__(self, J: Array) -> None:
        super().__init__()
        self.parts = [J[:, k : k + 9].ravel() for k in range(0, J.shape[1], 9)]
        self.set_num_residuals(len(J))
        self.set_parameter_block_sizes([9] * len(self.parts))

    def Evaluate(self, parameters: Any, residuals: Any, jacobians: Any) -> bool:
        residuals[:] = 0.0
        for part, out in zip(self.parts, jacobians or (), strict=False):
            if out is not None:
                out[:] = part
        return True


def ceres_blocks(problem: Chain, prior: Array) -> Callable[[], Array]:
    """(N, 9, 9) of the same rows by sparse QR; RuntimeError where Ceres finds them rank deficient."""
    blocks = [np.zeros(9) for _ in problem.poses[1]]
    costs = [_Linear(prior), *map(_Linear, problem.J)]
    pairs = [[blocks[0]], *([blocks[i], blocks[j]] for i, j in problem.pairs)]
    ceres = pyceres.Problem()
    for cost, where in zip(costs, pairs, strict=True):
        ceres.add_residual_block(cost, None, where)
    options = pyceres.CovarianceOptions()
    options.algorithm_type = pyceres.CovarianceAlgorithmType.SPARSE_QR
    options.num_threads = 1

    def ask() -> Array:
        found = pyceres.Covariance(options)
        if not found.compute([(x, x) for x in blocks], ceres):
            raise RuntimeError("Ceres found the Jacobian rank deficient")
        return np.array([found.get_covariance_block(x, x) for x in blocks])

    ask.keep = costs  # type: ignore[attr-defined]  # Ceres holds no reference to them
    return ask
