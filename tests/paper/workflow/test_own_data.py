"""The page on own data, followed to the letter with a recording that no configuration knows."""

import csv
import os
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from support import ROOT

from .conftest import make_project, snakemake

pytestmark = pytest.mark.workflow


@pytest.mark.slow
def test_page_leads_from_a_folder_to_table_3_and_figure_10(smoke_project: Path, tmp_path: Path) -> None:
    """A page whose configuration or command no longer fits."""
    page = (ROOT / "docs" / "your_own_data.md").read_text("utf-8")
    project = make_project(tmp_path / "project")
    recordings = project / "recordings"
    shutil.copytree(smoke_project / "data/rendered/rendered_hall", recordings / "my_flight")
    (configuration,) = re.findall(r"```yaml\n(.*?)```", page, flags=re.DOTALL)
    (project / "my_flight.yaml").write_text(configuration, "utf-8")
    (command,) = re.findall(r"```\nEUROC_ROOT=recordings snakemake --cores 2 (.*?)```", page, flags=re.DOTALL)
    done = snakemake(project, *command.replace("\\\n", " ").split(), smoke=False, EUROC_ROOT="recordings")
    assert done.returncode == 0, done.stderr[-3000:]
    with (project / "paper_figures/table3.csv").open(encoding="utf-8") as stream:
        found = [(row["sequence"], row["gauge"], float(row["p_rmse_m"])) for row in csv.DictReader(stream)]
    assert {name for name, _, _ in found} == {"my_flight_begin", "my_flight_end"}
    assert len(found) == 6 and all(0 < error < 0.05 for _, _, error in found)
    with np.load(project / "paper_figures/fig10_covariance_euroc.npz") as arrays:
        assert arrays["fixed"].shape == (72, 72)
        assert arrays["relative_frobenius_same_point"] < 1e-9
    assert (project / "data/checks/my_flight_begin.json").is_file()


def test_messages_that_the_page_explains_exist() -> None:
    """Words that no check says any more."""
    page = (ROOT / "docs" / "your_own_data.md").read_text("utf-8")
    table = page.split("| it says | it means |")[1].split("\n\n")[0]
    source = "".join(
        path.read_text("utf-8") for path in (ROOT / "src/vigauge/recordings/checks").glob("*.py")
    )
    source = re.sub(r'"\s*\n\s*f?"', "", source)
    for quoted in re.findall(r"^\| `(.+?)` \|", table, flags=re.MULTILINE):
        pieces = [piece.strip() for piece in re.split(r"\d+(?:\.\d+)?|\.\.\.|milliseconds|imu0", quoted)]
        for piece in filter(None, pieces):
            assert piece in source, piece


def test_choice_of_unknown_sequences_is_one_clear_error(tmp_path: Path) -> None:
    project = make_project(tmp_path / "project")
    done = snakemake(project, "--dry-run", "--config", "euroc={only: [MH_01_easy, nowhere]}", smoke=False)
    assert done.returncode != 0
    assert (
        "configuration, euroc.only: must be one of MH_01_easy, V1_01_easy (found 'nowhere')"
        in done.stdout + done.stderr
    )
    assert "Traceback" not in done.stdout + done.stderr


def test_flags_of_the_page_exist() -> None:
    """A command of the page with a flag that a program does not know."""
    page = (ROOT / "docs" / "your_own_data.md").read_text("utf-8")
    environment = os.environ | {"PYTHONPATH": str(ROOT / "src")}
    commands = re.findall(r"^vigauge ([a-z-]+)((?:[^\n]|\\\n)*)", page, flags=re.MULTILINE)
    commands.append(("estimate", page.split("| flag | meaning |")[1].split("\n\n")[0]))
    assert {word for word, _ in commands} == {"check", "estimate", "import-rosbag"}
    for word, arguments in commands:
        done = subprocess.run(
            ["python", "-m", "vigauge.cli", word, "--help"],
            capture_output=True,
            text=True,
            env=environment,
            check=True,
        )
        for flag in re.findall(r"--[a-z][a-z-]*", arguments):
            assert flag in done.stdout, (word, flag)
