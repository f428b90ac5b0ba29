"""A problem with biases in GTSAM: its CombinedImuFactor, on increments that GTSAM preintegrated itself.

Our factors are made of GTSAM's increments, covariances and bias derivatives, so that both minimise the same
cost, but for what :mod:`benchmarks.peer_gtsam` says of the frame of the error, and for second orders of the
biases' change: GTSAM corrects the rotation vector, we turn the rotation.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import gtsam
import numpy as np
from gtsam.symbol_shorthand import B, V, X
from numpy.typing import NDArray

from benchmarks import peer_gtsam
from vigauge.geometry import so3
from vigauge.geometry.so3 import Array
from vigauge.model.imu import ImuNoise, ImuSamples
from vigauge.model.problem import InertialFactors, Problem
from vigauge.model.state import State

from .problems_with_biases import read_samples

# From GTSAM's order (rotation, position, velocity, accelerometer bias, gyroscope bias) to ours, and back.
_ORDER = np.r_[3:6, 0:3, 6:9, 12:15, 9:12]
_STEP = 1e-3

Pim = gtsam.PreintegratedCombinedMeasurements


def preintegrated(
    samples: ImuSamples,
    keyframe_ns: NDArray[np.int64],
    noise: ImuNoise,
    gyro: Array,
    accel: Array,
    gravity: float,
) -> list[Pim]:
    """GTSAM's preintegration between keyframes at samples, at the given biases."""
    parameters = gtsam.PreintegrationCombinedParams.MakeSharedU(gravity)
    # The error chart that is nearest to ours, part by part.
    parameters.setImuFactorErrorMode(gtsam.ImuFactorErrorMode.ComponentWise)
    parameters.setAccelerometerCovariance(noise.accel_density**2 * np.eye(3))
    parameters.setGyroscopeCovariance(noise.gyro_density**2 * np.eye(3))
    parameters.setIntegrationCovariance(1e-14 * np.eye(3))
    parameters.setBiasAccCovariance(noise.accel_walk**2 * np.eye(3))
    parameters.setBiasOmegaCovariance(noise.gyro_walk**2 * np.eye(3))
    out = []
    step = np.diff(samples.t_ns) * 1e-9
    for first, end in zip(keyframe_ns[:-1], keyframe_ns[1:], strict=True):
        pim = Pim(parameters, gtsam.imuBias.ConstantBias(accel, gyro))
        for k in range(*np.searchsorted(samples.t_ns, [first, end])):
            pim.integrateMeasurement(samples.accel[k], samples.gyro[k], float(step[k]))
        out.append(pim)
    return out


def _corrected(pim: Pim, bias: Array) -> tuple[Array, Array, Array]:
    """dp, dR, dv that GTSAM has at a bias (accelerometer, gyroscope), by a prediction from the origin."""
    there = pim.predict(gtsam.NavState(), gtsam.imuBias.ConstantBias(bias[:3], bias[3:]))
    still = pim.predict(gtsam.NavState(), pim.biasHat())
    fall, gain = still.position() - pim.deltaPij(), still.velocity() - pim.deltaVij()
    return there.position() - fall, there.attitude().matrix(), there.velocity() - gain


def _by_bias(pim: Pim) -> Array:
    """(9, 6) derivative of (dp, rotation right of dR, dv) by (accelerometer, gyroscope) bias."""
    at, dR, columns = pim.biasHatVector(), pim.deltaRij().matrix(), []
    for unit in _STEP * np.eye(6):
        ends = []
        for far in (-2.0, -1.0, 1.0, 2.0):
            p, R, v = _corrected(pim, at + far * unit)
            ends.append(np.concatenate([p, so3.log(dR.T @ R), v]))
        columns.append((ends[0] - 8.0 * ends[1] + 8.0 * ends[2] - ends[3]) / (12.0 * _STEP))
    return np.stack(columns, axis=1)


def factors_of(pims: list[Pim]) -> InertialFactors:
    """Our factors between consecutive keyframes, of GTSAM's increments.

    GTSAM's errors are in the frame of the second keyframe, ours in that of the first.
    """
    index, dR = np.arange(len(pims)), np.array([pim.deltaRij().matrix() for pim in pims])
    turn = np.tile(np.eye(15), (len(pims), 1, 1))
    turn[:, 0:3, 0:3] = turn[:, 6:9, 6:9] = dR
    covariance = np.array([pim.residualCovariance()[np.ix_(_ORDER, _ORDER)] for pim in pims])
    by_bias = np.array([_by_bias(pim) for pim in pims])
    bias = np.array([pim.biasHatVector() for pim in pims])
    return InertialFactors(
        first=index,
        second=index + 1,
        dt=np.array([pim.deltaTij() for pim in pims]),
        dp=np.array([pim.deltaPij() for pim in pims]),
        dR=dR,
        dv=np.array([pim.deltaVij() for pim in pims]),
        covariance=turn @ covariance @ turn.swapaxes(1, 2),
        by_gyro_bias=by_bias[:, :, 3:],
        by_accel_bias=by_bias[:, :, :3],
        gyro_bias=bias[:, 3:],
        accel_bias=bias[:, :3],
    )


