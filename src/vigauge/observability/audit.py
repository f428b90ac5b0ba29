"""What is often wrong with an information matrix from elsewhere, in a sentence each.

All but one of these faults show in the same place: H U, which is zero where U are the directions that no
measurement sees. Damping leaves a multiple of the diagonal there, another chart or unit makes it zero for
another U, a prior leaves the rows of its keyframe, and a lost block those of the two that it joined.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np
import scipy.sparse

from ..arrays import instance, symmetric
from ..gauge.group import Group
from ..gauge.layout import POSE, Index, Layout, null_space
from ..geometry.so3 import Array
from ..kernels.sizes import POSE as POSE_COLUMNS
from ..sparsity.rounding import NOTHING, rounding
from ..sparsity.symmetric import sparse_symmetric
from .hypotheses import Hypothesis, larger_groups, other_estimates, other_layouts, other_units
from .own_blocks import separate, unmeasured

# A diagonal over more decades than this hides its small entries below the rounding of its large ones.
_DECADES = 12.0
# Largest part of H U that an explanation may leave unexplained.
_UNEXPLAINED = 1e-4
# Information beyond that of a usual keyframe at which a column counts as held.
_HELD = 100.0


@dataclass(frozen=True)
class Concern:
    """One finding, in a sentence.

    ``kind`` is "spread", "unmeasured", "parts", "group", "damping", "units", "chart", "order", "poses",
    "velocities", "gravity", "prior" or "block".
    """

    kind: str
    sentence: str

    def __str__(self) -> str:
        return self.sentence


def audit(
    H: Any,
    layout: Layout,
    poses: object,
    velocities: Array | None = None,
    points: Array | None = None,
    *,
    group: Group | None = None,
    gravity: object = None,
    vectors: Mapping[str, Array] | None = None,
) -> tuple[Concern, ...]:
    """What looks wrong with an information matrix, each in a sentence; nothing where nothing does.

    Takes what ``Covariance.from_hessian`` takes. Finds damping left in, another chart, order or unit than the
    layout's, poses that are inverted, velocities in the body, another direction of gravity, a prior on one
    keyframe (and whether it holds more than is free), a lost block between two keyframes or points,
    keyframes and points that too little measures, parts that nothing joins, a scale or tilt that is open
    beyond the group, and a diagonal too wide for thresholds on the matrix as it stands. Absolute
    measurements of several keyframes are no fault.

    Raises DataError where shapes do not fit, entries are not finite, or H is not symmetric.
    """
    instance("layout", layout, Layout)
    sparse = scipy.sparse.issparse(H)
    if sparse:
        H, diagonal = sparse_symmetric("H", H, layout.n)
    else:
        H = symmetric("H", H, layout.n)
        diagonal = H.diagonal()
    given: dict[str, Any] = {
        "layout": layout,
        "poses": poses,
        "velocities": velocities,
        "points": points,
        "group": group,
        "gravity": gravity,
        "vectors": vectors,
    }
    U = null_space(**given)
    found = _Leak.of(H, diagonal, U)
    out = [*_spread(diagonal, layout), *_open(H, found, layout)]
    free = found.N.shape[1]
    if not found.seen:
        return (*out, *(_damping(found, diagonal) or _first(H, diagonal, larger_groups(given), free + 1)))
    others = chain(other_units(layout, U), other_layouts(given), other_estimates(H, given))
    return (
        *out,
        *(
            _damping(found, diagonal)
            or _first(H, diagonal, others, free)
            or _prior(H, found, diagonal, layout)
            or _lost_block(H, found, layout)
        ),
    )


@dataclass(frozen=True)
class _Leak:
    """D H D N, with D H D of unit diagonal and N an orthonormal basis of D^-1 U; ``seen`` counts N."""

    N: Array
    along: Array
    scale: Array
    seen: int

    @classmethod
    def of(cls, H: Any, diagonal: Array, U: Array) -> _Leak:
        scale = 1.0 / np.sqrt(np.where(diagonal > NOTHING, diagonal, 1.0))
        T = U[:, U.any(axis=0)] / scale[:, None]
        N, sizes, _ = np.linalg.svd(T / np.linalg.norm(T, axis=0), full_matrices=False)
        N = N[:, sizes > rounding(len(N))]
        along = scale[:, None] * (H @ (scale[:, None] * N))
        return cls(N, along, scale, int(np.sum(np.linalg.eigvalsh(N.T @ along) > rounding(len(N)))))


def _spread(diagonal: Array, layout: Layout) -> Iterator[Concern]:
    measured = np.flatnonzero(diagonal > 0.0)
    if not measured.size:
        return
    low, high = (int(measured[f(diagonal[measured])]) for f in (np.argmin, np.argmax))
    decades = np.log10(diagonal[high]) - np.log10(diagonal[low])
    if decades > _DECADES:
        yield Concern(
            "spread",
            f"the diagonal of H spans {decades:.0f} decades, from {diagonal[low]:.0e} ({layout.name_of(low)})"
            f" to {diagonal[high]:.0e} ({layout.name_of(high)}): a rank or pseudo-inverse of H as it stands"
            " takes the small for zero; choose units alike, or scale H to a unit diagonal first",
        )


def _open(H: Any, found: _Leak, layout: Layout) -> Iterator[Concern]:
    if names := unmeasured(H, layout, found.scale, found.N):
        sentence = f"nothing measures {names}: take it out of H, or add what measures it"
        yield Concern("unmeasured", sentence)
    if parts := separate(H, layout):
        yield Concern("parts", f"nothing joins keyframes {parts}: each part has a gauge of its own")


def _damping(found: _Leak, diagonal: Array) -> list[Concern]:
    """H U = lambda diag(H) U, or lambda U, for all of U, of which rounding may hide some or all."""
    if not found.N.shape[1]:
        return []
    for M, what in ((np.ones(len(diagonal)), "of the diagonal"), (found.scale**2, "on the diagonal")):
        MN = M[:, None] * found.N
        factor = float(np.sum(MN * found.along) / np.sum(MN * MN))
        if np.linalg.norm(found.along - factor * MN) < _UNEXPLAINED * np.linalg.norm(found.along):
            why = (
                f", which is why {found.seen} of {found.N.shape[1]} directions of the gauge look measured"
                if found.seen
                else ""
            )
            return [
                Concern("damping", f"a damping of {factor:.1e} {what} is left in H{why}: take H without it")
            ]
    return []


def _first(H: Any, diagonal: Array, hypotheses: Iterable[Hypothesis], least: int) -> list[Concern]:
    """The first hypothesis with ``least`` directions or more, none of which H sees."""
    for kind, sentence, U in hypotheses:
        other = _Leak.of(H, diagonal, U)
        if not other.seen and other.N.shape[1] >= least:
            return [Concern(kind, sentence)]
    return []


def _places(found: _Leak, layout: Layout) -> list[Index]:
    """Columns of each keyframe or point, or column without a name, where H U is not zero."""
    nodes = layout.nodes
    size = np.sqrt(np.bincount(nodes, np.sum(found.along**2, axis=1)))
    return [np.flatnonzero(nodes == node) for node in np.flatnonzero(size > _UNEXPLAINED * size.max())]


def _prior(H: Any, found: _Leak, diagonal: Array, layout: Layout) -> list[Concern]:
    places = _places(found, layout)
    if len(places) != 1:
        return []
    name = _name(layout, places[0])
    what = f"{found.seen} direction{'s' * (found.seen > 1)} of the gauge"
    sentence = f"all that H has along {what} comes from a prior on {name}"
    sentence += ": where it was not measured, leave it out of H"
    poses = [kind for kind in POSE if kind in layout.blocks]
    if not poses or not np.isin(places[0], layout.columns_of(poses)).any():
        return [Concern("prior", sentence)]
    sentence += " and ask for the covariance in that keyframe's gauge"
    held, free = _held_directions(H, places[0], diagonal, layout), found.N.shape[1]
    if held > free:
        sentence += (
            f"; it holds {held} directions where {free} are free, so what was measured of the others (roll"
            " and pitch, of a visual-inertial estimate) is overruled and sigmas come out too small"
        )
    elif free < POSE_COLUMNS:  # a weaker prior cannot be told from measurements
        sentence += (
            f"; if it holds all {POSE_COLUMNS} of the pose, where {free} are free, sigmas are too small"
        )
    return [Concern("prior", sentence)]


def _held_directions(H: Any, place: Index, diagonal: Array, layout: Layout) -> int:
    """Directions of one pose with far more information than columns of their kind have elsewhere."""
    usual = np.zeros(layout.n)
    for kind in ("position", "rotation"):
        columns = layout.blocks.get(kind, np.empty((0, 0), np.int64))
        columns = columns[columns >= 0]
        if columns.size:
            usual[columns] = np.median(diagonal[columns])
    pose = place[usual[place] > 0.0]
    size = np.sqrt(usual[pose])
    return int(np.sum(np.linalg.eigvalsh(_dense(H, pose, pose) / np.outer(size, size)) > _HELD))


def _lost_block(H: Any, found: _Leak, layout: Layout) -> list[Concern]:
    places = _places(found, layout)
    if len(places) != 2:
        return []
    i, j = places
    if np.any(_dense(H, i, j)):
        return []
    # Of a lost block B: H U is -B U_j at i and -B^T U_i at j. Two priors would not fit together so.
    at_i, at_j = found.N[i].T @ found.along[i], found.N[j].T @ found.along[j]
    if np.abs(at_i - at_j.T).max() > _UNEXPLAINED * np.abs(at_i).max():
        return []
    return [
        Concern(
            "block",
            f"the block of H between {_name(layout, i)} and {_name(layout, j)} is empty, and what H U has"
            " there is what it would take away: it was lost on the way",
        )
    ]


def _dense(H: Any, rows: Index, columns: Index) -> Array:
    block = H[rows][:, columns]
    out: Array = block.toarray() if scipy.sparse.issparse(block) else block
    return out


def _name(layout: Layout, columns: Index) -> str:
    """'keyframe 3', 'point 7', 'column 12'."""
    return layout.name_of(int(columns[0])).split(" of ")[-1]
