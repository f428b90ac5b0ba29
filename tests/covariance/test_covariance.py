"""Covariances against dense algebra, and the identities that join the gauges (Section VI)."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from support.dense import dense_jacobian
from support.derivatives import central_differences
from support.gauged import covariance_of, motion_pseudo_inverse, spectrum
from support.random_problem import random_problem
from support.simulated import estimate, scene, trial
from vigauge.covariance.covariance import motion_covariance
from vigauge.covariance.foreign import covariance_from_hessian
from vigauge.covariance.held_inverse import HeldInverse
from vigauge.covariance.projection import oblique_projector, project_covariance
from vigauge.covariance.transform import transform_covariance
from vigauge.errors import DataError, DegenerateError, SolverError
from vigauge.gauge.gauges import (
    CentroidGauge,
    FixedGauge,
    FreeGauge,
    KeyframeGauge,
    PriorGauge,
    first_pose_columns,
)
from vigauge.gauge.group import orbit_tangent
from vigauge.geometry import so3
from vigauge.model.evaluation import relative_frobenius
from vigauge.model.imu import ImuNoise, preintegrate
from vigauge.model.problem import InertialFactors
from vigauge.model.state import State
from vigauge.solver.normal_equations import linearise
from vigauge.synthetic.scenario import make_trial

CONFIGURATIONS = [(shape, points) for shape in ("sine", "arc", "rec") for points in ("plane", "random")]
FREE, FIXED = FreeGauge(), FixedGauge()


def at_minimum(shape="sine", points="random"):
    """Problem, free estimate, and H there."""
    problem, state = trial(0, shape, points), estimate(0, shape, points)
    return problem, state, linearise(problem, state)


def on_gauge(shape="sine", points="random"):
    """Problem, the minimum moved onto the gauge of Eq. (10), and H there."""
    problem, state, _ = at_minimum(shape, points)
    state, _ = FIXED.meet(state, problem.initial)
    return problem, state, linearise(problem, state)


def dense_pinv(H: np.ndarray, U: np.ndarray) -> np.ndarray:
    """The pseudo-inverse by the null space in closed form: (H + s N N^T)^-1 - N N^T / s."""
    N = np.linalg.qr(U)[0]
    s = float(np.median(np.diagonal(H)))
    scale = 1.0 / np.sqrt(np.diagonal(H))
    full = (H + s * N @ N.T) * scale[:, None] * scale
    inverse = np.linalg.inv(full)
    inverse = 2.0 * inverse - inverse @ full @ inverse  # a Newton step for the last digits
    return inverse * scale[:, None] * scale - N @ N.T / s


def dense_without(H: np.ndarray, held: np.ndarray) -> np.ndarray:
    """Inverse of H without the held columns; zero there."""
    keep = np.setdiff1d(np.arange(len(H)), held)
    scale = 1.0 / np.sqrt(np.diagonal(H)[keep])
    out = np.zeros_like(H)
    out[np.ix_(keep, keep)] = np.linalg.inv(H[np.ix_(keep, keep)] * scale[:, None] * scale) * np.outer(
        scale, scale
    )
    return out


# The free gauge


@pytest.mark.parametrize(("shape", "points"), CONFIGURATIONS)
def test_free_covariance_is_the_pseudo_inverse(shape, points, record_property):
    """Catches a motion block that is the pseudo-inverse of the reduced H instead of the block of the
    pseudo-inverse of H: the landmarks' four columns are in between."""
    problem, state, equations = at_minimum(shape, points)
    H, n = equations.dense(), 9 * state.n_keyframes
    free = covariance_of(equations, state, FREE, state)
    closed_form = dense_pinv(H, orbit_tangent(state))[:n, :n]
    record_property("closed_form", relative_frobenius(free, closed_form))
    # Two ways that share no inverse: one holds the first pose, one nothing.
    assert relative_frobenius(motion_pseudo_inverse(equations, state), free) < 1e-10
    assert relative_frobenius(free, closed_form) < 1e-10
    # By singular values of J, not of H: those of H are the squares, and lose half of the digits.
    root = np.linalg.pinv(dense_jacobian(problem, state), rcond=1e-11)[:n]
    record_property("pinv", relative_frobenius(free, root @ root.T))
    assert relative_frobenius(free, root @ root.T) < 1e-10
    rough = np.linalg.pinv(H, rcond=1e-13, hermitian=True)[:n, :n]
    record_property("pinv_of_H", relative_frobenius(free, rough))
    assert relative_frobenius(free, rough) < 1e-7
    only_reduced = np.linalg.pinv(equations.eliminate().matrix, rcond=1e-12, hermitian=True)
    assert relative_frobenius(free, only_reduced) > 1e-3


