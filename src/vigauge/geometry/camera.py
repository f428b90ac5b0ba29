"""A calibrated camera on the body: pinhole projection, radial-tangential distortion, extrinsics.

The estimator works on *ideal* pixels, that is pinhole pixels with the distortion taken
out; distortion enters where images are read (``undistort_pixels``) or made (``distort``).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import integer, number, reals, require_rotations
from ..errors import VigaugeError
from .so3 import Array


@dataclass(frozen=True)
class Camera:
    """One camera.

    Attributes
    ----------
    fx, fy, cx, cy : pinhole intrinsics, pixels
    width, height : image size, pixels
    distortion : (k1, k2, p1, p2) of the radial-tangential (OpenCV, "plumb bob") model
    R_BC, p_BC : (3, 3) and (3,) m, camera to body: x_B = R_BC x_C + p_BC

    Raises DataError for a focal length or a size that is not positive, a matrix that is no rotation
    (1e-6), or numbers that are not finite.
    """

    fx: float
    fy: float
    cx: float
    cy: float
    width: int
    height: int
    distortion: tuple[float, float, float, float]
    R_BC: Array
    p_BC: Array

    def __post_init__(self) -> None:
        for name in ("fx", "fy"):
            number("camera", getattr(self, name), field=name, above=0.0)
        for name in ("cx", "cy"):
            number("camera", getattr(self, name), field=name)
        for name in ("width", "height"):
            number("camera", integer("camera", getattr(self, name), field=name), field=name, above=0.0)
        reals("camera", self.distortion, (4,), field="distortion")
        for name, shape in (("R_BC", (3, 3)), ("p_BC", (3,))):
            object.__setattr__(self, name, reals("camera", getattr(self, name), shape, field=name))
        require_rotations("camera", self.R_BC[None], field="R_BC")

    @property
    def K(self) -> Array:
        """(3, 3) calibration matrix, pixels."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    @property
    def T_BC(self) -> Array:
        """(4, 4) homogeneous transformation, camera to body."""
        T = np.eye(4)
        T[:3, :3] = self.R_BC
        T[:3, 3] = self.p_BC
        return T


def project(
    points_C: Array, fx: Array | float, fy: Array | float, cx: Array | float, cy: Array | float
) -> tuple[Array, Array]:
    """Pinhole projection of (M, 3) points, metres in the camera frame.

    The intrinsics are scalars or (M,). Returns pixels (M, 2) and the Jacobian
    d(pixels)/d(points_C), (M, 2, 3). Depths must not be zero.
    """
    inverse_depth = 1.0 / points_C[:, 2]
    x = points_C[:, 0] * inverse_depth
    y = points_C[:, 1] * inverse_depth
    uv = np.empty((len(points_C), 2))
    uv[:, 0] = fx * x + cx
    uv[:, 1] = fy * y + cy
    jacobian = np.zeros((len(points_C), 2, 3))
    jacobian[:, 0, 0] = fx * inverse_depth
    jacobian[:, 1, 1] = fy * inverse_depth
    jacobian[:, 0, 2] = -jacobian[:, 0, 0] * x
    jacobian[:, 1, 2] = -jacobian[:, 1, 1] * y
    return uv, jacobian


def distort(xy: Array, distortion: tuple[float, float, float, float]) -> tuple[Array, Array]:
    """Radial-tangential distortion of normalised image points (..., 2).

    Returns the distorted normalised points (..., 2) and d(distorted)/d(xy), (..., 2, 2).
    """
    k1, k2, p1, p2 = distortion
    x, y = xy[..., 0], xy[..., 1]
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + k2 * r2)
    slope = 2.0 * (k1 + 2.0 * k2 * r2)  # d radial / dx = slope * x
    out = np.empty(xy.shape)
    out[..., 0] = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x)
    out[..., 1] = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y
    jacobian = np.empty(xy.shape + (2,))
    jacobian[..., 0, 0] = radial + slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x
    jacobian[..., 1, 1] = radial + slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x
    jacobian[..., 0, 1] = slope * x * y + 2.0 * p1 * x + 2.0 * p2 * y
    jacobian[..., 1, 0] = jacobian[..., 0, 1]
    return out, jacobian


def undistort(xy_distorted: Array, distortion: tuple[float, float, float, float]) -> Array:
    """Inverse of :func:`distort` by Newton's method, to 1e-12 in normalised units.

    Raises
    ------
    VigaugeError
        where the model cannot be inverted: the point lies beyond the radius at which
        the distortion folds the image over.
    """
    target = np.asarray(xy_distorted, dtype=float)
    xy = target.copy()
    # Beyond the fold Newton's method may run away; what it makes of such points is judged below.
    with np.errstate(over="ignore", invalid="ignore"):
        for _ in range(30):
            value, jacobian = distort(xy, distortion)
            error = target - value
            if np.max(np.abs(error), initial=0.0) < 1e-12:
                break
            try:
                xy = xy + np.linalg.solve(jacobian, error[..., None])[..., 0]
            except np.linalg.LinAlgError:
                break  # a point sits exactly on the fold
        value, jacobian = distort(xy, distortion)
        # Roots on the far side of the fold exist too: on the near side, the one that a lens images,
        # the (symmetric) Jacobian is positive definite.
        determinant = jacobian[..., 0, 0] * jacobian[..., 1, 1] - jacobian[..., 0, 1] ** 2
        near_side = (jacobian[..., 0, 0] > 0.0) & (determinant > 0.0)
        good = near_side & (np.max(np.abs(target - value), axis=-1) < 1e-12)
    if not np.all(good):
        bad = target.reshape(-1, 2)[np.argmin(good.reshape(-1))]
        raise VigaugeError(f"distortion {distortion} cannot be inverted at normalised point {bad}")
    return xy


def undistort_pixels(camera: Camera, uv: Array) -> Array:
    """Ideal (pinhole) pixels of measured, distorted pixels; both (..., 2)."""
    focal = np.array([camera.fx, camera.fy])
    centre = np.array([camera.cx, camera.cy])
    return undistort((np.asarray(uv, dtype=float) - centre) / focal, camera.distortion) * focal + centre


def distort_pixels(camera: Camera, uv: Array) -> Array:
    """Pixels as the real camera sees them of ideal pinhole pixels; both (..., 2)."""
    focal = np.array([camera.fx, camera.fy])
    centre = np.array([camera.cx, camera.cy])
    return distort((np.asarray(uv, dtype=float) - centre) / focal, camera.distortion)[0] * focal + centre
