"""Descriptor matching: the matching rule by itself, and pairs of views of a known scene."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vigauge.geometry import so3
from vigauge.recordings.asl.images import read_image
from vigauge.recordings.frontend.descriptor_matching import (
    DescriptorMatcher,
    mutual_matches,
    squared_distances,
    track_by_descriptors,
)
from vigauge.recordings.frontend.settings import DescriptorSettings, PoseSettings, StereoSettings
from vigauge.recordings.frontend.stereo import StereoGeometry, epipolar_distance
from vigauge.recordings.frontend.tracks import LEFT, Tracks
from vigauge_paper.stand_in.flight import euroc_cameras

GEOMETRY = StereoGeometry(*euroc_cameras())


def plain_matches(squared: np.ndarray, ratio: float) -> set[tuple[int, int]]:
    """The rule, pair by pair."""
    found = set()
    for i, row in enumerate(squared):
        for j in range(squared.shape[1]):
            others_i, others_j = np.delete(row, j), np.delete(squared[:, j], i)
            best = squared[i, j]
            if not np.isfinite(best) or np.any(others_i < best) or np.any(others_j < best):
                continue
            if np.all(best <= ratio**2 * others_i) and np.all(best <= ratio**2 * others_j):
                found.add((i, j))
    return found


@given(st.integers(0, 10_000), st.integers(1, 7), st.integers(1, 7), st.floats(0.3, 0.95))
def test_matches_obey_the_rule(seed: int, n: int, m: int, ratio: float) -> None:
    """The ratio taken of squares, or tested one way only."""
    rng = np.random.default_rng(seed)
    squared = rng.uniform(0.0, 100.0, (n, m)) ** 2
    squared[rng.random((n, m)) < 0.3] = np.inf
    pairs = mutual_matches(squared, ratio)
    assert {tuple(p) for p in pairs.tolist()} == plain_matches(squared, ratio)


def test_nothing_matches_nothing() -> None:
    """An image without features ends in an index error."""
    for shape in ((0, 5), (5, 0), (0, 0)):
        assert mutual_matches(np.zeros(shape), 0.8).shape == (0, 2)


def test_squared_distances_are_exact() -> None:
    """Rounding that depends on the order of summation: another machine, other matches."""
    rng = np.random.default_rng(0)
    first, second = (rng.integers(0, 256, (n, 128)).astype(np.float32) for n in (30, 40))
    whole = first.astype(np.int64)[:, None] - second.astype(np.int64)[None]
    np.testing.assert_array_equal(squared_distances(first, second), np.sum(whole**2, axis=2))


def matcher() -> DescriptorMatcher:
    return DescriptorMatcher(GEOMETRY, DescriptorSettings(), StereoSettings(), PoseSettings())


def test_blank_images_give_no_features() -> None:
    """SIFT's None for "no descriptors" taken for an array."""
    grey = np.full((480, 752), 90, np.uint8)
    features = matcher().stereo_features(grey, grey)
    assert features.uv.shape == (0, 2)
    other = matcher().stereo_features(grey, grey)
    assert len(matcher().verified_matches(features, other)) == 0


def test_thin_matches_are_widened(rendered, monkeypatch: pytest.MonkeyPatch) -> None:
    """Keyframes far apart end a sequence although more features, on lines alone, join them."""
    frames, images = rendered.sequence.frames, (0, 15, 30)
    paths = (frames.left, frames.right)

    pairs: list[bool] = []
    verified_matches = DescriptorMatcher.verified_matches

    def counted(matcher: DescriptorMatcher, *of: Any) -> Any:
        pairs.append(matcher.wide)
        return verified_matches(matcher, *of)

    monkeypatch.setattr(DescriptorMatcher, "verified_matches", counted)

    def tracks(sure: int) -> Tracks:
        settings = DescriptorSettings(features=150, look_back=1, sure_matches=sure)
        found, _ = track_by_descriptors(
            lambda frame, camera: read_image(paths[camera][frame], rendered.sequence.cameras[camera]),
            images,
            GEOMETRY,
            settings,
            StereoSettings(),
            PoseSettings(),
        )
        return found

    thin, wide = tracks(0), tracks(20_000)
    # Then every keyframe with all before it, not just with the one before.
    assert pairs.count(False) == 2 + 2 and pairs.count(True) == 3
    assert np.sum(wide.keyframes_per_track() > 1) > 1.5 * np.sum(thin.keyframes_per_track() > 1)
    again = tracks(20_000)
    np.testing.assert_array_equal(again.uv, wide.uv)
    # The tracks fit the exact motion, except for a few that slid along their line.
    first, last = (wide.seen_at(k, LEFT) for k in (0, 2))
    track, a, b = np.intersect1d(first[1], last[1], return_indices=True)
    (R_1, p_1), (R_2, p_2) = (rendered.exact.pose(int(frames.t_ns[images[k]])) for k in (0, 2))
    camera = GEOMETRY.left
    R_CW = (R_2 @ camera.R_BC).T
    R_21 = R_CW @ R_1 @ camera.R_BC
    p_21 = R_CW @ (p_1 + R_1 @ camera.p_BC - p_2 - R_2 @ camera.p_BC)
    inverse = np.linalg.inv(camera.K)
    distance = epipolar_distance(inverse.T @ so3.hat(p_21) @ R_21 @ inverse, first[2][a], last[2][b])
    assert len(track) > 10 and np.mean(distance < 3.0) > 0.9