def test_penrose_conditions():
    """Catches an inverse that is only a generalised one: all four conditions of the pseudo-inverse."""
    _, state, equations = at_minimum("arc", "plane")
    H = equations.dense()
    P = covariance_from_hessian(H, orbit_tangent(state))
    assert relative_frobenius(H @ P @ H, H) < 1e-9
    assert relative_frobenius(P @ H @ P, P) < 1e-9
    # Symmetry of H P in scaled units: its entries mix m, rad and px.
    N = np.linalg.qr(orbit_tangent(state))[0]
    assert np.abs(P @ N).max() < 1e-12 * np.abs(P).max()
    assert np.array_equal(P, P.T)


@pytest.mark.parametrize("gauge", [FREE, FIXED, PriorGauge(1e3), CentroidGauge(), KeyframeGauge(index=4)])
def test_covariances_are_symmetric_and_positive(gauge):
    """Catches a difference of large matrices that loses positive semidefiniteness."""
    problem, state, _ = at_minimum()
    covariance = motion_covariance(problem, state, gauge)
    assert covariance.shape == (9 * state.n_keyframes,) * 2
    assert relative_frobenius(covariance, covariance.T) < 1e-14
    eigenvalues = np.linalg.eigvalsh(covariance)
    assert eigenvalues[0] > -1e-12 * eigenvalues[-1]


# The other gauges


@pytest.mark.parametrize(("shape", "points"), CONFIGURATIONS)
def test_fixed_covariance_is_the_reduced_inverse(shape, points):
    """Catches columns dropped from the wrong matrix: against the dense inverse without four columns."""
    problem, state, equations = at_minimum(shape, points)
    n, held = 9 * state.n_keyframes, FIXED.held(state)
    fixed = motion_covariance(problem, state, FIXED)
    assert relative_frobenius(fixed, dense_without(equations.dense(), held)[:n, :n]) < 1e-10
    assert not np.any(fixed[held])


@pytest.mark.parametrize("weight", [1e0, 1e5, 1e8])
def test_prior_covariance_is_the_inverse_with_the_prior(weight):
    """Catches a prior with the wrong weight in H."""
    problem, state, equations = at_minimum()
    H, n = equations.dense(), 9 * state.n_keyframes
    H[FIXED.held(state), FIXED.held(state)] += weight
    expected = dense_without(H, np.empty(0, dtype=int))[:n, :n]
    # The dense inverse loses the digits by which a weak prior's freedom exceeds the shape.
    found = motion_covariance(problem, state, PriorGauge(weight))
    assert relative_frobenius(found, expected) < 1e-10 * max(1.0, 1e4 / weight)


@pytest.mark.parametrize("gauge", [CentroidGauge(), KeyframeGauge(index=3), KeyframeGauge(index=0)])
def test_any_gauge_is_the_dense_projection(gauge):
    """Catches the landmarks' share missing in the four-column correction."""
    _, state, equations = at_minimum("rec")
    H, U, n = equations.dense(), orbit_tangent(state), 9 * state.n_keyframes
    Q = oblique_projector(U, gauge.normal(state))
    expected = (Q @ dense_pinv(H, U) @ Q.T)[:n, :n]
    assert relative_frobenius(covariance_of(equations, state, gauge, state), expected) < 1e-9
    constrained = gauge.normal(state)[:n].T @ covariance_of(equations, state, gauge, state)
    assert np.abs(constrained).max() < 1e-12 * np.abs(expected).max()


