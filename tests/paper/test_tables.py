"""Tables: what is averaged, what is marked, and that each format is well formed."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from support.results import covariance, solutions
from vigauge.model.archive import save_arrays
from vigauge_paper.tables import (
    latex,
    left_out,
    markdown,
    mean_errors,
    table1,
    table2,
    table3,
    wide_errors,
    worse_than_start,
)


@pytest.fixture
def solved(tmp_path: Path) -> Path:
    file = tmp_path / "solutions.csv"
    solutions("arc_plane").to_csv(file, index=False)
    return file


def test_table1_counts_parameters_and_shows_measured_ranks(tmp_path: Path) -> None:
    """Catches a rank that is copied from the number of rows instead of measured."""
    save_arrays(tmp_path / "c.npz", covariance() | {"rank_free": 7})
    rows = {str(row["gauge"]): row for row in table1(tmp_path / "c.npz")}
    assert rows["free"] == {"gauge": "free", "parameters": 42, "hessian_rows": 42, "hessian_rank": 7}
    assert rows["fix"]["parameters"] == 38
    assert rows["prior"]["hessian_rows"] == 42


def test_means_leave_out_failed_runs_and_other_noise_and_say_so(solved: Path) -> None:
    """Catches a diverged run, or a row of another noise model, in a mean."""
    table = pd.read_csv(solved)
    expected = mean_errors(solved)["fix"]["p_rmse_m"]
    extra = table[table["trial"] < 2].assign(p_rmse_m=99.0)
    extra = pd.concat([extra.assign(noise="consistent"), extra.assign(converged=False, trial=77)])
    pd.concat([table, extra[extra["gauge"] == "fix"]]).to_csv(solved, index=False)
    assert mean_errors(solved)["fix"]["p_rmse_m"] == pytest.approx(expected, rel=1e-15)
    assert left_out({"arc_plane": solved}) == " Left out, as they did not converge: 2 of arc_plane fix."


def test_a_gauge_that_never_converged_is_nan(solved: Path) -> None:
    """Catches a table that cannot be written because one sequence failed under one gauge."""
    table = pd.read_csv(solved)
    table.assign(converged=table["gauge"] != "prior").to_csv(solved, index=False)
    rows = {str(row["gauge"]): row for row in table2({"arc_plane": solved})}
    assert np.isnan(float(str(rows["prior"]["p_rmse_m"])))
    assert float(str(rows["fix"]["p_rmse_m"])) > 0


def test_an_end_worse_than_its_start_is_said(solved: Path) -> None:
    """Catches an optimisation that does harm and is only seen by comparing two notes."""
    table = pd.read_csv(solved)
    start = {
        f"start_{error}": 2.0 * table[error].mean() for error in ("p_rmse_m", "phi_rmse_deg", "v_rmse_mps")
    }
    table.assign(**start).to_csv(solved, index=False)
    assert worse_than_start({"arc_plane": solved}) == ""
    table.assign(**(start | {"start_phi_rmse_deg": 0.0})).to_csv(solved, index=False)
    found = worse_than_start({"arc_plane": solved})
    assert "Worse at the end" in found and found.count("arc_plane, phi from 0 to") == 1 and ";" not in found


def test_table3_names_its_source(solved: Path) -> None:
    """Catches a stand-in without its mark."""
    rows = table3({"rendered_hall": solved}, "rendered")
    assert list(rows[0]) == ["sequence", "source", "gauge", "p_rmse_m", "phi_rmse_deg", "v_rmse_mps"]
    assert {row["source"] for row in rows} == {"rendered"}


def _errors(fix: tuple[float, float, float], free: tuple[float, float, float]) -> list[dict[str, object]]:
    names = ("p_rmse_m", "phi_rmse_deg", "v_rmse_mps")
    return [
        {"configuration": "sine_plane", "gauge": gauge, **dict(zip(names, values, strict=True))}
        for gauge, values in (("fix", fix), ("free", free), ("prior", fix))
    ]


def test_bold_marks_the_smaller_where_the_digits_differ() -> None:
    """Catches bold for a difference that the digits shown do not have, or for the larger."""
    (row,) = wide_errors(_errors((0.010000, 0.20000, 0.3000), (0.010004, 0.1, 0.4)), None)
    assert row["fix, p (m)"] == row["free, p (m)"] == "0.01000"
    assert (row["fix, phi (deg)"], row["free, phi (deg)"]) == ("0.20000", "**0.10000**")
    assert (row["fix, v (m/s)"], row["free, v (m/s)"]) == ("**0.30000**", "0.40000")


def test_published_values_stand_beside_their_own_case(tmp_path: Path) -> None:
    """Catches the paper's row of another configuration."""
    file = tmp_path / "table2.csv"
    file.write_text(
        "configuration,gauge,p_rmse_m,phi_rmse_deg,v_rmse_mps\narc_plane,fix,9,9,9\nsine_plane,fix,1,2,3\n"
    )
    (row,) = wide_errors(_errors((0.1, 0.1, 0.1), (0.2, 0.2, 0.2)), file)
    assert row["fix, p (m)"] == "**0.10000** (1)"
    assert row["free, p (m)"] == "0.20000"
    (row,) = wide_errors(_errors((0.1, 0.1, 0.1), (0.2, 0.2, 0.2)), file, {"sine_plane": "arc_plane"})
    assert row["fix, v (m/s)"] == "**0.10000** (9)"


def test_markdown_and_latex_escape_what_would_break_them() -> None:
    """Catches a pipe, an underscore or a per cent sign that ends a cell, a word or a line."""
    rows: list[dict[str, object]] = [{"name_of": "a|b", "value": 0.123456, "text": "**1 %**"}]
    assert markdown(rows).splitlines()[-1] == r"| a\|b | 0.1235 | **1 %** |"
    lines = latex(rows, "a note").splitlines()
    assert lines[0] == r"\begin{tabular}{lll}"
    assert r"a|b & 0.1235 & \textbf{1 \%} \\" in lines
    assert r"name\_of & value & text \\" in lines


def test_what_must_be_known_first_stands_above() -> None:
    """A caveat below the numbers, or one that LaTeX would set as text outside the table."""
    rows = [{"a": 1}]
    assert markdown(rows, "note", "head").startswith("head\n\n| a |")
    assert latex(rows, "note", "head").splitlines()[:2] == ["% head", r"\begin{tabular}{l}"]
