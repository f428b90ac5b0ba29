"""What the machine could do at best: measured peaks, and the work of an iteration counted from the problem.

The counts are of the mathematics (structure used, symmetry used once), not of any program, so the same
floor holds for every solver; a stage's floor is the larger of its flops at the machine's peak and its
bytes at the machine's bandwidth.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from threadpoolctl import threadpool_limits

from vigauge.model.problem import Problem

_DOUBLE = 8


@dataclass(frozen=True)
class Peak:
    """Double-precision flop/s and byte/s of one core, as NumPy reaches them."""

    flops: float
    bandwidth: float


def _best(work: Callable[[], object], repeats: int = 5) -> float:
    """Least seconds of a few runs: interference only ever adds."""
    best = np.inf
    for _ in range(repeats):
        begin = time.perf_counter()
        work()
        best = min(best, time.perf_counter() - begin)
    return best


def measure_peak(order: int = 1500, length: int = 20_000_000) -> Peak:
    """Flops of a matrix product, and bytes of y += x streamed through memory."""
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=(2, order, order))
    out = np.empty((order, order))
    x, y = np.ones(length), np.ones(length)
    with threadpool_limits(1):
        flops = 2.0 * order**3 / _best(lambda: np.matmul(a, b, out=out))
        bandwidth = 3.0 * _DOUBLE * length / _best(lambda: np.add(x, y, out=y))
    return Peak(flops, bandwidth)


@dataclass(frozen=True)
class Stage:
    """Work of one stage of one iteration."""

    name: str
    flops: float
    bytes: float

    def floor_s(self, peak: Peak) -> float:
        return max(self.flops / peak.flops, self.bytes / peak.bandwidth)


def pair_counts(problem: Problem) -> tuple[int, int, int]:
    """(keyframe, landmark) pairs, unordered pairs of keyframes over all landmarks (a keyframe with itself
    included), and half bandwidth in keyframes."""
    pairs = np.unique(np.column_stack([problem.obs_landmark, problem.obs_keyframe]), axis=0)
    views = np.bincount(pairs[:, 0])
    first = np.full(problem.initial.n_landmarks, problem.initial.n_keyframes)
    last = np.zeros(problem.initial.n_landmarks, dtype=np.int64)
    np.minimum.at(first, pairs[:, 0], pairs[:, 1])
    np.maximum.at(last, pairs[:, 0], pairs[:, 1])
    return len(pairs), int((views * (views + 1) // 2).sum()), int((last - first).max())


def iteration_stages(problem: Problem) -> list[Stage]:
    """Stages of one accepted iteration; README.md has the counts one by one."""
    m, n, k = len(problem.obs_uv), problem.initial.n_keyframes, problem.initial.n_landmarks
    f = len(problem.inertial.dt)
    pairs, products, reach = pair_counts(problem)
    order = 9 * n
    band = min(9 * (reach + 1), order)
    measured = 16 + 3 * 4  # a pixel, and three 32-bit indices
    factor = 8 * (81 + 9 + 3 + 3 + 1)
    state = _DOUBLE * (15 * n + 3 * k)
    # Six numbers a pair are enough to make its coupling from, see vigauge.kernels.visual.
    blocks = _DOUBLE * (6 * pairs + 9 * k)
    system = _DOUBLE * order * band
    # Banded Cholesky; where the band is everything, velocities along their chain, then dense poses.
    chain = sum(3.0 * (6.0 * min(i + 2, n) + 3.0) ** 2 for i in range(n)) + (6.0 * n) ** 3 / 3.0
    return [
        # 60 flops a residual; 100 more for its Jacobians, 216 for J^T J and J^T r of (6 + 3) columns.
        # A factor: two 9 x 9 products with the whitener, and J^T J of 18 columns.
        Stage("linearise", 376.0 * m + 6000.0 * f, measured * m + factor * f + state + blocks),
        # F = B L^-T a pair (6 x 3), and 6 x 6 products, 3 deep, for each pair of keyframes.
        Stage("eliminate", 40.0 * k + 60.0 * pairs + 216.0 * products, 2 * blocks + system),
        Stage("factorise", order * band**2 if band < order else chain, 2 * system),
        Stage("substitute", 4.0 * order * band + 80.0 * pairs + 30.0 * k, system + blocks + state),
        Stage("evaluate", 60.0 * m + 250.0 * f, measured * m + factor * f + state),
    ]
