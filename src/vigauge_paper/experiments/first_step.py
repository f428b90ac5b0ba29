"""How hard the damping holds the orbit, read off the first step of a run.

Along the orbit the cost is flat, so the first step is cut by the prior alone: of the free
gauge's way a share s / (s + w) is left, where s is the damping in the units of the weight w.
"""

from __future__ import annotations

from collections.abc import Iterable

import pandas as pd

from ..ids import FREE, HEADLINE, PRIOR
from .evidence import Evidence, NoEvidenceError
from .experiment import Experiment, Material, NoSettings, Row


def damping_weight(with_prior: float, free: float, weight: float) -> float:
    """s from the position errors after the first step with a prior and without; nan where it did nothing."""
    return weight * with_prior / (free - with_prior) if free > with_prior else float("nan")


def from_traces(name: str, trace: pd.DataFrame, labels: dict[str, float], column: str) -> list[Row]:
    """Median over trials of s; ``labels`` maps entries of ``column`` to their prior weights."""
    first = trace[trace["iteration"] == 1].pivot(index="trial", columns=column, values="prior_position_m")
    rows: list[Row] = []
    for label, weight in labels.items():
        values = [damping_weight(a, b, weight) for a, b in zip(first[label], first["free"], strict=True)]
        rows.append(
            {"experiment": name, "weight": weight, "damping_weight": float(pd.Series(values).median())}
        )
    return rows


def from_published(name: str, figure6: pd.DataFrame) -> list[Row]:
    """The same from the points of the paper's Fig. 6."""
    first = figure6.query("panel == 'position_m' and step == 1").set_index("weight")["prior_error"]
    return [
        {
            "experiment": name,
            "weight": float(weight),
            "damping_weight": damping_weight(float(error), float(first["free"]), float(weight)),
        }
        for weight, error in first.items()
        if weight != "free"
    ]


def rows(material: Material, settings: NoSettings) -> list[Row]:
    """The sweep, every result, and the paper's Fig. 6."""
    sweep = pd.read_csv(material.sweep_trace, dtype={"weight": str})
    weights = {w: float(w) for w in dict.fromkeys(sweep["weight"]) if w != FREE and float(w) > 0.0}
    out = from_traces("sweep", sweep, weights, "weight")
    for name, file in material.traces.items():
        trace = pd.read_csv(file)
        out += from_traces(name, trace[trace["noise"] == HEADLINE], {PRIOR: material.prior_weight}, "gauge")
    figure6 = pd.read_csv(material.published / "fig06_prior_error_paths.csv", dtype={"weight": str})
    return out + from_published("published fig06", figure6)


def squared_weight(e: Evidence) -> str:
    """The weights of the paper's figures multiply the residual: they act as their squares."""
    steps = e.reason("first_step")
    theirs = steps[steps["experiment"] == "published fig06"]
    if theirs.empty:
        raise NoEvidenceError("no published first steps")
    plain = theirs["damping_weight"]
    squares = plain * theirs["weight"].astype(float)
    return (
        "the paper's weights act as their squares: the prior error after one step of its Fig. 6 asks for a "
        f"damping along the orbit of {squares.min():.3g} to {squares.max():.3g} if w^P is the square of the "
        f"weight shown (the residual of (11) times w), but {plain.min():.2g} to {plain.max():.3g} "
        "if it is the weight"
    )


def _orbit_damping(e: Evidence, names: Iterable[str]) -> str:
    steps = e.reason("first_step").set_index("experiment")["damping_weight"]
    shown = ", ".join(f"{name} {steps[name]:.2g}" for name in names)
    return f"damping along the orbit, read off the first step, in units of w^P: {shown}"


def prior_against_damping(e: Evidence) -> str:
    """The prior outweighs the damping in simulation."""
    return f"the prior outweighs the {_orbit_damping(e, e.configurations)}"


def prior_against_damping_on_sequences(e: Evidence) -> str:
    """With their many landmarks the sequences damp the orbit more than the prior pulls."""
    return (
        f"with more landmarks the diagonal grows, and so does the {_orbit_damping(e, e.sequences)}; "
        f"that slows the prior. {squared_weight(e)}"
    )


EXPERIMENT = Experiment("first_step", rows)
