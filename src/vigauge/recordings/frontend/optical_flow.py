"""Corners followed by pyramidal optical flow, from frame to frame and from left to right.

For contiguous sequences. The inertial sensor's rotation between frames tells where to start the
search, and correlation along the rectified row tells the disparity, where there are two cameras.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

import cv2
import numpy as np
from numpy.typing import NDArray

from ...geometry.camera import Camera, distort_pixels, in_field, undistort_pixels
from ...geometry.so3 import Array
from .frames import require_change
from .patch_alignment import align_patches
from .settings import FlowSettings, StereoSettings
from .stereo import Image, StereoGeometry, raw_pixels, search_disparity
from .tracks import LEFT, RIGHT, TrackingCounts, Tracks, concatenate, image_observations

ImageReader = Callable[[int, int], Image]
_CRITERIA = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 30, 0.01)
_EQUALISER_CLIP, _EQUALISER_TILES = 2.0, (8, 8)
# Why points are lost.
_LOST = ("optical flow", "image border", "outside the field", "stereo search", "stereo epipolar")


def _flow(
    first: Image, second: Image, points: Array, guess: Array, settings: FlowSettings
) -> tuple[Array, NDArray[np.bool_]]:
    """Points (m, 2) of ``first`` found in ``second`` near ``guess``, and which of them came back."""
    if not len(points):
        return points.copy(), np.zeros(0, dtype=bool)
    options = {
        "winSize": (settings.window_px, settings.window_px),
        "maxLevel": settings.levels,
        "criteria": _CRITERIA,
        "flags": cv2.OPTFLOW_USE_INITIAL_FLOW,
    }
    start = points.astype(np.float32)
    there, found, _ = cv2.calcOpticalFlowPyrLK(first, second, start, guess.astype(np.float32), **options)
    back, returned, _ = cv2.calcOpticalFlowPyrLK(second, first, there, start.copy(), **options)
    error = np.linalg.norm(back - start, axis=1)
    good = (found.ravel() == 1) & (returned.ravel() == 1) & (error <= settings.forward_backward_px)
    return there.astype(float), good


def _inside(points: Array, camera: Camera, border: int) -> NDArray[np.bool_]:
    size = np.array([camera.width, camera.height])
    return np.all((points >= border) & (points <= size - 1 - border), axis=1)


def _turned(points: Array, camera: Camera, dR_B: Array) -> Array:
    """Where raw pixels go when the body turns by dR_B (R_B0B1) and does not move."""
    ideal = undistort_pixels(camera, points)
    R_C1C0 = camera.R_BC.T @ dR_B.T @ camera.R_BC
    rays = np.column_stack([ideal, np.ones(len(ideal))]) @ np.linalg.inv(camera.K).T @ R_C1C0.T
    ahead = rays[:, 2] > 0.1
    out = points.copy()
    pixels = rays[ahead] @ camera.K.T
    out[ahead] = distort_pixels(camera, pixels[:, :2] / pixels[:, 2:])
    # The distortion model is only good near the image; elsewhere the old place is the better guess.
    outside = ~_inside(out, camera, -50)
    out[outside] = points[outside]
    return out


class FlowTracker:
    """Follows corners; call :meth:`advance` for each frame, :meth:`keyframe` at keyframes."""

    def __init__(self, geometry: StereoGeometry, flow: FlowSettings, stereo: StereoSettings) -> None:
        self.geometry, self.flow, self.stereo = geometry, flow, stereo
        self.counts = TrackingCounts(dict.fromkeys(_LOST, 0))
        self.points: Array = np.empty((0, 2))
        self.track = np.empty(0, dtype=np.int64)
        self.disparity = np.empty(0)
        self.n_tracks = 0
        self.image: Image | None = None
        # Image and points of the last keyframe, against which drift is taken out.
        self.reference: tuple[Image, Array, NDArray[np.int64]] | None = None
        self.observations: list[Tracks] = []
        self.equaliser = cv2.createCLAHE(_EQUALISER_CLIP, _EQUALISER_TILES)
        rows, columns = np.indices((geometry.left.height, geometry.left.width))
        self._in_field = in_field(geometry.left, np.stack([columns, rows], axis=-1))

    def equalised(self, image: Image) -> Image:
        """Local histogram equalisation, so that exposure does not matter."""
        return self.equaliser.apply(image)

    def advance(self, left: Image, dR_B: Array) -> None:
        """Follow all points into the next (equalised) left image; dR_B (3, 3) is R_B0B1 between them."""
        if self.image is not None and len(self.points):
            guess = _turned(self.points, self.geometry.left, dR_B)
            self._follow(self.image, left, self.points, guess)
        self.image = left

    def _follow(self, first: Image, second: Image, points: Array, guess: Array) -> None:
        self._move(*_flow(first, second, points, guess, self.flow))

    def _move(self, there: Array, good: NDArray[np.bool_]) -> None:
        """Points go to ``there``; those that are not good, or leave the field, are lost."""
        inside = _inside(there, self.geometry.left, self.flow.border_px)
        seen = in_field(self.geometry.left, there)
        self.counts.lose("optical flow", ~good)
        self.counts.lose("image border", good & ~inside)
        self.counts.lose("outside the field", good & inside & ~seen)
        self.points = there
        self._keep(good & inside & seen)

    def _keep(self, keep: NDArray[np.bool_]) -> None:
        self.points, self.track, self.disparity = self.points[keep], self.track[keep], self.disparity[keep]

    def keyframe(self, index: int, right: Image | None) -> None:
        """Make the current frame keyframe ``index``; ``right`` is its (equalised) right image, if any."""
        assert self.image is not None, "advance to a frame first"
        self._take_out_drift()
        self._add_corners()
        ideal = undistort_pixels(self.geometry.left, self.points)
        self.observations.append(image_observations(index, LEFT, self.track, ideal))
        if right is not None:
            uv_right, matched = self._match_right(right, ideal)
            self.observations.append(image_observations(index, RIGHT, self.track[matched], uv_right[matched]))
        self.reference = (self.image, self.points, self.track)

    def _take_out_drift(self) -> None:
        """Small errors add up from frame to frame: follow once more from the last keyframe itself."""
        if self.reference is None or self.image is None:
            return
        image, points, track = self.reference
        _, here, there = np.intersect1d(self.track, track, assume_unique=True, return_indices=True)
        in_order = np.argsort(here)
        here, there = here[in_order], there[in_order]
        assert len(here) == len(self.track), "every point was at the last keyframe"
        if self.flow.patch == "affine":
            self._move(*align_patches(image, self.image, points[there], self.points, self.flow.window_px | 1))
        else:
            self._follow(image, self.image, points[there], self.points)

    def _add_corners(self) -> None:
        """Fill up with corners away from the points that are there."""
        assert self.image is not None
        camera, flow = self.geometry.left, self.flow
        wanted = flow.corners - len(self.points)
        if wanted <= 0:
            return
        mask = np.zeros(self.image.shape, dtype=np.uint8)
        border = max(flow.border_px, 1)
        mask[border:-border, border:-border] = 255
        mask[~self._in_field] = 0
        for u, v in np.rint(self.points).astype(int):
            cv2.circle(mask, (int(u), int(v)), int(flow.corner_distance_px), 0, -1)
        corners = cv2.goodFeaturesToTrack(
            self.image, wanted, flow.corner_quality, flow.corner_distance_px, mask=mask, blockSize=5
        )
        if corners is None:
            return
        corners = (
            cv2.cornerSubPix(self.image, corners, (3, 3), (-1, -1), _CRITERIA).reshape(-1, 2).astype(float)
        )
        corners = corners[_inside(corners, camera, flow.border_px) & in_field(camera, corners)]
        self.points = np.concatenate([self.points, corners])
        self.track = np.concatenate([self.track, self.n_tracks + np.arange(len(corners))])
        self.disparity = np.concatenate([self.disparity, np.full(len(corners), np.nan)])
        self.n_tracks += len(corners)

    def _match_right(self, right: Image, ideal_left: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Ideal right pixels (m, 2) of the current points and which are good; remembers the disparities."""
        assert self.image is not None
        geometry, counts = self.geometry, self.counts
        uv_V = geometry.to_rectified(ideal_left, LEFT)
        rectified = geometry.rectified_image(self.image, LEFT), geometry.rectified_image(right, RIGHT)
        disparity = search_disparity(*rectified, uv_V, self.disparity, self.stereo)
        found = np.isfinite(disparity)
        guess_V = uv_V - np.column_stack([np.where(found, disparity, 0.0), np.zeros(len(uv_V))])
        guess = raw_pixels(geometry, guess_V, RIGHT)
        there, good = _flow(
            self.image, right, self.points, np.where(found[:, None], guess, self.points), self.flow
        )
        good &= found & _inside(there, geometry.right, self.flow.border_px) & in_field(geometry.right, there)
        uv_right = np.zeros_like(there)
        uv_right[good] = undistort_pixels(geometry.right, there[good])
        on_line = np.zeros(len(good), dtype=bool)
        distance = geometry.epipolar_distance(ideal_left[good], uv_right[good])
        disparity = geometry.disparity(ideal_left, uv_right)
        on_line[good] = (distance <= self.stereo.epipolar_px) & (disparity[good] > 0.0)
        counts.lose("stereo search", ~good)
        counts.lose("stereo epipolar", good & ~on_line)
        counts.stereo_tried += len(good)
        counts.stereo_matched += int(np.count_nonzero(on_line))
        self.disparity = np.where(on_line, disparity, np.nan)
        return uv_right, on_line