@pytest.mark.parametrize("gauge", [FREE, CentroidGauge(), FIXED])
def test_projection_without_forming_the_projector(gauge):
    """Catches an error of the rank-8 form: equal to the dense Q cov Q^T of Eq. (14)."""
    rng = np.random.default_rng(8)
    state = random_problem(0).initial
    root = rng.normal(size=(state.n_parameters,) * 2)
    covariance = root @ root.T
    U, V = orbit_tangent(state), gauge.normal(state)
    Q = oblique_projector(U, V)
    assert relative_frobenius(project_covariance(covariance, U, V), Q @ covariance @ Q.T) < 1e-12


# The transformation (12)


@pytest.mark.parametrize(("shape", "points"), CONFIGURATIONS)
def test_transformed_free_covariance_is_the_fixed_one(shape, points, record_property):
    """Catches (12) taken for an approximation: at one linearisation point it is an identity (I1)."""
    problem, state, equations = on_gauge(shape, points)
    free = covariance_of(equations, state, FREE, state)
    fixed = covariance_of(equations, state, FIXED, state)
    transformed, moved = transform_covariance(free, state, FIXED, problem.initial)
    record_property("same_point", relative_frobenius(transformed, fixed))
    assert relative_frobenius(transformed, fixed) < 1e-9
    assert np.allclose(moved.p_W, state.p_W, rtol=0, atol=1e-13)
    assert relative_frobenius(free, fixed) > 0.1  # they did differ


@pytest.mark.parametrize(("shape", "points"), CONFIGURATIONS)
def test_transformation_may_start_anywhere_on_the_orbit(shape, points, record_property):
    """Catches a wrong d(theta_C)/d(theta): from far along the orbit to the same fixed covariance."""
    problem, state, _ = at_minimum(shape, points)
    far = state.transformed(1.1, np.array([3.0, -2.0, 1.0]))
    free = motion_covariance(problem, far, FREE)
    transformed, moved = transform_covariance(free, far, FIXED, problem.initial)
    fixed = motion_covariance(problem, moved, FIXED)
    record_property("pushed", relative_frobenius(transformed, fixed))
    assert relative_frobenius(transformed, fixed) < 1e-9


def test_transformation_by_its_definition():
    """Catches any operator of Appendix A: Q and d(theta_C)/d(theta) by differences of g itself, with
    dphi_0 away from zero, against the blocks of the code."""
    problem = random_problem(6)
    state = problem.initial
    reference = State.start(state.p_W + 1.0, state.R_WB, state.v_W, state.X_W)
    root = 0.1 * np.random.default_rng(2).normal(size=(state.n_parameters,) * 2)
    covariance = root @ root.T
    moved, yaw = FIXED.meet(state, reference)
    t_W = moved.p_W[0] - so3.yaw_rotation(yaw) @ state.p_W[0]
    assert abs(yaw) > 0.1

    def push(delta):
        return moved.local(state.retract(delta).transformed(yaw, t_W))

    def along(d):
        return moved.local(moved.transformed(d[0], d[1:]))

    def constraint(delta):
        there = moved.retract(delta)
        return np.append(there.p_W[0], there.dphi_0[2])

    D = central_differences(push, state.n_parameters)
    U, V = central_differences(along, 4), central_differences(constraint, state.n_parameters).T
    T = oblique_projector(U, V) @ D
    transformed, theta_C = transform_covariance(covariance, state, FIXED, reference)
    assert relative_frobenius(transformed, T @ covariance @ T.T) < 1e-9
    assert np.array_equal(theta_C.p_W, moved.p_W)


