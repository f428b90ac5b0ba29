"""Which parts of a recording can be estimated, each in one go."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...errors import DataError
from ...model.imu import ImuSamples
from ..asl.sequence import Sequence
from ..checks.inertial import find_rest

# Landmarks are lost over a longer time without frames.
_LARGEST_FRAME_GAP_S = 3.0
# Longer parts are cut: thirty keyframes then stay half a second apart.
LONGEST_S, MOST_KEYFRAMES, _SPACING_S = 15.0, 30, 0.3
# Fewer do not tell biases, gravity and velocities apart.
LEAST_S, LEAST_KEYFRAMES = 1.0, 5
# Optical flow needs overlapping frames a twentieth of a second apart.
_FLOW_PERIOD_S = 0.1
# A part in which less moves is not worth a window of its own.
LEAST_MOVING_SHARE = 0.5


@dataclass(frozen=True)
class Part:
    """Part of a recording: seconds after the first frame, number of frames, seconds in which it moves."""

    start_s: float
    end_s: float
    frames: int
    moving_s: float

    @property
    def moves(self) -> bool:
        """Whether it is worth a window."""
        return self.moving_s >= LEAST_MOVING_SHARE * (self.end_s - self.start_s)

    def __str__(self) -> str:
        return f"{self.start_s:.2f} to {self.end_s:.2f} s"


def frame_seconds(sequence: Sequence) -> NDArray[np.float64]:
    """(F,) seconds of the frames after the first one."""
    seconds: NDArray[np.float64] = (sequence.frames.t_ns - sequence.frames.t_ns[0]) * 1e-9
    return seconds


def part_of(sequence: Sequence, start_s: float, end_s: float, offset_ns: int = 0) -> Part:
    """The part between two times. ``offset_ns``: added to stamps of frames to get the inertial clock.

    Raises DataError where it is too short, or has too few frames, for an estimate.
    """
    seconds = frame_seconds(sequence)
    inside = seconds[(seconds >= start_s) & (seconds <= end_s)]
    length = float(inside[-1] - inside[0]) if len(inside) else 0.0
    if len(inside) < LEAST_KEYFRAMES or length < LEAST_S:
        rule = (
            f"window too short: {start_s:g} to {end_s:g} s has {len(inside)} frames over "
            f"{length:.2f} s; {LEAST_KEYFRAMES} over {LEAST_S:g} s are needed, and the recording has "
            f"{len(seconds)} over {seconds[-1]:.2f} s"
        )
        raise DataError(sequence.folder, rule)
    imu = sequence.imu
    origin = int(sequence.frames.t_ns[0]) + offset_ns
    rows = slice(*np.searchsorted(imu.t_ns, origin + (inside[[0, -1]] * 1e9).astype(np.int64)))
    samples = ImuSamples(imu.t_ns[rows], imu.gyro[rows], imu.accel[rows])
    rest = find_rest(samples).share if len(samples.t_ns) > 1 else 0.0
    return Part(float(inside[0]), float(inside[-1]), len(inside), (1.0 - rest) * length)


def propose(sequence: Sequence, offset_ns: int = 0) -> list[Part]:
    """The parts of a recording that can be estimated, in order of time.

    Frames that are seconds apart share no landmarks, so a part ends there. Long ones are cut into equal ones.

    Raises DataError where there is none.
    """
    seconds = frame_seconds(sequence)
    parts = []
    for run in np.split(seconds, np.flatnonzero(np.diff(seconds) > _LARGEST_FRAME_GAP_S) + 1):
        pieces = max(int(np.ceil((run[-1] - run[0]) / LONGEST_S)), 1)
        edges = np.linspace(run[0], run[-1], pieces + 1)
        for start, end in zip(edges[:-1], edges[1:], strict=True):
            try:
                parts.append(part_of(sequence, float(start), float(end), offset_ns))
            except DataError:
                continue
    if not parts:
        # Says what the whole recording has.
        return [part_of(sequence, 0.0, float(seconds[-1]), offset_ns)]
    return parts


def best(parts: list[Part]) -> Part:
    """The part that moves for the longest time; of equals the first."""
    return max(parts, key=lambda part: part.moving_s)


def tracking(
    sequence: Sequence, part: Part, keyframes: int | None, tracker: str | None = None
) -> tuple[str, int]:
    """How points of a part are followed, and its number of keyframes: what is asked for, or what fits.

    Raises DataError for a number that it does not have frames for, or that is too small.
    """
    seconds = frame_seconds(sequence)
    inside = seconds[(seconds >= part.start_s) & (seconds <= part.end_s)]
    if tracker is None:
        dense = float(np.median(np.diff(inside))) <= _FLOW_PERIOD_S
        tracker = "optical_flow" if dense else "descriptors"
    if keyframes is None:
        wanted = round((part.end_s - part.start_s) / _SPACING_S) + 1
        keyframes = min(max(wanted, LEAST_KEYFRAMES), MOST_KEYFRAMES, part.frames)
    if not LEAST_KEYFRAMES <= keyframes <= part.frames:
        rule = f"must be from {LEAST_KEYFRAMES} to {part.frames}, the frames of {part}"
        raise DataError("keyframes", rule, value=keyframes)
    return tracker, keyframes
