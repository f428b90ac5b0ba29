"""Visual-inertial alignment: biases, gravity, velocities and scale from visual poses and inertial samples.

This is the start of an estimator without any truth. Visual poses of keyframes, in the frame M of their map,
say how the body moved. The inertial samples say it too, up to biases, gravity, velocities and, for one
camera, the scale of the map. As in VINS-Mono (Qin and Shen, IROS 2017) the gyroscope's bias comes first, by
turns alone, then all else by equations of motion that are linear in it. As in ORB-SLAM3 (Campos et al.,
T-RO 2021) everything is then estimated together by maximum likelihood, with gravity's length held. Visual
poses are not taken to be exact, as they are there: each step between neighbours has a sigma, which the data
can tell.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.linalg
import scipy.sparse
from numpy.typing import ArrayLike, NDArray

from ..arrays import integers, number, reals, require_rotations
from ..errors import DataError, DegenerateError, SolverError
from ..geometry import so3
from ..geometry.so3 import Array
from ..model.imu import ImuNoise, ImuSamples, Preintegrated, preintegrate
from .frontend.initialisation import length_of_gravity, turn_onto

# Turn-on bias of a MEMS accelerometer without calibration at the factory: 20 mg.
ACCEL_BIAS_SIGMA_MPS2 = 0.2
# Sigmas of a visual step before the residuals tell them: metres (or, without scale, share of the median step)
# and radians.
_STEP_M, _STEP_SHARE, _STEP_RAD = 0.005, 0.01, 0.002
# What the guess above counts for among the residuals that tell the sigmas, in residuals.
_GUESS_WEIGHT = 0.1
_ROUNDS_GYRO, _MOST_ROUNDS = 5, 50
# Moves below this are far inside one sigma; sigmas that change by less have settled.
_SMALL_STEP, _SETTLED = 1e-3, 0.01
# Above, the scale of a map is a guess.
_LARGEST_SCALE_SIGMA = 0.1
# A direction of the bias whose sigma is still this share of the prior's has not been observed.
_UNOBSERVED = 0.8
_NO_SCALE = (
    "the motion does not tell the scale of the map{known}: a window in which the camera speeds up and slows "
    "down along several axes, or a second camera, would do"
)
# Columns of the equations: gyroscope bias, accelerometer bias, gravity, scale; then position, turn and
# velocity of each keyframe.
_GYRO, _ACCEL, _GRAVITY, _SCALE, _SHARED, _WIDTH = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 10), 10, 9


@dataclass(frozen=True)
class Alignment:
    """Result of :func:`align`."""

    R_WM: Array  # (3, 3) turns the map upright: its yaw is that of the least turn
    # (N, 3) m, (N, 3, 3), (N, 3) m/s motion of the body along the map's axes, as vision and inertial samples
    # tell it together.
    p_M: Array
    R_MB: Array
    v_M: Array
    # (3,) rad/s and m/s^2, constant over the window.
    gyro_bias: Array
    accel_bias: Array
    scale: float  # metres a unit of the map; 1 where it was known
    # (9, 9) of gyroscope bias, accelerometer bias and the turn of gravity, a rotation vector in M across
    # gravity (rad; of rank 2, it has no part along it).
    covariance: Array
    velocity_sigma: Array  # (N, 3) m/s along the map's axes, poses of the first keyframe held
    scale_sigma: float  # relative, 0 where the scale was known
    # Deviations of the visual step between neighbouring keyframes, in units of the map and rad.
    step_sigma: tuple[float, float]
    free_gravity: float  # length of gravity, m/s^2, where it is not forced to the known magnitude
    # Of what the equations of motion leave over at the visual poses.
    rms_position_m: float
    rms_velocity_mps: float
    remarks: tuple[str, ...]  # a sentence on what the window does not tell

    @property
    def gyro_bias_sigma(self) -> Array:
        """(3,) rad/s."""
        return np.sqrt(np.diagonal(self.covariance)[:3])

    @property
    def accel_bias_sigma(self) -> Array:
        """(3,) m/s^2."""
        return np.sqrt(np.diagonal(self.covariance)[3:6])

    @property
    def tilt_sigma(self) -> float:
        """Deviation of gravity's direction, rad, about the axis about which it is known least."""
        return float(np.sqrt(np.linalg.eigvalsh(self.covariance[6:, 6:])[-1]))

    def to_mapping(self) -> dict[str, Any]:
        """Biases and what is known of them, as plain numbers and lists."""
        return {
            "gyro_bias_radps": self.gyro_bias.tolist(),
            "gyro_bias_sigma_radps": self.gyro_bias_sigma.tolist(),
            "accel_bias_mps2": self.accel_bias.tolist(),
            "accel_bias_sigma_mps2": self.accel_bias_sigma.tolist(),
            "tilt_sigma_rad": self.tilt_sigma,
            "velocity_sigma_mps": float(np.sqrt(np.mean(self.velocity_sigma**2))),
            "scale": self.scale,
            "scale_sigma": self.scale_sigma,
            "step_sigma": list(self.step_sigma),
            "remarks": list(self.remarks),
        }


