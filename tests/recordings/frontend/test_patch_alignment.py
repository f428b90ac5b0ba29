"""Patches found again in images that are turned and scaled by a known amount."""

from __future__ import annotations

import cv2
import numpy as np

from support.stereo_tracks import texture
from vigauge.recordings.frontend.patch_alignment import align_patches

SIZE = (640, 480)
FIRST = texture(3, SIZE[1], SIZE[0])
POINTS = np.stack(np.meshgrid(np.arange(80.5, 600.0, 60.0), np.arange(80.25, 420.0, 60.0)), axis=-1).reshape(
    -1, 2
)


def turned(degrees: float, scale: float, gain: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """The image after a turn about its middle, and where its points go."""
    A = cv2.getRotationMatrix2D((320.0, 240.0), degrees, scale)
    image = cv2.warpAffine(FIRST, A, SIZE, flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)
    return (gain * image).astype(np.uint8), POINTS @ A[:, :2].T + A[:, 2]


def test_points_of_a_turned_scaled_and_darker_image_are_found() -> None:
    """A half pixel between patch and image, the warp read the wrong way round, brightness that matters."""
    second, true = turned(6.0, 1.05, gain=0.7)
    guess = true + np.random.default_rng(0).uniform(-1.5, 1.5, true.shape)
    there, good = align_patches(FIRST, second, POINTS, guess, 21)
    error = (there - true)[good]
    assert np.mean(good) > 0.9
    assert np.abs(np.median(error, axis=0)).max() < 0.01
    assert np.median(np.linalg.norm(error, axis=1)) < 0.05


def test_what_is_not_there_is_not_found_and_stays() -> None:
    """OpenCV's error for a patch without texture; a point of another scene."""
    blank = np.full(SIZE[::-1], 100, np.uint8)
    for first, second in ((blank, blank), (FIRST, blank), (FIRST, texture(4, SIZE[1], SIZE[0]))):
        there, good = align_patches(first, second, POINTS, POINTS, 21)
        assert np.mean(good) < 0.02
        np.testing.assert_array_equal(there[~good], POINTS[~good])
    assert len(align_patches(FIRST, FIRST, POINTS[:0], POINTS[:0], 21)[0]) == 0
