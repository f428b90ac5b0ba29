"""A two-dimensional chart of the parameter space around a minimum: along the orbit, and across it.

A point (alpha, s) of the chart is the state g_alpha(theta* + s d): the minimum theta*, moved
by s along d, then turned by the yaw alpha about the vertical through the minimum's centroid.
d leads from the minimum to the start of the optimisation. The cost depends on s alone, as
(3) says; it is evaluated, not sketched.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vigauge.covariance.transform import transfer_blocks
from vigauge.gauge.gauges import FixedGauge, yaw_to_first_pose
from vigauge.gauge.group import orbit_tangent
from vigauge.geometry import so3
from vigauge.geometry.so3 import Array
from vigauge.model.evaluation import align_all_poses
from vigauge.model.problem import Problem
from vigauge.model.state import State
from vigauge.solver.normal_equations import NormalEquations, linearise
from vigauge.solver.residuals import cost


@dataclass(frozen=True)
class Chart:
    """The chart, its minimum and its direction across the orbit.

    ``minimum`` theta*; ``direction`` d (9N + 3K,); ``start_yaw`` alpha of the start, rad;
    ``equations`` H at the minimum, whose metric measures s.
    """

    problem: Problem
    minimum: State
    direction: Array
    start_yaw: float
    equations: NormalEquations

    @classmethod
    def around(cls, problem: Problem, minimum: State) -> Chart:
        """Chart through the problem's start, at (start_yaw, 1)."""
        aligned = align_all_poses(problem.initial, minimum)
        direction = minimum.local(aligned)
        return cls(
            problem, minimum, direction, -_yaw_between(problem.initial, aligned), linearise(problem, minimum)
        )

    @property
    def pivot_W(self) -> Array:
        """Point that turns of the chart leave in place."""
        return self.minimum.p_W.mean(axis=0)

    def state(self, alpha: float, s: float) -> State:
        """The state at a point of the chart."""
        across = self.minimum.retract(s * self.direction)
        return across.transformed(alpha, self.pivot_W - so3.yaw_rotation(alpha) @ self.pivot_W)

    def cost(self, s: float, alpha: float = 0.0) -> float:
        """Eq. (1) at a point of the chart, halved."""
        return cost(self.problem, self.state(alpha, s))

    def locate(self, state: State) -> tuple[float, float]:
        """(alpha, s) nearest to a state: yaw of its alignment, and projection onto d in the metric of H."""
        aligned = align_all_poses(state, self.minimum)
        H_d = self.equations.times(self.direction)
        return -_yaw_between(state, aligned), float(
            self.minimum.local(aligned) @ H_d / (self.direction @ H_d)
        )

    def gauge_yaw(self, s: float) -> float:
        """alpha at which the gauge C (first yaw as at the start) crosses the chart at s."""
        return yaw_to_first_pose(self.minimum.retract(s * self.direction))


def _yaw_between(state: State, aligned: State) -> float:
    """Yaw of the 4-DoF transformation that took ``state`` to ``aligned``."""
    return float(so3.log(aligned.R_WB[0] @ state.R_WB[0].T)[2])


@dataclass(frozen=True)
class CarriedPerturbation:
    """A perturbation a u + b d at theta, taken to the gauge by (12), in chart coordinates (alpha, s).

    ``at_estimate`` as drawn; ``carried`` by d(theta_C)/d(theta) along the orbit;
    ``projected`` by Q onto the tangent of the gauge; ``yaw`` of theta_C.
    """

    at_estimate: tuple[float, float]
    carried: tuple[float, float]
    projected: tuple[float, float]
    yaw: float


def carry_perturbation(chart: Chart, a: float, b: float) -> CarriedPerturbation:
    """Both operations of (12) on a perturbation of the minimum, with the real operators.

    The perturbation is a times the orbit's yaw tangent plus b times d, both at theta. D
    takes the tangent at theta to the tangent at theta_C; Q then removes what leads along
    the orbit: with coefficients (V^T U)^-1 V^T D of the perturbation, yaw first.
    """
    gauge = FixedGauge()
    theta = chart.minimum
    moved, yaw = gauge.meet(theta, chart.problem.initial)
    U, U_moved = orbit_tangent(theta), orbit_tangent(moved)
    shift = np.concatenate([[1.0], -np.cross([0.0, 0.0, 1.0], chart.pivot_W)])  # turn about the pivot
    blocks = transfer_blocks(theta, moved, yaw, len(chart.direction) // 3)

    def carry(vector: Array) -> Array:
        return (blocks @ vector.reshape(-1, 3, 1)).ravel()

    carried = carry(a * (U @ shift) + b * chart.direction)
    V = gauge.normal(moved)
    projected = carried - U_moved @ np.linalg.solve(V.T @ U_moved, V.T @ carried)
    basis = np.column_stack([U_moved, carry(chart.direction)])
    return CarriedPerturbation((a, b), _coordinates(carried, basis), _coordinates(projected, basis), yaw)


def _coordinates(vector: Array, basis: Array) -> tuple[float, float]:
    """(alpha, s) of a tangent vector: its coefficients on the first (yaw) and last column of a basis."""
    coefficients = np.linalg.lstsq(basis, vector, rcond=None)[0]
    return float(coefficients[0]), float(coefficients[-1])
