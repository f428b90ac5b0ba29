"""Choice of keyframes."""

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vigauge.errors import DataError
from vigauge.recordings.frontend.keyframes import select_keyframes
from vigauge.recordings.frontend.settings import KeyframeSettings

START_NS = 1403636584763555584


def stamps(seconds: list[float] | np.ndarray) -> np.ndarray:
    return START_NS + np.rint(np.asarray(seconds) * 1e9).astype(np.int64)


def test_dense_frames_give_even_keyframes_from_first_to_last() -> None:
    """Keyframes that bunch up at one end, or do not fill the window."""
    chosen = select_keyframes(stamps(np.arange(170) * 0.05), KeyframeSettings(count=30))
    assert len(chosen) == 30 and chosen[0] == 0 and chosen[-1] == 169
    assert set(np.diff(chosen)) == {5, 6}


def test_sparse_frames_lose_their_near_duplicates() -> None:
    """Of keyframes 0.05 s apart all kept, and a far one dropped, which would break the tracks."""
    seconds = [0.0, 1.0, 2.0, 2.05, 2.1, 3.0, 4.5]
    chosen = select_keyframes(stamps(seconds), KeyframeSettings(count=5))
    kept = [seconds[k] for k in chosen]
    assert kept in ([0.0, 1.0, 2.0, 3.0, 4.5], [0.0, 1.0, 2.05, 3.0, 4.5])


@given(st.lists(st.integers(1, 50), min_size=4, max_size=8), st.integers(2, 5))
def test_even_choice_is_the_best_of_all(gaps: list[int], count: int) -> None:
    """A slip in the dynamic programme: compared with trying every subset."""
    seconds = np.cumsum([0, *gaps]) * 0.05
    if count > len(seconds):
        return
    chosen = select_keyframes(stamps(seconds), KeyframeSettings(count=count))
    between = combinations(range(1, len(seconds) - 1), count - 2)
    best = min(np.sum(np.diff(seconds[[0, *middle, len(seconds) - 1]]) ** 2) for middle in between)
    assert len(chosen) == count
    assert np.sum(np.diff(seconds[chosen]) ** 2) == pytest.approx(best, rel=1e-9)


def test_spacing_takes_frames_that_far_apart() -> None:
    """Spacing equal to a multiple of the period, missed by a rounded stamp."""
    t_ns = stamps(np.arange(40) * 0.05)
    t_ns[6::6] -= 128  # as EuRoC's stamps are
    chosen = select_keyframes(t_ns, KeyframeSettings(count=0, spacing_s=0.3))
    np.testing.assert_array_equal(chosen, np.arange(0, 40, 6))


def test_window_counts_from_the_origin() -> None:
    """A window that moves when the folder begins later than the published sequence."""
    t_ns = stamps(np.arange(20) * 0.1)
    from_first = select_keyframes(t_ns, KeyframeSettings(window_start_s=1.0, window_end_s=1.5, count=6))
    np.testing.assert_array_equal(from_first, np.arange(10, 16))
    settings = KeyframeSettings(
        window_origin_ns=START_NS - 1_000_000_000, window_start_s=1.0, window_end_s=1.5, count=6
    )
    np.testing.assert_array_equal(select_keyframes(t_ns, settings), np.arange(6))


@pytest.mark.parametrize(
    "settings",
    [
        KeyframeSettings(count=30),
        KeyframeSettings(window_start_s=1.85, count=0, spacing_s=0.2),
        KeyframeSettings(count=0, spacing_s=50.0),
    ],
)
def test_too_few_frames_are_an_error(settings: KeyframeSettings) -> None:
    """Fewer keyframes than asked for, taken without a word."""
    with pytest.raises(DataError, match="must"):
        select_keyframes(stamps(np.arange(20) * 0.1), settings)


def test_long_windows_are_chosen_from_in_bounded_memory() -> None:
    """A table of frames times frames: gigabytes for a quarter of an hour of video."""
    t_ns = 10**18 + 50_000_000 * np.arange(20_000, dtype=np.int64)
    chosen = select_keyframes(t_ns, KeyframeSettings(count=30))
    assert len(chosen) == 30
    assert chosen[0] == 0 and chosen[-1] == len(t_ns) - 1
    gaps = np.diff(chosen)
    assert gaps.max() <= 1.1 * gaps.min()


def test_sparse_frames_of_a_long_window_are_still_enough() -> None:
    """Fewer candidates than keyframes after the selection, where frames come in bursts."""
    bursts = np.append(np.arange(3000) * 50_000_000, 10**14)
    chosen = select_keyframes(10**18 + bursts.astype(np.int64), KeyframeSettings(count=30, window_end_s=1e6))
    assert len(np.unique(chosen)) == 30
