"""Every solver that can be had here, on one small problem: same minimum, same covariance."""

import json
import subprocess
from dataclasses import replace
from importlib.util import find_spec

import numpy as np
import pytest

from benchmarks import problems_with_biases
from benchmarks.competitors import competitors
from benchmarks.exchange import read_matrix, read_state, write_problem
from benchmarks.model import Model
from benchmarks.native import Unavailable, build, find_toolchain
from benchmarks.problems import Size
from benchmarks.race import COST_TOLERANCE, Bench, Rules, race_covariances, race_solves
from support.dense import dense_jacobian, dense_residual
from support.simulated import trial, with_outliers
from vigauge.covariance.covariance import motion_covariance
from vigauge.gauge.gauges import FixedGauge, FreeGauge
from vigauge.model.archive import load_problems
from vigauge.model.evaluation import relative_frobenius
from vigauge.model.loss import Cauchy, Huber
from vigauge.solver.levenberg_marquardt import Options, solve
from vigauge.solver.residuals import cost

TIGHT = Options(function_tolerance=1e-12)


@pytest.fixture(scope="session")
def build_folder(tmp_path_factory):
    return tmp_path_factory.mktemp("build")


@pytest.fixture(scope="session")
def field(build_folder):
    return {competitor.name: competitor for competitor in competitors(build_folder)}


def test_judge_agrees_with_the_package(small):
    """Catches a judge with residuals or derivatives of another problem."""
    problem, _ = small
    model = Model(problem)
    state = solve(problem, FreeGauge(), Options(maximum_iterations=2)).state
    assert model.cost(state) == pytest.approx(cost(problem, state), rel=1e-12)
    assert np.allclose(model.residual(state), dense_residual(problem, state), atol=1e-9)
    J = dense_jacobian(problem, state)
    assert np.allclose(model.jacobian(state, total=False).toarray(), J, atol=1e-9 * np.abs(J).max())


def test_total_jacobian_by_differences(small):
    """Catches a Jacobian for SciPy that forgets the chain from total to left increments."""
    problem, _ = small
    model = Model(problem)
    rng = np.random.default_rng(0)
    x = 0.05 * rng.normal(size=problem.initial.n_parameters)
    J = model.jacobian(model.state(x), total=True)
    for _ in range(5):
        direction = rng.normal(size=len(x))
        step = 1e-6
        ahead = model.residual(model.state(x + step * direction))
        behind = model.residual(model.state(x - step * direction))
        numeric = (ahead - behind) / (2.0 * step)
        assert np.allclose(J @ direction, numeric, atol=1e-5 * np.abs(numeric).max())


@pytest.mark.oracle
@pytest.mark.parametrize("name", ["vigauge", "ceres", "gtsam", "scipy"])
def test_all_end_at_one_minimum(name, bench, field, said):
    """Catches a problem that means something else to one of the solvers: its cost at the end, by one
    judge, and its own idea of the cost."""
    if field[name].absent is not None:
        pytest.skip(field[name].absent)
    entries = race_solves(bench, [field["vigauge"], field[name]], 1, ("fix", "prior", "free"))
    assert {entry.gauge for entry in entries if entry.solver == name} == set(field[name].gauges)
    for entry in entries:
        assert entry.status == "measured", (entry, said)
        assert abs(entry.distance) < COST_TOLERANCE
        assert entry.iterations > 2 and entry.seconds and min(entry.seconds) > 0.0
        assert entry.peak_mib > 1.0


@pytest.mark.oracle
def test_ceres_takes_our_steps(bench, field):
    """Catches a C++ program with another trust region, parametrisation or count: as many linear solves."""
    if field["ceres"].absent is not None:
        pytest.skip(field["ceres"].absent)
    entries = race_solves(bench, [field["vigauge"], field["ceres"]], 1, ("fix", "prior", "free"))
    count = {(entry.solver, entry.gauge): entry.iterations for entry in entries}
    for gauge in ("fix", "prior", "free"):
        assert count["ceres", gauge] == count["vigauge", gauge], gauge


