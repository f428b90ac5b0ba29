"""The numbers of a build that another build must repeat, and how nearly.

Simulation repeats to six digits on any machine. Sequences do not: an inlier decision of the front-end can
turn on a last digit, so their numbers get a spread. Times are compared as ratios between gauges only.
"""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vigauge.errors import DataError

from ..figures.registry import FIGURES
from ..ids import ERRORS, FIX
from .expected import (
    ABSOLUTE,
    FACTOR,
    LIMIT,
    RELATIVE,
    SAME,
    SIMULATION,
    SOURCES,
    Value,
    missing,
    number,
    rows_of,
)

Rule = tuple[float, str]  # tolerance and kind of a value

WORD: Rule = (0.0, SAME)
EXACT: Rule = (0.0, ABSOLUTE)
DIGITS: Rule = (1e-6, RELATIVE)
SPREAD: Rule = (0.3, RELATIVE)  # twice what flipped inliers were seen to move a start
ONE: Rule = (1.0, ABSOLUTE)
TIMES: Rule = (1.0, FACTOR)
IDENTITY: Rule = (1e-9, LIMIT)  # Eq. (12), at one linearisation point
CONVERGED: dict[str, Rule] = {"fig09": (1.1e-3, LIMIT), "fig10": (2e-4, LIMIT)}  # as published

# Made from the sequences, at least in part.
ON_SEQUENCES = ("table3", "fig10", "fig11", "claims")
# Claims whose verdicts another processor may change.
TIMED = frozenset({"free-faster", "time-per-iteration", "prior-cost", "euroc-time"})


def found_values(folder: Path) -> list[Value]:
    """What stands in a folder of artefacts, with the rules for comparing another build.

    Artefacts of sequences other than the paper's or the rendered ones are left out. DataError where a
    file or a column is missing, or a number is none.
    """
    out = [
        *_table(folder, "table1", ["gauge"], ["parameters", "hessian_rows", "hessian_rank"], EXACT),
        *_table(folder, "table2", ["configuration", "gauge"], ERRORS, DIGITS),
        *_truths(folder),
        *_table(folder, "table3", ["sequence", "gauge"], ERRORS, SPREAD),
        *_table(folder, "fig05", ["reading", "weight", "quantity"], ["q1", "median", "q3"], EXACT),
        *_cost(folder, "fig07", EXACT),
        *_covariance(folder, "fig09"),
        *_covariance(folder, "fig10"),
        *_cost(folder, "fig11", ONE),
        *_table(folder, "claims", ["id"], ["verdict", "verdict_as_printed"], WORD),
    ]
    return [v for v in out if v.source in SOURCES and not _timed(v)]


def _timed(value: Value) -> bool:
    """Whether a value is a time by itself, or judged by times."""
    return value.row in TIMED or (value.artefact == "fig05" and value.row.endswith("time_s"))


def _file(folder: Path, artefact: str) -> Path:
    if artefact in FIGURES:
        return folder / f"{FIGURES[artefact].stem}{FIGURES[artefact].numbers}"
    return folder / f"{artefact}.csv"


def _table(
    folder: Path, artefact: str, labels: Sequence[str], columns: Sequence[str], rule: Rule
) -> Iterator[Value]:
    """Columns of a CSV file; a row is named by its labels."""
    file, source = _file(folder, artefact), _source(folder, artefact)
    for line, row in enumerate(rows_of(file, [*labels, *columns]), start=2):
        name = " ".join(row[label] for label in labels)
        for column in columns:
            value = row[column] if rule is WORD else number(row[column], file, column, line)
            yield Value(artefact, source, name, column, value, *rule)


def _cost(folder: Path, artefact: str, iterations: Rule) -> Iterator[Value]:
    """Iterations, and the times over those of fixation."""
    file, source = _file(folder, artefact), _source(folder, artefact)
    labels = ["experiment", "gauge", "quantity"]
    rows = rows_of(file, [*labels, "median", "mean"])
    median = {
        tuple(row[label] for label in labels): number(row["median"], file, "median", line)
        for line, row in enumerate(rows, start=2)
    }
    for line, row in enumerate(rows, start=2):
        experiment, gauge, quantity = (row[label] for label in labels)
        name = f"{experiment} {gauge}"
        value = median[experiment, gauge, quantity]
        if quantity == "iterations":
            mean = number(row["mean"], file, "mean", line)
            yield Value(artefact, source, name, "iterations median", value, *iterations)
            yield Value(artefact, source, name, "iterations mean", mean, *iterations)
        elif gauge != FIX and quantity == "time_s":
            if (experiment, FIX, quantity) not in median:
                raise DataError(file, f"must have the row {experiment}, {FIX}, {quantity}")
            ratio = value / median[experiment, FIX, quantity]
            yield Value(artefact, source, name, "time over fixation's", ratio, *TIMES)
        elif gauge != FIX:
            yield Value(artefact, source, name, quantity, value, *TIMES)


def _covariance(folder: Path, artefact: str) -> Iterator[Value]:
    """Relative Frobenius distances of the transformed covariance from that of fixation."""
    file, source = _file(folder, artefact), _source(folder, artefact)
    try:
        with np.load(file, allow_pickle=False) as archive:
            arrays = dict(archive)
    except FileNotFoundError as error:
        raise missing(file) from error
    except (ValueError, OSError, EOFError) as error:
        raise DataError(file, f"must be a NumPy archive: {error}") from error
    for point, rule in (("same_point", IDENTITY), ("converged", CONVERGED[artefact])):
        name = f"relative_frobenius_{point}"
        if name not in arrays:
            raise DataError(file, "must be an array", field=name, value=", ".join(arrays))
        yield Value(artefact, source, "", name, number(arrays[name], file, name), *rule)


def _truths(folder: Path) -> Iterator[Value]:
    """Which ground truth the errors of a sequence are from: another one gives other errors."""
    file, source = folder / "environment.json", _source(folder, "table3")
    try:
        for name, used in _json(file)["sequences"].items():
            yield Value("table3", source, name, "truth", str(used["truth"]), *WORD)
    except (AttributeError, KeyError, TypeError) as error:
        raise DataError(file, "must name the truth of each sequence", field="sequences") from error


def _source(folder: Path, artefact: str) -> str:
    """'simulation', or whose sequences an artefact shows: 'euroc', 'rendered' or 'other'."""
    if artefact not in ON_SEQUENCES:
        return SIMULATION
    record, name = folder / "source.json", _file(folder, artefact).name
    builds = {Path(file).name: build for file, build in _json(record).items()}
    try:
        return str(builds[name]["claims"])
    except (KeyError, TypeError) as error:
        raise DataError(record, "must say whose sequences it shows", field=name) from error


def _json(file: Path) -> dict[str, Any]:
    try:
        return dict(json.loads(file.read_text(encoding="utf-8")))
    except FileNotFoundError as error:
        raise missing(file) from error
    except (ValueError, TypeError) as error:
        raise DataError(file, f"must be a JSON object: {error}") from error
