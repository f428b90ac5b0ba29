"""The null space of an information matrix, and which known directions lie in it.

Everything is compared after Jacobi scaling (unit diagonal), in which metres, radians and
near or far landmarks weigh alike.
"""

from __future__ import annotations

import numpy as np

from ..geometry.so3 import Array

# Below this share of the largest eigenvalue, times the size, an eigenvalue is a rounding error.
ROUNDING = 1e3 * np.finfo(float).eps

# Cosine above which a direction lies in the null space. Eigenvectors there are good to the
# rounding error over the gap, so 1e-6 leaves room for gaps down to 1e-7.
_INSIDE = 1.0 - 1e-6


class NullSpace:
    """Null space of a symmetric matrix after Jacobi scaling, and which of it is explained so far."""

    def __init__(self, matrix: Array, diagonal: Array) -> None:
        # A parameter without any information keeps its unit.
        self.scale = np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
        self.matrix = matrix / self.scale[:, None] / self.scale
        self.eigenvalues, vectors = np.linalg.eigh(0.5 * (self.matrix + self.matrix.T))
        # Of H scaled to a unit diagonal it is at least one; a Schur complement of it may be all rounding.
        self.largest = max(float(np.max(np.abs(self.eigenvalues))), 1.0)
        null = np.abs(self.eigenvalues) < len(matrix) * ROUNDING * self.largest
        self.basis = vectors[:, null]
        self.explained = np.zeros((len(matrix), 0))
        informative = self.eigenvalues[~null]
        noise = float(np.max(np.abs(self.eigenvalues[null]), initial=np.finfo(float).eps * self.largest))
        self.gap = float(informative.min() / noise) if len(informative) else 0.0

    @property
    def unexplained(self) -> int:
        return self.basis.shape[1] - self.explained.shape[1]

    def take(self, candidates: Array) -> Array:
        """The part of the null space that lies in the span of ``candidates`` (n, c) and is new.

        Returns it as scaled orthonormal columns, and counts it as explained.
        """
        if not self.unexplained or not candidates.size:
            return self.explained[:, :0]
        scaled = candidates * self.scale[:, None]
        length = np.linalg.norm(scaled, axis=0)
        scaled = scaled[:, length > 0.0] / length[length > 0.0]
        span, sizes, _ = np.linalg.svd(scaled, full_matrices=False)
        span = span[:, sizes > 1e-8 * max(float(sizes.max(initial=0.0)), 1.0)]
        left, cosines, _ = np.linalg.svd(self.basis.T @ span, full_matrices=False)
        inside = self.basis @ left[:, cosines > _INSIDE]
        inside -= self.explained @ (self.explained.T @ inside)
        fresh, sizes, _ = np.linalg.svd(inside, full_matrices=False)
        fresh = fresh[:, sizes > 1e-2]
        self.explained = np.concatenate([self.explained, fresh], axis=1)
        return fresh

    def rest(self) -> Array:
        """What nothing has explained, as scaled orthonormal columns."""
        left = self.basis - self.explained @ (self.explained.T @ self.basis)
        vectors, _, _ = np.linalg.svd(left, full_matrices=False)
        return vectors[:, : self.unexplained]

    def eigenvalue(self, directions: Array) -> float:
        """Largest scaled information along scaled unit directions, next to the largest eigenvalue."""
        information = np.einsum("ij,ij->j", directions, self.matrix @ directions)
        return float(np.max(np.abs(information), initial=0.0)) / self.largest
