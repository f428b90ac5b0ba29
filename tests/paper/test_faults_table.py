"""The table of faults: every case has a test that exists."""

import ast
from functools import cache

from support import ROOT
from vigauge.files import read_rows

COLUMNS = ["input", "message", "outcome", "test"]


@cache
def functions_of(file: str) -> set[str]:
    tree = ast.parse((ROOT / file).read_text("utf-8"))
    return {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}


def test_every_fault_names_a_test_that_exists() -> None:
    """A table that claims what nothing checks."""
    rows = read_rows(ROOT / "docs" / "faults.csv")
    assert list(rows[0]) == COLUMNS
    for row in rows:
        assert None not in row and row["input"] and row["outcome"], row
        file, name = row["test"].split("::")
        assert name.split("[")[0] in functions_of(file), row["test"]
