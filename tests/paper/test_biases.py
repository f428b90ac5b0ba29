"""The paper's claims with biases in the state: runs, verdicts, sentences, figure."""

import argparse
import itertools
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from support.simulated import SETTINGS, scene
from vigauge.gauge.gauges import FixedGauge
from vigauge.model.evaluation import trajectory_errors
from vigauge.solver.levenberg_marquardt import Options, solve
from vigauge.solver.reintegration import solve_with_samples
from vigauge.synthetic.biases import make_biased_trial
from vigauge_paper.claims.biases import judge_biases
from vigauge_paper.commands import biases as command
from vigauge_paper.experiments import biases as experiment
from vigauge_paper.experiments.experiment import Material
from vigauge_paper.experiments.statistics import Criteria
from vigauge_paper.figures import biases as figure
from vigauge_paper.ids import CONFIGURATIONS

WALKS = (1.94e-5, 3.0e-3)
CRITERIA = Criteria(0.025, 0.043, 0.116, 0.99, 500, 2018, 0.025, 0.01)


@pytest.fixture(scope="module")
def runs() -> pd.DataFrame:
    """The experiment's table on few landmarks and trials, as its file has it."""
    ticks = itertools.count()
    material = Material(SETTINGS, Options(), 1e10, "sine_plane", lambda: float(next(ticks)))
    rows = experiment.rows(material, experiment.Settings(2, 1, *WALKS))
    return pd.DataFrame(rows).replace("", np.nan).infer_objects()


def as_if(runs: pd.DataFrame, **columns: object) -> pd.DataFrame:
    """The table with other numbers where the free gauge estimates biases."""
    out = runs.copy()
    here = (out["gauge"] == "free") & (out["biases"] == "estimated")
    for name, value in columns.items():
        out[name] = out[name].astype(float)
        out.loc[here, name] = value(out[here]) if callable(value) else value
    return out


def verdicts(runs: pd.DataFrame, biases: str) -> dict[str, str]:
    rows = judge_biases(runs, CRITERIA)
    return {str(row["id"]): str(row["verdict"]) for row in rows if row["biases"] == biases}


def test_every_flight_is_run_in_every_gauge_with_and_without_biases(runs: pd.DataFrame) -> None:
    """Catches a case left out, a null space that biases enlarge, and (12) with biases that turn."""
    assert runs["converged"].all()
    counts = runs.groupby(["experiment", "biases", "gauge"]).size()
    assert len(counts) == len(CONFIGURATIONS) * 2 * 3 and (counts == 2).all()
    assert (runs["parameters"] - runs["hessian_rank"] == 4).all()
    assert set(runs.loc[runs["biases"] == "estimated", "parameters"]) == {15 * 10 + 3 * 30}
    assert runs["relative_frobenius_same_point"].max() < 1e-9
    assert (runs["seconds"] > 0.0).all()


def test_errors_are_those_at_the_biases_found(runs: pd.DataFrame) -> None:
    """Catches factors left integrated at zero biases, and the count of a later solve for the first one's."""
    biased = make_biased_trial(scene(), 1, *WALKS)
    first = solve(biased.problem, FixedGauge(), Options())
    _, last = solve_with_samples(
        biased.problem, FixedGauge(), biased.samples, biased.keyframe_ns, biased.noise, Options()
    )
    row = runs.query("experiment == 'sine_random' and trial == 1 and biases == 'estimated'").iloc[[0]]
    assert row["iterations"].item() == first.iterations
    assert row["phi_rmse_deg"].item() == trajectory_errors(last.state, biased.truth).phi_rmse_deg
    off = last.state.gyro_bias - biased.truth.gyro_bias
    assert row["gyro_bias_rmse_radps"].item() == pytest.approx(np.sqrt((off**2).sum() / 10), rel=1e-12)
    assert row["gyro_bias_rmse_radps"].item() < 0.5 * np.linalg.norm(SETTINGS.gyro_bias_radps)


def test_no_covariance_without_an_estimate() -> None:
    """Catches covariances of a run that did not converge, and a stage that stops at a degenerate problem."""
    biased = make_biased_trial(scene(), 0, *WALKS)
    unsolved = solve(biased.problem, FixedGauge(), Options(maximum_iterations=1))
    assert not unsolved.converged
    assert experiment._covariances(biased.problem, unsolved) is None
    short = make_biased_trial(scene(n_keyframes=2, minimum_views=2), 0, *WALKS)
    solved = solve(short.problem, FixedGauge(), Options())
    assert experiment._covariances(short.problem, solved) is None


@pytest.mark.parametrize(
    "claim, columns",
    [
        ("same-accuracy", {"accel_bias_rmse_mps2": lambda t: 1.2 * t["accel_bias_rmse_mps2"]}),
        ("fewer-iterations", {"iterations": lambda t: t["iterations"] + 3}),
        ("time-per-iteration", {"seconds": lambda t: 1e-3 * t["seconds"]}),
        ("identity", {"relative_frobenius_same_point": 1e-6}),
        ("transformed-simulation", {"relative_frobenius_converged": 0.01}),
        ("rank", {"hessian_rank": lambda t: t["hessian_rank"] - 1}),
    ],
)
def test_a_claim_that_fails_is_seen(runs: pd.DataFrame, claim: str, columns: dict[str, object]) -> None:
    """Catches a judge that does not look, or looks at the runs with known biases."""
    wrong = as_if(runs, **columns)
    assert verdicts(wrong, "estimated")[claim] == "differs"
    assert verdicts(wrong, "known") == verdicts(runs, "known")


def test_without_runs_nothing_is_claimed(runs: pd.DataFrame) -> None:
    """Catches a verdict, or a stop, where no run converged."""
    failed = runs.assign(converged=runs["converged"] & (runs["biases"] == "known"))
    assert set(verdicts(failed, "estimated").values()) == {"not tested"}
    assert verdicts(failed, "known")["rank"] == "holds"


def test_artefacts_say_what_the_runs_say(
    runs: pd.DataFrame, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Catches a sentence or the number of trials left out, a mark of another gauge, errors of other runs."""
    drawn: dict[str, list[float]] = {}

    def keep(shown: Figure, stem: object) -> None:
        for line in shown.axes[1].lines:
            drawn.setdefault(str(line.get_label()), []).extend(line.get_ydata())

    monkeypatch.setattr(figure, "save_figure", keep)
    runs.to_csv(tmp_path / "runs.csv", index=False)
    command.work(
        argparse.Namespace(runs=tmp_path / "runs.csv", criteria=asdict(CRITERIA), output=tmp_path / "biases")
    )
    judged = pd.read_csv(tmp_path / "biases.csv")
    text = (tmp_path / "biases.md").read_text("utf-8")
    assert all(sentence in text for sentence in judged["sentence"])
    assert f"with {runs['trial'].nunique()} trials a flight" in text
    counts = judged[judged["quantity"] == "iterations"].set_index("biases")["estimate"]
    for biases in ("known", "estimated"):
        assert drawn[f"Free, {biases} biases"] == [counts[biases]]
    errors = pd.read_csv(tmp_path / "biases_errors.csv").set_index(["configuration", "biases", "gauge"])
    mine = runs.query("experiment == 'arc_plane' and biases == 'estimated' and gauge == 'free'")
    assert errors.loc[("arc_plane", "estimated", "free"), "v_rmse_mps"] == mine["v_rmse_mps"].mean()
    assert errors.loc["arc_plane", "known", :]["gyro_bias_rmse_radps"].isna().all()
