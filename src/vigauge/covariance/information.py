"""From what a solver has (H, J, a Schur complement) to one generalised inverse and the open directions."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import scipy.linalg.lapack as lapack
import scipy.sparse as sparse

from ..arrays import instance, reals, sparse_reals, symmetric
from ..errors import DataError, DegenerateError, IndefiniteError
from ..gauge.group import Group, YawTranslation
from ..gauge.layout import Index, Layout, null_space
from ..geometry.charts import poses_of
from ..geometry.so3 import Array
from ..kernels import symmetric as symmetric_kernels
from ..observability.audit import audit
from ..sparsity.rounding import NOTHING, rounding
from ..sparsity.symmetric import sparse_symmetric
from .estimate import EstimateCovariance
from .foreign import generalised_inverse
from .inverses import DenseInverse, Inverse, Scaled, SchurInverse
from .projection import independent_columns
from .sparse_inverse import SparseInverse

# Largest relative error of a covariance that may come from poses that are good to a few digits only.
_HARMLESS = 1e-3
# Largest share of a point's information that its coupling may lack.
_FOREIGN = 1e-6
# Up to so many columns a matrix is inverted dense, beyond by fronts, which are faster (measured).
_SMALL = 150
# Up to so many columns no Jacobian is squared, for its digits: 30 ms at most (measured).
_UNSQUARED = 400
# Share of a direction's square that makes it one of the group's own.
_OWN = 1.0 - 1e-6


def from_hessian(
    H: Any,
    layout: Layout,
    poses: object,
    velocities: Array | None = None,
    points: Array | None = None,
    *,
    group: Group | None = None,
    gravity: object = None,
    vectors: Mapping[str, Array] | None = None,
) -> EstimateCovariance:
    """The covariance of an estimate from any solver's information matrix, dense or sparse.

    H is J^T J of whitened residuals at the estimate, of the cost 1/2 ||r||^2, without damping, with the
    weights of a robust loss if there is one (:func:`vigauge.sandwich` goes further). Directions of the group
    that H has information along (absolute measurements, the prior of a marginalisation) are found; with
    none left the covariance is the plain inverse, whatever the gauge.

    Parameters
    ----------
    H : (n, n) array or scipy.sparse matrix, both triangles
    layout : what its columns stand for
    poses, velocities, points, group, gravity, vectors : the estimate, as :func:`vigauge.null_space` takes it

    Raises
    ------
    DataError
        for shapes, numbers that are not finite, an H that is not symmetric or has a zero on the diagonal, and
        for poses that are not those at which H was made
    IndefiniteError
        where H has a negative eigenvalue
    DegenerateError
        where more than the group is unobservable
    """
    instance("layout", layout, Layout)
    make = _prepared("H", H, layout.n)
    estimate = _Estimate(layout, poses, velocities, points, group, gravity, vectors)
    return estimate.covariance(*make(estimate))


def from_jacobian(
    J: Any,
    layout: Layout,
    poses: object,
    velocities: Array | None = None,
    points: Array | None = None,
    *,
    group: Group | None = None,
    gravity: object = None,
    vectors: Mapping[str, Array] | None = None,
) -> EstimateCovariance:
    """As :meth:`from_hessian`, from the whitened Jacobian (m, n) of the residuals.

    A dense J is never squared: its QR factor keeps the digits that J^T J loses. A sparse J of more than
    400 columns is squared, as SciPy has no sparse QR. That costs twice the digits: where rows 1e3 times as
    weak as the others hold two halves of a flight together, sigmas are good to 2e-7; at 1e4 to 1e-4; at 1e5
    DegenerateError is raised (measured, 60 keyframes). ``J.toarray()`` keeps the digits.
    """
    instance("layout", layout, Layout)
    estimate = _Estimate(layout, poses, velocities, points, group, gravity, vectors)
    if sparse.issparse(J) and J.shape[1] > _UNSQUARED:
        J = sparse_reals("J", J, ("m", layout.n))
        H = (J.T @ J).tocsc()
        return estimate.covariance(*_sparse(H, H.diagonal(), estimate))
    return estimate.covariance(*_orthogonal(reals("J", J, ("m", layout.n), matrix=True), estimate))


def from_schur(
    S: Any,
    layout: Layout,
    poses: object,
    velocities: Array | None = None,
    *,
    points: Array | None = None,
    coupling: Any = None,
    information: Array | None = None,
    group: Group | None = None,
    gravity: object = None,
    vectors: Mapping[str, Array] | None = None,
) -> EstimateCovariance:
    """As :meth:`from_hessian`, from a Schur complement S = A - B C^-1 B^T, points eliminated.

    Gauges that constrain poses need S alone. The free gauge of the whole, and landmarks, need the rest.

    Parameters
    ----------
    S : (n, n) array or scipy.sparse matrix
    layout : what the columns of S stand for; the points are columns n, n + 1, ... of the answer
    points : (K, 3) eliminated landmarks in W
    coupling : (n, 3K) B, array or scipy.sparse matrix
    information : (K, 3, 3) blocks of C
    """
    instance("layout", layout, Layout)
    make = _prepared("S", S, layout.n)
    if layout.n_points:
        raise DataError("layout", "must be that of S, in which points are eliminated", value=layout.n_points)
    given = [value is not None for value in (points, coupling, information)]
    if any(given) and not all(given):
        raise DataError("points", "must come with coupling and information, or none of the three")
    estimate = _Estimate(layout, poses, velocities, None, group, gravity, vectors)
    found = estimate.covariance(*make(estimate))
    if not all(given):
        return replace(found, whole=not found.U.shape[1])
    X = reals("points", points, ("K", 3))
    whole = layout.with_points(len(X))
    B = sparse_reals("coupling", coupling, (layout.n, 3 * len(X)))
    C = reals("information", information, (len(X), 3, 3), matrix=True)
    try:
        np.linalg.cholesky(C)
    except np.linalg.LinAlgError as error:
        raise DataError("information", "blocks must be positive definite") from error
    C_inverse = np.linalg.inv(C)
    index = np.arange(len(X))
    Y = (sparse.bsr_matrix((C_inverse, index, np.arange(len(X) + 1))) @ B.T).tocsr()
    tangent = null_space(whole, poses, velocities, X, group=group, gravity=gravity, vectors=vectors)
    U = tangent @ np.linalg.lstsq(found.tangent, found.U, rcond=None)[0]
    _require_partners(B.T @ found.U, C, U[layout.n :])
    return replace(
        found,
        layout=whole,
        points=X,
        inverse=SchurInverse(found.inverse, Y, C_inverse),
        tangent=tangent,
        U=U,
        log_det_held=found.log_det_held + float(np.sum(np.linalg.slogdet(C)[1])),
    )


def _require_partners(seen: Array, C: Array, U: Array) -> None:
    """DataError where B^T U + C U is not zero in rows of points: the whole has another null space."""
    own = (C @ U.reshape(len(C), 3, -1)).reshape(U.shape)
    size = np.abs(own).max(initial=0.0) + np.abs(seen).max(initial=0.0)
    wrong = np.abs(seen + own).max(axis=1, initial=0.0) > _FOREIGN * size
    if wrong.any():
        rule = "must belong to points, information and S: together they see the directions that S does not"
        raise DataError("coupling", rule, field=f"point {int(np.argmax(wrong)) // 3}")


class _Estimate:
    """The arguments that all three share, checked."""

    def __init__(
        self,
        layout: Layout,
        poses: object,
        velocities: Array | None,
        points: Array | None,
        group: Group | None,
        gravity: object,
        vectors: Mapping[str, Array] | None,
    ) -> None:
        self.layout, self.points, self.gravity = layout, points, gravity
        self.rest = {"velocities": velocities, "vectors": vectors}
        self.group = YawTranslation() if group is None else group
        self.R, self.p = checked = poses_of(poses, layout.n_keyframes)
        tangent = null_space(
            layout, checked, velocities, points, group=self.group, gravity=gravity, vectors=vectors
        )
        # In the plane a shift along z moves nothing.
        moves = np.any(tangent, axis=0)
        self.tangent = tangent[:, moves]
        self.names = [name for name, some in zip(self.group.directions, moves, strict=True) if some]

    def split(
        self, times: Callable[[Array], Array], scale: Array, *, jacobian: bool = False
    ) -> tuple[Array, tuple[str, ...], float]:
        """Open directions, scaled and orthonormal (n, k), and the names of the group's that are measured.

        ``times`` multiplies columns by A: H of unit diagonal, or a Jacobian whose square it is. What it has
        along a direction is zero where it is rounding; the third value says how much it is along all open
        ones. A Jacobian's is small enough to show what digits the poses lack.
        """
        T = self.tangent / scale[:, None]
        N = independent_columns("poses", T)
        A_N = times(N)
        # The group's own directions, of length one, by N.
        own = N.T @ T
        own /= np.linalg.norm(own, axis=0)
        least = rounding(len(T))
        if jacobian:
            extent = float(np.std(self.p - self.p.mean(axis=0))) or 1.0
            least *= max(1.0, float(np.abs(self.p).max()) / extent)
            _, values, vectors = np.linalg.svd(A_N, full_matrices=False)
            vectors, along = vectors.T, np.linalg.norm(A_N @ own, axis=0)
        else:
            information = N.T @ A_N
            values, vectors = np.linalg.eigh(information)
            along = np.einsum("ij,ij->j", own, information @ own)
            if np.any(values < -least):
                raise IndefiniteError(
                    f"H is not positive semidefinite: {values[0]:.0e} of its diagonal along the gauge"
                )
        opened = vectors[:, values <= least]
        measured = tuple(name for name, some in zip(self.names, along, strict=True) if some > least)
        return N @ opened, measured, float(np.linalg.norm(A_N @ opened))

    def covariance(
        self, inverse: Inverse, U: Array, measured: tuple[str, ...], log_det: float, held: Index
    ) -> EstimateCovariance:
        return EstimateCovariance(
            layout=self.layout,
            R=self.R,
            p=self.p,
            points=self.points,
            group=self.group,
            gravity=self.gravity,
            inverse=inverse,
            tangent=self.tangent,
            U=U,
            measured=measured,
            open=self._named(U),
            log_det_held=log_det,
            held=held,
        )

    def _named(self, U: Array) -> tuple[str, ...]:
        """Names of the open directions; combinations of the rest where the group's own are mixed."""
        if U.shape[1] == len(self.names):
            return tuple(self.names)
        length = np.linalg.norm(self.tangent, axis=0)
        C, _ = np.linalg.qr(np.linalg.lstsq(self.tangent / length, U, rcond=None)[0])
        share = np.sum(C**2, axis=1)
        own = [name for name, part in zip(self.names, share, strict=True) if part > _OWN]
        mixed = [name for name, part in zip(self.names, share, strict=True) if 1.0 - _OWN < part <= _OWN]
        combinations = [f"combination of {', '.join(mixed)}"] * (U.shape[1] - len(own))
        return (*own, *combinations)

    def refusal(self, error: DegenerateError, measured: tuple[str, ...], H: Any) -> DegenerateError:
        """What an audit finds in a singular or indefinite H; else what was found measured is the suspect."""
        hint, name = self._audited(H), ""
        parameters = error.parameters or (() if hint or measured or sparse.issparse(H) else self._open(H))
        if parameters:
            names = dict.fromkeys(map(self.layout.name_of, parameters))
            name = f" ({', '.join(names)})"
        if not hint and measured:
            hint = (
                f". H has some information along {', '.join(measured)}: where nothing absolute was measured,"
                " the poses, velocities or points are not those at which H was made, or lost digits"
            )
        return type(error)(f"{error}{name}{hint}")

    def _open(self, H: Array) -> tuple[int, ...]:
        """Columns that the direction of H with least information beyond the gauge is mostly of."""
        scale = 1.0 / np.sqrt(np.diagonal(H))
        N = independent_columns("poses", self.tangent / scale[:, None])
        weights = np.abs(np.linalg.eigh(H * scale[:, None] * scale + N @ N.T)[1][:, 0])
        largest = np.argsort(-weights)[:4]
        return tuple(map(int, largest[weights[largest] > 0.5 * weights.max()]))

    def other_poses(self, leak: float, H: Any) -> DataError:
        return DataError(
            "poses",
            f"must be those at which H was made: it has {leak:.0e} of its diagonal along the directions that"
            " the measurements do not see. Or they have too few digits (take all about a local origin), or"
            f" the layout names another side, or a little damping is left in H{self._audited(H)}",
        )

    def _audited(self, H: Any) -> str:
        found = audit(
            0.5 * (H + H.T),
            self.layout,
            (self.R, self.p),
            points=self.points,
            group=self.group,
            gravity=self.gravity,
            **self.rest,  # type: ignore[arg-type]
        )
        return "".join(f". An audit finds: {concern}" for concern in found)


