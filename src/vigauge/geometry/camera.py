"""A calibrated camera on the body: pinhole projection, the distortion of its lens, extrinsics.

The estimator works on *ideal* pixels, that is pinhole pixels with the distortion taken
out; distortion enters where images are read (``undistort_pixels``) or made (``distort``).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..arrays import integer, number, reals, require_rotations
from ..errors import DataError, VigaugeError
from .so3 import Array

RADIAL_TANGENTIAL, EQUIDISTANT = "radial-tangential", "equidistant"
# How many coefficients each lens may have.
LENSES = {RADIAL_TANGENTIAL: (4, 5), EQUIDISTANT: (4,)}
# An ideal image plane has no place for rays at 90 degrees, and little use for those beyond 70: there a pixel
# of a fisheye is 8.5 ideal pixels long.
LARGEST_ANGLE_DEG, FIELD_DEG = 85.0, 70.0
Coefficients = tuple[float, ...]


@dataclass(frozen=True)
class Camera:
    """One camera.

    Attributes
    ----------
    fx, fy, cx, cy : pinhole intrinsics, pixels
    width, height : image size, pixels
    distortion : coefficients of the lens: (k1, k2, p1, p2) or (k1, k2, p1, p2, k3) radial-tangential
        (OpenCV, "plumb bob"); (k1, k2, k3, k4) equidistant (Kannala and Brandt, OpenCV's "fisheye")
    R_BC, p_BC : (3, 3) and (3,) m, camera to body: x_B = R_BC x_C + p_BC
    lens : "radial-tangential" or "equidistant"

    Raises DataError for a focal length or a size that is not positive, a matrix that is no rotation
    (1e-6), another lens or number of coefficients, or numbers that are not finite.
    """

    fx: float
    fy: float
    cx: float
    cy: float
    width: int
    height: int
    distortion: Coefficients
    R_BC: Array
    p_BC: Array
    lens: str = RADIAL_TANGENTIAL

    def __post_init__(self) -> None:
        for name in ("fx", "fy"):
            number("camera", getattr(self, name), field=name, above=0.0)
        for name in ("cx", "cy"):
            number("camera", getattr(self, name), field=name)
        for name in ("width", "height"):
            number("camera", integer("camera", getattr(self, name), field=name), field=name, above=0.0)
        if self.lens not in LENSES:
            raise DataError("camera", f"must be one of {', '.join(LENSES)}", field="lens", value=self.lens)
        given = np.size(self.distortion)
        if given not in LENSES[self.lens]:
            counts = " or ".join(map(str, LENSES[self.lens]))
            rule = f"must be {counts} coefficients of a {self.lens} lens"
            raise DataError("camera", rule, field="distortion", value=given)
        reals("camera", self.distortion, (given,), field="distortion")
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


def distort(xy: Array, distortion: Coefficients, lens: str = RADIAL_TANGENTIAL) -> tuple[Array, Array]:
    """Distortion of normalised image points (..., 2) by a lens.

    Returns the distorted normalised points (..., 2) and d(distorted)/d(xy), (..., 2, 2), symmetric.
    """
    return (_equidistant if lens == EQUIDISTANT else _radial_tangential)(xy, distortion)


def _radial_tangential(xy: Array, distortion: Coefficients) -> tuple[Array, Array]:
    k1, k2, p1, p2, k3 = (*distortion, 0.0)[:5]
    x, y = xy[..., 0], xy[..., 1]
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + k3 * r2))
    slope = 2.0 * (k1 + r2 * (2.0 * k2 + 3.0 * k3 * r2))  # d radial / dx = slope * x
    out = np.empty(xy.shape)
    out[..., 0] = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x)
    out[..., 1] = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y
    jacobian = np.empty(xy.shape + (2,))
    jacobian[..., 0, 0] = radial + slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x
    jacobian[..., 1, 1] = radial + slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x
    jacobian[..., 0, 1] = slope * x * y + 2.0 * p1 * x + 2.0 * p2 * y
    jacobian[..., 1, 0] = jacobian[..., 0, 1]
    return out, jacobian


def _equidistant(xy: Array, distortion: Coefficients) -> tuple[Array, Array]:
    """Radius theta + k1 theta^3 + ... + k4 theta^9 for a ray at theta from the axis (Kannala and Brandt)."""
    r2 = np.sum(xy * xy, axis=-1)
    r = np.sqrt(r2)
    radius, slope = _radius(np.arctan(r), distortion)
    away = r > 0.0
    ratio = np.divide(radius, r, out=np.ones_like(r), where=away)
    # d radius / dr = slope / (1 + r^2): ratio across the radius, this along it.
    along = np.divide(slope / (1.0 + r2) - ratio, r2, out=np.zeros_like(r), where=away)
    jacobian = along[..., None, None] * xy[..., :, None] * xy[..., None, :]
    return ratio[..., None] * xy, jacobian + ratio[..., None, None] * np.eye(2)


def _radius(theta: Array, distortion: Coefficients) -> tuple[Array, Array]:
    """Distorted radius of rays at ``theta``, rad, and its derivative."""
    k1, k2, k3, k4 = distortion
    q = theta * theta
    radius = theta * (1.0 + q * (k1 + q * (k2 + q * (k3 + q * k4))))
    return radius, 1.0 + q * (3.0 * k1 + q * (5.0 * k2 + q * (7.0 * k3 + q * 9.0 * k4)))


def undistort(xy_distorted: Array, distortion: Coefficients, lens: str = RADIAL_TANGENTIAL) -> Array:
    """Inverse of :func:`distort` by Newton's method, to 1e-12 in normalised units or better.

    Raises
    ------
    VigaugeError
        where the model cannot be inverted: the point lies beyond the radius at which
        the distortion folds the image over, or at LARGEST_ANGLE_DEG from the axis.
    """
    target = np.asarray(xy_distorted, dtype=float)
    xy, good = undistort_where(target, distortion, lens)
    if not np.all(good):
        bad = target.reshape(-1, 2)[np.argmin(good.reshape(-1))]
        raise VigaugeError(f"distortion {distortion} cannot be inverted at normalised point {bad}")
    return xy


def undistort_where(
    xy_distorted: Array, distortion: Coefficients, lens: str = RADIAL_TANGENTIAL
) -> tuple[Array, NDArray[np.bool_]]:
    """:func:`undistort` where it can be, and where that is (...); elsewhere the points mean nothing."""
    invert = _invert_equidistant if lens == EQUIDISTANT else _invert_radial_tangential
    return invert(np.asarray(xy_distorted, dtype=float), distortion)


def _invert_radial_tangential(target: Array, distortion: Coefficients) -> tuple[Array, NDArray[np.bool_]]:
    xy = target.copy()
    # Beyond the fold Newton's method may run away; what it makes of such points is judged below.
    with np.errstate(over="ignore", invalid="ignore"):
        for _ in range(30):
            value, jacobian = _radial_tangential(xy, distortion)
            error = target - value
            if np.max(np.abs(error), initial=0.0) < 1e-12:
                break
            try:
                xy = xy + np.linalg.solve(jacobian, error[..., None])[..., 0]
            except np.linalg.LinAlgError:
                break  # a point sits exactly on the fold
        value, jacobian = _radial_tangential(xy, distortion)
        # Roots on the far side of the fold exist too: on the near side, the one that a lens images,
        # the (symmetric) Jacobian is positive definite.
        determinant = jacobian[..., 0, 0] * jacobian[..., 1, 1] - jacobian[..., 0, 1] ** 2
        near_side = (jacobian[..., 0, 0] > 0.0) & (determinant > 0.0)
        return xy, near_side & (np.max(np.abs(target - value), axis=-1) < 1e-12)


def _invert_equidistant(target: Array, distortion: Coefficients) -> tuple[Array, NDArray[np.bool_]]:
    """The angle by Newton's method between bounds that close in, then its tangent."""
    wanted = np.sqrt(np.sum(target * target, axis=-1))
    last = _last_angle(distortion)
    good = wanted <= _radius(np.array(last), distortion)[0]
    low, high = np.zeros_like(wanted), np.full_like(wanted, last)
    theta = np.minimum(wanted, last)
    for _ in range(60):
        radius, slope = _radius(theta, distortion)
        error = radius - wanted
        low, high = np.where(error <= 0.0, theta, low), np.where(error >= 0.0, theta, high)
        with np.errstate(divide="ignore", invalid="ignore"):
            newton = theta - error / slope
        inside = (newton >= low) & (newton <= high)
        step = np.where(inside, newton, 0.5 * (low + high)) - theta
        theta = theta + step
        if np.all(~good | (np.abs(step) <= 1e-16 + 2e-16 * theta)):
            break
    ratio = np.divide(np.tan(theta), wanted, out=np.ones_like(wanted), where=wanted > 0.0)
    return ratio[..., None] * target, good


def _last_angle(distortion: Coefficients) -> float:
    """Angle, rad, up to which the radius grows with it; LARGEST_ANGLE_DEG at most."""
    k1, k2, k3, k4 = distortion
    # In 1 / theta^2 the polynomial whose zeros are the folds is monic, however small the coefficients are.
    roots = np.roots([1.0, 3.0 * k1, 5.0 * k2, 7.0 * k3, 9.0 * k4])
    first = roots.real[np.abs(roots.imag) < 1e-12].max(initial=0.0)
    limit = float(np.radians(LARGEST_ANGLE_DEG))
    return limit if first <= limit**-2 else float(first**-0.5)


def undistort_pixels(camera: Camera, uv: Array) -> Array:
    """Ideal (pinhole) pixels of measured, distorted pixels; both (..., 2). Raises as :func:`undistort`."""
    focal, centre = _focal_and_centre(camera)
    xy = (np.asarray(uv, dtype=float) - centre) / focal
    return undistort(xy, camera.distortion, camera.lens) * focal + centre


def distort_pixels(camera: Camera, uv: Array) -> Array:
    """Pixels as the real camera sees them of ideal pinhole pixels; both (..., 2)."""
    focal, centre = _focal_and_centre(camera)
    xy = (np.asarray(uv, dtype=float) - centre) / focal
    return distort(xy, camera.distortion, camera.lens)[0] * focal + centre


def in_field(camera: Camera, uv: Array) -> NDArray[np.bool_]:
    """(...) whether measured pixels (..., 2) of a fisheye lie within FIELD_DEG and can be undistorted.

    True everywhere for a radial-tangential lens: it must serve its whole image, or its calibration is wrong.
    """
    if camera.lens != EQUIDISTANT:
        return np.ones(np.shape(uv)[:-1], dtype=bool)
    return np.asarray(_share_of_field(camera, uv) <= 1.0)


def edge_of_field(camera: Camera, uv: Array) -> Array:
    """Measured pixels (..., 2); those outside of the field of a fisheye are moved inwards to its edge."""
    if camera.lens != EQUIDISTANT:
        return uv
    centre = _focal_and_centre(camera)[1]
    # A rounding inside, so that they can be undistorted.
    return centre + (uv - centre) * np.minimum(1.0, (1.0 - 1e-12) / _share_of_field(camera, uv))[..., None]


def _share_of_field(camera: Camera, uv: Array) -> Array:
    """(...) radius of measured pixels (..., 2), as a share of that at FIELD_DEG or at the fold."""
    focal, centre = _focal_and_centre(camera)
    last = min(_last_angle(camera.distortion), float(np.radians(FIELD_DEG)))
    radius = np.linalg.norm((np.asarray(uv, dtype=float) - centre) / focal, axis=-1)
    return radius / float(_radius(np.array(last), camera.distortion)[0])


def ideal_size(camera: Camera, uv: Array) -> Array:
    """(...) how many ideal pixels one measured pixel is long, at ideal pixels ``uv`` (..., 2).

    The root mean square over its directions: the noise of a measured pixel times this is that of an ideal
    one. A fisheye's grows with the angle from the axis, to 6 at FIELD_DEG; a radial-tangential lens is near
    1 all over its image, and 1 is returned.
    """
    if camera.lens != EQUIDISTANT:
        return np.ones(np.shape(uv)[:-1])
    focal, centre = _focal_and_centre(camera)
    _, jacobian = distort((np.asarray(uv, dtype=float) - centre) / focal, camera.distortion, camera.lens)
    inverse = np.linalg.inv(jacobian)
    return np.sqrt(0.5 * np.sum(inverse * inverse, axis=(-2, -1)))


def _focal_and_centre(camera: Camera) -> tuple[Array, Array]:
    return np.array([camera.fx, camera.fy]), np.array([camera.cx, camera.cy])
