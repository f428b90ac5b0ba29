"""Names that results carry, wherever they are written or read: here only, and looked up by name."""

# A row of a table, by column.
Row = dict[str, object]

# The three approaches, in the order of the paper's legends, and those that are compared with fixation.
FIX, FREE, PRIOR = "fix", "free", "prior"
GAUGES = (FIX, FREE, PRIOR)
NOT_FIXED = (FREE, PRIOR)
# The prior whose weight is its information, as the paper's text says; its figures say otherwise.
PRIOR_AS_PRINTED = "prior_as_printed"
# Fixation once more, timed only: its ratio to the first shows how small an effect the times can tell.
FIX_AGAIN = "fix_again"

# The simulated configurations by name: trajectory and points (Section IV-A).
TRAJECTORIES = ("sine", "arc", "rec")
PLANE, RANDOM = "plane", "random"
POINTS = (PLANE, RANDOM)
CONFIGURATIONS = {
    f"{trajectory}_{points}": (trajectory, points) for points in POINTS for trajectory in TRAJECTORIES
}
# Left to right in Fig. 7.
FIGURE7_ORDER = tuple(f"{trajectory}_{points}" for points in (RANDOM, PLANE) for trajectory in TRAJECTORIES)

# Tables of the paper by key: their captions.
TABLES = {"table1": "Table I", "table2": "Table II", "table3": "Table III"}

# RMSE of position (m), rotation (deg) and velocity (m/s).
ERRORS = ("p_rmse_m", "phi_rmse_deg", "v_rmse_mps")
# And of the biases, where they are estimated and not known as in the paper.
BIAS_ERRORS = ("gyro_bias_rmse_radps", "accel_bias_rmse_mps2")
KNOWN, ESTIMATED = "known", "estimated"

# The noise model of tables and figures.
HEADLINE = "headline"

# What every result of a rendered sequence says.
STAND_IN = "rendered stand-in, not EuRoC"
