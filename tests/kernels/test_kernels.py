"""Kernels against plain NumPy forms: rotations at every size of angle, products, damping."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg
from hypothesis import given
from hypothesis import strategies as st

import vigauge
from support import ROOT
from vigauge.geometry import so3
from vigauge.kernels import blas, cholesky, damping, multifrontal, rotation, symmetric

ANGLES = [0.0, 1e-300, 1e-12, 1e-8, 1e-4, 0.29999999, 0.3, 0.30000001, 1.0, 3.0, np.pi - 1e-9, np.pi, 6.0]
vectors = st.tuples(*[st.floats(-2.0, 2.0)] * 3).map(np.array)


def filled(function, argument):
    out = np.empty(3 if function is rotation.log else (3, 3))
    function(argument, out)
    return out


PAIRS = [
    (rotation.exp, so3.exp),
    (rotation.left_jacobian, so3.left_jacobian),
    (rotation.right_jacobian_inverse, so3.right_jacobian_inverse),
]


@pytest.mark.parametrize(("compiled", "plain"), PAIRS, ids=lambda function: getattr(function, "__name__", ""))
@pytest.mark.parametrize("angle", ANGLES)
def test_compiled_forms_at_chosen_angles(compiled, plain, angle):
    """Catches a wrong series, a sign, or a jump at the threshold between series and closed form."""
    phi = angle * np.array([2.0, -1.0, 2.0]) / 3.0
    assert np.abs(filled(compiled, phi) - plain(phi)).max() < 2e-14


@pytest.mark.parametrize(("compiled", "plain"), PAIRS, ids=lambda function: getattr(function, "__name__", ""))
@given(phi=vectors)
def test_compiled_forms_anywhere(compiled, plain, phi):
    """Catches mixed-up axes."""
    assert np.abs(filled(compiled, phi) - plain(phi)).max() < 2e-14


@given(phi=vectors)
def test_logarithm(phi):
    """Catches a branch of Shepperd's method with exchanged components."""
    R = so3.exp(phi)
    assert np.abs(so3.exp(filled(rotation.log, R)) - R).max() < 1e-14


@pytest.mark.parametrize("axis", np.eye(3))
@pytest.mark.parametrize("angle", [0.0, 1e-9, 1.0, np.pi - 1e-7, np.pi])
def test_logarithm_near_half_a_turn(angle, axis):
    """Catches lost digits where the trace of R no longer tells the angle."""
    found = filled(rotation.log, so3.exp(angle * axis))
    assert min(np.abs(found - angle * axis).max(), np.abs(found + angle * axis).max()) < 1e-14


def test_a_state_is_retracted_as_by_the_definitions():
    """Catches the first keyframe moved by a left increment instead of its total, Eqs. (8)-(9), and a kind of
    parameter that takes another's part of the step."""
    rng, n, k = np.random.default_rng(0), 5, 4
    p_W, v_W, X_W = rng.normal(size=(n, 3)), rng.normal(size=(n, 3)), rng.normal(size=(k, 3))
    R_WB, dphi_0, R_ref = so3.exp(rng.normal(size=(n, 3))), rng.normal(size=3), so3.exp(rng.normal(size=3))
    delta = rng.normal(size=15 * n + 3 * k)  # with biases, which are no part of this
    out = [np.empty_like(array) for array in (p_W, R_WB, v_W, X_W, dphi_0)]
    rotation.retract(delta, p_W, R_WB, v_W, X_W, dphi_0, R_ref, *out)
    p, turn, v = delta[: 9 * n].reshape(3, n, 3)
    turned = so3.exp(turn) @ R_WB
    turned[0] = so3.exp(dphi_0 + turn[0]) @ R_ref
    expected = p_W + p, turned, v_W + v, X_W + delta[15 * n :].reshape(k, 3), dphi_0 + turn[0]
    for found, right in zip(out, expected, strict=True):
        assert np.abs(found - right).max() < 1e-14


