"""What no measurement sees: the null space of H, direction by direction and by name.

A visual-inertial problem has four null directions, the tangent of its orbit, Eq. (15):
position and yaw. Any further one makes it degenerate, and its covariance has no meaning.
Here the null space is computed, the expected directions are taken out, and the rest is
compared with the motions that are known to leave measurements as they are (scale, tilt, a
keyframe's velocity, one part of the measurement graph against another, a landmark along
its ray), so that the answer names states and not numbers.

Directions are compared after Jacobi scaling, in which metres, radians and near or far
landmarks weigh alike.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.sparse import issparse
from scipy.special import chdtri

from ..arrays import indices, instance, reals, symmetric
from ..errors import DataError
from ..gauge.group import YawTranslation, local_tangent
from ..geometry import so3
from ..geometry.so3 import Array
from ..model.problem import Problem
from ..model.state import State
from ..solver.normal_equations import NormalEquations, ReducedSystem, linearise
from ..solver.residuals import down_weighted
from ..sparsity.layout import Index, by_keyframe
from ..sparsity.rounding import rounding
from ..sparsity.symmetric import sparse_symmetric
from .sparse_spectrum import SparseNullSpace
from .spectrum import NullSpace
from .unobservable import (
    ACCELEROMETER,
    GYROSCOPE,
    measurement_graph,
    scaling,
    tilts_with_bias,
    unobservable_moves,
)

# Columns up to which a sparse matrix is made dense.
_SMALL = 400
# A quantity is determined if zero lies more than three of its standard deviations away.
_SIGMAS = 3.0
# Information that noise alone gives is a chi-square; beyond this quantile it is signal.
_QUANTILE = 0.999

# Below these, next to the distance of the landmarks and in radians, a flight does not move.
_STILL_SHARE = 5e-3
_STILL_TURN = np.radians(1.0)

COMBINATION = "combination"
STILL = "standing still"
_REPEATED = "standing still: all views repeat the first, so their errors are not independent"
_LANDMARKS_ONLY = {"position": 0.0, "rotation": 0.0, "velocity": 0.0, "landmark": 1.0}
# In the order of the parameters; biases where they are estimated.
_KINDS = ("position", "rotation", "velocity", GYROSCOPE, ACCELEROMETER)


@dataclass(frozen=True)
class Direction:
    """Null directions of one kind.

    Attributes
    ----------
    kind : "scale", "roll and pitch", "velocity", "depth", ...; "combination" where no name fits
    count : how many dimensions it has
    keyframes, landmarks : which it concerns; empty: all of them
    eigenvalue : largest of them in the scaled matrix, next to that matrix' largest
    shares : part of the squared length, by block (position, rotation, velocity, biases, landmark)
    sigma : of a weak scale: its marginal standard deviation as a share of the scale; zero for others
    """

    kind: str
    count: int
    eigenvalue: float
    shares: Mapping[str, float]
    keyframes: tuple[int, ...] = ()
    landmarks: tuple[int, ...] = ()
    sigma: float = 0.0

    def __str__(self) -> str:
        if self.landmarks:
            return f"{self.kind} of {_listed('landmark', self.landmarks)}"
        if self.kind == COMBINATION:
            largest = [name for name, share in self.shares.items() if share > 0.1]
            return f"{self.count} {COMBINATION}{'s' * (self.count > 1)} of {', '.join(largest)}"
        where = f" of {_listed('keyframe', self.keyframes)}" if self.keyframes else ""
        return self.kind + where + (f" (sigma {self.sigma:.0%})" if self.sigma else "")


@dataclass(frozen=True)
class Diagnosis:
    """What H says about its problem.

    Attributes
    ----------
    n_parameters : size of H
    expected : number of null directions that the gauge explains, and that are there
    missing : number of expected directions that H does not have: something absolute is measured
    extra : null directions beyond them
    weak : directions with information, but no more than noise gives (three sigma reach zero)
    eigenvalues : of the scaled matrix (reduced onto the motion for a problem; the smallest of a large sparse
        one), next to its largest, ascending
    gap : smallest eigenvalue that counts, over the largest that does not
    motion : "moving", "standing still" or "pure rotation"; empty for a bare matrix
    cause : why there are extra or weak directions, where that is known
    down_weighted : reprojection errors longer than ``delta`` of the problem's loss
    """

    n_parameters: int
    expected: int
    missing: int
    extra: tuple[Direction, ...]
    weak: tuple[Direction, ...]
    eigenvalues: Array
    gap: float
    motion: str = ""
    cause: str = ""
    down_weighted: int = 0

    @property
    def degenerate(self) -> bool:
        """Whether more than the gauge is unobservable."""
        return bool(self.extra or self.weak)

    @property
    def rank(self) -> int:
        """Rank of H."""
        return self.n_parameters - self.expected - sum(direction.count for direction in self.extra)

    @property
    def measured(self) -> str:
        """How many of the expected directions something measures, and what to do; empty where none."""
        if not self.missing:
            return ""
        what = f"{self.missing} of {self.expected + self.missing} expected directions are measured"
        if self.expected or self.degenerate:
            return what
        return f"{what}: H is invertible, invert it"

    @property
    def sentence(self) -> str:
        """The finding in one sentence."""
        why = f" ({self.cause})" if self.cause else ""
        if not self.degenerate:
            parts = [
                f"regular: rank {self.rank} of {self.n_parameters}, gap {self.gap:.0e}{why}",
                "no null direction is extra",
                self.measured,
                _REPEATED if self.motion == STILL else "",
                self._of_loss,
            ]
            return "; ".join(filter(None, parts))
        parts = [self.measured] if self.missing else []
        if self.extra:
            count = sum(direction.count for direction in self.extra)
            names = ", ".join(map(str, self.extra))
            parts.append(f"{count} more than the gauge unobservable: {names}")
        if self.weak:
            parts.append(f"no better known than noise: {', '.join(map(str, self.weak))}")
        if self.down_weighted:
            parts.append(self._of_loss)
        return f"degenerate{why}: {'; '.join(parts)}"

    @property
    def _of_loss(self) -> str:
        return f"{self.down_weighted} reprojection errors are down-weighted" if self.down_weighted else ""

    @property
    def withheld(self) -> str:
        """Why a covariance would mean nothing, in one sentence; empty where it means something.

        Not only degenerate problems: where nothing moves, every view repeats the first, so its
        errors are no independent draws of the noise that the covariance believes in. And not a bare
        matrix that measures an expected direction: no gauge has a choice there. (The covariance of a
        problem looks for the open ones itself.)
        """
        if self.degenerate:
            return self.sentence
        if self.motion == STILL:
            return _REPEATED
        return "" if self.motion else self.measured


def _listed(what: str, numbers: Sequence[int]) -> str:
    """'keyframe 3', 'keyframes 0 to 9', 'landmarks 1, 4, 7 and 21 more'."""
    if len(numbers) == 1:
        return f"{what} {numbers[0]}"
    if len(numbers) > 2 and numbers[-1] - numbers[0] == len(numbers) - 1:
        return f"{what}s {numbers[0]} to {numbers[-1]}"
    shown = ", ".join(map(str, numbers[:6]))
    return f"{what}s {shown}" + (f" and {len(numbers) - 6} more" if len(numbers) > 6 else "")


def diagnose_hessian(H: Any, U: Array, blocks: Mapping[str, Index] | None = None) -> Diagnosis:
    """Null directions of any estimator's information matrix beyond the ones that its gauge explains.

    Parameters
    ----------
    H : (n, n) information matrix, symmetric, an array or scipy.sparse. Of more than 400 sparse columns no
        dense matrix is made, and ``eigenvalues`` are the smallest only
    U : (n, d) null directions that are expected (4 for visual-inertial, 7 for monocular problems)
    blocks : parameters of each named block; a null direction is named by the block that it lies
        in, or else as a combination with its shares. Without them all of H is one block.

    Raises DataError where shapes do not fit, entries are not finite, or H is not symmetric,
    IndefiniteError where H has a negative eigenvalue, and DegenerateError where a large sparse H leaves more
    than 500 directions open.
    """
    large = issparse(H) and H.shape[0] > _SMALL
    H = sparse_symmetric("H", H, H.shape[0])[0] if large else symmetric("H", H)
    n = H.shape[0]
    U = reals("U", U, (n, "d"), matrix=True)
    null = SparseNullSpace(H, U) if large else NullSpace(H, np.diagonal(H))
    null.require_semidefinite()
    expected = null.take(U).shape[1]
    named = {name: indices("blocks", rows, n, field=name) for name, rows in (blocks or {}).items()}
    parts = named or {"parameters": np.arange(n, dtype=np.int64)}
    extra = []
    for name, rows in parts.items():
        found = null.take_parameters(rows) if blocks else null.explained[:, :0]
        if found.shape[1]:
            extra.append(Direction(name, found.shape[1], null.eigenvalue(found), _shares(found, parts)))
    rest = null.rest()
    if rest.shape[1]:
        extra.append(Direction(COMBINATION, rest.shape[1], null.eigenvalue(rest), _shares(rest, parts)))
    return Diagnosis(
        n, expected, U.shape[1] - expected, tuple(extra), (), null.eigenvalues / null.largest, null.gap
    )


def _shares(directions: Array, blocks: Mapping[str, Index]) -> dict[str, float]:
    total = float(np.sum(directions**2))
    return {name: float(np.sum(directions[rows] ** 2)) / total for name, rows in blocks.items()}


def diagnose(problem: Problem, state: State) -> Diagnosis:
    """Which directions of a visual-inertial problem no measurement sees at a state, and why.

    Singular landmark blocks are found and named too, where elimination would refuse them.

    Raises DataError where a residual's derivative is not finite at the state.
    """
    instance("problem", problem, Problem).require_fits(state).require_bounded()
    return diagnose_equations(linearise(problem, state), problem, state)


def diagnose_equations(equations: NormalEquations, problem: Problem, state: State) -> Diagnosis:
    """As :func:`diagnose`, from normal equations at hand (without any gauge's prior).

    Raises DataError where they are not finite.
    """
    if not (np.all(np.isfinite(equations.storage)) and np.all(np.isfinite(equations.landmark))):
        raise DataError("normal equations", "must be finite at the state")
    landmarks, filled = _fill_landmarks(equations)
    reduced = filled.eliminate()
    n_motion = state.n_motion
    null = NullSpace(reduced.matrix, equations.diagonal()[:n_motion])
    found = _Findings(null, reduced, equations)
    tangent = local_tangent(YawTranslation(), state)[:n_motion]
    expected = null.take(tangent).shape[1]
    for kind, keyframes, candidates in unobservable_moves(problem, state):
        found.add(kind, keyframes, null.take(candidates))
    found.add(COMBINATION, (), null.rest())
    extra = [*found.directions, *landmarks]
    weak = (
        *_weak_tilt(found, problem, state),
        *_weak_scale(found, equations, problem, state),
        *_weak_depths(equations, filled, landmarks, state),
    )
    motion = _motion(equations, state)
    open_ones = [*extra, *weak]
    blind = sum(len(direction.landmarks) for direction in open_ones)
    scale = any(direction.kind == "scale" for direction in open_ones)
    tilt = sum(d.count for d in open_ones if d.kind.startswith(ACCELEROMETER) and not d.keyframes)
    return Diagnosis(
        n_parameters=state.n_parameters,
        expected=expected,
        missing=tangent.shape[1] - expected,
        extra=tuple(extra),
        weak=weak,
        eigenvalues=null.eigenvalues / null.largest,
        gap=null.gap,
        motion=motion,
        cause=_cause(problem, state, motion, blind, scale, tilt) if open_ones else "",
        down_weighted=down_weighted(problem, state),
    )


def _fill_landmarks(equations: NormalEquations) -> tuple[list[Direction], NormalEquations]:
    """Landmarks with a direction that no view measures, and equations in which it is filled up.

    A direction without information in a landmark's own block couples with nothing, so
    information added along it leaves the reduced camera system as it is.
    """
    C = equations.landmark
    if not len(C):
        return [], equations
    diagonal = np.diagonal(C, axis1=1, axis2=2)
    scale = np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    values, vectors = np.linalg.eigh(C / scale[:, :, None] / scale[:, None, :])
    null = values < rounding(3)
    blind = vectors * null[:, None, :]
    fill = scale[:, :, None] * (blind @ blind.swapaxes(1, 2)) * scale[:, None, :]
    numbers = np.flatnonzero(null.any(axis=1))
    if not len(numbers):
        return [], equations
    count = int(null.sum())
    largest = float(np.max(np.abs(values[null])))
    name = "depth" if count == len(numbers) else "place"
    direction = Direction(name, count, largest, _LANDMARKS_ONLY, landmarks=tuple(map(int, numbers)))
    return [direction], replace(equations, landmark=C + fill)


class _Findings:
    """Named null directions of the reduced system, neighbours of one kind merged into one."""

    def __init__(self, null: NullSpace, reduced: ReducedSystem, equations: NormalEquations) -> None:
        self.null, self.reduced, self.equations = null, reduced, equations
        self.directions: list[Direction] = []

    def add(self, kind: str, keyframes: tuple[int, ...], vectors: Array) -> None:
        if not vectors.shape[1]:
            return
        if kind == ACCELEROMETER and not keyframes:
            kind = self.tilt(vectors)
        direction = Direction(
            kind, vectors.shape[1], self.null.eigenvalue(vectors), self.shares(vectors), keyframes
        )
        last = self.directions[-1] if self.directions else None
        if last is not None and last.kind == kind and keyframes and last.keyframes:
            direction = replace(
                direction,
                count=last.count + direction.count,
                eigenvalue=max(last.eigenvalue, direction.eigenvalue),
                keyframes=last.keyframes + keyframes,
                shares={
                    name: (last.count * last.shares[name] + direction.count * share)
                    / (last.count + direction.count)
                    for name, share in direction.shares.items()
                },
            )
            self.directions.pop()
        self.directions.append(direction)

    def tilt(self, vectors: Array) -> str:
        """Name of tilts, with the axes of the body along which biases take them back, if any do."""
        per_keyframe = by_keyframe(vectors / self.null.scale[:, None], self.reduced.structure.n_keyframes)
        span, sizes, _ = np.linalg.svd(per_keyframe[0, -3:], full_matrices=False)
        along = np.linalg.norm(span * (sizes > 1e-3 * np.linalg.norm(per_keyframe)), axis=1)
        axes = " and ".join(axis for axis, share in zip("xyz", along, strict=True) if share > 0.3)
        return f"{ACCELEROMETER} along {axes} with the tilt" if axes else "roll and pitch"

    def shares(self, vectors: Array) -> dict[str, float]:
        """Shares by block, the landmarks that go along with the motion included."""
        squares = (vectors**2).reshape(self.reduced.structure.layout.width // 3, -1).sum(axis=1)
        landmark = 0.0
        if self.reduced.structure.n_landmarks:
            motion = vectors / self.null.scale[:, None]
            none = np.zeros((3 * self.equations.structure.n_landmarks, vectors.shape[1]))
            step = self.reduced.through_landmarks(none, motion).reshape(-1, 3, vectors.shape[1])
            diagonal = np.diagonal(self.equations.landmark, axis1=1, axis2=2)
            landmark = float(np.sum(diagonal[:, :, None] * step**2))
        parts = dict(zip(_KINDS, map(float, squares), strict=False))
        total = float(squares.sum()) + landmark
        return {name: value / total for name, value in (parts | {"landmark": landmark}).items()}


def _weak_tilt(found: _Findings, problem: Problem, state: State) -> tuple[Direction, ...]:
    """The tilt, where three marginal sigmas are a radian or more: an accelerometer's bias then takes it back.

    It is that of the last keyframe about level axes, with all else free to move along.
    """
    named = any(direction.kind.startswith(ACCELEROMETER) for direction in found.directions)
    if named or not problem.estimates_biases or state.n_keyframes < 2 or not len(problem.inertial.dt):
        return ()
    n = state.n_keyframes
    level = np.zeros((state.n_motion, 2))
    level[6 * n - 3 : 6 * n - 1] = np.eye(2)
    variances, axes = np.linalg.eigh(found.null.marginal(level))
    moves = tilts_with_bias(problem, state) @ axes[:, _SIGMAS**2 * variances > 1.0]
    if not moves.shape[1]:
        return ()
    scaled = np.linalg.qr(moves * found.null.scale[:, None])[0]
    kind = found.tilt(scaled)
    return (Direction(kind, moves.shape[1], found.null.eigenvalue(scaled), found.shares(scaled)),)


def _weak_scale(
    found: _Findings, equations: NormalEquations, problem: Problem, state: State
) -> tuple[Direction, ...]:
    """The scale, where three marginal sigmas reach zero, or where changing it costs no more than noise does.

    Its sigma is that of the size of the path about its centre, with all else free to move along, if that of
    the landmarks' distances is no better: two cameras that turn on the spot know those, but not the size of
    a path of noise. With one camera the scale comes from accelerations only: its information is the energy
    of their whitened signal, and that of noise is a chi-square of six numbers a factor.
    """
    named = any(direction.kind == "scale" for direction in found.directions)
    if named or state.n_keyframes < 2 or not state.n_landmarks:
        return ()
    motion, landmark = scaling(problem, state)
    noise = float(chdtri(max(6 * len(problem.inertial.dt), 1), 1.0 - _QUANTILE))
    change = np.concatenate([motion, landmark.ravel()])
    path = state.p_W - state.p_W.mean(axis=0)
    functional = np.zeros(len(motion))
    functional[: path.size] = path.ravel() / max(float(np.sum(path**2)), np.finfo(float).tiny)
    sigma = found.null.sigma(functional) if _motion(equations, state) == "moving" else 0.0
    seen = _SIGMAS * sigma <= 1.0 or _SIGMAS * _map_sigma(found, equations, landmark) <= 1.0
    if seen and change @ equations.times(change) > max(_SIGMAS**2, noise):
        return ()
    scaled = (motion * found.null.scale)[:, None]
    length = float(np.linalg.norm(scaled))
    # Without any motion the scale moves landmarks along their rays only, which is a matter of depths.
    if length < 1e-6:
        return ()
    scaled /= length
    return (Direction("scale", 1, found.null.eigenvalue(scaled), found.shares(scaled), sigma=sigma),)


def _map_sigma(found: _Findings, equations: NormalEquations, ray: Array) -> float:
    """Standard deviation of the distances (K, 3) of landmarks, weighted by their information, as a share."""
    n_motion = len(found.null.scale)
    felt = equations.times(np.concatenate([np.zeros(n_motion), ray.ravel()]))
    information = float(ray.ravel() @ felt[n_motion:])
    if information <= 0.0:
        return np.inf
    return float(np.hypot(information**-0.5, found.null.sigma(felt[:n_motion] / information)))


def _rays(equations: NormalEquations, state: State) -> tuple[Array, Array]:
    """(K,) distance of each landmark from the mean of its observers, and the (K, 3) unit rays."""
    pairs = equations.structure.pairs
    total = np.zeros((state.n_landmarks, 3))
    np.add.at(total, pairs.landmark, state.p_W[pairs.keyframe])
    views = np.bincount(pairs.landmark, minlength=state.n_landmarks)
    ray = state.X_W - total / views[:, None]
    distance = np.linalg.norm(ray, axis=1)
    return distance, ray / np.maximum(distance, np.finfo(float).tiny)[:, None]


def _weak_depths(
    equations: NormalEquations, filled: NormalEquations, null: Sequence[Direction], state: State
) -> tuple[Direction, ...]:
    """Depths within three sigma of nothing at known poses, where that is so for most landmarks.

    A few far landmarks harm nothing; where most have no depth the views have no parallax.
    """
    known = {number for direction in null for number in direction.landmarks}
    if not state.n_landmarks:
        return ()
    distance, ray = _rays(equations, state)
    variance = np.einsum("ki,kij,kj->k", ray, np.linalg.inv(filled.landmark), ray)
    weak = set(map(int, np.flatnonzero(_SIGMAS**2 * variance > distance**2))) - known
    if 2 * (len(weak) + len(known)) <= state.n_landmarks or not weak:
        return ()
    information = np.einsum("ki,kij,kj->k", ray, equations.landmark, ray)
    largest = float(
        np.max(information[sorted(weak)] / np.trace(equations.landmark, axis1=1, axis2=2)[sorted(weak)])
    )
    return (Direction("depth", len(weak), largest, _LANDMARKS_ONLY, landmarks=tuple(sorted(weak))),)


def _motion(equations: NormalEquations, state: State) -> str:
    """Whether the body moved: next to the distance of the landmarks, or to a metre without any."""
    unit = float(np.median(_rays(equations, state)[0])) if state.n_landmarks else 1.0
    extent = float(np.max(np.linalg.norm(state.p_W - state.p_W.mean(axis=0), axis=1)))
    turn = float(np.max(np.linalg.norm(so3.log(state.R_WB @ state.R_WB[0].T), axis=1)))
    if state.n_keyframes < 2 or extent > _STILL_SHARE * unit:
        return "moving"
    return STILL if turn < _STILL_TURN else "pure rotation"


def _cause(problem: Problem, state: State, motion: str, blind: int, scale: bool, tilt: int) -> str:
    """What in the data makes a problem degenerate, where it is one of the known things."""
    if state.n_keyframes == 1:
        return "a single keyframe"
    count, _ = measurement_graph(problem)
    if count > 1:
        return f"the measurements join the keyframes into {count} separate parts"
    if not state.n_landmarks:
        return "no landmarks"
    if motion != "moving":
        return motion
    if 2 * blind > state.n_landmarks:
        return f"{blind} of {state.n_landmarks} landmarks without parallax"
    if not len(problem.inertial.dt):
        return "no inertial measurements"
    if tilt:
        turns = "turns about one level axis only" if tilt == 1 else "does not turn"
        return f"the body {turns}, so its tilt and the accelerometer's bias look alike"
    return "no acceleration beyond noise" if scale else ""