def align(
    p_M: ArrayLike,
    R_MB: ArrayLike,
    samples: ImuSamples,
    t_ns: ArrayLike,
    noise: ImuNoise,
    gravity: float = 9.81,
    *,
    p_B: ArrayLike = (0.0, 0.0, 0.0),
    scale: bool = False,
    accel_bias_sigma: float = ACCEL_BIAS_SIGMA_MPS2,
    step_sigma: tuple[float, float] | None = None,
    largest_gap_s: float | None = None,
) -> Alignment:
    """Biases, gravity, velocities and, if asked for, scale: maximum likelihood, with sigmas.

    Biases are constant over the window. Visual errors add up from keyframe to keyframe: each step has an
    error of its own.

    Parameters
    ----------
    p_M : (N, 3) positions in the map of the point ``p_B`` of the body, in m, or in units of the map
    R_MB : (N, 3, 3) attitudes of the body in the map
    samples : as recorded, biases in; they must cover ``t_ns``
    t_ns : (N,) stamps of the keyframes by the clock of the samples, ns, increasing
    gravity : its magnitude, m/s^2
    p_B : (3,) m; the camera's position on the body where the poses are the camera's
    scale : estimate the metres a unit of the map (poses of one camera)
    accel_bias_sigma : prior of the accelerometer's bias about zero, m/s^2
    step_sigma : deviations of a visual step, position in units of the map and turn in rad; None: as the
        residuals tell
    largest_gap_s : as :func:`vigauge.preintegrate`

    Raises DataError for input of the wrong shape, fewer than three keyframes, samples that do not cover them.
    DegenerateError where the motion does not tell the scale. VigaugeError where poses and samples do not
    belong together: gravity comes out nowhere near its length.
    """
    window = _Window.of(p_M, R_MB, samples, t_ns, noise, gravity, p_B, accel_bias_sigma, largest_gap_s)
    guess = (_STEP_SHARE * window.median_step or _STEP_M, _STEP_RAD) if scale else (_STEP_M, _STEP_RAD)
    sigma = reals("alignment", guess if step_sigma is None else step_sigma, (2,), field="step_sigma")
    if np.any(sigma <= 0.0):
        raise DataError("alignment", "must be positive", field="step_sigma", value=sigma.tolist())
    state, free_gravity = _linear_start(window, sigma, scale)
    state, basis, covariance, sigma = _refined(window, state, sigma, scale, step_sigma is not None)
    return _result(window, state, basis, covariance, sigma, free_gravity)


