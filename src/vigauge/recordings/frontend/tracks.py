"""Tracks: which point of the scene was seen at which pixel in which keyframe and camera."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ...geometry.so3 import Array

Index = NDArray[np.int64]
LEFT, RIGHT = 0, 1


@dataclass(frozen=True)
class Tracks:
    """M observations of tracks."""

    # (M,) indices; a track has at most one observation a keyframe and camera.
    keyframe: Index
    camera: Index
    track: Index
    uv: Array  # (M, 2) ideal (undistorted) pixels
    n_tracks: int  # tracks are numbered 0..n_tracks - 1; some may have no observation left

    def where(self, keep: NDArray[np.bool_]) -> Tracks:
        """The observations where ``keep`` (M,) holds; track numbers stay."""
        return replace(
            self,
            keyframe=self.keyframe[keep],
            camera=self.camera[keep],
            track=self.track[keep],
            uv=self.uv[keep],
        )

    def of_tracks(self, keep: NDArray[np.bool_]) -> Tracks:
        """The observations of the tracks where ``keep`` (n_tracks,) holds; track numbers stay."""
        return self.where(keep[self.track])

    def renumbered(self, keep: NDArray[np.bool_]) -> Tracks:
        """The observations of the tracks where ``keep`` (n_tracks,) holds, numbered 0.. in the same order."""
        kept = self.of_tracks(keep)
        number = np.cumsum(keep) - 1
        return replace(kept, track=number[kept.track], n_tracks=int(np.count_nonzero(keep)))

    def keyframes_per_track(self) -> Index:
        """(n_tracks,) number of keyframes that see each track, in either camera."""
        n_keyframes = int(self.keyframe.max(initial=-1)) + 1
        pairs = np.unique(self.track * n_keyframes + self.keyframe) if n_keyframes else self.track
        return np.bincount(pairs // max(n_keyframes, 1), minlength=self.n_tracks)

    def tracks_per_keyframe(self, n_keyframes: int) -> Index:
        """(n_keyframes,) number of tracks that each keyframe sees in the left camera."""
        return np.bincount(self.keyframe[self.camera == LEFT], minlength=n_keyframes)

    def seen_at(self, keyframe: int, camera: int) -> tuple[Index, Index, Array]:
        """Rows (m,), track numbers (m,) and pixels (m, 2) of one image."""
        rows = np.flatnonzero((self.keyframe == keyframe) & (self.camera == camera))
        return rows, self.track[rows], self.uv[rows]


@dataclass
class TrackingCounts:
    """``stereo_tried`` and ``stereo_matched`` left points over all keyframes; points or matches ``lost``."""

    lost: dict[str, int]
    stereo_tried: int = 0
    stereo_matched: int = 0

    def lose(self, reason: str, which: NDArray[np.bool_]) -> None:
        """Count those where ``which`` holds."""
        self.lost[reason] += int(np.count_nonzero(which))


def concatenate(parts: list[Tracks], n_tracks: int) -> Tracks:
    """All observations of ``parts``, ordered by track, keyframe and camera."""
    keyframe = np.concatenate([p.keyframe for p in parts])
    camera = np.concatenate([p.camera for p in parts])
    track = np.concatenate([p.track for p in parts])
    uv = np.concatenate([p.uv for p in parts])
    order = np.lexsort((camera, keyframe, track))
    return Tracks(keyframe[order], camera[order], track[order], uv[order], n_tracks)


def image_observations(keyframe: int, camera: int, track: Index, uv: Array) -> Tracks:
    """Observations of one image; ``track`` (m,) and ``uv`` (m, 2)."""
    m = len(track)
    return Tracks(
        keyframe=np.full(m, keyframe, dtype=np.int64),
        camera=np.full(m, camera, dtype=np.int64),
        track=np.asarray(track, dtype=np.int64),
        uv=np.asarray(uv, dtype=float).reshape(m, 2),
        n_tracks=int(np.max(track, initial=-1)) + 1,
    )


def join_matches(image_of_feature: Index, matches: Index) -> tuple[Index, int, int]:
    """Tracks as the connected components of a match graph.

    Parameters
    ----------
    image_of_feature : (F,) image that each feature belongs to
    matches : (P, 2) pairs of features

    Returns
    -------
    (F,) track number of each feature, -1 for features in no consistent track; the number of
    tracks; and the number of components refused because two features of one image are in them.
    """
    n = len(image_of_feature)
    ones = np.ones(len(matches), dtype=np.int8)
    graph = coo_array((ones, (matches[:, 0], matches[:, 1])), shape=(n, n))
    n_components, component = connected_components(graph, directed=False)
    component = component.astype(np.int64)
    n_images = int(image_of_feature.max(initial=0)) + 1
    seen, first, count = np.unique(
        component * n_images + image_of_feature, return_index=True, return_counts=True
    )
    conflicting = np.zeros(n_components, dtype=bool)
    conflicting[component[first[count > 1]]] = True
    size = np.bincount(component, minlength=n_components)
    good = (size > 1) & ~conflicting
    number = np.where(good, np.cumsum(good) - 1, -1)
    return number[component], int(np.count_nonzero(good)), int(np.count_nonzero(conflicting))
