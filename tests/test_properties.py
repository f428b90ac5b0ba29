"""Small random problems, well and badly used: a number is that of a dense oracle, or an error in words.

What is damaged is drawn for every public function in turn; none of them may give NaN, a number for
input that has none, or an error of NumPy, LAPACK or compiled code.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import vigauge as vg
from support.damage import ARRAYS
from support.dense import dense_jacobian
from support.random_problem import random_problem
from vigauge.covariance.projection import oblique_projector

COUNT = 250  # of each of the four properties


@cache
def dense(seed: int, n_keyframes: int, n_landmarks: int):
    """A problem, H from the plain Jacobian, U, and the pseudo-inverse by singular values of J, not of H."""
    problem = random_problem(seed, n_keyframes, n_landmarks)
    J = dense_jacobian(problem, problem.initial)
    scale = np.linalg.norm(J, axis=0)
    U = vg.orbit_tangent(problem.initial)
    # Columns of one size first: then held columns, then the projection onto V = U.
    held = vg.FixedGauge().held(problem.initial)
    keep = np.setdiff1d(np.arange(J.shape[1]), held)
    half = np.linalg.pinv(J[:, keep] / scale[keep], rcond=1e-13) / scale[keep, None]
    fixed = np.zeros((J.shape[1],) * 2)
    fixed[np.ix_(keep, keep)] = half @ half.T
    return problem, J.T @ J, U, fixed


sizes = st.tuples(st.integers(0, 24), st.integers(2, 5), st.integers(6, 10))
gauges = st.sampled_from(
    [vg.FixedGauge(), vg.FreeGauge(), vg.KeyframeGauge(1), vg.CentroidGauge(), vg.PriorGauge(30.0)]
)


def expected(fixed: np.ndarray, U: np.ndarray, gauge: vg.Gauge, state: vg.State) -> np.ndarray:
    V = gauge.normal(state)
    Q = oblique_projector(U, V)
    out = Q @ fixed @ Q.T
    if isinstance(gauge, vg.PriorGauge):
        W = U @ np.linalg.inv(V.T @ U)
        out += W @ W.T / gauge.weight
    return out


def close(found: np.ndarray, wanted: np.ndarray) -> bool:
    scale = np.sqrt(np.maximum(np.diagonal(wanted), 1e-12 * np.diagonal(wanted).max()))
    return bool(np.abs((found - wanted) / scale[:, None] / scale).max() < 1e-5)


@settings(max_examples=COUNT, deadline=None)
@given(sizes, gauges)
def test_covariances_are_those_of_dense_algebra(size, gauge):
    """Catches a wrong block of any function, in any gauge, on any small problem."""
    problem, H, U, fixed = dense(*size)
    state, n = problem.initial, 9 * problem.initial.n_keyframes
    wanted = expected(fixed, U, gauge, state)
    assert close(vg.motion_covariance(problem, state, gauge), wanted[:n, :n])
    landmarks = vg.landmark_covariances(problem, state, gauge)
    for k, block in enumerate(landmarks):
        at = slice(n + 3 * k, n + 3 * k + 3)
        assert close(block, wanted[at, at])
    if not isinstance(gauge, vg.PriorGauge):
        V = gauge.normal(state)
        assert close(vg.covariance_from_hessian(H, U, V), wanted)
        assert close(vg.project_covariance(fixed, U, V, H=H), wanted)
    assert vg.diagnose_hessian(H, U).rank == len(H) - 4


def _uses(problem, H, U, fixed) -> dict[str, tuple[np.ndarray, Callable[[object], object]]]:
    """Of every public function that takes arrays: a right array, and the call that takes it."""
    s, V, gauge = problem.initial, vg.FixedGauge().normal(problem.initial), vg.FixedGauge()
    n = 9 * s.n_keyframes
    t, w = np.arange(50) * 5_000_000, np.ones((50, 3))
    uses: dict[str, tuple[np.ndarray, Callable[[object], object]]] = {
        "H": (H, lambda a: vg.covariance_from_hessian(a, U)),
        "U of H": (U, lambda a: vg.covariance_from_hessian(H, a)),
        "V of H": (V, lambda a: vg.covariance_from_hessian(H, U, a) if a is not None else _none()),
        "H to diagnose": (H, lambda a: vg.diagnose_hessian(a, U)),
        "U to diagnose": (U, lambda a: vg.diagnose_hessian(H, a)),
        "covariance": (fixed, lambda a: vg.project_covariance(a, U, V)),
        "U": (U, lambda a: vg.project_covariance(fixed, a, V)),
        "V": (V, lambda a: vg.project_covariance(fixed, U, a)),
        "motion": (fixed[:n, :n], lambda a: vg.transform_covariance(a, s, gauge, s)),
        "step": (np.zeros(s.n_parameters), s.retract),
        "shift": (np.zeros(3), lambda a: s.transformed(0.0, a)),
        "compared": (H, lambda a: vg.relative_frobenius(a, H)),
        "gyro": (w, lambda a: vg.preintegrate(vg.ImuSamples(t, a, w), 0, t[-1], vg.ImuNoise(1e-3, 1e-2))),
        "accel": (w, lambda a: vg.preintegrate(vg.ImuSamples(t, w, a), 0, t[-1], vg.ImuNoise(1e-3, 1e-2))),
        "pixels": (problem.obs_uv, lambda a: vg.motion_covariance(replace(problem, obs_uv=a), s, gauge)),
        "lever": (np.zeros(3), lambda a: replace(problem.cameras[0], p_BC=a)),
        "mounting": (np.eye(3), lambda a: replace(problem.cameras[0], R_BC=a)),
    }
    for name in ("p_W", "R_WB", "v_W", "X_W", "dphi_0", "R_WB0_ref"):
        uses |= {
            f"{name} {verb}": (
                getattr(s, name),
                lambda a, name=name, call=call: call(replace(s, **{name: a})),
            )
            for verb, call in (
                ("for a covariance", lambda moved: vg.motion_covariance(problem, moved, gauge)),
                ("to keyframes", lambda moved: vg.keyframe_covariances(problem, moved, gauge)),
                ("to landmarks", lambda moved: vg.landmark_covariances(problem, moved, gauge)),
                ("to diagnose", lambda moved: vg.diagnose(problem, moved)),
                ("against the truth", lambda moved: vg.trajectory_errors(moved, s)),
                ("of a problem", problem.with_initial),
            )
        }
    for name in ("dt", "dp", "dR", "dv", "covariance"):
        uses[name] = (
            getattr(problem.inertial, name),
            lambda a, name=name: vg.motion_covariance(
                replace(problem, inertial=replace(problem.inertial, **{name: a})), s, gauge
            ),
        )
    return uses


def _none() -> None:
    raise vg.DataError("V", "None asks for the pseudo-inverse, which is right")


NAMES = sorted(_uses(*dense(0, 2, 6)))


@settings(max_examples=3 * COUNT, deadline=None)
@given(sizes, st.sampled_from(NAMES), st.sampled_from(sorted(ARRAYS)), st.integers(0, 2**32 - 1))
def test_damaged_arrays_are_refused(size, name, damage, seed):
    """Catches NaN returned, entries dropped or read as numbers, and errors that are not the package's."""
    array, call = _uses(*dense(*size))[name]
    # A state with a landmark less is a state: it is the problem that it does not fit.
    if (name, damage) == ("X_W against the truth", "a row less"):
        return
    # A solver may start anywhere, and says where its cost is not finite.
    if name.endswith("of a problem") and damage == "overflow":
        return
    with pytest.raises(vg.VigaugeError):
        call(ARRAYS[damage](array, np.random.default_rng(seed)))


