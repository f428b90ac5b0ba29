"""Degenerate problems: found by the null space of H, and named."""

from dataclasses import replace

import numpy as np
import pytest

from support import degenerate as d
from support.dense import dense_jacobian
from support.simulated import estimate, trial
from vigauge.covariance.covariance import motion_covariance
from vigauge.errors import DataError, IndefiniteError
from vigauge.gauge.gauges import CentroidGauge, FreeGauge
from vigauge.gauge.group import orbit_tangent
from vigauge.geometry import so3
from vigauge.model.factors import BiasPrior
from vigauge.model.problem import Problem
from vigauge.model.state import State
from vigauge.observability.diagnosis import Diagnosis, diagnose, diagnose_equations, diagnose_hessian
from vigauge.solver.levenberg_marquardt import solve
from vigauge.solver.normal_equations import linearise


def apart(keyframe: np.ndarray, landmark: np.ndarray) -> np.ndarray:
    """The first four keyframes see the first ten landmarks only, the others the rest."""
    return (keyframe < 4) == (landmark < 10)


TWO_CHAINS = [(0, 1), (1, 2), (2, 3), (4, 5), (5, 6), (6, 7)]
SHORT_CHAIN = [(i, i + 1) for i in range(6)]
VELOCITIES = "velocity of keyframes 0 to 7"

# What is beyond position and yaw, by hand: (settings of the problem, names, number of directions).
DEGENERATE = {
    "standing still": ({"path": d.still, "turn": d.still}, ["depth of landmarks 0 to 19"], 20),
    "constant velocity": ({"path": d.straight, "turn": d.still}, ["scale"], 1),
    "a single keyframe": (
        {"n_keyframes": 1},
        ["velocity of keyframe 0", "roll and pitch", "depth of landmarks 0 to 19"],
        25,
    ),
    "a single stereo keyframe": (
        {"n_keyframes": 1, "stereo": True},
        ["velocity of keyframe 0", "roll and pitch"],
        5,
    ),
    "no landmarks": ({"n_landmarks": 0}, ["velocity", "roll and pitch"], 5),
    "a landmark of one view": (
        {"sees": lambda keyframe, landmark: (landmark != 3) | (keyframe == 2)},
        ["depth of landmark 3"],
        1,
    ),
    "no inertial measurements": ({"links": []}, [VELOCITIES, "scale", "roll and pitch"], 27),
    "no inertial measurements, stereo": (
        {"links": [], "stereo": True},
        [VELOCITIES, "roll and pitch"],
        26,
    ),
    "two parts": (
        {"links": TWO_CHAINS, "sees": apart},
        ["position of keyframes 4 to 7", "yaw of keyframes 4 to 7"],
        4,
    ),
    "two parts without inertial measurements": (
        {"links": [], "sees": apart},
        [
            VELOCITIES,
            "scale",
            "roll and pitch",
            "position of keyframes 4 to 7",
            "yaw of keyframes 4 to 7",
            "roll and pitch of keyframes 4 to 7",
            "scale of keyframes 4 to 7",
        ],
        34,
    ),
    "a keyframe that sees nothing": (
        {"links": SHORT_CHAIN, "sees": lambda keyframe, landmark: keyframe != 7},
        [
            "velocity of keyframe 7",
            "position of keyframe 7",
            "yaw of keyframe 7",
            "roll and pitch of keyframe 7",
        ],
        9,
    ),
    "a keyframe with one track": (
        {"links": SHORT_CHAIN, "sees": lambda keyframe, landmark: (keyframe != 7) | (landmark < 1)},
        ["velocity of keyframe 7", "pose of keyframe 7"],
        7,
    ),
}


def pitching(t: np.ndarray) -> np.ndarray:
    return 0.3 * np.sin(2.0 * t)[:, None] * np.array([0.0, 1.0, 0.0])


def turning_about_gravity(t: np.ndarray) -> np.ndarray:
    return 0.3 * np.sin(2.0 * t)[:, None] * np.array([0.0, 0.0, 1.0])


def askew(t: np.ndarray) -> np.ndarray:
    return np.tile([0.3, 0.5, 0.2], (len(t), 1))