def test_landmarks_do_not_change_the_motion_block():
    """Catches a transformation of the motion block that needs the landmarks."""
    problem, state, equations = at_minimum("arc")
    n = 9 * state.n_keyframes
    full = covariance_from_hessian(equations.dense(), orbit_tangent(state))
    with_landmarks, _ = transform_covariance(full, state, FIXED, problem.initial)
    motion, moved = transform_covariance(full[:n, :n], state, FIXED, problem.initial)
    assert relative_frobenius(with_landmarks[:n, :n], motion) < 1e-10
    expected = dense_without(linearise(problem, moved).dense(), FIXED.held(moved))
    assert relative_frobenius(with_landmarks, expected) < 1e-9


@pytest.mark.parametrize("weight", [1e0, 1e2, 1e5, 1e8, 1e12, 1e16])
def test_transformed_prior_covariance_is_the_fixed_one(weight):
    """Catches information that leaks from the prior: for any weight it says nothing of the shape (I2)."""
    problem, state, equations = on_gauge("sine", "plane")
    prior = covariance_of(equations, state, PriorGauge(weight), state)
    fixed = covariance_of(equations, state, FIXED, state)
    transformed, _ = transform_covariance(prior, state, FIXED, problem.initial)
    # A weak prior leaves variances of 1/w, of which the transformation takes all but the shape.
    assert relative_frobenius(transformed, fixed) < 1e-9 * max(1.0, 1e3 / weight)


@pytest.mark.parametrize("weight", [1e2, 1e5, 1e8])
def test_prior_covariance_is_the_inverse_of_the_augmented_hessian(weight):
    """Catches a wrong share of the prior along the orbit: here it is simply added to a dense H."""
    problem, state, equations = on_gauge()
    prior = PriorGauge(weight).prior(state, problem.initial)
    H = equations.with_factor(prior).dense()
    scale = 1.0 / np.sqrt(np.diagonal(H))
    inverse = np.linalg.inv(H * scale[:, None] * scale) * scale[:, None] * scale
    n = 9 * state.n_keyframes
    ours = covariance_of(equations, state, PriorGauge(weight), problem.initial)
    assert relative_frobenius(ours, inverse[:n, :n]) < 1e-6


def test_a_prior_without_weight_has_no_covariance():
    """Catches a bare linear algebra error, or infinities, where the prior leaves the gauge free."""
    problem, state, _ = on_gauge()
    with pytest.raises(DegenerateError, match="leave part of the gauge free"):
        motion_covariance(problem, state, PriorGauge(0.0))


def test_prior_covariance_differs_by_the_weight():
    """Catches a prior that is not (11): its covariance is the fixed one plus T T^T / w, with T the
    orbit's tangent in units of the gauge (I3)."""
    problem, state, equations = on_gauge()
    n = 9 * state.n_keyframes
    U, V = orbit_tangent(state), FIXED.normal(state)
    T = (U @ np.linalg.inv(V.T @ U))[:n]
    fixed = covariance_of(equations, state, FIXED, state)
    distance = []
    for weight in (1e0, 1e2, 1e5, 1e8):
        prior = covariance_of(equations, state, PriorGauge(weight), state)
        assert relative_frobenius(prior, fixed + T @ T.T / weight) < 1e-7
        distance.append(relative_frobenius(prior, fixed))
    assert np.allclose(np.array(distance) / distance[0], [1.0, 1e-2, 1e-5, 1e-8], rtol=1e-2)


