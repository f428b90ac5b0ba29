"""The profile for Slurm, and the record of the run on one (`make test-slurm`)."""

from __future__ import annotations

import csv
import re

import yaml

from support import ROOT


def test_every_timed_stage_has_its_node_to_itself() -> None:
    """Catches a timed rule that the profile does not know: times taken beside other jobs."""
    rules = "\n".join(path.read_text("utf-8") for path in sorted((ROOT / "workflow").rglob("*.smk")))
    blocks = re.findall(r"^(?:rule|checkpoint) (\w+):\n((?:^ .*\n|^\n)*)", rules, flags=re.MULTILINE)
    timed = {name for name, text in blocks if re.search(r"\btimed=ALONE\b", text)}
    timed |= {
        name for base, name in re.findall(r"^use rule (\w+) as (\w+)", rules, re.MULTILINE) if base in timed
    }
    profile = yaml.safe_load((ROOT / "profiles" / "slurm" / "config.yaml").read_text("utf-8"))
    resources = profile["set-resources"]
    alone = {name for name, value in resources.items() if value == {"slurm_extra": "'--exclusive'"}}
    assert timed and alone == timed


def test_every_recorded_check_holds() -> None:
    """Catches a record that nobody looked at."""
    with (ROOT / "docs" / "slurm.csv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert rows and all(row["holds"] == "True" for row in rows)
