"""Figures 7 and 11: what is on the panels is whole, and the paper's times are ours times a stated factor."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from support import ROOT
from support.results import solutions, timing
from vigauge_paper.figures import cost
from vigauge_paper.figures.statistics import median_interval
from vigauge_paper.ids import FIGURE7_ORDER

PUBLISHED = ROOT / "data" / "published" / "fig07_simulation_cost.csv"


def draw(folder: Path, published: Path | None, rendered: bool = False) -> None:
    for name in FIGURE7_ORDER:
        solutions(name).to_csv(folder / f"{name}.solutions.csv", index=False)
        timing(name).to_csv(folder / f"{name}.timing.csv", index=False)
    files = (
        {name: folder / f"{name}.{kind}.csv" for name in FIGURE7_ORDER} for kind in ("solutions", "timing")
    )
    cost.draw_cost(*files, {name: name for name in FIGURE7_ORDER}, published, folder / "fig", rendered)


def test_nothing_is_cut_off(tmp_path: Path, drawn: list[Figure]) -> None:
    """Catches the crosses at seven iterations, half of which the upper edge hid."""
    draw(tmp_path, PUBLISHED)
    for panel in drawn[0].axes:
        low, high = panel.get_ylim()
        room = 0.02 * (high - low)
        for line in panel.lines:
            shown = np.asarray(line.get_ydata(), dtype=float)
            shown = shown[np.isfinite(shown)]
            assert (shown <= high - room).all() and (shown >= low).all()


def test_times_of_the_paper_are_read_off_the_axis_on_the_right(tmp_path: Path, drawn: list[Figure]) -> None:
    """Catches crosses in another unit than their axis, and a factor that is not the one drawn."""
    draw(tmp_path, PUBLISHED)
    panel = drawn[0].axes[0]
    (right,) = panel.child_axes
    factor = float(right.get_ylabel().removeprefix("paper (ms), ").removesuffix(" × left"))
    assert right.get_ylim() == pytest.approx(factor * np.array(panel.get_ylim()))
    table = pd.read_csv(PUBLISHED).query("quantity == 'time_s' and gauge == 'free'")
    wanted = 1e3 * table.set_index("configuration")["median"][list(FIGURE7_ORDER)]
    crosses = [factor * np.asarray(line.get_ydata()) for line in panel.lines if line.get_marker() == "x"]
    assert any(np.allclose(values, wanted) for values in crosses)


def test_the_legend_leaves_the_name_of_the_stand_in_free(tmp_path: Path, drawn: list[Figure]) -> None:
    """Catches a legend that hides that the data are not EuRoC's."""
    draw(tmp_path, None, rendered=True)
    (legend,), name = drawn[0].legends, drawn[0]._suptitle
    assert name is not None and name.get_text()
    assert not legend.get_window_extent().overlaps(name.get_window_extent())


def test_without_the_paper_there_is_no_second_axis(tmp_path: Path, drawn: list[Figure]) -> None:
    draw(tmp_path, None)
    assert not drawn[0].axes[0].child_axes
    assert not [line for panel in drawn[0].axes for line in panel.lines if line.get_marker() == "x"]


def test_experiments_none_of_whose_runs_converged_are_drawn_empty(
    tmp_path: Path, drawn: list[Figure], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Catches limits and factors of nothing, which are not numbers."""
    failed = solutions("sine_plane").assign(converged=False)
    monkeypatch.setattr(f"{__name__}.solutions", lambda name: failed)
    draw(tmp_path, PUBLISHED)
    assert not drawn[0].axes[0].child_axes
    assert (pd.read_csv(tmp_path / "fig.csv")["count"] == 0).all()


def test_two_per_cent_can_be_seen(tmp_path: Path, drawn: list[Figure]) -> None:
    """Catches an axis whose range hides the effect that the paper is about: 2 % in the made-up times."""
    draw(tmp_path, PUBLISHED)
    low, high = drawn[0].axes[2].get_ylim()
    assert low <= 0.98 and high >= 1.02 and high - low < 0.2
    rows = pd.read_csv(tmp_path / "fig.csv").query("quantity == 'time_per_iteration_ratio'")
    assert (rows["median_low"] <= rows["median"]).all() and (rows["median"] <= rows["median_high"]).all()


@pytest.mark.parametrize("count", [6, 7, 50, 101])
def test_interval_of_a_median_holds_as_often_as_it_says(count: int) -> None:
    """Catches the quartiles in its place, and bounds one place too far in."""
    rng = np.random.default_rng(3)
    bounds = np.array([median_interval(values) for values in rng.uniform(size=(4000, count))])
    share = np.mean((bounds[:, 0] <= 0.5) & (bounds[:, 1] >= 0.5))
    assert 0.945 < share < 0.99


def test_interval_of_few_values_is_their_range() -> None:
    assert median_interval(np.array([3.0, 1.0, 2.0])) == (1.0, 3.0)
    assert np.isnan(median_interval(np.empty(0))).all()
