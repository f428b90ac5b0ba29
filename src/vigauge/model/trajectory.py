"""An estimate to hand on: poses, velocities, times, and what its covariance says and means."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from ..arrays import instance, integers, reals, require_rotations
from ..errors import DataError
from ..geometry.charts import poses_of
from ..geometry.so3 import Array
from ..kernels.sizes import KEYFRAME
from .first_rotation import chain
from .state import State

# Axes of each kind of parameter, and their unit.
AXES = {
    "position": (("x", "y", "z"), "m"),
    "rotation": (("rx", "ry", "rz"), "rad"),
    "velocity": (("vx", "vy", "vz"), "m/s"),
}
SIDES = ("left", "right")
_USUAL_KINDS = {6: ("position", "rotation"), 9: ("position", "rotation", "velocity")}

_COVARIANCE = "covariance of keyframes"
_ASK_IN = "must be a gauge, such as vg.CentroidGauge(), for the covariance to be asked for"
# Largest difference of entries that ought to be equal, next to the largest sigmas of the two axes.
_ASYMMETRY = 1e-8


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory:
    """What :func:`vigauge.load_trajectory` gives.

    Attributes
    ----------
    p_W : (N, 3) positions, m
    R_WB : (N, 3, 3) rotations, body to world
    v_W : (N, 3) velocities in W, m/s, or None
    times_ns : (N,) integer nanoseconds, increasing, or None
    covariance : (N, c, c) covariances of single keyframes, in the order of ``kinds``, or None
    sigma : (N, c) standard deviations; those of ``covariance`` where that is there, or None
    kinds : what the c axes are, of "position" (m), "rotation" (rad) and "velocity" (m/s), three axes each
    gauge : name of the gauge that the covariance is in
    frame : name of the world frame
    side : of the rotation's increments: "left" (in W) or "right" (in B); positions and velocities are in W
    keys : names of the keyframes; None where they are 0, 1, ...

    Raises DataError for shapes that do not fit, times that do not increase, a covariance without the name
    of its gauge, and an unknown kind or side.
    """

    p_W: Array
    R_WB: Array
    v_W: Array | None = None
    times_ns: NDArray[np.int64] | None = None
    covariance: Array | None = None
    sigma: Array | None = None
    kinds: tuple[str, ...] = ()
    gauge: str = ""
    frame: str = "W"
    side: str = "left"
    keys: tuple[str, ...] | None = None

    def __post_init__(self) -> None:
        name = "trajectory"
        p = reals(name, self.p_W, ("N", 3), field="p_W")
        R = reals(name, self.R_WB, (len(p), 3, 3), field="R_WB")
        require_rotations(name, R, field="R_WB")
        self._set(p_W=p, R_WB=R)
        if self.v_W is not None:
            self._set(v_W=reals(name, self.v_W, (len(p), 3), field="v_W"))
        if self.times_ns is not None:
            times = integers(name, self.times_ns, (len(p),), field="times_ns")
            late = np.flatnonzero(times[1:] <= times[:-1])
            if late.size:
                row = int(late[0]) + 1
                raise DataError(name, "must increase", field="times_ns", row=row, value=int(times[row]))
            self._set(times_ns=times)
        keys = instance("keys", self.keys or (), tuple)
        if self.keys is not None and (len(keys) != len(p) or len(set(keys)) != len(keys)):
            raise DataError(name, f"must be {len(p)} different names", field="keys", value=keys)
        for field, text in (("frame", self.frame), ("gauge", self.gauge), *(("keys", key) for key in keys)):
            if not isinstance(text, str) or not text.isprintable():  # a line break would not come back
                raise DataError(name, "must be a printable name", field=field, value=text)
        if self.side not in SIDES:
            rule = "must be left or right; vg.as_convention brings a covariance to one of these"
            raise DataError(name, rule, field="side", value=self.side)
        self._check_uncertainty(len(p))

    def _check_uncertainty(self, count: int) -> None:
        name = "trajectory"
        if self.covariance is None and self.sigma is None:
            if self.kinds or self.gauge:
                rule = "must come with a covariance: that is what it describes"
                raise DataError(name, rule, field="gauge", value=self.gauge or self.kinds)
            return
        unknown = [kind for kind in instance("kinds", self.kinds, tuple) if kind not in AXES]
        if unknown or len(set(self.kinds)) != len(self.kinds) or not self.kinds:
            rule = f"must be different ones of {', '.join(AXES)}"
            raise DataError(name, rule, field="kinds", value=self.kinds)
        if not self.gauge:
            rule = "must be named with a covariance: without it the numbers mean nothing"
            raise DataError(name, rule, field="gauge")
        width = 3 * len(self.kinds)
        if self.covariance is not None:
            C = _symmetric(reals(_COVARIANCE, self.covariance, (count, width, width), matrix=True))
            variances = np.diagonal(C, axis1=1, axis2=2)
            self._set(covariance=C, sigma=np.sqrt(np.maximum(variances, 0.0)))
        sigma = reals(name, self.sigma, (count, width), field="sigma")
        if sigma.min(initial=0.0) < 0.0:
            row = int(np.argmin(sigma.min(axis=1)))
            raise DataError(name, "must not be negative", field="sigma", row=row, value=float(sigma.min()))
        self._set(sigma=sigma)

    def __repr__(self) -> str:
        has = [name for name in ("v_W", "times_ns", "covariance", "sigma") if getattr(self, name) is not None]
        parts = [
            f"{len(self.p_W)} keyframes",
            f"frame={self.frame!r}",
            *([f"with {', '.join(has)}"] if has else []),
        ]
        if self.kinds:
            parts.append(f"of {', '.join(self.kinds)}, gauge={self.gauge!r}, side={self.side!r}")
        return f"Trajectory({', '.join(parts)})"

    def _set(self, **values: object) -> None:
        for name, value in values.items():
            object.__setattr__(self, name, value)

    @property
    def axes(self) -> list[str]:
        """Names of the covariance's axes: x, y, z, rx, ..."""
        return [axis for kind in self.kinds for axis in AXES[kind][0]]

    @property
    def units(self) -> list[str]:
        """Unit of each axis."""
        return [AXES[kind][1] for kind in self.kinds for _ in range(3)]


