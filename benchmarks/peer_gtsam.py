"""A problem in GTSAM, with its own C++ factors only.

Projection factors are GenericProjectionFactor. The inertial factor is GTSAM's ImuFactor, whose
preintegrated measurement is set to the increments of ours exactly, and its noise to ours. Its error
vector is in the frame of the second keyframe, ours in that of the first: with the noise turned
likewise, the two costs differ by products of two errors only (every solve's end is checked).
ImuFactor wants a bias; each factor gets one of its own, held at zero by a stiff prior, so that it is
a leaf of the elimination and no variable that couples all keyframes.
"""

from __future__ import annotations

import gtsam
import numpy as np
from gtsam.symbol_shorthand import B, L, V, X

from vigauge.geometry import so3
from vigauge.geometry.so3 import Array
from vigauge.model.problem import Problem
from vigauge.model.state import State

_BIAS_SIGMA = 1e-7


def _measurement(problem: Problem, row: int) -> gtsam.PreintegratedImuMeasurements:
    """GTSAM's preintegration of two steps that add up to the given increments.

    With steps of h = dt / 2, turn rate w and forces a_1, a_2 (the second one carried into the
    first frame as b): dv = h (a_1 + b), dp = 1.5 h^2 a_1 + 0.5 h^2 b.
    """
    f = problem.inertial
    dt, dp, dv = float(f.dt[row]), f.dp[row], f.dv[row]
    h = 0.5 * dt
    rate = so3.log(f.dR[row]) / dt
    total = dv / h
    a_1 = dp / h**2 - 0.5 * total
    b = total - a_1
    parameters = gtsam.PreintegrationParams.MakeSharedU(problem.gravity)
    for set_covariance in (
        parameters.setAccelerometerCovariance,
        parameters.setGyroscopeCovariance,
        parameters.setIntegrationCovariance,
    ):
        set_covariance(1e-6 * np.eye(3))
    measured = gtsam.PreintegratedImuMeasurements(parameters, gtsam.imuBias.ConstantBias())
    measured.integrateMeasurement(a_1, rate, h)
    measured.integrateMeasurement(so3.exp(rate * h).T @ b, rate, h)
    return measured


def _inertial_factor(problem: Problem, row: int) -> gtsam.NoiseModelFactor:
    f = problem.inertial
    i, j = int(f.first[row]), int(f.second[row])
    # GTSAM's order is (rotation, position, velocity).
    order = np.r_[3:6, 0:3, 6:9]
    turn = np.zeros((9, 9))
    turn[0:3, 0:3] = np.eye(3)
    turn[3:6, 3:6] = turn[6:9, 6:9] = f.dR[row].T
    covariance = turn @ f.covariance[row][np.ix_(order, order)] @ turn.T
    factor = gtsam.ImuFactor(X(i), V(i), X(j), V(j), B(row), _measurement(problem, row))
    return factor.cloneWithNewNoiseModel(gtsam.noiseModel.Gaussian.Covariance(covariance))


def first_pose_factor(reference: State, noise: gtsam.noiseModel.Base) -> gtsam.CustomFactor:
    """First position and z of dphi_0: Eq. (11), or with a constrained noise model Eq. (10).

    The one factor in Python: GTSAM has none on a position and a single angle.
    """
    R_ref = gtsam.Rot3(reference.R_WB0_ref)

    def error(this, values, jacobians):  # type: ignore[no-untyped-def]
        T = values.atPose3(this.keys()[0])
        R = T.rotation()
        dphi_0 = gtsam.Rot3.Logmap(R.compose(R_ref.inverse()))
        if jacobians is not None:
            # A left increment is R times the right one; J_l^-1(phi) = J_r^-1(-phi).
            by_rotation = gtsam.Rot3.LogmapDerivative(-dphi_0) @ R.matrix()
            jacobians[0] = np.asfortranarray(
                np.block([[np.zeros((3, 3)), R.matrix()], [by_rotation[2:], np.zeros((1, 3))]])
            )
        return np.append(T.translation() - reference.p_W[0], dphi_0[2])

    return gtsam.CustomFactor(noise, [X(0)], error)


def observations_of(problem: Problem) -> gtsam.NonlinearFactorGraph:
    """The images' measurements."""
    graph = gtsam.NonlinearFactorGraph()
    pixel = gtsam.noiseModel.Isotropic.Sigma(2, problem.sigma_px)
    rigs = [
        (gtsam.Cal3_S2(c.fx, c.fy, 0.0, c.cx, c.cy), gtsam.Pose3(gtsam.Rot3(c.R_BC), c.p_BC))
        for c in problem.cameras
    ]
    for i, c, j, uv in zip(
        problem.obs_keyframe.tolist(),
        problem.obs_camera.tolist(),
        problem.obs_landmark.tolist(),
        problem.obs_uv,
        strict=True,
    ):
        graph.add(gtsam.GenericProjectionFactorCal3_S2(uv, pixel, X(i), L(j), *rigs[c]))
    return graph


