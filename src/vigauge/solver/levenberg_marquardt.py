"""Levenberg-Marquardt with the trust-region policy of Ceres, which the paper used (Section IV-B).

The policy decides the iteration counts that the paper compares, so it is followed to the
detail: Jacobi scaling by the first Jacobian, damping by the clamped diagonal, Nielsen's
radius update, and a step that meets the function or parameter tolerance ends the run
without being taken. ``Solution.iterations`` counts as Ceres does: the initial evaluation
and every step tried, but not that last one.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from ..arrays import instance, integer, number
from ..errors import DataError, SolverError
from ..gauge.gauges import Gauge
from ..geometry.so3 import Array
from ..kernels.damping import clamped, largest, predicted_decrease, squares
from ..model.factors import LinearFactor
from ..model.problem import Problem
from ..model.state import State
from ..sparsity.layout import Layout
from .normal_equations import NormalEquations, linearise
from .residuals import Evaluation, down_weighted, evaluate
from .workers import Workers


class Status(StrEnum):
    """Why a run ended. The first three mean convergence."""

    FUNCTION_TOLERANCE = "function tolerance"
    GRADIENT_TOLERANCE = "gradient tolerance"
    PARAMETER_TOLERANCE = "parameter tolerance"
    ITERATION_LIMIT = "iteration limit"
    RADIUS_COLLAPSED = "trust region collapsed"
    INVALID_STEPS = "too many invalid steps"
    NON_FINITE = "non-finite cost"


CONVERGED = frozenset({Status.FUNCTION_TOLERANCE, Status.GRADIENT_TOLERANCE, Status.PARAMETER_TOLERANCE})


@dataclass(frozen=True)
class Options:
    """Tolerances and limits; the defaults are those of Ceres. ``threads`` changes the time only.

    Raises DataError for a negative number, one that is not finite, or a count that is no integer.
    """

    initial_radius: float = 1e4
    maximum_radius: float = 1e16
    minimum_radius: float = 1e-32
    minimum_diagonal: float = 1e-6
    maximum_diagonal: float = 1e32
    minimum_decrease: float = 1e-3
    function_tolerance: float = 1e-6
    gradient_tolerance: float = 1e-10
    parameter_tolerance: float = 1e-8
    maximum_iterations: int = 50
    maximum_invalid_steps: int = 5
    threads: int = 1

    def __post_init__(self) -> None:
        for name, default in type(self).__dataclass_fields__.items():
            value = (integer if isinstance(default.default, int) else number)(
                "options", getattr(self, name), field=name
            )
            if value < (1 if name == "threads" else 0):
                raise DataError("options", "must not be negative", field=name, value=value)


# Made and checked once, not in every solve.
_CERES_DEFAULTS = Options()


class Iteration(NamedTuple):
    """One row of the trace; entry 0 is the start.

    ``cost`` at the state that the iteration leaves; ``radius`` of the trust region
    (damping = diagonal / radius); ``accepted``; ``mean_reprojection_px``;
    ``prior_position_m`` and ``prior_yaw_rad``: distance of the first pose from its initial
    value (Fig. 6); ``seconds`` since the start by the caller's clock.
    """

    cost: float
    radius: float
    accepted: bool
    mean_reprojection_px: float
    prior_position_m: float
    prior_yaw_rad: float
    seconds: float


@dataclass(frozen=True)
class Solution:
    """Estimate, how the run ended, and its trace; ``states`` holds every iterate when asked for.

    ``layout`` says how the reduced camera system was factorised: dense or banded, in which
    order of keyframes, and how much is stored (its fill-in). ``down_weighted`` is how many reprojection
    errors are longer than ``delta`` of the problem's loss; their weight is below 1 (Huber) or 1/2 (Cauchy).
    """

    state: State
    status: Status
    cost: float
    trace: tuple[Iteration, ...]
    seconds: float
    layout: Layout
    states: tuple[State, ...] = ()
    down_weighted: int = 0

    @property
    def iterations(self) -> int:
        """Count as Ceres reports it, the initial evaluation included."""
        return len(self.trace)

    @property
    def converged(self) -> bool:
        return self.status in CONVERGED


@dataclass
class _TrustRegion:
    """Radius and its update (Ceres' Levenberg-Marquardt strategy; Nielsen's rule)."""

    options: Options
    radius: float = field(init=False)
    decrease: float = 2.0

    def __post_init__(self) -> None:
        self.radius = self.options.initial_radius

    def accept(self, quality: float) -> None:
        self.radius /= max(1.0 / 3.0, 1.0 - (2.0 * quality - 1.0) ** 3)
        self.radius = min(self.radius, self.options.maximum_radius)
        self.decrease = 2.0

    def reject(self) -> None:
        self.radius /= self.decrease
        self.decrease *= 2.0


class _Evaluation(NamedTuple):
    """A state, the gauge's prior there, and the cost with and without it."""

    state: State
    prior: LinearFactor | None
    cost: float
    measurements: Evaluation


