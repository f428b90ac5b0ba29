"""Frames too far apart: what the camera turns between them, and the spacing that would do."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...geometry.camera import Camera
from .findings import Findings
from .turning import GyroRotation

# Frames share points for certain only where the view turns by less than half of it, and within some seconds.
LONGEST_GAP_S = 5.0
# Share of intervals that may turn further for a spacing to do, and of frames before a recording is refused.
_FAR_SHARE, MOST_FAR_SHARE = 0.05, 0.5
_SPACINGS_S = (5.0, 2.0, 1.0, 0.5, 0.2, 0.1, 0.05)


def check_spacing(t_ns: NDArray[np.int64], camera: Camera, gyro: GyroRotation, out: Findings) -> None:
    """Frames between which the camera turns so far, or so much time passes, that they may share no points."""
    view = 2.0 * np.arctan(min(camera.width / camera.fx, camera.height / camera.fy) / 2.0)
    limit = 0.5 * float(view)

    def turned(first: NDArray[np.int64], second: NDArray[np.int64]) -> np.ndarray:
        z = [(gyro.at(t) @ camera.R_BC)[:, :, 2] for t in (first, second)]
        return np.arccos(np.clip(np.sum(z[0] * z[1], axis=1), -1.0, 1.0))

    gaps = np.diff(t_ns) * 1e-9
    far = (turned(t_ns[:-1], t_ns[1:]) > limit) | (gaps > LONGEST_GAP_S)
    out.fact("cam0", frames_far_apart=int(np.count_nonzero(far)))
    if not np.any(far):
        return
    starts = np.arange(gyro.t_ns[0], gyro.t_ns[-1], 50_000_000)
    enough = (
        s
        for s in _SPACINGS_S
        if len(e := starts[starts + round(s * 1e9) <= gyro.t_ns[-1]])
        and np.mean(turned(e, e + round(s * 1e9)) > limit) <= _FAR_SHARE
    )
    k = int(np.argmax(far))
    most = np.mean(far) > MOST_FAR_SHARE
    (out.error if most else out.warn)(
        "frame spacing",
        f"{np.count_nonzero(far)} of {len(gaps)} neighbouring frames are too far apart to share points "
        f"(first {gaps[k]:.3g} s after {t_ns[k]} ns; limits: {LONGEST_GAP_S:g} s, {np.degrees(limit):.0f} "
        f"deg, half of the view): with this motion a frame every {next(enough, _SPACINGS_S[-1]):g} s would do"
        + ("" if most else "; choose a window without them"),
    )