@pytest.mark.parametrize("n", [1, 3, 4, 9, 90])
def test_a_factor_solves_and_inverts(n):
    """Catches rows of the inverse that miss one of those before them where their number is no multiple of
    four, and a solution that reads outside of the triangle."""
    rng = np.random.default_rng(n)
    J = rng.normal(size=(2 * n, n))
    A, out = J.T @ J, np.empty((n, n))
    storage, x = A.ravel().copy(), rng.normal(size=n)
    right = x.copy()
    assert cholesky.factorise(storage, n, n, n - 1)
    cholesky.solve(storage, n, n - 1, x)
    assert np.abs(A @ x - right).max() < 1e-11
    cholesky.inverse(storage.reshape(n, n), out)
    assert np.abs(np.tril(out - np.linalg.inv(A))).max() < 1e-11
    assert not cholesky.factorise(-A.ravel(), n, n, n - 1)


@pytest.mark.parametrize(
    ("rows", "columns", "first", "end"), [(7, 60, 0, 60), (96, 55, 12, 54), (5, 24, 8, 24), (1, 3, 1, 2)]
)
def test_products_of_some_columns(rows, columns, first, end):
    """Catches a panel that is shifted, transposed, or overwrites what was there: columns before ``first``
    and from ``end`` on are not to be touched, the others are added to."""
    rng = np.random.default_rng(0)
    A, before = rng.normal(size=(rows, columns)), rng.normal(size=(columns, columns))
    out = before.copy()
    blas.add_gram(A.ravel(), rows, columns, first, end, out.ravel(), np.empty(4, dtype=np.int32))
    part = slice(first, end)
    expected = before.copy()
    expected[part, part] += A[:, part].T @ A[:, part]
    upper = np.triu(np.ones_like(out, dtype=bool))
    assert np.abs(out - expected)[upper].max() < 1e-13 * rows
    outside = np.ones_like(upper)
    outside[part, part] = False
    assert np.array_equal(out[outside], before[outside])


@pytest.mark.parametrize("k", [0, 1, 4, 7])
def test_pivots_are_those_of_a_pivoted_qr(k):
    """Catches rows that are nearly dependent, or chosen twice: they would be held and leave a gauge free."""
    N = np.linalg.qr(np.random.default_rng(k).normal(size=(50, 50)))[0][:, :k]
    expected = scipy.linalg.qr(N.T, mode="economic", pivoting=True)[2][:k] if k else []
    assert list(symmetric.pivots(N.copy())) == list(expected)


@pytest.mark.parametrize(("columns", "rows"), [(1, 0), (3, 5), (9, 30), (40, 60), (41, 60), (55, 0)])
def test_panels_are_those_of_the_dense_factor(columns, rows):
    """Catches an entry above the diagonal that is read, a rest of columns that are no multiple of four, and
    LAPACK's way parting from our own."""
    n = columns + rows
    rng = np.random.default_rng(n)
    J = rng.normal(size=(2 * n, n))
    A = J.T @ J
    L = np.linalg.cholesky(A)
    size, lower = np.empty(6, dtype=np.int32), np.tri(n, columns, dtype=bool)
    panel = np.where(lower, A[:, :columns], np.nan).T.copy().ravel()
    assert cholesky.factorise_panel(panel, columns, n, n, size) == 0
    found = np.where(lower, panel.reshape(columns, n).T, 0.0)
    assert np.abs(found - L[:, :columns]).max() < 1e-13 * np.abs(L).max()
    XY = np.full(columns * n, np.nan)
    multifrontal.invert_panel(panel, columns, n, XY, size)
    X = np.linalg.inv(L[:columns, :columns])
    expected = np.concatenate([X, -L[columns:, :columns] @ X])
    assert np.abs(XY.reshape(columns, n).T - expected).max() < 1e-11 * np.abs(expected).max()
    A[columns - 1, columns - 1] = -1.0
    assert cholesky.factorise_panel(A.T[:columns].copy().ravel(), columns, n, n, size) == columns


def test_damping_is_clamped_where_columns_are_scaled():
    """Catches clamps applied to the diagonal itself, or a radius that multiplies."""
    diagonal, scale = np.array([4.0, 1e-12, 1e40]), np.array([0.5, 2.0, 1.0])
    out = np.empty(3)
    damping.clamped(diagonal, scale**2, 1e-6, 1e32, 10.0, out)
    assert np.allclose(out, np.clip(diagonal * scale**2, 1e-6, 1e32) / scale**2 / 10.0, rtol=1e-15)


