"""The profile for Slurm, and the record of the run on one (`make test-slurm`)."""

from __future__ import annotations

import csv
import re

import yaml

from support import ROOT


def test_every_timed_stage_has_its_node_to_itself() -> None:
    """Catches a timed rule that does not ask for its node, here or as a module, and runs beside others."""
    files = {path: path.read_text("utf-8") for path in sorted((ROOT / "workflow").rglob("*.smk"))}
    common = files[ROOT / "workflow" / "rules" / "common.smk"]
    assert 'ALONE = {"timed": 1000, "slurm_extra": "--exclusive"}' in common
    blocks = re.findall(
        r"^(?:rule|checkpoint) (\w+):\n((?:^ .*\n|^\n)*)", "\n".join(files.values()), flags=re.MULTILINE
    )
    timing = {name for name, text in blocks if "time" in name or "--timing" in text and "timings" not in text}
    alone = {name for name, text in blocks if re.search(r"resources:\n(?: {8}.*\n)*? {8}\*\*ALONE,", text)}
    profile = yaml.safe_load((ROOT / "profiles" / "slurm" / "config.yaml").read_text("utf-8"))
    # Names of rules in the profile would not be those of a module.
    assert "set-resources" not in profile and alone and alone == timing


def test_every_recorded_check_holds() -> None:
    """Catches a record that nobody looked at."""
    with (ROOT / "docs" / "slurm.csv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert rows and all(row["holds"] == "True" for row in rows)
