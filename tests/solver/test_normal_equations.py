"""Block normal equations and Schur complement against dense linear algebra."""

from dataclasses import replace

import numpy as np
import pytest

from support.dense import dense_jacobian, dense_residual
from support.random_problem import random_problem, with_noise_of_its_own
from support.simulated import estimate, trial
from vigauge import example_problem
from vigauge.errors import DegenerateError, SolverError
from vigauge.kernels import covisibility
from vigauge.kernels.lanes import LANES
from vigauge.model.factors import LinearFactor
from vigauge.model.problem import Problem
from vigauge.solver.normal_equations import NormalEquations, linearise
from vigauge.solver.residuals import cost
from vigauge.sparsity import structure
from vigauge.sparsity.layout import motion_columns

NO_COLUMNS = np.empty(0, dtype=np.int64)


def problems():
    """Two cameras and a jumping factor; a long flight with short tracks; a simulated problem away
    from and at its minimum; the first two with biases, the first with noise that differs."""
    known, estimated = (
        [random_problem(3, biases=b), random_problem(4, n_keyframes=15, n_landmarks=40, window=4, biases=b)]
        for b in (False, True)
    )
    return [
        *((problem, problem.initial) for problem in known),
        (trial(), trial().initial),
        (trial(), estimate()),
        *((problem, problem.initial) for problem in estimated),
        (with_noise_of_its_own(known[0], 3), known[0].initial),
    ]


@pytest.mark.parametrize("case", range(7))
def test_blocks_are_those_of_the_dense_product(case):
    """Catches an observation summed into another block, or added twice: H = J^T J and g = J^T r."""
    problem, state = problems()[case]
    equations = linearise(problem, state)
    J, r = dense_jacobian(problem, state), dense_residual(problem, state)
    scale = np.linalg.norm(J, axis=0)
    H = J.T @ J / scale[:, None] / scale
    assert np.abs(equations.dense() / scale[:, None] / scale - H).max() < 1e-12
    assert np.abs(equations.gradient - J.T @ r).max() < 1e-12 * np.linalg.norm(r) * scale.max()
    assert np.allclose(equations.diagonal(), scale**2, rtol=1e-12)


def test_two_cameras_of_one_keyframe_share_a_block():
    """Catches the second camera's rows overwriting the first's in a (keyframe, landmark) block."""
    problem = random_problem(3)
    found = linearise(problem, problem.initial).structure
    pairs = set(zip(problem.obs_landmark.tolist(), problem.obs_keyframe.tolist(), strict=True))
    assert len(found.pairs.keyframe) == len(pairs) < len(problem.obs_uv)


def test_groups_take_every_landmark_once():
    """Catches landmarks between two groups or batches: short tracks over many keyframes need several."""
    problem = random_problem(4, n_keyframes=60, n_landmarks=6000, window=3)
    s = problem.structure
    batches = s.batches
    assert s.n_groups > 5
    assert np.array_equal(np.sort(batches.order), np.arange(s.n_landmarks))
    assert (batches.batch_begin[0], batches.batch_begin[-1]) == (0, s.n_landmarks)
    assert set(np.diff(batches.batch_begin).tolist()) <= set(range(1, LANES + 1))
    batch, lane = s.landmark_lane
    assert np.array_equal(batches.order[batches.batch_begin[batch] + lane], np.arange(s.n_landmarks))
    for g in range(s.n_groups):
        keyframes = s.seen[s.group_seen[g] : s.group_seen[g + 1]]
        cells = slice(*batches.batch_cell[[s.group_batch[g], s.group_batch[g + 1]]])
        assert np.array_equal(keyframes[batches.cell_row[cells]], batches.cell_keyframe[cells])
        assert np.array_equal(np.unique(batches.cell_keyframe[cells]), keyframes)


