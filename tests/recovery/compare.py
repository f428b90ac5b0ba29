"""Results of two runs, byte by byte but for what tells times."""

import csv
import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path

FOLDERS = ("data", "paper_figures")

# Files and folders that hold nothing but times, and drawings of times; the page has those inside.
TIMES_ONLY = ("timing.csv", "timing", "iteration_time.csv", "index.html")
DRAWN_TIMES = ("fig05_", "fig07_", "fig11_", "biases.p")
# Lines of pages: a time, or how many numbers of such a figure lie inside our range.
_TIMED = re.compile(r"time|^\| fig(05|07|11) \| \d+ \|")


def results(project: Path) -> Iterator[Path]:
    """Result files of a project, relative to it; Snakemake's own hidden files are none."""
    for folder in FOLDERS:
        for file in sorted((project / folder).rglob("*")):
            if file.is_file() and file.name != ".snakemake_timestamp":
                yield file.relative_to(project)


def differences(one: Path, other: Path) -> list[str]:
    """What differs between the results of two projects, in words; empty where they are the same."""
    names = {folder: set(results(folder)) for folder in (one, other)}
    out = [f"{name} is in one run only" for name in sorted(names[one] ^ names[other])]
    timed = _timed_claims(one)
    for name in sorted(names[one] & names[other]):
        read = _reader(name, timed)
        if read is not None and read(one / name) != read(other / name):
            out.append(f"{name} differs")
    return out


def _reader(name: Path, timed: set[str]) -> Callable[[Path], object] | None:
    """How to read a file without its times; None where nothing else is in it."""
    if name.name.endswith("stamp.json"):
        return lambda path: _without(path, "timings")
    if name.name in TIMES_ONLY or name.parent.name in TIMES_ONLY:
        return None
    if name.parent.name == "timing_reasons":
        return lambda path: [{**row, "seconds": ""} for row in _rows(path)]
    if name.name == "source.json":
        return lambda path: json.loads(path.read_text("utf-8"))  # in the order in which jobs were planned
    if name.name == "environment.json":
        return lambda path: _without(path, "speed")
    if name.name.startswith(DRAWN_TIMES):
        return _iterations if name.suffix == ".csv" else None
    if name.name in ("claims.csv", "claims_why.csv", "biases.csv"):
        return lambda path: [row for row in _rows(path) if row["id"] not in timed]
    if name.name == "comparison.csv":
        return _iterations
    if name.name in ("comparison.md", "biases.md"):
        return lambda path: [line for line in path.read_text("utf-8").splitlines() if not _TIMED.search(line)]
    if name.name in ("claims.md", "summary.md"):
        return lambda path: [line for line in path.read_text("utf-8").splitlines() if not _of(timed, line)]
    return Path.read_bytes


def _rows(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def _without(path: Path, times: str) -> dict[str, object]:
    """A JSON object without its member that depends on times."""
    return {key: value for key, value in json.loads(path.read_text("utf-8")).items() if key != times}


def _iterations(path: Path) -> list[dict[str, str]]:
    return [row for row in _rows(path) if not row["quantity"].startswith("time")]


def _timed_claims(project: Path) -> set[str]:
    """Ids and wordings of claims for which times were measured."""
    claims = project / "paper_figures" / "claims.csv"
    if not claims.is_file():
        return set()
    timed = [row for row in _rows(claims) if re.search(r"\btimes?\b|median paired ratio", row["measured"])]
    return {row[key] for row in timed for key in ("id", "claim")}


def _of(timed: set[str], line: str) -> bool:
    """Whether a line of the ledger or the summary tells of a timed claim, or counts verdicts."""
    counts = re.match(r"Claims: |\d+ of \d+ claims of the paper hold", line)
    return counts is not None or any(f"| {text} |" in line for text in timed)
