"""A ground truth against the inertial sensor: rotations against the gyroscope, motion against the force."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...geometry import so3
from ...geometry.so3 import Array
from ...model.imu import ImuNoise, ImuSamples, preintegrate
from ..asl.ground_truth import GroundTruth
from ..asl.nearest import nearest_index
from ..asl.truth_steps import SMALLEST_M, find_steps
from .findings import Findings
from .turning import GyroRotation, TurnFit, Turns, compare_turns

_INTERVAL_S, _MOST_INTERVALS = 0.25, 400
# A good truth has the gyroscope's axes within hundredths of a degree over seconds of motion; half a degree is
# as much as two seconds of bias error at 0.004 rad/s, and tilts gravity by 0.09 m/s^2.
AXES_WARNING_DEG = 0.5
# Nothing but another convention or another body turns the axes this far.
AXES_ERROR_DEG = 10.0
# Share of the turns that the fit may leave over before the two are not the same motion.
RESIDUAL_SHARE = 0.3
# Truth and inertial sensor may be stamped by different clocks; at 1 rad/s 5 ms are 0.3 deg.
OFFSET_WARNING_S = 0.005
_PROPAGATION_S, _MOST_PROPAGATIONS = 1.0, 30
# Of a second of propagation, m/s^2: biases left in explain 0.5, wrong gravity makes 2 g = 19.6.
FORCE_WARNING_MPS2, FORCE_ERROR_MPS2 = 0.6, 4.0
_DENSITIES = ImuNoise(1e-4, 1e-3)  # only the mean of the increments is used here


def check_truth(
    name: str, truth: GroundTruth, samples: ImuSamples, frames_ns: NDArray[np.int64], out: Findings
) -> None:
    """Facts and findings on one ground-truth folder.

    Neither the axes nor the offset need known biases: a constant gyroscope bias is part of
    the fit. So a truth whose orientation is off shows, whatever its own biases make up for.
    """
    inside = (truth.t_ns >= samples.t_ns[0]) & (truth.t_ns <= samples.t_ns[-1])
    out.fact(
        name,
        rows=len(truth.t_ns),
        rate_hz=1e9 / float(np.median(np.diff(truth.t_ns))) if len(truth.t_ns) > 1 else None,
        velocities=truth.v_W is not None,
        biases=truth.gyro_bias is not None,
    )
    if np.count_nonzero(inside) < 2:
        out.error("truth", f"{name} shares no time with imu0: their clocks or units differ")
        return
    outside = int(np.count_nonzero((frames_ns < truth.t_ns[0]) | (frames_ns > truth.t_ns[-1])))
    out.fact(name, frames_outside=outside)
    if outside:
        out.warn("truth", f"{name} does not cover {outside} of {len(frames_ns)} frames")
    t_ns, R_WB = _spaced(truth, np.flatnonzero(inside))
    gyro = GyroRotation(samples)
    fit = compare_turns(gyro, _turns(t_ns, R_WB))
    if fit is None:
        out.skip(f"rotation of {name}", "too little rotation to compare with the gyroscope")
    else:
        _judge_turns(name, fit, gyro, t_ns, R_WB, out)
    bias = fit.gyro_bias if fit is not None else np.mean(samples.gyro, axis=0)
    _check_force(name, truth, samples, bias, out)
    _check_steps(name, truth, samples, out)


def _check_steps(name: str, truth: GroundTruth, samples: ImuSamples, out: Findings) -> None:
    """Jumps of the position that the accelerometer rules out; the front-end evaluates without them."""
    steps = find_steps(truth, samples)
    if steps is None:
        out.skip(f"steps of {name}", "its samples are too far apart, or imu0 does not cover them")
        return
    longest = max((step.length_m for step in steps), default=0.0)
    out.fact(name, steps=[step.t_ns for step in steps], longest_step_m=longest)
    if steps:
        out.warn(
            "truth steps",
            f"the position of {name} jumps {len(steps)} times between samples, by up to {1e3 * longest:.1f} "
            f"mm (limit {1e3 * SMALLEST_M:g} mm, first at {steps[0].t_ns}): taken out before anything is "
            "evaluated",
        )


def _spaced(truth: GroundTruth, rows: NDArray[np.intp]) -> tuple[NDArray[np.int64], Array]:
    """Stamps and rotations every quarter of a second."""
    stamps = truth.t_ns[rows]
    n = max(int((stamps[-1] - stamps[0]) * 1e-9 / _INTERVAL_S), 1)
    wanted = np.linspace(stamps[0], stamps[-1], n + 1).astype(np.int64)
    chosen = np.unique(rows[nearest_index(stamps, wanted)[0]])
    return truth.t_ns[chosen], truth.R_WB[chosen]


def _turns(t_ns: NDArray[np.int64], R_WB: Array) -> Turns:
    phi = so3.log(R_WB[:-1].swapaxes(1, 2) @ R_WB[1:])
    turns = Turns(t_ns[:-1], t_ns[1:], phi, np.eye(3))
    if len(phi) > _MOST_INTERVALS:
        keep = np.zeros(len(phi), dtype=bool)
        keep[np.linspace(0, len(phi) - 1, _MOST_INTERVALS).round().astype(int)] = True
        turns = turns.where(keep)
    return turns


def _judge_turns(
    name: str, fit: TurnFit, gyro: GyroRotation, t_ns: NDArray[np.int64], R_WB: Array, out: Findings
) -> None:
    turns = _turns(t_ns, R_WB)
    share = fit.rms_rad / turns.rms_rad
    out.fact(
        name,
        gyro_offset_ms=1e3 * fit.offset_s,
        gyro_offset_sigma_ms=1e3 * fit.offset_sigma_s,
        gyro_axes_deg=fit.axes_deg,
        gyro_scale=fit.scale,
        gyro_residual_deg=float(np.degrees(fit.rms_rad)),
        gyro_bias_radps=fit.gyro_bias,
    )
    if share > RESIDUAL_SHARE or fit.axes_deg > AXES_ERROR_DEG:
        out.error(
            "truth rotation",
            f"the rotation of {name} is not that of the gyroscope: {100 * share:.0f} % of it is left over"
            + _explanation(gyro, t_ns, R_WB, fit.rms_rad),
        )
        return
    if fit.axes_deg > AXES_WARNING_DEG:
        out.warn(
            "truth rotation",
            f"the orientation of {name} is off: its turns have axes {fit.axes_deg:.2f} deg from those of "
            f"the gyroscope (limit {AXES_WARNING_DEG:g}). Do not evaluate rotations against it, nor take "
            "accelerometer biases from it",
        )
    if abs(fit.offset_s) > max(OFFSET_WARNING_S, 3.0 * fit.offset_sigma_s):
        out.warn(
            "truth clock",
            f"the clock of {name} is off by {1e3 * fit.offset_s:.1f} ms (gyroscope minus truth)",
        )


def _explanation(gyro: GyroRotation, t_ns: NDArray[np.int64], R_WB: Array, rms_rad: float) -> str:
    """The misreading of the quaternions that makes the rotations fit, in words; empty where none does."""
    q = so3.quaternion(R_WB)
    readings = {
        "the quaternions look like x y z w, the format has w first": so3.from_quaternion(q[:, [3, 0, 1, 2]]),
        "the quaternions look like world-to-body, the format has body-to-world": R_WB.swapaxes(1, 2),
    }
    for words, R in readings.items():
        fit = compare_turns(gyro, _turns(t_ns, R))
        if fit is not None and fit.rms_rad < 0.2 * rms_rad:
            return f"; {words}"
    return ""


def _check_force(name: str, truth: GroundTruth, samples: ImuSamples, gyro_bias: Array, out: Findings) -> None:
    """A second of inertial propagation from the truth's states against where it ends."""
    left_over = _propagation_errors(truth, samples, gyro_bias)
    if left_over is None:
        out.skip(f"force of {name}", f"no {_PROPAGATION_S:g} s of both")
        return
    size = float(np.median(np.linalg.norm(left_over, axis=1)))
    mean = np.median(left_over, axis=0)
    out.fact(name, force_residual_mps2=size, mean_force_residual_W_mps2=mean)
    if size > FORCE_ERROR_MPS2:
        out.error(
            "gravity direction",
            f"inertial propagation over {_PROPAGATION_S:g} s from {name} leaves {size:.3g} m/s^2 over "
            f"({mean[0]:.2f}, {mean[1]:.2f}, {mean[2]:.2f} in its world): the accelerometer must measure "
            "+9.8 m/s^2 upwards at rest, and the world's z axis must point up",
        )
    elif size > FORCE_WARNING_MPS2:
        out.warn(
            "truth force",
            f"inertial propagation over {_PROPAGATION_S:g} s from {name} leaves {size:.3g} m/s^2 over "
            f"(limit {FORCE_WARNING_MPS2:g}): orientation or accelerometer biases are off",
        )


