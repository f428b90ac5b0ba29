"""Covariances of positions as ellipsoids, for pictures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from ..arrays import integer, number, reals
from ..errors import DataError
from ..geometry.so3 import Array

# Share of the largest entry that may be missing to symmetry and to positive eigenvalues, as rounding.
_ROUNDED = 1e-8


@dataclass(frozen=True, eq=False)
class Ellipsoids:
    """What :func:`vigauge.ellipsoids` gives.

    Attributes
    ----------
    semi_axes : (N, 3) lengths, longest first; the covariance's unit
    rotations : (N, 3, 3) from the axes of the ellipsoids to those of the covariance, one axis a column
    """

    semi_axes: Array
    rotations: Array

    @property
    def quaternions(self) -> Array:
        """(N, 4) the rotations as x, y, z, w."""
        out: Array = Rotation.from_matrix(self.rotations).as_quat(canonical=True).reshape(-1, 4)
        return out

    def surfaces(self, centres: Array, n: int = 16) -> Array:
        """(N, 3, 2n, n) x, y, z of points around centres (N, 3), each a grid that Matplotlib's surfaces take.

        Raises DataError for shapes that do not fit, and for n below 3.
        """
        centres, n = reals("centres", centres, (len(self.semi_axes), 3)), integer("n", n)
        if n < 3:
            raise DataError("n", "must be 3 or more", value=n)
        around, down = np.meshgrid(np.linspace(0, 2 * np.pi, 2 * n), np.linspace(0, np.pi, n), indexing="ij")
        sphere = np.stack([np.cos(around) * np.sin(down), np.sin(around) * np.sin(down), np.cos(down)])
        grown = self.rotations * self.semi_axes[:, None, :]
        return np.tensordot(grown, sphere, axes=1) + centres[:, :, None, None]


def ellipsoids(covariance: Array, k: float = 1.0) -> Ellipsoids:
    """Where the error of a position lies: x^T C^-1 x <= k^2, of each covariance.

    In three dimensions the share of errors inside is 20 % for k = 1, 74 % for 2 and 97 % for 3:
    ``scipy.stats.chi2.cdf(k**2, 3)``.

    Parameters
    ----------
    covariance : (N, 3, 3), or (N, c, c) of keyframes whose first three axes are the position, in W
    k : how many sigmas

    Raises DataError for another shape, an asymmetric covariance or a negative eigenvalue beyond rounding.
    """
    k = number("k", k, above=0.0)
    C = reals("covariance", covariance, ("N", "c", "c"), matrix=True)
    if C.shape[1] < 3 or C.shape[1] != C.shape[2]:
        raise DataError("covariance", "must have shape (N, 3, 3) or larger blocks", value=C.shape)
    C = C[:, :3, :3]
    # By the largest of all: where a gauge holds a keyframe, its own is only rounding.
    size, skew = np.abs(C).max(initial=0.0), np.abs(C - C.swapaxes(1, 2)).max(axis=(1, 2), initial=0.0)
    if np.any(skew > _ROUNDED * size):
        row = int(np.argmax(skew))
        raise DataError("covariance", "must be symmetric", row=row, value=float(skew[row]))
    values, vectors = np.linalg.eigh(0.5 * (C + C.swapaxes(1, 2)))
    if np.any(values < -_ROUNDED * size):
        row = int(np.argmin(values.min(axis=1, initial=0.0)))
        rule = "must have no negative eigenvalue"
        raise DataError("covariance", rule, row=row, value=float(values[row].min()))
    vectors = vectors[:, :, ::-1].copy()
    vectors[:, :, 2] *= np.sign(np.linalg.det(vectors))[:, None]  # a rotation, no mirror
    return Ellipsoids(k * np.sqrt(np.maximum(values[:, ::-1], 0.0)), vectors)
