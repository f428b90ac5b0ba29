"""Extremely large prior weights (Section V-A)."""

from __future__ import annotations

from dataclasses import dataclass

from vigauge.gauge.gauges import FixedGauge, Gauge, PriorGauge

from ..ids import ERRORS, FIX
from .evidence import Evidence
from .experiment import Experiment, Material
from .solves import solve_all

Row = dict[str, object]


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
    """How near the RMSE of each weight comes to that of fixation."""
    table = e.reason("weights").groupby(["experiment", "gauge"])[list(ERRORS)].mean()
    fix = table.xs(FIX, level="gauge")
    parts = [
        f"{weight}: {(table.xs(weight, level='gauge') - fix).abs().to_numpy().max():.1e}"
        for weight in e.reason("weights")["gauge"].drop_duplicates()
        if weight != FIX
    ]
    shown = f"{', '.join(parts)}{e.left_out('weights')}"
    return f"largest difference of mean RMSE to fixation by w^P: {shown}"


EXPERIMENT = Experiment("weights", rows, Settings)
