"""How long the whole paper takes, rule by rule.

    python -m benchmarks.paper_time [--cores 2]

Runs the workflow anew from nothing (``snakemake --forceall``) and adds up what Snakemake itself recorded
of each job.
"""

from __future__ import annotations

import argparse
import csv
import json
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from vigauge.errors import DataError
from vigauge.files import write_rows
from vigauge_paper.tables import markdown

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
RESULT = "paper.csv"
WHOLE = "(whole paper)"

Row = dict[str, object]


def job_records(folder: Path) -> list[dict[str, Any]]:
    """What Snakemake recorded of each output file; DataError where there is nothing."""
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    if not files:
        raise DataError(folder, "the workflow must have run here: no record of a job")
    return [json.loads(path.read_text(encoding="utf-8")) for path in files]


def rule_rows(records: Iterable[dict[str, Any]], since: float, wall_s: float) -> list[Row]:
    """Rows of paper.csv: seconds by rule, longest first, of jobs begun after ``since``; the wall time last.

    A job with several outputs has several records with the same times, and counts once.
    """
    jobs: dict[tuple[str, float], float] = {}
    for r in records:
        begin, end = r.get("starttime"), r.get("endtime")
        if begin is not None and end is not None and float(begin) >= since:
            # Records of one job begin at one time, and end a little after each other.
            job = (str(r["rule"]), float(begin))
            jobs[job] = max(float(end), jobs.get(job, 0.0))
    seconds: dict[str, list[float]] = defaultdict(list)
    for (rule, begin_s), end_s in jobs.items():
        seconds[rule].append(end_s - begin_s)
    rows: list[Row] = [
        {"rule": rule, "jobs": len(times), "seconds": round(sum(times), 2), "longest_s": round(max(times), 2)}
        for rule, times in sorted(seconds.items(), key=lambda item: -sum(item[1]))
    ]
    longest = round(max((max(times) for times in seconds.values()), default=0.0), 2)
    rows.append({"rule": WHOLE, "jobs": len(jobs), "seconds": round(wall_s, 2), "longest_s": longest})
    return rows


def whole_paper_s(file: Path) -> float | None:
    """Wall time that a run of this module wrote, or None where it has not run."""
    if not file.is_file():
        return None
    with file.open(encoding="utf-8", newline="") as stream:
        for row in csv.DictReader(stream):
            if row["rule"] == WHOLE:
                return float(row["seconds"])
    raise DataError(file, f"must have a row {WHOLE}", field="rule")


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.paper_time", description=__doc__)
    parser.add_argument("--cores", type=int, default=2)
    parser.add_argument("--results", type=Path, default=HERE / "results")
    options = parser.parse_args(arguments)
    stamp, begin = time.time(), time.monotonic()
    done = subprocess.run(["snakemake", "--cores", str(options.cores), "--forceall"], cwd=ROOT)
    if done.returncode:
        return done.returncode
    rows = rule_rows(job_records(ROOT / ".snakemake" / "metadata"), stamp, time.monotonic() - begin)
    write_rows(options.results / RESULT, rows)
    print(
        markdown(
            rows, f"Seconds by rule; {options.cores} jobs at a time, so the whole takes less than the sum."
        )
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