TILT = "accelerometer bias along x and y with the tilt"
# With biases in the state: the body must turn about two axes, or about gravity.
WITH_BIASES = {
    "translation": ({"turn": d.still, "stereo": True}, [TILT], 2, "does not turn"),
    "translation, one camera": ({"turn": d.still}, [TILT], 2, "does not turn"),
    "hovering": ({"path": d.still, "turn": d.still, "stereo": True}, [TILT], 2, "standing still"),
    "translation askew": (
        {"turn": askew, "stereo": True},
        ["accelerometer bias along x and y and z with the tilt"],
        2,
        "does not turn",
    ),
    "pitching": (
        {"turn": pitching, "stereo": True},
        ["accelerometer bias along y with the tilt"],
        1,
        "about one level axis only",
    ),
    "constant acceleration": ({"path": d.falling, "turn": d.still}, [TILT, "scale"], 3, "does not turn"),
    "no inertial measurements": (
        {"links": [], "stereo": True},
        [
            VELOCITIES,
            "gyroscope bias of keyframes 0 to 7",
            "accelerometer bias of keyframes 0 to 7",
            "roll and pitch",
        ],
        74,
        "no inertial measurements",
    ),
    "turning about gravity": ({"turn": turning_about_gravity, "stereo": True}, [], 0, ""),
    "swaying": ({"stereo": True}, [], 0, ""),
    "swaying, one camera": ({}, [], 0, ""),
}

# Looks degenerate, and is not.
REGULAR = {
    "a flight": {},
    "a flight with stereo": {"stereo": True},
    "one plane": {"landmarks": d.coplanar},
    "constant velocity with stereo": {"path": d.straight, "stereo": True},
    # Known biases: the scale of a constant acceleration is measured.
    "constant acceleration": {"path": d.falling},
    "constant acceleration without rotation": {"path": d.falling, "turn": d.still},
    "two parts with an inertial link": {"sees": apart},
    "pure rotation with stereo": {"path": d.still, "stereo": True},
}


def dense_nullity(problem: Problem) -> int:
    """Null directions of the dense Jacobian with unit columns, by its singular values."""
    J = dense_jacobian(problem, problem.initial)
    length = np.linalg.norm(J, axis=0)
    values = np.linalg.svd(J / np.where(length > 0.0, length, 1.0), compute_uv=False)
    return J.shape[1] - int(np.count_nonzero(values > 1e-7 * values[0]))


def noisy(problem: Problem, seed: int = 0) -> Problem:
    """The same with noise as believed, and a start off the truth."""
    rng = np.random.default_rng(seed)
    f, truth = problem.inertial, problem.initial
    error = rng.normal(size=(len(f.dt), 9)) * d.SIGMA_INERTIAL
    factors = replace(f, dp=f.dp + error[:, :3], dR=f.dR @ so3.exp(error[:, 3:6]), dv=f.dv + error[:, 6:])
    start = State.start(
        truth.p_W + rng.normal(0.0, 0.03, truth.p_W.shape),
        so3.exp(rng.normal(0.0, 0.02, truth.p_W.shape)) @ truth.R_WB,
        truth.v_W + rng.normal(0.0, 0.03, truth.p_W.shape),
        truth.X_W + rng.normal(0.0, 0.05, truth.X_W.shape),
    )
    uv = problem.obs_uv + rng.normal(0.0, d.SIGMA_PX, problem.obs_uv.shape)
    return replace(problem, inertial=factors, obs_uv=uv, initial=start)


@pytest.mark.parametrize("case", DEGENERATE)
def test_extra_directions_are_counted_and_named(case: str) -> None:
    """A degenerate problem that passes for regular, or gets another's name."""
    settings, names, count = DEGENERATE[case]
    problem = d.problem_of(**settings)
    found = diagnose(problem, problem.initial)
    assert found.degenerate
    assert [str(direction) for direction in found.extra] == names
    assert sum(direction.count for direction in found.extra) == count
    assert found.expected == 4 and found.missing == 0
    assert found.n_parameters - found.rank == dense_nullity(problem)
    for direction in found.extra:
        assert sum(direction.shares.values()) == pytest.approx(1.0)
        assert direction.eigenvalue < 1e-11
    assert found.sentence.startswith("degenerate") and names[0] in found.sentence
    assert found.withheld == found.sentence


def biased(settings: dict) -> Problem:
    motion = {name: settings[name] for name in ("path", "turn") if name in settings}
    return d.with_biases(d.problem_of(**settings), **motion)


