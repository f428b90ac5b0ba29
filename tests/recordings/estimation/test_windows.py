"""Which windows are proposed for recordings with gaps and rests."""

from dataclasses import replace

import numpy as np
import pytest

from vigauge.errors import DataError
from vigauge.model.imu import ImuSamples
from vigauge.recordings.asl.sequence import Sequence
from vigauge.recordings.estimation.windows import best, part_of, propose, tracking


def recording(sequence: Sequence, seconds: np.ndarray, rests: tuple[float, float]) -> Sequence:
    """Frames at these times, samples at 200 Hz that move but for a rest."""
    start = 10**18
    t_ns = start + np.round(seconds * 1e9).astype(np.int64)
    t = np.arange(-0.5, seconds[-1] + 0.5, 0.005)
    moves = ((t < rests[0]) | (t > rests[1]))[:, None]
    gyro = moves * np.sin(7.0 * t[:, None] + np.arange(3))
    accel = np.array([0.0, 0.0, 9.81]) + moves * np.cos(9.0 * t[:, None] + np.arange(3))
    paths = (sequence.frames.left[0],) * len(t_ns)
    frames = replace(sequence.frames, t_ns=t_ns, left=paths, right=paths)
    samples = ImuSamples(start + np.round(t * 1e9).astype(np.int64), gyro, accel)
    return replace(sequence, frames=frames, imu=samples)


def test_parts_end_at_gaps_and_long_ones_are_cut(rendered) -> None:
    """A window across a gap, where no landmark is seen on both sides, or of half an hour."""
    seconds = np.concatenate([np.arange(0.0, 4.0, 0.1), np.arange(60.0, 100.0, 0.1), [120.0]])
    parts = propose(recording(rendered.sequence, seconds, (-1.0, -1.0)))
    edges = [(part.start_s, part.end_s) for part in parts]
    np.testing.assert_allclose(edges, [(0.0, 3.9), (60.0, 73.3), (73.3, 86.6), (86.6, 99.9)], atol=0.11)
    assert all(part.moves for part in parts)


def test_the_part_that_moves_longest_is_chosen(rendered) -> None:
    """A window in which the vehicle stands before its take-off."""
    sequence = recording(rendered.sequence, np.arange(0.0, 30.0, 0.1), (0.0, 14.0))
    parts = propose(sequence)
    assert [part.moves for part in parts] == [False, True]
    assert best(parts) == parts[1]


def test_too_short_a_window_says_what_the_recording_has(rendered) -> None:
    sequence = recording(rendered.sequence, np.arange(0.0, 30.0, 0.1), (-1.0, -1.0))
    with pytest.raises(
        DataError, match=r"window too short: 2 to 2.5 s .* the recording has 300 over 29.90 s"
    ):
        part_of(sequence, 2.0, 2.5)
    short = recording(rendered.sequence, np.arange(0.0, 0.5, 0.1), (-1.0, -1.0))
    with pytest.raises(DataError, match="window too short"):
        propose(short)


@pytest.mark.parametrize(("spacing_s", "tracker"), [(0.05, "optical_flow"), (0.5, "descriptors")])
def test_sparse_frames_are_matched_and_dense_ones_followed(rendered, spacing_s: float, tracker: str) -> None:
    """Optical flow across half a second, which loses every point."""
    sequence = recording(rendered.sequence, np.arange(0.0, 15.0, spacing_s), (-1.0, -1.0))
    part = part_of(sequence, 0.0, 15.0)
    assert tracking(sequence, part, None) == (tracker, 30)
    assert tracking(sequence, part, 7, "descriptors") == ("descriptors", 7)
    with pytest.raises(DataError, match="must be from 5 to"):
        tracking(sequence, part, 4)
    with pytest.raises(DataError, match="must be from 5 to"):
        tracking(sequence, part, part.frames + 1)