@pytest.mark.parametrize("seed", [3, 4])
def test_every_observation_has_a_lane_of_its_own(seed):
    """Catches an observation summed with the camera, the pose or the landmark of another."""
    problem = random_problem(seed, n_keyframes=30, n_landmarks=3000, window=3)
    s = problem.structure
    batches = s.batches
    assert len(np.unique(s.obs_slot)) == len(problem.obs_uv)
    view, lane = np.divmod(s.obs_slot, LANES)
    cell = np.searchsorted(batches.cell_view, view, side="right") - 1
    batch = np.searchsorted(batches.batch_cell, cell, side="right") - 1
    assert np.array_equal(batches.view_camera[view], problem.obs_camera)
    assert np.array_equal(batches.cell_keyframe[cell], problem.obs_keyframe)
    assert np.array_equal(batches.order[batches.batch_begin[batch] + lane], problem.obs_landmark)
    pairs = s.pairs
    assert np.array_equal(pairs.keyframe, batches.cell_keyframe[pairs.cell])
    assert np.array_equal(np.searchsorted(pairs.landmark, np.arange(s.n_landmarks + 1)), pairs.begin)


def test_who_does_not_see_a_landmark_may_be_anywhere():
    """Catches a division by zero in an empty lane: a landmark in the image plane of a keyframe that does not
    see it, beside landmarks that it does see."""
    problem = random_problem(4, n_keyframes=15, n_landmarks=40, window=4)
    batches = problem.structure.batches
    j, k = next(
        (j, k)
        for j in batches.order[: batches.batch_begin[1]].tolist()
        for k in batches.cell_keyframe[: batches.batch_cell[1]].tolist()
        if k > 0 and k not in problem.obs_keyframe[problem.obs_landmark == j]
    )
    # The camera in the body's place, so that the depth is zero to the last digit.
    camera = replace(problem.cameras[0], R_BC=np.eye(3), p_BC=np.zeros(3))
    problem = replace(problem, cameras=(camera,) * len(problem.cameras))
    state = problem.initial
    p_W, R_WB, X_W = state.p_W.copy(), state.R_WB.copy(), state.X_W.copy()
    p_W[k], R_WB[k], X_W[j] = 0.0, np.eye(3), [1.0, 2.0, 0.0]
    there = replace(state, p_W=p_W, R_WB=R_WB, X_W=X_W)
    equations = linearise(problem, there)
    J, r = dense_jacobian(problem, there), dense_residual(problem, there)
    J /= (scale := np.linalg.norm(J, axis=0))
    assert np.allclose(equations.dense() / scale[:, None] / scale, J.T @ J, atol=1e-12)
    assert cost(problem, there) == pytest.approx(0.5 * r @ r, rel=1e-12)


def test_cameras_of_a_keyframe_may_come_in_any_order():
    """Catches sums into a block that another camera has not begun yet: problems are ordered by landmark and
    keyframe, not by camera."""
    problem = random_problem(3)
    order = np.lexsort((-problem.obs_camera, problem.obs_keyframe, problem.obs_landmark))
    names = ("keyframe", "camera", "landmark", "uv")
    swapped = replace(problem, **{f"obs_{name}": getattr(problem, f"obs_{name}")[order] for name in names})
    assert not np.array_equal(swapped.obs_camera, problem.obs_camera)
    found, expected = linearise(swapped, swapped.initial), linearise(problem, problem.initial)
    assert np.allclose(found.dense(), expected.dense(), rtol=1e-12, atol=1e-9)
    assert np.allclose(found.gradient, expected.gradient, rtol=1e-12, atol=1e-9)


def test_keyframes_without_observations():
    """Catches rows shifted to the next keyframe where one has no observations at all."""
    problem = random_problem(5)
    keep = problem.obs_keyframe != 2
    problem = replace(
        problem,
        **{
            f"obs_{name}": getattr(problem, f"obs_{name}")[keep]
            for name in ("keyframe", "camera", "landmark", "uv")
        },
    )
    J = dense_jacobian(problem, problem.initial)
    H = linearise(problem, problem.initial).dense()
    assert np.allclose(H, J.T @ J, rtol=1e-12, atol=1e-12 * np.abs(H).max())