def graph_of(problem: Problem, prior_weight: float | None) -> gtsam.NonlinearFactorGraph:
    """All measurements; the gauge prior where a weight is given."""
    graph = observations_of(problem)
    still = gtsam.noiseModel.Isotropic.Sigma(6, _BIAS_SIGMA)
    for row in range(len(problem.inertial.dt)):
        graph.add(_inertial_factor(problem, row))
        graph.add(gtsam.PriorFactorConstantBias(B(row), gtsam.imuBias.ConstantBias(), still))
    if prior_weight is not None:
        noise = gtsam.noiseModel.Isotropic.Precision(4, prior_weight)
        graph.add(first_pose_factor(problem.initial, noise))
    return graph


def values_of(state: State) -> gtsam.Values:
    """A state as GTSAM's values."""
    values = gtsam.Values()
    for i in range(state.n_keyframes):
        values.insert(X(i), gtsam.Pose3(gtsam.Rot3(state.R_WB[i]), state.p_W[i]))
        values.insert(V(i), state.v_W[i])
    for j in range(state.n_landmarks):
        values.insert(L(j), state.X_W[j])
    return values


def values_with_biases(problem: Problem, state: State) -> gtsam.Values:
    """The same, and the bias of each inertial factor at zero."""
    values = values_of(state)
    for row in range(len(problem.inertial.dt)):
        values.insert(B(row), gtsam.imuBias.ConstantBias())
    return values


def state_of(values: gtsam.Values, like: State) -> State:
    """GTSAM's values as a state with the reference rotation of ``like``."""
    poses = [values.atPose3(X(i)) for i in range(like.n_keyframes)]
    R_WB = np.array([pose.rotation().matrix() for pose in poses])
    return State(
        p_W=np.array([pose.translation() for pose in poses]),
        R_WB=R_WB,
        v_W=np.array([values.atVector(V(i)) for i in range(like.n_keyframes)]),
        X_W=np.array([values.atPoint3(L(j)) for j in range(like.n_landmarks)]),
        dphi_0=so3.log(R_WB[0] @ like.R_WB0_ref.T),
        R_WB0_ref=like.R_WB0_ref,
    )


def motion_keys(n_keyframes: int) -> list[int]:
    """Poses, then velocities."""
    return [X(i) for i in range(n_keyframes)] + [V(i) for i in range(n_keyframes)]


def keyframe_keys(n_keyframes: int) -> list[list[int]]:
    """Pose and velocity of each keyframe."""
    return [[X(i), V(i)] for i in range(n_keyframes)]


def _left(state: State, keyframe: int) -> Array:
    """(3, 3) from increments on the right, in the body, to the parameters of a rotation."""
    R = state.R_WB[keyframe]
    return R if keyframe else so3.left_jacobian_inverse(state.dphi_0) @ R


def keyframes_to_our_parameters(state: State) -> Array:
    """(N, 9, 9) derivatives of our parameters by GTSAM's increments in the order of :func:`keyframe_keys`."""
    T = np.zeros((state.n_keyframes, 9, 9))
    for i, R in enumerate(state.R_WB):
        T[i, 0:3, 3:6], T[i, 3:6, 0:3], T[i, 6:9, 6:9] = R, _left(state, i), np.eye(3)
    return T


def blocks_in_our_parameters(joints: list[gtsam.JointMarginal], state: State) -> Array:
    """(N, 9, 9) of (position, rotation, velocity), from the joint marginals of :func:`keyframe_keys`."""
    T = keyframes_to_our_parameters(state)
    return T @ np.array([joint.fullMatrix() for joint in joints]) @ T.swapaxes(1, 2)


def in_our_parameters(joint: gtsam.JointMarginal, state: State) -> Array:
    """(9N, 9N) covariance of left increments in W, in our order, from the joint marginal of
    :func:`motion_keys`."""
    T = to_our_parameters(state)
    return T @ joint.fullMatrix() @ T.T


def to_our_parameters(state: State) -> Array:
    """(9N, 9N) derivative of our parameters by GTSAM's increments in the order of :func:`motion_keys`."""
    n = state.n_keyframes
    T = np.zeros((9 * n, 9 * n))
    for i, R in enumerate(state.R_WB):
        left = _left(state, i)
        T[3 * i : 3 * i + 3, 6 * i + 3 : 6 * i + 6] = R  # GTSAM: rotation, then translation, in the body
        T[3 * (n + i) : 3 * (n + i) + 3, 6 * i : 6 * i + 3] = left
        T[3 * (2 * n + i) : 3 * (2 * n + i) + 3, 3 * (2 * n + i) : 3 * (2 * n + i) + 3] = np.eye(3)
    return T
