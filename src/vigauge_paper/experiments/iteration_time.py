"""What holding four columns can save of an iteration's time, and what it does.

Under fixation the reduced system has 9N - 4 rows instead of 9N. That is all it can save: residuals,
Jacobians and the elimination of the landmarks are the same in all gauges.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from vigauge.gauge.gauges import Gauge, three_gauges
from vigauge.model.problem import Problem
from vigauge.solver.levenberg_marquardt import Options
from vigauge.synthetic.scenario import make_scene, make_trial

from ..ids import CONFIGURATIONS, Row
from .evidence import Evidence
from .experiment import Experiment, Material
from .interleaved import Trial, solve_interleaved

Clock = Callable[[], float]

# Rows that a first-pose gauge holds out.
HELD = 4


@dataclass(frozen=True)
class Settings:
    """Numbers of keyframes; iterations and repeats of runs."""

    n_keyframes: tuple[int, ...]
    iterations: int
    repeats: int


def iteration_times(
    problem: Problem, gauges: Mapping[str, Gauge], options: Options, settings: Settings, clock: Clock
) -> list[Row]:
    """Seconds an iteration, gauges taking turns, all for the same number of iterations.

    No tolerance ends a run, so that no gauge has more of the dearer first iteration than another.
    """
    fixed_length = replace(
        options,
        function_tolerance=0.0,
        gradient_tolerance=0.0,
        parameter_tolerance=0.0,
        maximum_iterations=settings.iterations,
    )
    trial = Trial({"n_keyframes": problem.initial.n_keyframes}, problem)
    timed = solve_interleaved([trial], gauges, fixed_length, clock=clock, repeats=settings.repeats)
    return [
        {
            **trial.labels,
            "what": one.gauge,
            "repeat": one.repeat,
            "seconds": one.solution.seconds / max(one.solution.iterations, 1),
        }
        for one in timed
    ]


def dense_times(n_keyframes: int, repeats: int, rng: np.random.Generator, clock: Clock) -> list[Row]:
    """Seconds of factoring and solving a dense system of 9N rows, and of 9N - 4."""
    systems = {}
    for name, size in (("dense 9N", 9 * n_keyframes), ("dense 9N - 4", 9 * n_keyframes - HELD)):
        root = rng.normal(size=(size, size))
        systems[name] = root @ root.T + size * np.eye(size), rng.normal(size=size)
    rows: list[Row] = []
    for repeat in range(-1, repeats):  # the first goes unrecorded
        for name, (matrix, right) in systems.items():
            start = clock()
            cho_solve(cho_factor(matrix, check_finite=False), right, check_finite=False)
            seconds = clock() - start
            if repeat >= 0:
                rows.append({"n_keyframes": n_keyframes, "what": name, "repeat": repeat, "seconds": seconds})
    return rows


def rows(material: Material, settings: Settings) -> list[Row]:
    """A row a run of every gauge and a dense solve of both sizes, for every number of keyframes."""
    rng = np.random.default_rng(material.simulation.seed)
    trajectory, points = CONFIGURATIONS[material.sweep_configuration]
    gauges = three_gauges(material.prior_information)
    out: list[Row] = []
    for count in settings.n_keyframes:
        problem = make_trial(
            make_scene(trajectory, points, replace(material.simulation, n_keyframes=count)), 0
        )
        out += iteration_times(problem, gauges, material.solver, settings, material.clock)
        out += dense_times(count, settings.repeats, rng, material.clock)
    return out


def sentence(e: Evidence) -> str:
    """What the smaller system of fixation can save of an iteration."""
    table = e.reason("iteration_time")
    middle = table.groupby(["n_keyframes", "what"])["seconds"].median().unstack()
    saved = 100 * (middle["dense 9N"] - middle["dense 9N - 4"]) / middle["free"]
    return (
        "Fixation saves four rows of the reduced system, which is at most "
        f"{max(float(saved.max()), 0.0):.1g} % of an iteration; all else, "
        "but for the prior's own residual, is the same work."
    )


EXPERIMENT = Experiment("iteration_time", rows, Settings, timed=True)
