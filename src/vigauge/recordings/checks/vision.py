"""What a sample of the images tells: brightness, frozen frames, stereo geometry, turns of the camera."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ...errors import VigaugeError
from ...geometry import so3
from ...geometry.camera import Camera, distort_pixels, undistort_pixels
from ...geometry.so3 import Array
from ..asl.images import read_image
from ..asl.sequence import Sequence
from ..frontend.descriptor_matching import DescriptorMatcher, mutual_matches, squared_distances
from ..frontend.epipolar import relative_pose
from ..frontend.pnp import estimate_pose
from ..frontend.settings import DescriptorSettings, PoseSettings, StereoSettings
from ..frontend.stereo import Image, StereoGeometry
from ..frontend.tracks import LEFT, RIGHT
from ..frontend.triangulation import triangulate_pair
from .turning import Turns

# Turns over less are lost in the noise of a pose; over more, matching fails.
_TURN_S, _LONGEST_TURN_S = 0.2, 1.2
# Points that agree on a pose, below which it is not believed.
_LEAST_INLIERS = 15
# Matches of unrelated places pass the ratio test less often than this strict.
_RATIO = 0.7
# As good as a calibration that fits.
_EXPLAINED_PX = 1.0
_DARK, _BRIGHT = 5, 250
_FEATURES = DescriptorSettings(features=600)

# What is measured of each frame, in the order of its list.
_NUMBERS = ("features", "matches", "grey_left", "grey_right", "contrast", "clipped")


@dataclass(frozen=True)
class Effort:
    """How many stereo frames and turns to look at: this, not the length of a recording, sets the time."""

    stereo_frames: int = 6
    turns: int = 20


@dataclass(frozen=True)
class StereoSample:
    """Medians over some stereo frames."""

    frames: int  # frames looked at
    features: float  # features of the left image
    matches: float  # of them matched to the right image by look alone, whatever the calibration says
    epipolar_px: float  # distance of these matches from their epipolar lines; NaN without matches
    # Rectified disparity of those near their line, which is positive in front of the cameras; NaN without
    # any.
    disparity_px: float
    # Mean grey level of 0..255; NaN right where there is one camera.
    grey_left: float
    grey_right: float
    contrast: float  # standard deviation of the grey levels of the left image
    clipped: float  # share of pixels of either image that are black or white
    # (frames,) the stamp of each and the median distance of its own matches; NaN where it has too few.
    frame_ns: NDArray[np.int64]
    frame_epipolar_px: Array
    # Frames whose matches fit another frame of cam1: stamp, and by how many frames that one is later.
    slips: tuple[tuple[int, int], ...] = ()

    @property
    def is_pair(self) -> bool:
        """Whether there are two cameras."""
        return not np.isnan(self.grey_right)


def _spread(n: int, most: int) -> list[int]:
    """At most ``most`` of 0..n-1, evenly."""
    return sorted({int(k) for k in np.linspace(0, n - 1, min(n, most)).round()})


def find_frozen(sequence: Sequence, frames: NDArray[np.int64], camera: int) -> NDArray[np.int64]:
    """Those of the frames (F,) whose image file of one camera equals that before, byte for byte.

    Only files of equal size are opened, so this can look at all frames.
    """
    paths = (sequence.frames.left, sequence.frames.right)[camera]
    files = [paths[frame] for frame in frames]
    sizes = [file.stat().st_size for file in files]
    same = [
        sizes[k] == sizes[k - 1] and files[k].read_bytes() == files[k - 1].read_bytes()
        for k in range(1, len(files))
    ]
    return frames[1:][np.array(same, dtype=bool)]


class ImageSample:
    """Reads images of chosen frames (F,) of a sequence and measures them.

    Everything here raises DataError for an image that cannot be read, and VigaugeError for a
    distortion that cannot be inverted.
    """

    def __init__(self, sequence: Sequence, frames: NDArray[np.int64], effort: Effort) -> None:
        self.sequence, self.frames, self.effort = sequence, frames, effort
        self.geometry = StereoGeometry.of(sequence.cameras)
        self._matches: list[tuple[Array, Array]] = []
        self._matcher = DescriptorMatcher(self.geometry, _FEATURES, StereoSettings(), PoseSettings())
        self._detected = lru_cache(maxsize=4)(self._detect)

    def read(self, frame: int, camera: int) -> Image:
        """The raw image of a frame of the sequence; camera 0 left, 1 right."""
        paths = (self.sequence.frames.left, self.sequence.frames.right)[camera]
        return read_image(paths[frame], self.sequence.cameras[camera])

    def _detect(self, frame: int, camera: int) -> tuple[Array, NDArray[np.float32]]:
        return self._matcher.detect(self.read(frame, camera), camera)

    def stereo(self) -> StereoSample:
        """Brightness, and how well matches between left and right fit the calibration."""
        chosen = _spread(len(self.frames), self.effort.stereo_frames)
        rows = [self._stereo_of(int(self.frames[k])) for k in chosen]
        distance = np.concatenate([row[0] for row in rows])
        disparity = np.concatenate([row[1] for row in rows])
        numbers = np.median([row[2] for row in rows], axis=0)
        own = np.array([np.median(d) if len(d) >= _LEAST_INLIERS else np.nan for d, _, _ in rows])
        near = np.abs(distance) <= 2.0 * StereoSettings().epipolar_px
        return StereoSample(
            frames=len(rows),
            epipolar_px=float(np.median(distance)) if len(distance) else float("nan"),
            disparity_px=float(np.median(disparity[near])) if np.any(near) else float("nan"),
            **dict(zip(_NUMBERS, map(float, numbers), strict=True)),
            frame_ns=self.sequence.frames.t_ns[self.frames[chosen]],
            frame_epipolar_px=own,
            slips=self._slips([chosen[k] for k in np.flatnonzero(own > _EXPLAINED_PX)]),
        )

    def _slips(self, suspects: list[int]) -> tuple[tuple[int, int], ...]:
        """Those of the frames (indices into ``frames``) whose left image fits a neighbour's right image."""
        found = []
        for k in suspects:
            uv, descriptors = self._detected(int(self.frames[k]), LEFT)
            for later in (1, -1, 2, -2):
                if not 0 <= k + later < len(self.frames):
                    continue
                uv_R, descriptors_R = self._detected(int(self.frames[k + later]), RIGHT)
                pairs = mutual_matches(squared_distances(descriptors, descriptors_R), _RATIO)
                distance = self.geometry.epipolar_distance(uv[pairs[:, 0]], uv_R[pairs[:, 1]])
                if len(pairs) >= _LEAST_INLIERS and np.median(distance) < 0.5 * _EXPLAINED_PX:
                    found.append((int(self.sequence.frames.t_ns[self.frames[k]]), later))
                    break
        return tuple(found)

    def _stereo_of(self, frame: int) -> tuple[Array, Array, list[float]]:
        if not self.geometry.is_pair:
            image, none = self.read(frame, LEFT), np.empty(0)
            features = float(len(self._detected(frame, LEFT)[0]))
            light = [float(image.mean()), np.nan, float(image.std()), _clipped(image)]
            return none, none, [features, np.nan, *light]
        images = self.read(frame, LEFT), self.read(frame, RIGHT)
        (uv, descriptors), (uv_R, descriptors_R) = self._detected(frame, LEFT), self._detected(frame, RIGHT)
        pairs = mutual_matches(squared_distances(descriptors, descriptors_R), _RATIO)
        uv, uv_R = uv[pairs[:, 0]], uv_R[pairs[:, 1]]
        self._matches.append((uv, uv_R))
        grey = [float(image.mean()) for image in images]
        clipped = float(np.mean([_clipped(image) for image in images]))
        numbers = [float(len(descriptors)), float(len(pairs)), *grey, float(images[0].std()), clipped]
        return self.geometry.epipolar_distance(uv, uv_R), self.geometry.disparity(uv, uv_R), numbers

    def explain_epipolar(self) -> str:
        """The mistake in the calibration that, undone, brings the matches of :meth:`stereo` onto
        their epipolar lines, in words; empty where it is none of those that are tried.
        """
        left, right = self.geometry.left, self.geometry.right
        readings = {
            "both T_BS look inverted (body to camera)": (_inverted(left), _inverted(right)),
            "the T_BS of cam0 and cam1 look exchanged": (_posed_as(left, right), _posed_as(right, left)),
            "cam0 and cam1 look exchanged": (right, left),
        }
        for words, (first, second) in readings.items():
            try:
                uv = [undistort_pixels(first, distort_pixels(left, uv)) for uv, _ in self._matches]
                uv_R = [undistort_pixels(second, distort_pixels(right, uv_R)) for _, uv_R in self._matches]
            except VigaugeError:
                continue  # a lens that cannot have made these images explains nothing
            distance = StereoGeometry(first, second).epipolar_distance(
                np.concatenate(uv), np.concatenate(uv_R)
            )
            if float(np.median(distance)) < _EXPLAINED_PX:
                return words
        return ""

    def turns(self) -> tuple[Turns, Array, int]:
        """Turns of the left camera between frames by PnP from stereo points, the share (P,) of
        the image's width by which points moved, and how many pairs of frames were tried.
        """
        t_ns = self.sequence.frames.t_ns[self.frames]
        pairs = _pairs(t_ns, self.effort.turns)
        first, second, phi, moved = [], [], [], []
        for a, b in pairs:
            found = self._turn(int(self.frames[a]), int(self.frames[b]))
            if found is not None:
                first.append(int(t_ns[a]))
                second.append(int(t_ns[b]))
                phi.append(found[0])
                moved.append(found[1])
        R_BC = self.sequence.cameras[LEFT].R_BC
        stamps = np.array(first, dtype=np.int64), np.array(second, dtype=np.int64)
        return Turns(*stamps, np.array(phi).reshape(-1, 3), R_BC), np.array(moved), len(pairs)

    def _turn(self, first: int, second: int) -> tuple[Array, float] | None:
        """Rotation vector of R_C1C2 and the median motion of points, px; None without a good pose."""
        if not self.geometry.is_pair:
            return self._turn_of_one(first, second)
        left, right, later = (
            self._detected(first, LEFT),
            self._detected(first, RIGHT),
            self._detected(second, LEFT),
        )
        stereo = mutual_matches(squared_distances(left[1], right[1]), _RATIO)
        uv, uv_R = left[0][stereo[:, 0]], right[0][stereo[:, 1]]
        near = self.geometry.epipolar_distance(uv, uv_R) <= StereoSettings().epipolar_px
        points = np.full((len(left[0]), 3), np.nan)
        points[stereo[near, 0]] = triangulate_pair(self.geometry, uv[near], uv_R[near])
        pairs = mutual_matches(squared_distances(left[1], later[1]), _RATIO)
        pairs = pairs[np.isfinite(points[pairs[:, 0], 0])]
        before, after = left[0][pairs[:, 0]], later[0][pairs[:, 1]]
        settings = PoseSettings()
        pose = estimate_pose(
            points[pairs[:, 0]], after, self.geometry.left.K, settings.reprojection_px, settings.rounds
        )
        if pose is None or pose.n_inliers < _LEAST_INLIERS:
            return None
        motion = np.linalg.norm(after - before, axis=1)[pose.inlier]
        return so3.log(pose.R_CM.T), float(np.median(motion))

    def _turn_of_one(self, first: int, second: int) -> tuple[Array, float] | None:
        """The same from one camera, by matches alone."""
        left, later = self._detected(first, LEFT), self._detected(second, LEFT)
        pairs = mutual_matches(squared_distances(left[1], later[1]), _RATIO)
        before, after = left[0][pairs[:, 0]], later[0][pairs[:, 1]]
        step = relative_pose(before, after, self.geometry.left.K, StereoSettings().epipolar_px)
        if step is None or np.count_nonzero(step[2]) < _LEAST_INLIERS:
            return None
        motion = np.linalg.norm(after - before, axis=1)[step[2]]
        return so3.log(step[0].T), float(np.median(motion))


def _clipped(image: Image) -> float:
    """Share of the pixels that are black or white."""
    return float(np.mean((image <= _DARK) | (image >= _BRIGHT)))


def _posed_as(camera: Camera, other: Camera) -> Camera:
    return replace(camera, R_BC=other.R_BC, p_BC=other.p_BC)


def _inverted(camera: Camera) -> Camera:
    return replace(camera, R_BC=camera.R_BC.T, p_BC=-camera.R_BC.T @ camera.p_BC)


def _pairs(t_ns: NDArray[np.int64], most: int) -> list[tuple[int, int]]:
    """At most ``most`` pairs of frames, one after the other, that lie _TURN_S to _LONGEST_TURN_S apart."""
    pairs = []
    a = 0
    while a < len(t_ns) - 1:
        b = int(np.searchsorted(t_ns, t_ns[a] + round(_TURN_S * 1e9) - 1_000_000))
        if b >= len(t_ns):
            break
        if (t_ns[b] - t_ns[a]) * 1e-9 <= _LONGEST_TURN_S:
            pairs.append((a, b))
        a = b
    return [pairs[k] for k in _spread(len(pairs), most)] if pairs else []
