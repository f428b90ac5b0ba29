"""Misuse of every public function: one error of the package's own that says what, where and the rule."""

# A table reads line by line.
# ruff: noqa: E501

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse

import vigauge as vg
from support.random_problem import random_problem, random_state
from vigauge import arrays
from vigauge.geometry import so3

PROBLEM = random_problem(0)
STATE = PROBLEM.initial
N = 9 * STATE.n_keyframes
COVARIANCE = vg.Covariance.of(PROBLEM, STATE)
H = COVARIANCE.equations.dense()
U = vg.orbit_tangent(STATE)
V = vg.FixedGauge().normal(STATE)
FREE = vg.covariance_from_hessian(H, U)
MOTION = COVARIANCE.motion(vg.FreeGauge())
FIX = vg.FixedGauge()
# U by right increments of all but the first rotation: what an estimator with body-frame increments has.
RIGHT = U.copy()
for i in range(1, STATE.n_keyframes):
    rows = slice(3 * STATE.n_keyframes + 3 * i, 3 * STATE.n_keyframes + 3 * i + 3)
    RIGHT[rows] = STATE.R_WB[i].T @ U[rows]
RNG = np.random.default_rng(0)
SAMPLES = vg.ImuSamples(np.arange(100) * 5_000_000, RNG.normal(size=(100, 3)), RNG.normal(size=(100, 3)))
NOISE = vg.ImuNoise(1e-3, 1e-2)
LARGER, SMALLER = random_state(RNG, 6, 9), random_state(RNG, 3, 5)
CAMERA = PROBLEM.cameras[0]


def put(array, at, value):
    out = np.array(array)
    out[at] = value
    return out


def again(**fields):
    """The problem with its first observation repeated, so changed."""
    rows = np.r_[0, : len(PROBLEM.obs_uv)]
    names = ("obs_keyframe", "obs_camera", "obs_landmark", "obs_uv")
    return replace(PROBLEM, **{name: getattr(PROBLEM, name)[rows] for name in names} | fields)


def samples(t_ns):
    return vg.ImuSamples(t_ns, SAMPLES.gyro[: len(t_ns)], SAMPLES.accel[: len(t_ns)])


def integrate(start, end, t_ns=SAMPLES.t_ns, **options):
    return vg.preintegrate(samples(t_ns), start, end, NOISE, **options)


project, foreign = vg.project_covariance, vg.covariance_from_hessian
GAP = SAMPLES.t_ns + np.where(np.arange(100) > 50, 100_000_000, 0)

