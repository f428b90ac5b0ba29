"""Experiments that explain the results: each must show its effect where there is one, and none elsewhere."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from support import ROOT
from support.simulated import SETTINGS, scene, trial
from vigauge.errors import ConfigError
from vigauge.gauge.gauges import FixedGauge, FreeGauge, PriorGauge, three_gauges
from vigauge.solver.levenberg_marquardt import Options, solve
from vigauge_paper.experiments import bias_hypothesis
from vigauge_paper.experiments.exchange import exchange, exchange_published, exchanged
from vigauge_paper.experiments.experiment import Material
from vigauge_paper.experiments.iteration_time import Settings, dense_times, iteration_times
from vigauge_paper.experiments.orbit import cost_on_orbit
from vigauge_paper.experiments.reading import PAPER, QUANTITIES, pulls, slopes
from vigauge_paper.experiments.solves import solve_all
from vigauge_paper.experiments.yaw import yaw_drift
from vigauge_paper.ids import TRAJECTORIES

PUBLISHED = ROOT / "data" / "published"


def test_cost_is_the_same_on_the_orbit_only() -> None:
    """Catches a transformation that leaves out landmarks or velocities."""
    problem = trial()
    rows = cost_on_orbit("sine", problem, problem.initial, 5, np.random.default_rng(3))
    assert max(abs(float(str(row["relative_change"]))) for row in rows) < 1e-12
    still = replace(problem.initial, v_W=problem.initial.v_W + 0.1)
    moved = cost_on_orbit("sine", problem, still, 1, np.random.default_rng(3))
    assert moved[0]["cost"] != pytest.approx(rows[0]["cost"])


def test_yaw_drifts_under_iterated_updates_only() -> None:
    """Catches the drift of Eq. (8) going unseen, or Eq. (9) not holding the yaw."""
    table = pd.DataFrame(yaw_drift("sine", 0, trial(), Options()))
    last = table.groupby("update")["yaw_deg"].last().abs()
    assert last["(8)"] > 1e-4
    assert last["(9)"] < 1e-9
    first = table[table["iteration"] <= 1]["yaw_deg"].abs()
    assert first.max() < 1e-9, "one update with zero z holds the yaw"


def test_without_damping_the_gauges_take_equal_counts() -> None:
    """Catches an option that does not reach the solver."""
    problems = [trial(i) for i in range(3)]
    options = Options(initial_radius=1e12)
    table = pd.DataFrame(solve_all("sine", problems, scene().truth, three_gauges(1e5), options))
    assert set(table["initial_radius"]) == {1e12}
    means = table.groupby("gauge")["iterations"].mean()
    assert means.max() - means.min() < 0.5


def test_slope_of_the_first_step_tells_what_the_weight_multiplies() -> None:
    """Catches a slope that is two whatever the runs did."""
    problem, weights = trial(), ("7", "100", "500")
    rows = []
    for source, power in {PAPER: 2, "information": 1}.items():
        gauges = {"free": FreeGauge(), **{w: PriorGauge(float(w) ** power) for w in weights}}
        steps = {label: solve(problem, gauge).trace[1] for label, gauge in gauges.items()}
        for quantity, name in QUANTITIES.items():
            rows += pulls(source, quantity, pd.Series({w: getattr(s, name) for w, s in steps.items()}))
    found = slopes(pd.DataFrame(rows))
    assert found[PAPER, "position_m"] == pytest.approx(2.0, abs=0.1)
    assert found["information", "position_m"] == pytest.approx(1.0, abs=0.1)


def test_weights_that_pull_all_or_nothing_have_no_pull() -> None:
    rows = pulls(PAPER, "position_m", pd.Series({"free": 0.3, "7": 0.1, "0": 0.3, "1e8": 0.0}))
    assert [(row["weight"], row["pull"]) for row in rows] == [(7.0, pytest.approx(2.0))]


def test_exchanging_twice_is_nothing_and_once_shows() -> None:
    """Catches another pair than the published one: (3N+1, 3N) and (3N+1, 3N+1)."""
    rng = np.random.default_rng(1)
    root = rng.normal(size=(18, 18))
    covariance = root @ root.T
    once = exchanged(covariance)
    changed = {(int(i), int(j)) for i, j in np.argwhere(once != covariance)}
    assert changed == {(7, 6), (7, 7)}
    assert np.array_equal(exchanged(once), covariance)
    row = exchange("x", covariance, covariance)
    assert row["relative_frobenius"] == 0.0 and float(str(row["with_exchanged_pair"])) > 0.0


def test_published_pair_is_put_back() -> None:
    """Catches reading the published figures as if they were as they should be."""
    rng = np.random.default_rng(2)
    root = rng.normal(size=(18, 18))
    covariance = np.abs(root @ root.T)
    eps = 1e-6
    arrays = {"eps": np.array(eps)}
    for panel, matrix in (("transformed", covariance), ("fixed", exchanged(covariance))):
        arrays[panel] = np.log10(matrix + eps)
        arrays[f"{panel}_zero_mask"] = np.zeros((18, 18), dtype=bool)
    row = exchange_published("paper", arrays)
    assert float(str(row["relative_frobenius"])) < 1e-12
    assert float(str(row["with_exchanged_pair"])) > 1e-3


def test_iterations_are_timed_at_equal_number() -> None:
    """Catches runs that end by their tolerance: gauges would be timed over different mixes of iterations."""
    ticks = iter(range(10_000))
    settings = Settings(n_keyframes=(10,), iterations=7, repeats=2)
    rows = iteration_times(
        trial(), {"fix": FixedGauge(), "free": FreeGauge()}, Options(), settings, lambda: float(next(ticks))
    )
    assert [row["what"] for row in rows] == ["fix", "free", "free", "fix"]
    assert len({row["seconds"] for row in rows}) == 1, "the same clock calls, so the same iterations"


def test_dense_solves_of_both_sizes_are_timed() -> None:
    ticks = iter(range(100))
    rows = dense_times(3, 2, np.random.default_rng(0), lambda: float(next(ticks)))
    assert [(row["what"], row["repeat"], row["seconds"]) for row in rows] == [
        (what, repeat, 1.0) for repeat in (0, 1) for what in ("dense 9N", "dense 9N - 4")
    ]


def test_a_hidden_bias_grows_the_errors_and_none_leaves_them() -> None:
    """Catches a bias that the problems take off again, and one that reaches the other configurations."""
    none = dict.fromkeys(TRAJECTORIES, (0.0, 0.0, 0.0))
    hidden = bias_hypothesis.Settings(1, none | {"arc": (0.0, 0.0, 0.02)}, none)
    material = Material(SETTINGS, Options(), 1e5, "sine_plane", lambda: 0.0, published=PUBLISHED)
    table = pd.DataFrame(bias_hypothesis.rows(material, hidden))
    assert list(table.columns) == ["configuration", "error", "published", "without", "with_bias", "ratio"]
    assert len(table) == 18
    assert np.allclose(table["ratio"] * table["published"], table["with_bias"])
    arc = table["configuration"].str.startswith("arc")
    rotation = table["error"] == "phi_rmse_deg"
    assert (table["with_bias"] > 2.0 * table["without"])[arc & rotation].all()
    assert (table["with_bias"] == table["without"])[~arc].all()


def test_biases_must_name_every_trajectory() -> None:
    with pytest.raises(ConfigError, match="gyro_bias_radps"):
        bias_hypothesis.Settings(1, {"sine": (0.0, 0.0, 0.0)}, dict.fromkeys(TRAJECTORIES, (0.0, 0.0, 0.0)))