def dense_step(equations: NormalEquations, damping: np.ndarray, held: np.ndarray) -> np.ndarray:
    keep = np.setdiff1d(np.arange(len(damping)), held)
    H = (equations.dense() + np.diag(damping))[np.ix_(keep, keep)]
    step = np.zeros(len(damping))
    step[keep] = np.linalg.solve(H, -equations.gradient[keep])
    return step


@pytest.mark.parametrize("held", [NO_COLUMNS, np.array([0, 1, 2, 32]), np.array([5, 11, 40])])
@pytest.mark.parametrize("case", [0, 1, 2, 4, 5])
def test_schur_step_is_the_dense_step(case, held):
    """Catches an elimination, a back-substitution or a held column that is not exact."""
    problem, state = problems()[case]
    held = held[held < state.n_motion]
    equations = linearise(problem, state)
    damping = 1e-4 * equations.diagonal()
    step = equations.eliminate(damping).solve(held)
    expected = dense_step(equations, damping, held)
    scale = np.sqrt(equations.diagonal())
    assert np.linalg.norm(scale * (step - expected)) < 1e-9 * np.linalg.norm(scale * expected)
    assert np.all(step[held] == 0.0)
    assert np.count_nonzero(step) == len(step) - len(held)


@pytest.mark.parametrize("apart", [1, 2, 5])
@pytest.mark.parametrize("width", [9, 15])
def test_a_factor_between_velocities_of_any_keyframes_is_in_the_step(width, apart):
    """Catches a step that leaves out what joins velocities of keyframes that are no neighbours."""
    problem = example_problem(biases="estimated" if width == 15 else "known")
    state = problem.initial
    columns = motion_columns(state.n_keyframes, width)[[1, 1 + apart], 6:9].ravel()
    factor = LinearFactor(columns, np.ones(3), 1e3 * np.hstack([np.eye(3), -np.eye(3)]))
    equations = linearise(problem, state).with_factor(factor)
    damping = 1e-4 * equations.diagonal()
    step = equations.eliminate(damping).solve(NO_COLUMNS)
    expected = dense_step(equations, damping, NO_COLUMNS)
    scale = np.sqrt(equations.diagonal())
    assert np.linalg.norm(scale * (step - expected)) < 1e-9 * np.linalg.norm(scale * expected)


@pytest.mark.parametrize("case", [0, 1, 2, 4, 5])
def test_schur_complement_is_the_dense_one(case):
    """Catches damping added to one part only, and landmarks lost between groups that are eliminated
    together: S = A - W C^-1 W^T, with and without damping."""
    problem, state = problems()[case]
    equations = linearise(problem, state)
    n = state.n_motion
    for damping in (None, 0.1 * equations.diagonal()):
        H = equations.dense() + (0.0 if damping is None else np.diag(damping))
        g = equations.gradient
        reduced = equations.eliminate(damping)
        S = H[:n, :n] - H[:n, n:] @ np.linalg.solve(H[n:, n:], H[n:, :n])
        b = g[:n] - H[:n, n:] @ np.linalg.solve(H[n:, n:], g[n:])
        assert np.abs(reduced.matrix - S).max() < 1e-11 * np.abs(H[:n, :n]).max()
        assert np.abs(reduced.gradient - b).max() < 1e-11 * np.abs(g[:n]).max()