@runtime_checkable
class Posed(Protocol):
    """What knows poses and their covariances: an EstimateCovariance."""

    @property
    def layout(self) -> Any: ...

    @property
    def poses(self) -> tuple[Array, Array]: ...

    @property
    def measured(self) -> tuple[str, ...]: ...

    def keyframes(self, gauge: Any, *, to: str) -> Array: ...


@runtime_checkable
class Solved(Protocol):
    """What has a State: a Covariance or a Solution of the library's own."""

    @property
    def state(self) -> State: ...


def trajectory_of(
    estimate: object,
    covariance: Array | None,
    *,
    times_ns: object,
    gauge: object,
    frame: str,
    side: str,
    kinds: Sequence[str] | None,
    keys: Sequence[object] | None,
) -> Trajectory:
    """The Trajectory of what :func:`vigauge.save_trajectory` takes."""
    if isinstance(estimate, Trajectory):
        given = {"times_ns": times_ns, "covariance": covariance, "gauge": gauge or None, "keys": keys}
        extra = [name for name, value in given.items() if value is not None]
        if extra:
            raise DataError("trajectory", "has its own; use dataclasses.replace", field=", ".join(extra))
        return estimate
    v: object = None
    if isinstance(estimate, Posed):
        if covariance is None and gauge:
            if isinstance(gauge, str):
                raise DataError("gauge", _ASK_IN, value=gauge)
            if side not in SIDES:
                raise DataError("side", f"must be {' or '.join(SIDES)}", value=side)
            covariance, kinds = estimate.keyframes(gauge, to=side), _USUAL_KINDS[6]
            names = {key: str(key) for key in estimate.layout.names}
            gauge = with_measured(_gauge_name(gauge, names), estimate.measured)
        if keys is None and estimate.layout.keys is not None:
            keys = estimate.layout.having(_USUAL_KINDS[6])
        estimate = estimate.poses
    elif isinstance(estimate, Solved):
        if covariance is None and gauge and hasattr(estimate, "keyframes"):
            if isinstance(gauge, str):
                raise DataError("gauge", _ASK_IN, value=gauge)
            covariance = estimate.keyframes(gauge)
        estimate = estimate.state
    if isinstance(estimate, State):
        estimate.require_valid()
        R, p, v = estimate.R_WB, estimate.p_W, estimate.v_W
    elif isinstance(estimate, tuple) and len(estimate) == 3:
        (R, p), v = poses_of(estimate[:2]), estimate[2]
    else:
        R, p = poses_of(estimate)
    if covariance is not None and kinds is None:
        covariance, kinds = _usual_kinds(covariance, estimate)
    out = Trajectory(
        p_W=p,
        R_WB=R,
        v_W=v,  # type: ignore[arg-type]
        times_ns=times_ns,  # type: ignore[arg-type]
        covariance=covariance,
        kinds=tuple(kinds or ()),
        gauge=_gauge_name(gauge),
        frame=frame,
        side=side,
        keys=None if keys is None else tuple(map(str, keys)),
    )
    return _left_first(out, estimate) if isinstance(estimate, State) else out


