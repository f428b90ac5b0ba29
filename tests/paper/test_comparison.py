"""Published numbers beside ours: every one is there, and whether it lies in our range is told right."""

import argparse
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from support import ROOT
from support.results import Results as MadeUp
from support.results import covariance
from support.simulated import trial
from vigauge.covariance.covariance import motion_covariance
from vigauge.gauge.gauges import FixedGauge
from vigauge.model.archive import save_arrays, save_problems
from vigauge.solver.levenberg_marquardt import Options, solve
from vigauge_paper.commands.comparison import work
from vigauge_paper.comparison.number import Number, counts, machine, number, score
from vigauge_paper.comparison.numbers import Results, numbers
from vigauge_paper.comparison.sigmas import deviations, of_trials
from vigauge_paper.comparison.variants import explained_by_chance, variants
from vigauge_paper.prior import RESIDUAL
from vigauge_paper.run.provenance import Stamp, write_stamp

PUBLISHED = ROOT / "data" / "published"
SEQUENCES = {"MH_01_easy": "MH", "V1_01_easy": "VI"}


@pytest.fixture
def results(tmp_path: Path) -> Results:
    """Made-up results, with the paper's 30 keyframes on the sequences and two trials for Fig. 9."""
    made_up = MadeUp(tmp_path / "made_up", covariance=dict.fromkeys(SEQUENCES, covariance(30))).write()
    problems = tmp_path / "problems.npz"
    save_problems(problems, [trial(0), trial(1)])
    del made_up["reasons"]
    return Results(
        **made_up,
        reading=RESIDUAL,
        problems=problems,
        solver=Options(),
        published=PUBLISHED,
        sequences=SEQUENCES,
    )


def test_every_published_number_is_there(results: Results) -> None:
    """Catches a row that is dropped; weights of the paper that the made-up sweep lacks are left out."""
    table, times = numbers(results)
    count = {str(row["artefact"]): row["numbers"] for row in counts(table)}
    assert count["table2, fix"] == count["table2, free"] == 18
    assert count["table3, fix"] == count["table3, free"] == 6
    assert count["fig04"] == 5 * 3 and count["fig05"] == 4 * 3
    assert count["fig06"] == 23 + 2 * (23 - 5)
    assert count["fig07"] == 18 * 3 + 12 and count["fig11"] == 6 * 3 + 4
    assert count["fig09"] == (10 + 9) * 3 and count["fig10"] == (30 + 29) * 3
    assert count["fig01"] == 30 + 29
    assert len(times) == 4 + 18 + 6


def test_numbers_are_paired_with_their_own(results: Results) -> None:
    """Catches a number of another case or gauge, and a range that is not that of the trials."""
    table, _ = numbers(results)
    own = pd.read_csv(results.solutions["rec_plane"]).query("gauge == 'free'")["v_rmse_mps"]
    (found,) = (
        n
        for n in table
        if (n.artefact, n.case, n.gauge, n.quantity) == ("table2", "rec_plane", "free", "v_rmse_mps")
    )
    assert found.published == 0.01495
    assert (found.ours, found.low, found.high) == pytest.approx((own.mean(), own.min(), own.max()))


def test_one_problem_has_no_range(results: Results) -> None:
    """Catches a sequence's single run passing for a range of its own."""
    table, _ = numbers(results)
    alone = [n for n in table if n.artefact in ("table3", "fig01", "fig10")]
    assert alone and all(n.inside is None for n in alone)
    assert all(n.inside is not None for n in table if n.artefact in ("table2", "fig05", "fig09"))


def test_sequences_of_others_are_not_compared(results: Results) -> None:
    """A stand-in set beside EuRoC's numbers."""
    table, times = numbers(replace(results, sequences={}))
    assert not {n.artefact for n in [*table, *times]} & {"table3", "fig01", "fig10", "fig11"}


def test_other_numbers_of_keyframes_and_withheld_covariances_are_left_out(results: Results) -> None:
    """Catches keyframes set beside others, and numbers from an archive that has none."""
    other = dict(results.covariances)
    for name, file in other.items():
        save_arrays(file, covariance(4) if name == "MH_01_easy" else {"withheld": np.array("degenerate")})
    assert not {n.artefact for n in numbers(results)[0]} & {"fig01", "fig10"}


@pytest.mark.parametrize(("published", "inside"), [(0.9, False), (1.0, True), (3.0, True), (3.1, False)])
def test_inside_is_from_the_smallest_to_the_largest(published: float, inside: bool) -> None:
    """Catches a range that is looked at from one side."""
    found = number("a", "b", "fix", "q", published, [1.0, 2.0, 3.0])
    assert found.inside is inside and found.ours == 2.0
    assert number("a", "b", "fix", "q", published, [1.0]).inside is None


def test_all_times_are_one_factor() -> None:
    """Catches a mean that is not geometric, and a spread that is not around the factor."""
    times = [Number("fig07", "a", "fix", "time_s median", 1.0, ours, np.nan, np.nan) for ours in (0.1, 0.4)]
    row = machine(times)
    assert row["ratio"] == pytest.approx(0.2)
    assert (row["low"], row["high"]) == pytest.approx((0.1, 0.4)) and row["inside_our_range"] is None


