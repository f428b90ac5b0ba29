"""The stages on problems that have no covariance: marked, withheld and said, all the way to the figures."""

import json
import subprocess
import sys
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from support import degenerate as d
from support import simulated
from support.results import Results
from vigauge.errors import DataError
from vigauge.model.archive import load_arrays, load_statuses, save_problems, save_states
from vigauge.model.problem import Problem
from vigauge.solver.levenberg_marquardt import Options
from vigauge_paper.experiments.evidence import Evidence, NoEvidenceError
from vigauge_paper.experiments.statistics import Criteria
from vigauge_paper.figures.ellipses import draw_ellipses
from vigauge_paper.figures.matrices import draw_covariances
from vigauge_paper.tables import degenerate, left_out, table1


def stage(name: str, *flags: object) -> subprocess.CompletedProcess[str]:
    """Run a stage as a rule does."""
    command = [sys.executable, "-m", f"vigauge_paper.commands.{name}", *map(str, flags)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120)


def solve(
    folder: Path, problem: Problem, noise: dict[str, Any] | None = None, **options: float
) -> subprocess.CompletedProcess[str]:
    save_problems(folder / "problems.npz", [problem])
    save_states(folder / "truth.npz", [problem.initial])
    outputs = {
        name: folder / f"{name}.{ending}"
        for name, ending in (("solutions", "csv"), ("trace", "csv"), ("states", "npz"))
    }
    return stage(
        "solve",
        *(
            "--problems",
            folder / "problems.npz",
            "--truth",
            folder / "truth.npz",
            "--prior-weight",
            1e5,
            "--prior-reading",
            "information",
        ),
        *("--solver", json.dumps(asdict(Options()) | options)),
        *(part for name, file in outputs.items() for part in (f"--{name}", file)),
        *("--noise", json.dumps(noise or {})),
    )


def covariance(folder: Path, noise: dict[str, Any] | None = None) -> subprocess.CompletedProcess[str]:
    return stage(
        "covariance",
        *("--problems", folder / "problems.npz", "--states", folder / "states.npz"),
        *("--prior-weight", 1e5, "--prior-reading", "information", "--output", folder / "covariance.npz"),
        *("--distances", folder / "covariance.csv", "--noise", json.dumps(noise or {})),
    )


@pytest.fixture
def still(tmp_path: Path) -> Path:
    """Solutions and covariances of a problem without motion."""
    done = solve(tmp_path, d.problem_of(d.still, d.still))
    assert done.returncode == 0, done.stderr
    done = covariance(tmp_path)
    assert done.returncode == 0, done.stderr
    assert "covariance withheld; degenerate (standing still)" in done.stderr
    return tmp_path


def test_a_degenerate_problem_gets_no_covariance(still: Path) -> None:
    """Numbers made of rounding errors, printed as a covariance."""
    arrays = load_arrays(still / "covariance.npz")
    assert "depth of landmarks 0 to 19" in str(arrays["withheld"])
    assert not {"free", "fixed", "prior", "transformed"} & set(arrays)
    solutions = pd.read_csv(still / "solutions.csv")
    assert solutions["degenerate"].all()
    assert solutions["inertial_chi2_per_redundancy"].isna().all()
    assert degenerate({"still": still / "solutions.csv"}) == (
        " Degenerate: 1 of still fix, 1 of still prior, 1 of still free."
    )


def test_ranks_of_a_degenerate_problem_are_measured(still: Path) -> None:
    """Table I must not fall back to what the rank would be."""
    ranks = {row["gauge"]: row["hessian_rank"] for row in table1(still / "covariance.npz")}
    full = 9 * 8 + 3 * 20
    assert ranks == {"fix": full - 24, "free": full - 24, "prior": full - 20}


@pytest.mark.parametrize(("draw", "numbers"), [(draw_covariances, ".npz"), (draw_ellipses, ".csv")])
def test_figures_say_why_they_are_empty(still: Path, draw, numbers: str) -> None:
    draw(still / "covariance.npz", still / "figure", "euroc")
    assert {".pdf", ".png", numbers} <= {file.suffix for file in still.glob("figure.*")}
    if numbers == ".csv":
        assert "standing still" in pd.read_csv(still / "figure.csv")["withheld"][0]
    else:
        assert set(load_arrays(still / "figure.npz")) == {"withheld", "source"}


def test_claims_have_no_evidence_in_it(tmp_path: Path) -> None:
    """A verdict on a covariance that was withheld."""
    files = Results(tmp_path, covariance={"sine_plane": {"withheld": "degenerate: scale"}}).evidence()
    evidence = Evidence(
        **files,
        sweep_configuration="sine_plane",
        machine_hall="MH_01_easy",
        vicon_room="V1_01_easy",
        source="euroc",
        cpu="made up",
        reading="residual",
        criteria=Criteria(0.02, 0.05, 0.1, 0.99, 10, 1, 0.02, 1e-4),
    )
    with pytest.raises(NoEvidenceError, match="sine_plane: degenerate: scale"):
        evidence.covariance("sine_plane")
    assert "free" in evidence.covariance("arc_plane")