class _Objective:
    """The cost of one gauge: Eq. (1), plus Eq. (11) where the gauge has a prior."""

    def __init__(self, problem: Problem, gauge: Gauge, workers: Workers) -> None:
        self.problem = problem
        self.gauge = gauge
        self.workers = workers
        self.spent: NormalEquations | None = None

    def evaluate(self, state: State) -> _Evaluation:
        found = evaluate(self.problem, state)
        cost = found.cost
        prior = self.gauge.prior(state, self.problem.initial)
        if prior is not None:
            cost += 0.5 * float(np.vdot(prior.residual, prior.residual))
        return _Evaluation(state, prior, cost, found)

    def linearise(self, here: _Evaluation) -> NormalEquations:
        """Equations at a state; those made before are no longer valid."""
        self.spent = linearise(
            self.problem,
            here.state,
            self.workers,
            R_CW=here.measurements.R_CW,
            spent=self.spent,
            prior=here.prior,
        )
        return self.spent


def _state_norm(state: State, origin: Array | None) -> float:
    """Norm of the parameters as Ceres sees them: unit quaternions for rotations after the first.

    Lengths are about ``origin``, if any: next to the distance of the Earth's centre every step is short.
    """
    p_W, X_W = (state.p_W, state.X_W) if origin is None else (state.p_W - origin, state.X_W - origin)
    vectors: tuple[Array, ...] = p_W, state.v_W, X_W
    if state.gyro_bias is not None and state.accel_bias is not None:
        vectors += state.gyro_bias, state.accel_bias
    return math.sqrt(squares(state.dphi_0, *vectors) + len(p_W) - 1)


def solve(
    problem: Problem,
    gauge: Gauge,
    options: Options | None = None,
    *,
    clock: Callable[[], float] = lambda: 0.0,
    keep_states: bool = False,
    start: State | None = None,
) -> Solution:
    """Minimise Eq. (1) from ``problem.initial`` under a gauge.

    Parameters
    ----------
    start : state to begin from, if another than ``problem.initial``, which gauges and priors still refer to
    clock : seconds, e.g. ``time.perf_counter``; without it every time in the trace is 0
    keep_states : keep the state of every iteration (Fig. 2)

    A run that cannot go on ends with a status that says so. Raises DataError for arguments of another kind.
    """
    instance("problem", problem, Problem)
    instance("gauge", gauge, Gauge)
    options = _CERES_DEFAULTS if options is None else instance("options", options, Options)
    # What is done in one piece is done here: threads would only have to be started.
    with Workers(options.threads if len(problem.structure.pieces) > 1 else 1) as workers:
        return _Run(problem, gauge, options, clock, keep_states, workers, start).solve()


