"""A trajectory as a B-spline, with the exact kinematics that an IMU on it senses.

The paper fits its trajectories with B-splines and samples accelerations and angular
velocities from them (Section IV-A). Position and rotation vector are splines in time;
every derivative is the spline's own, so the inertial data agree with the poses to
rounding error.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ..geometry import so3
from ..geometry.so3 import Array

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

# Quintic: jerk is continuous, so the sampled acceleration and angular velocity are smooth.
DEGREE = 5


@dataclass(frozen=True)
class SplineTrajectory:
    """Body trajectory ``p_W(t)``, ``R_WB(t) = R_ref Exp(phi(t))``; t in seconds from the start."""

    position: BSpline  # B-spline of the body position in W, metres
    rotation: BSpline  # B-spline of the rotation vector phi, radians; must stay below pi in length
    R_WB_ref: Array  # (3, 3) orientation at phi = 0

    @classmethod
    def through(cls, t: ArrayLike, p_W: ArrayLike, phi: ArrayLike, R_WB_ref: ArrayLike) -> SplineTrajectory:
        """Spline through the given points: t (M,) s, p_W (M, 3) m, phi (M, 3) rad."""
        # Many read a trajectory's type and make none; the import takes a sixth of a second.
        from scipy.interpolate import make_interp_spline

        t = np.asarray(t, dtype=float)
        return cls(
            position=make_interp_spline(t, np.asarray(p_W, dtype=float), k=DEGREE),
            rotation=make_interp_spline(t, np.asarray(phi, dtype=float), k=DEGREE),
            R_WB_ref=np.asarray(R_WB_ref, dtype=float),
        )

    def p_W(self, t: ArrayLike) -> Array:
        """Position, metres. Shape of t plus (3,)."""
        return self.position(np.asarray(t, dtype=float))

    def v_W(self, t: ArrayLike) -> Array:
        """Velocity, m/s."""
        return self.position(np.asarray(t, dtype=float), nu=1)

    def a_W(self, t: ArrayLike) -> Array:
        """Acceleration, m/s^2."""
        return self.position(np.asarray(t, dtype=float), nu=2)

    def R_WB(self, t: ArrayLike) -> Array:
        """Orientation, body to world."""
        return self.R_WB_ref @ so3.exp(self.rotation(np.asarray(t, dtype=float)))

    def omega_B(self, t: ArrayLike) -> Array:
        """Angular velocity in the body frame, rad/s: J_r(phi) dphi/dt."""
        t = np.asarray(t, dtype=float)
        rate = self.rotation(t, nu=1)
        return np.einsum("...ij,...j->...i", so3.right_jacobian(self.rotation(t)), rate)

    def specific_force_B(self, t: ArrayLike, gravity: float) -> Array:
        """What an ideal accelerometer reads in the body frame: R^T (a_W - g_W), g_W = (0, 0, -g)."""
        force_W = self.a_W(t) + np.array([0.0, 0.0, gravity])
        return np.einsum("...ji,...j->...i", self.R_WB(t), force_W)