@pytest.mark.parametrize("name", NAMES)
def test_arrays_in_order_are_taken(name):
    """Catches a gate that refuses everything, with which the property above would hold too."""
    array, call = _uses(*dense(0, 2, 6))[name]
    call(array)
    call(np.asfortranarray(array))
    call(array.tolist())


bad_numbers = st.one_of(
    st.floats(max_value=0.0), st.sampled_from([np.nan, np.inf, True, "1", None, 1j, [1.0, 2.0]])
)


@settings(max_examples=COUNT, deadline=None)
@given(bad_numbers, st.sampled_from(["sigma", "factor", "prior", "focal", "width"]))
def test_weights_and_sigmas_must_be_positive_numbers(value, name):
    """Catches a weight of zero, a bool or a NaN that divides its way into a covariance."""
    problem = dense(0, 2, 6)[0]
    uses = {
        "sigma": lambda: replace(problem, sigma_px=value),
        "factor": lambda: problem.with_noise(1.0, value),
        # Weight 0 is no prior, so it is a number below it that must be refused.
        "prior": lambda: vg.PriorGauge(value if value != 0.0 or isinstance(value, bool) else -1.0),
        "focal": lambda: replace(problem.cameras[0], fx=value),
        "width": lambda: replace(problem.cameras[0], width=value),
    }
    with pytest.raises(vg.VigaugeError):
        uses[name]()


bad_indices = st.one_of(
    st.lists(st.floats(), min_size=1),
    st.lists(st.booleans(), min_size=1),
    st.lists(st.integers().filter(lambda k: not 0 <= k < 2), min_size=1),
    st.sampled_from(["0", [[0, 1]], [None], 1j, 0]),
)


@settings(max_examples=COUNT, deadline=None)
@given(bad_indices)
def test_indices_must_be_numbers_of_things_that_are_there(index):
    """Catches a mask taken for numbers, 1.9 taken for 1, and memory read past its end."""
    covariance = vg.Covariance.of(dense(0, 2, 6)[0], dense(0, 2, 6)[0].initial)
    with pytest.raises(vg.VigaugeError):
        covariance.keyframes(vg.FixedGauge(), index)
    with pytest.raises(vg.VigaugeError):
        covariance.joint(vg.FreeGauge(), index)
