"""Where the keyframes may be: ellipsoids of three sigmas in two gauges, as a picture.

Needs Matplotlib. Other viewers take the same numbers; for Rerun:
rr.Ellipsoids3D(centers=p, half_sizes=found.semi_axes, quaternions=found.quaternions).
"""

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import vigauge as vg

problem = vg.example_problem()
state = vg.solve(problem, vg.FreeGauge()).state
covariance = vg.Covariance.of(problem, state)

figure, panels = plt.subplots(1, 2, subplot_kw={"projection": "3d"})
for axes, gauge in zip(panels, (vg.FixedGauge(), vg.CentroidGauge()), strict=True):
    found = vg.ellipsoids(covariance.keyframes(gauge), k=3.0)
    for x, y, z in found.surfaces(state.p_W):
        axes.plot_surface(x, y, z)
    axes.set_title(gauge.name)
    axes.set_aspect("equal")
    volumes = 4 / 3 * np.pi * found.semi_axes.prod(axis=1)
    longest = found.semi_axes[:, 0].round(4)
    print(f"{gauge.name}: longest semi-axis of first and last {longest[0]} {longest[-1]} m")
    print(f"mean volume {volumes.mean():.2e} m^3")
figure.savefig("ellipsoids.png")