def _result(
    window: _Window, state: _State, basis: Array, covariance: Array, sigma: Array, free_gravity: float
) -> Alignment:
    """What was found, in the terms of who asked. DegenerateError where the scale is a guess."""
    shared = basis[:_SHARED] @ covariance @ basis[:_SHARED].T
    scale_sigma = float(np.sqrt(shared[_SCALE, _SCALE].item())) / state.scale
    if scale_sigma > _LARGEST_SCALE_SIGMA:
        known = f" to {100 * _LARGEST_SCALE_SIGMA:.0f} % (its sigma is {100 * scale_sigma:.0f} %)"
        raise DegenerateError(_NO_SCALE.format(known=known))
    # The turn w of gravity that moves it by dg is g x dg / |g|^2.
    to_turn = scipy.linalg.block_diag(np.eye(6), so3.hat(state.g_M) / window.gravity**2)
    covariance_of_shared = to_turn @ shared[:9, :9] @ to_turn.T
    velocity = np.arange(_SHARED, basis.shape[0]).reshape(-1, _WIDTH)[:, 6:].ravel()
    velocity_variance = np.einsum("ij,jk,ik->i", basis[velocity], covariance, basis[velocity])
    left_over = _equations(window, replace(state, p_M=window.p_M, R_MB=window.R_MB)).residual
    rms = np.sqrt(np.mean(np.sum(left_over.reshape(-1, 3, 3) ** 2, axis=2), axis=0))
    return Alignment(
        R_WM=turn_onto(state.g_M, np.array([0.0, 0.0, -1.0])),
        p_M=state.scale * state.p_M - state.R_MB @ window.p_B,
        R_MB=state.R_MB,
        v_M=state.v_M,
        gyro_bias=state.gyro_bias,
        accel_bias=state.accel_bias,
        scale=state.scale,
        covariance=covariance_of_shared,
        velocity_sigma=np.sqrt(velocity_variance).reshape(-1, 3),
        scale_sigma=scale_sigma,
        step_sigma=(float(sigma[0]), float(sigma[1])),
        free_gravity=free_gravity,
        rms_position_m=float(rms[0]),
        rms_velocity_mps=float(rms[2]),
        remarks=_remarks(covariance_of_shared[_ACCEL, _ACCEL], window.accel_bias_sigma),
    )


@dataclass(frozen=True)
class _Window:
    """What was measured."""

    p_M: Array
    R_MB: Array
    samples: ImuSamples
    t_ns: NDArray[np.int64]
    noise: ImuNoise
    gravity: float
    p_B: Array
    accel_bias_sigma: float
    largest_gap_s: float | None

    @classmethod
    def of(
        cls,
        p_M: ArrayLike,
        R_MB: ArrayLike,
        samples: ImuSamples,
        t_ns: ArrayLike,
        noise: ImuNoise,
        gravity: float,
        p_B: ArrayLike,
        accel_bias_sigma: float,
        largest_gap_s: float | None,
    ) -> _Window:
        """The checked input of :func:`align`, samples outside of the keyframes left out."""
        stamps = integers("alignment", t_ns, ("N",), field="t_ns")
        n = len(stamps)
        if n < 3:
            rule = "at least three keyframes are needed: two do not tell velocity and gravity apart"
            raise DataError("alignment", rule, field="t_ns", value=n)
        if np.any(np.diff(stamps) <= 0):
            row = int(np.argmax(np.diff(stamps) <= 0)) + 1
            raise DataError("alignment", "must increase", row=row, field="t_ns", value=int(stamps[row]))
        R = reals("alignment", R_MB, (n, 3, 3), field="R_MB")
        require_rotations("alignment", R, field="R_MB")
        lo = max(int(np.searchsorted(samples.t_ns, stamps[0], side="right")) - 1, 0)
        hi = int(np.searchsorted(samples.t_ns, stamps[-1], side="left")) + 1
        return cls(
            reals("alignment", p_M, (n, 3), field="p_M"),
            R,
            ImuSamples(samples.t_ns[lo:hi], samples.gyro[lo:hi], samples.accel[lo:hi]),
            stamps,
            noise,
            number("alignment", gravity, field="gravity", above=0.0),
            reals("alignment", p_B, (3,), field="p_B"),
            number("alignment", accel_bias_sigma, field="accel_bias_sigma", above=0.0),
            largest_gap_s,
        )

    def factors(self, gyro_bias: Array, accel_bias: Array) -> list[Preintegrated]:
        """One from each keyframe to the next, linearised at these biases."""
        corrected = self.samples.corrected(gyro_bias, accel_bias)
        ends = zip(self.t_ns[:-1].tolist(), self.t_ns[1:].tolist(), strict=True)
        return [preintegrate(corrected, a, b, self.noise, largest_gap_s=self.largest_gap_s) for a, b in ends]

    @cached_property
    def steps(self) -> tuple[Array, Array]:
        """Visual steps (N - 1, 3) and (N - 1, 3, 3) in the frame of the body that they start from."""
        return _steps(self.p_M, self.R_MB)

    @property
    def median_step(self) -> float:
        return float(np.median(np.linalg.norm(self.steps[0], axis=1)))


