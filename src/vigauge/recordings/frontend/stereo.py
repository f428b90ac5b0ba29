"""Geometry of the calibrated stereo pair: epipolar lines, rectification, and left-right search."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from ...geometry import so3
from ...geometry.camera import (
    EQUIDISTANT,
    Camera,
    distort_pixels,
    edge_of_field,
    ideal_size,
    undistort_pixels,
)
from ...geometry.so3 import Array
from .settings import StereoSettings

Image = NDArray[np.uint8]
# Rows that a rectified match may be off: calibration and rounding, in pixels.
_ROW_MARGIN_PX = 2
# Peaks of the correlation closer than this belong to one, in pixels.
_PEAK_WIDTH_PX = 4
# How far the disparity of a track may move between keyframes: this share of it plus this many pixels.
_DISPARITY_SHARE, _DISPARITY_MARGIN_PX = 0.35, 8.0


@dataclass(frozen=True)
class RectifiedView:
    """The common view V of both cameras: x along the baseline, z nearest to both optical axes.

    ``R_VC`` turns of the left and right camera into V, ``K_V`` (3, 3) its calibration matrix in
    pixels, ``width`` and ``height`` of its image.
    """

    R_VC: tuple[Array, Array]
    K_V: Array
    width: int
    height: int


@dataclass(frozen=True)
class StereoGeometry:
    """What follows from the calibration of two cameras; x_R = R_RL x_L + p_RL."""

    left: Camera
    right: Camera

    @classmethod
    def of(cls, cameras: tuple[Camera, ...]) -> StereoGeometry:
        """Of two cameras; of one, which is then both, nothing but ``left`` means anything."""
        return cls(cameras[0], cameras[-1])

    @property
    def is_pair(self) -> bool:
        """Whether there are two cameras."""
        return self.left is not self.right

    @cached_property
    def R_RL(self) -> Array:
        return self.right.R_BC.T @ self.left.R_BC

    @cached_property
    def p_RL(self) -> Array:
        return self.right.R_BC.T @ (self.left.p_BC - self.right.p_BC)

    @cached_property
    def fundamental(self) -> Array:
        """(3, 3) F with uv_R^T F uv_L = 0 for homogeneous ideal pixels."""
        essential = so3.hat(self.p_RL) @ self.R_RL
        return np.linalg.inv(self.right.K).T @ essential @ np.linalg.inv(self.left.K)

    def epipolar_distance(self, uv_left: Array, uv_right: Array) -> Array:
        """(M,) larger distance, measured px, of two ideal pixels (M, 2) from each other's epipolar line."""
        sizes = ideal_size(self.left, uv_left), ideal_size(self.right, uv_right)
        return epipolar_distance(self.fundamental, uv_left, uv_right, *sizes)

    @cached_property
    def rectified(self) -> RectifiedView:
        """The view in which matching points share their row; it holds both images, of a fisheye its field."""
        along = -self.R_RL.T @ self.p_RL  # centre of the right camera in the left one
        x = along / np.linalg.norm(along)
        forward = np.array([0.0, 0.0, 1.0]) + self.R_RL[2]
        z = forward - (forward @ x) * x
        z /= np.linalg.norm(z)
        R_VL = np.array([x, np.cross(z, x), z])
        R_VC = (R_VL, R_VL @ self.R_RL.T)
        focal = 0.25 * (self.left.fx + self.left.fy + self.right.fx + self.right.fy)
        K_V = np.diag([focal, focal, 1.0])
        # Undistorted, an image is larger than it was, and its corners must not be cut off.
        rims = [
            _through(K_V @ R @ np.linalg.inv(camera.K), undistort_pixels(camera, _rim(camera)))
            for camera, R in zip((self.left, self.right), R_VC, strict=True)
        ]
        low = np.floor(np.min(np.concatenate(rims), axis=0))
        high = np.ceil(np.max(np.concatenate(rims), axis=0))
        K_V[:2, 2] = -low
        width, height = (high - low).astype(int) + 1
        return RectifiedView(R_VC, K_V, int(width), int(height))

    def _homography(self, camera: int) -> Array:
        """(3, 3) from ideal pixels of a camera to rectified pixels."""
        view = self.rectified
        return view.K_V @ view.R_VC[camera] @ np.linalg.inv((self.left, self.right)[camera].K)

    @cached_property
    def _maps(self) -> tuple[tuple[Array, Array], ...]:
        view = self.rectified
        size = (view.width, view.height)
        maps = []
        for camera, R_VC in zip((self.left, self.right), view.R_VC, strict=True):
            lens = cv2.fisheye if camera.lens == EQUIDISTANT else cv2
            distortion = np.array(camera.distortion)
            maps.append(
                lens.initUndistortRectifyMap(camera.K, distortion, R_VC, view.K_V, size, cv2.CV_32FC1)
            )
        return tuple(maps)

    def rectified_image(self, image: Image, camera: int) -> Image:
        """The image of one camera (0 left, 1 right) seen through the rectified view."""
        return cv2.remap(image, *self._maps[camera], interpolation=cv2.INTER_LINEAR)

    def to_rectified(self, uv: Array, camera: int) -> Array:
        """Rectified pixels (M, 2) of ideal pixels (M, 2)."""
        return _through(self._homography(camera), uv)

    def from_rectified(self, uv_V: Array, camera: int) -> Array:
        """Ideal pixels (M, 2) of rectified pixels (M, 2)."""
        return _through(np.linalg.inv(self._homography(camera)), uv_V)

    def disparity(self, uv_left: Array, uv_right: Array) -> Array:
        """(M,) rectified disparity in px, positive for points in front of the cameras."""
        return self.to_rectified(uv_left, 0)[:, 0] - self.to_rectified(uv_right, 1)[:, 0]


