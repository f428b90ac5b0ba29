"""Less damping: fewer iterations of the free gauge come from it."""

from __future__ import annotations

from dataclasses import dataclass, replace

from vigauge.gauge.gauges import three_gauges

from .evidence import Evidence
from .experiment import Experiment, Material
from .solves import solve_all

Row = dict[str, object]


@dataclass(frozen=True)
class Settings:
    """``trials`` of every configuration; ``radii`` first trust-region radii."""

    trials: int
    radii: tuple[float, ...]


def rows(material: Material, settings: Settings) -> list[Row]:
    """A row a run: every configuration, radius, trial and gauge."""
    gauges = three_gauges(material.prior_information)
    return [
        row
        for name in material.problems
        for radius in settings.radii
        for row in solve_all(
            name,
            material.trials(name, settings.trials),
            material.truth(name),
            gauges,
            replace(material.solver, initial_radius=radius),
        )
    ]


def sentence(e: Evidence) -> str:
    """Fewer iterations of the free gauge come from the damping."""
    table = e.reason("damping")
    radius = table["initial_radius"].max()
    counts = table[table["initial_radius"] == radius].groupby(["experiment", "gauge"])["iterations"].mean()
    undamped = counts.unstack()
    after = (undamped["free"] - undamped["fix"]).mean()
    usual = e.reason("tolerance")
    usual = usual[usual["function_tolerance"] == usual["function_tolerance"].max()]
    means = usual.groupby("gauge")["iterations"].mean()
    before = means["free"] - means["fix"]
    largest = (undamped["free"] - undamped["fix"]).abs().max()
    return (
        f"Levenberg-Marquardt damping: with the first radius at {radius:g} (damping {1 / radius:g} of the "
        f"diagonal) the mean difference of free and fix is {after:+.2f} iterations instead of {before:+.2f}, "
        f"in no configuration more than {largest:.2f}; means: fix {undamped['fix'].mean():.2f}, "
        f"prior {undamped['prior'].mean():.2f}, free {undamped['free'].mean():.2f}"
        f"{e.left_out('damping', 'tolerance')}"
    )


EXPERIMENT = Experiment("damping", rows, Settings)
