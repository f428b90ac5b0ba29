"""Spread over changes of the front-end: what is in it, and what the note may say of it."""

import pandas as pd
import pytest
import yaml

from support import ROOT
from support.results import solutions
from vigauge_paper.spread import spread_rows, spread_sentence, spread_table
from vigauge_paper.workflow.sequences import Sequences


def form(scale: float, free: float = 1.0) -> pd.DataFrame:
    """Results of one form: errors times ``scale``, and those of the free gauge times ``free``."""
    table = solutions("arc_plane", 1)
    for error in ("p_rmse_m", "phi_rmse_deg", "v_rmse_mps"):
        values = {"fix": 0.01, "free": 0.01 * free, "prior": 0.01}
        table[error] = scale * table["gauge"].map(values)
        table[f"start_{error}"] = 2.0 * scale * 0.01
    return table


def test_median_and_range_are_over_the_forms_of_the_headline_noise() -> None:
    """A form that failed, or another noise model, in the range; a difference between gauges across forms."""
    failed = form(50.0).assign(converged=False)
    other = form(70.0).assign(noise="consistent")
    forms = [form(1.0), form(3.0, 1.01), pd.concat([form(2.0), other]), failed]
    rows = {(row["gauge"], row["quantity"]): row for row in spread_rows("hall", forms)}
    free = rows["free", "p_rmse_m"]
    assert free["runs"] == 3
    assert [free[key] for key in ("least", "median", "greatest")] == pytest.approx([0.01, 0.02, 0.0303])
    assert free["gauge_difference"] == pytest.approx(0.01)
    assert rows["prior", "p_rmse_m"]["gauge_difference"] == 0.0
    assert rows["prior", "p_rmse_m"]["below_fixation"] == 0
    assert rows["fix", "start_v_rmse_mps"]["greatest"] == pytest.approx(0.06)


@pytest.mark.parametrize(("free", "words"), [(1.0003, "is far below"), (1.5, "is not far below")])
def test_the_note_says_whether_gauges_differ_by_less_than_changes(free: float, words: str) -> None:
    """A sentence that stands whatever was measured."""
    text = spread_sentence(pd.DataFrame(spread_rows("hall", [form(1.0, free), form(1.2), form(1.1)])))
    assert words in text
    assert "p 11 (10 to 12) mm" in text and "fix iterations 6 (6 to 6)" in text
    assert "fewer under free in 3 runs" in text


def test_the_page_shows_two_digits_by_sequence_and_gauge() -> None:
    """Catches metres beside millimetres, and dozens of rows of seventeen digits in the place of a table."""
    rows = spread_table(pd.DataFrame(spread_rows("hall", [form(1.0), form(1.234), form(1.1)])))
    assert [row["gauge"] for row in rows] == ["fix", "free", "prior"]
    assert rows[1]["runs"] == 3 and rows[1]["p (mm)"] == "11 (10 to 12)"
    assert rows[1]["phi (deg)"] == "0.011 (0.01 to 0.012)" and rows[1]["start p (mm)"] == "22 (20 to 25)"


def test_changed_forms_share_the_check_of_their_sequence() -> None:
    """Catches a recording that is checked anew for every form, and a form whose own part is not checked."""
    config = yaml.safe_load((ROOT / "config" / "config.yaml").read_text("utf-8"))
    sequences = Sequences.of(config, "somewhere")
    assert sequences.check("MH_01_seed_1") == sequences.check("MH_01_easy") == "data/checks/MH_01_easy.json"
    for other in ("V1_01_easy", "MH_01_frame_later", "MH_01_default"):  # recording, part, faults accepted
        assert sequences.check(other) == f"data/checks/{other}.json"
