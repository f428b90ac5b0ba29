"""What a covariance is judged by: information next to rounding, in any unit, scale, storage and place."""

from dataclasses import replace

import numpy as np
import pytest

from support.dense import dense_jacobian
from support.simulated import estimate, trial
from vigauge.covariance.covariance import Covariance, motion_covariance, motion_pseudo_inverse
from vigauge.covariance.foreign import covariance_from_hessian
from vigauge.covariance.projection import project_covariance
from vigauge.covariance.transform import transform_covariance
from vigauge.errors import DataError, DegenerateError, IndefiniteError
from vigauge.gauge.gauges import CentroidGauge, FixedGauge, FreeGauge, KeyframeGauge, PriorGauge
from vigauge.gauge.group import orbit_tangent
from vigauge.model.evaluation import relative_frobenius
from vigauge.observability.diagnosis import diagnose
from vigauge.solver.levenberg_marquardt import solve
from vigauge.solver.normal_equations import linearise

GAUGES = [FreeGauge(), FixedGauge(), PriorGauge(1e5), CentroidGauge(), KeyframeGauge(3)]
# A map's coordinates, Earth-centred ones, and a station a hundred million metres away, m.
PLACES = {"map": [4.5e5, 5.3e6, 400.0], "earth": [4.2e6, 1.7e5, 4.78e6], "far": [0.0, 0.0, 1e8]}


def flight():
    """H, U and the normal of the fixed gauge at an estimate, and the estimate."""
    state = estimate(0)
    return linearise(trial(0), state).dense(), orbit_tangent(state), FixedGauge().normal(state), state


def exact_inverse(H: np.ndarray) -> np.ndarray:
    """Inverse in long double by Gauss-Jordan, after scaling: the oracle of ill-conditioned matrices."""
    scale = 1.0 / np.sqrt(np.diagonal(H).astype(np.longdouble))
    A = np.hstack([H * scale[:, None] * scale, np.eye(len(H), dtype=np.longdouble)])
    for i in range(len(H)):
        pivot = i + int(np.argmax(np.abs(A[i:, i])))
        A[[i, pivot]] = A[[pivot, i]]
        A[i] /= A[i, i]
        others = np.arange(len(H)) != i
        A[others] -= A[others, i][:, None] * A[i]
    return A[:, len(H) :] * scale[:, None] * scale


@pytest.mark.parametrize(
    ("rows", "sigma"),
    [
        ("position", 0.3),
        ("position", 30.0),
        ("position and yaw", 3.0),
        ("yaw", 0.5),
        ("every position", 300.0),
    ],
)
def test_a_soft_prior_is_no_null_space(rows, sigma):
    """Catches sigmas thirty times too small: a prior's information is little next to that of the images."""
    H, U, _, state = flight()
    n = state.n_keyframes
    at = {"position": [0, 1, 2], "yaw": [3 * n + 2], "position and yaw": [0, 1, 2, 3 * n + 2]}.get(
        rows, list(range(3 * n))
    )
    H[at, at] += sigma**-2
    with pytest.raises(DataError, match="null space of H.*prior.*invert H"):
        covariance_from_hessian(H, U)
    # What was returned was wrong: the estimate is known to the prior's sigma, not to that of the shape.
    if rows == "position and yaw":
        right = np.sqrt(float(exact_inverse(H)[0, 0]))
        assert right == pytest.approx(sigma, rel=0.01)


@pytest.mark.parametrize("error", [1e-12, 1e-10])
def test_a_null_space_of_few_digits_is_one(error):
    """Catches a threshold at rounding: what U lacks is small next to the weakest direction of H."""
    H, U, V, _ = flight()
    off = U * (1.0 + error * np.random.default_rng(0).normal(size=U.shape))
    expected = covariance_from_hessian(H, U, V)
    assert relative_frobenius(covariance_from_hessian(H, off, V), expected) < 1e6 * error


def test_a_null_space_of_too_few_digits_is_refused():
    """Catches a fixed threshold: 2e-7 of the diagonal is more than the weakest direction can bear."""
    H, U, _, _ = flight()
    off = U * (1.0 + 2e-7 * np.random.default_rng(0).normal(size=U.shape))
    with pytest.raises(DataError, match="null space of H.*weakest.*another estimate"):
        covariance_from_hessian(H, off)


@pytest.mark.parametrize("how", ["repeated", "combined", "zero"])
def test_dependent_null_directions_are_refused(how):
    """Catches an orthonormal basis that is completed by a direction of rounding errors."""
    H, U, _, _ = flight()
    U[:, 3] = {"repeated": U[:, 1], "combined": U[:, 1] - 3.0 * U[:, 2], "zero": 0.0 * U[:, 1]}[how]
    for call in (lambda: covariance_from_hessian(H, U), lambda: project_covariance(np.eye(len(H)), U, U)):
        with pytest.raises(DataError, match="U, condition: columns must be independent"):
            call()


@pytest.mark.parametrize("how", ["velocities", "two positions", "nearly"])
@pytest.mark.parametrize("unit", [1.0, 1e-12])
def test_normals_that_do_not_cut_the_orbit_are_refused(how, unit):
    """Catches variances of 1e29 (m^2): three constraints on four directions, and one that says nothing."""
    H, U, V, state = flight()
    n = state.n_keyframes
    V[:, 3] = 0.0
    # A difference of two heights does not change along the orbit, and a velocity only with the yaw.
    V[[2, 5], 3] = unit, -unit
    if how == "velocities":
        V[:, 2], V[6 * n + 2, 2] = 0.0, unit
    if how == "nearly":
        V[0, 3] = 1e-13 * unit
    for call in (
        lambda: covariance_from_hessian(H, U, V),
        lambda: project_covariance(covariance_from_hessian(H, U), U, V),
    ):
        with pytest.raises(DegenerateError, match="constraints leave part of the gauge free"):
            call()