@pytest.mark.parametrize("case", WITH_BIASES)
def test_what_biases_hide_is_counted_and_named(case: str) -> None:
    """Catches a bias that looks like a tilt or a scale and passes for regular, or a good window refused."""
    settings, names, count, cause = WITH_BIASES[case]
    problem = biased(settings)
    found = diagnose(problem, problem.initial)
    assert [str(direction) for direction in found.extra] == names
    assert not found.weak
    assert sum(direction.count for direction in found.extra) == count
    assert found.n_parameters - found.rank == dense_nullity(problem)
    assert cause in found.cause and bool(cause) == found.degenerate
    for direction in found.extra:
        assert sum(direction.shares.values()) == pytest.approx(1.0)


@pytest.mark.parametrize("case", WITH_BIASES)
@pytest.mark.parametrize("seed", [0, 1])
def test_noise_does_not_hide_what_biases_hide(case: str, seed: int) -> None:
    """Catches a tilt that errors of a few milliradians make regular: its sigma is a radian then. A prior on
    the bias makes it regular in truth."""
    settings, names, count, _ = WITH_BIASES[case]
    problem, rng = biased(settings), np.random.default_rng(seed)
    truth = problem.initial
    step = rng.normal(size=truth.n_parameters) * np.repeat([3e-3, 2e-3, 1e-2, 0.0, 0.0, 0.0], [24] * 5 + [60])
    state = truth.retract(step)
    found = diagnose(problem, state)
    kinds = {direction.kind for direction in (*found.extra, *found.weak)}
    assert any("with the tilt" in kind for kind in kinds) == any("with the tilt" in name for name in names)
    assert found.degenerate == (count > 0)
    prior = BiasPrior(0, np.zeros(3), np.zeros(3), 0.01, 0.1)
    told = diagnose(replace(problem, factors=(prior,)), state)
    assert not any("with the tilt" in str(direction) for direction in (*told.extra, *told.weak))


@pytest.mark.parametrize("case", REGULAR)
def test_regular_problems_pass(case: str) -> None:
    """A good covariance withheld: a plane is no degeneracy where there is an inertial sensor."""
    problem = d.problem_of(**REGULAR[case])
    found = diagnose(problem, problem.initial)
    assert not found.degenerate, found.sentence
    assert (
        found.rank
        == problem.initial.n_parameters - 4
        == problem.initial.n_parameters - dense_nullity(problem)
    )
    assert found.gap > 1e7
    assert not found.withheld


@pytest.mark.parametrize(
    ("settings", "kinds"),
    [
        ({"path": d.still, "turn": d.still}, {"scale", "depth"}),
        ({"path": d.still}, {"scale", "depth"}),
        ({"path": d.straight}, {"scale"}),
        ({"path": d.straight, "turn": d.still}, {"scale"}),
    ],
)
@pytest.mark.parametrize("seed", [0, 1, 3])
def test_noise_does_not_hide_a_degenerate_motion(settings: dict, kinds: set, seed: int) -> None:
    """At an estimate the null directions carry information that is noise only; rank alone is then full."""
    problem = noisy(d.problem_of(**settings), seed)
    found = diagnose(problem, solve(problem, FreeGauge()).state)
    assert found.degenerate and found.weak
    assert {direction.kind for direction in (*found.extra, *found.weak)} <= kinds


@pytest.mark.parametrize("case", ["a flight", "one plane", "constant acceleration"])
def test_noise_does_not_make_a_problem_degenerate(case: str) -> None:
    problem = noisy(d.problem_of(**REGULAR[case]))
    solution = solve(problem, FreeGauge())
    assert solution.converged
    assert not diagnose(problem, solution.state).degenerate


@pytest.mark.parametrize("shape", ["sine", "arc", "rec"])
@pytest.mark.parametrize("points", ["plane", "random"])
def test_the_paper_s_simulations_are_regular(shape: str, points: str) -> None:
    found = diagnose(trial(0, shape, points), estimate(0, shape, points))
    assert found.sentence.startswith("regular: rank 176 of 180")


def test_stereo_at_rest_is_regular_but_has_no_covariance() -> None:
    """Stereo sees everything from one place, yet every view has the errors of the first."""
    problem = d.problem_of(d.still, d.still, stereo=True)
    found = diagnose(problem, problem.initial)
    assert not found.degenerate and found.motion == "standing still"
    assert found.withheld.startswith("standing still") and found.withheld in found.sentence
    assert found.sentence.startswith("regular")


