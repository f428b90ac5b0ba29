"""Tracks: joining matches, counting, renumbering."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from vigauge.recordings.frontend.tracks import (
    LEFT,
    RIGHT,
    Tracks,
    concatenate,
    image_observations,
    join_matches,
)


def test_matches_join_through_a_chain() -> None:
    """A track cut in two where its ends were never matched directly."""
    image = np.array([0, 0, 1, 1, 2, 2])
    number, n_tracks, refused = join_matches(image, np.array([[0, 2], [2, 4], [3, 5]]))
    assert n_tracks == 2 and refused == 0
    assert number[0] == number[2] == number[4] != number[3] == number[5]
    assert number[1] == -1


def test_component_with_two_features_of_an_image_is_refused() -> None:
    """Two points of the scene run together in one track by a wrong match."""
    image = np.array([0, 0, 1, 2, 0, 1])
    number, n_tracks, refused = join_matches(image, np.array([[0, 2], [2, 3], [3, 1], [4, 5]]))
    assert (n_tracks, refused) == (1, 1)
    np.testing.assert_array_equal(number, [-1, -1, -1, -1, 0, 0])


def test_no_matches_give_no_tracks() -> None:
    """An error, or tracks of one view, where nothing was matched."""
    number, n_tracks, refused = join_matches(np.array([0, 1]), np.empty((0, 2), dtype=np.int64))
    assert (n_tracks, refused) == (0, 0) and np.all(number == -1)


observations = st.sets(
    st.tuples(st.integers(0, 4), st.integers(0, 1), st.integers(0, 5)), min_size=1, max_size=40
)


def tracks_of(rows: set[tuple[int, int, int]]) -> Tracks:
    table = np.array(sorted(rows))
    return Tracks(table[:, 0], table[:, 1], table[:, 2], table.astype(float) @ np.ones((3, 2)), 6)


@given(observations)
def test_counts_agree_with_plain_counting(rows: set[tuple[int, int, int]]) -> None:
    """A stereo pair counted as two keyframes: a landmark with no motion parallax would pass."""
    tracks = tracks_of(rows)
    expected = [len({k for k, _, t in rows if t == track}) for track in range(6)]
    np.testing.assert_array_equal(tracks.keyframes_per_track(), expected)
    left = [len([t for k, c, t in rows if k == keyframe and c == LEFT]) for keyframe in range(5)]
    np.testing.assert_array_equal(tracks.tracks_per_keyframe(5), left)


@given(observations, st.lists(st.booleans(), min_size=6, max_size=6))
def test_renumbering_keeps_order_and_pixels(rows: set[tuple[int, int, int]], keep: list[bool]) -> None:
    """Pixels that end up with another landmark's number."""
    tracks = tracks_of(rows)
    kept = tracks.renumbered(np.array(keep))
    old = np.flatnonzero(keep)
    assert kept.n_tracks == len(old)
    got = {(k, c, int(old[t])): tuple(uv) for k, c, t, uv in zip(*columns(kept), strict=True)}
    expected = {(k, c, t): tuple(uv) for k, c, t, uv in zip(*columns(tracks), strict=True) if keep[t]}
    assert got == expected


def columns(tracks: Tracks) -> tuple:
    return tracks.keyframe.tolist(), tracks.camera.tolist(), tracks.track.tolist(), tracks.uv.tolist()


def test_concatenation_orders_by_track_keyframe_camera() -> None:
    """Observations out of order: triangulation splits them into groups where the track changes."""
    parts = [
        image_observations(1, LEFT, np.array([3, 1]), np.array([[3.0, 1.0], [1.0, 1.0]])),
        image_observations(0, RIGHT, np.array([3]), np.array([[3.0, 0.5]])),
        image_observations(0, LEFT, np.array([3, 0]), np.array([[3.0, 0.0], [0.0, 0.0]])),
    ]
    joined = concatenate(parts, 4)
    np.testing.assert_array_equal(joined.track, [0, 1, 3, 3, 3])
    np.testing.assert_array_equal(joined.uv[:, 1], [0.0, 1.0, 0.0, 0.5, 1.0])
    rows, track, uv = joined.seen_at(1, LEFT)
    np.testing.assert_array_equal(rows, [1, 4])
    np.testing.assert_array_equal(track, uv[:, 0])