def test_damped_inverse_is_repaired_by_the_projection():
    """Catches a damped H taken for the free gauge: its inverse grows as 1/lambda along the orbit, and
    the projection brings it back (I4)."""
    _, state, equations = on_gauge()
    H, U, V = equations.dense(), orbit_tangent(state), FIXED.normal(state)
    fixed = dense_without(H, FIXED.held(state))
    traces, errors = [], []
    for factor in (1e-8, 1e-10):
        damped = dense_without(H + factor * np.diag(np.diagonal(H)), np.empty(0, dtype=int))
        damped = 0.5 * (damped + damped.T)
        traces.append(np.trace(damped) - np.trace(fixed))
        errors.append(relative_frobenius(project_covariance(damped, U, V), fixed))
    assert traces[1] == pytest.approx(100.0 * traces[0], rel=0.05)
    assert traces[1] > 10.0 * np.trace(fixed)
    assert errors[0] < 1e-2
    assert errors[1] == pytest.approx(errors[0] / 100.0, rel=0.05)


def test_free_gauge_has_the_smallest_trace():
    """Catches a free covariance that is not the inner-constraint one: no gauge has less variance in
    sum over all parameters, in these units (I5)."""
    _, state, equations = at_minimum()
    H, U = equations.dense(), orbit_tangent(state)
    free = covariance_from_hessian(H, U)
    rng = np.random.default_rng(0)
    for _ in range(40):
        V = rng.normal(size=U.shape) + rng.normal(0.0, 3.0) * U
        assert np.trace(project_covariance(free, U, V)) >= np.trace(free)
    for gauge in (FIXED, CentroidGauge(), KeyframeGauge(index=5)):
        assert np.trace(project_covariance(free, U, gauge.normal(state))) > np.trace(free)


def test_units_change_the_free_covariance_only():
    """Catches units that leak into a geometric gauge: metres to centimetres changes what the
    pseudo-inverse says after it is changed back; the transformed covariance stays (I6)."""
    _, state, equations = on_gauge()
    H, U, V = equations.dense(), orbit_tangent(state), FIXED.normal(state)
    units = np.ones(state.n_parameters)
    units[: 3 * state.n_keyframes] = 100.0  # positions in centimetres
    H_cm, U_cm, V_cm = H / units[:, None] / units, U * units[:, None], V / units[:, None]
    back = covariance_from_hessian(H_cm, U_cm) / units[:, None] / units
    assert relative_frobenius(back, covariance_from_hessian(H, U)) > 0.01
    fixed = covariance_from_hessian(H, U, V)
    fixed_back = covariance_from_hessian(H_cm, U_cm, V_cm) / units[:, None] / units
    assert relative_frobenius(fixed_back, fixed) < 1e-9


def test_normalised_error_is_the_same_in_every_gauge():
    """Catches a gauge that loses or makes up information: e^T H e and e^T pinv(cov) e agree (I7)."""
    problem, state, equations = on_gauge()
    H, U = equations.dense(), orbit_tangent(state)
    e = np.random.default_rng(3).multivariate_normal(
        np.zeros(len(H)), covariance_from_hessian(H, U), method="eigh"
    )
    before = e @ H @ e
    for gauge in (FIXED, CentroidGauge(), KeyframeGauge(index=2)):
        projected = oblique_projector(U, gauge.normal(state)) @ e
        assert projected @ H @ projected == pytest.approx(before, rel=1e-9)
    keep = np.setdiff1d(np.arange(len(H)), FIXED.held(state))
    fixed = covariance_from_hessian(H, U, FIXED.normal(state))[np.ix_(keep, keep)]
    held_out = (oblique_projector(U, FIXED.normal(state)) @ e)[keep]
    scale = 1.0 / np.sqrt(np.diagonal(fixed))
    weighted = np.linalg.solve(fixed * scale[:, None] * scale, held_out * scale)
    assert (held_out * scale) @ weighted == pytest.approx(before, rel=1e-6)


