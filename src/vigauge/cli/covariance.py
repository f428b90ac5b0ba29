"""Write the covariance of an estimate in a gauge, as sigmas (.csv) or as matrices (.npz)."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import numpy as np

from vigauge.adapters.information import Information
from vigauge.cli.command import EXIT_DEFECT, LOG, parser, run
from vigauge.cli.estimate_file import EXIT_WITHHELD, add_arguments, read_named, state_of
from vigauge.cli.names import gauge_of, scale_of
from vigauge.covariance.covariance import Covariance
from vigauge.errors import DataError, DegenerateError, SolverError
from vigauge.gauge.gauges import Gauge
from vigauge.gauge.layout import Layout
from vigauge.model.problem import Problem
from vigauge.model.trajectory import with_measured
from vigauge.model.trajectory_files import save_trajectory
from vigauge.observability.diagnosis import diagnose_equations

_KINDS = ("position", "rotation", "velocity")
_OF = {"poses": _KINDS[:2], "velocities": _KINDS[2:], "all": _KINDS}


def work(options: argparse.Namespace) -> None:
    gauge = gauge_of(options.gauge)
    if options.out.suffix.lower() not in (".csv", ".npz"):
        raise DataError("--out", "must end in .csv or .npz", value=str(options.out))
    if options.scale and options.gauge == "free":
        raise DataError("--scale", "must not come with the free gauge, which needs none", value=options.scale)
    given = read_named(options)
    write = _of_information if isinstance(given, Information) else _of_problem
    try:
        write(given, gauge, options)  # type: ignore[arg-type]
    except SolverError as error:
        LOG.error("covariance withheld: %s", error)
        sys.exit(EXIT_WITHHELD)
    LOG.info("%s: covariance of %s in the gauge '%s'", options.out, options.of, options.gauge)


def _of_problem(problem: Problem, gauge: Gauge, options: argparse.Namespace) -> None:
    if options.scale:
        raise DataError("--scale", "is measured by the IMU of a problem; leave it out", value=options.scale)
    state = state_of(problem, at_start=options.at_start)
    covariance = Covariance.of(problem, state)
    withheld = diagnose_equations(covariance.equations, problem, state).withheld
    if withheld:
        raise DegenerateError(withheld)
    kinds = _OF[options.of]
    of = np.concatenate([3 * _KINDS.index(kind) + np.arange(3) for kind in kinds])
    blocks = covariance.keyframes(gauge)[:, of[:, None], of]
    save_trajectory(options.out, state, blocks, gauge=options.gauge, kinds=kinds)


def _of_information(given: Information, gauge: Gauge, options: argparse.Namespace) -> None:
    layout = given.layout
    there = [kind for kind in _OF[options.of] if kind in layout.blocks]
    kinds = there if options.of == "all" else list(_OF[options.of])
    for kind in kinds or _KINDS[:1]:
        if kind not in layout.blocks or layout.blocks[kind].shape[1] != _width(layout, kind):
            raise DataError(options.file, "must name three columns a keyframe for this", field=kind)
    covariance = given.covariance()
    if covariance.measured:
        rule = (
            "%s: H has information along %s, which no gauge takes out; where nothing absolute was measured:"
        )
        LOG.warning(rule, options.file, ", ".join(covariance.measured))
        for concern in given.audit() or ("take out of H what is absolute",):
            LOG.warning("%s", concern)
    # Landmarks in the plane are keyframes without an angle.
    keys = layout.having(kinds)
    rows = layout.places_having(kinds)
    known: Any = (gauge, scale_of(options.scale)) if options.scale else gauge
    posed = "rotation" in kinds or "position" in kinds
    blocks = covariance.keyframes(known, keys, kinds, to="left" if posed else None)
    R, p = given.R[rows], given.p[rows]
    estimate = (R, p) if given.velocities is None else (R, p, given.velocities[rows])
    times = None if given.times_ns is None else given.times_ns[rows]
    name = with_measured(" ".join(filter(None, (options.gauge, options.scale))), covariance.measured)
    save_trajectory(
        options.out, estimate, blocks, times_ns=times, gauge=name, kinds=kinds, keys=layout.keys and keys
    )


def _width(layout: Layout, kind: str) -> int:
    """Columns that a kind must have: x, y and the angle alone in the plane."""
    plane = layout.blocks.get("position", np.empty((0, 3))).shape[1] == 2
    return {"position": 2, "rotation": 1}.get(kind, 3) if plane else 3


def main() -> None:
    arguments = parser(__doc__)
    add_arguments(arguments)
    arguments.add_argument(
        "--gauge",
        required=True,
        help="reference without error: first (keyframe), centroid, keyframe:K, or free (none)",
    )
    arguments.add_argument(
        "--scale",
        metavar="SCALE",
        help="reference of an open scale: distance:I:J of two keyframes, or depth:K",
    )
    arguments.add_argument("--of", choices=list(_OF), default="poses", help="blocks to write; default: poses")
    arguments.add_argument(
        "--out",
        type=Path,
        required=True,
        help="file for sigmas (.csv) or covariances (.npz), in m and rad, by left increments",
    )
    run(work, arguments, defect_status=EXIT_DEFECT)


if __name__ == "__main__":
    main()