def test_predicted_decrease_is_that_of_the_model():
    """Catches a lost half or sign: -(g x + x H x / 2) where (H + D) x = -g; and a square for a length."""
    rng = np.random.default_rng(1)
    J, g, D = rng.normal(size=(8, 5)), rng.normal(size=5), rng.uniform(0.1, 1.0, 5)
    H = J.T @ J
    x = np.linalg.solve(H + np.diag(D), -g)
    decrease, length = damping.predicted_decrease(g, D, x)
    assert decrease == pytest.approx(-(g @ x + 0.5 * x @ H @ x), rel=1e-12)
    assert length == pytest.approx(np.linalg.norm(x), rel=1e-12)


_SOLVE = """
import hashlib
from support.random_problem import random_problem
from vigauge.gauge.gauges import FreeGauge
from vigauge.solver.levenberg_marquardt import solve
s = solve(random_problem(4, n_keyframes=12, n_landmarks=60), FreeGauge()).state
print(hashlib.sha256(b"".join(a.tobytes() for a in (s.p_W, s.R_WB, s.v_W, s.X_W))).hexdigest())
"""


_COST = """
from support.random_problem import random_problem
from vigauge.solver.residuals import cost
problem = random_problem(4, n_keyframes=12, n_landmarks=60)
print(cost(problem, problem.initial))
"""


def test_the_process_that_compiles_computes_what_later_ones_do(tmp_path):
    """Catches kernels that call each other as functions of their own: while they are compiled the one that is
    called is another piece of machine code than the copy that is kept on disk, and last digits differ."""
    tests = ROOT / "tests"
    environment = dict(os.environ) | {"NUMBA_CACHE_DIR": str(tmp_path), "PYTHONPATH": str(tests)}
    found = [
        subprocess.run(
            [sys.executable, "-c", _SOLVE], env=environment, capture_output=True, text=True, check=True
        ).stdout
        for _ in range(2)
    ]
    assert list(tmp_path.rglob("*.nbi"))
    assert found[0] == found[1] != ""


def test_machine_code_on_disk_is_that_of_the_sources(tmp_path):
    """Catches code of yesterday's parts in today's kernel: Numba looks at the kernel's own file only, and
    arrays of another number of lanes would then be run through with the old one."""
    package = Path(vigauge.__file__).parent
    copy = tmp_path / "vigauge"
    shutil.copytree(package, copy, ignore=shutil.ignore_patterns("__pycache__"))
    tests = ROOT / "tests"
    environment = dict(os.environ) | {
        "NUMBA_CACHE_DIR": str(tmp_path / "cache"),
        "PYTHONPATH": os.pathsep.join([str(tmp_path), str(tests)]),
    }

    def cost() -> float:
        run = [sys.executable, "-c", _COST]
        return float(subprocess.run(run, env=environment, capture_output=True, text=True, check=True).stdout)

    before = cost()
    lanes = copy / "kernels" / "lanes.py"
    text = lanes.read_text().replace("LANES = 16", "LANES = 8")
    assert text != lanes.read_text()
    lanes.write_text(text)
    assert cost() == pytest.approx(before, rel=1e-9)


_EXP = (
    "import numpy as np; from vigauge.kernels.rotation import exp; exp(np.ones(3), np.eye(3)); print('done')"
)


@pytest.mark.parametrize(
    "variables",
    [
        {"NUMBA_DISABLE_JIT": "1"},
        {"HOME": "/proc/nowhere"},
        {"HOME": "/proc/nowhere", "NUMBA_CACHE_DIR": "/proc/nowhere"},
    ],
    ids=lambda variables: " ".join(variables),
)
def test_kernels_run_whatever_the_environment_says(tmp_path, variables):
    """Catches functions taken for compiled ones, and a cache that nobody can write."""
    environment = dict(os.environ) | {"NUMBA_CACHE_DIR": str(tmp_path)} | variables
    run = [sys.executable, "-c", _EXP]
    done = subprocess.run(run, env=environment, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "done\n"), done.stderr


def test_users_functions_stay_uncompiled_where_they_ask_for_it(tmp_path):
    """Catches a setting of the whole process that importing this package changes."""
    user = "import numba, vigauge.kernels.rotation; print(numba.njit(lambda x: x)(numba.config.DISABLE_JIT))"
    environment = dict(os.environ) | {"NUMBA_DISABLE_JIT": "1", "NUMBA_CACHE_DIR": str(tmp_path)}
    run = [sys.executable, "-c", user]
    done = subprocess.run(run, env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "1"
