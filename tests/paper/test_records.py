"""The records of the long tests that are run by hand: `make recovery` and `make test-slurm`."""

import csv

import pytest

from support import ROOT


@pytest.mark.parametrize(("record", "column"), [("recovery.csv", "identical"), ("slurm.csv", "holds")])
def test_every_recorded_run_went_well(record: str, column: str) -> None:
    """Catches a record of a kill with other results, or of a check that failed, at which nobody looked."""
    with (ROOT / "docs" / record).open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert rows and all(row[column] == "True" for row in rows)
