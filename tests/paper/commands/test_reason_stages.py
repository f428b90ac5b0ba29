"""Stages of the explaining experiments: what a change given as text does, and which scenes are drawn."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from support.simulated import SETTINGS, trial
from vigauge.errors import ConfigError
from vigauge.solver.levenberg_marquardt import Options
from vigauge_paper.commands.reasons_accuracy import _parsed, simulated
from vigauge_paper.commands.reasons_scenes import spreads
from vigauge_paper.experiments.free_spread import free_spread
from vigauge_paper.experiments.settings import AccuracySettings

ACCURACY = AccuracySettings(
    trials=1,
    simulation=("accel_error_x_mps2=0.2",),
    believed_density_factors=(),
    euler_rates_hz=(),
    landmarks=(),
    accel_bias_mps2=0.0,
    gyro_bias_radps=0.0,
    parts=1,
    seed=1,
)


def test_changes_joined_by_a_comma_are_all_made() -> None:
    """Catches a change that is dropped, or an accelerometer's axis taken for another."""
    settings, solver, accel = _parsed(
        "n_landmarks=77, accel_error_z_mps2=0.1, function_tolerance=1e-3", SETTINGS, Options()
    )
    assert (settings.n_landmarks, solver.function_tolerance) == (77, 1e-3)
    assert accel.tolist() == [0.0, 0.0, 0.1]
    with pytest.raises(ConfigError, match="must be a key of simulation or solver"):
        _parsed("accel_error_w_mps2=0.1", SETTINGS, Options())


def test_an_accelerometer_error_tilts_and_is_not_in_the_run_without_it() -> None:
    """Catches an error that does not reach the problem, or that all variants have."""
    table = pd.DataFrame(simulated(SETTINGS, Options(), ACCURACY))
    errors = table[table["alignment"] == "first pose"].groupby("variant")["phi_rmse_deg"].mean()
    # An error of 0.2 m/s^2 is a tilt of 1.2 degrees at rest.
    assert 0.7 < errors["accel_error_x_mps2=0.2"] < 1.8
    assert errors["as configured"] < 0.5


def test_draws_are_others_than_that_of_the_results() -> None:
    """Catches the configured scene explaining itself, and draws that are one and the same."""
    table = pd.DataFrame(spreads(SETTINGS, Options(), 2))
    drawn = table[table["experiment"] == "sine_random"]["ratio"].to_numpy()
    own = free_spread("sine_random", 0, trial(), Options())["ratio"]
    assert len(np.unique([*drawn, own])) == 3
