"""The profile for Slurm."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from recovery.kill import TIMEOUT_S, make_project
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


@pytest.mark.workflow
def test_what_the_queue_answers_reaches_the_terminal(tmp_path: Path) -> None:
    """Catches a run that asks for its number of cores, which a cluster has not, and a refusal in silence."""
    pytest.importorskip("snakemake_executor_plugin_slurm")
    project = make_project(tmp_path / "project")
    for name in ("sacct", "sinfo", "sbatch"):
        (tmp_path / name).write_text("#!/bin/sh\necho 'this queue is closed' >&2\nexit 1\n", "utf-8")
        (tmp_path / name).chmod(0o755)
    command = [sys.executable, "-m", "snakemake", "--workflow-profile", "profiles/slurm"]
    command += ["--configfile", "config/smoke.yaml", "--", "data/simulation/arc_plane/path.csv"]
    env = {**os.environ, "PATH": f"{tmp_path}:{os.environ['PATH']}", "EUROC_ROOT": ""}
    done = subprocess.run(command, cwd=project, env=env, capture_output=True, text=True, timeout=TIMEOUT_S)
    # Set in, as what a stage says: the executor itself says the same of `sacct`, and goes on.
    sentences = [line for line in done.stderr.splitlines() if line.startswith("  ")]
    assert done.returncode == 1 and "this queue is closed" in sentences[0], done.stderr[-2000:]
