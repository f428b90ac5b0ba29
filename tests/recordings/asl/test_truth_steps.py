"""Steps in a ground truth: found from truth and inertial samples, and taken out."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vigauge.geometry import so3
from vigauge.model.imu import ImuSamples
from vigauge.recordings.asl.ground_truth import GroundTruth, read_ground_truth
from vigauge.recordings.asl.sequence import read_sequence
from vigauge.recordings.asl.truth_steps import (
    coarseness_m,
    find_steps,
    step_candidates,
    steps_between,
    why_kept,
    without_steps,
)

# First frame of the sequence.
MH_01_BEGINS_NS = 1_403_636_579_763_555_584
START_NS = 1_403_636_580_000_000_000
GRAVITY = np.array([0.0, 0.0, -9.81])


def recording(spacing_ns: int = 5_000_000, count: int = 200) -> tuple[GroundTruth, ImuSamples]:
    """Lively motion (a third of g, some rad/s), truth and inertial samples of it, biases left in."""
    t_ns = np.arange(count, dtype=np.int64) * spacing_ns + START_NS
    t = (t_ns - t_ns[0]) * 1e-9
    rate = np.array([5.0, 4.0, 6.0])
    p_W = 0.1 * np.sin(np.outer(t, rate))
    a_W = -0.1 * rate**2 * np.sin(np.outer(t, rate))
    R_WB = so3.exp(0.8 * np.sin(np.outer(t, [2.0, 3.0, 2.5])))
    noise = np.random.default_rng(0).normal(0.0, 1e-5, p_W.shape)
    force = np.einsum("mji,mj->mi", R_WB, a_W - GRAVITY) + np.array([-0.03, 0.55, 0.08])
    samples = ImuSamples(t_ns, np.zeros_like(force), force)
    return GroundTruth(t_ns, p_W + noise, R_WB, np.zeros_like(p_W)), samples


def stepped(truth: GroundTruth, row: int, shift: np.ndarray) -> GroundTruth:
    p_W = truth.p_W.copy()
    p_W[row:] += shift
    return replace(truth, p_W=p_W)


directions = st.tuples(*[st.floats(-1.0, 1.0)] * 3).map(np.array).filter(lambda d: np.linalg.norm(d) > 0.1)


def test_a_sound_truth_has_none():
    """Catches motion, gravity or biases taken for a step."""
    assert find_steps(*recording()) == ()


@given(row=st.integers(2, 197), direction=directions, size=st.floats(2e-3, 0.05))
def test_a_step_is_found_and_taken_out(row, direction, size):
    """Catches a step of the wrong sign, place or size, or its shadow counted as another one."""
    truth, samples = recording()
    shift = size * direction / np.linalg.norm(direction)
    spoilt = stepped(truth, row, shift)
    (step,) = find_steps(spoilt, samples)
    assert step.t_ns == truth.t_ns[row]
    assert step.shift_W == pytest.approx(shift, abs=1e-4)
    assert step.length_m == pytest.approx(size, abs=2e-4)
    repaired = without_steps(spoilt, (step,))
    assert np.abs(repaired.p_W - truth.p_W).max() < 1e-4
    assert repaired.v_W is truth.v_W


def test_several_steps_are_told_apart():
    """Catches corrections that are not added up."""
    truth, samples = recording()
    shifts = [np.array([5e-3, 0.0, 0.0]), np.array([0.0, -3e-3, 4e-3]), np.array([0.0, 0.0, 0.02])]
    spoilt = truth
    for row, shift in zip((30, 90, 91), shifts, strict=True):
        spoilt = stepped(spoilt, row, shift)
    steps = find_steps(stepped(stepped(truth, 30, shifts[0]), 90, shifts[1]), samples)
    assert [step.t_ns for step in steps] == truth.t_ns[[30, 90]].tolist()
    assert (
        np.abs(
            without_steps(stepped(stepped(truth, 30, shifts[0]), 90, shifts[1]), steps).p_W - truth.p_W
        ).max()
        < 2e-4
    )
    # Two in a row are no step between two samples, and nothing is guessed.
    assert len(find_steps(spoilt, samples)) <= 2


def test_one_wrong_sample_is_no_step():
    """Catches an outlier taken for a step: what follows it must not be moved."""
    truth, samples = recording()
    p_W = truth.p_W.copy()
    p_W[60] += np.array([0.01, 0.0, 0.0])
    assert find_steps(replace(truth, p_W=p_W), samples) == ()


@pytest.mark.parametrize("sigma_m", [1e-4, 2e-4, 3e-4, 5e-4, 2e-3])
@pytest.mark.parametrize("outlier_m", [0.0, 1e-3])
def test_noise_of_the_truth_is_no_step(sigma_m, outlier_m):
    """Catches a limit that the truth's own noise exceeds: what is taken out adds up."""
    truth, samples = recording(count=4000)
    noise = np.random.default_rng(1).normal(0.0, sigma_m, truth.p_W.shape)
    noise[2000, 0] += outlier_m
    assert find_steps(replace(truth, p_W=truth.p_W + noise), samples) == ()


