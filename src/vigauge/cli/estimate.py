"""Estimate motion, biases and covariance from a recording in ASL layout, without ground truth.

Exit status: 0 nothing odd found, 1 warnings, 2 refused: one sentence says why, and nothing is written.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from vigauge.cli.command import EXIT_DEFECT, LOG, parser, run
from vigauge.cli.names import gauge_of, loss_of
from vigauge.errors import DataError, VigaugeError
from vigauge.recordings.estimation.estimate import Estimate, estimate, proposed_parts
from vigauge.recordings.estimation.folder import lines, require_free, write_estimates

EXIT_WARNINGS = 1


def work(options: argparse.Namespace) -> None:
    target = options.out or Path(f"{options.folder.resolve().name}_estimate")
    settings = {
        "keyframes": options.keyframes,
        "gauge": gauge_of(options.gauge),
        "gauge_name": options.gauge,
        "loss": loss_of(options.loss),
        "noise": options.noise,
        "tracker": options.tracker,
        "camera_time_offset_ns": options.camera_time_offset_ns,
        "progress": True,
    }
    require_free(target)
    refused: dict[str, str] = {}
    if options.windows:
        found = _one_after_another(options, settings, refused)
    else:
        found = {"": estimate(options.folder, start_s=options.start, end_s=options.end, **settings)}
    write_estimates(target, found, refused)
    for name, one in found.items():
        print("\n".join(lines(one, target / name)))
    if refused or any(one.warnings for one in found.values()):
        sys.exit(EXIT_WARNINGS)


def _one_after_another(
    options: argparse.Namespace, settings: dict[str, object], refused: dict[str, str]
) -> dict[str, Estimate]:
    """An estimate for each part that moves, each by itself; a part that is refused says why."""
    if options.start is not None or options.end is not None:
        raise DataError("--windows", "takes the whole recording: leave out --start and --end")
    found = {}
    for part in proposed_parts(options.folder, options.camera_time_offset_ns):
        name = f"{part.start_s:.2f}_{part.end_s:.2f}"
        try:
            found[name] = estimate(options.folder, start_s=part.start_s, end_s=part.end_s, **settings)  # type: ignore[arg-type]
        except VigaugeError as error:
            refused[name] = str(error)
            LOG.warning("%s: refused: %s", part, error)
    if not found:
        raise DataError(options.folder, f"no window can be used; the last: {list(refused.values())[-1]}")
    return found


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("folder", type=Path, help="folder with mav0/ in it")
    arguments.add_argument(
        "--start", type=float, help="start of the window, in seconds after the first frame"
    )
    arguments.add_argument(
        "--end", type=float, help="end of the window; without both, a part that moves is chosen"
    )
    arguments.add_argument(
        "--windows", action="store_true", help="estimate all parts of the recording, each by itself"
    )
    arguments.add_argument(
        "--keyframes", type=int, help="number of keyframes; default: by the window's length"
    )
    arguments.add_argument(
        "--gauge",
        default="first",
        help="reference without error: first (keyframe), centroid, keyframe:K, or free (none)",
    )
    arguments.add_argument(
        "--loss",
        default="none",
        help="robust loss of reprojection errors: none, huber:D or cauchy:D (D in sigmas)",
    )
    arguments.add_argument(
        "--noise",
        choices=("fitted", "stated"),
        default="fitted",
        help="fitted: scaled to the residuals; stated: 1 px and the densities of imu0/sensor.yaml",
    )
    arguments.add_argument(
        "--tracker",
        choices=("optical_flow", "descriptors"),
        help="default: optical flow where frames are dense; descriptors take longer",
    )
    arguments.add_argument(
        "--camera-time-offset-ns", type=int, default=0, help="offset to add to the stamps of frames"
    )
    arguments.add_argument("--out", type=Path, help="folder of the results; default: NAME_estimate, here")
    run(work, arguments, defect_status=EXIT_DEFECT)


if __name__ == "__main__":
    main()
