"""From entries of the races to tables: times, ratios with intervals, and the reasons of what is missing."""

from __future__ import annotations

import math
import statistics as plain
from collections.abc import Iterable, Mapping, Sequence

from vigauge.model.problem import Problem

from .competitors import OURS
from .limits import Peak, Stage
from .race import Entry
from .statistics import exponent, paired_ratio

Row = dict[str, object]

# Exponents are fitted from this size on: shorter problems measure overhead.
LARGE = 100


def _problem(name: str, problem: Problem) -> Row:
    return {
        "problem": name,
        "n_keyframes": problem.initial.n_keyframes,
        "n_landmarks": problem.initial.n_landmarks,
        "n_observations": len(problem.obs_uv),
    }


def _ratios(entry: Entry, others: Mapping[str, Entry | None]) -> tuple[Row, Row]:
    """Columns ratio_to_X, and separately their intervals; empty where either time does not count."""
    ratios: Row = {}
    intervals: Row = {}
    for name, other in others.items():
        column = f"ratio_to_{name}"
        value: tuple[object, object, object] = ("", "", "")
        if entry.counts and other is not None and other.counts:
            value = tuple(  # type: ignore[assignment]
                "" if math.isnan(v) else round(v, 4)
                for v in paired_ratio(other.per_iteration(), entry.per_iteration())
            )
        ratios[column] = value[0]
        intervals[f"{column}_low"], intervals[f"{column}_high"] = value[1], value[2]
    return ratios, intervals


def _find(entries: Iterable[Entry], solver: str, gauge: str | None = None, part: str = "") -> Entry | None:
    fits = (e for e in entries if e.solver == solver and e.part == part and gauge in (None, e.gauge))
    return next(fits, None)


def _ms(seconds: Sequence[float]) -> object:
    return round(1e3 * plain.median(seconds), 4) if seconds else ""


def solve_rows(name: str, problem: Problem, entries: Sequence[Entry]) -> list[Row]:
    """Rows of solve.csv; ratios compare solvers within a gauge, theirs over ours: above one we are faster."""
    rows = []
    for entry in entries:
        others = {peer: _find(entries, peer, entry.gauge) for peer in ("gtsam", "ceres")}
        ratios, intervals = _ratios(entry, others)
        rows.append(
            {
                **_problem(name, problem),
                "solver": entry.solver,
                "gauge": entry.gauge,
                "threads": entry.threads,
                "iterations": entry.iterations if entry.counts else "",
                "ms_total": _ms(entry.seconds) if entry.counts else "",
                "ms_per_iteration": _ms(entry.per_iteration()) if entry.counts else "",
                **ratios,
                **intervals,
                "rounds": len(entry.seconds),
                "variant": entry.variant,
                "cost_excess": f"{entry.distance:.2e}" if entry.iterations else "",
                "peak_mib": round(entry.peak_mib, 1) if entry.peak_mib else "",
                "status": entry.status,
            }
        )
    return rows


def covariance_rows(name: str, problem: Problem, entries: Sequence[Entry]) -> list[Row]:
    """Rows of covariance.csv.

    Rows of one part are compared: the 9N x 9N motion block, or its diagonal blocks. pinv has it in the
    free gauge only, GTSAM under the prior only: every row is compared with those.
    """
    rows = []
    for entry in entries:
        peers = {
            "pinv": _find(entries, "pinv", part=entry.part),
            "marginals": _find(entries, "gtsam", part=entry.part),
            "ceres": _find(entries, "ceres", "fix", part=entry.part),
            "fixed": _find(entries, OURS, "fix", part=entry.part),
        }
        ratios, intervals = _ratios(entry, peers)
        rows.append(
            {
                **_problem(name, problem),
                "solver": entry.solver,
                "gauge": entry.gauge,
                "threads": entry.threads,
                "part": entry.part,
                "ms_total": _ms(entry.seconds) if entry.counts else "",
                **ratios,
                **intervals,
                "rounds": len(entry.seconds),
                "variant": entry.variant,
                "distance_to_vigauge": f"{entry.distance:.2e}" if entry.iterations else "",
                "peak_mib": round(entry.peak_mib, 1) if entry.peak_mib else "",
                "status": entry.status,
            }
        )
    return rows


def _density(row: Row) -> float:
    """Landmarks a keyframe."""
    return float(str(row["n_landmarks"])) / float(str(row["n_keyframes"]))


def scaling_rows(solves: Sequence[Row], floors: Mapping[str, float]) -> list[Row]:
    """Rows of scaling.csv: milliseconds an iteration in the free gauge, the slope over long problems, and how
    much of the time the machine's floor explains. ``floors`` has seconds by problem."""
    out: list[Row] = []
    kinds = dict.fromkeys((r["solver"], r["threads"]) for r in solves if r["gauge"] == "free")
    for solver, threads in kinds:
        chosen = [
            r
            for r in solves
            if (r["solver"], r["threads"], r["gauge"]) == (solver, threads, "free")
            and r["ms_per_iteration"] != ""
        ]
        long = [r for r in chosen if int(str(r["n_keyframes"])) >= LARGE]
        # With N alone only problems with as many landmarks a keyframe are compared.
        alike = [r for r in long if _density(r) == min(map(_density, long))]
        slope = exponent(
            [float(str(r["n_keyframes"])) for r in alike], [float(str(r["ms_per_iteration"])) for r in alike]
        )
        # This slope is over all of them.
        by_work = exponent(
            [float(str(r["n_observations"])) for r in long], [float(str(r["ms_per_iteration"])) for r in long]
        )
        for r in chosen:
            floor_ms = 1e3 * floors[str(r["problem"])]
            out.append(
                {
                    **{key: r[key] for key in ("problem", "n_keyframes", "n_landmarks", "n_observations")},
                    **{key: r[key] for key in ("solver", "gauge", "threads", "ms_per_iteration")},
                    "exponent_keyframes": "" if math.isnan(slope) else round(slope, 3),
                    "exponent_observations": "" if math.isnan(by_work) else round(by_work, 3),
                    "floor_ms": round(floor_ms, 4),
                    "share_of_floor": round(floor_ms / float(str(r["ms_per_iteration"])), 4),
                    "peak_mib": r["peak_mib"],
                }
            )
    return out


def roofline_rows(
    name: str, problem: Problem, stages: Sequence[Stage], peak: Peak, seconds: Mapping[str, float]
) -> list[Row]:
    """Rows of roofline.csv: work of each stage of an iteration, its floor here, and our own ``seconds``."""
    return [
        {
            **_problem(name, problem),
            "stage": stage.name,
            "flops": round(stage.flops),
            "bytes": round(stage.bytes),
            "floor_ms": round(1e3 * stage.floor_s(peak), 5),
            "bound": "flops" if stage.flops / peak.flops > stage.bytes / peak.bandwidth else "bandwidth",
            "ours_ms": round(1e3 * seconds[stage.name], 5),
            "ours_over_floor": round(seconds[stage.name] / stage.floor_s(peak), 2),
        }
        for stage in stages
    ]
