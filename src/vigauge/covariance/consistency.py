"""Whether the believed noise fits: chi-square of each group of measurements, and NEES where there is a truth.

At the minimum a group's expected chi-square is not its number of residuals but its
redundancy, the number less what the parameters take from it: tr(Cov H_group). That trace
is the same in every gauge, as no measurement sees the orbit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from scipy.special import gammaincinv

from ..arrays import integer, number, reals, symmetric
from ..errors import DataError
from ..gauge.gauges import FixedGauge
from ..geometry.so3 import Array
from ..model.problem import Problem
from ..model.state import State
from ..solver.normal_equations import inertial_information
from ..solver.residuals import inertial_residual, visual_residual
from .covariance import Covariance

# Of an error, in standard deviations: what may lie outside the gauge of its covariance by rounding.
_OUTSIDE = 1e-6


@dataclass(frozen=True)
class GroupChiSquare:
    """Chi-square per redundancy of the visual and of the inertial measurements, and the redundancies."""

    visual: float
    inertial: float
    visual_redundancy: float
    inertial_redundancy: float


def chi_square(problem: Problem, state: State) -> GroupChiSquare:
    """Chi-squares at a minimum. Redundancies add up to residuals - (n - 4).

    Raises DataError for a problem with a loss, whose errors are no chi-square, and DegenerateError where
    more than the gauge is unobservable.
    """
    problem.require_fits(state)
    if problem.loss is not None:
        raise DataError(
            "problem", "must have no loss: a chi-square is of squares", field="loss", value=problem.loss
        )
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


def nees(error: Array, covariance: Array, dof: int) -> float:
    """Normalised estimation error squared e^T C^+ e: chi-square with ``dof`` degrees where C is right.

    Parameters
    ----------
    error : (n,) estimate minus truth or truth minus estimate, taken to the gauge of the covariance (by the
        projector of Eq. (14), say)
    covariance : (n, n) of the error, in the error's units, singular where a gauge holds something
    dof : rank of the covariance: 9N - 4 for the motion block in a gauge that constrains the motion alone

    Any generalised inverse gives the same number for an error in the gauge. This one inverts the ``dof``
    rows and columns that pivoting finds most independent, each in its own standard deviation.

    Raises DataError where the covariance has a smaller rank, or where the error is not in its gauge.
    """
    error = reals("error", error, ("n",))
    n = len(error)
    covariance = symmetric("covariance", covariance, n)
    dof = integer("nees", dof, field="dof")
    if not 1 <= dof <= n:
        raise DataError("nees", f"must be in 1..{n}", field="dof", value=dof)
    variances = np.diagonal(covariance)
    sigma = np.sqrt(np.where(variances > 0.0, variances, 1.0))
    factor, pivots, rank, _ = scipy.linalg.lapack.dpstrf(covariance / np.outer(sigma, sigma), lower=1)
    if rank < dof:
        raise DataError("covariance", f"must have rank {dof}; give the dof of its gauge", value=int(rank))
    order = pivots - 1
    whitened = scipy.linalg.solve_triangular(factor[:dof, :dof], (error / sigma)[order[:dof]], lower=True)
    outside = (error / sigma)[order[dof:]] - factor[dof:, :dof] @ whitened
    if np.abs(outside).max(initial=0.0) > _OUTSIDE * max(1.0, float(np.linalg.norm(whitened))):
        row = int(order[dof + int(np.argmax(np.abs(outside)))])
        rule = "must be in the gauge of the covariance, whose rank is dof; take it there by Eq. (14)"
        raise DataError("error", rule, row=row, value=float(error[row]))
    return float(whitened @ whitened)


def mean_nees_band(dof: int, trials: int, confidence: float = 0.99) -> tuple[float, float]:
    """Bounds between which the mean NEES of independent trials lies with a probability ``confidence``.

    The sum over trials is chi-square with ``dof * trials`` degrees of freedom where the covariance is right.
    Raises DataError for counts below one and a confidence that is not between 0 and 1.
    """
    count = 1
    for name, given in (("dof", dof), ("trials", trials)):
        if integer("mean_nees_band", given, field=name) < 1:
            raise DataError("mean_nees_band", "must be at least 1", field=name, value=given)
        count *= given
    if not 0.0 < number("mean_nees_band", confidence, field="confidence") < 1.0:
        raise DataError("mean_nees_band", "must be between 0 and 1", field="confidence", value=confidence)
    tails = 0.5 * (1.0 - confidence), 0.5 * (1.0 + confidence)
    # Quantiles of chi-square, as scipy.stats computes them; that takes half a second to import.
    low, high = (float(2.0 * gammaincinv(0.5 * count, tail)) / trials for tail in tails)
    return low, high
