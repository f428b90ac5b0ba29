"""Times of several experiments taken in one process."""

import json
from argparse import Namespace
from dataclasses import asdict
from itertools import pairwise
from pathlib import Path

import pandas as pd

from support import simulated
from vigauge.model.archive import save_problems
from vigauge.solver.levenberg_marquardt import Options
from vigauge_paper.commands import time_sweep
from vigauge_paper.commands.time_solves import work
from vigauge_paper.prior import RESIDUAL


def test_experiments_take_turns_and_the_speed_of_the_machine_is_recorded(tmp_path: Path) -> None:
    """One experiment timed after the other, so that a drift of the machine passes for their difference.

    Fixation timed right after itself, so that the caches that it finds warm pass for a quicker gauge.
    """
    for name, count in (("one", 2), ("two", 1)):
        save_problems(tmp_path / f"{name}.npz", [simulated.trial(number) for number in range(count)])
    work(
        Namespace(
            problems=[(name, tmp_path / f"{name}.npz") for name in ("one", "two")],
            prior_weight=1e5,
            prior_reading=RESIDUAL,
            solver=asdict(Options()),
            noise={"two": {"headline": {"sigma_px": 2.0, "density_factor": 1.0}}},
            repeats=2,
            timing=tmp_path / "timing.csv",
            machine=tmp_path / "machine.json",
        )
    )
    table = pd.read_csv(tmp_path / "timing.csv")
    turns = table.drop_duplicates(["repeat", "experiment", "trial"])
    assert list(zip(turns["experiment"], turns["trial"], strict=True)) == 2 * [
        ("one", 0),
        ("two", 0),
        ("one", 1),
    ]
    assert (table.groupby(["repeat", "experiment", "trial"])["gauge"].nunique() == 5).all()
    assert (table["seconds"] > 0).all()
    for _, turn in table.groupby(["repeat", "experiment", "trial"]):
        assert not {("fix", "fix_again"), ("fix_again", "fix")} & set(pairwise(turn["gauge"]))
    speed = json.loads((tmp_path / "machine.json").read_text("utf-8"))["speed"]
    assert len(speed["reference_s"]) == 2 + 1  # before every repeat and at the end
    assert speed["drift"] == max(speed["reference_s"]) / min(speed["reference_s"]) - 1.0


def test_weights_of_a_sweep_take_turns_under_both_readings(tmp_path: Path) -> None:
    """Catches a weight that is always timed first, and a reading whose times are the other's."""
    save_problems(tmp_path / "problems.npz", [simulated.trial(number) for number in range(2)])
    solver, timing, weights = asdict(Options()), tmp_path / "timing.csv", ["0", "1e5"]
    files = {"problems": tmp_path / "problems.npz", "timing": timing}
    time_sweep.work(Namespace(**files, weights=weights, solver=solver, repeats=1))
    table = pd.read_csv(timing, dtype={"weight": str})
    turns = table.groupby(["reading", "trial"], sort=False)["weight"].agg(list)
    assert list(turns) == 2 * [["0", "1e5", "free"], ["1e5", "free", "0"]]
    counts = table.groupby(["reading", "weight"])["iterations"].sum()
    assert counts["residual", "free"] == counts["information", "free"]
    assert (table["seconds"] > 0).all()
