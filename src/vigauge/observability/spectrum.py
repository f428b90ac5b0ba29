"""The spectrum of an information matrix: what is zero to rounding, and which known directions are.

Everything is compared after Jacobi scaling (unit diagonal), in which metres, radians and
near or far landmarks weigh alike. One rule, :func:`rounding`, says what is zero: the rank of
Table I, the diagnosis, the condition number and the covariances all ask it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import DegenerateError, IndefiniteError, SolverError
from ..geometry.so3 import Array
from ..solver.normal_equations import NormalEquations, ReducedSystem
from ..sparsity.layout import Index
from ..sparsity.rounding import NOTHING, rounding

# Cosine above which a direction lies in the null space. Eigenvectors there are good to the
# rounding error over the gap, so 1e-6 leaves room for gaps down to 1e-7.
_INSIDE = 1.0 - 1e-6

# Directions of unit length are dependent where their smallest singular value is below. A turn and a shift
# seen from the centre of the Earth come to 1e-8 for a path of a tenth of a metre.
DEPENDENT = 1e-11


def scaled_eigenvalues(matrix: Array) -> Array:
    """Eigenvalues, ascending, of a symmetric matrix scaled to a unit diagonal (Jacobi scaling)."""
    scale = 1.0 / np.sqrt(np.diagonal(matrix))
    return np.linalg.eigvalsh(matrix * scale[:, None] * scale)


@dataclass(frozen=True)
class Spectrum:
    """Eigenvalues of the Jacobi-scaled reduced camera system, ascending, and what they say.

    Scaling makes metres, radians and near or far landmarks comparable; rank is that of H.
    """

    eigenvalues: Array
    n_landmarks: int

    @classmethod
    def of(cls, reduced: ReducedSystem, held: Index | None = None) -> Spectrum:
        """Spectrum of a reduced camera system without its ``held`` columns."""
        S = reduced.matrix
        if held is not None and len(held):
            keep = np.setdiff1d(np.arange(len(S)), held)
            S = S[np.ix_(keep, keep)]
        return cls(scaled_eigenvalues(S), reduced.structure.n_landmarks)

    @property
    def _null(self) -> np.ndarray:
        return is_null(self.eigenvalues, len(self.eigenvalues), float(np.abs(self.eigenvalues).max()))

    @property
    def gap(self) -> float:
        """Smallest magnitude that is not zero to rounding over the largest that is.

        It says how clear the null directions are. Without any the smallest eigenvalue is
        compared with the rounding error of the largest.
        """
        return _gap(self.eigenvalues, self._null)

    @property
    def nullity(self) -> int:
        """Number of directions without information."""
        return int(np.count_nonzero(self._null))

    @property
    def rank(self) -> int:
        """Rank of H: the landmark blocks that were eliminated have full rank."""
        return len(self.eigenvalues) - self.nullity + 3 * self.n_landmarks

    @property
    def condition(self) -> float:
        """Largest over smallest eigenvalue; infinite where the matrix is singular to rounding."""
        smallest, largest = float(self.eigenvalues[0]), float(self.eigenvalues[-1])
        return largest / smallest if smallest > rounding(len(self.eigenvalues)) * largest else np.inf


def is_null(eigenvalues: Array, n: int, largest: float) -> np.ndarray:
    """Which eigenvalues of a scaled (n, n) matrix, whose largest is given, are zero to rounding."""
    # Of H scaled to a unit diagonal the largest is at least one; a Schur complement may be all rounding.
    return eigenvalues < rounding(n) * max(largest, 1.0)


def _gap(eigenvalues: Array, null: np.ndarray) -> float:
    magnitude = np.abs(eigenvalues)
    if null.all():
        return 0.0
    return float(magnitude[~null].min() / np.max(magnitude[null], initial=np.finfo(float).eps))


def condition_number(equations: NormalEquations) -> float:
    """Condition of the Jacobi-scaled reduced camera system, any prior included; infinite where singular.

    (The scaling is that of the solver's damping, so a large weight alone does not make it large.)
    """
    try:
        reduced = equations.eliminate()
    except SolverError:
        return np.inf  # a landmark's own block is singular
    if not np.all(np.diagonal(reduced.matrix) > 0.0):
        return np.inf
    return Spectrum.of(reduced).condition


def require_regular(trace: float, n: int) -> None:
    """DegenerateError where an (n, n) matrix, scaled to a unit diagonal, is singular to rounding.

    ``trace`` is that of its inverse, which lies between one and n times 1 / (smallest eigenvalue).
    A factorisation may succeed on a singular matrix, with pivots made of rounding errors.
    """
    if not trace * rounding(n) <= 1.0:
        raise DegenerateError(
            f"more is unobservable than the gauge: the scaled information is singular (below {n / trace:.0e})"
        )


def require_semidefinite(A: Array) -> None:
    """IndefiniteError where a matrix A that was scaled to a unit diagonal has a negative eigenvalue."""
    _require_semidefinite(*np.linalg.eigh(0.5 * (A + A.T)))


def _require_semidefinite(eigenvalues: Array, vectors: Array) -> None:
    if eigenvalues[0] < -rounding(len(vectors)) * max(float(np.abs(eigenvalues).max()), 1.0):
        raise indefinite(float(eigenvalues[0]), vectors[:, 0])


def indefinite(value: float, direction: Array) -> IndefiniteError:
    """What to say of a scaled matrix with a negative ``value`` along a unit direction (n,)."""
    weights = np.abs(direction)
    largest = np.argsort(-weights)[:4]
    where = sorted(map(int, largest[weights[largest] > 0.5 * weights.max()]))
    return IndefiniteError(
        f"H is not positive semidefinite: {value:.0e} of its diagonal in a direction mostly of"
        f" parameter {', '.join(map(str, where))}. It is no sum of squares, or lost digits"
        " (stored in single precision, or as differences of large numbers)",
        parameters=tuple(where),
    )


def unit_scale(diagonal: Array) -> Array:
    """Roots of a diagonal. A parameter without any information keeps its unit."""
    return np.sqrt(np.where(diagonal > NOTHING, diagonal, 1.0))


class NullSpace:
    """Null space of a symmetric matrix after Jacobi scaling, and which of it is explained so far."""

    def __init__(self, matrix: Array, diagonal: Array) -> None:
        self.scale = unit_scale(diagonal)
        A = matrix / self.scale[:, None] / self.scale
        eigenvalues, vectors = np.linalg.eigh(0.5 * (A + A.T))
        self._keep(A, eigenvalues, vectors, max(float(np.max(np.abs(eigenvalues))), 1.0))

    def _keep(self, matrix: Any, eigenvalues: Array, vectors: Array, largest: float) -> None:
        self.matrix, self.eigenvalues, self.vectors, self.largest = matrix, eigenvalues, vectors, largest
        self._null = is_null(eigenvalues, len(vectors), largest)
        self.basis = vectors[:, self._null]
        self.explained = np.zeros((len(vectors), 0))
        self.gap = _gap(eigenvalues, self._null)

    def require_semidefinite(self) -> None:
        """IndefiniteError where the matrix has a negative eigenvalue."""
        _require_semidefinite(self.eigenvalues, self.vectors)

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
        return self._take(self.basis.T @ span[:, sizes > DEPENDENT * max(float(sizes.max(initial=0.0)), 1.0)])

    def take_parameters(self, rows: Index) -> Array:
        """As :meth:`take`, of the unit vectors of some parameters."""
        if not self.unexplained or not rows.size:
            return self.explained[:, :0]
        return self._take(self.basis[rows].T)

    def _take(self, along: Array) -> Array:
        """Of the span of orthonormal directions, whose products with the basis are given."""
        left, cosines, _ = np.linalg.svd(along, full_matrices=False)
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

    def sigma(self, functional: Array) -> float:
        """Marginal standard deviation of a linear function (n,) that is zero on the null space."""
        return float(np.sqrt(self.marginal(functional[:, None])[0, 0]))

    def marginal(self, functionals: Array) -> Array:
        """(c, c) covariance of linear functions (n, c) that are zero on the null space."""
        along = (functionals / self.scale[:, None]).T @ self.vectors
        known = ~self._null
        return (along[:, known] / self.eigenvalues[known]) @ along[:, known].T

    def eigenvalue(self, directions: Array) -> float:
        """Largest scaled information along scaled unit directions, next to the largest eigenvalue."""
        information = np.einsum("ij,ij->j", directions, self.matrix @ directions)
        return float(np.max(np.abs(information), initial=0.0)) / self.largest
