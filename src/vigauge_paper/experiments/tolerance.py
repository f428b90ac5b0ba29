"""Runs to the very minimum: differences of RMSE come from where each run stops."""

from dataclasses import dataclass, replace

import pandas as pd

from vigauge.gauge.gauges import three_gauges

from ..ids import ERRORS, FIX, FREE, Row
from .evidence import Evidence
from .experiment import Experiment, Material
from .solves import solve_all


@dataclass(frozen=True)
class Settings:
    """``trials`` of every configuration; ``function_tolerance`` of runs to the very minimum."""

    trials: int
    function_tolerance: float


def rows(material: Material, settings: Settings) -> list[Row]:
    """A row a run: every configuration, tolerance (the solver's and the tight one), trial and gauge."""
    gauges = three_gauges(material.prior_information)
    tight = replace(material.solver, function_tolerance=settings.function_tolerance)
    return [
        row
        for name in material.problems
        for options in (material.solver, tight)
        for row in solve_all(
            name, material.trials(name, settings.trials), material.truth(name), gauges, options
        )
    ]


def at_the_minimum(e: Evidence) -> pd.DataFrame:
    """Runs with the tight tolerance that converged."""
    table = e.reason("tolerance")
    return table[table["function_tolerance"] == table["function_tolerance"].min()]


def largest_difference(e: Evidence, gauge: str) -> float:
    """Largest relative difference of a mean RMSE to fixation's, at the minimum, over configurations."""
    means = at_the_minimum(e).groupby(["experiment", "gauge"])[list(ERRORS)].mean()
    fix = means.xs(FIX, level="gauge")
    return float(((means.xs(gauge, level="gauge") - fix) / fix).abs().to_numpy().max())


def sentence(e: Evidence) -> str:
    """Differences of RMSE come from where each run stops."""
    return (
        "Both gauges have the same minimum and stop at different points near it: where all runs go on to it, "
        f"mean RMSE differ by at most {100 * largest_difference(e, FREE):.1e} %{e.left_out('tolerance')}."
    )


EXPERIMENT = Experiment("tolerance", rows, Settings, reads=("problems", "truths"))
