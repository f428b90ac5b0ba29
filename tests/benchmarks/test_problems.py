"""The problems that all solvers start from."""

import struct

import numpy as np
import pytest

from benchmarks.exchange import read_matrix, read_state, write_matrix, write_state
from benchmarks.problems import (
    MINIMUM_PARALLAX_RAD,
    MINIMUM_VIEWS,
    TRACK_LENGTHS,
    Size,
    cached_problem,
    make_problem,
)
from vigauge.errors import DataError
from vigauge.gauge.gauges import FreeGauge
from vigauge.model.archive import load_problems
from vigauge.solver.levenberg_marquardt import Options, solve
from vigauge.solver.residuals import cost


@pytest.fixture(scope="module")
def long():
    return make_problem(Size(40, 400))


def test_same_seed_same_problem(long):
    """Catches a generator that draws from somewhere else than its seed."""
    again, other = make_problem(Size(40, 400)), make_problem(Size(40, 400, seed=1))
    assert np.array_equal(again.obs_uv, long.obs_uv)
    assert np.array_equal(again.initial.p_W, long.initial.p_W)
    assert not np.array_equal(other.obs_uv[:50], long.obs_uv[:50])


def test_tracks_are_bounded_and_long_enough(long):
    """Catches tracks that grow with the flight (work would grow with its square), points that are seen
    too seldom, and keyframes that see nothing."""
    assert (long.initial.n_keyframes, long.initial.n_landmarks) == (40, 400)
    views = np.bincount(long.obs_landmark)
    assert views.min() >= MINIMUM_VIEWS and views.max() <= max(TRACK_LENGTHS)
    assert 7.0 < views.mean() < 9.0
    reach = [np.ptp(long.obs_keyframe[long.obs_landmark == j]) for j in range(400)]
    assert max(reach) < max(TRACK_LENGTHS)
    seen = np.bincount(long.obs_keyframe, minlength=40)
    assert seen.min() > 0.3 * seen.mean()


def test_landmarks_are_numbered_by_first_sight(long):
    """Catches observations that kept the numbers in which landmarks were drawn."""
    first = np.full(400, 40)
    np.minimum.at(first, long.obs_landmark, long.obs_keyframe)
    assert np.all(np.diff(first) >= 0)


def test_parallax_at_the_estimate(long):
    """Catches points near the direction of flight, which no camera can place."""
    state = solve(long, FreeGauge()).state
    angles = []
    for j in range(long.initial.n_landmarks):
        seen = long.obs_keyframe[long.obs_landmark == j]
        a, b = state.X_W[j] - state.p_W[seen[0]], state.X_W[j] - state.p_W[seen[-1]]
        angles.append(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))
    # Noise moves a point a little.
    assert min(angles) > 0.3 * MINIMUM_PARALLAX_RAD


def test_flight_goes_on_at_constant_speed(long):
    """Catches a long flight that speeds up, stands still, or leaves the paper's 2 m/s and spacing."""
    speed = np.linalg.norm(solve(long, FreeGauge()).state.v_W, axis=1)
    assert np.all((speed > 1.5) & (speed < 2.6))
    assert long.inertial.dt == pytest.approx(np.full(39, 2.5 / 9), abs=0.006)


@pytest.mark.parametrize("size", [Size(10, 60), Size(40, 400)])
def test_noise_is_as_stated(size):
    """Catches measurements that do not fit their own noise: chi-square an degree of freedom."""
    problem = make_problem(size)
    best = solve(problem, FreeGauge(), Options(function_tolerance=1e-9))
    n, k = size.n_keyframes, size.n_landmarks
    freedom = 2 * len(problem.obs_uv) + 9 * (n - 1) - (9 * n + 3 * k - 4)
    assert best.converged
    assert 2.0 * best.cost / freedom == pytest.approx(1.0, abs=5.0 * np.sqrt(2.0 / freedom))


def test_start_is_far_from_the_minimum(long):
    """Catches a start at the truth, from which every solver is fast."""
    assert cost(long, long.initial) > 10.0 * solve(long, FreeGauge()).cost


def test_too_small_is_refused():
    """Catches a size that ends in an index error deep inside."""
    with pytest.raises(DataError, match="two keyframes"):
        make_problem(Size(1, 10))


def test_files_are_made_once(small, tmp_path):
    """Catches solvers that start from different files, or a file made anew under a running race."""
    problem, files = small
    folder = files[0].parent
    before = [file.stat().st_mtime_ns for file in files]
    assert cached_problem(Size(10, 40), folder) == files
    assert [file.stat().st_mtime_ns for file in files] == before


def test_binary_file_is_the_problem(small):
    """Catches fields in another order, or of another width, than the C++ program reads."""
    problem, (_, binary) = small
    raw = binary.read_bytes()
    assert raw[:8] == b"VIGPROB2"
    n, k, cameras, m, f, width = struct.unpack("<6q", raw[8:56])
    assert (n, k, cameras, m, f, width) == (10, 40, 1, len(problem.obs_uv), 9, 9)
    assert struct.unpack("<2d", raw[56:72]) == (problem.sigma_px, problem.gravity)
    doubles = 2 + (15 * n + 3 * k + 3) + 9 + 16 * cameras + 2 * m + (1 + 3 + 9 + 3 + 81) * f
    assert len(raw) == 56 + 8 * (doubles + 3 * m + 2 * f)
    whitener = np.frombuffer(raw[-8 * 81 * f :], "<f8").reshape(f, 9, 9)
    assert np.array_equal(whitener, problem.inertial.whitener)


def test_state_and_matrix_round_trip(small, tmp_path):
    """Catches a state that comes back turned, shortened, or as another problem's."""
    problem, _ = small
    state = solve(problem, FreeGauge()).state
    file = tmp_path / "x.state"
    for written in (state.with_biases(*np.arange(60.0).reshape(2, 10, 3)), state):
        write_state(file, written)
        back = read_state(file, written)
        for name in ("p_W", "R_WB", "v_W", "X_W", "dphi_0", "R_WB0_ref", "gyro_bias", "accel_bias"):
            assert np.array_equal(getattr(back, name), getattr(written, name)), name
    other = make_problem(Size(10, 41))
    with pytest.raises(DataError, match="41 landmarks"):
        read_state(file, other.initial)
    file.write_bytes(file.read_bytes()[:-8])
    with pytest.raises(DataError, match="cut short"):
        read_state(file, problem.initial)
    file.write_bytes(b"something else")
    with pytest.raises(DataError, match="state file"):
        read_state(file, problem.initial)
    matrix = np.arange(9.0).reshape(3, 3)
    write_matrix(tmp_path / "m", matrix)
    assert np.array_equal(read_matrix(tmp_path / "m", (3, 3)), matrix)
    with pytest.raises(DataError, match="4 x 4"):
        read_matrix(tmp_path / "m", (4, 4))


def test_npz_holds_the_same_numbers(small):
    """Catches a problem that changes on its way through the archive."""
    problem, files = small
    assert np.array_equal(load_problems(files[0])[0].obs_uv, make_problem(Size(10, 40)).obs_uv)
    assert np.array_equal(problem.obs_uv, make_problem(Size(10, 40)).obs_uv)