@settings(max_examples=15)
@given(
    st.lists(
        st.sampled_from([FREE, FIXED, CentroidGauge(), KeyframeGauge(index=2), KeyframeGauge(index=9)]),
        min_size=1,
        max_size=4,
    ),
    st.sampled_from([FIXED, CentroidGauge(), KeyframeGauge(index=7), FREE]),
)
def test_gauges_chain_by_any_path(path, goal):
    """Catches information lost on the way: through any gauges to the same covariance as directly."""
    problem, state, equations = on_gauge("arc", "plane")
    start = covariance_from_hessian(equations.dense(), orbit_tangent(state))
    covariance, here = start, state
    for gauge in [*path, goal]:
        covariance, here = transform_covariance(covariance, here, gauge, problem.initial)
    direct, _ = transform_covariance(start, state, goal, problem.initial)
    assert relative_frobenius(covariance, direct) < 1e-9


# Any estimator's H


def monocular_like(rng: np.random.Generator, size: int = 40, null: int = 7):
    """A random information matrix with a given null space, of very uneven scale."""
    scale = 10.0 ** rng.uniform(-2.0, 2.0, size)
    U = rng.normal(size=(size, null))
    J = rng.normal(size=(3 * size, size))
    J -= J @ U @ np.linalg.pinv(U)
    H = J.T @ J
    return H / scale[:, None] / scale, U * scale[:, None]


@pytest.mark.parametrize("null", [1, 4, 7])
def test_covariance_from_any_hessian(null):
    """Catches the number four written into the algebra: also for one or seven null directions."""
    H, U = monocular_like(np.random.default_rng(null), null=null)
    assert relative_frobenius(covariance_from_hessian(H, U), np.linalg.pinv(H, 1e-12, hermitian=True)) < 1e-8
    held = np.arange(null)
    V = np.eye(len(H))[:, held]
    assert relative_frobenius(covariance_from_hessian(H, U, V), dense_without(H, held)) < 1e-8


def test_hessians_that_do_not_fit_are_refused():
    """Catches a covariance made up for directions that carry information, or that carry none."""
    H, U = monocular_like(np.random.default_rng(0), null=4)
    with pytest.raises(DataError, match="null space"):
        covariance_from_hessian(H, np.random.default_rng(1).normal(size=U.shape))
    with pytest.raises(DataError, match="diagonal"):
        covariance_from_hessian(np.diag([1.0, 0.0, 2.0]), np.zeros((3, 1)))


@pytest.mark.parametrize("seed", range(8))
def test_a_further_null_direction_is_refused(seed):
    """Catches a covariance of rounding errors: H has five null directions and only four are named."""
    H, U = monocular_like(np.random.default_rng(seed), null=5)
    with pytest.raises(DegenerateError):
        covariance_from_hessian(H, U[:, :4])


def uniform_motion():
    """A camera in straight uniform flight: scale cannot be seen, a fifth unobservable direction."""
    world = scene("sine", "random")
    n = len(world.keyframe_ns)
    t = world.keyframe_ns * 1e-9
    v_W = np.array([1.5, 0.4, 0.1])
    truth = State.start(
        t[:, None] * v_W, np.tile(world.truth.R_WB[0], (n, 1, 1)), np.tile(v_W, (n, 1)), world.truth.X_W
    )
    samples = replace(
        world.imu,
        gyro=np.zeros_like(world.imu.gyro),
        accel=np.tile(truth.R_WB[0].T @ [0.0, 0.0, 9.81], (len(world.imu.t_ns), 1)),
    )
    noise = ImuNoise(1e-3, 1e-2)
    ends = zip(world.keyframe_ns[:-1], world.keyframe_ns[1:], strict=True)
    factors = InertialFactors.chain([preintegrate(samples, int(a), int(b), noise) for a, b in ends])
    return replace(make_trial(world, 0), initial=truth, inertial=factors), truth


def test_degenerate_motion_is_found_and_refused():
    """Catches a covariance printed for a problem whose scale is unobservable: five null directions."""
    problem, state = uniform_motion()
    found = spectrum(linearise(problem, state))
    assert found.nullity == 5
    for gauge in (FREE, FIXED, CentroidGauge()):
        with pytest.raises(DegenerateError):
            motion_covariance(problem, state, gauge)