def test_a_run_that_did_not_converge_gets_no_covariance(tmp_path: Path) -> None:
    """H at a point that is no minimum is no information about it."""
    problem = d.problem_of()
    away = replace(problem, initial=problem.initial.retract(np.full(problem.initial.n_parameters, 0.05)))
    done = solve(tmp_path, away, maximum_iterations=1)
    assert done.returncode == 0, done.stderr
    assert set(load_statuses(tmp_path / "states.npz")) == {"iteration limit"}
    done = covariance(tmp_path)
    assert done.returncode == 0, done.stderr
    arrays = load_arrays(tmp_path / "covariance.npz")
    assert str(arrays["withheld"]) == (
        "the run did not converge: fix (iteration limit), prior (iteration limit), free (iteration limit)"
    )
    assert "free" not in arrays
    assert left_out({"away": tmp_path / "solutions.csv"}) == (
        " Left out, as they did not converge: 1 of away fix, 1 of away free, 1 of away prior."
    )


def test_a_start_that_no_flight_has_is_refused_with_its_row(tmp_path: Path) -> None:
    """Catches a crash, or a row of infinities: squares of such velocities overflow."""
    problem = d.problem_of()
    start = replace(problem.initial, v_W=np.full_like(problem.initial.v_W, 1e200))
    done = solve(tmp_path, problem.with_initial(start))
    assert done.returncode == 2 and "state, row 0, v_W: must be below 1e+100" in done.stderr, done.stderr
    assert not (tmp_path / "solutions.csv").exists()


def test_a_start_without_a_cost_is_a_status_and_not_a_crash(tmp_path: Path) -> None:
    """Catches a run that stops: landmarks at the camera have depth zero."""
    problem = simulated.trial(0)
    start = replace(problem.initial, X_W=np.zeros_like(problem.initial.X_W) + problem.initial.p_W[0])
    done = solve(tmp_path, problem.with_initial(start))
    assert done.returncode == 0, done.stderr
    solutions = pd.read_csv(tmp_path / "solutions.csv")
    assert set(solutions["status"]) == {"non-finite cost"}
    assert not solutions["converged"].any()


def test_regular_problems_have_an_empty_reason(tmp_path: Path) -> None:
    done = solve(tmp_path, d.problem_of())
    assert done.returncode == 0, done.stderr
    assert covariance(tmp_path).returncode == 0
    arrays = load_arrays(tmp_path / "covariance.npz")
    assert str(arrays["withheld"]) == "" and arrays["free"].shape == (72, 72)


def test_distances_are_those_of_each_noise_model_at_its_own_optimum(tmp_path: Path) -> None:
    """The headline's estimates or noise under the name of another model."""
    problem = d.problem_of()
    start = problem.initial.retract(np.full(problem.initial.n_parameters, 0.001))
    problem = problem.with_initial(start)
    models = {"consistent": {"sigma_px": 0.5, "density_factor": 0.7}}
    models["headline"] = {"sigma_px": 1.0, "density_factor": 1.0}
    names = ["relative_frobenius_same_point", "relative_frobenius_converged", "relative_frobenius_prior"]
    found = {}
    for headline, noise in (("both", models), ("consistent", {"headline": models["consistent"]})):
        (tmp_path / headline).mkdir()
        assert solve(tmp_path / headline, problem, noise).returncode == 0
        assert covariance(tmp_path / headline, noise).returncode == 0
        found[headline] = pd.read_csv(tmp_path / headline / "covariance.csv").set_index("noise")[names]
    assert list(found["both"].index) == ["headline", "consistent"]
    assert list(found["both"].loc["consistent"]) == list(found["consistent"].loc["headline"])
    assert found["both"].loc["consistent", names[1]] != found["both"].loc["headline", names[1]]


def test_states_without_a_status_are_refused(tmp_path: Path) -> None:
    """Estimates of unknown standing must not pass for minima."""
    problem = d.problem_of()
    save_problems(tmp_path / "problems.npz", [problem])
    save_states(tmp_path / "states.npz", [problem.initial] * 3)
    with pytest.raises(DataError, match="status of a run"):
        load_statuses(tmp_path / "states.npz")
    done = covariance(tmp_path)
    assert done.returncode == 2
    assert "states.npz, status: entry 0: must be the status of a run" in done.stderr


def test_prior_weights_to_1e16_run_and_report_their_conditioning(tmp_path: Path) -> None:
    """A weight at which the arithmetic fails without anybody noticing."""
    problem = d.problem_of()
    start = problem.initial.retract(np.full(problem.initial.n_parameters, 0.01))
    save_problems(tmp_path / "problems.npz", [replace(problem, initial=start)])
    save_states(tmp_path / "truth.npz", [problem.initial])
    done = stage(
        "prior_sweep",
        *("--problems", tmp_path / "problems.npz", "--truth", tmp_path / "truth.npz"),
        *("--weights", "0", "1", "1e5", "1e10", "1e14", "1e16"),
        *("--solver", json.dumps(asdict(Options()))),
        *("--sweep", tmp_path / "sweep.csv", "--trace", tmp_path / "trace.csv"),
    )
    assert done.returncode == 0, done.stderr
    sweep = pd.read_csv(tmp_path / "sweep.csv", dtype={"weight": str}).set_index("weight")
    assert len(sweep) == 14 and sweep["status"].notna().all()
    sweep = sweep[sweep["reading"] == "information"]
    assert np.isinf(sweep.loc[["0", "free"], "condition"]).all()
    finite = sweep.loc[["1", "1e5", "1e10", "1e14", "1e16"], "condition"]
    assert np.all(np.isfinite(finite)) and np.all(finite > 1.0)
    assert sweep.loc["1", "condition"] > sweep.loc["1e5", "condition"]