def epipolar_distance(
    fundamental: Array,
    uv_first: Array,
    uv_second: Array,
    size_first: Array | float = 1.0,
    size_second: Array | float = 1.0,
) -> Array:
    """(M,) larger of the distances, px, of each point from the epipolar line of the other.

    ``size_first``, ``size_second`` (M,) divide them: ideal pixels to a measured one (``ideal_size``).
    """
    first = np.column_stack([uv_first, np.ones(len(uv_first))])
    second = np.column_stack([uv_second, np.ones(len(uv_second))])
    line_second = first @ fundamental.T
    line_first = second @ fundamental
    product = np.abs(np.einsum("ij,ij->i", second, line_second))
    shorter = np.minimum(
        size_second * np.hypot(line_second[:, 0], line_second[:, 1]),
        size_first * np.hypot(line_first[:, 0], line_first[:, 1]),
    )
    return product / np.maximum(shorter, 1e-300)


def _rim(camera: Camera) -> Array:
    """(M, 2) pixels along the border of the raw image, or of the field of a fisheye where that is nearer."""
    u, v = np.arange(camera.width, dtype=float), np.arange(camera.height, dtype=float)
    sides = [np.column_stack([u, np.full_like(u, end)]) for end in (0.0, camera.height - 1.0)]
    sides += [np.column_stack([np.full_like(v, end), v]) for end in (0.0, camera.width - 1.0)]
    return edge_of_field(camera, np.concatenate(sides))


def _through(homography: Array, uv: Array) -> Array:
    xyz = np.column_stack([uv, np.ones(len(uv))]) @ homography.T
    return xyz[:, :2] / xyz[:, 2:]


def search_disparity(
    rectified_left: Image, rectified_right: Image, uv_V: Array, expected: Array, settings: StereoSettings
) -> Array:
    """Disparity of points along their rectified row by normalised correlation.

    Parameters
    ----------
    uv_V : (M, 2) points in the rectified left image
    expected : (M,) disparity to search around, px; NaN where nothing is known: then the whole
        range is searched

    Returns
    -------
    (M,) disparity to a fraction of a pixel; NaN where no patch matches well or two match alike.
    """
    half = settings.patch_px // 2
    out = np.full(len(uv_V), np.nan)
    height, width = rectified_left.shape
    for i, (u, v) in enumerate(uv_V):
        row = int(round(v))
        if not half + _ROW_MARGIN_PX <= row < height - half - _ROW_MARGIN_PX or not half <= u < width - half:
            continue
        known = np.isfinite(expected[i])
        margin = _DISPARITY_SHARE * expected[i] + _DISPARITY_MARGIN_PX
        largest = (
            min(expected[i] + margin, settings.largest_disparity_px)
            if known
            else settings.largest_disparity_px
        )
        smallest = max(expected[i] - margin, 0.0) if known else 0.0
        # Columns of the patch centre in the right image.
        first = max(int(np.floor(u - largest)), half)
        last = min(int(np.ceil(u - smallest)) + 1, width - 1 - half)
        if last - first < 2:
            continue
        patch = cv2.getRectSubPix(rectified_left, (2 * half + 1, 2 * half + 1), (float(u), float(v)))
        strip = rectified_right[
            row - half - _ROW_MARGIN_PX : row + half + _ROW_MARGIN_PX + 1, first - half : last + half + 1
        ]
        score = cv2.matchTemplate(strip, patch, cv2.TM_CCOEFF_NORMED).max(axis=0)
        out[i] = u - first - _peak(score, settings)
    return out


def _peak(score: Array, settings: StereoSettings) -> float:
    """Position of the one clear maximum, by a parabola through three values; NaN where there is none."""
    best = int(np.argmax(score))
    if not score[best] >= settings.correlation or best in (0, len(score) - 1):
        return np.nan
    others = np.concatenate([score[: max(best - _PEAK_WIDTH_PX, 0)], score[best + _PEAK_WIDTH_PX + 1 :]])
    if others.size and others.max() > settings.second_peak * score[best]:
        return np.nan
    before, here, after = (float(s) for s in score[best - 1 : best + 2])
    curvature = before - 2.0 * here + after
    return best + (0.5 * (before - after) / curvature if curvature < 0.0 else 0.0)


def raw_pixels(geometry: StereoGeometry, uv_V: Array, camera: int) -> Array:
    """Pixels (M, 2) of the raw, distorted image of one camera for rectified pixels (M, 2)."""
    return distort_pixels((geometry.left, geometry.right)[camera], geometry.from_rectified(uv_V, camera))
