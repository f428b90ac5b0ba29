"""Figure 6: every path with its weight, every iteration with its number, the paper's and ours."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from support import ROOT
from support.results import sweep, sweep_trace
from vigauge_paper.figures import prior
from vigauge_paper.prior import RESIDUAL

PUBLISHED = ROOT / "data" / "published"
WEIGHTS = ["7", "100", "500", "1e8"]


def draw(stem: Path, published: Path | None) -> None:
    tables = (table[table["reading"] == RESIDUAL] for table in (sweep(), sweep_trace()))
    prior.draw_paths(*tables, stem, WEIGHTS, published)


def iterations(panel: Axes, weight: str) -> set[int]:
    """The iterations whose numbers stand in the column of a weight."""
    (header,) = [text for text in panel.texts if text.get_text() == weight]
    column = [t for t in panel.texts if t is not header and t.get_position()[0] == header.get_position()[0]]
    ends = [[int(end) for end in text.get_text().split("–")] for text in column]
    return {step for end in ends for step in range(end[0], end[-1] + 1)}


def test_every_path_has_its_weight_and_every_iteration_its_number(
    tmp_path: Path, drawn: list[Figure]
) -> None:
    """Catches the paper's curves without weights, and iterations that nobody can tell apart."""
    draw(tmp_path / "fig", PUBLISHED)
    paper = pd.read_csv(PUBLISHED / "fig06_prior_error_paths.csv", dtype={"weight": str})
    last = paper.groupby(["panel", "weight"])["step"].max()
    above, ours = drawn[0].axes[:2], drawn[0].axes[2:]
    for panel, quantity in zip(above, ("yaw_rad", "position_m"), strict=True):
        for weight in ("free", *WEIGHTS):
            assert iterations(panel, weight) == set(range(1, last[quantity, weight] + 1))
    assert all(iterations(panel, weight) == {1, 2, 3, 4} for panel in ours for weight in WEIGHTS)


def test_paths_are_the_papers_own_and_ours(tmp_path: Path, drawn: list[Figure]) -> None:
    """Catches yaw drawn as position, and a row under the other's name."""
    draw(tmp_path / "fig", PUBLISHED)
    paper = pd.read_csv(PUBLISHED / "fig06_prior_error_paths.csv", dtype={"weight": str})
    wanted = paper.query("panel == 'position_m' and weight == '100'")["prior_error"]
    assert any(
        np.allclose(line.get_ydata(), wanted) for line in drawn[0].axes[1].lines if len(line.get_ydata()) == 6
    )
    own = sweep_trace().query("reading == @RESIDUAL and weight == '100'")["prior_yaw_rad"]
    assert any(np.array_equal(line.get_ydata(), own) for line in drawn[0].axes[2].lines)
    assert [axes.get_title(loc="left").split(";")[0] for axes in drawn[0].axes] == ["Paper"] * 2 + [
        "Ours"
    ] * 2


def test_a_path_that_did_not_converge_says_so(tmp_path: Path, drawn: list[Figure]) -> None:
    """Catches a run that was cut off looking like any other."""
    table = sweep().query("reading == @RESIDUAL")
    bad = table["weight"] == "500"
    table = table.assign(converged=~bad, status=table["status"].mask(bad, "iteration limit"))
    prior.draw_paths(table, sweep_trace().query("reading == @RESIDUAL"), tmp_path / "fig", WEIGHTS, PUBLISHED)
    told = ["500 (iteration limit)" in [t.get_text() for t in panel.texts] for panel in drawn[0].axes]
    assert told == [False, False, True, True]


def test_errors_of_zero_and_of_all_sizes_are_seen(tmp_path: Path, drawn: list[Figure]) -> None:
    """Catches the start, where the error is zero, lost by the logarithm; small errors lost without it."""
    draw(tmp_path / "fig", None)
    assert len(drawn[0].axes) == 2
    for panel in drawn[0].axes:
        to_display = panel.transData.transform
        heights = to_display([(1.0, y) for y in (0.0, 1e-5, 1e-4, 1e-3, 1e-2)])[:, 1]
        low, high = panel.transAxes.transform([(0, 0), (0, 1)])[:, 1]
        assert (np.diff(heights) > 0.05 * (high - low)).all()
        assert low <= heights[0] and heights[-1] < high


@pytest.mark.parametrize(
    ("heights", "wanted"),
    [
        ([-9.0, -1.0, -2.0, -3.0], ["1", "2", "3"]),
        ([-9.0, -1.0, -1.1, -1.2, -2.0], ["1–3", "4"]),
        ([-9.0, -1.0, -2.0, -2.2, -2.31], ["1", "2–4"]),
        ([-9.0], []),
    ],
)
def test_labels_that_would_overlap_are_one(heights: list[float], wanted: list[str]) -> None:
    assert [text for text, _ in prior._ranges(np.array(heights))] == wanted
