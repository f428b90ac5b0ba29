"""Eq. (1) once more, in plain NumPy: the judge of every solver's estimate, and SciPy's Jacobian.

It shares no code with the kernels that are measured. Every rotation is parametrised by its total
left increment from the start, R = Exp(phi) R_start, as the first one is in Eq. (9).
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from vigauge.geometry import so3
from vigauge.geometry.so3 import Array
from vigauge.model.problem import Problem
from vigauge.model.state import State


class Model:
    """Residuals, and their Jacobian by total increments x (9N + 3K,) from the start, in the order of
    :mod:`vigauge.model.state`."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.n = problem.initial.n_keyframes
        self.whitener = np.linalg.inv(np.linalg.cholesky(problem.inertial.covariance))
        self.gravity_W = np.array([0.0, 0.0, -problem.gravity])

    def state(self, x: Array) -> State:
        """The start moved by x."""
        s, n = self.problem.initial, self.n
        p, phi, v = x[: 9 * n].reshape(3, n, 3)
        return State(
            p_W=s.p_W + p,
            R_WB=so3.exp(phi) @ s.R_WB,
            v_W=s.v_W + v,
            X_W=s.X_W + x[9 * n :].reshape(-1, 3),
            dphi_0=phi[0].copy(),
            R_WB0_ref=s.R_WB0_ref,
        )

    def _images(self, state: State) -> tuple[Array, Array, Array, Array]:
        """Rays X - p in W, R_CW, points in the camera, whitened pixel errors; one row an observation."""
        q = self.problem
        R_BC = np.array([c.R_BC for c in q.cameras])[q.obs_camera]
        p_BC = np.array([c.p_BC for c in q.cameras])[q.obs_camera]
        f = np.array([[c.fx, c.fy] for c in q.cameras])[q.obs_camera]
        centre = np.array([[c.cx, c.cy] for c in q.cameras])[q.obs_camera]
        ray_W = state.X_W[q.obs_landmark] - state.p_W[q.obs_keyframe]
        R_CW = R_BC.swapaxes(1, 2) @ state.R_WB[q.obs_keyframe].swapaxes(1, 2)
        points_C = np.einsum("mij,mj->mi", R_CW, ray_W) - np.einsum("mji,mj->mi", R_BC, p_BC)
        uv = f * points_C[:, :2] / points_C[:, 2:] + centre
        return ray_W, R_CW, points_C, (uv - q.obs_uv) / q.sigma_px

    def _motion(self, state: State) -> tuple[Array, Array, Array]:
        """Position, rotation and velocity error of each factor, in the frame of its first keyframe."""
        f = self.problem.inertial
        i, j, dt = f.first, f.second, f.dt[:, None]
        R_iT = state.R_WB[i].swapaxes(1, 2)
        shift = state.p_W[j] - state.p_W[i] - state.v_W[i] * dt - 0.5 * self.gravity_W * dt**2
        change = state.v_W[j] - state.v_W[i] - self.gravity_W * dt
        turn = so3.log(f.dR.swapaxes(1, 2) @ R_iT @ state.R_WB[j])
        return np.einsum("fij,fj->fi", R_iT, shift), turn, np.einsum("fij,fj->fi", R_iT, change)

    def _inertial(self, motion: tuple[Array, Array, Array]) -> Array:
        f = self.problem.inertial
        error = np.concatenate([motion[0] - f.dp, motion[1], motion[2] - f.dv], axis=1)
        return np.einsum("fij,fj->fi", self.whitener, error)

    def residual(self, state: State) -> Array:
        """(2M + 9F,) whitened, the visual ones first."""
        visual = self._images(state)[3]
        return np.concatenate([visual.ravel(), self._inertial(self._motion(state)).ravel()])

    def cost(self, state: State) -> float:
        """1/2 ||r||^2."""
        r = self.residual(state)
        return 0.5 * float(r @ r)

    def jacobian(self, state: State, *, total: bool) -> sparse.csr_matrix:
        """Sparse Jacobian; ``total`` by the increments from the start of all rotations, otherwise as
        the package defines it: total for the first rotation only."""
        q, n = self.problem, self.n
        ray_W, R_CW, points_C, visual = self._images(state)
        chain = np.broadcast_to(np.eye(3), (n, 3, 3)).copy()
        if total:
            chain[:] = so3.left_jacobian(so3.log(state.R_WB @ q.initial.R_WB.swapaxes(1, 2)))
        else:
            chain[0] = so3.left_jacobian(state.dphi_0)
        m = len(visual)
        by_point = np.zeros((m, 2, 3))
        depth = points_C[:, 2]
        for axis, name in enumerate(("fx", "fy")):
            focal = np.array([getattr(c, name) for c in q.cameras])[q.obs_camera] / q.sigma_px
            by_point[:, axis, axis] = focal / depth
            by_point[:, axis, 2] = -focal * points_C[:, axis] / depth**2
        by_landmark = by_point @ R_CW
        by_rotation = by_landmark @ so3.hat(ray_W) @ chain[q.obs_keyframe]

        f = q.inertial
        shift, turn, change = self._motion(state)
        R_iT, R_jT = state.R_WB[f.first].swapaxes(1, 2), state.R_WB[f.second].swapaxes(1, 2)
        by_turn = so3.right_jacobian_inverse(turn) @ R_jT
        dt = f.dt[:, None, None]
        count = len(f.dt)
        first, second = np.zeros((2, count, 9, 9))
        first[:, 0:3, 0:3], second[:, 0:3, 0:3] = -R_iT, R_iT
        first[:, 0:3, 3:6], first[:, 6:9, 3:6] = so3.hat(shift) @ R_iT, so3.hat(change) @ R_iT
        first[:, 0:3, 6:9], first[:, 6:9, 6:9], second[:, 6:9, 6:9] = -R_iT * dt, -R_iT, R_iT
        first[:, 3:6, 3:6], second[:, 3:6, 3:6] = -by_turn, by_turn
        blocks = []
        for block, keyframe in ((first, f.first), (second, f.second)):
            block[:, :, 3:6] = block[:, :, 3:6] @ chain[keyframe]
            blocks.append(self.whitener @ block)

        rows = np.arange(2 * m).reshape(m, 2)
        inertial_rows = 2 * m + np.arange(9 * count).reshape(count, 9)
        parts = [
            (rows, 3 * q.obs_keyframe, -by_landmark),
            (rows, 3 * n + 3 * q.obs_keyframe, by_rotation),
            (rows, 9 * n + 3 * q.obs_landmark, by_landmark),
        ]
        for block, keyframe in zip(blocks, (f.first, f.second), strict=True):
            for part in range(3):
                columns = 3 * n * part + 3 * keyframe
                parts.append((inertial_rows, columns, block[:, :, 3 * part : 3 * part + 3]))
        values, i, j = [], [], []
        for row, column, block in parts:
            shape = block.shape
            values.append(block.ravel())
            i.append(np.broadcast_to(row[:, :, None], shape).ravel())
            j.append(np.broadcast_to((column[:, None] + np.arange(3))[:, None, :], shape).ravel())
        size = (2 * m + 9 * count, 9 * n + 3 * q.initial.n_landmarks)
        return sparse.csr_matrix((np.concatenate(values), (np.concatenate(i), np.concatenate(j))), shape=size)