@pytest.mark.parametrize("size", [3e-2, 1e-6, 1e-10])
def test_a_negative_eigenvalue_is_named(size):
    """Catches "not positive definite in this gauge": what is negative is H, and where is known."""
    H, U, V, _ = flight()
    scale = np.sqrt(np.diagonal(H))
    S = H / scale[:, None] / scale
    weak = np.linalg.eigh(S)[1][:, 4]
    H -= (size + weak @ S @ weak) * np.outer(scale * weak, scale * weak)
    with pytest.raises(IndefiniteError, match=f"not positive semidefinite: -{size:.0e}"):
        covariance_from_hessian(H, U, V)


def test_single_precision_is_not_called_regular():
    """Catches digits that storage lost: H of a flight has eigenvalues below those of single precision."""
    H, U, _, _ = flight()
    with pytest.raises(IndefiniteError, match="H is not positive semidefinite.*single precision"):
        covariance_from_hessian(H.astype(np.float32).astype(float), U)


def test_a_negative_diagonal_is_refused():
    H, U, _, _ = flight()
    H[7, 7] *= -1.0
    with pytest.raises(DataError, match="H, row 7: must have a diagonal without negative entries"):
        covariance_from_hessian(H, U)


@pytest.mark.parametrize("factor", [1e-30, 1e-12, 1e12, 1e30])
def test_weights_scale_the_covariance(factor):
    """Catches an absolute threshold anywhere: H in other units of information, U and V of any length."""
    H, U, V, _ = flight()
    for normal in (None, V):
        scaled = None if normal is None else normal / factor
        found = covariance_from_hessian(H * factor, U * factor, scaled) * factor
        assert relative_frobenius(found, covariance_from_hessian(H, U, normal)) < 1e-9


@pytest.mark.parametrize("columns", ["sigma", "factors"])
def test_problems_of_any_weight(columns):
    """Catches an absolute threshold in the solver's own equations."""
    problem, state = trial(0), estimate(0)
    for root in (1e-15, 1e-9, 1e9, 1e15):
        f = problem.inertial
        other = replace(
            problem,
            sigma_px=problem.sigma_px * root,
            inertial=replace(f, covariance=f.covariance * root**2),
        )
        gauge = FreeGauge() if columns == "sigma" else FixedGauge()
        found = motion_covariance(other, state, gauge) / root**2
        assert relative_frobenius(found, motion_covariance(problem, state, gauge)) < 1e-9


# Far origins


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("gauge", GAUGES)
def test_the_estimate_does_not_depend_on_the_origin(place, gauge):
    """Catches a run that stops a centimetre early, as every step is short next to the Earth's radius."""
    problem, t_W = trial(0), np.array(PLACES[place])
    near = solve(problem, gauge)
    far = solve(problem.with_initial(problem.initial.transformed(0.0, t_W)), gauge)
    assert (far.iterations, far.status) == (near.iterations, near.status)
    # A position of that size has no more digits.
    digits = 10.0 * np.spacing(np.abs(t_W).max())
    assert np.abs(far.state.p_W - t_W - near.state.p_W).max() < digits
    assert np.abs(far.state.v_W - near.state.v_W).max() < digits


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("gauge", GAUGES)
def test_sigmas_do_not_depend_on_the_origin(place, gauge):
    """Catches a turn about a far origin, which is nearly a shift: 1e-4 of the free gauge."""
    problem, state, t_W = trial(0), estimate(0), np.array(PLACES[place])
    moved = state.transformed(0.0, t_W)
    far = problem.with_initial(problem.initial.transformed(0.0, t_W))
    expected = motion_covariance(problem, state, gauge)
    assert relative_frobenius(motion_covariance(far, moved, gauge), expected) < 1e-8
    taken, _ = transform_covariance(expected, moved, CentroidGauge(), far.initial)
    assert relative_frobenius(taken, motion_covariance(problem, state, CentroidGauge())) < 1e-7
    found = diagnose(far, moved)
    assert (found.expected, found.missing, found.degenerate) == (4, 0, False)


@pytest.mark.parametrize("place", PLACES)
def test_a_far_hessian_has_the_same_covariance(place):
    """Catches products of far columns, against pinv of the dense Jacobian."""
    problem, state, t_W = trial(0), estimate(0), np.array(PLACES[place])
    moved, n = state.transformed(0.0, t_W), 9 * state.n_keyframes
    far = problem.with_initial(problem.initial.transformed(0.0, t_W))
    root = np.linalg.pinv(dense_jacobian(problem, state), rcond=1e-11)
    expected = root @ root.T
    found = covariance_from_hessian(linearise(far, moved).dense(), orbit_tangent(moved))
    assert relative_frobenius(found, expected) < 3e-8
    covariance = Covariance.of(far, moved)
    assert relative_frobenius(motion_pseudo_inverse(covariance), expected[:n, :n]) < 3e-8
    assert relative_frobenius(covariance.motion(FreeGauge()), expected[:n, :n]) < 3e-8
