"""Simulated problems of the size of a test, made once a session.

The numbers are those of the paper's experiment, with fewer landmarks.
"""

from dataclasses import replace
from functools import cache

import numpy as np

from vigauge.gauge.gauges import FreeGauge
from vigauge.model.loss import Loss
from vigauge.model.problem import Problem
from vigauge.model.state import State
from vigauge.solver.levenberg_marquardt import Options, solve
from vigauge.synthetic.biases import BiasedTrial, make_biased_trial
from vigauge.synthetic.scenario import Scene, make_scene, make_trial
from vigauge.synthetic.settings import SimulationSettings

SETTINGS = SimulationSettings(
    duration_s=2.5,
    mean_speed_mps=2.0,
    n_keyframes=10,
    n_landmarks=30,
    minimum_views=3,
    landmark_depth_m=(1.5, 8.0),
    plane_roughness_m=0.05,
    image_size_px=(320, 240),
    field_of_view_deg=110.0,
    sigma_px=1.0,
    imu_rate_hz=200.0,
    gyro_density=1.0e-3,
    accel_density=1.0e-2,
    gyro_bias_radps=(0.01, -0.02, 0.03),
    accel_bias_mps2=(0.1, -0.05, 0.08),
    rotation_amplitude_deg=12.0,
    view_follows_path=0.0,
    gravity_mps2=9.81,
    perturb_position_m=0.05,
    perturb_rotation_deg=6.0,
    perturb_velocity_mps=0.05,
    perturb_landmark_m=0.075,
    n_trials=3,
    redraw_noise=True,
    seed=2018,
)

# Far below the defaults, so that what is compared is the minimum and not where a run stopped.
# A function tolerance of zero would go on until rounding error decides.
TIGHT = Options(
    function_tolerance=1e-15, parameter_tolerance=1e-14, gradient_tolerance=1e-9, maximum_iterations=200
)


@cache
def scene(trajectory: str = "sine", points: str = "random", **changes) -> Scene:
    """A scene of the settings above, with the given fields changed."""
    return make_scene(trajectory, points, replace(SETTINGS, **changes))


@cache
def trial(number: int = 0, trajectory: str = "sine", points: str = "random", **changes) -> Problem:
    """The problem of one trial of such a scene."""
    return make_trial(scene(trajectory, points, **changes), number)


def with_outliers(problem: Problem, loss: Loss | None, share: float = 0.15) -> Problem:
    """The problem with a loss, and a share of its observations off by 10 to 30 sigma."""
    rng = np.random.default_rng(7)
    bad = rng.random(len(problem.obs_uv)) < share
    turn, length = (
        rng.uniform(0.0, 2.0 * np.pi, len(bad)),
        rng.uniform(10.0, 30.0, len(bad)) * problem.sigma_px,
    )
    off = (bad * length)[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    return replace(problem, obs_uv=problem.obs_uv + off, loss=loss)


@cache
def estimate(number: int = 0, trajectory: str = "sine", points: str = "random", **changes) -> State:
    """The free-gauge minimum of such a problem; its first pose lies off the gauge of Eq. (10)."""
    solution = solve(trial(number, trajectory, points, **changes), FreeGauge(), TIGHT)
    assert solution.converged
    return solution.state


@cache
def biased_trial(number: int = 0, trajectory: str = "sine", points: str = "random", **changes) -> BiasedTrial:
    """A trial with biases to estimate, which walk as a consumer sensor's do."""
    return make_biased_trial(scene(trajectory, points, **changes), number, gyro_walk=1e-3, accel_walk=1e-2)


@cache
def biased_estimate(number: int = 0, trajectory: str = "sine", points: str = "random", **changes) -> State:
    """The free-gauge minimum of such a problem."""
    solution = solve(biased_trial(number, trajectory, points, **changes).problem, FreeGauge(), TIGHT)
    assert solution.converged
    return solution.state
