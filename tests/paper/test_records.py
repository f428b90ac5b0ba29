"""The records of the long tests that are run by hand: `make recovery` and `make test-slurm`."""

import pytest

from support import ROOT
from vigauge.files import read_rows


@pytest.mark.parametrize(("record", "column"), [("recovery.csv", "identical"), ("slurm.csv", "holds")])
def test_every_recorded_run_went_well(record: str, column: str) -> None:
    """Catches a record of a kill with other results, or of a check that failed, at which nobody looked."""
    rows = read_rows(ROOT / "docs" / record)
    assert rows and all(row[column] == "True" for row in rows)
