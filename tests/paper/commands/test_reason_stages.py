"""Stages of the explaining experiments: which scenes are drawn."""

from __future__ import annotations

import numpy as np
import pandas as pd

from support.simulated import SETTINGS, trial
from vigauge.solver.levenberg_marquardt import Options
from vigauge_paper.commands.free_spread import spreads
from vigauge_paper.experiments.free_spread import free_spread


def test_draws_are_others_than_that_of_the_results() -> None:
    """Catches the configured scene explaining itself, and draws that are one and the same."""
    table = pd.DataFrame(spreads(SETTINGS, Options(), 2))
    drawn = table[table["experiment"] == "sine_random"]["ratio"].to_numpy()
    own = free_spread("sine_random", 0, trial(), Options())["ratio"]
    assert len(np.unique([*drawn, own])) == 3
