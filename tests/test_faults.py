"""The table of fault cases: every test that it names is there."""

from __future__ import annotations

import ast
import csv
from pathlib import Path

ROOT = Path(__file__).parent.parent
TABLE = ROOT / "docs" / "faults.csv"


def functions(path: Path) -> set[str]:
    return {
        node.name
        for node in ast.walk(ast.parse(path.read_text("utf-8")))
        if isinstance(node, ast.FunctionDef)
    }


def test_every_fault_names_a_test_that_exists() -> None:
    """A table that promises a behaviour nobody checks."""
    with TABLE.open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert rows and set(rows[0]) == {"case", "fault", "expected", "test", "message", "exit_status"}
    for row in rows:
        file, _, test = row["test"].partition("::")
        assert (ROOT / file).is_file(), row
        assert test.partition("[")[0] in functions(ROOT / file), row
        assert row["fault"] and row["expected"] and row["exit_status"] in ("", "0", "1", "2"), row


def test_every_recorded_kill_ended_in_the_same_results() -> None:
    """A record of the long kill test that nobody looked at."""
    with (ROOT / "docs" / "recovery.csv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert rows and all(row["identical"] == "True" for row in rows)
