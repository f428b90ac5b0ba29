"""Published numbers beside ours: every one is there, and what is off by a factor of two is marked."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest

from support import ROOT
from vigauge_paper.commands.comparison import work
from vigauge_paper.comparison.numbers import FACTOR, Number, comparison_rows, numbers, score

PUBLISHED = ROOT / "data" / "published"
SEQUENCES = {"MH_01_easy": "MH", "V1_01_easy": "VI"}


def _ours(folder: Path) -> Path:
    """Artefacts that hold exactly what the paper has, in our formats."""
    ours = {theirs: name for name, theirs in SEQUENCES.items()}
    pd.read_csv(PUBLISHED / "table2.csv").to_csv(folder / "table2.csv", index=False)
    table3 = pd.read_csv(PUBLISHED / "table3.csv")
    table3.assign(sequence=table3["sequence"].map(ours)).to_csv(folder / "table3.csv", index=False)
    fig04 = pd.read_csv(PUBLISHED / "fig04_prior_weight_rmse.csv")
    fig04 = fig04.assign(weight=fig04["weight_guess"], phi_rmse_deg=fig04["phi_rmse_rad"])
    fig04.to_csv(folder / "fig04_prior_weight_rmse.csv", index=False)
    fig05 = pd.read_csv(PUBLISHED / "fig05_prior_weight_cost.csv")
    fig05.to_csv(folder / "fig05_prior_weight_cost.csv", index=False)
    fig06 = pd.read_csv(PUBLISHED / "fig06_prior_error_paths.csv", dtype={"weight": str})
    wide = fig06.pivot(
        index=["weight", "step", "mean_reprojection_px"], columns="panel", values="prior_error"
    )
    wide = wide.reset_index().rename(
        columns={"step": "iteration", "yaw_rad": "prior_yaw_rad", "position_m": "prior_position_m"}
    )
    wide.to_csv(folder / "fig06_prior_error_paths.csv", index=False)
    for name, key in (("fig07_simulation_cost", "configuration"), ("fig11_euroc_cost", "sequence")):
        table = pd.read_csv(PUBLISHED / f"{name}.csv")
        table["median"] = table["median"].fillna(table["value"])
        table["experiment"] = table[key].replace(ours)
        table.to_csv(folder / f"{name}.csv", index=False)
    return folder


def test_every_published_number_is_there_and_equal_to_itself(tmp_path: Path) -> None:
    """Catches a row that is dropped, paired with another case, or read from another column."""
    table = numbers(_ours(tmp_path), PUBLISHED, SEQUENCES)
    assert {n.ratio for n in table} == {1.0}
    count = pd.Series([n.artefact for n in table]).value_counts()
    assert count["table2"] == 12 * 3
    assert count["table3"] == 4 * 3
    assert count["fig04"] == 17 * 3
    assert count["fig05"] == 20 * 3
    assert count["fig06"] == 23 + 2 * (23 - 5)
    assert count["fig07"] == 18 * 7
    assert count["fig11"] == 6 * 7
    assert score(table) == (0.0, 0.0)


def test_sequences_of_others_are_not_compared(tmp_path: Path) -> None:
    """A stand-in set beside EuRoC's numbers."""
    table = numbers(_ours(tmp_path), PUBLISHED, {})
    assert not {n.artefact for n in table} & {"table3", "fig11"}


@pytest.mark.parametrize("ratio", [0.49, 2.01, float("nan"), float("inf")])
def test_outside_is_either_way(ratio: float) -> None:
    """Catches a factor looked at from one side, and a ratio that does not exist passing for good."""
    assert Number("a", "b", "fix", "q", 1.0, ratio).outside
    assert not Number("a", "b", "fix", "q", 1.0, FACTOR).outside
    assert Number("a", "b", "fix", "q", 0.0, 1.0).outside
    assert not Number("a", "b", "fix", "q", 0.0, 0.0).outside


def test_rows_say_what_is_outside(tmp_path: Path) -> None:
    """Catches a mark that does not go with its ratio, or ours and the paper's exchanged."""
    one, *rest = numbers(_ours(tmp_path), PUBLISHED, SEQUENCES)
    row, *others = comparison_rows([replace(one, ours=3.0 * one.published), *rest])
    assert row["ratio"] == pytest.approx(3.0) and row["outside_factor_two"] is True
    assert not any(other["outside_factor_two"] for other in others)


def test_page_counts_and_lists_what_is_outside(tmp_path: Path) -> None:
    """Catches a page that hides a number that is off, or shows those that are not."""
    ours = _ours(tmp_path)
    table2 = pd.read_csv(ours / "table2.csv")
    table2.loc[0, "p_rmse_m"] *= 4.0
    table2.to_csv(ours / "table2.csv", index=False)
    names = list(SEQUENCES.items())
    work(
        argparse.Namespace(
            artefacts=ours,
            published=PUBLISHED,
            source="euroc",
            published_names=names,
            output=tmp_path / "comparison.csv",
        )
    )
    page = (tmp_path / "comparison.md").read_text("utf-8")
    assert "| table2 | 36 | 1 |" in page and "| fig05 | 60 | 0 |" in page
    assert len([line for line in page.splitlines() if line.startswith("| table2 |")]) == 2
