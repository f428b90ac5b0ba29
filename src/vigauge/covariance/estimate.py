"""The covariance of anyone's estimate, in any gauge.

A generalised inverse G is made once (:mod:`vigauge.covariance.information`). A gauge's covariance is
Q G Q^T with Q of Eq. (14), an update of rank 2d on the blocks that are asked for.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from ..arrays import indices, instance, reals
from ..errors import DataError, DegenerateError
from ..gauge.gauges import FreeGauge
from ..gauge.group import Group
from ..gauge.layout import POSE, Index, Layout
from ..gauge.normals import gauge_normal
from ..geometry.charts import Poses, chart_named
from ..geometry.so3 import Array
from ..kernels import symmetric
from .inverses import Inverse
from .projection import along_orbit, independent_columns
from .relative import RelativePose, is_still, relative_pose


@dataclass(frozen=True, eq=False, repr=False)
class EstimateCovariance:
    """The covariance of an estimate by another solver, to be asked for in one gauge after another.

    ``vigauge.Covariance.from_hessian``, ``from_jacobian`` and ``from_schur`` make it. Units, order and sides
    are those of the layout. Keyframes and points are addressed by the layout's keys. ``gauge``, in every
    method, is FreeGauge (the pseudo-inverse), FixedGauge, KeyframeGauge(key), CentroidGauge, a tuple of one
    of these and Distance or MeanDepth for the scale, or the normal V itself, (n, d); that of
    :meth:`in_gauge` where it is left out, and FreeGauge before.

    Attributes
    ----------
    layout : what the columns stand for
    R, p : (N, 3, 3) R_WB and (N, 3) p_W of the keyframes
    points : (K, 3) landmarks in W, or None
    group, gravity : the motions that the measurements may not see
    inverse : G, any symmetric matrix with H G H = H
    tangent : (n, d) directions along which the group moves the estimate
    U : (n, k) those that H does not see, the null space of H
    measured : names of the group's directions that H has information along
    open : names of the k open directions; "combination of x, y, yaw" where those are mixed. Where there are
        none H has a plain inverse, which is the answer in every gauge, and no gauge is looked at
    log_det_held, held : log det of H without k columns, and these columns
    whole : False for a Schur complement that came without its points
    """

    layout: Layout
    R: Array
    p: Array
    points: Array | None
    group: Group
    gravity: object
    inverse: Inverse
    tangent: Array
    U: Array
    measured: tuple[str, ...]
    open: tuple[str, ...]
    log_det_held: float
    held: Index
    whole: bool = True
    gauge: Any = field(default_factory=FreeGauge)

    def __repr__(self) -> str:
        layout = self.layout
        parts = f"{layout.n} columns, {layout.n_keyframes} keyframes, {layout.n_points} points"
        return (
            f"EstimateCovariance({parts}, side={layout.side!r}, open={self.open}, measured={self.measured})"
        )

    def in_gauge(self, gauge: Any) -> EstimateCovariance:
        """The same covariance with another gauge for questions that name none; nothing is inverted again.

        Raises DataError for a gauge that does not constrain all open directions, DegenerateError where it
        leaves part of the orbit free.
        """
        other = replace(self, gauge=gauge)
        other._projection  # noqa: B018  (refuses the gauge here)
        return other

    def joint(self, keys: Sequence[Hashable], gauge: Any = None) -> Array:
        """(c, c) covariance of some keyframes together, all their columns, the first key's first."""
        some = [self.layout.columns(key) for key in instance("keys", keys, Iterable)]
        rows = np.concatenate([np.empty(0, dtype=np.int64), *some])
        out = self.entries(rows, rows, gauge)
        return 0.5 * (out + out.T)

    def block(self, a: Hashable, b: Hashable, gauge: Any = None) -> Array:
        """(c_a, c_b) cross covariance of two keyframes; that of one of them for a equal to b."""
        return self.entries(self.layout.columns(a), self.layout.columns(b), gauge)

    def entries(self, rows: Index, columns: Index, gauge: Any = None) -> Array:
        """(r, c) entries of the covariance by columns of H, None for all; DataError for one too many."""
        rows = indices("rows", rows, self.layout.n)
        columns = indices("columns", columns, self.layout.n)
        A, W = self._at(gauge)._projection
        out: Array = self.inverse.across(rows, columns) - A[rows] @ W[columns].T - W[rows] @ A[columns].T
        own = rows[:, None] == columns
        out[own] = np.maximum(out[own], 0.0)
        return out

    def keyframes(
        self,
        gauge: Any = None,
        keys: Sequence[Hashable] | None = None,
        kinds: Sequence[str] | None = None,
        *,
        to: str | None = None,
    ) -> Array:
        """(m, c, c) covariances of single keyframes, all by default; of all their columns, or of some kinds.

        Columns are in the order of ``kinds``, or of ``layout.blocks`` where none are given.

        Where the layout names its keyframes, as those of GTSAM, all are those that have these kinds:
        ``layout.having(kinds)`` in that order.

        ``to`` converts poses from the layout's side to another convention of :func:`vigauge.as_convention`,
        in that one's order: ``keyframes(gauge, to="ros")`` is (m, 6, 6) for PoseWithCovariance. Other kinds
        follow the pose. Poses in the plane have zeros for what does not move.

        Raises DataError for a key or kind that is not there, or where a keyframe lacks some of the columns.
        """
        layout = self.layout
        at = np.arange(layout.n_keyframes)
        if keys is not None:
            at = np.array([layout.place(key) for key in instance("keys", keys, Iterable)], dtype=np.int64)
        if not kinds:
            there = [kind for kind, c in layout.blocks.items() if not len(at) or np.any(c[at] >= 0)]
            kinds = there if to is None else POSE
        kinds = list(instance("kinds", kinds, Iterable))
        if to is not None:
            if not set(POSE) <= set(kinds):
                rule = "must have position and rotation: conventions mix the two"
                raise DataError("kinds", rule, value=kinds)
            kinds = [*POSE, *(kind for kind in kinds if kind not in POSE)]
        rows = layout.columns_of(kinds)
        if keys is None and layout.keys is not None:
            having = layout.places_having(kinds)
            at = having if having.size else at
        lacking = np.flatnonzero(np.any(rows[at] < 0, axis=1))
        if lacking.size:
            key = layout.names[at[lacking[0]]]
            rule = f"must have columns of {', '.join(kinds)}: say which kinds, or ask with block()"
            raise DataError("keys", rule, field=f"keyframe {key}")
        blocks = self._blocks(rows[at], gauge)
        if to is None:
            return blocks
        pose = layout.chart.to(chart_named("to", to), self.R[at], self.p[at])
        # In the plane: x and y, and the turn about z.
        lengths, turns = (layout.blocks[kind].shape[1] for kind in POSE)
        pose = pose[:, :, [*range(lengths), *range(6 - turns, 6)]]
        width = pose.shape[2]
        rest = rows.shape[1] - width
        J = np.zeros((len(at), 6 + rest, width + rest))
        J[:, :6, :width], J[:, 6:, width:] = pose, np.eye(rest)
        return _clean(J @ blocks @ J.swapaxes(1, 2))

    @property
    def poses(self) -> tuple[Array, Array]:
        """R_WB (m, 3, 3) and p_W (m, 3) of the keyframes that ``keyframes(gauge, to=...)`` has."""
        at = self.layout.places_having(POSE)
        return self.R[at], self.p[at]

    def landmarks(self, gauge: Any = None, keys: Sequence[Hashable] | None = None) -> Array:
        """(m, 3, 3) covariances of landmarks, all by default, m^2; DataError for one that is not there."""
        layout = self.layout
        some = slice(None) if keys is None else [layout.point_place(key) for key in keys]
        return self._blocks(layout.points[some], gauge)

    def sigma(self, kind: str, gauge: Any = None) -> Array:
        """(N, c) standard deviations of one kind, of the keyframes that have it, or of "points" (K, 3)."""
        blocks = self.landmarks(gauge) if kind == "points" else self.keyframes(gauge, None, [kind])
        return np.sqrt(np.diagonal(blocks, axis1=1, axis2=2))

    def relative_pose(self, i: Hashable, j: Hashable, gauge: Any = None) -> RelativePose:
        """The pose of keyframe j in keyframe i's frame, with its covariance, which no gauge changes.

        Where the scale is open it does depend on the gauge, which must then be given.

        Raises DataError for a key that is not there, and where the scale is open and no gauge given.
        """
        a, b = self.layout.place(i), self.layout.place(j)
        pose, J_i, J_j = relative_pose(self.R[a], self.p[a], self.R[b], self.p[b])
        world_i, rows_i = self.layout.world_from(i, self.R, self.p)
        world_j, rows_j = self.layout.world_from(j, self.R, self.p)
        J = np.concatenate([J_i @ world_i, J_j @ world_j], axis=1)
        rows = np.concatenate([rows_i, rows_j])
        if is_still(J, self.U[rows]):
            C = self.inverse.across(rows, rows)
        elif gauge is None and isinstance(self.gauge, FreeGauge):
            raise DataError("gauge", "must be given: an open direction (the scale?) moves relative poses")
        else:
            C = self.entries(rows, rows, gauge)
        covariance = J @ C @ J.T
        return replace(pose, covariance=0.5 * (covariance + covariance.T))

    def log_det(self, gauge: Any = None) -> float:
        """Logarithm of the product of the covariance's eigenvalues that are not zero, for D-optimality.

        The gauge adds ``log det(V^T V) + log det(U^T U) - 2 log |det(V^T U)|``, which only depends on the
        estimate: differences between two sets of measurements at one estimate are the same in every
        gauge. Those of the trace (A-optimality) and of the largest eigenvalue (E-optimality) are not.
        """
        if not self.U.shape[1]:
            return -self.log_det_held
        V = self._at(gauge)._normal
        change = np.linalg.slogdet(V.T @ V)[1] - 2.0 * np.linalg.slogdet(V.T @ self.U)[1]
        return float(-self.log_det_held + change + 2.0 * np.linalg.slogdet(self.U[self.held])[1])

    def matrix(self, gauge: Any = None) -> Array:
        """(n, n) the whole covariance; for small problems."""
        rows = np.arange(self.layout.n)
        out = self.entries(rows, rows, gauge)
        return 0.5 * (out + out.T)

    def _at(self, gauge: Any) -> EstimateCovariance:
        return self if gauge is None else replace(self, gauge=gauge)

    def _blocks(self, rows: Index, gauge: Any) -> Array:
        A, W = self._at(gauge)._projection
        out = self.inverse.blocks(rows)
        symmetric.project_blocks(out, np.ascontiguousarray(A), np.ascontiguousarray(W), rows)
        return out

    @cached_property
    def _projection(self) -> tuple[Array, Array]:
        """A and W (n, k) of the update G - A W^T - W A^T."""
        if not self.U.shape[1]:
            return self.U, self.U
        V = self._normal
        W = along_orbit(self.U, V)
        G_V = self.inverse.times(V)
        return G_V - 0.5 * W @ (V.T @ G_V), W

    @cached_property
    def _normal(self) -> Array:
        """V (n, k): the gauge's constraints, or those combinations of them that stop the open directions."""
        n, k, d = len(self.U), self.U.shape[1], self.tangent.shape[1]
        gauge = self.gauge
        if isinstance(gauge, FreeGauge):
            if not self.whole:
                raise DataError(
                    "gauge",
                    "the free gauge of the whole needs what was eliminated: give from_schur points, coupling"
                    " and information (or gauge=covariance.U, for the free gauge of the rest alone)",
                )
            return self.U
        if isinstance(gauge, np.ndarray):
            V = reals("gauge", gauge, (n, "d"), matrix=True)
        else:
            V = gauge_normal(
                self.layout,
                Poses(self.R, self.p),
                gauge,
                group=self.group,
                points=self.points,
                gravity=self.gravity,
            )
            V = V[:, np.any(V, axis=0)]  # in the plane no column has a height
        if V.shape[1] < k or V.shape[1] not in (k, d):
            rule = f"must constrain the {k} open directions ({', '.join(self.open)})"
            hint = "; add vg.Distance or vg.MeanDepth for the scale" if "scale" in self.open else ""
            raise DataError("gauge", rule + hint, value=V.shape[1])
        V = independent_columns("gauge", V)
        if V.shape[1] == k:
            return V
        # V M^T is dual to the group's tangent; what belongs to the open directions is kept.
        coordinates = np.linalg.lstsq(self.tangent, self.U, rcond=None)[0]
        try:
            return along_orbit(V, self.tangent) @ coordinates
        except DegenerateError as error:
            raise DegenerateError("the gauge's constraints leave part of the group free") from error


def _clean(C: Array) -> Array:
    """(m, c, c) covariances, symmetric, with zero variance and not rounding below it where a gauge holds."""
    C = 0.5 * (C + C.swapaxes(1, 2))
    variances = np.einsum("mcc->mc", C)
    np.maximum(variances, 0.0, out=variances)
    return C
