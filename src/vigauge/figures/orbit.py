"""Figures 2 and 8, computed: the paths of the three approaches, and the transformation (12), in the chart.

Polar drawing: the angle is the yaw along the orbit, exaggerated; the radius grows with the
distance from the orbit, as sqrt(s). Shades are the logarithm of the true cost.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from ..files import write_rows
from ..levenberg_marquardt import Solution
from ..so3 import Array
from .chart import Chart, carry_perturbation
from .style import COLOURS, COLUMN, LABELS, MARKERS, new_figure, save_figure

# Radius of the orbit on paper, and angle (rad on paper) of the larger of the yaws shown.
_ORBIT_RADIUS = 1.6
_SHOWN_ANGLE = 0.6


def _place(alpha: Array, s: Array, stretch: float) -> tuple[Array, Array]:
    """Position on paper: top is alpha = 0, positive yaw to the left."""
    radius = _ORBIT_RADIUS + np.sign(s) * np.sqrt(np.abs(s))
    angle = np.pi / 2 + stretch * np.asarray(alpha)
    return radius * np.cos(angle), radius * np.sin(angle)


def _background(axes: Axes, chart: Chart, half_width: float) -> list[dict[str, object]]:
    """Shade the chart by the cost; returns what was evaluated."""
    r = np.linspace(-0.9, 1.15, 42)
    s = np.sign(r) * r**2
    costs = np.array([chart.cost(float(value)) for value in s])
    angle = np.linspace(-half_width, half_width, 61) + np.pi / 2
    x, y = ((_ORBIT_RADIUS + r)[:, None] * trig(angle) for trig in (np.cos, np.sin))
    shade = np.log10(costs)[:, None] * np.ones_like(angle)
    axes.contourf(x, y, shade, levels=18, cmap="OrRd", zorder=0)
    return [
        {"kind": "cost", "curve": "", "alpha_rad": 0.0, "s": float(a), "cost": float(c)}
        for a, c in zip(s, costs, strict=True)
    ]


def _curve(
    kind: str, name: str, alpha: Array, s: Array, costs: Array | None = None
) -> list[dict[str, object]]:
    values = np.full(len(s), np.nan) if costs is None else costs
    return [
        {
            "kind": kind,
            "curve": name,
            "alpha_rad": float(a),
            "s": float(b),
            "cost": "" if np.isnan(c) else float(c),
        }
        for a, b, c in zip(alpha, s, values, strict=True)
    ]


def _gauge_curve(chart: Chart, low: float, high: float) -> tuple[Array, Array]:
    r = np.linspace(low, high, 41)
    s = np.sign(r) * r**2
    return np.array([chart.gauge_yaw(float(value)) for value in s]), s


def draw_paths(chart: Chart, solutions: Mapping[str, Solution], stem: Path, prior_weight: float) -> None:
    """Figure 2: iterates of the three approaches from one start."""
    located = {
        gauge: np.array([chart.locate(state) for state in solution.states])
        for gauge, solution in solutions.items()
    }
    gauge_alpha, gauge_s = _gauge_curve(chart, -0.8, 1.1)
    widest = max(abs(gauge_alpha).max(), *(abs(path[:, 0]).max() for path in located.values()))
    stretch = _SHOWN_ANGLE / widest
    with new_figure(COLUMN, 2.9) as (figure, axes):
        rows = _background(axes, chart, 1.25 * _SHOWN_ANGLE)
        orbit = np.linspace(-1.25 * _SHOWN_ANGLE, 1.25 * _SHOWN_ANGLE, 61) / stretch
        axes.plot(*_place(orbit, np.zeros_like(orbit), stretch), color="black", linewidth=1.0)
        axes.plot(*_place(gauge_alpha, gauge_s, stretch), "--", color=COLOURS["fix"], linewidth=0.9)
        for gauge in ("free", "prior", "fix"):
            alpha, s = located[gauge].T
            label = LABELS[gauge] + (f" ($w^P$ = {prior_weight:g})" if gauge == "prior" else "")
            axes.plot(*_place(alpha, s, stretch), color=COLOURS[gauge], marker=MARKERS[gauge], label=label)
            costs = np.array([row.cost for row in solutions[gauge].trace])
            rows += _curve("iterate", gauge, alpha, s, costs)
        axes.plot(
            *_place(np.array([chart.start_yaw]), np.array([1.0]), stretch),
            "*",
            color="black",
            markersize=9,
            label="Start",
        )
        _label(axes, "Orbit of\nminimum cost", orbit[-12], 0.0, stretch, (-16, -24))
        _label(axes, r"Gauge $\mathcal{C}$", gauge_alpha[2], gauge_s[2], stretch, (4, 0))
        axes.set_title(
            f"angle = {stretch:.0f} x yaw,  radius - {_ORBIT_RADIUS} = " + r"$\sqrt{s}$", fontsize=6.5
        )
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.01), ncols=4, fontsize=6, columnspacing=0.9)
        _frame(axes)
        rows += _curve("gauge", "fix", gauge_alpha, gauge_s)
        save_figure(figure, stem)
    write_rows(f"{stem}.csv", rows)


def draw_transformation(chart: Chart, stem: Path) -> None:
    """Figure 8: a perturbation at the free estimate, carried along the orbit, projected onto the gauge."""
    _, yaw = _meeting(chart)
    gauge_alpha, gauge_s = _gauge_curve(chart, -0.5, 0.75)
    stretch = _SHOWN_ANGLE / max(abs(yaw), abs(gauge_alpha).max())
    moved = carry_perturbation(chart, a=0.35 * abs(yaw), b=0.2)
    with new_figure(COLUMN, 2.5) as (figure, axes):
        orbit = np.linspace(-0.45, 1.6, 61) * yaw
        axes.plot(*_place(orbit, np.zeros_like(orbit), stretch), color=COLOURS["fix"])
        axes.plot(*_place(gauge_alpha, gauge_s, stretch), color=COLOURS["free"])
        arrows = (
            (0.0, moved.at_estimate, r"$\Delta\theta$", "black", (-6, 4)),
            (yaw, moved.carried, r"$\frac{\partial\theta_C}{\partial\theta}\Delta\theta$", "black", (-26, 3)),
            (
                yaw,
                moved.projected,
                r"$\Delta\theta_C = Q\,\frac{\partial\theta_C}{\partial\theta}\Delta\theta$",
                COLOURS["free"],
                (6, -4),
            ),
        )
        ends = []
        for base, (d_alpha, d_s), label, colour, offset in arrows:
            foot = np.array(_place(np.array(base), np.array(0.0), stretch))
            tip = foot + _tangent_vector(base, d_alpha, d_s, stretch)
            ends.append(tip)
            axes.annotate("", tip, foot, arrowprops={"arrowstyle": "-|>", "color": colour, "linewidth": 1.1})
            axes.annotate(label, tip, offset, textcoords="offset points", color=colour, fontsize=7)
        axes.plot(*np.transpose(ends[1:]), ":", color="black", linewidth=0.8)
        for base, label, offset in ((0.0, r"$\theta$", (-2, -11)), (yaw, r"$\theta_C$", (-14, -8))):
            _label(axes, label, base, 0.0, stretch, offset)
        _label(axes, r"orbit $\mathcal{M}_\theta$", orbit[-6], 0.0, stretch, (-34, -8))
        _label(axes, r"gauge $\mathcal{C}$", gauge_alpha[0], gauge_s[0], stretch, (6, 0))
        axes.set_title(
            f"tangent vectors; angle = {stretch:.0f} x yaw ({np.degrees(yaw):.2f} deg)", fontsize=6.5
        )
        _frame(axes)
        save_figure(figure, stem)
    rows = _curve("gauge", "C", gauge_alpha, gauge_s)
    for kind in ("at_estimate", "carried", "projected"):
        d_alpha, d_s = getattr(moved, kind)
        rows += _curve("vector", kind, np.array([d_alpha]), np.array([d_s]))
    rows += _curve("point", "theta_C", np.array([yaw]), np.zeros(1))
    write_rows(f"{stem}.csv", rows)


def _meeting(chart: Chart) -> tuple[float, float]:
    return 0.0, chart.gauge_yaw(0.0)


def _tangent_vector(alpha: float, d_alpha: float, d_s: float, stretch: float) -> Array:
    """A tangent vector on paper: along the arc by stretch * d_alpha, outwards by d_s, at the orbit."""
    angle = np.pi / 2 + stretch * alpha
    along = _ORBIT_RADIUS * stretch * d_alpha * np.array([-np.sin(angle), np.cos(angle)])
    return along + 2.0 * d_s * np.array([np.cos(angle), np.sin(angle)])


def _label(
    axes: Axes, text: str, alpha: float, s: float, stretch: float, offset: tuple[float, float]
) -> None:
    axes.annotate(
        text, _place(np.array(alpha), np.array(s), stretch), offset, textcoords="offset points", fontsize=7
    )


def _frame(axes: Axes) -> None:
    axes.set_aspect("equal")
    axes.set_xticks([])
    axes.set_yticks([])
