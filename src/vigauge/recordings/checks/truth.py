"""A ground truth against the inertial sensor: rotations against the gyroscope, motion against the force."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...geometry import so3
from ...geometry.so3 import Array
from ...model.imu import ImuNoise, ImuSamples, preintegrate
from ..asl.ground_truth import LARGEST_GAP_NS, GroundTruth, derived_velocity
from ..asl.nearest import nearest_index
from ..asl.truth_steps import SMALLEST_M, coarseness_m, step_candidates, why_kept
from .findings import Findings
from .truth_columns import check_biases, check_velocity
from .turning import GyroRotation, TurnFit, Turns, compare_turns

_INTERVAL_S, _MOST_INTERVALS = 0.25, 400
# A good truth has the gyroscope's axes within hundredths of a degree over seconds of motion; half a degree is
# as much as two seconds of bias error at 0.004 rad/s, and tilts gravity by 0.09 m/s^2.
AXES_WARNING_DEG = 0.5
# A warning is given where the angle is larger by this many of its standard deviations.
_SURE = 2.0
# Nothing but another convention or another body turns the axes this far.
AXES_ERROR_DEG = 10.0
# Share of the turns that the fit may leave over before the two are not the same motion.
RESIDUAL_SHARE = 0.3
# Truth and inertial sensor may be stamped by different clocks; at 1 rad/s 5 ms are 0.3 deg.
OFFSET_WARNING_S = 0.005
_PROPAGATION_S, _MOST_PROPAGATIONS = 1.0, 30
# Of a second of propagation, m/s^2: biases left in explain 0.5, wrong gravity makes 2 g = 19.6.
FORCE_WARNING_MPS2, FORCE_ERROR_MPS2 = 0.6, 4.0
# A force left over that is the same in body axes all the time is a bias; good truths leave 0.05 over.
BIAS_WARNING_MPS2 = 0.1
_DENSITIES = ImuNoise(1e-4, 1e-3)  # only the mean of the increments is used here


def check_truth(
    name: str,
    truth: GroundTruth,
    samples: ImuSamples,
    frames_ns: NDArray[np.int64],
    gyro_bias: Array | None,
    out: Findings,
) -> None:
    """Facts and findings on one ground-truth folder.

    ``gyro_bias`` (3,) rad/s is what other checks found, or None: it serves where the truth turns too little.

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
    _check_reach(name, truth, frames_ns, out)
    t_ns, R_WB = _spaced(truth, np.flatnonzero(inside))
    gyro = GyroRotation(samples)
    fit = compare_turns(gyro, _turns(t_ns, R_WB))
    if fit is None:
        out.skip(f"rotation of {name}", "too little rotation to compare with the gyroscope")
    elif not _judge_turns(name, fit, gyro, t_ns, R_WB, out):
        fit = None
    found = fit.gyro_bias if fit is not None else gyro_bias
    v_W = derived_velocity(truth)
    if truth.v_W is None:
        out.skip(
            f"columns of {name}",
            "it has poses only (8 columns): velocities are derived from its positions, over a tenth of a "
            "second, and it has no biases that could be taken as known",
        )
    else:
        if check_velocity(name, truth, v_W, out):
            v_W = truth.v_W
        check_biases(name, truth, samples, found, out)
    _check_force(name, truth, samples, v_W, found if found is not None else samples.gyro.mean(axis=0), out)
    _check_steps(name, truth, samples, out)


def _check_reach(name: str, truth: GroundTruth, frames_ns: NDArray[np.int64], out: Findings) -> None:
    """Frames at which the truth has no state: the front-end refuses keyframes there."""
    missing = frames_ns[~truth.serves(frames_ns)]
    out.fact(name, frames_outside=len(missing))
    if len(missing):
        (out.warn if len(missing) < len(frames_ns) else out.error)(
            "truth",
            f"{name} does not cover {len(missing)} of {len(frames_ns)} frames (first {missing[0]} ns): no "
            f"state there, nor states at most {LARGEST_GAP_NS / 1e6:g} ms apart around them. Keyframes "
            "there are refused where it serves to evaluate",
        )


