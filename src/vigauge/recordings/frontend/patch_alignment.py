"""Patches of one image found in another, turned, scaled and sheared, to a tenth of a pixel.

A window that is only shifted finds the middle of its texture, not its point. When the camera turns or comes
nearer, these two part, and the point walks: by 0.4 px a keyframe on a rendered flight, where an affine window
leaves 0.09 px (Shi and Tomasi, CVPR 1994, track alike). The alignment is that of Evangelidis and Psarakis
(PAMI 2008), to which brightness and contrast do not matter.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from ...geometry.so3 import Array
from .stereo import Image

_CRITERIA = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 30, 1e-4)
# Smoothing of both patches, px, so that their gradients are of the texture and not of the noise.
_BLUR_PX = 3
# The patch is looked for in one that is larger by this on each side, and is somewhere else beyond half of it.
_MARGIN_PX = 10
# Below, what is found is something else.
_LEAST_CORRELATION = 0.8


def align_patches(
    first: Image, second: Image, points: Array, guess: Array, side_px: int
) -> tuple[Array, NDArray[np.bool_]]:
    """Points (m, 2) of ``first`` in ``second``, near ``guess`` (m, 2), and which were found.

    Those that were not stay at their guess. ``side_px`` is the side of a patch, odd.
    """
    middle = np.array([side_px // 2, side_px // 2, 1.0])
    centre = middle[:2] + _MARGIN_PX
    wide_px = side_px + 2 * _MARGIN_PX
    there, good = guess.copy(), np.zeros(len(points), dtype=bool)
    for k, (point, near) in enumerate(zip(points.tolist(), guess.tolist(), strict=True)):
        patch = cv2.getRectSubPix(first, (side_px, side_px), point)
        around = cv2.getRectSubPix(second, (wide_px, wide_px), near)
        shift = np.array([[1.0, 0.0, _MARGIN_PX], [0.0, 1.0, _MARGIN_PX]], dtype=np.float32)
        try:
            correlation, warp = cv2.findTransformECC(
                patch, around, shift, cv2.MOTION_AFFINE, _CRITERIA, None, _BLUR_PX
            )
        except cv2.error:  # no texture, or no minimum
            continue
        moved = warp @ middle - centre
        good[k] = correlation >= _LEAST_CORRELATION and bool(np.all(np.abs(moved) < 0.5 * _MARGIN_PX))
        if good[k]:
            there[k] += moved
    return there, good