def _propagation_errors(truth: GroundTruth, samples: ImuSamples, gyro_bias: Array) -> Array | None:
    """(P, 3) m/s^2 in the truth's world: mean acceleration that propagation leaves over, or None."""
    length = round(_PROPAGATION_S * 1e9)
    v_W = truth.v_W if truth.v_W is not None else _velocities(truth)
    usable = (truth.t_ns >= samples.t_ns[0]) & (truth.t_ns + length + length // 10 <= samples.t_ns[-1])
    usable &= truth.t_ns + length <= truth.t_ns[-1]
    rows = np.flatnonzero(usable & np.all(np.isfinite(v_W), axis=1))
    if not len(rows):
        return None
    rows = rows[np.unique(np.linspace(0, len(rows) - 1, _MOST_PROPAGATIONS).round().astype(int))]
    ends, distance = nearest_index(truth.t_ns, truth.t_ns[rows] + length)
    out = []
    for row, end, off in zip(rows, ends, distance, strict=True):
        if off > length // 10:
            continue  # a hole in the truth
        bias = truth.gyro_bias[row] if truth.gyro_bias is not None else gyro_bias
        force = truth.accel_bias[row] if truth.accel_bias is not None else np.zeros(3)
        start_ns, end_ns = int(truth.t_ns[row]), int(truth.t_ns[end])
        # Gaps are a finding of their own.
        moved = preintegrate(
            samples.corrected(bias, force),
            start_ns,
            end_ns,
            _DENSITIES,
            largest_gap_s=1e9,
        )
        gravity = np.array([0.0, 0.0, -9.81])
        expected = (
            truth.p_W[row] + moved.dt * v_W[row] + 0.5 * moved.dt**2 * gravity + truth.R_WB[row] @ moved.dp
        )
        out.append(2.0 * (truth.p_W[end] - expected) / moved.dt**2)
    return np.array(out) if out else None


def _velocities(truth: GroundTruth) -> Array:
    """(M, 3) m/s by central differences over a tenth of a second; NaN at the ends and in holes."""
    half = 50_000_000
    before, off_before = nearest_index(truth.t_ns, truth.t_ns - half)
    after, off_after = nearest_index(truth.t_ns, truth.t_ns + half)
    dt = (truth.t_ns[after] - truth.t_ns[before])[:, None] * 1e-9
    v_W = (truth.p_W[after] - truth.p_W[before]) / np.where(dt > 0.0, dt, np.nan)
    v_W[(off_before > half // 2) | (off_after > half // 2)] = np.nan
    return v_W