def _check_steps(name: str, truth: GroundTruth, samples: ImuSamples, out: Findings) -> None:
    """Jumps of the position that the accelerometer rules out; the front-end evaluates without them."""
    grid = coarseness_m(truth)
    if grid:
        out.warn(
            "truth values",
            f"the positions of {name} are given to {grid:g} m only: errors below that are its own. Export "
            "it with more decimals",
        )
    steps = step_candidates(truth, samples)
    if steps is None:
        out.skip(f"steps of {name}", "its samples are too far apart, or imu0 does not cover them")
        return
    longest = max((step.length_m for step in steps), default=0.0)
    out.fact(name, steps=[step.t_ns for step in steps], longest_step_m=longest)
    kept = why_kept(truth, steps)
    if kept:
        out.warn("truth steps", f"the position of {name} moves in jumps: {kept}. Nothing is taken out")
    elif steps:
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
) -> bool:
    """Errors and warnings on rotation and clock; False where this is not the motion of the gyroscope."""
    turns = _turns(t_ns, R_WB)
    share = fit.rms_rad / turns.rms_rad
    out.fact(
        name,
        gyro_offset_ms=1e3 * fit.offset_s,
        gyro_offset_sigma_ms=1e3 * fit.offset_sigma_s,
        gyro_axes_deg=fit.axes_deg,
        gyro_axes_sigma_deg=fit.axes_sigma_deg,
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
        return False
    if fit.axes_deg > AXES_WARNING_DEG + _SURE * fit.axes_sigma_deg:
        out.warn(
            "truth rotation",
            f"the orientation of {name} is off: its turns have axes {fit.axes_deg:.2f} deg from those of "
            f"the gyroscope (standard deviation {fit.axes_sigma_deg:.2f}, limit {AXES_WARNING_DEG:g}). Do "
            "not evaluate rotations against it, nor take accelerometer biases from it",
        )
    if abs(fit.offset_s) > max(OFFSET_WARNING_S, 3.0 * fit.offset_sigma_s):
        out.warn(
            "truth clock",
            f"the clock of {name} is off by {1e3 * fit.offset_s:.1f} ms (gyroscope minus truth)",
        )
    return True


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


def _check_force(
    name: str, truth: GroundTruth, samples: ImuSamples, v_W: Array, gyro_bias: Array, out: Findings
) -> None:
    """A second of inertial propagation from the truth's states against where it ends."""
    errors = _propagation_errors(truth, samples, v_W, gyro_bias)
    if errors is None:
        out.skip(f"force of {name}", f"no {_PROPAGATION_S:g} s of both")
        return
    left_over, in_body = errors
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
            f"(limit {FORCE_WARNING_MPS2:g}): orientation or accelerometer biases are off"
            + _bias_of_force(truth, in_body),
        )
    elif truth.accel_bias is not None and _bias_of_force(truth, in_body):
        out.warn(
            "truth biases", f"the accelerometer biases of {name} are off{_bias_of_force(truth, in_body)}"
        )


def _bias_of_force(truth: GroundTruth, in_body: Array) -> str:
    """The accelerometer biases that the left-over forces (P, 3), body axes, ask for, in words.

    Empty where they are small, where they are not the same all the time, or where the truth has none.
    """
    bias = -np.median(in_body, axis=0)
    spread = float(np.median(np.linalg.norm(in_body + bias, axis=1)))
    if truth.accel_bias is None or np.linalg.norm(bias) < max(BIAS_WARNING_MPS2, 2.0 * spread):
        return ""
    given, fitted = (
        "({:.3f}, {:.3f}, {:.3f})".format(*b)
        for b in (truth.accel_bias.mean(axis=0), truth.accel_bias.mean(axis=0) + bias)
    )
    return f": they are {given} m/s^2 in the mean, the motion says {fitted}"


def _propagation_errors(
    truth: GroundTruth, samples: ImuSamples, v_W: Array, gyro_bias: Array
) -> tuple[Array, Array] | None:
    """(P, 3) m/s^2 in the truth's world and in body axes: mean acceleration that propagation leaves over."""
    length = round(_PROPAGATION_S * 1e9)
    usable = (truth.t_ns >= samples.t_ns[0]) & (truth.t_ns + length + length // 10 <= samples.t_ns[-1])
    usable &= truth.t_ns + length <= truth.t_ns[-1]
    rows = np.flatnonzero(usable & np.all(np.isfinite(v_W), axis=1))
    if not len(rows):
        return None
    rows = rows[np.unique(np.linspace(0, len(rows) - 1, _MOST_PROPAGATIONS).round().astype(int))]
    ends, distance = nearest_index(truth.t_ns, truth.t_ns[rows] + length)
    out, rows_used = [], []
    for row, end, off in zip(rows, ends, distance, strict=True):
        if off > length // 10:
            continue  # a hole in the truth
        bias = truth.gyro_bias[row] if truth.gyro_bias is not None else gyro_bias
        force = truth.accel_bias[row] if truth.accel_bias is not None else np.zeros(3)
        start_ns, end_ns = int(truth.t_ns[row]), int(truth.t_ns[end])
        # Gaps are a finding of their own.
        moved = preintegrate(samples.corrected(bias, force), start_ns, end_ns, _DENSITIES, largest_gap_s=1e9)
        gravity = np.array([0.0, 0.0, -9.81])
        expected = (
            truth.p_W[row] + moved.dt * v_W[row] + 0.5 * moved.dt**2 * gravity + truth.R_WB[row] @ moved.dp
        )
        out.append(2.0 * (truth.p_W[end] - expected) / moved.dt**2)
        rows_used.append(row)
    if not out:
        return None
    return np.array(out), np.einsum("pji,pj->pi", truth.R_WB[rows_used], np.array(out))