def _usual_kinds(covariance: Array, estimate: object) -> tuple[Array, tuple[str, ...]]:
    """The covariance without biases, which a trajectory has none of, and what is in one of its width."""
    width = np.shape(covariance)[-1] if np.ndim(covariance) == 3 else 0
    if isinstance(estimate, State) and estimate.has_biases and width == estimate.width:
        width, covariance = KEYFRAME, np.asarray(covariance)[:, :KEYFRAME, :KEYFRAME]
    if width not in _USUAL_KINDS:
        rule = "must be (N, 6, 6) or (N, 9, 9), as covariance.keyframes(gauge) gives; else say kinds="
        raise DataError(_COVARIANCE, rule, value=np.shape(covariance))
    return covariance, _USUAL_KINDS[width]


def _left_first(trajectory: Trajectory, state: State) -> Trajectory:
    """The first rotation's covariance by left increments, as all others: a State's is by dphi_0, Eq. (9)."""
    C = trajectory.covariance
    if C is None:
        return trajectory
    if trajectory.side != "left":
        raise DataError("side", "must be left: that of a State's covariance", value=trajectory.side)
    if "rotation" not in trajectory.kinds or not len(C):
        return trajectory
    J = np.eye(C.shape[1])
    at = slice(3 * trajectory.kinds.index("rotation"), 3 * trajectory.kinds.index("rotation") + 3)
    J[at, at] = chain(state)
    first = J @ C[0] @ J.T
    return replace(trajectory, covariance=np.concatenate([0.5 * (first + first.T)[None], C[1:]]))


def _gauge_name(gauge: object, names: Mapping[object, str] | None = None) -> str:
    """'keyframe:5': a gauge's own name, with its keyframe where it has one; those of a tuple in a row."""
    if isinstance(gauge, str):
        return gauge
    if isinstance(gauge, tuple) and gauge:
        return " ".join(_gauge_name(one, names) for one in gauge)
    name = getattr(gauge, "name", None)
    if not isinstance(name, str):
        raise DataError("gauge", "must be a gauge or the name of one", value=gauge)
    keys = [
        getattr(gauge, field) for field in ("index", "first", "second", "keyframe") if hasattr(gauge, field)
    ]
    return ":".join([name, *((names or {}).get(key, str(key)) for key in keys)])


def with_measured(gauge: str, measured: Sequence[str]) -> str:
    """The name of a gauge for a file, with the directions that are measured, which it does not hold."""
    return f"{gauge} (measured: {' '.join(measured)})" if measured else gauge


def _symmetric(C: Array) -> Array:
    """(N, c, c) covariances without their rounding; DataError where it is more than that.

    Measured by the largest sigma of each axis: where a gauge holds a keyframe, its own is only rounding.
    """
    variances = np.diagonal(C, axis1=1, axis2=2)
    size = np.sqrt(np.abs(variances).max(axis=0, initial=0.0))
    size = np.maximum(size, 1e-3 * size.max(initial=0.0))
    negative = np.flatnonzero((variances < -_ASYMMETRY * size**2).any(axis=1))
    if negative.size:
        row = int(negative[0])
        value = float(variances[row].min())
        raise DataError(_COVARIANCE, "must have a diagonal without negative entries", row=row, value=value)
    difference = np.abs(C - C.swapaxes(1, 2))
    skew = np.flatnonzero((difference > _ASYMMETRY * np.outer(size, size)).any(axis=(1, 2)))
    if skew.size:
        row = int(skew[0])
        raise DataError(_COVARIANCE, "must be symmetric", row=row, value=float(difference[row].max()))
    return 0.5 * (C + C.swapaxes(1, 2))