_Found = tuple[Inverse, Array, tuple[str, ...], float, Index]


def _rows_to_hold(N: Array) -> Index:
    """Rows of N (n, k) that are far from dependent: holding them stops every open direction."""
    return np.sort(symmetric_kernels.pivots(np.array(N)))


def _scale(diagonal: Array, layout: Layout) -> Array:
    if not np.all(diagonal > NOTHING):
        row = int(np.argmin(diagonal))
        rule = "diagonal must be positive: nothing measures this parameter, take its row and column out"
        raise DataError("H", rule, row=row, field=layout.name_of(row), value=float(diagonal[row]))
    return 1.0 / np.sqrt(diagonal)


def _prepared(name: str, H: Any, n: int) -> Callable[[_Estimate], _Found]:
    """A matrix, checked, that waits for the estimate."""
    if sparse.issparse(H) and H.shape[0] > _SMALL:
        return partial(_sparse, *sparse_symmetric(name, H, n))
    return partial(_dense, symmetric(name, H, n))


def _dense(H: Array, estimate: _Estimate) -> _Found:
    scale = _scale(np.diagonal(H), estimate.layout)
    A = H * scale[:, None] * scale
    N, measured, _ = estimate.split(lambda B: A @ B, scale)
    try:
        G, N = generalised_inverse(A, N)
    except DegenerateError as error:
        raise estimate.refusal(error, measured, H) from error
    except DataError as error:
        raise estimate.other_poses(float(np.linalg.norm(A @ N)), H) from error
    held = _rows_to_hold(N)
    half = np.linalg.cholesky(A + N @ N.T)
    log_det = 2.0 * float(np.sum(np.log(np.diagonal(half)))) + 2.0 * np.linalg.slogdet(N[held])[1]
    log_det -= 2.0 * float(np.sum(np.log(np.delete(scale, held))))
    return Scaled(DenseInverse(G), scale), N * scale[:, None], measured, log_det, held


