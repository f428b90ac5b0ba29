"""What the results must show, beside what they show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from .competitors import OURS
from .results import Row

Wanted = dict[int, tuple[float, float]]

# (quantity, to reach, moonshot); reached when at least this for ratios, at most this for the rest.
AT_LEAST: tuple[tuple[str, str, Wanted], ...] = (
    ("iteration, N = {n}, against gtsam", "ratio_to_gtsam", {10: (20, 35), 100: (15, 25), 300: (15, 25)}),
    ("iteration, N = {n}, against ceres", "ratio_to_ceres", {10: (5, 8), 100: (7, 12), 300: (7, 12)}),
)
COVARIANCE: tuple[tuple[str, str, str, Wanted], ...] = (
    (
        "free motion covariance, N = {n}, against pinv",
        "free",
        "ratio_to_pinv",
        {10: (400, 800), 30: (2500, 5000)},
    ),
    (
        "motion covariance, N = {n}, against GTSAM Marginals",
        "prior",
        "ratio_to_marginals",
        {10: (10, 20), 30: (10, 20), 100: (10, 20)},
    ),
)
# With biases in the state, of the gauge where it is least; and an iteration over that with known biases.
WITH_BIASES: dict[str, tuple[float, float]] = {"gtsam": (15, 30), "ceres": (5, 10)}
OVER_KNOWN = (1.7, 1.3)
FREE_OVER_FIXED = (1.3, 1.1)
GROWTH = (1.2, 1.05)
MEMORY_GIB = (3.0, 1.0)
START_S = (1.5, 0.7)
PAPER_S = (180.0, 90.0)


def _row(
    quantity: str, measured: object, wanted: tuple[float, float], *, at_least: bool, interval: str = ""
) -> Row:
    verdict = "not measured"
    if measured != "":
        value = float(str(measured))
        ok = [value >= limit if at_least else value <= limit for limit in wanted]
        verdict = "moonshot" if ok[1] else "reached" if ok[0] else "short"
    return {
        "quantity": quantity,
        "measured": measured,
        "interval": interval,
        "to_reach": wanted[0],
        "moonshot": wanted[1],
        "verdict": verdict,
    }


def _cell(rows: Sequence[Row], column: str, **where: object) -> tuple[object, str]:
    """Value and interval of our row that fits; empty where there is none."""
    for row in rows:
        if row["solver"] == OURS and all(row[key] == value for key, value in where.items()):
            return _of(row, column)
    return "", ""


def _of(row: Row, column: str) -> tuple[object, str]:
    low, high = row.get(f"{column}_low", ""), row.get(f"{column}_high", "")
    return row[column], f"{low} to {high}" if low != "" else ""


def bias_rows(solves: Sequence[Row]) -> list[Row]:
    """Rows of targets.csv about rows of with_biases_solve.csv."""
    out = []
    ours = [row for row in solves if row["solver"] == OURS and row["ms_per_iteration"] != ""]
    for n in dict.fromkeys(row["n_keyframes"] for row in ours):
        estimated, known = (
            {row["gauge"]: row for row in ours if row["n_keyframes"] == n and row["biases"] == kind}
            for kind in ("estimated", "known")
        )
        for peer, wanted in WITH_BIASES.items():
            column = f"ratio_to_{peer}"
            raced = [row for row in estimated.values() if row[column] != ""]
            least = min(raced, key=lambda row: float(str(row[column])), default=None)
            value, interval = ("", "") if least is None else _of(least, column)
            text = f"iteration with biases, N = {n}, against {peer}"
            out.append(_row(text, value, wanted, at_least=True, interval=interval))
        ratios = [
            float(str(row["ms_per_iteration"])) / float(str(known[gauge]["ms_per_iteration"]))
            for gauge, row in estimated.items()
            if gauge in known
        ]
        text = f"iteration with biases, N = {n}, over known biases"
        out.append(_row(text, round(max(ratios), 4) if ratios else "", OVER_KNOWN, at_least=False))
    return out


def target_rows(
    solves: Sequence[Row],
    covariances: Sequence[Row],
    scaling: Sequence[Row],
    with_biases: Sequence[Row],
    others: Mapping[str, float],
) -> list[Row]:
    """Rows of targets.csv. ``others`` may have start_s and paper_s."""
    out = []
    for text, column, sizes in AT_LEAST:
        for n, wanted in sizes.items():
            value, interval = _cell(solves, column, n_keyframes=n, gauge="free", threads=1)
            out.append(_row(text.format(n=n), value, wanted, at_least=True, interval=interval))
    out += bias_rows(with_biases)
    for text, gauge, column, sizes in COVARIANCE:
        for n, wanted in sizes.items():
            value, interval = _cell(covariances, column, n_keyframes=n, gauge=gauge, threads=1, part="whole")
            out.append(_row(text.format(n=n), value, wanted, at_least=True, interval=interval))
    for n in sorted({int(str(row["n_keyframes"])) for row in covariances if row["part"] == "whole"}):
        # The column has the fixed gauge's time over this one's.
        value, _ = _cell(covariances, "ratio_to_fixed", n_keyframes=n, gauge="free", threads=1, part="whole")
        value = "" if value == "" else round(1.0 / float(str(value)), 4)
        out.append(_row(f"free over fixed covariance time, N = {n}", value, FREE_OVER_FIXED, at_least=False))
    value, _ = _cell(scaling, "exponent_keyframes", threads=1)
    out.append(_row("growth of an iteration with N (exponent)", value, GROWTH, at_least=False))
    value, _ = _cell(scaling, "peak_mib", threads=1, n_keyframes=1000)
    value = "" if value == "" else round(float(str(value)) / 1024.0, 3)
    out.append(_row("N = 1000, memory, GiB", value, MEMORY_GIB, at_least=False))
    for name, text, wanted in (
        ("start_s", "process that solves one problem, s", START_S),
        ("paper_s", "whole paper, s", PAPER_S),
    ):
        found = others.get(name)
        out.append(_row(text, "" if found is None else round(found, 3), wanted, at_least=False))
    return out
