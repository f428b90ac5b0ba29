"""Whether the believed noise fits the data: chi-square of each group of measurements per redundancy.

At the minimum a group's expected chi-square is not its number of residuals but its
redundancy, the number less what the parameters take from it: tr(Cov H_group). That trace
is the same in every gauge, as no measurement sees the orbit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..gauge.gauges import FixedGauge
from ..model.problem import Problem
from ..model.state import State
from ..solver.normal_equations import inertial_information
from ..solver.residuals import inertial_residual, visual_residual
from .covariance import Covariance


@dataclass(frozen=True)
class GroupChiSquare:
    """Chi-square per redundancy of the visual and of the inertial measurements, and the redundancies."""

    visual: float
    inertial: float
    visual_redundancy: float
    inertial_redundancy: float


def chi_square(problem: Problem, state: State) -> GroupChiSquare:
    """Chi-squares at a minimum. Redundancies add up to residuals - (n - 4).

    Raises DegenerateError where more than the gauge is unobservable.
    """
    problem.require_fits(state)
    visual, inertial = visual_residual(problem, state), inertial_residual(problem, state)
    covariance = Covariance.of(problem, state).motion(FixedGauge())
    taken = float(np.vdot(covariance, inertial_information(problem, state)))
    inertial_redundancy = inertial.size - taken
    visual_redundancy = visual.size - (state.n_parameters - 4 - taken)
    return GroupChiSquare(
        visual=float(np.vdot(visual, visual)) / visual_redundancy,
        inertial=float(np.vdot(inertial, inertial)) / inertial_redundancy,
        visual_redundancy=visual_redundancy,
        inertial_redundancy=inertial_redundancy,
    )
