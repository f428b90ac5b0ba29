"""What a prior's weight multiplies, read off the first step of the runs of Fig. 6.

Along the orbit the cost is flat, so the first step is cut by the prior alone. With damping s and the
information W of the prior, a share r = s / (s + W) is left of the free gauge's way: 1 / r - 1 = W / s.
Over the weights w its slope on logarithmic axes is 1 if W = w, and 2 if W = w^2, whatever the scene is.
"""

import numpy as np
import pandas as pd

from ..ids import FREE, Row
from ..prior import READINGS
from .evidence import Evidence, NoEvidenceError
from .experiment import Experiment, Material, NoSettings

PAPER = "paper"
QUANTITIES = {"position_m": "prior_position_m", "yaw_rad": "prior_yaw_rad"}
_COLUMNS = ["source", "quantity", "weight", "pull"]


def pulls(source: str, quantity: str, errors: pd.Series) -> list[Row]:
    """1 / r - 1 of every weight, from the prior errors after the first step by weight and of the free gauge.

    Weights that leave the free gauge's way as it is, or nothing of it, show no pull.
    """
    rows: list[Row] = []
    for weight, error in errors.drop(FREE).items():
        if 0.0 < error < errors[FREE]:
            pull = float(errors[FREE] / error - 1.0)
            rows.append({"source": source, "quantity": quantity, "weight": float(str(weight)), "pull": pull})
    return rows


def rows(material: Material, settings: NoSettings) -> list[Row]:
    """The paper's Fig. 6, and ours under both readings: medians over trials."""
    figure6 = pd.read_csv(material.published / "fig06_prior_error_paths.csv", dtype={"weight": str})
    sweep = pd.read_csv(material.sweep_trace[material.sweep_configuration], dtype={"weight": str})
    trace = sweep.query("iteration == 1")
    out: list[Row] = []
    for panel, column in QUANTITIES.items():
        first = figure6[(figure6["panel"] == panel) & (figure6["step"] == 1)]
        out += pulls(PAPER, panel, first.set_index("weight")["prior_error"])
        for reading in READINGS:
            ours = trace[trace["reading"] == reading].groupby("weight")[column].median()
            out += pulls(reading, panel, ours)
    return [{name: row[name] for name in _COLUMNS} for row in out]


def slopes(table: pd.DataFrame) -> pd.Series:
    """Slope of log(1 / r - 1) over log w, by source and quantity; none for fewer than two weights."""
    if (table["source"] == PAPER).sum() < 2:
        raise NoEvidenceError("fewer than two published first steps")
    kinds = ["source", "quantity"]
    return (
        table.groupby(kinds)
        .filter(lambda part: len(part) > 1)
        .groupby(kinds)[["weight", "pull"]]
        .apply(lambda part: float(np.polyfit(np.log(part["weight"]), np.log(part["pull"]), 1)[0]))
    )


def sentence(e: Evidence) -> str:
    """The slope of the paper's figure beside ours."""
    found = slopes(e.reason("reading").astype({"weight": float}))
    position, yaw = (found[PAPER, quantity] for quantity in QUANTITIES)
    return (
        "In the paper's Fig. 6 the weight multiplies the residual: the first step's prior error falls with "
        f"its square (slope {position:.2f} for position, {yaw:.2f} for yaw)."
    )


EXPERIMENT = Experiment("reading", rows, reads=("sweep_trace",))