def gentle(t: np.ndarray) -> np.ndarray:
    """Acceleration of a sixth of a metre per second squared and less: the scale is known to its own size."""
    return 0.3 * d.falling(t) + 0.7 * d.straight(t)


def scale_sigma(problem: Problem, state: State) -> float:
    """Marginal sigma of the path's size, from the covariance of all positions about their centre."""
    path = (state.p_W - state.p_W.mean(axis=0)).ravel()
    positions = motion_covariance(problem, state, CentroidGauge())[: len(path), : len(path)]
    return float(np.sqrt(path @ positions @ path)) / float(path @ path)


@pytest.mark.parametrize(
    "settings",
    [{"path": gentle}, {"path": gentle, "turn": d.still}, {"n_landmarks": 1}, {"path": d.straight}],
)
def test_a_badly_known_scale_is_flagged_by_its_marginal_sigma(settings: dict) -> None:
    """The information of the scale alone is large where velocities and tilt may not move along."""
    problem = noisy(d.problem_of(**settings)) if "path" in settings else d.problem_of(**settings)
    state = solve(problem, FreeGauge()).state
    found = diagnose(problem, state)
    assert [direction.kind for direction in found.weak] == ["scale"]
    sigma = scale_sigma(problem, state)
    assert found.weak[0].sigma == pytest.approx(sigma, rel=1e-6) and sigma > 1.0 / 3.0
    assert f"scale (sigma {sigma:.0%})" in found.sentence
    assert found.withheld == found.sentence


@pytest.mark.parametrize("stereo", [False, True])
def test_a_well_known_scale_is_not_flagged(stereo: bool) -> None:
    problem = noisy(d.problem_of(stereo=stereo))
    state = solve(problem, FreeGauge()).state
    assert scale_sigma(problem, state) < 0.1
    assert diagnose(problem, state).sentence.endswith("no null direction is extra")


def held(t: np.ndarray) -> np.ndarray:
    """A body that turns in somebody's hands: it moves by more than nothing and less than is known of it."""
    return 0.015 * np.sin(3.0 * t[:, None] + [0.0, 1.0, 2.0])


@pytest.mark.parametrize("seed", [0, 1, 3])
def test_two_cameras_that_turn_on_the_spot_know_the_scale(seed: int) -> None:
    """A path that is all noise, whose size is taken for the scale: two cameras see distances all the same."""
    problem = noisy(d.problem_of(held, stereo=True).with_noise(3.0, 10.0), seed)
    state = solve(problem, FreeGauge()).state
    found = diagnose(problem, state)
    assert scale_sigma(problem, state) > 1.0 / 3.0 and found.motion == "moving"
    assert not found.withheld


def test_pure_rotation_of_the_camera_itself() -> None:
    """About the camera's centre there is no parallax at all; about the body's the lever arm gives some."""
    problem = d.problem_of(d.still)
    centred = replace(problem, cameras=(replace(problem.cameras[0], p_BC=np.zeros(3)),))
    found = diagnose(centred, centred.initial)
    assert [str(direction) for direction in found.extra] == ["depth of landmarks 0 to 19"]
    assert found.cause == "pure rotation"
    assert not diagnose(problem, problem.initial).extra


def test_an_absolute_measurement_is_missed_among_the_expected() -> None:
    """A direction of the gauge that something measures must not be counted as free."""
    problem = d.problem_of()
    state = problem.initial
    H = linearise(problem, state).dense()
    H[0, 0] += 1e6
    found = diagnose_hessian(H, orbit_tangent(state))
    assert (found.expected, found.missing, found.degenerate) == (3, 1, False)
    assert found.withheld == "1 of 4 expected directions are measured"
    assert found.sentence.endswith("no null direction is extra; 1 of 4 expected directions are measured")