def track_by_flow(
    read: ImageReader,
    frames: Iterable[int],
    keyframes: NDArray[np.int64],
    dR_B: Array,
    geometry: StereoGeometry,
    flow: FlowSettings,
    stereo: StereoSettings,
) -> tuple[Tracks, TrackingCounts]:
    """Tracks over the keyframes of a contiguous sequence.

    Parameters
    ----------
    read : the raw image of (frame, camera)
    frames : indices of the frames to go through, consecutive, first and last keyframe included
    keyframes : (N,) indices of the keyframes among them
    dR_B : (F - 1, 3, 3) R_B0B1 between each frame and the next

    Raises DataError where two successive images are the same to the last bit: the camera was frozen.
    """
    tracker = FlowTracker(geometry, flow, stereo)
    number = {int(frame): n for n, frame in enumerate(keyframes)}
    before: Image | None = None
    for step, frame in enumerate(frames):
        image = read(frame, LEFT)
        before = require_change(before, image, frame)
        tracker.advance(tracker.equalised(image), dR_B[step - 1] if step else np.eye(3))
        if frame in number:
            right = tracker.equalised(read(frame, RIGHT)) if geometry.is_pair else None
            tracker.keyframe(number[frame], right)
    return concatenate(tracker.observations, tracker.n_tracks), tracker.counts
