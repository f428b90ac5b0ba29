"""The figure of what a prior's weight multiplies: the slopes it states, and lines too short for one."""

from pathlib import Path

import pandas as pd
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

from support.results import reasons
from vigauge_paper.figures import reading
from vigauge_paper.prior import INFORMATION, RESIDUAL


def test_each_line_states_its_own_slope(tmp_path: Path, drawn: list[Figure]) -> None:
    """Catches the slope of one reading under the other's name, one made up from one weight, lost dots."""
    table = reasons()["reading"]
    lone = (table["source"] == INFORMATION) & (table["quantity"] == "yaw_rad") & (table["weight"] > 7.0)
    table.loc[table["quantity"] == "yaw_rad", "pull"] /= 100.0
    table[~lone].to_csv(tmp_path / "reading.csv", index=False)
    reading.draw_reading(tmp_path / "reading.csv", tmp_path / "fig")
    words = [text.get_text() for text in drawn[0].findobj(Text)]
    assert words.count("ours, weight is the information: slope 1.00") == 1
    assert words.count("ours, weight is the information") == 1
    assert words.count("ours, weight multiplies the residual: slope 2.00") == 2
    assert words.count("paper's Fig. 6: slope 2.00") == 2
    low, high = drawn[0].axes[1].get_ylim()
    assert all(low < y < high for panel in drawn[0].axes for line in panel.lines for y in line.get_ydata())
    rows = pd.read_csv(tmp_path / "fig.csv")
    assert len(rows) == (~lone).sum()
    slopes = rows.groupby(["source", "quantity"])["slope"].first()
    assert slopes[RESIDUAL, "position_m"] == pytest.approx(2.0)
    assert pd.isna(slopes[INFORMATION, "yaw_rad"])