@pytest.mark.parametrize("sigma", [1e-3, 1.0, 100.0])
def test_a_prior_on_the_whole_gauge_is_said(sigma: float) -> None:
    """A soft prior is no null space: H is invertible, and that is what to do."""
    problem = d.problem_of()
    H, U = linearise(problem, problem.initial).dense(), orbit_tangent(problem.initial)
    rows = [0, 1, 2, 3 * problem.initial.n_keyframes + 2]
    H[rows, rows] += sigma**-2
    found = diagnose_hessian(H, U)
    assert (found.expected, found.missing) == (0, 4)
    said = "4 of 4 expected directions are measured: H is invertible, invert it"
    assert said in found.sentence and found.withheld == said
    # And where it is not: a velocity that nothing measures.
    H[-1], H[:, -1] = 0.0, 0.0
    found = diagnose_hessian(H, U)
    assert found.degenerate and "invert it" not in found.sentence
    assert "4 of 4 expected directions are measured; 1 more than the gauge" in found.sentence


@pytest.mark.parametrize("size", [3e-2, 1e-9])
@pytest.mark.parametrize("at", ["inside", "single precision"])
def test_a_negative_eigenvalue_is_never_regular(size: float, at: str) -> None:
    problem = d.problem_of()
    H, U = linearise(problem, problem.initial).dense(), orbit_tangent(problem.initial)
    scale = np.sqrt(np.diagonal(H))
    values, vectors = np.linalg.eigh(H / scale[:, None] / scale)
    if at == "inside":
        H -= (values[4] + size) * np.outer(scale * vectors[:, 4], scale * vectors[:, 4])
    if at == "single precision":
        H = H.astype(np.float32).astype(float)
    with pytest.raises(IndefiniteError, match="H is not positive semidefinite: -.* of parameter"):
        diagnose_hessian(H, U)


def test_any_hessian_by_its_blocks() -> None:
    """The same answer from the bare matrix; what lies in no block is a combination with its shares."""
    problem = d.problem_of(links=TWO_CHAINS, sees=lambda k, j: ((k < 4) == (j < 10)) & ((j != 3) | (k == 2)))
    state = problem.initial
    n = 3 * state.n_keyframes
    blocks = {
        "position": np.arange(n),
        "rotation": np.arange(n, 2 * n),
        "velocity": np.arange(2 * n, 3 * n),
        "landmark": np.arange(3 * n, state.n_parameters),
    }
    H, U = linearise(problem, state).dense(), orbit_tangent(state)
    found = diagnose_hessian(H, U, blocks)
    assert [(direction.kind, direction.count) for direction in found.extra] == [
        ("landmark", 1),
        ("combination", 4),
    ]
    assert found.rank == diagnose(problem, state).rank
    assert "4 combinations of position, rotation" in found.sentence
    assert diagnose_hessian(H, U).extra[0].count == 5


def test_units_do_not_change_the_finding() -> None:
    """A threshold on the bare eigenvalues would call millimetres degenerate."""
    problem = d.problem_of(d.straight, d.still)
    state = problem.initial
    H, U = linearise(problem, state).dense(), orbit_tangent(state)
    unit = np.where(np.arange(len(H)) % 3 == 0, 1e5, 1e-4)
    found = diagnose_hessian(H * unit[:, None] * unit, U / unit[:, None])
    assert (found.expected, [direction.count for direction in found.extra]) == (4, [1])


def test_the_first_rotation_keeps_its_own_parametrisation() -> None:
    """Tilt is named also where the first increment is far from zero, Eq. (9)."""
    problem = d.problem_of(links=[])
    step = np.zeros(problem.initial.n_parameters)
    step[24:27] = [0.4, -0.3, 0.2]
    found = diagnose(problem, problem.initial.retract(step))
    assert [str(direction) for direction in found.extra][-1] == "roll and pitch"


@pytest.mark.parametrize(
    ("H", "U", "rule"),
    [
        (np.eye(3)[:2], np.zeros((2, 1)), "shape"),
        (np.eye(3), np.zeros((2, 1)), "shape"),
        (np.diag([1.0, np.nan, 1.0]), np.zeros((3, 1)), "finite"),
        (np.eye(3) + np.eye(3, k=1), np.zeros((3, 1)), "symmetric"),
    ],
)
def test_matrices_that_are_none_are_refused(H: np.ndarray, U: np.ndarray, rule: str) -> None:
    with pytest.raises(DataError, match=rule):
        diagnose_hessian(H, U)


def test_it_is_public() -> None:
    """What the package's name list promises must be there."""
    import vigauge

    problem = d.problem_of()
    assert isinstance(vigauge.diagnose(problem, problem.initial), Diagnosis)
    equations = linearise(problem, problem.initial)
    assert diagnose_equations(equations, problem, problem.initial).rank == problem.initial.n_parameters - 4
