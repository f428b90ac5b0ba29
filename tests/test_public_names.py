"""The public names: one table, and what Python, type checkers and help() make of it."""

import ast
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2

import vigauge as vg
from support.simulated import SETTINGS
from vigauge.model.archive import load_arrays
from vigauge.synthetic.biases import BiasedTrial, make_biased_trial
from vigauge.synthetic.scenario import make_scene, make_trial

TABLE = vg._PUBLIC
HEAVY = ("numpy", "scipy", "numba", "pandas", "vigauge.model")
HELP = "import pydoc, vigauge; print(pydoc.plain(pydoc.render_doc(vigauge)))"


def python(code: str) -> str:
    return subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout


def test_all_lists_the_table() -> None:
    assert vg.__all__ == ["__version__", *TABLE]
    assert dir(vg) == sorted(vg.__all__)


@pytest.mark.parametrize("name", TABLE)
def test_every_name_is_there(name: str) -> None:
    """Catches a name whose module has moved, and a lookup that gives another object each time."""
    value = getattr(vg, name)
    assert value.__name__ == name
    assert value.__module__ == f"vigauge.{TABLE[name][0]}".rstrip(".")
    assert getattr(vg, name) is value


def test_a_name_that_is_not_public_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'sovle'"):
        _ = vg.sovle


def test_type_checkers_see_the_table() -> None:
    """Catches a public name that is loaded at run time and unknown, or known elsewhere, to a type checker."""
    stub = ast.parse(Path(vg.__file__).with_suffix(".pyi").read_text(encoding="utf-8"))
    seen = {}
    for node in stub.body:
        if isinstance(node, ast.ImportFrom):
            # Only `X as X` is public to a strict type checker.
            seen |= {alias.name: node.module for alias in node.names if alias.asname == alias.name}
        elif isinstance(node, ast.FunctionDef):
            seen[node.name] = ""
    assert seen == {name: module for name, (module, _) in TABLE.items()}


def test_help_begins_with_the_names_and_their_meanings() -> None:
    text = python(HELP)
    description = text.split("PACKAGE CONTENTS")[0]
    lines = [line.split() for line in description.splitlines()]
    shown = [line for line in lines if line and line[0] in TABLE]
    assert shown == [[name, *meaning.split()] for name, (_, meaning) in TABLE.items()]


def test_import_is_light() -> None:
    """Catches a public name that is imported with the package: `import vigauge` takes milliseconds."""
    code = f"import sys, vigauge; print([m for m in {HEAVY} if m in sys.modules])"
    assert python(code).strip() == "[]"


def test_import_is_quick() -> None:
    """Under 0.1 s, the best of three: other work on the machine must not decide."""
    code = "import time; t = time.perf_counter(); import vigauge; print(time.perf_counter() - t)"
    assert min(float(python(code)) for _ in range(3)) < 0.1


# Without biases, and with more landmarks than the other tests need.
EXAMPLE = replace(
    SETTINGS, n_landmarks=200, gyro_bias_radps=(0.0, 0.0, 0.0), accel_bias_mps2=(0.0, 0.0, 0.0), n_trials=1
)


def biased() -> BiasedTrial:
    settings = replace(EXAMPLE, gyro_bias_radps=(0.01, -0.02, 0.015), accel_bias_mps2=(0.05, -0.1, 0.08))
    return make_biased_trial(make_scene("sine", "random", settings), 0, 2e-5, 3e-3)


MADE = {
    "example.npz": lambda: make_trial(make_scene("sine", "random", EXAMPLE), 0),
    "example_biases.npz": lambda: biased().problem,
}


@pytest.mark.parametrize("name", MADE)
def test_example_is_what_the_simulator_makes(name: str, tmp_path: Path) -> None:
    """Catches an example older than the simulator or the archive: then save the made one in its place."""
    vg.save_problems(tmp_path / "made.npz", [MADE[name]()])
    made = load_arrays(tmp_path / "made.npz")
    kept = load_arrays(Path(vg.__file__).with_name(name))
    assert kept.keys() == made.keys()
    for name, array in kept.items():
        if array.dtype.kind == "U":
            assert array == made[name]
        else:
            np.testing.assert_allclose(array, made[name], rtol=1e-9, atol=1e-12, err_msg=name)


def test_example_is_the_same_every_time_and_solvable() -> None:
    first, second = vg.example_problem(), vg.example_problem()
    assert first.initial.n_keyframes == 10
    assert first.initial.n_landmarks == 200
    np.testing.assert_array_equal(first.obs_uv, second.obs_uv)
    solution = vg.solve(first, vg.FreeGauge())
    assert solution.converged
    # Half the chi-square: two numbers an observation, nine a factor, less what is estimated.
    freedom = 2 * len(first.obs_uv) + 9 * 9 - (first.initial.n_parameters - 4)
    assert abs(2.0 * solution.cost / freedom - 1.0) < 0.15
    assert not vg.diagnose(first, solution.state).degenerate


def test_example_with_biases_finds_the_true_ones() -> None:
    """Biases that are held, unobservable, or off by more than their sigmas say."""
    problem, truth = vg.example_problem(biases="estimated"), biased().truth
    assert problem.estimates_biases and not np.any(problem.initial.gyro_bias)
    solution = vg.solve(problem, vg.FreeGauge())
    assert solution.converged and not vg.diagnose(problem, solution.state).degenerate
    covariance = vg.Covariance.of(problem, solution.state).keyframes(vg.FixedGauge())[0]
    error = np.concatenate(
        [
            solution.state.gyro_bias[0] - truth.gyro_bias[0],
            solution.state.accel_bias[0] - truth.accel_bias[0],
        ]
    )
    assert error @ np.linalg.solve(covariance[9:, 9:], error) < chi2.ppf(0.99, 6)
    assert np.abs(solution.state.gyro_bias[0]).max() > 5.0 * np.sqrt(np.diagonal(covariance)[9:12].max())


def test_example_of_an_unknown_kind_is_refused() -> None:
    with pytest.raises(vg.DataError, match=r'biases: must be "known" or "estimated"'):
        vg.example_problem(biases="constant")
