"""The columns of a ground truth that nobody looks at: velocities and biases, against what the rest tells."""

from __future__ import annotations

import numpy as np

from ...geometry.so3 import Array
from ...model.imu import ImuSamples
from ..asl.ground_truth import GroundTruth
from .findings import Findings

# Velocities against the derivative of position: good ones differ by 0.01 m/s, which is noise of position.
VELOCITY_MPS, VELOCITY_WARNING_SHARE, VELOCITY_ERROR_SHARE = 0.05, 0.1, 0.3
# The mean of a gyroscope's bias comes out of a few seconds of turns within 0.002 rad/s; 0.03 turn a second of
# motion by two degrees.
BIAS_WARNING_RADPS, BIAS_ERROR_RADPS = 0.006, 0.03
# Of an explanation, what may be left over of the difference that it explains.
_EXPLAINED = 0.3


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.sum(values**2, axis=-1))))


def check_velocity(name: str, truth: GroundTruth, derived_W: Array, out: Findings) -> bool:
    """The velocity columns against the derivative of position; whether they can be used."""
    known = np.all(np.isfinite(derived_W), axis=1)
    if truth.v_W is None or not np.any(known):
        out.skip(f"velocities of {name}", "its samples are too far apart for a derivative of position")
        return truth.v_W is not None
    # A step of the position spoils a tenth of a second of its derivative: the nine best tenths are compared.
    given, derived = truth.v_W[known], derived_W[known]
    size = np.linalg.norm(given - derived, axis=1)
    best = size <= np.quantile(size, 0.9)
    given, derived = given[best], derived[best]
    left_over, speed = _rms(given - derived), _rms(derived)
    out.fact(name, speed_mps=speed, velocity_residual_mps=left_over)
    if left_over <= max(VELOCITY_MPS, VELOCITY_WARNING_SHARE * speed):
        return True
    R_BW = truth.R_WB[known][best].swapaxes(1, 2)
    scale = float(np.sum(given * derived)) / max(float(np.sum(given**2)), 1e-12)
    readings = {
        "they look like velocities in body axes": given - np.einsum("mij,mj->mi", R_BW, derived),
        f"they look {1.0 / scale if scale else 0.0:.3g} times too large": given - derived / (scale or 1.0),
    }
    why = next(
        (f"; {w}" for w, rest in readings.items() if _rms(rest) < _EXPLAINED * max(_rms(given), 1e-9)), ""
    )
    if not np.any(given):
        why = "; they are zeros"
    bad = left_over > VELOCITY_ERROR_SHARE * speed
    (out.error if bad else out.warn)(
        "truth velocity",
        f"the velocities of {name} differ from the derivative of its positions by {left_over:.3g} m/s, root "
        f"mean square, at a speed of {speed:.3g} m/s{why}. Velocities must be in the world frame, m/s",
    )
    return not bad


def check_biases(
    name: str, truth: GroundTruth, samples: ImuSamples, fitted: Array | None, out: Findings
) -> None:
    """The gyroscope bias columns against the bias that turns, or rest, tell: ``fitted`` (3,) rad/s."""
    if fitted is None or truth.gyro_bias is None or truth.accel_bias is None:
        out.skip(f"biases of {name}", "no turns and no rest that would tell the bias of the gyroscope")
        return
    inside = (truth.t_ns >= samples.t_ns[0]) & (truth.t_ns <= samples.t_ns[-1])
    gyro, accel = (columns[inside].mean(axis=0) for columns in (truth.gyro_bias, truth.accel_bias))
    difference = float(np.linalg.norm(gyro - fitted))
    out.fact(name, gyro_bias_difference_radps=difference)
    if difference <= BIAS_WARNING_RADPS:
        return
    readings = {
        "gyroscope and accelerometer look exchanged": accel,
        "they look like those of the other sign (to be added)": -gyro,
        "they look like deg/s": np.radians(gyro),
    }
    best = min(readings, key=lambda words: float(np.linalg.norm(readings[words] - fitted)))
    explained = np.linalg.norm(readings[best] - fitted) < _EXPLAINED * difference
    why = f"; {best}" if explained else ""
    if not np.any(gyro):
        why = "; they are zeros, which says that nobody estimated them"
    text = "({:.4f}, {:.4f}, {:.4f})".format
    (out.error if difference > BIAS_ERROR_RADPS else out.warn)(
        "truth biases",
        f"the gyroscope biases of {name} are {text(*gyro)} rad/s in the mean, its motion and imu0 say "
        f"{text(*fitted)}{why}. Do not take known biases from it",
    )