@dataclass(frozen=True)
class _State:
    """What is estimated; ``p_M`` in units of the map, of the point ``p_B`` of the body."""

    gyro_bias: Array
    accel_bias: Array
    g_M: Array
    scale: float
    p_M: Array
    R_MB: Array
    v_M: Array

    def moved(self, step: Array) -> _State:
        """The state after a step (10 + 9 N,) in the order of the columns; turns act on the left."""
        own = step[_SHARED:].reshape(-1, 3, 3)
        return _State(
            self.gyro_bias + step[_GYRO],
            self.accel_bias + step[_ACCEL],
            self.g_M + step[_GRAVITY],
            self.scale + float(step[_SCALE].item()),
            self.p_M + own[:, 0],
            so3.exp(own[:, 1]) @ self.R_MB,
            self.v_M + own[:, 2],
        )


@dataclass(frozen=True)
class _Equations:
    """Inertial equations: ``residual`` (F, 9), ``jacobian`` (F, 9, 28) in the shared columns, then those of
    the first and of the second keyframe, and ``covariance`` (F, 9, 9)."""

    residual: Array
    jacobian: Array
    covariance: Array


def _steps(p_M: Array, R_MB: Array) -> tuple[Array, Array]:
    back = R_MB[:-1].swapaxes(1, 2)
    return np.einsum("fij,fj->fi", back, np.diff(p_M, axis=0)), back @ R_MB[1:]


def _equations(window: _Window, state: _State) -> _Equations:
    """Equations of motion over each interval, of what Forster et al. (T-RO 2017), Eq. (45), leave over."""
    factors = window.factors(state.gyro_bias, state.accel_bias)
    dp, dR, dv, covariance = (
        np.array([getattr(f, name) for f in factors]) for name in ("dp", "dR", "dv", "covariance")
    )
    by_bias = np.array([np.hstack([f.by_gyro_bias, f.by_accel_bias]) for f in factors])
    dt = np.array([f.dt for f in factors])[:, None]
    back = state.R_MB[:-1].swapaxes(1, 2)
    arm = state.R_MB @ window.p_B
    path = np.diff(state.p_M, axis=0)
    move = state.scale * path - np.diff(arm, axis=0) - dt * state.v_M[:-1] - 0.5 * dt**2 * state.g_M
    change = np.diff(state.v_M, axis=0) - dt * state.g_M
    turn = so3.log(dR.swapaxes(1, 2) @ back @ state.R_MB[1:])
    residual = np.hstack(
        [np.einsum("fij,fj->fi", back, move) - dp, turn, np.einsum("fij,fj->fi", back, change) - dv]
    )
    J = np.zeros((len(factors), 9, _SHARED + 2 * _WIDTH))
    J[:, :, :6] = -by_bias
    J[:, 3:6, :6] = -so3.left_jacobian_inverse(turn) @ by_bias[:, 3:6]
    J[:, 0:3, _GRAVITY], J[:, 6:9, _GRAVITY] = -0.5 * dt[:, :, None] ** 2 * back, -dt[:, :, None] * back
    J[:, 0:3, _SCALE] = back @ path[:, :, None]
    first, second = J[:, :, _SHARED : _SHARED + _WIDTH], J[:, :, _SHARED + _WIDTH :]
    first[:, 0:3, 0:3], second[:, 0:3, 0:3] = -state.scale * back, state.scale * back
    first[:, 0:3, 3:6], second[:, 0:3, 3:6] = back @ so3.hat(move - arm[:-1]), back @ so3.hat(arm[1:])
    first[:, 0:3, 6:9] = -dt[:, :, None] * back
    second[:, 3:6, 3:6] = so3.right_jacobian_inverse(turn) @ state.R_MB[1:].swapaxes(1, 2)
    first[:, 3:6, 3:6] = -second[:, 3:6, 3:6]
    first[:, 6:9, 3:6] = back @ so3.hat(change)
    first[:, 6:9, 6:9], second[:, 6:9, 6:9] = -back, back
    return _Equations(residual, J, covariance)


def _visual(window: _Window, state: _State) -> tuple[Array, Array]:
    """Residual (F, 6) of the visual steps, position then turn, and its (F, 6, 28) Jacobian."""
    p_step, R_step = window.steps
    p, R = _steps(state.p_M, state.R_MB)
    turn = so3.log(R_step.swapaxes(1, 2) @ R)
    back = state.R_MB[:-1].swapaxes(1, 2)
    J = np.zeros((len(p), 6, _SHARED + 2 * _WIDTH))
    first, second = J[:, :, _SHARED : _SHARED + _WIDTH], J[:, :, _SHARED + _WIDTH :]
    first[:, 0:3, 0:3], second[:, 0:3, 0:3] = -back, back
    first[:, 0:3, 3:6] = back @ so3.hat(np.diff(state.p_M, axis=0))
    second[:, 3:6, 3:6] = so3.right_jacobian_inverse(turn) @ state.R_MB[1:].swapaxes(1, 2)
    first[:, 3:6, 3:6] = -second[:, 3:6, 3:6]
    return np.hstack([p - p_step, turn]), J


