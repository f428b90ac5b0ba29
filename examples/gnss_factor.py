"""A motion factor of one's own: GNSS positions of an antenna on the body.

Two of them measure the whole gauge, one leaves the turn about it open."""

from dataclasses import dataclass, replace

import numpy as np

import vigauge as vg


@dataclass(frozen=True)
class Gnss:
    """The antenna of keyframe ``k`` was measured at ``z_W``; it sits at ``p_BA`` on the body."""

    k: int
    z_W: np.ndarray
    p_BA: np.ndarray
    sigma_m: float = 0.02

    @property
    def keyframes(self) -> tuple[int, ...]:
        return (self.k,)

    def at(self, state: vg.State, reference: vg.State) -> vg.LinearFactor:
        x, y, z = arm = state.R_WB[self.k] @ self.p_BA
        turn = np.array([[0, z, -y], [-z, 0, x], [y, -x, 0]])  # by the left increment: -hat(R p_BA)
        columns = np.r_[3 * self.k + np.arange(3), 3 * (state.n_keyframes + self.k) + np.arange(3)]
        error, jacobian = state.p_W[self.k] + arm - self.z_W, np.hstack([np.eye(3), turn])
        return vg.LinearFactor(columns, error / self.sigma_m, jacobian / self.sigma_m)


problem, p_BA = vg.example_problem(), np.array([0.1, 0.0, 0.2])
antenna = problem.initial.p_W + problem.initial.R_WB @ p_BA
for keyframes in ((), (0,), (0, 9)):
    measured = replace(problem, factors=tuple(Gnss(k, antenna[k], p_BA) for k in keyframes))
    covariance = vg.Covariance.of(measured, vg.solve(measured, vg.FreeGauge()).state)
    sigma = np.sqrt(np.diag(covariance.motion(vg.CentroidGauge()))[12:15].max())
    print(f"{len(keyframes)} positions: {covariance.U.shape[1]} open directions, sigma {sigma:.4f} m")
