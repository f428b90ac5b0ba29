"""The state of a VI problem, Eq. (2): keyframes and landmarks, and how it is moved.

Parametrisation (Section III-A): rotations of keyframes i > 0 take left increments in the
world frame, Eq. (8); the first one is ``Exp(dphi_0) R_WB0_ref`` with the *total*
increment dphi_0 as its parameter, Eq. (9), so that its yaw can be held.

Order of parameters, here and in every matrix: all positions, all rotations, all velocities, where
they are estimated all gyroscope and all accelerometer biases (9N or 15N), then the landmarks (3K).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import instance, number, reals, require_rotations, vectors
from ..errors import DataError
from ..geometry import so3
from ..geometry.so3 import Array
from ..kernels import rotation
from ..kernels.sizes import KEYFRAME, WITH_BIASES

_SHAPES: dict[str, tuple[int | str, ...]] = {
    "p_W": ("N", 3),
    "R_WB": ("N", 3, 3),
    "v_W": ("N", 3),
    "X_W": ("K", 3),
    "dphi_0": (3,),
    "R_WB0_ref": (3, 3),
}
BIASES = ("gyro_bias", "accel_bias")


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
    gyro_bias, accel_bias : (N, 3) biases in the body frame, rad/s and m/s^2; both None where they are known
        and no part of the state
    """

    p_W: Array
    R_WB: Array
    v_W: Array
    X_W: Array
    dphi_0: Array
    R_WB0_ref: Array
    gyro_bias: Array | None = None
    accel_bias: Array | None = None

    def __post_init__(self) -> None:
        # One form for compiled code; arrays that have it are kept as they are. Numbers may be anything here:
        # a trial step of the solver may go beyond them.
        for name in _SHAPES:
            array = getattr(self, name)
            if type(array) is not np.ndarray or array.dtype != np.float64 or not array.flags.c_contiguous:
                object.__setattr__(self, name, reals("state", array, _SHAPES[name], field=name))
        n, k = (array.shape[0] if array.ndim else 0 for array in (self.p_W, self.X_W))
        if n == 0:
            raise DataError("state", "must have at least one keyframe", field="p_W")
        shapes = (n, 3), (n, 3, 3), (n, 3), (k, 3), (3,), (3, 3)
        for name, shape in zip(_SHAPES, shapes, strict=True):
            if getattr(self, name).shape != shape:
                found = getattr(self, name).shape
                raise DataError("state", f"must have shape {shape}", field=name, value=found)
        if self.gyro_bias is None and self.accel_bias is None:
            return
        for name in BIASES:
            array = getattr(self, name)
            if array is None:
                raise DataError("state", "must be given where the other bias is", field=name)
            if type(array) is not np.ndarray or array.dtype != np.float64 or not array.flags.c_contiguous:
                array = reals("state", array, (n, 3), field=name)
                object.__setattr__(self, name, array)
            if array.shape != (n, 3):
                raise DataError("state", f"must have shape {(n, 3)}", field=name, value=array.shape)

    @classmethod
    def start(
        cls,
        p_W: Array,
        R_WB: Array,
        v_W: Array,
        X_W: Array,
        gyro_bias: Array | None = None,
        accel_bias: Array | None = None,
    ) -> State:
        """A state whose first rotation is its own reference: dphi_0 = 0.

        Raises DataError for wrong shapes, non-finite numbers or matrices that are no rotations.
        """
        arrays = {
            name: reals("state", array, _SHAPES[name], field=name).copy()
            for name, array in (("p_W", p_W), ("R_WB", R_WB), ("v_W", v_W), ("X_W", X_W))
        }
        # Without a keyframe there is no first rotation; what refuses that stands in one place.
        R_ref = np.concatenate([arrays["R_WB"], np.eye(3)[None]])[0]
        out = cls(**arrays, dphi_0=np.zeros(3), R_WB0_ref=R_ref, gyro_bias=gyro_bias, accel_bias=accel_bias)
        return out.require_valid()

    def with_biases(self, gyro_bias: Array, accel_bias: Array) -> State:
        """This state with biases to estimate: (3,) for all keyframes, or (N, 3).

        Raises DataError for other shapes or numbers that are not finite.
        """
        biases = {
            name: vectors("state", bias, self.n_keyframes, field=name)
            for name, bias in zip(BIASES, (gyro_bias, accel_bias), strict=True)
        }
        return replace(self, **biases)

    def require_valid(self) -> State:
        """This state, if it is one: as :meth:`start` asks, and with Eq. (9) true of the first rotation.

        Raises DataError. For states from outside; the methods of a valid state keep it valid.
        """
        arrays = [getattr(self, name) for name in _SHAPES]
        for name in self._biases:
            reals("state", getattr(self, name), (self.n_keyframes, 3), field=name)
        if rotation.state_defect(*arrays) < 1e-6:
            return self
        for name, array in zip(_SHAPES, arrays, strict=True):
            reals("state", array, _SHAPES[name], field=name)
        require_rotations("state", self.R_WB, field="R_WB")
        if np.max(np.abs(self.dphi_0)) > 7.0 or np.linalg.norm(self.dphi_0) > 2.0 * np.pi - 1e-6:
            raise DataError(
                "state",
                "must be shorter than 2 pi, where Eq. (9) has no derivative",
                field="dphi_0",
                value=self.dphi_0,
            )
        require_rotations("state", self.R_WB0_ref[None], field="R_WB0_ref")
        if np.abs(so3.exp(self.dphi_0) @ self.R_WB0_ref - self.R_WB[0]).max() > 1e-6:
            raise DataError(
                "state", "Exp(dphi_0) R_WB0_ref must be the first rotation", field="dphi_0", value=self.dphi_0
            )
        return self

    def require_bounded(self) -> State:
        """This state, valid and without numbers of 1e100 or more, of whose squares no answer could be made.

        Raises DataError. A solver may start from larger ones, and says that the cost is not finite.
        """
        for name in ("p_W", "v_W", "X_W"):
            reals("state", getattr(self, name), _SHAPES[name], field=name)
        return self.require_valid()

    def require_size(self, other: State) -> None:
        """DataError where another state has not as many keyframes and landmarks, or biases, as this one."""
        mine, others = (self.n_keyframes, self.n_landmarks), (other.n_keyframes, other.n_landmarks)
        if mine != others:
            rule = f"must have {mine[0]} keyframes and {mine[1]} landmarks"
            raise DataError("state", rule, value=others)
        if self.has_biases != other.has_biases:
            rule = "must be given: they are estimated" if self.has_biases else "must be None: they are known"
            raise DataError("state", rule, field="gyro_bias and accel_bias")

    @property
    def n_keyframes(self) -> int:
        return len(self.p_W)

    @property
    def n_landmarks(self) -> int:
        return len(self.X_W)

    @property
    def n_parameters(self) -> int:
        """n = 9N + 3K of Table I, 15N + 3K with biases."""
        return self.n_motion + 3 * self.n_landmarks

    @property
    def has_biases(self) -> bool:
        """Whether biases are part of the state."""
        return self.gyro_bias is not None

    @property
    def _biases(self) -> tuple[str, ...]:
        return BIASES if self.has_biases else ()

    @property
    def width(self) -> int:
        """Parameters of a keyframe: 9, or 15 with biases."""
        return KEYFRAME if self.gyro_bias is None else WITH_BIASES

    @property
    def n_motion(self) -> int:
        """Parameters of all keyframes: 9N, or 15N with biases."""
        return self.width * self.n_keyframes

    @property
    def local_origin(self) -> Array | None:
        """(3,) the first position, m, where W's origin is far away (a hundred times the path), else None.

        Map or Earth-centred coordinates (1e6 m and more) are long against what happens in them: a step is
        then compared with the state about this point, and a turn is taken about it.
        """
        first = self.p_W[0].tolist()
        size = max(map(abs, first))
        # The last position says enough of most paths.
        if size <= 100.0 * math.dist(first, self.p_W[-1].tolist()):
            return None
        return self.p_W[0] if size > 100.0 * np.abs(self.p_W - self.p_W[0]).max() else None

    def retract(self, delta: Array) -> State:
        """The state moved by an increment (n,) in the order of this module, Eqs. (8)-(9).

        Raises DataError for another length or numbers that are not finite.
        """
        return self.stepped(reals("increment", delta, (self.n_parameters,)))

    def stepped(self, delta: Array) -> State:
        """As :meth:`retract`, for an increment that is known to be one: a solver's own step."""
        n = len(self.p_W)
        p_W, R_WB, v_W = np.empty((n, 3)), np.empty((n, 3, 3)), np.empty((n, 3))
        X_W, dphi_0 = np.empty((len(self.X_W), 3)), np.empty(3)
        rotation.retract(
            delta,
            self.p_W,
            self.R_WB,
            self.v_W,
            self.X_W,
            self.dphi_0,
            self.R_WB0_ref,
            p_W,
            R_WB,
            v_W,
            X_W,
            dphi_0,
        )
        # Made of arrays that have their form, so nothing is looked at: that would cost more than the step.
        out = object.__new__(State)
        vars(out).update(p_W=p_W, R_WB=R_WB, v_W=v_W, X_W=X_W, dphi_0=dphi_0, R_WB0_ref=self.R_WB0_ref)
        if self.gyro_bias is not None and self.accel_bias is not None:
            gyro, accel = delta[KEYFRAME * len(p_W) : self.n_motion].reshape(2, -1, 3)
            vars(out).update(gyro_bias=self.gyro_bias + gyro, accel_bias=self.accel_bias + accel)
        return out

    def local(self, other: State) -> Array:
        """The increment d (n,) after which ``self.retract(d)`` has the poses of ``other``.

        Raises DataError where the two differ in size or one is no valid state.
        """
        self.require_valid().require_size(instance("state", other, State).require_valid())
        turn = so3.log(other.R_WB @ self.R_WB.swapaxes(1, 2))
        if np.array_equal(self.R_WB0_ref, other.R_WB0_ref):
            turn[0] = other.dphi_0 - self.dphi_0
        else:
            turn[0] = so3.log(other.R_WB[0] @ self.R_WB0_ref.T) - self.dphi_0
        return np.concatenate(
            [
                (other.p_W - self.p_W).ravel(),
                turn.ravel(),
                (other.v_W - self.v_W).ravel(),
                *((getattr(other, name) - getattr(self, name)).ravel() for name in self._biases),
                (other.X_W - self.X_W).ravel(),
            ]
        )

    def transformed(self, yaw: float, t_W: Array) -> State:
        """g(theta) of Eqs. (4)-(5): turned by ``yaw`` (rad) about gravity, then shifted by t_W (m).

        Biases are in the body frame and stay.

        Raises DataError for a shift of another shape or numbers that are not finite.
        """
        R_z, t_W = so3.yaw_rotation(number("yaw", yaw)), reals("t_W", t_W, (3,))
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
