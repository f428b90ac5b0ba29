"""The record of the long kill test (`make recovery`)."""

from __future__ import annotations

import csv

from support import ROOT


def test_every_recorded_kill_ended_in_the_same_results() -> None:
    """A record of the long kill test that nobody looked at."""
    with (ROOT / "docs" / "recovery.csv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert rows and all(row["identical"] == "True" for row in rows)
