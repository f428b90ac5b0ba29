"""Procedural grey textures for the faces of a scene, packed in one image with its mip levels.

Each face gets its own pattern, nothing repeats: clouds at several scales, and on them
rectangles, discs, triangles and checkerboards of log-uniform size, so that corner and
blob detectors find features at every distance. Averaged copies at half, quarter, ... the
resolution serve distant and slanted surfaces without aliasing.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from vigauge.geometry.so3 import Array

from .scene import FACES_PER_BOX, Scene

N_LEVELS = 6
# Texels repeated around each face: one is left on the coarsest level for interpolation.
_GUARD = 2 ** (N_LEVELS - 1)
_SHELF_TEXELS = 4096
_SHAPES_PER_M2 = 28.0
_SHAPE_SIZE_M = (0.035, 0.8)
_CLOUD_SIZES_M = (2.0, 0.5, 0.12, 0.03)
_CLOUD_AMPLITUDES = (30.0, 18.0, 10.0, 7.0)


@dataclass(frozen=True)
class TextureAtlas:
    """All faces and all mip levels in one image.

    A point with in-face coordinates (a, b), metres from the face's low corner along its two
    axes in the order x, y, z, has the texel coordinates ``(a, b) / texel_m + offset`` on
    level 0, and on level k ``((.) + 0.5) / 2^k - 0.5 + level_offset[k]``.
    """

    image: NDArray[np.uint8]  # (H, W) uint8
    texel_m: Array  # (faces,) size of a texel, metres
    origin_m: Array  # (faces, 2) in-face coordinates of the low corner in W, metres
    offset: Array  # (faces, 2) texels (horizontal, vertical) of the low corner on level 0
    level_offset: Array  # (N_LEVELS, 2) texels


def face_axes(axis: int) -> tuple[int, int]:
    """The two axes of W that span a face normal to ``axis``."""
    first, second = (k for k in range(3) if k != axis)
    return first, second


def paint(scene: Scene, rng: np.random.Generator) -> TextureAtlas:
    """Paint every face of the scene; same generator state, same texture."""
    boxes = scene.all_boxes()
    n_faces = FACES_PER_BOX * len(boxes)
    texel_m, origin_m, offset = np.empty(n_faces), np.empty((n_faces, 2)), np.empty((n_faces, 2))
    shelf = _Shelf()
    pieces = []
    for number in range(n_faces):
        box = boxes[number // FACES_PER_BOX]
        texel_m[number] = scene.box_texel_m if number >= FACES_PER_BOX else scene.room_texel_m
        axes = face_axes(number % FACES_PER_BOX // 2)
        origin_m[number] = [box.low[a] for a in axes]
        width_m, height_m = (box.high[a] - box.low[a] for a in axes)
        piece = _paint_face(width_m, height_m, float(texel_m[number]), rng)
        piece = cv2.copyMakeBorder(piece, _GUARD, _GUARD, _GUARD, _GUARD, cv2.BORDER_REPLICATE)
        corner = shelf.place(piece.shape[1], piece.shape[0])
        pieces.append((corner, piece))
        # Texel centres lie half a texel inside the face.
        offset[number] = np.array(corner) + _GUARD - 0.5
    unit = 2 ** (N_LEVELS - 1)
    height = -(-shelf.height() // unit) * unit
    base = np.zeros((height, _SHELF_TEXELS), np.uint8)
    for (left, top), piece in pieces:
        base[top : top + piece.shape[0], left : left + piece.shape[1]] = piece
    image, level_offset = _with_levels(base)
    return TextureAtlas(image, texel_m, origin_m, offset, level_offset)


class _Shelf:
    """Places rectangles left to right, in rows as high as their highest piece."""

    def __init__(self) -> None:
        self._left = self._top = self._row_height = 0

    def place(self, width: int, height: int) -> tuple[int, int]:
        if self._left + width > _SHELF_TEXELS:
            self._top += self._row_height
            self._left = self._row_height = 0
        corner = (self._left, self._top)
        self._left += width
        self._row_height = max(self._row_height, height)
        return corner

    def height(self) -> int:
        return self._top + self._row_height


def _with_levels(base: NDArray[np.uint8]) -> tuple[NDArray[np.uint8], Array]:
    """The base image with its averaged copies stacked in a column on its right."""
    height, width = base.shape
    image = np.zeros((height, width + width // 2), np.uint8)
    image[:, :width] = base
    level_offset = np.zeros((N_LEVELS, 2))
    level, top = base, 0
    for k in range(1, N_LEVELS):
        level = cv2.resize(level, (level.shape[1] // 2, level.shape[0] // 2), interpolation=cv2.INTER_AREA)
        image[top : top + level.shape[0], width : width + level.shape[1]] = level
        level_offset[k] = (width, top)
        top += level.shape[0]
    return image, level_offset


def _paint_face(
    width_m: float, height_m: float, texel_m: float, rng: np.random.Generator
) -> NDArray[np.uint8]:
    width, height = (max(round(size / texel_m), 2) for size in (width_m, height_m))
    canvas = np.full((height, width), rng.uniform(85.0, 150.0), np.float32)
    for size_m, amplitude in zip(_CLOUD_SIZES_M, _CLOUD_AMPLITUDES, strict=True):
        cells = (max(round(height_m / size_m), 1) + 3, max(round(width_m / size_m), 1) + 3)
        grid = amplitude * rng.standard_normal(cells, dtype=np.float32)
        canvas += cv2.resize(grid, (width, height), interpolation=cv2.INTER_LINEAR)
    face = np.clip(canvas, 0.0, 255.0).astype(np.uint8)
    for _ in range(rng.poisson(_SHAPES_PER_M2 * width_m * height_m)):
        size_m = float(np.exp(rng.uniform(*np.log(_SHAPE_SIZE_M))))
        _draw_shape(face, size_m / texel_m, rng)
    # Band-limits the edges, so that interpolation between texels is faithful.
    return cv2.GaussianBlur(face, (0, 0), 0.7)


def _draw_shape(face: NDArray[np.uint8], size: float, rng: np.random.Generator) -> None:
    """One random shape, ``size`` texels across, on the face."""
    height, width = face.shape
    centre = rng.uniform((0.0, 0.0), (width, height))
    kind, angle, stretch = rng.integers(4), rng.uniform(0.0, np.pi), rng.uniform(0.5, 1.0)
    grey, other_grey = (float(g) for g in rng.uniform(15.0, 245.0, 2))
    if kind == 0:
        _fill(face, _ellipse(centre, size, stretch, angle), grey)
    elif kind == 1:
        _fill(face, _polygon(centre, size, 3, angle), grey)
    elif kind == 2 or size < 12.0:
        _fill(face, _quad(centre, size, stretch * size, angle), grey)
    else:
        cells = int(rng.integers(2, 5))
        side = size / cells
        for row in range(cells):
            for column in range(cells):
                place = (np.array([column, row]) - 0.5 * (cells - 1)) * side
                turned = centre + _turn(angle) @ place
                _fill(face, _quad(turned, side, side, angle), grey if (row + column) % 2 else other_grey)


def _turn(angle: float) -> Array:
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def _polygon(centre: Array, size: float, corners: int, angle: float) -> Array:
    around = angle + 2.0 * np.pi * np.arange(corners) / corners
    return centre + 0.5 * size * np.column_stack([np.cos(around), np.sin(around)])


def _ellipse(centre: Array, size: float, stretch: float, angle: float) -> Array:
    circle = _polygon(np.zeros(2), size, 24, 0.0) * [1.0, stretch]
    return centre + circle @ _turn(angle).T


def _quad(centre: Array, width: float, height: float, angle: float) -> Array:
    corners = 0.5 * np.array([[-width, -height], [width, -height], [width, height], [-width, height]])
    return centre + corners @ _turn(angle).T


def _fill(face: NDArray[np.uint8], outline: Array, grey: float) -> None:
    # Fixed point with 4 fractional bits; anti-aliased.
    points = np.round(outline * 16.0).astype(np.int32)
    cv2.fillConvexPoly(face, points, grey, cv2.LINE_AA, 4)