class _Run:
    """One minimisation: the loop of Ceres' trust-region minimiser."""

    def __init__(
        self,
        problem: Problem,
        gauge: Gauge,
        options: Options,
        clock: Callable[[], float],
        keep_states: bool,
        workers: Workers,
        start: State | None,
    ) -> None:
        self.problem, self.options, self.clock, self.keep_states = problem, options, clock, keep_states
        self.begin = clock()
        self.objective = _Objective(problem, gauge, workers)
        self.held = gauge.held(problem.initial)
        self.origin = problem.initial.local_origin
        self.region = _TrustRegion(options)
        self.trace: list[Iteration] = []
        self.states: list[State] = []
        self.moved = False
        begin = problem.initial if start is None else problem.require_fits(start)
        self.here = self.objective.evaluate(begin)
        # No state's norm is larger: a step adds its length at most.
        self.largest_norm = _state_norm(begin, self.origin)

    def solve(self) -> Solution:
        self._record(accepted=True)
        if not np.isfinite(self.here.cost):
            return self._end(Status.NON_FINITE)
        self._linearise()
        # Column scaling is that of the first Jacobian for the whole run (Ceres' jacobi_scaling);
        # it matters only where it meets the clamps of the damping.
        scale = 1.0 / (1.0 + np.sqrt(self.diagonal))
        self.scale_squared = scale * scale
        invalid = 0
        while True:
            status = self._must_stop()
            if status is not None:
                return self._end(status)
            step, decrease, length = self._step()
            if step is None or not 0.0 < decrease < math.inf:
                invalid += 1
                if invalid >= self.options.maximum_invalid_steps:
                    return self._end(Status.INVALID_STEPS)
                self._rejected()
                continue
            invalid = 0
            status = self._try(step, decrease, length)
            if status is not None:
                return self._end(status)

    def _try(self, step: Array, predicted_decrease: float, length: float) -> Status | None:
        """Go to the end of the step if it is good; a status ends the run."""
        there = self.objective.evaluate(self.here.state.stepped(step))
        if self.moved and self._is_short(length):
            return Status.PARAMETER_TOLERANCE
        change = self.here.cost - there.cost
        if abs(change) <= self.options.function_tolerance * self.here.cost:
            return Status.FUNCTION_TOLERANCE
        quality = change / predicted_decrease
        if quality > self.options.minimum_decrease:
            self.here, self.moved = there, True
            self.largest_norm += length
            self._linearise()
            self.region.accept(quality)
            self._record(accepted=True)
        else:
            self._rejected()
        return None

    def _linearise(self) -> None:
        self.equations = self.objective.linearise(self.here)
        self.diagonal, self.gradient = self.equations.diagonal_and_gradient()
        self.gradient[self.held] = 0.0

    def _is_short(self, length: float) -> bool:
        """Whether a step is nothing beside the state."""
        tolerance = self.options.parameter_tolerance
        if length > tolerance * (self.largest_norm + tolerance):
            return False
        return length <= tolerance * (_state_norm(self.here.state, self.origin) + tolerance)

    def _step(self) -> tuple[Array | None, float, float]:
        """The damped step, the decrease of the cost that the linear model predicts, and the step's length."""
        o = self.options
        damping = np.empty(len(self.diagonal))
        clamped(
            self.diagonal,
            self.scale_squared,
            o.minimum_diagonal,
            o.maximum_diagonal,
            self.region.radius,
            damping,
        )
        try:
            reduced = self.equations.eliminate(damping, self.objective.workers)
            step = reduced.solve(self.held, overwrite=True)
        except SolverError:
            return None, 0.0, 0.0  # counted as an invalid step: the next one is damped more
        return step, *predicted_decrease(self.gradient, damping, step)

    def _rejected(self) -> None:
        self.region.reject()
        self._record(accepted=False)

    def _must_stop(self) -> Status | None:
        if len(self.trace) > self.options.maximum_iterations:
            return Status.ITERATION_LIMIT
        if self.trace[-1].accepted and largest(self.gradient) <= self.options.gradient_tolerance:
            return Status.GRADIENT_TOLERANCE
        if self.region.radius <= self.options.minimum_radius:
            return Status.RADIUS_COLLAPSED
        return None

    def _record(self, accepted: bool) -> None:
        state, start = self.here.state, self.problem.initial
        self.trace.append(
            Iteration(
                cost=self.here.cost,
                radius=self.region.radius,
                accepted=accepted,
                mean_reprojection_px=self.here.measurements.mean_reprojection_px,
                prior_position_m=math.dist(state.p_W[0].tolist(), start.p_W[0].tolist()),
                prior_yaw_rad=float(abs(state.dphi_0[2])),
                seconds=self.clock() - self.begin,
            )
        )
        if self.keep_states:
            self.states.append(state)

    def _end(self, status: Status) -> Solution:
        return Solution(
            state=self.here.state,
            status=status,
            cost=self.here.cost,
            trace=tuple(self.trace),
            seconds=self.clock() - self.begin,
            layout=self.problem.structure.layout,
            states=tuple(self.states),
            down_weighted=down_weighted(self.problem, self.here.state),
        )