@pytest.mark.parametrize("spacings_ms", [(4, 10), (5, 5, 10), (5, 6), (2, 10)])
@pytest.mark.parametrize("row", [60, 61, 62])
def test_uneven_stamps_give_the_size_of_the_step(spacings_ms, row):
    """Catches a step judged by the length of the interval after it."""
    truth, samples = recording(1_000_000, 2000)
    rows = np.concatenate([[0], np.cumsum(np.tile(spacings_ms, 2000 // sum(spacings_ms)))])[:-1]
    sparse = GroundTruth(truth.t_ns[rows], truth.p_W[rows], truth.R_WB[rows], truth.v_W[rows])
    (step,) = find_steps(stepped(sparse, row, np.array([0.0, 0.01, 0.0])), samples)
    assert step.t_ns == sparse.t_ns[row]
    assert step.shift_W == pytest.approx([0.0, 0.01, 0.0], abs=3e-4)


@pytest.mark.parametrize("spacing_ns", [50_000_000, 20_000_000])
def test_sparse_truth_is_not_judged(spacing_ns):
    """Catches a verdict where the motion between samples is unknown."""
    assert find_steps(*recording(spacing_ns)) is None


def test_outside_the_inertial_samples_nothing_is_judged():
    """Catches forces made up before the first or after the last sample."""
    truth, samples = recording()
    half = ImuSamples(samples.t_ns[:100], samples.gyro[:100], samples.accel[:100])
    assert find_steps(stepped(truth, 150, np.array([0.01, 0.0, 0.0])), half) == ()
    late = ImuSamples(samples.t_ns + 10**10, samples.gyro, samples.accel)
    assert find_steps(truth, late) is None
    assert without_steps(truth, None) is truth


def walk(count: int = 14_000) -> tuple[GroundTruth, ImuSamples]:
    """7 m at 0.1 m/s, truth of 200 Hz."""
    t_ns = START_NS + np.arange(count, dtype=np.int64) * 5_000_000
    p_W = np.outer((t_ns - t_ns[0]) * 1e-9, [0.1003, 0.0, 0.0])
    R_WB = np.tile(np.eye(3), (count, 1, 1))
    samples = ImuSamples(t_ns, np.zeros_like(p_W), np.tile(-GRAVITY, (count, 1)))
    return GroundTruth(t_ns, p_W, R_WB, np.zeros_like(p_W)), samples


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda p: np.round(p, 2), "given to 0.01 m only"),
        (lambda p: 500_000.0 + np.round(p, 1), "given to 0.1 m only"),
        (lambda p: p[np.arange(len(p)) // 10 * 10], "90 % of its positions repeat the one before"),
    ],
    ids=["2 decimals", "UTM, 1 decimal", "held between updates"],
)
def test_updates_of_a_coarse_truth_are_not_taken_out(spoil, words):
    """Catches a path that vanishes: of 7 m, 6.98 m were taken for steps."""
    truth, samples = walk()
    coarse = replace(truth, p_W=spoil(truth.p_W))
    steps = step_candidates(coarse, samples)
    assert words in why_kept(coarse, steps)
    assert without_steps(coarse, find_steps(coarse, samples)) is coarse


def test_a_step_that_is_half_of_the_path_is_left_in():
    """Catches a path cut in half on the word of one sample."""
    truth, samples = recording()
    spoilt = stepped(truth, 100, np.array([0.5, 0.0, 0.0]))
    assert find_steps(spoilt, samples) is None
    assert "1 jumps in 0.995 s make up 0.5 m" in why_kept(spoilt, step_candidates(spoilt, samples))


def test_fine_positions_are_on_no_grid():
    """Catches a truth of full precision, or one that rests, called coarse."""
    truth, _ = walk()
    assert coarseness_m(recording()[0]) == 0.0
    assert coarseness_m(replace(truth, p_W=np.zeros_like(truth.p_W))) == 0.0
    assert coarseness_m(replace(truth, p_W=np.round(truth.p_W, 4))) == 0.0


def test_only_steps_inside_a_window_change_its_path():
    """Catches a step before the first keyframe, which moves all of them, counted as one of the window."""
    truth, samples = recording()
    steps = find_steps(stepped(truth, 50, np.array([0.01, 0.0, 0.0])), samples)
    at = steps[0].t_ns
    assert steps_between(steps, at - 1, at + 1) == list(steps)
    assert steps_between(steps, at, at + 1) == [] == steps_between(None, 0, 1)


@pytest.mark.euroc
def test_known_steps_of_a_published_truth(euroc_root):
    """Catches a rule that misses what the data are known for: the jumps of MH_01's published positions, which
    are all there are of a millimetre or more in its first 17 s."""
    folder = euroc_root / "MH_01_easy"
    truth = read_ground_truth(folder / "mav0" / "state_groundtruth_estimate0")
    steps = find_steps(truth, read_sequence(folder).imu)
    assert [round(1e-9 * (step.t_ns - MH_01_BEGINS_NS), 2) for step in steps] == [4.97, 5.77, 16.12, 16.77]
    assert [1e3 * step.length_m for step in steps] == pytest.approx([8.6, 5.0, 1.9, 3.3], abs=0.1)
