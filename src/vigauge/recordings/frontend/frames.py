"""Which frames of a sequence the front-end looks at, and which of them are keyframes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...errors import DataError
from ..asl.images import read_image
from ..asl.sequence import Sequence, StereoFrames
from .keyframes import select_keyframes
from .settings import FrontEndSettings
from .stereo import Image


def require_change(before: Image | None, image: Image, frame: int) -> Image:
    """``image`` itself; DataError where it equals the one ``before`` to the last bit: the camera hung."""
    if before is not None and np.array_equal(before, image):
        raise DataError("frames", "successive images must differ (frozen camera)", row=frame, field="cam0")
    return image


def choose_frames(
    sequence: Sequence, settings: FrontEndSettings
) -> tuple[Sequence, NDArray[np.int64], dict[str, int]]:
    """The sequence by the inertial clock and without frames of no use, its keyframes (N,), and
    how many frames of the window were skipped, by reason.

    Of the frames that the tracker looks at, those without contrast in either camera (covered,
    dark, blinded) are left out, and keyframes are chosen anew among the others.

    Raises DataError where more frames would have to be skipped than the settings allow, or too few are left.
    """
    frames = sequence.frames
    usable = np.ones(len(frames.t_ns), dtype=bool)
    judged: dict[int, bool] = {}
    while True:
        rows = np.flatnonzero(usable)
        keyframes = select_keyframes(frames.t_ns[rows], settings.keyframes)
        last = int(keyframes[-1])
        looked_at = keyframes if settings.tracker == "descriptors" else np.arange(keyframes[0], last + 1)
        for row in rows[looked_at].tolist():
            if row not in judged:
                judged[row] = _contrast(sequence, row) >= settings.keyframes.least_contrast
        poor = [row for row in rows[looked_at].tolist() if not judged[row]]
        begin, end = int(frames.t_ns[rows[keyframes[0]]]), int(frames.t_ns[rows[last]])
        skipped = {
            "no right image": int(np.count_nonzero((frames.dropped_ns > begin) & (frames.dropped_ns < end))),
            "no contrast": len(poor) + int(np.count_nonzero(~usable)),
        }
        _require_few(skipped, settings.keyframes.most_skipped, begin, end)
        if not poor:
            return replace(sequence, frames=_used(frames, rows, settings)), keyframes, skipped
        usable[poor] = False


def _used(frames: StereoFrames, rows: NDArray[np.intp], settings: FrontEndSettings) -> StereoFrames:
    """The frames of some rows, by the clock of the inertial sensor."""
    left, right = (tuple(paths[k] for k in rows) if paths else () for paths in (frames.left, frames.right))
    t_ns, dropped_ns = (t + settings.camera_time_offset_ns for t in (frames.t_ns[rows], frames.dropped_ns))
    return replace(frames, t_ns=t_ns, left=left, right=right, dropped_ns=dropped_ns)


def _contrast(sequence: Sequence, row: int) -> float:
    """Deviation of the grey levels of the flatter image of a frame."""
    paths = [paths[row] for paths in (sequence.frames.left, sequence.frames.right) if paths]
    images = map(read_image, paths, sequence.cameras)
    return min(float(image.std()) for image in images)


def _require_few(skipped: dict[str, int], most: int, begin_ns: int, end_ns: int) -> None:
    if sum(skipped.values()) > most:
        reasons = ", ".join(f"{n} with {reason}" for reason, n in skipped.items() if n)
        rule = f"at most {most} frames between {begin_ns} and {end_ns} ns may be skipped ({reasons})"
        raise DataError("frames", rule, field="keyframes.most_skipped", value=sum(skipped.values()))
