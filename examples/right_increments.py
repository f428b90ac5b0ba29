"""The covariance of an estimator that turns rotations on the right, R <- R Exp(dphi): change U and V.

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
to_right = np.eye(at.n_parameters)
for k, R in enumerate(at.R_WB):
    block = slice(3 * (n + k), 3 * (n + k + 1))
    to_right[block, block] = R.T  # right increment = R^T (left increment)
U, V = to_right @ vg.orbit_tangent(at), to_right @ vg.FixedGauge().normal(at)
right = vg.covariance_from_hessian(J.T @ J, U, V)
left, own = to_right.T @ right @ to_right, vg.motion_covariance(problem, at, vg.FixedGauge())
print(f"relative difference from the library's own: {vg.relative_frobenius(left[: 9 * n, : 9 * n], own):.0e}")
