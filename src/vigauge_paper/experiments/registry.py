"""The experiments that explain results, in the order in which they run."""

from . import (
    bias_hypothesis,
    biases,
    damping,
    exchange,
    iteration_time,
    nees,
    orbit,
    reading,
    tolerance,
    weights,
    yaw,
)

_ALL = (
    orbit.EXPERIMENT,
    yaw.EXPERIMENT,
    damping.EXPERIMENT,
    tolerance.EXPERIMENT,
    weights.EXPERIMENT,
    exchange.EXPERIMENT,
    reading.EXPERIMENT,
    bias_hypothesis.EXPERIMENT,
    nees.EXPERIMENT,
    iteration_time.EXPERIMENT,
    biases.EXPERIMENT,
)
EXPERIMENTS = {experiment.name: experiment for experiment in _ALL}
UNTIMED = tuple(name for name, experiment in EXPERIMENTS.items() if not experiment.timed)
TIMED = tuple(name for name, experiment in EXPERIMENTS.items() if experiment.timed)