def _scattered(J: Array, n_keyframes: int) -> scipy.sparse.csr_array:
    """(F r, 10 + 9 N) of blocks (F, r, 28) over neighbouring keyframes."""
    f, r, width = J.shape
    own = _SHARED + _WIDTH * np.arange(f)[:, None] + np.arange(2 * _WIDTH)
    columns = np.hstack([np.tile(np.arange(_SHARED), (f, 1)), own])
    rows = np.arange(f * r).reshape(f, r, 1)
    where = (np.broadcast_to(rows, J.shape).ravel(), np.broadcast_to(columns[:, None], J.shape).ravel())
    return scipy.sparse.csr_array((J.ravel(), where), (f * r, _SHARED + _WIDTH * n_keyframes))


def _whitener(covariance: Array) -> Array:
    return np.linalg.inv(np.linalg.cholesky(covariance))


def _gyro_bias(window: _Window, sigma_rad: float) -> Array:
    """(3,) rad/s by Gauss-Newton over the turns between neighbours, with both sensors' noise."""
    bias = np.zeros(3)
    for _ in range(_ROUNDS_GYRO):
        factors = window.factors(bias, np.zeros(3))
        dR = np.array([f.dR for f in factors])
        turn = so3.log(dR.swapaxes(1, 2) @ window.steps[1])
        W = _whitener(np.array([f.covariance[3:6, 3:6] for f in factors]) + sigma_rad**2 * np.eye(3))
        J = W @ so3.left_jacobian_inverse(turn) @ np.array([f.by_gyro_bias[3:6] for f in factors])
        bias = (
            bias + np.linalg.lstsq(J.reshape(-1, 3), np.einsum("fij,fj->fi", W, turn).ravel(), rcond=None)[0]
        )
    return bias


def _linear_start(window: _Window, sigma: Array, scale: bool) -> tuple[_State, float]:
    """Velocities, gravity of any length, accelerometer bias and scale at the visual poses; and that length.

    The poses' errors count as noise of the equations. Gravity of the state has the known length.
    """
    n = len(window.p_M)
    zero = np.zeros(3)
    state = _State(_gyro_bias(window, sigma[1]), zero, zero, 1.0, window.p_M, window.R_MB, np.zeros((n, 3)))
    equations = _equations(window, state)
    W = _whitener(equations.covariance + np.diag(np.repeat([sigma[0] ** 2, sigma[1] ** 2, 0.0], 3)))
    A = _scattered(W @ equations.jacobian, n).toarray()
    wanted = np.zeros(A.shape[1], dtype=bool)
    wanted[_ACCEL] = wanted[_GRAVITY] = True
    wanted[_SCALE] = scale
    wanted[_SHARED:].reshape(n, _WIDTH)[:, 6:] = True
    prior = np.eye(A.shape[1])[_ACCEL] / window.accel_bias_sigma
    b = np.einsum("fij,fj->fi", W, equations.residual).ravel()
    step = np.zeros(A.shape[1])
    step[wanted] = np.linalg.lstsq(np.vstack([A, prior])[:, wanted], -np.append(b, zero), rcond=None)[0]
    state = state.moved(step)
    length = length_of_gravity(state.g_M, window.gravity)
    return replace(state, g_M=state.g_M * (window.gravity / length)), length