def graph_of(problem: Problem, pims: list[Pim], prior_weight: float | None) -> gtsam.NonlinearFactorGraph:
    """Images and combined factors; the gauge prior where a weight is given."""
    graph = peer_gtsam.observations_of(problem)
    for i, pim in enumerate(pims):
        graph.add(gtsam.CombinedImuFactor(X(i), V(i), X(i + 1), V(i + 1), B(i), B(i + 1), pim))
    if prior_weight is not None:
        noise = gtsam.noiseModel.Isotropic.Precision(4, prior_weight)
        graph.add(peer_gtsam.first_pose_factor(problem.initial, noise))
    return graph


def values_of(state: State) -> gtsam.Values:
    """A state with biases as GTSAM's values."""
    values = peer_gtsam.values_of(state)
    assert state.gyro_bias is not None and state.accel_bias is not None
    for i, (gyro, accel) in enumerate(zip(state.gyro_bias, state.accel_bias, strict=True)):
        values.insert(B(i), gtsam.imuBias.ConstantBias(accel, gyro))
    return values


def state_of(values: gtsam.Values, like: State) -> State:
    """GTSAM's values as a state with biases."""
    biases = [values.atConstantBias(B(i)) for i in range(like.n_keyframes)]
    return replace(
        peer_gtsam.state_of(values, like),
        gyro_bias=np.array([bias.gyroscope() for bias in biases]),
        accel_bias=np.array([bias.accelerometer() for bias in biases]),
    )


def keyframe_keys(n_keyframes: int) -> list[list[int]]:
    """Pose, velocity and bias of each keyframe."""
    return [[X(i), V(i), B(i)] for i in range(n_keyframes)]


def motion_keys(n_keyframes: int) -> list[int]:
    """Poses, velocities, biases."""
    return [*peer_gtsam.motion_keys(n_keyframes), *(B(i) for i in range(n_keyframes))]


def in_our_parameters(joint: Array, state: State) -> Array:
    """(15N, 15N) covariance of left increments in W, in our order, from that of :func:`motion_keys`."""
    n = state.n_keyframes
    T = np.zeros((15 * n, 15 * n))
    T[: 9 * n, : 9 * n] = peer_gtsam.to_our_parameters(state)
    for i in range(n):
        gyro, accel, theirs = 9 * n + 3 * i, 12 * n + 3 * i, 9 * n + 6 * i
        T[gyro : gyro + 3, theirs + 3 : theirs + 6] = T[accel : accel + 3, theirs : theirs + 3] = np.eye(3)
    return T @ joint @ T.T


def blocks_in_our_parameters(joints: list[Array], state: State) -> Array:
    """(N, 15, 15) of (position, rotation, velocity, biases), from the joint marginals of
    :func:`keyframe_keys`."""
    T = np.zeros((len(joints), 15, 15))
    T[:, :9, :9] = peer_gtsam.keyframes_to_our_parameters(state)
    T[:, 9:12, 12:15] = T[:, 12:15, 9:12] = np.eye(3)
    return T @ np.array(joints) @ T.swapaxes(1, 2)


class Peer:
    """What the worker asks of :mod:`benchmarks.peer_gtsam`, for a problem with its samples beside."""

    state_of = staticmethod(state_of)
    keyframe_keys, motion_keys = staticmethod(keyframe_keys), staticmethod(motion_keys)

    def __init__(self, gravity: float, problem_file: Path) -> None:
        self.pims = preintegrated(*read_samples(problem_file), gravity)

    def graph_of(self, problem: Problem, prior_weight: float | None) -> gtsam.NonlinearFactorGraph:
        return graph_of(problem, self.pims, prior_weight)

    def values_with_biases(self, problem: Problem, state: State) -> gtsam.Values:
        return values_of(state)

    def blocks_in_our_parameters(self, joints: list[gtsam.JointMarginal], state: State) -> Array:
        return blocks_in_our_parameters([joint.fullMatrix() for joint in joints], state)

    def in_our_parameters(self, joint: gtsam.JointMarginal, state: State) -> Array:
        return in_our_parameters(joint.fullMatrix(), state)