def test_a_landmark_of_one_view_is_refused():
    """Catches a covariance with a landmark whose depth no view measures."""
    problem, state, _ = at_minimum()
    rows = (problem.obs_landmark != 5) | (np.cumsum(problem.obs_landmark == 5) == 1)
    problem = replace(
        problem,
        **{
            f"obs_{name}": getattr(problem, f"obs_{name}")[rows]
            for name in ("keyframe", "camera", "landmark", "uv")
        },
    )
    for gauge in (FREE, FIXED):
        with pytest.raises(SolverError, match="landmark"):
            motion_covariance(problem, state, gauge)


def test_transformation_refuses_what_does_not_fit():
    """Catches a matrix of another problem, and a motion block where landmarks are constrained."""
    problem, state, _ = at_minimum()
    with pytest.raises(DataError, match="shape"):
        transform_covariance(np.eye(12), state, FIXED, problem.initial)
    with pytest.raises(DataError, match="landmarks"):
        transform_covariance(np.eye(9 * state.n_keyframes), state, FREE, problem.initial)


def test_transformation_refuses_what_is_not_symmetric():
    """Catches a triangle of a covariance taken for all of it, and a NaN carried through."""
    problem, state, equations = at_minimum()
    covariance = covariance_of(equations, state, FREE, problem.initial)
    with pytest.raises(DataError, match="covariance, row 0, column 3: must be symmetric"):
        transform_covariance(np.tril(covariance), state, FIXED, problem.initial)
    covariance[3, 3] = np.nan
    with pytest.raises(DataError, match="covariance, row 3, column 3: must be finite"):
        transform_covariance(covariance, state, FIXED, problem.initial)


@pytest.mark.parametrize("length", [np.pi - 1e-6, np.pi, np.pi + 1e-6, np.pi + 0.5, 6.0])
def test_the_first_increment_may_be_about_pi(length):
    """Catches a series, a logarithm or a branch that fails where the paper's Eq. (9) warns of
    (|dphi_0| < pi): the parametrisation itself holds up to 2 pi."""
    problem, state, _ = at_minimum()
    dphi_0 = length * np.array([0.48, -0.36, 0.8])
    state = replace(state, dphi_0=dphi_0, R_WB0_ref=so3.exp(-dphi_0) @ state.R_WB[0]).require_valid()
    equations = linearise(problem, state)
    covariance = covariance_of(equations, state, FREE, problem.initial)
    moved_covariance, moved = transform_covariance(covariance, state, FIXED, problem.initial)
    expected = covariance_of(linearise(problem, moved), moved, FIXED, problem.initial)
    assert relative_frobenius(moved_covariance, expected) < 1e-7


def test_an_increment_of_a_whole_turn_is_refused():
    """Catches a state at which the rotation has no derivative by its increment."""
    _, state, _ = at_minimum()
    dphi_0 = 2.0 * np.pi * np.array([0.0, 0.6, 0.8])
    state = replace(state, dphi_0=dphi_0, R_WB0_ref=so3.exp(-dphi_0) @ state.R_WB[0])
    with pytest.raises(DataError, match=r"dphi_0: must be shorter than 2 pi"):
        state.require_valid()


def test_an_inverse_that_is_given_away_may_be_written_to():
    """Catches the inverse that products and blocks come from handed out itself: the next gauge's covariance
    would be made of what the caller did to it."""
    problem = trial()
    state = estimate()
    reduced = linearise(problem, state).eliminate()
    inverse = HeldInverse.of(reduced, first_pose_columns(state))
    assert not problem.structure.layout.banded
    columns = problem.structure.columns
    expected = inverse.dense()
    inverse.dense()[:] = np.nan
    assert np.array_equal(inverse.dense(), expected)
    assert np.allclose(inverse.times(np.eye(len(expected))), expected, rtol=1e-12)
    assert np.array_equal(inverse.blocks(columns)[1], expected[np.ix_(columns[1], columns[1])])