def _orthogonal(J: Array, estimate: _Estimate) -> _Found:
    """From a dense Jacobian, by its QR factor with columns held."""
    scale = _scale(np.einsum("ij,ij->j", J, J), estimate.layout)
    A = J * scale
    n = A.shape[1]
    N, measured, leak = estimate.split(lambda B: A @ B, scale, jacobian=True)
    held = _rows_to_hold(N)
    keep = np.setdiff1d(np.arange(n), held)
    R = np.asarray(np.linalg.qr(A[:, keep], mode="r"))
    inverse, info = lapack.dtrtri(R) if len(R) == len(keep) else (R, 1)
    size = float(np.linalg.norm(inverse)) if not info else np.inf
    if not size * rounding(n) <= 1.0:
        few = f", with {len(J)} rows for {len(keep)} parameters" if len(J) < len(keep) else ""
        error = DegenerateError(
            f"more is unobservable than the gauge: the Jacobian has too small a rank{few}"
        )
        raise estimate.refusal(error, measured, J.T @ J)
    if leak * size > _HARMLESS:
        raise estimate.other_poses(leak, J.T @ J)
    G = np.zeros((n, n))
    G[np.ix_(keep, keep)] = inverse @ inverse.T
    log_det = 2.0 * float(np.sum(np.log(np.abs(np.diagonal(R)))) - np.sum(np.log(scale[keep])))
    return Scaled(DenseInverse(G), scale), N * scale[:, None], measured, log_det, held


def _sparse(H: Any, diagonal: Array, estimate: _Estimate) -> _Found:
    scale = _scale(diagonal, estimate.layout)
    N, measured, leak = estimate.split(lambda B: scale[:, None] * (H @ (scale[:, None] * B)), scale)
    held = _rows_to_hold(N)
    try:
        inverse = SparseInverse(H, scale, estimate.layout.nodes, held)
    except DegenerateError as error:
        raise estimate.refusal(error, measured, H) from error
    if not inverse.below(_HARMLESS / max(leak, NOTHING)):
        raise estimate.other_poses(leak, H)
    log_det = inverse.log_det - 2.0 * float(np.sum(np.log(np.delete(scale, held))))
    return Scaled(inverse, scale), N * scale[:, None], measured, log_det, held
