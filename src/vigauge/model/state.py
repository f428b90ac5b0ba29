"""The state of a VI problem, Eq. (2): keyframes and landmarks, and how it is moved.

Parametrisation (Section III-A): rotations of keyframes i > 0 take left increments in the
world frame, Eq. (8); the first one is ``Exp(dphi_0) R_WB0_ref`` with the *total*
increment dphi_0 as its parameter, Eq. (9), so that its yaw can be held.

Order of parameters, here and in every matrix: all positions, all rotations, all
velocities (9N), then the landmarks (3K).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..errors import DataError
from ..geometry import so3
from ..geometry.so3 import Array
from ..kernels.rotation import retract_rotations


def _require_rotations(name: str, R: Array) -> None:
    # Entries outside [-2, 2] are no rotation's, and their products may overflow.
    small = np.abs(R).max(axis=(1, 2), initial=0.0) < 2.0
    R_small = np.where(small[:, None, None], R, 0.0)
    drift = np.abs(R_small @ R_small.swapaxes(1, 2) - np.eye(3)).max(axis=(1, 2), initial=0.0)
    drift = np.maximum(drift, np.where(np.linalg.det(R_small) > 0, 0.0, 2.0))
    if np.any(drift > 1e-6):
        row = int(np.argmax(drift))
        raise DataError("state", "must be a rotation matrix", field=name, row=row, value=R[row])


def _require_valid(p_W: Array, R_WB: Array, v_W: Array, X_W: Array) -> None:
    n = len(p_W)
    if n == 0:
        raise DataError("state", "must have at least one keyframe", field="p_W")
    for name, array, shape in (
        ("p_W", p_W, (n, 3)),
        ("R_WB", R_WB, (n, 3, 3)),
        ("v_W", v_W, (n, 3)),
        ("X_W", X_W, (len(X_W), 3)),
    ):
        if np.shape(array) != shape:
            raise DataError("state", f"shape must be {shape}", field=name, value=np.shape(array))
        if not np.all(np.isfinite(array)):
            row = int(np.argwhere(~np.isfinite(np.asarray(array)))[0][0])
            raise DataError("state", "must be finite", field=name, row=row, value=array[row])
    _require_rotations("R_WB", np.asarray(R_WB, dtype=float))


@dataclass(frozen=True)
class State:
    """Keyframe states and landmarks, in the world frame W (z up).

    Attributes
    ----------
    p_W : (N, 3) body positions, m
    R_WB : (N, 3, 3) body orientations, body to world
    v_W : (N, 3) velocities, m/s
    X_W : (K, 3) landmarks, m
    dphi_0 : (3,) total increment of the first rotation, rad, Eq. (9)
    R_WB0_ref : (3, 3) first rotation at dphi_0 = 0 (R_0^0 of the paper)
    """

    p_W: Array
    R_WB: Array
    v_W: Array
    X_W: Array
    dphi_0: Array
    R_WB0_ref: Array

    def __post_init__(self) -> None:
        # One form for compiled code; arrays that have it are kept as they are.
        for name in ("p_W", "R_WB", "v_W", "X_W", "dphi_0", "R_WB0_ref"):
            object.__setattr__(self, name, np.ascontiguousarray(getattr(self, name), dtype=float))

    @classmethod
    def start(cls, p_W: Array, R_WB: Array, v_W: Array, X_W: Array) -> State:
        """A state whose first rotation is its own reference: dphi_0 = 0.

        Raises DataError for wrong shapes, non-finite numbers or matrices that are no rotations.
        """
        _require_valid(p_W, R_WB, v_W, X_W)
        R_WB = np.array(R_WB, dtype=float)
        return cls(
            p_W=np.array(p_W, dtype=float),
            R_WB=R_WB,
            v_W=np.array(v_W, dtype=float),
            X_W=np.array(X_W, dtype=float),
            dphi_0=np.zeros(3),
            R_WB0_ref=R_WB[0].copy(),
        )

    def require_valid(self) -> State:
        """This state, if it is one: as :meth:`start` asks, and with Eq. (9) true of the first rotation.

        Raises DataError. For states from outside; the methods of a valid state keep it valid.
        """
        _require_valid(self.p_W, self.R_WB, self.v_W, self.X_W)
        if np.shape(self.dphi_0) != (3,) or not np.all(np.isfinite(self.dphi_0)):
            raise DataError("state", "must be a finite rotation vector", field="dphi_0", value=self.dphi_0)
        if np.max(np.abs(self.dphi_0)) > 7.0 or np.linalg.norm(self.dphi_0) > 2.0 * np.pi - 1e-6:
            raise DataError(
                "state",
                "must be shorter than 2 pi, where Eq. (9) has no derivative",
                field="dphi_0",
                value=self.dphi_0,
            )
        if np.shape(self.R_WB0_ref) != (3, 3) or not np.all(np.isfinite(self.R_WB0_ref)):
            raise DataError("state", "must be a 3 x 3 matrix", field="R_WB0_ref", value=self.R_WB0_ref)
        _require_rotations("R_WB0_ref", self.R_WB0_ref[None])
        if np.abs(so3.exp(self.dphi_0) @ self.R_WB0_ref - self.R_WB[0]).max() > 1e-6:
            raise DataError(
                "state", "Exp(dphi_0) R_WB0_ref must be the first rotation", field="dphi_0", value=self.dphi_0
            )
        return self

    @property
    def n_keyframes(self) -> int:
        return len(self.p_W)

    @property
    def n_landmarks(self) -> int:
        return len(self.X_W)

    @property
    def n_parameters(self) -> int:
        """n = 9N + 3K of Table I."""
        return 9 * self.n_keyframes + 3 * self.n_landmarks

    def retract(self, delta: Array) -> State:
        """The state moved by an increment (9N + 3K,) in the order of this module, Eqs. (8)-(9)."""
        n = self.n_keyframes
        step = np.ascontiguousarray(delta[: 9 * n], dtype=float).reshape(3, n, 3)
        dphi_0 = self.dphi_0 + step[1, 0]
        R_WB = np.empty_like(self.R_WB)
        retract_rotations(self.R_WB, step[1], dphi_0, self.R_WB0_ref, R_WB)
        return State(
            p_W=self.p_W + step[0],
            R_WB=R_WB,
            v_W=self.v_W + step[2],
            X_W=self.X_W + delta[9 * n :].reshape(-1, 3),
            dphi_0=dphi_0,
            R_WB0_ref=self.R_WB0_ref,
        )

    def local(self, other: State) -> Array:
        """The increment d (9N + 3K,) with ``self.retract(d) == other`` (shared R_WB0_ref)."""
        rotation = so3.log(other.R_WB @ self.R_WB.swapaxes(1, 2))
        rotation[0] = other.dphi_0 - self.dphi_0
        return np.concatenate(
            [
                (other.p_W - self.p_W).ravel(),
                rotation.ravel(),
                (other.v_W - self.v_W).ravel(),
                (other.X_W - self.X_W).ravel(),
            ]
        )

    def transformed(self, yaw: float, t_W: Array) -> State:
        """g(theta) of Eqs. (4)-(5): turned by ``yaw`` (rad) about gravity, then shifted by t_W (m)."""
        R_z = so3.yaw_rotation(yaw)
        dphi_0 = so3.log(R_z @ so3.exp(self.dphi_0))
        R_WB = R_z @ self.R_WB
        return replace(
            self,
            p_W=self.p_W @ R_z.T + t_W,
            R_WB=R_WB,
            v_W=self.v_W @ R_z.T,
            X_W=self.X_W @ R_z.T + t_W,
            dphi_0=dphi_0,
        )
