"""An experiment that explains results: what it starts from, its settings and its table."""

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from vigauge.model.archive import load_problems, load_states
from vigauge.model.problem import Problem
from vigauge.model.state import State
from vigauge.solver.levenberg_marquardt import Options
from vigauge.synthetic.settings import SimulationSettings

from ..ids import Row


@dataclass(frozen=True)
class Material:
    """What experiments start from.

    ``problems`` and ``truths`` of the simulated configurations and ``covariances`` of all results, by name;
    ``sweep_trace`` of the prior weights, by ``sweep_configuration``, which they are done on; ``published``
    is the folder of the paper's numbers; ``clock`` tells seconds.
    Files are given to experiments that take no times only, and to each those that it reads.
    """

    simulation: SimulationSettings
    solver: Options
    prior_information: float
    sweep_configuration: str
    clock: Callable[[], float]
    problems: Mapping[str, Path] = field(default_factory=dict)
    truths: Mapping[str, Path] = field(default_factory=dict)
    covariances: Mapping[str, Path] = field(default_factory=dict)
    sweep_trace: Mapping[str, Path] = field(default_factory=dict)
    published: Path = Path()

    def trials(self, name: str, count: int) -> list[Problem]:
        """The first trials of a simulated configuration."""
        return load_problems(self.problems[name])[:count]

    def truth(self, name: str) -> State:
        return load_states(self.truths[name])[0]


@dataclass(frozen=True)
class NoSettings:
    """Of an experiment that reads off what others left."""


@dataclass(frozen=True)
class Trials:
    """``trials`` of every simulated configuration that is used."""

    trials: int


@dataclass(frozen=True)
class Experiment:
    """``name`` of its table and of its part of config section 'reasons', read as ``settings``.

    ``rows`` makes the table from the material and the settings; ``reads`` names the files of the material
    that it waits for, ``published`` aside; ``timed``: its numbers are seconds, and
    differ from run to run. The sentences that the ledger quotes stand in the same file, as functions.
    """

    name: str
    rows: Callable[[Material, Any], list[Row]]
    settings: type[Any] = NoSettings
    reads: tuple[str, ...] = ()
    timed: bool = False

    @property
    def about(self) -> str:
        """What it asks, in a sentence: the first of its module."""
        module = sys.modules[self.rows.__module__]
        return str(module.__doc__).splitlines()[0].removesuffix(".")
