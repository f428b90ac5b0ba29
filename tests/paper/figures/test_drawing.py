"""Figures from made-up results: files, bytes, the numbers beside them, and what they must say."""

from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Text

from support import ROOT
from support.results import WEIGHTS, Results, covariance, solutions, sweep, sweep_timing, sweep_trace, timing
from support.simulated import TIGHT, estimate, scene, trial
from vigauge.errors import OutputError
from vigauge.gauge.gauges import three_gauges
from vigauge.model.archive import load_arrays, save_arrays, save_states
from vigauge.model.state import State
from vigauge.solver.levenberg_marquardt import solve
from vigauge.synthetic.landmarks import PLANES
from vigauge_paper.figures import cost, ellipses, errors, matrices, narrow, orbit, prior, scenes, style
from vigauge_paper.figures.chart import Chart
from vigauge_paper.prior import READINGS

LEADING = "residual"
STAND_IN = "rendered stand-in, not EuRoC"
PUBLISHED = ROOT / "data" / "published"


@pytest.fixture
def written(tmp_path: Path) -> Path:
    """Folder of made-up result files."""
    for name in ("sine_plane", "arc_random"):
        solutions(name).to_csv(tmp_path / f"{name}.solutions.csv", index=False)
        timing(name).to_csv(tmp_path / f"{name}.timing.csv", index=False)
    sweep().to_csv(tmp_path / "sweep.csv", index=False)
    sweep_timing().to_csv(tmp_path / "sweep_timing.csv", index=False)
    sweep_trace().to_csv(tmp_path / "sweep_trace.csv", index=False)
    save_arrays(tmp_path / "covariance.npz", covariance())
    return tmp_path


@pytest.fixture
def texts(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[str]]:
    """All words on the figures that are drawn; nothing is rendered."""
    found: list[str] = []

    def keep(figure: Figure, stem: object) -> None:
        found.extend(artist.get_text() for artist in figure.findobj(Text))

    for module in (cost, ellipses, errors, matrices, prior):
        monkeypatch.setattr(module, "save_figure", keep)
    yield found


def draw_prior(folder: Path, out: Path, published: Path | None) -> None:
    """Figures 4, 5 and 6 as a, b and c, from the tables of a sweep under both readings."""
    tables = {
        kind: {reading: prior.read_sweep(folder / f"{kind}.csv", reading) for reading in READINGS}
        for kind in ("sweep", "sweep_timing", "sweep_trace")
    }
    sweeps = tables["sweep"]
    prior.draw_accuracy(sweeps[LEADING], out / "a", published)
    prior.draw_cost(sweeps, tables["sweep_timing"], out / "b", published)
    trace = tables["sweep_trace"][LEADING]
    prior.draw_paths(sweeps[LEADING], trace, out / "c", ["7", "100", "500", "1e8"], published)


def experiments(folder: Path, kind: str) -> dict[str, Path]:
    return {name: folder / f"{name}.{kind}.csv" for name in ("sine_plane", "arc_random")}


def draw_cost_of(folder: Path, stem: Path, rendered: bool = False) -> None:
    cost.draw_cost(experiments(folder, "solutions"), experiments(folder, "timing"), {}, None, stem, rendered)


DRAWINGS: dict[str, Callable[[Path, Path], None]] = {
    "cost": draw_cost_of,
    "matrices": lambda folder, stem: matrices.draw_covariances(folder / "covariance.npz", stem, "simulation"),
}


@pytest.mark.parametrize("name", DRAWINGS)
def test_same_results_give_the_same_bytes(written: Path, name: str) -> None:
    """Catches a date, a random identifier or a program's name in a figure file."""
    for run in ("a", "b"):
        DRAWINGS[name](written, written / run / "fig")
    made = sorted(str(file.relative_to(written / "a")) for file in (written / "a").rglob("fig.*"))
    assert {"fig.pdf", "fig.png", "narrow/fig.png"} < set(made)
    for file in made:
        assert (written / "a" / file).read_bytes() == (written / "b" / file).read_bytes(), file


