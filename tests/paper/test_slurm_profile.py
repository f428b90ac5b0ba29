"""The profile for Slurm."""

from __future__ import annotations

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
