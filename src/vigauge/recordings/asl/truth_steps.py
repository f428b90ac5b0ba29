"""Steps in a ground truth: jumps of its position between two samples that the accelerometer rules out.

Published truths are made of a tracker's measurements, and where its estimate jumps, the position does too:
those of MH_01 to MH_05 are known for it. Such a jump adds the same error to every estimate, a wrong one and
a right one. It is found from the truth and the inertial samples alone, before there is any estimate.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...geometry.so3 import Array
from ...model.imu import ImuSamples
from .ground_truth import GroundTruth

# Two samples may be this far apart: over 10 ms a millimetre is an acceleration of 10 m/s^2, which no error
# of bias, gravity or axes comes near.
LONGEST_SPACING_NS = 10_500_000
SMALLEST_M = 1e-3
# A step is so many times the usual change between samples; it makes two changes of opposite sign, of which
# the sum is at most so much of the difference; and next to them changes are below so much of the limit.
_ABOVE_NOISE, _BALANCE, _CALM = 6.0, 0.5, 0.4
# Steps are a flaw here and there. Where there are more, they are how the truth was written: with few
# decimals, or with values held between updates. Its motion is in its steps then, and none may be taken out.
MOST_A_SECOND, LARGEST_SHARE, _ALWAYS_FEW = 1.0, 0.1, 3
# Positions on a decimal grid of a millimetre or more, m.
_GRIDS_M = (1.0, 0.1, 0.01, 0.001)


@dataclass(frozen=True)
class TruthStep:
    """All positions from ``t_ns`` on are shifted by ``shift_W`` (3,), m."""

    t_ns: int
    shift_W: Array

    @property
    def length_m(self) -> float:
        return float(np.linalg.norm(self.shift_W))


def find_steps(
    truth: GroundTruth, samples: ImuSamples, gravity: float = 9.81
) -> tuple[TruthStep, ...] | None:
    """Steps that may be taken out, in order of time; None where nothing can be judged, or
    :func:`why_kept` has a reason.
    """
    steps = step_candidates(truth, samples, gravity)
    return None if steps is None or why_kept(truth, steps) else steps


def coarseness_m(truth: GroundTruth) -> float:
    """The decimal grid, 1 mm to 1 m, that all positions lie on; 0 where there is none, or nothing moves."""
    p_W = truth.p_W - np.round(truth.p_W[0])
    on_grid = (g for g in _GRIDS_M if np.all(np.abs(p_W / g - np.round(p_W / g)) < 1e-6))
    return next(on_grid, 0.0) if np.any(np.ptp(truth.p_W, axis=0) > 0.0) else 0.0


def why_kept(truth: GroundTruth, steps: tuple[TruthStep, ...]) -> str:
    """Why these steps must not be taken out, in words; empty where they may be."""
    if not steps:
        return ""
    seconds = float(truth.t_ns[-1] - truth.t_ns[0]) * 1e-9
    moves = np.linalg.norm(np.diff(truth.p_W, axis=0), axis=1)
    path, length = float(np.sum(moves)), sum(step.length_m for step in steps)
    many = len(steps) > max(_ALWAYS_FEW, MOST_A_SECOND * seconds)
    if not many and length <= LARGEST_SHARE * path:
        return ""
    grid = coarseness_m(truth)
    held = float(np.mean(moves == 0.0))
    cause = f"its positions are given to {grid:g} m only" if grid else ""
    if not grid and held > 0.5:
        cause = f"{100 * held:.0f} % of its positions repeat the one before"
    counts = f"{len(steps)} jumps in {seconds:.3g} s make up {length:.3g} m of {path:.3g} m of path"
    return f"{counts}: {cause}" if cause else counts


def step_candidates(
    truth: GroundTruth, samples: ImuSamples, gravity: float = 9.81
) -> tuple[TruthStep, ...] | None:
    """Steps of a millimetre or more, in order of time; None where no samples are near enough and covered.

    At each sample the change of velocity between the two intervals around it is set against the specific
    force, turned into the world by the truth's rotation, plus gravity (m/s^2). Biases are left in: over 10 ms
    they move nothing by a tenth of a millimetre.
    """
    t_ns = truth.t_ns
    if len(t_ns) < 4:
        return None
    spacing = np.diff(t_ns)
    dense = (spacing[:-1] <= LONGEST_SPACING_NS) & (spacing[1:] <= LONGEST_SPACING_NS)
    covered = (t_ns[1:-1] >= samples.t_ns[0]) & (t_ns[1:-1] <= samples.t_ns[-1])
    if not np.any(dense & covered):
        return None
    change, spacing_s = _unexpected_change(truth, samples, gravity), np.diff(t_ns)[:, None] * 1e-9
    tested = dense & covered
    size = np.linalg.norm(change * spacing_s[1:], axis=1)
    # A truth with noise of its own changes its velocity all the time.
    limit = max(SMALLEST_M, _ABOVE_NOISE * float(np.median(size[tested])))
    # Both changes that a step makes are those of the interval that it lies in.
    before, after = change[:-1] * spacing_s[1:-1], change[1:] * spacing_s[1:-1]
    large = (np.linalg.norm(before, axis=1) > limit) & (np.linalg.norm(after, axis=1) > limit)
    opposite = np.linalg.norm(before + after, axis=1) < _BALANCE * np.linalg.norm(before - after, axis=1)
    # Where there is a third change next to the two, a sample is wrong, or something else is no single step.
    around = np.pad(tested & (size > _CALM * limit), 2)
    alone = ~around[1:-4] & ~around[4:-1]
    found = np.flatnonzero(tested[:-1] & tested[1:] & large & opposite & alone)
    return tuple(TruthStep(int(t_ns[k + 2]), 0.5 * (before[k] - after[k])) for k in found)


def _unexpected_change(truth: GroundTruth, samples: ImuSamples, gravity: float) -> Array:
    """(M - 2, 3) change of velocity at each inner sample less what the specific force lets expect, m/s."""
    h = np.diff(truth.t_ns)[:, None] * 1e-9
    velocity = np.diff(truth.p_W, axis=0) / h
    inner = truth.t_ns[1:-1]
    force = np.column_stack([np.interp(inner, samples.t_ns, samples.accel[:, a]) for a in range(3)])
    acceleration = np.einsum("mij,mj->mi", truth.R_WB[1:-1], force) - np.array([0.0, 0.0, gravity])
    return np.diff(velocity, axis=0) - 0.5 * (h[:-1] + h[1:]) * acceleration


def without_steps(truth: GroundTruth, steps: tuple[TruthStep, ...] | None) -> GroundTruth:
    """The truth as it would be without its steps: positions after each are moved back. Velocities stay."""
    if not steps:
        return truth
    p_W = truth.p_W.copy()
    for step in steps:
        p_W[truth.t_ns >= step.t_ns] -= step.shift_W
    return replace(truth, p_W=p_W)


def steps_between(steps: tuple[TruthStep, ...] | None, first_ns: int, last_ns: int) -> list[TruthStep]:
    """The steps that change the shape of the path between two stamps."""
    return [step for step in steps or () if first_ns < step.t_ns <= last_ns]
