"""The covariance of an estimator that turns rotations on the right, R <- R Exp(dphi): say so.

Its Jacobian is its own, by complex steps; the gauge is that of the first pose.
"""

import numpy as np

import vigauge as vg

problem = vg.example_problem()
at = vg.solve(problem, vg.FreeGauge()).state
at = vg.State.start(at.p_W, at.R_WB, at.v_W, at.X_W)  # the linearisation point of both sides
f, camera, n = problem.inertial, problem.cameras[0], at.n_keyframes


def residual(x):
    """Whitened residuals after the increment x (positions, turns, velocities, landmarks), to first order."""
    dp, dphi, dv, dX = np.split(x.reshape(-1, 3), [n, 2 * n, 3 * n])
    p, R, v, X = at.p_W + dp, at.R_WB + np.cross(at.R_WB, dphi[:, None]), at.v_W + dv, at.X_W + dX
    R_T, keyframe = R.swapaxes(1, 2), problem.obs_keyframe
    X_C = np.einsum("mij,mj->mi", R_T[keyframe], X[problem.obs_landmark] - p[keyframe])
    pixels = [camera.fx, camera.fy] * X_C[:, :2] / X_C[:, 2:] / problem.sigma_px
    i, j, t, g = f.first, f.second, f.dt[:, None], np.array([0, 0, problem.gravity])
    moves = p[j] - p[i] - v[i] * t + g * t**2 / 2, v[j] - v[i] + g * t
    E = f.dR.swapaxes(1, 2) @ R_T[i] @ R[j]  # near the identity, so Log E is short
    w = (E - E.swapaxes(1, 2))[:, [2, 0, 1], [1, 2, 0]] / 2
    inertial = [R_T[i] @ moves[0][..., None], (w * (1 + (w * w).sum(1, keepdims=True) / 6))[..., None]]
    return np.append(pixels, f.whitener @ np.concatenate([*inertial, R_T[i] @ moves[1][..., None]], axis=1))


J = np.array([residual(1e-30j * step).imag / 1e-30 for step in np.eye(at.n_parameters)]).T
layout = vg.Layout.by_kind(n, ["position", "rotation", "velocity"], points=at.n_landmarks, side="right")
right = vg.Covariance.from_jacobian(J, layout, (at.R_WB, at.p_W), at.v_W, at.X_W)
poses = right.keyframes(vg.FixedGauge(), None, ["position", "rotation"])
left = vg.as_convention(poses, at.R_WB, source="right", to="left")
own = vg.keyframe_covariances(problem, at, vg.FixedGauge())[:, :6, :6]
print(f"relative difference from the library's own: {np.linalg.norm(left - own) / np.linalg.norm(own):.0e}")
