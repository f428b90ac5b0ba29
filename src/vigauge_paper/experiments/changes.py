"""One assumption changed: a number of the simulation's or the solver's settings."""

from dataclasses import fields, replace
from typing import Any

from vigauge.errors import ConfigError
from vigauge.solver.levenberg_marquardt import Options
from vigauge.synthetic.settings import SimulationSettings


def changed(
    settings: SimulationSettings, solver: Options, parameter: str, value: float
) -> tuple[SimulationSettings, Options]:
    """Settings with one number of either changed. ConfigError for a name that neither has."""
    for kind, holder in (("simulation", settings), ("solver", solver)):
        if parameter in {field.name for field in fields(holder)}:
            number: Any = int(value) if isinstance(getattr(holder, parameter), int) else value
            if kind == "simulation":
                return replace(settings, **{parameter: number}), solver
            return settings, replace(solver, **{parameter: number})
    raise ConfigError(
        "config section 'sensitivity'", "must be a key of simulation or solver", value=parameter
    )
