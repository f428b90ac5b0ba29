"""A world of axis-aligned boxes, and the exact point that a ray of sight meets.

The scene is one room seen from inside with boxes standing or hanging in it. Every surface
is a rectangle, so a ray-cast is a few divisions and the truth is exact.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vigauge.errors import VigaugeError
from vigauge.geometry.camera import Camera, undistort
from vigauge.geometry.so3 import Array

# Faces are numbered 6 * box + 2 * axis + side; box 0 is the room, side 1 the larger coordinate.
FACES_PER_BOX = 6


@dataclass(frozen=True)
class Box:
    """Axis-aligned box in W: corners ``low`` and ``high``, (x, y, z) in metres."""

    low: tuple[float, float, float]
    high: tuple[float, float, float]

    def corners(self) -> Array:
        """(8, 3) corners, metres."""
        low, high = np.array(self.low), np.array(self.high)
        pick = np.indices((2, 2, 2)).reshape(3, 8).T
        return np.where(pick == 1, high, low)


@dataclass(frozen=True)
class Scene:
    """A room and the boxes in it."""

    room: Box  # its walls, floor and ceiling are seen from inside
    boxes: tuple[Box, ...]  # seen from outside; must not contain the camera
    # Size of a texture element on the surfaces.
    room_texel_m: float
    box_texel_m: float

    def all_boxes(self) -> tuple[Box, ...]:
        """The room first, then the boxes: the order of the face numbers."""
        return (self.room, *self.boxes)

    def raycast(
        self, origin_W: Array, rays_W: NDArray[np.floating]
    ) -> tuple[NDArray[np.floating], NDArray[np.int64]]:
        """First surface along each ray.

        ``rays_W`` is (3, ...) and need not have unit length: the point met is
        ``origin_W + scale * ray``. Returns ``scale`` and the face number, both (...).
        """
        scale, face = enter_room(self.room, origin_W, rays_W)
        for k, box in enumerate(self.boxes, start=1):
            meet_box(box, k, origin_W, rays_W, scale, face)
        return scale, face


def enter_room(
    room: Box, origin_W: Array, rays_W: NDArray[np.floating]
) -> tuple[NDArray[np.floating], NDArray[np.int64]]:
    """Scale and face at which (3, ...) rays from inside leave the room.

    Raises VigaugeError for an origin outside the room.
    """
    if not all(low < x < high for low, x, high in zip(room.low, origin_W, room.high, strict=True)):
        raise VigaugeError(f"camera must be inside the room {room}, is at {np.asarray(origin_W).tolist()}")
    scale = face = None
    for axis in range(3):
        ray = rays_W[axis]
        forward = ray > 0.0
        gap_low, gap_high = room.low[axis] - origin_W[axis], room.high[axis] - origin_W[axis]
        with np.errstate(divide="ignore"):
            reach = np.where(forward, ray.dtype.type(gap_high), ray.dtype.type(gap_low)) / ray
        # A ray along the wall gives -inf here, for it goes by the branch of the low side.
        reach = np.abs(reach)
        number = 2 * axis + forward.astype(np.int64)
        if scale is None or face is None:
            scale, face = reach, number
        else:
            nearer = reach < scale
            scale = np.where(nearer, reach, scale)
            face = np.where(nearer, number, face)
    assert scale is not None and face is not None
    return scale, face


def meet_box(
    box: Box,
    number: int,
    origin_W: Array,
    rays_W: NDArray[np.floating],
    scale: NDArray[np.floating],
    face: NDArray[np.int64],
) -> None:
    """Where the rays meet box ``number`` before ``scale``, put its distance and face there, in place."""
    enter = leave = entry_face = None
    for axis in range(3):
        ray = rays_W[axis]
        with np.errstate(divide="ignore", invalid="ignore"):
            inverse = 1.0 / ray
            to_low = ray.dtype.type(box.low[axis] - origin_W[axis]) * inverse
            to_high = ray.dtype.type(box.high[axis] - origin_W[axis]) * inverse
        near, far = np.minimum(to_low, to_high), np.maximum(to_low, to_high)
        face_here = FACES_PER_BOX * number + 2 * axis + (ray < 0.0)
        if enter is None or leave is None or entry_face is None:
            enter, leave, entry_face = near, far, face_here
        else:
            later = near > enter
            entry_face = np.where(later, face_here, entry_face)
            enter = np.maximum(enter, near)
            leave = np.minimum(leave, far)
    assert enter is not None and leave is not None and entry_face is not None
    with np.errstate(invalid="ignore"):
        met = (enter < leave) & (enter > 0.0) & (enter < scale)
    np.copyto(scale, enter, where=met)
    np.copyto(face, entry_face, where=met)


def point_at_pixel(
    scene: Scene, camera: Camera, R_WB: Array, p_W: Array, uv: Array
) -> tuple[Array, Array, NDArray[np.int64]]:
    """What is seen at measured (distorted) pixels of a camera on a body at R_WB, p_W.

    Parameters: uv (M, 2) pixels. Returns the points X_W (M, 3) m, their depths along the
    optical axis (M,) m, and the face numbers (M,).
    """
    normalised = (np.asarray(uv, dtype=float) - [camera.cx, camera.cy]) / [camera.fx, camera.fy]
    ideal = undistort(normalised, camera.distortion, camera.lens)
    rays_C = np.column_stack([ideal, np.ones(len(ideal))])
    rays_W = R_WB @ camera.R_BC @ rays_C.T
    origin_W = R_WB @ camera.p_BC + p_W
    depth, face = scene.raycast(origin_W, rays_W)
    return origin_W + depth[:, None] * rays_W.T, depth, face


def _standing(x: float, y: float, size: tuple[float, float, float], above: float = 0.0) -> Box:
    """A box of the given size centred on (x, y), ``above`` the floor, metres."""
    half_x, half_y = 0.5 * size[0], 0.5 * size[1]
    return Box((x - half_x, y - half_y, above), (x + half_x, y + half_y, above + size[2]))


def hall() -> Scene:
    """A hall of 20 x 14 x 7 m, with machines, pillars and slabs 2 to 11 m ahead of the origin."""
    boxes = (
        _standing(3.4, 2.1, (0.9, 0.9, 1.7)),
        _standing(3.0, -2.3, (0.8, 1.1, 1.2)),
        _standing(4.6, -0.3, (1.2, 1.4, 0.9)),
        _standing(5.6, 1.2, (0.4, 0.4, 4.2)),
        _standing(6.8, -3.4, (1.8, 1.8, 2.8)),
        _standing(7.0, 4.3, (1.6, 1.8, 2.4)),
        _standing(9.0, 0.6, (1.5, 2.2, 3.6)),
        _standing(1.2, 4.6, (1.6, 1.2, 2.2)),
        _standing(0.9, -4.8, (1.5, 1.3, 2.0)),
        _standing(4.8, -1.2, (1.6, 1.6, 0.3), above=2.9),
        _standing(6.2, 2.6, (2.0, 1.2, 0.3), above=3.6),
    )
    return Scene(Box((-6.0, -7.0, 0.0), (14.0, 7.0, 7.0)), boxes, room_texel_m=0.008, box_texel_m=0.005)


def room() -> Scene:
    """A room of 8 x 8 x 4 m with boxes along the walls and slabs on them."""
    boxes = (
        _standing(3.3, 0.2, (0.8, 1.2, 0.9)),
        _standing(3.0, 2.6, (1.0, 0.8, 1.9)),
        _standing(3.2, -2.4, (0.9, 1.3, 1.3)),
        _standing(1.0, 3.3, (1.2, 0.8, 0.8)),
        _standing(0.8, -3.4, (1.4, 0.7, 1.5)),
        _standing(-1.8, 3.2, (0.8, 0.9, 2.1)),
        _standing(-1.6, -3.3, (1.0, 0.8, 0.7)),
        _standing(-3.4, 0.0, (0.7, 1.4, 1.1)),
        _standing(3.7, 1.2, (0.5, 1.4, 0.12), above=2.3),
        _standing(3.7, -0.9, (0.5, 1.0, 0.12), above=2.0),
    )
    return Scene(Box((-4.0, -4.0, 0.0), (4.0, 4.0, 4.0)), boxes, room_texel_m=0.005, box_texel_m=0.004)