def returning_flight(n_landmarks: int = 120) -> Problem:
    """Twelve keyframes that come back: every fourth landmark is seen by the first and the last two only."""
    problem = random_problem(3, n_keyframes=12, n_landmarks=n_landmarks)
    far = problem.obs_landmark % 4 == 0
    ends = (problem.obs_keyframe < 2) | (problem.obs_keyframe > 9)
    # Of the others in their group, some are lost early and some miss a keyframe: a batch with a gap.
    early, gap = problem.obs_keyframe < 7, (problem.obs_keyframe < 8) & (problem.obs_keyframe != 5)
    keep = np.where(far, ends, np.where(problem.obs_landmark % 4 == 3, early, gap))
    seen = np.unique(problem.obs_landmark[keep])
    names = ("keyframe", "camera", "landmark", "uv")
    kept = {f"obs_{name}": getattr(problem, f"obs_{name}")[keep] for name in names}
    kept["obs_landmark"] = np.searchsorted(seen, kept["obs_landmark"])
    return replace(problem, initial=replace(problem.initial, X_W=problem.initial.X_W[seen]), **kept)


def require_dense_system(problem: Problem) -> None:
    equations = linearise(problem, problem.initial)
    n = problem.initial.n_motion
    J, r = dense_jacobian(problem, problem.initial), dense_residual(problem, problem.initial)
    damping = 1e-3 * equations.diagonal()
    H, g = J.T @ J + np.diag(damping), J.T @ r
    inverse = np.linalg.solve(H[n:, n:], np.column_stack([H[n:, :n], g[n:]]))
    S, b = H[:n, :n] - H[:n, n:] @ inverse[:, :-1], g[:n] - H[:n, n:] @ inverse[:, -1]
    reduced = equations.eliminate(damping)
    scale = np.sqrt(np.diagonal(H)[:n])
    assert np.abs((reduced.matrix - S) / scale[:, None] / scale).max() < 1e-11
    assert np.abs((reduced.gradient - b) / scale).max() < 1e-11 * np.abs(g[:n] / scale).max()
    assert np.abs((equations.dense() - J.T @ J)[:n, :n] / scale[:, None] / scale).max() < 1e-12


def test_flight_that_comes_back():
    """Catches columns of the product that nobody filled, and products of batches apart from their group's put
    in the wrong place: landmarks of one group that are seen by other keyframes, with others between."""
    problem = returning_flight()
    batches = problem.structure.batches
    first, end = batches.batch_cell[:-1], batches.batch_cell[1:]
    reach = batches.cell_row[end - 1] + 1 - batches.cell_row[first]
    gaps = reach - (end - first)
    apart = reach > covisibility.LONG_GAPS * (end - first)
    assert np.any(apart) and np.any((gaps > 0) & ~apart)
    require_dense_system(problem)


@pytest.mark.parametrize("piece", [64, 400])
def test_pieces_add_up_to_the_whole(piece, monkeypatch):
    """Catches a piece's share of the system, the gradient or keyframes' blocks lost or put elsewhere."""
    monkeypatch.setattr(structure, "PIECE", piece)
    monkeypatch.setattr(structure, "CALL_COST", 0.0)
    for problem in (
        random_problem(4, n_keyframes=30, n_landmarks=120, window=3),
        random_problem(4, n_keyframes=30, n_landmarks=120, window=3, biases=True),
        random_problem(3, n_keyframes=6, n_landmarks=40),
        returning_flight(),
    ):
        require_dense_system(problem)
    assert len(random_problem(4, n_keyframes=30, n_landmarks=120, window=3).structure.pieces) > 2


@pytest.mark.parametrize("lane", [0, 5, 15, 16])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_one_bad_landmark_is_enough(lane, axis):
    """Catches a block without a factor that is overlooked beside good ones, whichever its place."""
    equations = linearise(returning_flight(), returning_flight().initial)
    j = equations.structure.batches.order[lane]
    landmark = equations.landmark.copy()
    landmark[j, axis, axis] *= -1.0
    with pytest.raises(SolverError, match="not positive definite"):
        replace(equations, landmark=landmark).eliminate(1e-3 * equations.diagonal())


