"""SIFT matching between sparse keyframes: left to right, of two cameras, and to earlier keyframes.

Every pair of keyframes is verified on its own: points with stereo depth in the one fix the
pose of the other (PnP RANSAC), and with that pose all other matches must fit the epipolar lines.
Where keyframes are far apart, or there is one camera, the lines alone verify a pair.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from ...geometry import so3
from ...geometry.camera import ideal_size, in_field, undistort_pixels
from ...geometry.so3 import Array
from .epipolar import relative_pose
from .frames import require_change
from .pnp import estimate_pose, reprojection_error
from .settings import DescriptorSettings, PoseSettings, StereoSettings
from .stereo import Image, StereoGeometry, epipolar_distance
from .tracks import LEFT, RIGHT, Index, TrackingCounts, Tracks, concatenate, image_observations, join_matches
from .triangulation import triangulate_pair

# A match between two views of a moving camera may be off by more than one within the rig,
# whose calibration is exact: this many times the stereo threshold.
_PAIR_EPIPOLAR_FACTOR = 1.5
# Why features and matches are lost.
_LOST = ("outside the field", "pair refused", "pair geometry", "conflicting tracks")


@dataclass(frozen=True)
class _StereoFeatures:
    """Features of one keyframe.

    ``uv`` (n, 2) ideal left pixels; ``descriptors`` (n, 128); ``uv_right`` (n, 2) and
    ``points_C`` (n, 3) m in the left camera, NaN where there is no right match.
    """

    uv: Array
    descriptors: NDArray[np.float32]
    uv_right: Array
    points_C: Array

    @property
    def has_depth(self) -> NDArray[np.bool_]:
        return np.isfinite(self.points_C[:, 0])


def squared_distances(first: NDArray[np.float32], second: NDArray[np.float32]) -> NDArray[np.float32]:
    """(n, m) squared distances of descriptors (n, 128) and (m, 128).

    SIFT's entries are whole numbers up to 255, so every product and sum here is exact in
    single precision, and the result does not depend on the order of summation.
    """
    norms = np.einsum("ij,ij->i", first, first)[:, None] + np.einsum("ij,ij->i", second, second)[None, :]
    return norms - 2.0 * (first @ second.T)


def mutual_matches(squared: Array, ratio: float) -> Index:
    """(P, 2) pairs (row, column) that are each other's nearest and pass the ratio test both ways.

    ``squared`` (n, m) squared distances, infinite where a pair is ruled out beforehand.
    """
    if min(squared.shape) == 0:
        return np.empty((0, 2), dtype=np.int64)
    nearest = np.argmin(squared, axis=1)
    rows = np.arange(len(squared))
    mutual = np.argmin(squared, axis=0)[nearest] == rows
    best = squared[rows, nearest]
    clear = np.isfinite(best)
    for axis in (0, 1):
        if squared.shape[axis] > 1:
            second = (
                np.partition(squared, 1, axis=axis)[1]
                if axis == 0
                else np.partition(squared, 1, axis=1)[:, 1]
            )
            clear &= best <= ratio**2 * (second[nearest] if axis == 0 else second)
    keep = np.flatnonzero(mutual & clear)
    return np.column_stack([keep, nearest[keep]]).astype(np.int64)


class DescriptorMatcher:
    """Features of stereo keyframes and their matches."""

    def __init__(
        self,
        geometry: StereoGeometry,
        descriptors: DescriptorSettings,
        stereo: StereoSettings,
        pose: PoseSettings,
        wide: bool = False,
    ) -> None:
        """``wide``: for views far apart; more features, and pairs are verified by epipolar lines alone."""
        if wide:
            descriptors = replace(
                descriptors,
                features=min(2 * descriptors.features, 20_000),
                contrast=0.5 * descriptors.contrast,
                ratio=0.5 * (1.0 + descriptors.ratio),
                pair_inliers=2 * descriptors.pair_inliers,
            )
        self.wide = wide
        self.geometry, self.settings, self.stereo, self.pose = geometry, descriptors, stereo, pose
        self.counts = TrackingCounts(dict.fromkeys(_LOST, 0))
        self.detector = cv2.SIFT_create(
            nfeatures=descriptors.features,
            contrastThreshold=descriptors.contrast,
            enable_precise_upscale=True,
        )

    def detect(self, image: Image, camera: int) -> tuple[Array, NDArray[np.float32]]:
        """Ideal pixels (n, 2) and descriptors (n, 128); one feature a place, whatever its orientations."""
        keypoints, descriptors = self.detector.detectAndCompute(image, None)
        if descriptors is None:
            return np.empty((0, 2)), np.empty((0, 128), dtype=np.float32)
        raw = np.array([k.pt for k in keypoints])
        _, unique = np.unique(raw, axis=0, return_index=True)
        unique.sort()
        view = (self.geometry.left, self.geometry.right)[camera]
        seen = in_field(view, raw[unique])
        self.counts.lose("outside the field", ~seen)
        unique = unique[seen]
        return undistort_pixels(view, raw[unique]), descriptors[unique]

    def stereo_features(self, left: Image, right: Image | None) -> _StereoFeatures:
        """Features of one keyframe, matched along epipolar lines and triangulated where it has two images."""
        geometry = self.geometry
        uv, descriptors = self.detect(left, LEFT)
        if right is None:
            return _StereoFeatures(
                uv, descriptors, np.full((len(uv), 2), np.nan), np.full((len(uv), 3), np.nan)
            )
        uv_R, descriptors_R = self.detect(right, RIGHT)
        squared = squared_distances(descriptors, descriptors_R)
        V_left, V_right = geometry.to_rectified(uv, LEFT), geometry.to_rectified(uv_R, RIGHT)
        # In the rectified view the epipolar distance is the difference of the rows.
        row_gap = np.abs(V_left[:, None, 1] - V_right[None, :, 1])
        disparity = V_left[:, None, 0] - V_right[None, :, 0]
        allowed = (row_gap <= self.stereo.epipolar_px) & (disparity > 0.0)
        allowed &= disparity <= self.stereo.largest_disparity_px
        pairs = mutual_matches(np.where(allowed, squared, np.inf), self.settings.stereo_ratio)
        uv_right, points_C = np.full((len(uv), 2), np.nan), np.full((len(uv), 3), np.nan)
        if len(pairs):
            ok = geometry.epipolar_distance(uv[pairs[:, 0]], uv_R[pairs[:, 1]]) <= self.stereo.epipolar_px
            pairs = pairs[ok]
            uv_right[pairs[:, 0]] = uv_R[pairs[:, 1]]
            points_C[pairs[:, 0]] = triangulate_pair(geometry, uv[pairs[:, 0]], uv_R[pairs[:, 1]])
        self.counts.stereo_tried += len(uv)
        self.counts.stereo_matched += len(pairs)
        return _StereoFeatures(uv, descriptors, uv_right, points_C)

    def verified_matches(self, first: _StereoFeatures, second: _StereoFeatures) -> Index:
        """(P, 2) matches between the left images of two keyframes that fit one relative pose."""
        pairs = mutual_matches(squared_distances(first.descriptors, second.descriptors), self.settings.ratio)
        K = self.geometry.left.K
        if self.wide or not self.geometry.is_pair:
            return self._along_lines(first, second, pairs)
        known = first.has_depth[pairs[:, 0]]
        points, uv = first.points_C[pairs[:, 0]], second.uv[pairs[:, 1]]
        pose = estimate_pose(
            points[known],
            uv[known],
            K,
            self.pose.reprojection_px,
            self.pose.rounds,
            self.pose.seed,
            ideal_size(self.geometry.left, uv[known]),
        )
        if pose is None or pose.n_inliers < self.settings.pair_inliers:
            self.counts.lost["pair refused"] += len(pairs)
            return pairs[:0]
        inverse = np.linalg.inv(K)
        fundamental = inverse.T @ so3.hat(pose.p_CM) @ pose.R_CM @ inverse
        sizes = [ideal_size(self.geometry.left, at) for at in (first.uv[pairs[:, 0]], uv)]
        distance = epipolar_distance(fundamental, first.uv[pairs[:, 0]], uv, *sizes)
        good = distance <= _PAIR_EPIPOLAR_FACTOR * self.stereo.epipolar_px
        error = reprojection_error(K, pose.R_CM, pose.p_CM, points[known], uv[known])
        good[known] &= error / sizes[1][known] <= _PAIR_EPIPOLAR_FACTOR * self.pose.reprojection_px
        self.counts.lose("pair geometry", ~good)
        return pairs[good]

    def _along_lines(self, first: _StereoFeatures, second: _StereoFeatures, pairs: Index) -> Index:
        """The matches (P, 2) that fit one essential matrix, or none."""
        uv_first, uv_second = first.uv[pairs[:, 0]], second.uv[pairs[:, 1]]
        step = relative_pose(uv_first, uv_second, self.geometry.left.K, self.stereo.epipolar_px)
        if step is None or np.count_nonzero(step[2]) < self.settings.pair_inliers:
            self.counts.lost["pair refused"] += len(pairs)
            return pairs[:0]
        self.counts.lose("pair geometry", ~step[2])
        return pairs[step[2]]


def track_by_descriptors(
    read: Callable[[int, int], Image],
    keyframes: Collection[int],
    geometry: StereoGeometry,
    descriptors: DescriptorSettings,
    stereo: StereoSettings,
    pose: PoseSettings,
) -> tuple[Tracks, TrackingCounts]:
    """Tracks over keyframes; ``read`` gives the raw image of (frame, camera).

    Where a keyframe has fewer than ``descriptors.sure_matches`` matches with every one of those just
    before it, all are matched anew: with more features, and against earlier ones until enough match.

    Raises DataError where two successive keyframes are the same to the last bit: the camera was frozen.
    """
    matcher = DescriptorMatcher(geometry, descriptors, stereo, pose)
    features, matches, weakest = _match(matcher, read, keyframes, descriptors.look_back, 0)
    sure = descriptors.sure_matches
    if weakest < sure:
        matcher = DescriptorMatcher(geometry, descriptors, stereo, pose, wide=True)
        features, matches, _ = _match(matcher, read, keyframes, descriptors.look_back, sure)
    offset = np.cumsum([0] + [len(here.uv) for here in features])
    image = np.repeat(np.arange(len(features)), np.diff(offset))
    joined = np.concatenate(matches) if matches else np.empty((0, 2), dtype=np.int64)
    track, n_tracks, n_conflicting = join_matches(image, joined)
    matcher.counts.lost["conflicting tracks"] = n_conflicting
    observations = []
    for number, here in enumerate(features):
        number_of = track[offset[number] : offset[number + 1]]
        for camera, uv in ((LEFT, here.uv), (RIGHT, here.uv_right)):
            seen = (number_of >= 0) & np.isfinite(uv[:, 0])
            observations.append(image_observations(number, camera, number_of[seen], uv[seen]))
    return concatenate(observations, n_tracks), matcher.counts


def _match(
    matcher: DescriptorMatcher,
    read: Callable[[int, int], Image],
    keyframes: Iterable[int],
    look_back: int,
    sure: int,
) -> tuple[list[_StereoFeatures], list[Index], int]:
    """Features by keyframe; matches by pair, features numbered through; the matches with its best
    partner that the worst keyframe has.

    A keyframe is matched with the ``look_back`` before it, and with those before them until one
    gives ``sure`` matches.
    """
    features: list[_StereoFeatures] = []
    matches: list[Index] = []
    offset, weakest = [0], np.iinfo(np.int64).max
    before: Image | None = None
    for number, frame in enumerate(keyframes):
        left = read(frame, LEFT)
        before = require_change(before, left, frame)
        right = read(frame, RIGHT) if matcher.geometry.is_pair else None
        here = matcher.stereo_features(left, right)
        best = 0
        for earlier in reversed(range(number)):
            if number - earlier > look_back and best >= sure:
                break
            pairs = matcher.verified_matches(features[earlier], here)
            matches.append(pairs + np.array([offset[earlier], offset[number]]))
            best = max(best, len(pairs))
        weakest = min(weakest, best) if number else weakest
        features.append(here)
        offset.append(offset[-1] + len(here.uv))
    return features, matches, int(weakest)
