"""Dense and banded storage of one symmetric matrix: the same answers from both."""

from dataclasses import replace

import numpy as np
import pytest

from support.random_problem import random_problem
from vigauge.errors import SolverError
from vigauge.gauge.gauges import FreeGauge
from vigauge.model.factors import LinearFactor
from vigauge.model.problem import Problem
from vigauge.solver.levenberg_marquardt import Options, solve
from vigauge.solver.normal_equations import linearise
from vigauge.sparsity.layout import Layout, by_keyframe, motion_columns


def flight(n_keyframes: int = 40, seed: int = 1) -> Problem:
    """Short tracks over many keyframes, inertial factors between neighbours only."""
    problem = random_problem(seed, n_keyframes=n_keyframes, n_landmarks=5 * n_keyframes, window=4)
    f = problem.inertial
    chain = {
        name: getattr(f, name)[:-1] for name in ("first", "second", "dt", "dp", "dR", "dv", "covariance")
    }
    return replace(problem, inertial=replace(f, **chain))


def renumbered(problem: Problem, order: np.ndarray) -> Problem:
    """The same flight with its keyframes numbered in another order (the first stays first)."""
    state, f = problem.initial, problem.inertial
    number = np.argsort(order)
    moved = replace(state, p_W=state.p_W[order], R_WB=state.R_WB[order], v_W=state.v_W[order])
    return Problem.from_observations(
        initial=moved,
        cameras=problem.cameras,
        keyframe=number[problem.obs_keyframe],
        camera=problem.obs_camera,
        landmark=problem.obs_landmark,
        uv=problem.obs_uv,
        sigma_px=problem.sigma_px,
        inertial=replace(f, first=number[f.first], second=number[f.second]),
        gravity=problem.gravity,
    )


def shuffled(problem: Problem) -> tuple[Problem, np.ndarray]:
    n = problem.initial.n_keyframes
    order = np.append(0, 1 + np.random.default_rng(0).permutation(n - 1))
    return renumbered(problem, order), order


def stored_dense(problem: Problem) -> Problem:
    """The same problem, its motion block not stored as a band."""
    other = replace(problem)
    n = problem.initial.n_keyframes
    dense = replace(problem.structure, layout=Layout(np.arange(n), 9 * n - 1, False))
    other.__dict__["structure"] = dense
    return other


@pytest.mark.parametrize("held", [[], [0, 1, 2, 122], [7, 200, 359]])
@pytest.mark.parametrize("mixed", [False, True])
def test_banded_step_is_the_dense_step(held, mixed):
    """Catches entries outside the band, a wrong order, and columns held in one form only."""
    problem = shuffled(flight())[0] if mixed else flight()
    layout = problem.structure.layout
    assert layout.banded
    assert np.array_equal(layout.place, np.arange(40)) != mixed
    steps = []
    for form in (problem, stored_dense(problem)):
        equations = linearise(form, form.initial)
        reduced = equations.eliminate(1e-3 * equations.diagonal())
        steps.append((equations, reduced, reduced.solve(np.array(held, dtype=np.int64))))
    (banded, reduced, step), (dense, full, expected) = steps
    scale = np.sqrt(dense.diagonal())
    assert np.array_equal(banded.diagonal(), dense.diagonal())
    assert np.allclose(banded.motion, dense.motion, rtol=1e-14)
    assert np.abs(reduced.matrix - full.matrix).max() < 1e-14 * np.abs(full.matrix).max()
    assert np.linalg.norm(scale * (step - expected)) < 1e-9 * np.linalg.norm(scale * expected)
    assert np.all(step[held] == 0.0)


def test_renumbering_finds_the_band():
    """Catches a band that depends on how keyframes are numbered: reverse Cuthill-McKee undoes a shuffle."""
    problem = flight(60)
    mixed, _ = shuffled(problem)
    plain, found = problem.structure.layout, mixed.structure.layout
    assert found.banded
    assert (plain.reordered, found.reordered) == (False, True)
    assert solve(mixed, FreeGauge(), Options(maximum_iterations=1)).layout is found
    assert found.length < 0.4 * found.size**2
    assert found.half_bandwidth <= 2 * plain.half_bandwidth + 9


def test_no_band_is_stored_dense():
    """Catches a band as wide as the matrix: landmarks seen from everywhere, or a short window."""
    everywhere = random_problem(2, n_keyframes=30, n_landmarks=40)
    assert not everywhere.structure.layout.banded
    assert not flight(8).structure.layout.banded


def test_order_of_motion_vectors():
    """Catches a transposition: (9N,) by kind to (N, 9) by keyframe, matrices alike."""
    x = np.arange(54.0)
    blocks = by_keyframe(x, 6)
    assert blocks[1].tolist() == [3, 4, 5, 21, 22, 23, 39, 40, 41]
    assert np.array_equal(blocks, x[motion_columns(6)])
    assert np.array_equal(by_keyframe(np.stack([x, -x], axis=1), 6), np.stack([blocks, -blocks], axis=2))


def test_prior_outside_the_band_is_refused():
    """Catches a prior written beyond the stored entries, which would corrupt others silently."""
    problem = flight()
    equations = linearise(problem, problem.initial)
    inside = np.array([0, 1, 2, 122])
    added = equations.with_factor(LinearFactor(inside, np.ones(4), 2.0 * np.eye(4), total=True))
    assert np.allclose((added.motion - equations.motion)[np.ix_(inside, inside)], 4.0 * np.eye(4), atol=1e-6)
    with pytest.raises(SolverError, match="too far apart"):
        equations.with_factor(LinearFactor(np.array([0, 117]), np.ones(2), np.eye(2), total=True))