@pytest.mark.parametrize("seed", range(20))
def test_singular_landmarks_are_always_called_so(seed):
    """Catches an error that depends on how a zero was rounded: a landmark on one line of sight is
    unobservable, whether its last pivot comes out as 1e-17 or as -1e-17."""
    problem = random_problem(3)
    j = seed % problem.initial.n_landmarks
    mine = np.flatnonzero(problem.obs_landmark == j)
    keep = (problem.obs_landmark != j) | (np.arange(len(problem.obs_uv)) == mine[seed % len(mine)])
    names = ("keyframe", "camera", "landmark", "uv")
    lone = replace(problem, **{f"obs_{name}": getattr(problem, f"obs_{name}")[keep] for name in names})
    with pytest.raises(DegenerateError, match=f"landmark {j} "):
        linearise(lone, lone.initial).eliminate()


def test_couplings_are_those_of_the_blocks():
    """Catches the landmark couplings that covariances go through: F, W C^-1 V and V^T C^-1 V."""
    problem, state = problems()[0]
    equations = linearise(problem, state)
    reduced = equations.eliminate()
    n = 9 * state.n_keyframes
    H = equations.dense()
    V = np.random.default_rng(0).normal(size=(3 * state.n_landmarks, 4))
    assert np.allclose(reduced.landmark_inverses(), np.linalg.inv(equations.landmark), rtol=1e-9)
    motion, gram = reduced.couple(V)
    expected = np.linalg.solve(H[n:, n:], V)
    assert np.allclose(motion, H[:n, n:] @ expected, rtol=1e-9, atol=1e-9)
    assert np.allclose(gram, V.T @ expected, rtol=1e-9)


def test_prior_is_added_once_and_only_there():
    """Catches a prior that changes the equations it was added to, or touches other columns."""
    problem, state = problems()[1]
    equations = linearise(problem, state)
    before = equations.motion.copy()
    columns, r = np.array([0, 1, 2, 32]), np.array([1.0, -2.0, 3.0, 0.5])
    J = np.random.default_rng(1).normal(size=(4, 4))
    added = equations.with_factor(LinearFactor(columns, r, J, total=True))
    full = np.zeros((4, state.n_parameters))
    full[:, columns] = J
    assert np.allclose(added.dense() - equations.dense(), full.T @ full, rtol=0, atol=1e-6)
    assert np.allclose(added.gradient - equations.gradient, full.T @ r, rtol=0, atol=1e-6)
    assert np.array_equal(equations.motion, before)


def test_order_of_motion_columns():
    """Catches another order than all positions, all rotations, all velocities."""
    assert motion_columns(2).tolist() == [
        [0, 1, 2, 6, 7, 8, 12, 13, 14],
        [3, 4, 5, 9, 10, 11, 15, 16, 17],
    ]


def without_landmarks(problem: Problem) -> Problem:
    empty = np.zeros(0, dtype=np.int64)
    return replace(
        problem,
        initial=replace(problem.initial, X_W=np.zeros((0, 3))),
        obs_keyframe=empty,
        obs_camera=empty,
        obs_landmark=empty,
        obs_uv=np.zeros((0, 2)),
    )


def test_inertial_only_problems():
    """Catches sums over no landmarks: H, step and couplings of a problem without images."""
    problem = without_landmarks(random_problem(2))
    equations = linearise(problem, problem.initial)
    J = dense_jacobian(problem, problem.initial)
    assert np.allclose(equations.dense(), J.T @ J, rtol=1e-12, atol=1e-9)
    damping = 0.1 * equations.diagonal()
    step = equations.eliminate(damping).solve(NO_COLUMNS)
    assert np.allclose(step, dense_step(equations, damping, NO_COLUMNS), rtol=1e-9, atol=1e-12)


def test_failed_factorisations_are_named():
    """Catches a bare linear algebra error where the solver expects its own."""
    problem, state = problems()[0]
    equations = linearise(problem, state)
    with pytest.raises(SolverError, match="landmark"):
        replace(equations, landmark=-equations.landmark).eliminate()
    with pytest.raises(SolverError, match="reduced camera system"):
        replace(equations, storage=-equations.storage).eliminate().solve(NO_COLUMNS)