def test_score_is_of_fixation_in_table_two() -> None:
    pair = [number("table2", "a", "fix", "q", 1.0, [x]) for x in (0.5, 4.0)]
    other = [number("table2", "a", "free", "q", 1.0, [9.0]), number("fig05", "a", "fix", "q", 1.0, [9.0])]
    assert score(pair + other) == pytest.approx((1.5 * np.log(2.0), np.log(4.0)))


def test_deviations_are_those_of_keyframes() -> None:
    """Catches blocks or keyframes exchanged."""
    blocks = np.array([[1.0, 4.0], [9.0, 16.0], [25.0, 36.0]])  # p, phi, v of two keyframes
    found = deviations(np.diag(np.repeat(blocks.ravel(), 3) / 3.0))
    assert np.allclose(found, np.sqrt(blocks).T)
    own = motion_covariance(trial(1), solve(trial(1), FixedGauge()).state, FixedGauge())
    assert np.allclose(of_trials([trial(0), trial(1)], Options())["fixed"][1], deviations(own))


def _hypothesis(folder: Path, with_bias: float) -> Path:
    file = folder / "bias_hypothesis.csv"
    row = {"published": 1.0, "without": 0.25, "with_bias": with_bias, "ratio": with_bias}
    pd.DataFrame([row, row]).to_csv(file, index=False)
    return file


def _sweep(folder: Path) -> Path:
    """A summary of the sweep with one setting, judged by two claims."""
    setting: Mapping[str, object] = {"parameter": "sigma_px", "value": "2", "rmse_ratio": 0.5}
    setting |= {"rmse_ratio_low": 0.1, "rmse_ratio_high": 0.9, "rmse_score": 0.7}
    pd.DataFrame([setting | {"id": "a"}, setting | {"id": "b"}]).to_csv(folder / "summary.csv", index=False)
    return folder / "summary.csv"


def test_variants_are_the_hypothesis_and_the_sweep(tmp_path: Path) -> None:
    """Catches a setting that is listed once a claim, and a column under another's name."""
    none, hidden, swept = variants(_hypothesis(tmp_path, 1.0), _sweep(tmp_path))
    assert none["typical ratio"] == pytest.approx(0.25) and hidden["mean abs log ratio"] == 0.0
    assert list(swept.values()) == ["sigma_px = 2", 0.5, 0.1, 0.9, 0.7]
    assert len(variants(_hypothesis(tmp_path, 1.0), None)) == 2


def test_chance_explains_much_and_is_drawn_from_its_seed() -> None:
    """Catches a share that counts numbers that were never off, or one that no seed fixes."""
    assert explained_by_chance(1) == explained_by_chance(1) != explained_by_chance(2)
    # Beyond a factor of 6 no variant can help: ln(6 / 2) of ln(10 / 2) are below it.
    assert 0.5 < explained_by_chance(1) < np.log(3.0) / np.log(5.0)


def _page(results: Results, folder: Path, **flags: object) -> str:
    """The page that the command writes."""
    files = ("sweep", "sweep_timing", "sweep_trace", "problems", "published")
    options: dict[str, object] = {
        **{name: list(getattr(results, name).items()) for name in ("solutions", "timings", "covariances")},
        **{name: getattr(results, name) for name in files},
        "prior_reading": results.reading,
        "solver": {},
        "hypothesis": _hypothesis(folder, 1.0),
        "source": "euroc",
        "published_names": list(SEQUENCES.items()),
        "seed": 1,
        "sensitivity": None,
        "output": folder / "comparison.csv",
    }
    work(argparse.Namespace(**options | flags))
    return (folder / "comparison.md").read_text("utf-8")


def test_page_counts_what_lies_inside(results: Results, tmp_path: Path) -> None:
    """Catches a page whose counts are not those of the table, and a time among the numbers."""
    page = _page(results, tmp_path)
    table = pd.read_csv(tmp_path / "comparison.csv")
    assert list(table["artefact"]).count("times") == 1
    assert set(table[table["quantity"].str.startswith("time_s")]["artefact"]) == {"times"}
    of_table2 = table.query("artefact == 'table2' and gauge == 'fix'")["inside_our_range"]
    assert f"| table2, fix | 18 | 18 | {(of_table2.astype(str) == 'True').sum()} |" in page
    assert "| table3, free | 6 | 0 | 0 |" in page
    assert not {"nan", "None"} & set(page.split())


@pytest.mark.parametrize("same", [True, False])
def test_page_shows_the_sweep_of_the_same_configuration_only(
    results: Results, tmp_path: Path, same: bool
) -> None:
    """Catches a sweep that is left out, and an old one set beside new results."""
    stamps = [tmp_path / "reasons.json", tmp_path / "sweep.json"]
    for stamp, seed in zip(stamps, (1, 1 if same else 2), strict=True):
        config = {"simulation": {"seed": seed}}
        write_stamp(stamp, Stamp(stamp.stem, "1", "abc", {}, config, {}, (), {}, {}, {}, {}))
    flags = {"sensitivity": _sweep(tmp_path), "sensitivity_stamp": stamps[1], "stamps": stamps[:1]}
    assert ("sigma_px = 2" in _page(results, tmp_path, **flags)) is same