# Words of the input, the call, and what the message must say.
CASES = [
    ("a triangle of a covariance projected", lambda: project(np.tril(FREE), U, V), r"covariance, row \d+, column \d+: must be symmetric"),
    ("an upper triangle of a covariance transformed", lambda: vg.transform_covariance(np.triu(MOTION), STATE, FIX, STATE), "covariance.*symmetric"),
    ("a triangle of a small block beside a large one", lambda: project(np.diag([1e-6, 1e-6, 1e6]) + 1e-7 * np.eye(3, k=1), np.ones((3, 1)), np.ones((3, 1))), "row 0, column 1: must be symmetric"),
    ("NaN in a covariance", lambda: project(put(FREE, (2, 5), np.nan), U, V), "covariance, row 2, column 5: must be finite"),
    ("infinity in U", lambda: project(FREE, put(U, (4, 1), np.inf), V), "U, row 4, column 1: must be finite"),
    ("NaN in V", lambda: project(FREE, U, put(V, (0, 3), np.nan)), "V, row 0, column 3: must be finite"),
    ("a negative variance", lambda: project(put(FREE, (3, 3), -1.0), U, V), "covariance, row 3: must have a diagonal"),
    ("an information matrix projected, H given", lambda: project(H, U, V, H=H), "covariance.*is it the information matrix"),
    ("an information matrix transformed", lambda: vg.transform_covariance(H[:N, :N], STATE, FIX, STATE), "is it an information matrix"),
    ("twice the covariance, H given", lambda: project(2.0 * FREE, U, V, H=H), "H cov H must be H"),
    ("U of right increments projected, H given", lambda: project(FREE, RIGHT, V, H=H), "U, column 0: must be in the null space of H; are both by the same increments"),
    ("U of right increments with an information matrix", lambda: foreign(H, RIGHT), "U: columns must be in the null space of H"),
    ("U of another state projected, H given", lambda: project(FREE, put(U, (0, 0), 9.0), V, H=H), "U, column 0"),
    ("NaN in the upper triangle of H", lambda: foreign(put(H, (1, 7), np.nan), U), "H, row 1, column 7: must be finite"),
    ("infinity in the upper triangle of H to diagnose", lambda: vg.diagnose_hessian(put(H, (1, 7), np.inf), U), "H, row 1, column 7: must be finite"),
    ("NaN in U of an information matrix", lambda: foreign(H, put(U, (5, 2), np.nan)), "U, row 5, column 2: must be finite"),
    ("a number in H whose square overflows", lambda: foreign(put(put(H, (1, 7), 1e200), (7, 1), 1e200), U), r"H, row 1, column 7: must be below 1e\+100"),
    ("information of a parameter that rounds to none", lambda: foreign(np.diag([1e-320, 1.0]), np.zeros((2, 0))), "H, row 0: diagonal must be positive"),
    ("no landmarks, as complex numbers", lambda: COVARIANCE.landmarks(FIX, np.zeros(0, complex)), "landmarks: must be integers"),
    ("a triangle of an information matrix", lambda: foreign(np.triu(H), U), "H, row .*: must be symmetric"),
    ("V with three columns for an information matrix", lambda: foreign(H, U, V[:, :3]), r"V: must have shape \(\d+, 4\)"),
    ("V with three columns projected", lambda: project(FREE, U, V[:, :3]), "V: must have shape"),
    ("V with fewer rows", lambda: project(FREE, U, V[:-1]), "V: must have shape"),
    ("V that names one row twice", lambda: project(FREE, U, V[:, [0, 1, 2, 2]]), "V, condition: columns must be independent"),
    ("a column of U outside the null space", lambda: foreign(H, np.column_stack([U[:, :3], np.ones(len(U))])), "U: columns must be in the null space of H"),
    ("a flat H", lambda: foreign(H.ravel(), U), r"H: must have shape \(n, n\)"),
    ("H of complex numbers", lambda: foreign(H + 0j, U), "H: must hold real numbers"),
    ("H of objects", lambda: foreign(H.astype(object), U), "H: must hold real numbers"),
    ("H of booleans", lambda: foreign(H > 0, U), "H: must hold real numbers"),
    ("H of 32-bit floats", lambda: foreign(H.astype(np.float32), U), "H: must be 64-bit floats"),
    ("a masked H", lambda: foreign(np.ma.masked_less(H, 0.0), U), "H: must not be masked"),
    ("ragged lists for H", lambda: foreign([[1.0], [1.0, 2.0]], U), "H: must be an array"),
    ("None for U", lambda: foreign(H, None), "U: must hold real numbers"),
    ("blocks by a mask", lambda: vg.diagnose_hessian(H, U, {"p": np.zeros(len(H), dtype=bool)}), "blocks, p: must be integers; a mask"),
    ("blocks beyond H", lambda: vg.diagnose_hessian(H, U, {"p": [len(H)]}), "blocks, row 0, p: must lie in"),
    ("a larger state than the problem's", lambda: vg.motion_covariance(PROBLEM, LARGER, FIX), "state: must have 4 keyframes and 7 landmarks"),
    ("a smaller state to diagnose", lambda: vg.diagnose(PROBLEM, SMALLER), "state: must have 4 keyframes"),
    ("a state without one landmark", lambda: vg.landmark_covariances(PROBLEM, replace(STATE, X_W=STATE.X_W[1:]), FIX), "state: must have 4 keyframes and 7 landmarks"),
    ("NaN in the state", lambda: vg.motion_covariance(PROBLEM, replace(STATE, p_W=put(STATE.p_W, (2, 1), np.nan)), FIX), "state, row 2, p_W: must be finite"),
    ("infinity in a landmark", lambda: vg.orbit_tangent(replace(STATE, X_W=put(STATE.X_W, (3, 0), np.inf))), "state, row 3, X_W: must be finite"),
    ("a rotation scaled by 1.01", lambda: vg.diagnose(PROBLEM, replace(STATE, R_WB=STATE.R_WB * 1.01)), "R_WB: must be a rotation"),
    ("keyframes by a mask", lambda: COVARIANCE.keyframes(FIX, [True, False, True, True]), "keyframes: must be integers; a mask"),
    ("keyframe 1.9", lambda: COVARIANCE.keyframes(FIX, [1.9]), "keyframes: must be integers"),
    ("keyframe -1", lambda: COVARIANCE.joint(FIX, [-1]), "keyframes, row 0: must lie in 0..3"),
    ("keyframes as a table", lambda: COVARIANCE.joint(FIX, [[0, 1]]), r"keyframes: must have shape \(m,\)"),
    ("landmarks by a mask", lambda: COVARIANCE.landmarks(FIX, np.ones(7, dtype=bool)), "landmarks: must be integers; a mask"),
    ("the keyframe of a gauge is 1.9", lambda: vg.KeyframeGauge(1.9), "gauge 'keyframe', index: must be an integer"),
    ("a prior of weight -1", lambda: vg.PriorGauge(-1.0), "gauge 'prior', weight: must be at least 0"),
    ("a prior of weight infinity", lambda: vg.PriorGauge(np.inf), "weight: must be a finite number"),
    ("a prior of weight NaN", lambda: vg.PriorGauge(np.nan), "weight: must be a finite number"),
    ("states of different sizes compared", lambda: STATE.local(LARGER), "state: must have 4 keyframes"),
    ("an increment of another length", lambda: STATE.retract(np.zeros(N + 3)), "increment: must have shape"),
    ("NaN in an increment", lambda: STATE.retract(np.full(STATE.n_parameters, np.nan)), "increment, row 0: must be finite"),
    ("a shift with two parts", lambda: STATE.transformed(0.1, np.zeros(2)), r"t_W: must have shape \(3,\)"),
    ("a turn by NaN", lambda: STATE.transformed(np.nan, np.zeros(3)), "yaw: must be a finite number"),
    ("seven numbers for a rigid motion", lambda: vg.Euclidean().act(STATE, np.zeros(7)), r"parameters: must have shape \(6,\)"),
    ("an observation twice", lambda: again(), r"obs_uv: .* once only.*landmark 0, keyframe 0, camera 0"),
    ("an observation twice, with other pixels", lambda: again(obs_uv=np.r_[PROBLEM.obs_uv[:1] + 3.0, PROBLEM.obs_uv]), "once only"),
    ("an observation twice, far apart in the lists", lambda: vg.Problem.from_observations(STATE, PROBLEM.cameras, np.r_[PROBLEM.obs_keyframe, 0], np.r_[PROBLEM.obs_camera, PROBLEM.obs_camera[0]], np.r_[PROBLEM.obs_landmark, 0], np.r_[PROBLEM.obs_uv, [[1.0, 2.0]]], 1.0, PROBLEM.inertial, 9.81), "once only"),
    ("lists of observations of different lengths", lambda: vg.Problem.from_observations(STATE, PROBLEM.cameras, PROBLEM.obs_keyframe[1:], PROBLEM.obs_camera, PROBLEM.obs_landmark, PROBLEM.obs_uv, 1.0, PROBLEM.inertial, 9.81), "obs_keyframe: must have shape"),
    ("keyframes of observations by a mask", lambda: replace(PROBLEM, obs_keyframe=PROBLEM.obs_keyframe > 0), "obs_keyframe: must be integers; a mask"),
    ("keyframes of observations as floats", lambda: replace(PROBLEM, obs_keyframe=PROBLEM.obs_keyframe + 0.5), "obs_keyframe: must be integers"),
    ("pixels as complex numbers", lambda: replace(PROBLEM, obs_uv=PROBLEM.obs_uv + 0j), "obs_uv: must hold real"),
    ("pixels with sigma 0", lambda: replace(PROBLEM, sigma_px=0.0), "sigma_px: must be positive"),
    ("pixels with sigma -1", lambda: PROBLEM.with_noise(-1.0, 1.0), "sigma_px: must be positive"),
    ("pixels with sigma True", lambda: replace(PROBLEM, sigma_px=True), "sigma_px: must be a finite number"),
    ("a factor of -1 on densities", lambda: PROBLEM.with_noise(1.0, -1.0), "density_factor: must be positive"),
    ("gravity of -9.81", lambda: replace(PROBLEM, gravity=-9.81), "gravity: must not be negative"),
    ("an inertial rotation that is none", lambda: replace(PROBLEM.inertial, dR=PROBLEM.inertial.dR * 1.01), "dR: must be a rotation"),
    ("a triangle of an inertial covariance", lambda: replace(PROBLEM.inertial, covariance=np.tril(PROBLEM.inertial.covariance)), "covariance: must be symmetric"),
    ("keyframes with one stamp", lambda: replace(PROBLEM.inertial, dt=put(PROBLEM.inertial.dt, 1, 0.0)), "inertial factors, row 1, dt: must be positive"),
    ("inertial stamps in seconds", lambda: samples(SAMPLES.t_ns * 1e-9), "imu, timestamp: must be integer nanoseconds"),
    ("inertial stamps in microseconds", lambda: integrate(0, 100_000, SAMPLES.t_ns // 1000), "timestamp: must be nanoseconds"),
    ("an interval in seconds", lambda: integrate(0.0, 0.1), "t_start_ns: must be an integer"),
    ("a gap between inertial samples", lambda: integrate(0, 400_000_000, GAP), "imu, row 50, timestamp: gap between samples"),
    ("a dropped sample where none may be", lambda: integrate(0, 400_000_000, np.delete(SAMPLES.t_ns, 9), largest_gap_s=0.006), "row 8, timestamp: gap"),
    ("two inertial stamps swapped", lambda: samples(SAMPLES.t_ns[put(np.arange(100), [7, 8], [8, 7])]), "imu, row 8, timestamp: must increase strictly"),
    ("an inertial stamp twice", lambda: samples(put(SAMPLES.t_ns, 7, SAMPLES.t_ns[6])), "imu, row 7, timestamp: must increase strictly"),
    ("inertial samples backwards", lambda: samples(SAMPLES.t_ns[::-1]), "timestamp: must increase strictly"),
    ("an interval from its end to its start", lambda: integrate(200_000_000, 100_000_000), "positive length"),
    ("NaN in a rate", lambda: replace(SAMPLES, gyro=put(SAMPLES.gyro, (4, 1), np.nan)), "imu, row 4, gyro: must be finite"),
    ("fewer forces than stamps", lambda: replace(SAMPLES, accel=SAMPLES.accel[1:]), "accel: must have shape"),
    ("a bias with two parts", lambda: SAMPLES.corrected(np.zeros(2), np.zeros(3)), "gyro_bias: must have shape"),
    ("a negative noise density", lambda: vg.ImuNoise(-1e-3, 1e-2), "gyro_density: must not be negative"),
    ("a noise density of NaN", lambda: vg.ImuNoise(1e-3, np.nan), "accel_density: must be a finite number"),
    ("a camera turned by no rotation", lambda: replace(CAMERA, R_BC=np.ones((3, 3))), "camera, row 0, R_BC: must be a rotation"),
    ("a mirrored camera", lambda: replace(CAMERA, R_BC=-CAMERA.R_BC), "R_BC: must be a rotation"),
    ("a negative focal length", lambda: replace(CAMERA, fx=-CAMERA.fx), "camera, fx: must be positive"),
    ("a focal length of NaN", lambda: replace(CAMERA, fy=np.nan), "camera, fy: must be a finite number"),
    ("a camera position of NaN", lambda: replace(CAMERA, p_BC=np.full(3, np.nan)), "p_BC: must be finite"),
    ("an image of width 0", lambda: replace(CAMERA, width=0), "camera, width: must be positive"),
    ("a negative tolerance", lambda: vg.Options(function_tolerance=-1.0), "function_tolerance: must not be negative"),
    ("no threads", lambda: vg.Options(threads=0), "threads: must not be negative"),
    ("1.5 iterations", lambda: vg.Options(maximum_iterations=1.5), "maximum_iterations: must be an integer"),
    ("covariances of different sizes compared", lambda: vg.relative_frobenius(FREE, MOTION), "A: must have shape"),
    ("a covariance compared with zeros", lambda: vg.relative_frobenius(np.eye(2), np.zeros((2, 2))), "must not be zero"),
    ("NaN in an estimate against the truth", lambda: vg.trajectory_errors(replace(STATE, v_W=STATE.v_W * np.nan), STATE), "v_W: must be finite"),
]  # fmt: skip


@pytest.mark.parametrize(("call", "words"), [case[1:] for case in CASES], ids=[case[0] for case in CASES])
def test_misuse_is_refused_in_words(call, words):
    """Catches a wrong number, NaN, or an error of NumPy, LAPACK or compiled code for input that has no answer."""
    with pytest.raises(vg.VigaugeError, match=words):
        call()


@pytest.mark.parametrize(
    "form", [np.asfortranarray, np.matrix, np.ndarray.tolist, scipy.sparse.csr_array, np.longdouble]
)
@pytest.mark.filterwarnings("ignore:the matrix subclass")
def test_other_forms_of_a_matrix_give_the_same_numbers(form):
    """Catches a form of matrix whose product, or whose memory, means something else."""
    expected = foreign(H, U, V)
    assert np.allclose(foreign(form(H), U, V), expected, rtol=1e-9, atol=0)
    assert np.allclose(project(form(FREE), U, V), project(FREE, U, V), rtol=1e-12, atol=0)


def test_states_with_different_references_are_compared_by_their_rotations():
    """Catches a difference of total increments that count from two rotations: 0 for a turn by 0.2 rad."""
    other = vg.State.start(STATE.p_W, so3.exp([0.0, 0.1, 0.2]) @ STATE.R_WB, STATE.v_W, STATE.X_W)
    moved = STATE.retract(STATE.local(other))
    assert np.abs(STATE.local(other)).max() > 0.1
    assert np.allclose(moved.R_WB, other.R_WB, rtol=0, atol=1e-13)
    assert np.allclose(other.retract(other.local(STATE)).R_WB, STATE.R_WB, rtol=0, atol=1e-13)


def test_a_gap_that_is_allowed_is_bridged():
    """Catches an allowance that is ignored."""
    assert integrate(0, 400_000_000, GAP, largest_gap_s=0.2).dt == pytest.approx(0.4)


def test_thirty_two_bit_measurements_are_taken_as_they_stand():
    """Catches a refusal, or another rounding, of what feature trackers give."""
    single = PROBLEM.obs_uv.astype(np.float32)
    assert np.array_equal(replace(PROBLEM, obs_uv=single).obs_uv, single.astype(float))


def test_the_gate_keeps_what_needs_no_change():
    """Catches a copy of every array that passes, which costs more than the look."""
    array = np.ones((3, 3))
    assert np.shares_memory(arrays.reals("A", array, (3, 3)), array)
