"""Whether covariances fit errors, and covariances under a robust loss."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import integers, number, reals, require_symmetric, shape_of, sparse_reals
from ..errors import DataError, IndefiniteError
from ..geometry import so3
from ..geometry.charts import poses_of
from ..geometry.so3 import Array
from ..sparsity.rounding import rounding
from .consistency import mean_nees_band


@dataclass(frozen=True, eq=False)
class Nees:
    """Squared errors in units of their covariances (normalised estimation error squared).

    Attributes
    ----------
    values : (m,) one for each error
    degrees_of_freedom : (m,) what each is on average where the covariance is right
    mean : sum of values over sum of degrees of freedom; one where the covariances are right
    low, high : band in which the mean lies with the probability asked for, of independent errors
    """

    values: Array
    degrees_of_freedom: Array
    mean: float
    low: float
    high: float

    @property
    def consistent(self) -> bool:
        """Whether the mean lies in the band; above it the covariances are too small."""
        return self.low <= self.mean <= self.high


def nees(estimate: object, truth: object, covariance: Array, *, probability: float = 0.95) -> Nees:
    """NEES of estimates against the truth, both in the gauge of the covariances.

    Errors of one trajectory are correlated: the band holds for errors of separate runs. A direction without
    variance (held by the gauge) does not count.

    Parameters
    ----------
    estimate, truth : (m, c) vectors, or m poses as (m, 4, 4), (m, 3, 4) or a pair (R, p)
    covariance : (m, c, c) or one (c, c) for all; of poses (position, rotation) with left increments, see
        :func:`vigauge.as_convention`
    probability : that of the band

    Raises DataError for shapes that do not fit, and IndefiniteError for a negative variance.
    """
    number("probability", probability, above=0.0)
    if probability >= 1.0:
        raise DataError("probability", "must be below 1", value=probability)
    if isinstance(estimate, tuple) or len(shape_of("estimate", estimate)) == 3:
        R, p = poses_of(estimate)
        R_true, p_true = poses_of(truth, len(p))
        error = np.concatenate([p - p_true, so3.log(R @ R_true.swapaxes(1, 2))], axis=1)
    else:
        found = reals("estimate", estimate, ("m", "c"))
        error = found - reals("truth", truth, found.shape)
    m, c = error.shape
    if not m:
        raise DataError("estimate", "must have one row at least", value=error.shape)
    one = len(shape_of("covariance", covariance)) == 2
    C = reals("covariance", covariance, (c, c) if one else (m, c, c), matrix=True)
    C = np.broadcast_to(C, (m, c, c))
    require_symmetric("covariance", C)
    size = np.sqrt(np.abs(np.diagonal(C, axis1=1, axis2=2)))
    size = np.where(size > 0.0, size, 1.0)
    values, vectors = np.linalg.eigh(C / size[:, :, None] / size[:, None, :])
    if values.min() < -rounding(c):
        row = int(np.argmin(values.min(axis=1)))
        raise IndefiniteError(
            f"covariance, row {row}: has a negative variance ({values.min():.0e} of its diagonal)"
        )
    varies = values > rounding(c)
    along = np.einsum("mij,mi->mj", vectors, error / size)
    squared = np.sum(np.where(varies, along**2 / np.where(varies, values, 1.0), 0.0), axis=1)
    freedom = varies.sum(axis=1).astype(float)
    total = max(int(freedom.sum()), 1)
    low, high = (bound / total for bound in mean_nees_band(total, 1, probability))
    return Nees(squared, freedom, float(squared.sum()) / total, low, high)


def sandwich(
    J: Any, weights: Array, residuals: Array, covariance: Array, *, groups: Array | None = None
) -> Array:
    """Covariance of an estimate with a robust loss from the spread of its residuals: C (sum g g^T) C.

    g = w r J is the gradient of one residual's loss. It needs no noise level, and outliers that the loss
    weighs down count for what they did. C is best that of the second derivative of the cost: of
    J^T diag(psi') J with psi = w r (Huber: 1 inside the threshold, 0 outside). With the weights in place of
    psi' H is too large where there are outliers, and C too small.

    Parameters
    ----------
    J : (m, n) whitened Jacobian, without weights, array or scipy.sparse matrix
    weights : (m,) w of the loss at the estimate: rho'(r^2) in Ceres' terms
    residuals : (m,) whitened residuals r
    covariance : (n, n) C in a gauge, or some rows of it (k, n); the answer is (k, k), in the same gauge
    groups : (m,) equal numbers for residuals that err together (both coordinates of a pixel)

    Raises DataError for shapes that do not fit and negative weights.
    """
    C = reals("covariance", covariance, ("k", "n"), matrix=True)
    J = sparse_reals("J", J, ("m", C.shape[1]))
    m = J.shape[0]
    weights = reals("weights", weights, (m,))
    if weights.min(initial=0.0) < 0.0:
        row = int(np.argmin(weights))
        raise DataError("weights", "must not be negative", row=row, value=float(weights[row]))
    step = (J * (weights * reals("residuals", residuals, (m,)))[:, None]) @ C.T
    if groups is not None:
        _, number_of = np.unique(integers("groups", groups, (m,)), return_inverse=True)
        total = np.zeros((int(number_of.max(initial=-1)) + 1, len(C)))
        np.add.at(total, number_of, step)
        step = total
    out: Array = step.T @ step
    return out