def _refined(
    window: _Window, state: _State, sigma: Array, scale: bool, fixed_sigma: bool
) -> tuple[_State, Array, Array, Array]:
    """Everything at once by Gauss-Newton: the state, the (10 + 9 N, m) directions it may move in, the
    (m, m) covariance along them, and the sigmas of a visual step."""
    n = len(window.p_M)
    guess = sigma
    for _ in range(_MOST_ROUNDS):
        basis = _directions(state.g_M, n, scale)
        A, residual = _whitened(window, state, basis, sigma)
        covariance = _inverse(A.T @ A)
        step = -covariance @ (A.T @ residual)
        state = state.moved(basis @ step)
        state = replace(state, g_M=state.g_M * (window.gravity / np.linalg.norm(state.g_M)))
        before = sigma
        if not fixed_sigma:
            seen = A[: 6 * (n - 1)]
            left_over = residual[: len(seen)] + seen @ step
            sigma = _told_by_residuals(
                sigma, guess, left_over, np.einsum("ij,ij->i", seen @ covariance, seen)
            )
        settled = bool(np.all(np.abs(sigma / before - 1.0) < _SETTLED))
        if state.scale <= 0.0:
            break
        if settled and float(np.linalg.norm(A @ step)) < _SMALL_STEP:
            return state, basis, covariance, sigma
    if scale:
        raise DegenerateError(_NO_SCALE.format(known=""))
    raise SolverError(
        f"visual-inertial alignment does not settle in {_MOST_ROUNDS} rounds: poses and inertial data do not "
        "belong together, or the window is too short"
    )


def _whitened(window: _Window, state: _State, basis: Array, sigma: Array) -> tuple[Array, Array]:
    """Rows (r, m) along ``basis`` and residuals (r,): of visual steps, motion, and the prior of the bias."""
    n = len(window.p_M)
    visual_residual, visual_jacobian = _visual(window, state)
    weight = np.repeat(1.0 / sigma, 3)
    equations = _equations(window, state)
    W = _whitener(equations.covariance)
    seen, moved = _scattered(weight[:, None] * visual_jacobian, n), _scattered(W @ equations.jacobian, n)
    residual = [
        (weight * visual_residual).ravel(),
        np.einsum("fij,fj->fi", W, equations.residual).ravel(),
        state.accel_bias / window.accel_bias_sigma,
    ]
    A = np.vstack([seen @ basis, moved @ basis, basis[_ACCEL] / window.accel_bias_sigma])
    return A, np.concatenate(residual)


def _told_by_residuals(sigma: Array, guess: Array, left_over: Array, taken: Array) -> Array:
    """(2,) sigmas of a visual step by whitened residuals (6 F,), of which the unknowns take up ``taken``."""
    squares = np.sum(left_over.reshape(-1, 2, 3) ** 2, axis=(0, 2))
    free = np.sum(1.0 - taken.reshape(-1, 2, 3), axis=(0, 2))
    return sigma * np.sqrt((squares + _GUESS_WEIGHT * (guess / sigma) ** 2) / (free + _GUESS_WEIGHT))


def _directions(g_M: Array, n: int, scale: bool) -> Array:
    """(10 + 9 N, m): biases, gravity about the two axes across it, the scale if unknown, and all keyframes
    but for the first one's pose, which defines the map."""
    width = _SHARED + _WIDTH * n
    across = np.linalg.norm(g_M) * np.linalg.svd(g_M[None])[2][1:].T
    tilt = np.zeros((width, 2))
    tilt[_GRAVITY] = across
    free = np.ones(width, dtype=bool)
    free[_GRAVITY] = free[_SHARED : _SHARED + 6] = False
    free[_SCALE] = scale
    return np.hstack([np.eye(width)[:, free], tilt])


def _inverse(H: Array) -> Array:
    """Inverse of an information matrix of mixed units; DegenerateError where it is singular to rounding."""
    size = np.sqrt(np.diagonal(H))
    try:
        half = scipy.linalg.solve_triangular(
            np.linalg.cholesky(H / np.outer(size, size)), np.diag(1.0 / size), lower=True
        )
    except np.linalg.LinAlgError as error:
        raise DegenerateError(
            "the window does not tell biases, gravity and velocities apart: more keyframes, or a motion that "
            "speeds up and turns, would do"
        ) from error
    return half.T @ half


def _remarks(covariance: Array, prior_sigma: float) -> tuple[str, ...]:
    """A sentence on each direction (in the body) along which the accelerometer's bias stays at its prior."""
    variance, axes = np.linalg.eigh(covariance)
    return tuple(
        f"accelerometer bias along ({', '.join(f'{x:.2f}' for x in axis)}) of the body stays at its prior "
        f"(sigma {np.sqrt(v):.3g} of {prior_sigma:.3g} m/s^2): the window turns too little to tell it from "
        "gravity; a window that tilts by tens of degrees, or a known bias, would do"
        for v, axis in zip(variance, axes.T, strict=True)
        if np.sqrt(v) > _UNOBSERVED * prior_sigma
    )
