"""Hypothesis: a small bias of the inertial sensor that the estimator does not know, one a trajectory.

The paper's errors are larger than its own covariance allows, so something was not in its model. Six numbers a
trajectory, fitted to the six RMSE of its two configurations, bring Table II near. They are as many parameters
as numbers that they explain: the table shows that so small a bias suffices, not that it was there.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from vigauge.errors import ConfigError
from vigauge.gauge.gauges import FixedGauge
from vigauge.model.evaluation import trajectory_errors
from vigauge.solver.levenberg_marquardt import Options, solve
from vigauge.synthetic.scenario import Scene, make_scene, make_trial

from ..ids import CONFIGURATIONS, ERRORS, TRAJECTORIES, Row
from .experiment import Experiment, Material


@dataclass(frozen=True)
class Settings:
    """``trials`` of every configuration; by trajectory, what is added to the inertial samples of its flights.

    ``gyro_bias_radps`` and ``accel_bias_mps2`` are in the body frame. ConfigError unless each names every
    trajectory.
    """

    trials: int
    gyro_bias_radps: Mapping[str, Sequence[float]]
    accel_bias_mps2: Mapping[str, Sequence[float]]

    def __post_init__(self) -> None:
        for field in ("gyro_bias_radps", "accel_bias_mps2"):
            if set(named := getattr(self, field)) != set(TRAJECTORIES):
                raise ConfigError(
                    "config section 'reasons.bias_hypothesis'",
                    f"must name the trajectories {', '.join(TRAJECTORIES)}",
                    field=field,
                    value=", ".join(named),
                )


def biased(scene: Scene, gyro: Sequence[float], accel: Sequence[float]) -> Scene:
    """The scene with a constant added to its inertial samples, rad/s and m/s^2: no problem knows of it."""
    return replace(scene, imu=scene.imu.corrected(-np.array(gyro), -np.array(accel)))


def mean_rmse(scene: Scene, trials: int, options: Options) -> list[float]:
    """Mean RMSE of the first trials under fixation: m, deg, m/s."""
    solutions = (solve(make_trial(scene, trial), FixedGauge(), options) for trial in range(trials))
    errors = [trajectory_errors(solution.state, scene.truth) for solution in solutions]
    return [float(np.mean([getattr(e, name) for e in errors])) for name in ERRORS]


def rows(material: Material, settings: Settings) -> list[Row]:
    """The 18 RMSE of Table II under fixation: published, ours without and with the bias, its ratio."""
    paper = pd.read_csv(material.published / "table2.csv").query("gauge == 'fix'").set_index("configuration")
    out: list[Row] = []
    for name, (trajectory, points) in CONFIGURATIONS.items():
        scene = make_scene(trajectory, points, material.simulation)
        hidden = biased(scene, settings.gyro_bias_radps[trajectory], settings.accel_bias_mps2[trajectory])
        found = (mean_rmse(s, settings.trials, material.solver) for s in (scene, hidden))
        for error, without, with_bias in zip(ERRORS, *found, strict=True):
            published = float(paper.loc[name, error])
            out.append(
                {
                    "configuration": name,
                    "error": error,
                    "published": published,
                    "without": without,
                    "with_bias": with_bias,
                    "ratio": with_bias / published,
                }
            )
    return out


EXPERIMENT = Experiment("bias_hypothesis", rows, Settings)