@pytest.mark.oracle
@pytest.mark.parametrize("loss", [Huber(1.5), Cauchy(2.0)])
@pytest.mark.parametrize(("gauge", "tolerance"), [(FixedGauge(), 1e-10), (FreeGauge(), 1e-6)])
def test_ceres_takes_our_steps_with_a_loss(loss, gauge, tolerance, field, build_folder, tmp_path):
    """Catches another rho, weight or corrector than Ceres', with 15 % outliers: as many linear solves, and
    at the end the same cost, by their own idea of it and by ours, and the same covariance.

    In the free gauge, steps along the orbit are rounding in both, and long runs part.
    """
    if field["ceres"].absent is not None:
        pytest.skip(field["ceres"].absent)
    problem = with_outliers(trial(), loss)
    write_problem(tmp_path / "problem", problem)
    command = [str(build(build_folder)), str(tmp_path / "problem"), "1", str(tolerance), "200"]
    requests = (f"loss {loss.kind} {loss.delta}", f"solve {gauge.name} dense_schur", "state state")
    requests += "covariance fix dense_svd", "matrix matrix"
    done = subprocess.run(
        command, cwd=tmp_path, input="\n".join(requests), capture_output=True, text=True, check=True
    )
    theirs = json.loads(done.stdout.splitlines()[2])
    ours = solve(problem, gauge, Options(function_tolerance=tolerance, maximum_iterations=200))
    assert ours.converged and theirs["converged"]
    assert ours.iterations == theirs["iterations"] > 10
    assert ours.cost == pytest.approx(theirs["cost"], rel=1e-8)
    state = read_state(tmp_path / "state", problem.initial)
    assert cost(problem, state) == pytest.approx(theirs["cost"], rel=1e-12)
    covariance = motion_covariance(problem, state, FixedGauge())
    assert relative_frobenius(covariance, read_matrix(tmp_path / "matrix", covariance.shape)) < 1e-6


@pytest.mark.oracle
@pytest.mark.parametrize(
    ("name", "gauges"), [("ceres", {"fix", "free"}), ("gtsam", {"prior"}), ("pinv", {"free"})]
)
def test_all_give_one_covariance(name, gauges, bench, field, said):
    """Catches blocks of a covariance in another order, frame or gauge."""
    if field[name].absent is not None:
        pytest.skip(field[name].absent)
    state = solve(bench.problem, FreeGauge(), TIGHT).state
    entries = race_covariances(bench, [field["vigauge"], field[name]], state, 1, {})
    theirs = [entry for entry in entries if entry.solver == name]
    assert {entry.gauge for entry in theirs} == gauges
    assert all(entry.status == "measured" for entry in entries), (entries, said)
    assert all(0.0 < entry.distance < 1e-4 for entry in theirs)
    # The tolerance can tell gauges apart.
    fix, free = (motion_covariance(bench.problem, state, gauge) for gauge in (FixedGauge(), FreeGauge()))
    assert np.linalg.norm(fix - free) > 0.1 * np.linalg.norm(free)


@pytest.mark.oracle
@pytest.mark.parametrize("name", ["ceres", "gtsam"])
def test_biases_mean_the_same_to_all(name, field, tmp_path, said):
    """Catches a bias of another sign, order or walk in one of the programs: the cost at the end, Ceres'
    number of steps, and the covariance of 15 parameters a keyframe."""
    if field[name].absent is not None or find_spec("gtsam") is None:
        pytest.skip("not installed")
    files = problems_with_biases.cached_problem(Size(10, 40), tmp_path)
    rules = Rules(limit_s=120.0, memory_gib=8.0, budget_s=0.1, rounds=3)
    bench = Bench(load_problems(files[0])[0], files, tmp_path, rules, said.append)
    assert bench.problem.estimates_biases
    # Of Ceres the quick way only.
    quick = {"fix": "sparse_qr"} if name == "ceres" else field[name].covariances
    running = [field["vigauge"], replace(field[name], covariances=quick)]
    entries = race_solves(bench, running, 1, ("fix", "prior", "free"))
    assert all(entry.status == "measured" for entry in entries), (entries, said)
    count = {(entry.solver, entry.gauge): entry.iterations for entry in entries}
    if name == "ceres":
        assert all(count["ceres", gauge] == count["vigauge", gauge] > 3 for gauge in ("fix", "prior", "free"))
    state = solve(bench.problem, FreeGauge(), TIGHT).state
    entries = race_covariances(bench, running, state, 1, {})
    assert any(entry.solver == name for entry in entries)
    assert all(entry.status == "measured" for entry in entries), (entries, said)


def test_missing_parts_are_named(tmp_path):
    """Catches a suite that dies, or says nothing, where native Ceres cannot be had."""
    with pytest.raises(Unavailable, match=r"apt-get install no-such-compiler libceres-dev"):
        find_toolchain("no-such-compiler", (tmp_path,))
    with pytest.raises(Unavailable, match="libceres-dev must be installed"):
        find_toolchain("python3", (tmp_path,))


def test_program_is_compiled_once(build_folder, field):
    """Catches half a minute of compiling in every run."""
    if field["ceres"].absent is not None:
        pytest.skip(field["ceres"].absent)
    program = build(build_folder)
    made = program.stat().st_mtime_ns
    assert build(build_folder) == program and program.stat().st_mtime_ns == made
