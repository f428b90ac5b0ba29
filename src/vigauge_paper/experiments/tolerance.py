"""Runs to the very minimum: differences of RMSE come from where each run stops."""

from __future__ import annotations

from dataclasses import dataclass, replace

from vigauge.gauge.gauges import three_gauges

from ..ids import ERRORS, NOT_FIXED
from .evidence import Evidence
from .experiment import Experiment, Material
from .solves import solve_all

Row = dict[str, object]


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


def sentence(e: Evidence) -> str:
    """Differences of RMSE come from where each run stops."""
    table = e.reason("tolerance")
    texts = []
    for value in sorted(table["function_tolerance"].unique(), reverse=True):
        means = (
            table[table["function_tolerance"] == value].groupby(["experiment", "gauge"])[list(ERRORS)].mean()
        )
        fix = means.xs("fix", level="gauge")
        worst = {
            gauge: ((means.xs(gauge, level="gauge") - fix) / fix).abs().to_numpy().max()
            for gauge in NOT_FIXED
        }
        texts.append(f"{value:g}: free {worst['free']:.1e}, prior {worst['prior']:.1e}")
    return (
        "where each run stops: largest relative difference of mean RMSE to fixation at function tolerance "
        + "; ".join(texts)
        + e.left_out("tolerance")
    )


EXPERIMENT = Experiment("tolerance", rows, Settings)
