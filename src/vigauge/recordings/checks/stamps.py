"""Rates, spans and gaps of the sensors, and whether their stamps can be nanoseconds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..asl.sequence import StereoFrames
from .findings import Findings

# Inertial sensors of estimators run at 50 to 2000 Hz, cameras at 0.1 to 200 Hz (0.1 for keyframes);
# between a unit of time and the next lies a factor of a thousand, so these need not be sharp.
IMU_RATE_HZ, CAMERA_RATE_HZ = (50.0, 2000.0), (0.1, 200.0)
# A gap of this many median periods lost several samples: one lost sample is integrated well enough.
GAP_PERIODS = 4.0
# sensor.yaml states the nominal rate; clocks and dropped samples explain a tenth.
RATE_TOLERANCE = 0.1
# Single periods say little where stamps are those of arrival, in bursts: so many are averaged, a number that
# short patterns divide.
_AVERAGED = 12
# A burst: more than this share of a second's spacings are shorter than so many periods.
_SHORT_PERIODS, _BURST_SHARE = 0.6, 0.25
_UNITS = ((1e3, "microseconds"), (1e6, "milliseconds"), (1e9, "seconds"))


def mean_period_ns(t_ns: NDArray[np.int64]) -> float:
    """Median of means of a dozen periods, ns, which neither gaps nor bursts change; NaN for one stamp."""
    n = min(_AVERAGED, len(t_ns) - 1)
    return float(np.median(t_ns[n:] - t_ns[:-n])) / n if n > 0 else float("nan")


def check_rate(
    name: str, t_ns: NDArray[np.int64], allowed: tuple[float, float], stated: object, out: Findings
) -> bool:
    """Facts on one sensor's stamps; an error, and False, where only another unit of time explains its rate.

    ``allowed`` range of rates, Hz; ``stated`` the rate in ``sensor.yaml``, or whatever stands there.
    """
    measured = 1e9 / mean_period_ns(t_ns)
    span = float(t_ns[-1] - t_ns[0]) * 1e-9
    largest = float(np.max(np.diff(t_ns), initial=0)) * 1e-9
    out.fact(name, rows=len(t_ns), rate_hz=measured, span_s=span, largest_gap_s=largest)
    if np.isnan(measured):
        out.error("rate", f"{name} has one sample only")
        return False
    if not allowed[0] <= measured <= allowed[1]:
        unit = next((u for f, u in _UNITS if allowed[0] <= measured / f <= allowed[1]), None)
        hint = f"; the stamps look like {unit}" if unit else ""
        out.error(
            "rate",
            f"{name} runs at {measured:.4g} Hz if its stamps are nanoseconds, "
            f"expected {allowed[0]:g} to {allowed[1]:g} Hz{hint}",
        )
    elif isinstance(stated, (int, float)) and stated > 0 and abs(measured / stated - 1.0) > RATE_TOLERANCE:
        out.warn("rate", f"{name} runs at {measured:.4g} Hz, its sensor.yaml says {stated:g} Hz")
    return allowed[0] <= measured <= allowed[1]


def check_imu_gaps(t_ns: NDArray[np.int64], first_ns: int, last_ns: int, out: Findings) -> None:
    """Samples missing between the first and the last frame: what was not measured cannot be integrated."""
    period = mean_period_ns(t_ns)
    begin = max(int(np.searchsorted(t_ns, first_ns, side="right")) - 1, 0)
    end = int(np.searchsorted(t_ns, last_ns, side="left")) + 1
    gaps = np.diff(t_ns[begin:end])
    wide = np.flatnonzero(gaps > GAP_PERIODS * period)
    out.fact("imu0", gaps=len(wide))
    if len(wide):
        k = begin + int(wide[0])
        out.error(
            "imu gap",
            f"imu0 has {len(wide)} gap(s) of more than {GAP_PERIODS:g} periods; the first follows "
            f"{t_ns[k]} ns and is {gaps[wide[0]] * 1e-9:.4g} s long: no interval between "
            "keyframes may span it, choose a "
            "window without it",
        )


def check_bursts(t_ns: NDArray[np.int64], out: Findings) -> None:
    """Spacings far below the mean period, second by second: stamps of arrival, not of measurement."""
    period = mean_period_ns(t_ns)
    length = max(round(1e9 / period), 1)
    short = np.diff(t_ns) < _SHORT_PERIODS * period
    shares = [float(np.mean(short[k : k + length])) for k in range(0, len(short), length)]
    bursts = [k for k, share in enumerate(shares) if share > _BURST_SHARE]
    out.fact("imu0", burst_seconds=len(bursts))
    if bursts:
        k = bursts[0] * length
        spacings = np.diff(t_ns)[k : k + length] * 1e-6
        out.warn(
            "imu bursts",
            f"the samples of imu0 come in bursts in {len(bursts)} of {len(shares)} s, first after "
            f"{t_ns[k]} ns: {spacings.min():.3g} to {spacings.max():.3g} ms apart, "
            f"{period * 1e-6:.3g} ms in the mean. These are times of arrival: stamp samples where they are "
            "measured, or space them evenly",
        )


def check_coverage(name: str, t_ns: NDArray[np.int64], frames_ns: NDArray[np.int64], out: Findings) -> None:
    """Frames that lie outside the record of another sensor."""
    outside = int(np.count_nonzero((frames_ns < t_ns[0]) | (frames_ns > t_ns[-1])))
    out.fact(name, frames_outside=outside)
    if outside == len(frames_ns):
        out.error(
            "coverage",
            f"{name} ({t_ns[0]}..{t_ns[-1]} ns) and the frames ({frames_ns[0]}..{frames_ns[-1]} ns) "
            "share no time: their clocks or units differ",
        )
    elif outside:
        out.warn("coverage", f"{outside} of {len(frames_ns)} frames lie outside the record of {name}")


def check_partners(frames: StereoFrames, first_ns: int, last_ns: int, out: Findings) -> None:
    """Left frames without a right one, where there are two cameras."""
    if not frames.right:
        return
    inside = (frames.dropped_ns >= first_ns) & (frames.dropped_ns <= last_ns)
    missing = frames.dropped_ns[inside]
    out.fact("cam1", missing_frames=len(missing))
    if len(missing):
        out.warn(
            "missing frame",
            f"{len(missing)} frame(s) of cam0 have no frame of cam1 and are skipped; the first is "
            f"{missing[0]} ns",
        )
