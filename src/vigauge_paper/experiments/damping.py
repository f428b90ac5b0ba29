"""Less damping: fewer iterations of the free gauge come from it."""

from dataclasses import dataclass, replace

from vigauge.gauge.gauges import three_gauges

from ..ids import Row
from .evidence import Evidence
from .experiment import Experiment, Material
from .solves import solve_all


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
    means = counts.unstack()
    largest = float((means["free"] - means["fix"]).abs().max())
    return (
        "Levenberg-Marquardt damping makes the difference: without it, gauges differ by at most "
        f"{largest:.2f} iterations{e.left_out('damping')}."
    )


EXPERIMENT = Experiment("damping", rows, Settings, reads=("problems", "truths"))
