"""Names that results carry, wherever they are written or read."""

from __future__ import annotations

# The three approaches, in the order of the paper's legends.
GAUGES = ("fix", "free", "prior")

# RMSE of position (m), rotation (deg) and velocity (m/s).
ERRORS = ("p_rmse_m", "phi_rmse_deg", "v_rmse_mps")

# The noise model of tables and figures.
HEADLINE = "headline"

# What every result of a rendered sequence says.
STAND_IN = "rendered stand-in, not EuRoC"
