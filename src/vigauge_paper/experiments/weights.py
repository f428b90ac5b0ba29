"""Extremely large prior weights (Section V-A)."""

from dataclasses import dataclass

from vigauge.gauge.gauges import FixedGauge, Gauge, PriorGauge

from ..ids import ERRORS, FIX, Row
from .evidence import Evidence
from .experiment import Experiment, Material
from .solves import solve_all


@dataclass(frozen=True)
class Settings:
    """``trials`` of every configuration; ``weights`` of the prior as text, 1/m^2 and 1/rad^2."""

    trials: int
    weights: tuple[str, ...]


def rows(material: Material, settings: Settings) -> list[Row]:
    """A row a run: every configuration and trial, under fixation and every weight."""
    gauges: dict[str, Gauge] = {FIX: FixedGauge()}
    gauges |= {weight: PriorGauge(float(weight)) for weight in settings.weights}
    return [
        row
        for name in material.problems
        for row in solve_all(
            name, material.trials(name, settings.trials), material.truth(name), gauges, material.solver
        )
    ]


def sentence(e: Evidence) -> str:
    """Up to which information runs were tried, and how near they come to fixation."""
    table = e.reason("weights")
    largest = max((name for name in table["gauge"].unique() if name != FIX), key=float)
    means = table.groupby(["experiment", "gauge"])[list(ERRORS)].mean()
    fix, other = (means.xs(name, level="gauge") for name in (FIX, largest))
    away = float((other - fix).abs().to_numpy().max())
    near = f"to within {away:.0e}" if away > 0.0 else "to the last digit"
    return (
        f"Up to an information of {largest} the prior acts as fixation, whose mean RMSE it has "
        f"{near}{e.left_out('weights')}."
    )


EXPERIMENT = Experiment("weights", rows, Settings, reads=("problems", "truths"))