def test_a_failing_writer_leaves_no_file(written: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Catches a half-written figure that a rerun would take for done."""

    def fail(self: Figure, target: object, **options: object) -> None:
        Path(str(target)).write_bytes(b"half")
        raise OSError("disk full")

    monkeypatch.setattr(Figure, "savefig", fail)
    with pytest.raises(OutputError, match="disk full; nothing was changed"):
        DRAWINGS["matrices"](written, written / "out" / "fig")
    assert not [file for file in (written / "out").rglob("*") if file.suffix in (".png", ".pdf")]


def test_figure_sizes_are_the_journals_columns(written: Path) -> None:
    """Catches a figure whose text shrinks because it is wider than the page."""
    import matplotlib.image

    DRAWINGS["matrices"](written, written / "fig")
    height, width = matplotlib.image.imread(written / "fig.png").shape[:2]
    assert width == round(200 * style.PAGE)
    assert 0 < height < 200 * 5


def test_panels_are_stacked_for_a_phone() -> None:
    """Catches panels that overlap, stay side by side, or lose the label they shared with their row."""
    with style.new_figure(style.PAGE, 4.0, 2, 2, sharey="row") as (figure, axes):
        for number, panel in enumerate(axes.T.flat):
            panel.set_title(f"panel {number}")
            panel.imshow(np.eye(3))
        figure.colorbar(axes[0, 0].images[0], ax=axes[:, 0], location="bottom")
        axes[0, 0].set_ylabel("error")
        narrow.stack(figure, style.COLUMN)
        figure.draw_without_rendering()
        boxes = [panel.get_tightbbox() for panel in axes.T.flat]
        assert figure.get_figwidth() == style.COLUMN
        assert all(above.y0 >= below.y1 for above, below in pairwise(boxes))
        assert all(box.x0 >= 0 and box.x1 <= figure.bbox.width for box in boxes)
        assert axes[0, 1].get_ylabel() == "error"
        assert axes[0, 1].yaxis.get_tick_params()["labelleft"]


@pytest.mark.parametrize("rendered", [True, False])
def test_stand_ins_are_named_on_every_figure_of_sequences(
    written: Path, texts: list[str], rendered: bool
) -> None:
    """Catches rendered data passing for EuRoC on Figures 1, 10 and 11."""
    source = "rendered" if rendered else "euroc"
    for draw in (
        lambda: draw_cost_of(written, written / "x", rendered),
        lambda: ellipses.draw_ellipses(written / "covariance.npz", written / "x", source),
        lambda: matrices.draw_covariances(written / "covariance.npz", written / "x", source),
    ):
        texts.clear()
        draw()
        assert (STAND_IN in texts) is rendered


def test_cost_numbers_are_those_of_the_results(written: Path, texts: list[str]) -> None:
    """Catches a gauge or a quantity drawn under another's name, and failed runs that nobody sees."""
    file = written / "sine_plane.solutions.csv"
    table = pd.read_csv(file)
    table.loc[(table["gauge"] == "free") & (table["trial"] == 0), ["converged", "iterations"]] = [False, 50]
    table.to_csv(file, index=False)
    draw_cost_of(written, written / "fig")
    rows = pd.read_csv(written / "fig.csv").set_index(["experiment", "gauge", "quantity"])
    assert rows.loc[("sine_plane", "free", "iterations"), "mean"] == 5.0
    assert rows.loc[("sine_plane", "free", "iterations"), "count"] == 11
    assert rows.loc[("sine_plane", "free", "time_s"), "count"] == 11
    assert rows.loc[("sine_plane", "fix", "iterations"), "median"] == 6.0
    assert rows.loc[("arc_random", "prior", "time_per_iteration_ratio"), "median"] == pytest.approx(1.02)
    assert "sine plane\n(1 not conv.)" in texts


def test_published_marks_appear_only_when_asked(written: Path, texts: list[str]) -> None:
    """Catches the paper's values on a stand-in, or missing where they are wanted."""
    draw_cost_of(written, written / "fig")
    assert "paper" not in texts
    names = {"sine_plane": "sine_plane", "arc_random": "arc_random"}
    cost.draw_cost(
        experiments(written, "solutions"), experiments(written, "timing"), names,
        PUBLISHED / "fig07_simulation_cost.csv", written / "fig",
    )  # fmt: skip
    assert "paper" in texts


def test_prior_figures_keep_the_order_of_the_weights(written: Path, texts: list[str]) -> None:
    """Catches weights in alphabetical order, a weight read as a number ("1e5" as 100000.0), lost rows."""
    draw_prior(written, written, PUBLISHED)
    read = {name: pd.read_csv(written / f"{name}.csv", dtype={"weight": str}) for name in "abc"}
    assert tuple(read["a"]["weight"]) == WEIGHTS
    assert tuple(read["b"].query("reading == @LEADING and quantity == 'iterations'")["median"]) == (
        4,
        12,
        8,
        6,
        5,
        5,
    )
    assert set(read["c"]["weight"]) == {"free", "7", "100", "500", "1e8"}
    assert any("paper" in text for text in texts)


def test_a_weight_under_which_nothing_converged_is_drawn_empty(written: Path, texts: list[str]) -> None:
    """Catches a sweep that cannot be drawn because one extreme weight failed throughout."""
    table = sweep()
    table.assign(converged=table["weight"] != "1e8").to_csv(written / "sweep.csv", index=False)
    draw_prior(written, written, None)
    rows = pd.read_csv(written / "b.csv", dtype={"weight": str}).set_index(["weight", "quantity"])
    assert (rows.loc[[("1e8", "iterations"), ("1e8", "time_s")], "count"] == 0).all()


def test_accuracy_is_drawn_as_change_with_the_papers_on_one_axis(written: Path, monkeypatch: Any) -> None:
    """Catches a second axis, on which all curves look alike, and changes of something else."""
    axes: list[Axes] = []
    monkeypatch.setattr(prior, "save_figure", lambda figure, stem: axes.extend(figure.axes))
    prior.draw_accuracy(prior.read_sweep(written / "sweep.csv", LEADING), written / "a", PUBLISHED)
    assert len(axes) == 3 and len({panel.get_ylim() for panel in axes}) == 1
    table = pd.read_csv(written / "a.csv")
    assert table["p_rmse_m_change_percent"].tolist() == pytest.approx(
        (100.0 * (table["p_rmse_m"] / table["p_rmse_m"][0] - 1.0)).tolist()
    )
    ours, theirs = axes[0].get_lines()
    assert ours.get_ydata() == pytest.approx(table["p_rmse_m_change_percent"])
    paper = pd.read_csv(PUBLISHED / "fig04_prior_weight_rmse.csv").set_index("weight")["p_rmse_m"]
    at_7 = WEIGHTS.index("7")
    assert theirs.get_ydata()[at_7] == pytest.approx(100.0 * (paper[7] / paper[0] - 1.0))


def test_both_readings_stand_beside_the_paper(written: Path, texts: list[str]) -> None:
    """Catches one reading drawn twice, or under the other's name."""
    for name in ("sweep", "sweep_timing"):
        table = pd.read_csv(written / f"{name}.csv", dtype={"weight": str})
        table["iterations"] += table["reading"] == "information"
        table.to_csv(written / f"{name}.csv", index=False)
    draw_prior(written, written, PUBLISHED)
    rows = pd.read_csv(written / "b.csv").query("quantity == 'iterations'")
    medians = {reading: table["median"].to_numpy() for reading, table in rows.groupby("reading")}
    assert (medians["information"] == medians["residual"] + 1).all()
    assert {"ours, weight multiplies the residual", "ours, weight is the information", "paper"} <= set(texts)


def test_ellipses_are_those_of_the_joint_covariance() -> None:
    """Catches variances drawn as lengths, a correlation left out, or the minor axis given the direction."""
    turn = np.radians(30.0)
    R = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    block = np.zeros((27, 27))
    block[3:5, 3:5] = R @ np.diag([4.0, 1.0]) @ R.T
    found = ellipses.xy_ellipses(block, 3)
    assert found[0]["semi_major_m"] == found[2]["semi_minor_m"] == 0.0
    assert (found[1]["semi_major_m"], found[1]["semi_minor_m"]) == pytest.approx((2.0, 1.0))
    assert np.tan(found[1]["angle_rad"]) == pytest.approx(np.tan(turn))


@pytest.mark.parametrize(("extent", "largest"), [(4.0, 0.001), (0.6, 0.0022), (1.0, 5.0)])
def test_enlargement_is_round_and_keeps_ellipses_apart(extent: float, largest: float) -> None:
    """Catches ellipses that swallow the flight; an uncertainty wider than the flight is not enlarged."""
    scale = ellipses.enlargement(extent, largest)
    assert scale >= 1.0
    assert scale == 1.0 or scale * largest < 0.2 * extent
    assert f"{scale:.0e}"[0] in "125"


def test_one_enlargement_for_all_curves_of_a_flight(written: Path, texts: list[str]) -> None:
    """Catches panels with different factors, which made the paper's Figure 1 hard to compare."""
    larger = {name: 9.0 * a for name, a in covariance().items() if name in ("free", "transformed", "fixed")}
    save_arrays(written / "second.npz", covariance() | larger)
    ellipses.draw_ellipses(
        written / "covariance.npz", written / "fig", "euroc", beside=[written / "second.npz"]
    )
    flights = dict(list(pd.read_csv(written / "fig.csv").groupby("sequence")))
    assert set(flights) == {"covariance", "second"}
    for name, table in flights.items():
        assert table["enlargement"].nunique() == 1
        assert set(table["curve"]) == {"free", "transformed", "fixed"}
        assert f"{name}\nellipses enlarged {table['enlargement'].iloc[0]:g} times" in texts
    sizes = [table["semi_major_m"].max() for table in flights.values()]
    assert sizes[1] == pytest.approx(3.0 * sizes[0])


def test_a_withheld_flight_stands_beside_the_others_in_words(written: Path, texts: list[str]) -> None:
    """Catches a sequence without covariance that empties the figure, or vanishes from it."""
    save_arrays(written / "still.npz", {"withheld": "degenerate: standing still"})
    ellipses.draw_ellipses(
        written / "still.npz", written / "fig", "euroc", beside=[written / "covariance.npz"]
    )
    table = pd.read_csv(written / "fig.csv").set_index("sequence")
    assert table.loc["still", "withheld"] == "degenerate: standing still"
    assert table.loc["covariance", "semi_major_m"].notna().all()
    assert "Covariance withheld. still: degenerate: standing still." in texts


def test_held_parameters_are_found_by_their_zero_variance() -> None:
    """Catches yellow bands for rounding residue missed, or for parameters that are just well known."""
    arrays = covariance()
    held = matrices.held_entries(np.asarray(arrays["fixed"]))
    assert list(np.flatnonzero(held)) == [0, 1, 2, 11]
    assert not matrices.held_entries(np.asarray(arrays["free"])).any()
    with_rounding = np.asarray(arrays["fixed"]) + 1e-22 * np.eye(27)
    assert np.array_equal(matrices.held_entries(with_rounding), held)


def test_white_is_the_epsilon_of_the_text() -> None:
    """Section VI-B: catches the 1e-6 of the published figure."""
    assert matrices.logarithm(np.zeros((1, 1)))[0, 0] == pytest.approx(-7.0)


def test_covariance_figure_keeps_the_contract_arrays(written: Path, texts: list[str]) -> None:
    """Catches arrays that are scaled, or whose name changed."""
    matrices.draw_covariances(written / "covariance.npz", written / "fig", "euroc")
    kept, original = load_arrays(written / "fig.npz"), covariance()
    for name in ("free", "transformed", "fixed"):
        assert np.array_equal(kept[name], np.asarray(original[name]))
    assert kept["relative_frobenius_same_point"] == 1e-12
    assert kept["relative_frobenius_converged"] == 1e-5


def test_scene_figure_shows_every_point(tmp_path: Path) -> None:
    """Catches landmarks or keyframes lost between the file and the figure."""
    truth = scene().truth
    save_states(tmp_path / "truth.npz", [truth])
    path = scene().trajectory.p_W(np.linspace(0.0, 2.5, 20))
    pd.DataFrame(path, columns=["x_m", "y_m", "z_m"]).to_csv(tmp_path / "path.csv", index=False)
    scenes.draw_scenes(["sine random"], [tmp_path / "truth.npz"], [tmp_path / "path.csv"], tmp_path / "fig")
    kinds = pd.read_csv(tmp_path / "fig.csv")["kind"].value_counts()
    assert kinds.to_dict() == {"landmark": truth.n_landmarks, "trajectory": 20, "keyframe": truth.n_keyframes}
    assert (tmp_path / "fig.pdf").stat().st_size > 1000


def test_landmarks_on_planes_are_shown_with_their_planes(tmp_path: Path) -> None:
    """Catches a rectangle on another plane than its landmarks', or one that leaves some of them out."""
    X_W = scene(points="plane").truth.X_W
    patches = scenes.plane_patches(X_W)
    assert len(patches) > 1
    assert sorted(row for _, rows in patches.values() for row in rows) == list(range(len(X_W)))
    for plane, (corners, rows) in patches.items():
        normal, offset = PLANES[plane]
        assert corners @ normal == pytest.approx(np.full(4, offset))
        within = np.abs(normal) < 0.5
        assert (X_W[rows][:, within] >= corners[:, within].min(axis=0)).all()
        assert (X_W[rows][:, within] <= corners[:, within].max(axis=0)).all()
        assert np.abs(X_W[rows] @ normal - offset).max() < 0.5


def test_computed_sketches_keep_what_they_show(tmp_path: Path) -> None:
    """Figures 2 and 8: catches paths that do not start together, do not go down, or leave their gauge."""
    problem = trial()
    solutions_of = {
        name: solve(problem, gauge, TIGHT, keep_states=True) for name, gauge in three_gauges(2000.0).items()
    }
    chart = Chart.around(problem, estimate())
    orbit.draw_paths(chart, solutions_of, tmp_path / "paths", 2000.0)
    orbit.draw_transformation(chart, tmp_path / "carried")
    table = pd.read_csv(tmp_path / "paths.csv")
    paths = dict(list(table[table["kind"] == "iterate"].groupby("curve")))
    assert set(paths) == {"fix", "free", "prior"}
    for path in paths.values():
        assert path.iloc[0][["alpha_rad", "s"]].tolist() == pytest.approx([chart.start_yaw, 1.0], abs=1e-9)
        assert path["cost"].is_monotonic_decreasing
        assert abs(path["s"].iloc[-1]) < 1e-4
    assert paths["free"]["alpha_rad"].iloc[-1] == pytest.approx(0.0, abs=1e-3)
    for gauge in ("fix", "prior"):
        assert paths[gauge]["alpha_rad"].iloc[-1] == pytest.approx(chart.gauge_yaw(0.0), abs=1e-4)
    shades = table[table["kind"] == "cost"]
    assert shades["s"].iloc[shades["cost"].argmin()] == pytest.approx(0.0, abs=0.01)
    vectors = pd.read_csv(tmp_path / "carried.csv").query("kind == 'vector'").set_index("curve")
    assert np.ptp(vectors["s"]) < 1e-12
    assert vectors.loc["projected", "alpha_rad"] != vectors.loc["carried", "alpha_rad"]


def test_sketches_name_their_axes_point_along_the_paths_and_keep_words_inside(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Catches a drawing that only its author can read, and labels that the frame cuts or leaves out."""
    arrows: list[str] = []

    def look(figure: Figure, stem: Path) -> None:
        figure.canvas.draw()
        axes = figure.axes[0]
        frame = axes.get_window_extent()
        inner = [text for text in axes.texts if text.get_text()]
        outside = [
            text.get_text() for text in inner if not frame.contains(*text.get_window_extent().min)
            or not frame.contains(*text.get_window_extent().max)
        ]  # fmt: skip
        assert inner and outside == []
        if stem.name == "paths":
            assert "yaw along the orbit" in axes.get_xlabel() and "distance" in axes.get_ylabel()
            assert "cost" in figure.axes[1].get_ylabel()
            arrows.extend(
                mpl.colors.to_hex(text.arrow_patch.get_edgecolor()).upper()
                for text in axes.texts
                if isinstance(text, mpl.text.Annotation) and text.arrow_patch is not None
            )
        else:
            assert axes.get_title() == ""

    monkeypatch.setattr(orbit, "save_figure", look)
    solutions_of = {
        name: solve(trial(), gauge, TIGHT, keep_states=True) for name, gauge in three_gauges(50.0**2).items()
    }
    chart = Chart.around(trial(), estimate())
    orbit.draw_paths(chart, solutions_of, tmp_path / "paths", 50.0)
    orbit.draw_transformation(chart, tmp_path / "carried")
    assert set(arrows) == {style.COLOURS[gauge] for gauge in style.LABELS}


def test_failures_are_counted_where_they_happened(tmp_path: Path, texts: list[str]) -> None:
    """One weight's failures spread over all, or one gauge's, or a path that looks like any other."""

    def fail(table: pd.DataFrame) -> pd.DataFrame:
        bad = (table["weight"] == "500") & (table["trial"] < 2)
        return table.assign(
            converged=~bad,
            status=table["status"].mask(bad, "iteration limit"),
            p_rmse_m=table["p_rmse_m"].mask(bad, 1e9),
        )

    def fail_fix(table: pd.DataFrame) -> pd.DataFrame:
        return table.assign(converged=(table["gauge"] != "fix") | (table["trial"] > 2))

    Results(tmp_path / "run", sweep=fail, solutions={"arc_plane": fail_fix}).write()
    run = tmp_path / "run"
    draw_prior(run, tmp_path, None)
    rmse = pd.read_csv(tmp_path / "a.csv", dtype={"weight": str}).set_index("weight")
    assert rmse["excluded"].to_dict() == {w: 2 if w == "500" else 0 for w in rmse.index}
    assert rmse["p_rmse_m"].max() < 0.1
    boxes = pd.read_csv(tmp_path / "b.csv", dtype={"weight": str}).groupby("weight")["excluded"].max()
    assert boxes["500"] == 2 and boxes.drop("500").max() == 0
    assert any("left out, not converged: 2 at 500" in text for text in texts)
    assert any("left out, not converged: 4 at 500" in text for text in texts), "of both readings of Figure 5"
    paths = pd.read_csv(tmp_path / "c.csv", dtype={"weight": str}).groupby("weight")["status"].first()
    assert paths["500"] == "iteration limit" and paths["100"] == "function tolerance"
    assert any("500 (iteration limit)" in text for text in texts)
    rows = pd.DataFrame(
        cost.cost_rows("arc_plane", run / "arc_plane/solutions.csv", run / "arc_plane/timing.csv")
    )
    assert rows.groupby("gauge")["excluded"].max().to_dict() == {"fix": 3, "free": 0, "prior": 0}


def test_the_paper_stands_beside_ours(written: Path, texts: list[str]) -> None:
    """A switch that shows nothing; ours labelled as the paper's."""
    matrices.draw_covariances(
        written / "covariance.npz", written / "x", "simulation", PUBLISHED / "fig09.npz"
    )
    ellipses.draw_ellipses(
        written / "covariance.npz", written / "y", "euroc", PUBLISHED / "fig01_euroc_ellipses.csv"
    )
    for name in ("(d) Paper, free", "(f) Paper, fixed"):
        assert name in texts
    assert any(text.startswith("Paper (its MH)") for text in texts)


def test_published_ellipses_have_deviations_and_their_longer_axis() -> None:
    """Catches variances drawn as lengths, and x taken for y."""
    file = PUBLISHED / "fig01_euroc_ellipses.csv"
    p_W, found = ellipses.published_ellipses(file, "free")
    row = pd.read_csv(file).query("curve == 'free' and record == 'ellipse' and keyframe == 3").iloc[0]
    assert tuple(p_W[3]) == (row["x"], row["y"])
    assert found[3]["semi_major_m"] ** 2 == pytest.approx(row["var_x_m2"])
    assert found[3]["semi_minor_m"] ** 2 == pytest.approx(row["var_y_m2"])
    assert found[3]["angle_rad"] == 0.0
    held = ellipses.published_ellipses(file, "fixed")[1][0]
    assert held["semi_major_m"] < 1e-6


def test_errors_stand_beside_their_sigmas(tmp_path: Path, texts: list[str]) -> None:
    """A sigma of another keyframe or quantity, or an error in a gauge that is not the sigma's."""
    truth = scene("sine", "plane").truth
    truth = State.start(truth.p_W, truth.R_WB, truth.v_W, np.empty((0, 3)))
    n = truth.n_keyframes
    v_W = truth.v_W.copy()
    v_W[4] += [0.0, 0.3, 0.4]
    wrong = State.start(truth.p_W, truth.R_WB, v_W, truth.X_W).transformed(0.7, np.array([1.0, 2.0, 3.0]))
    fixed = np.diag(np.repeat(np.arange(3 * n, dtype=float), 3))
    arrays = {"withheld": np.array(""), "fixed": fixed}
    arrays |= {"p_W_fixed": wrong.p_W, "R_WB_fixed": wrong.R_WB, "v_W_fixed": wrong.v_W}
    save_arrays(tmp_path / "c.npz", arrays)
    save_arrays(tmp_path / "none.npz", {"withheld": np.array("degenerate: scale")})
    save_states(tmp_path / "truth.npz", [truth])
    truths = {"hall": tmp_path / "truth.npz", "room": tmp_path / "truth.npz"}
    archives = {"hall": tmp_path / "c.npz", "room": tmp_path / "none.npz"}
    errors.draw_errors(archives, truths, tmp_path / "figure", rendered=True)
    table = pd.read_csv(tmp_path / "figure.csv").set_index(["quantity", "keyframe"])
    assert list(table.loc["p"].index) == list(range(1, n))
    assert table.loc[("v", 4), "error"] == pytest.approx(0.5)
    assert table.loc[("v", 4), "sigma"] == pytest.approx(np.sqrt(3 * (2 * n + 4)))
    assert table["error"].drop(("v", 4)).max() < 1e-9
    assert STAND_IN in texts and "hall" in texts and "room" not in texts
