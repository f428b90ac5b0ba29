"""Figures 2 and 8, computed: the paths of the three approaches, and the transformation (12), in the chart.

Polar drawing: the angle is the yaw along the orbit, exaggerated; the radius grows with the
distance s from the orbit. Figure 2 shows sqrt(s), so that both the start and the last
iterates are seen; Figure 8 shows s itself, as it shows tangents.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import Normal, Stroke
from matplotlib.ticker import MaxNLocator

from vigauge.files import write_rows
from vigauge.geometry.so3 import Array
from vigauge.solver.levenberg_marquardt import Solution

from ..ids import FIX, FREE, PRIOR
from .chart import CarriedPerturbation, Chart, carry_perturbation
from .style import COLOURS, COLUMN, LABELS, MARKERS, new_figure, save_figure

Rows = list[dict[str, object]]
Offset = tuple[float, float]

# Radius of the orbit on paper; where the drawings end, from the centre of the orbit.
_ORBIT_RADIUS = 1.6
_PATHS_WINDOW = (-1.25, 1.25, 0.72, 2.72)
# Angles (rad on paper) of the widest yaw of Figure 2, and between the two points of Figure 8.
_PATHS_ANGLE = 0.55
_POINTS_ANGLE = 0.8
# Figure 2: angle of the scale of s, and length on paper from which a step has an arrow.
_SCALE_ANGLE = 0.42
_STEP_WITH_ARROW = 0.25
# Where the arrows of paths that run together lie, so that none hides another.
_ARROW_AT = {PRIOR: 0.4, FIX: 0.55, FREE: 0.65}
# Figure 8: length on paper of s = 1, and the perturbation in shares of the yaw and of d.
_UNIT_LENGTH = 2.6
_PERTURBATION = (-0.35, 0.22)
# Room on paper for the longest label, to the right of its vector.
_FORMULA_WIDTH = 0.5
_OUTLINE = [Stroke(linewidth=2.4, foreground="white"), Normal()]


@dataclass(frozen=True)
class _Paper:
    """Where points of the chart lie on paper: alpha = 0 at the top of the orbit.

    ``stretch`` rad on paper for one rad of yaw, negative to mirror; ``compressed`` for a
    radius that grows with sqrt(s) instead of s.
    """

    stretch: float
    compressed: bool

    def height(self, s: Array) -> Array:
        """Distance from the orbit on paper."""
        return np.sign(s) * np.sqrt(np.abs(s)) if self.compressed else _UNIT_LENGTH * np.asarray(s)

    def place(self, alpha: Array | float, s: Array | float) -> Array:
        """(2, ...) position on paper."""
        radius = _ORBIT_RADIUS + self.height(np.asarray(s, dtype=float))
        angle = np.pi / 2 + self.stretch * np.asarray(alpha, dtype=float)
        return np.array([radius * np.cos(angle), radius * np.sin(angle)])

    def vector(self, alpha: float, d_alpha: float, d_s: float) -> Array:
        """(2,) tangent vector (d_alpha, d_s) at the orbit's point alpha; for a radius linear in s."""
        angle = np.pi / 2 + self.stretch * alpha
        across = np.array([np.cos(angle), np.sin(angle)])
        along = np.array([-np.sin(angle), np.cos(angle)])
        return _ORBIT_RADIUS * self.stretch * d_alpha * along + _UNIT_LENGTH * d_s * across


def draw_paths(chart: Chart, solutions: Mapping[str, Solution], stem: Path, prior_weight: float) -> None:
    """Figure 2: iterates of the three approaches from one start, over the true cost."""
    located = {
        gauge: np.array([chart.locate(state) for state in solution.states])
        for gauge, solution in solutions.items()
    }
    gauge_alpha, gauge_s = _gauge_curve(chart, np.linspace(-0.85, 1.12, 60), compressed=True)
    shown = gauge_s > -0.3
    widest = max(abs(gauge_alpha[shown]).max(), *(abs(path[:, 0]).max() for path in located.values()))
    # Mirrored where needed, so that the gauge meets the orbit on the left, as in the paper.
    paper = _Paper(np.copysign(_PATHS_ANGLE / widest, chart.gauge_yaw(0.0)), compressed=True)
    with new_figure(COLUMN, 2.85) as (figure, axes):
        rows = _background(figure, axes, chart)
        orbit = np.linspace(-1.2, 1.2, 121) / paper.stretch
        axes.plot(*paper.place(orbit, 0.0), color="black", linewidth=1.0)
        axes.plot(*paper.place(gauge_alpha, gauge_s), "--", color=COLOURS["fix"], linewidth=1.0)
        _scales(axes, paper)
        for gauge in (PRIOR, FIX, FREE):
            alpha, s = located[gauge].T
            label = LABELS[gauge] + (f" ($w^P$ = {prior_weight:g})" if gauge == "prior" else "")
            label += "" if solutions[gauge].converged else f" ({solutions[gauge].status})"
            axes.plot(
                *paper.place(alpha, s),
                color=COLOURS[gauge],
                marker=MARKERS[gauge],
                markeredgecolor="white",
                markeredgewidth=0.4,
                markersize=4.5,
                label=label,
                path_effects=_OUTLINE,
            )
            _directions(axes, paper.place(alpha, s), COLOURS[gauge], _ARROW_AT[gauge])
            costs = np.array([row.cost for row in solutions[gauge].trace])
            rows += _curve("iterate", gauge, alpha, s, costs)
        start = paper.place(chart.start_yaw, 1.0)
        axes.plot(*start, "*", color="black", markeredgecolor="white", markersize=10, label="Start")
        beside = int(np.searchsorted(gauge_s, -0.35))
        axes.text(0.0, 1.26, r"orbit of minimum cost $\mathcal{M}_\theta$", fontsize=7, ha="center")
        _label(axes, r"gauge $\mathcal{C}$", paper.place(gauge_alpha[beside], gauge_s[beside]), (5, -5))
        left, right, bottom, top = _PATHS_WINDOW
        axes.set(xlim=(left, right), ylim=(bottom, top))
        axes.set_xlabel(f"yaw along the orbit, drawn {abs(paper.stretch):.0f} times as wide")
        axes.set_ylabel(r"distance $s$ from the orbit, drawn as $\sqrt{s}$")
        legend = axes.legend(
            loc="upper center", bbox_to_anchor=(0.55, -0.08), ncols=4, columnspacing=0.7, handlelength=1.4
        )
        for handle in legend.get_lines():
            handle.set_path_effects([])
        _frame(axes)
        save_figure(figure, stem)
    rows += _curve("gauge", "C", gauge_alpha, gauge_s)
    write_rows(f"{stem}.csv", rows)


def _scales(axes: Axes, paper: _Paper) -> None:
    """Marks of the yaw along the orbit, in degrees, and of s across it."""
    for degrees in range(-6, 7, 2):
        alpha = np.radians(degrees)
        if abs(paper.stretch * alpha) < 0.75:
            foot = paper.place(alpha, 0.0)
            axes.plot(*np.transpose([foot, 0.97 * foot]), color="black", linewidth=0.8)
            axes.text(*(0.91 * foot), rf"${degrees}\degree$", fontsize=6.5, ha="center", va="center")
    alpha = -_SCALE_ANGLE / paper.stretch
    axes.plot(*paper.place(np.full(2, alpha), np.array([0.0, 1.0])), color="black", linewidth=0.8)
    for s in (0.1, 0.3, 1.0):
        place = paper.place(alpha, s)
        axes.plot(*place, "k_", markersize=5)
        _label(axes, f"$s$ = {s:g}", place, (-31, -2), size=6.5)


def _directions(axes: Axes, path: Array, colour: str, share: float) -> None:
    """An arrow in each step that is long enough for one, at a share of its length."""
    for foot, tip in pairwise(path.T):
        if np.linalg.norm(tip - foot) > _STEP_WITH_ARROW:
            _arrow(axes, foot + (share - 0.1) * (tip - foot), foot + share * (tip - foot), colour, 1.4)


def _background(figure: Figure, axes: Axes, chart: Chart) -> Rows:
    """Shade the window by the cost, with its isolines and a scale; returns what was evaluated."""
    left, right, bottom, top = _PATHS_WINDOW
    x, y = np.meshgrid(np.linspace(left, right, 160), np.linspace(bottom, top, 160))
    height = np.hypot(x, y) - _ORBIT_RADIUS
    # The cost is the same along the orbit: a profile across it fills the window.
    profile = np.linspace(height.min(), height.max(), 61)
    s = np.sign(profile) * profile**2
    costs = np.array([chart.cost(float(value)) for value in s])
    shade = np.interp(height, profile, np.log10(costs))
    shades = axes.contourf(x, y, shade, levels=24, cmap="OrRd", zorder=0)
    bar = figure.colorbar(shades, ax=axes, fraction=0.035, pad=0.02, ticks=MaxNLocator(integer=True))
    bar.set_label(r"cost of Eq. (1), $\log_{10}$")
    axes.contour(x, y, shade, levels=24, colors="white", linewidths=0.3, linestyles="--", zorder=0)
    return _curve("cost", "", np.zeros_like(s), s, costs)


def draw_transformation(chart: Chart, stem: Path) -> None:
    """Figure 8: a perturbation at the free estimate, carried along the orbit, projected onto the gauge."""
    yaw = chart.gauge_yaw(0.0)
    gauge_alpha, gauge_s = _gauge_curve(chart, np.linspace(-0.2, 0.32, 41), compressed=False)
    # Mirrored where needed, so that the way along the orbit leads to the right, as in the paper.
    paper = _Paper(-_POINTS_ANGLE / yaw, compressed=False)
    moved = carry_perturbation(chart, a=_PERTURBATION[0] * yaw, b=_PERTURBATION[1])
    with new_figure(COLUMN, 2.35) as (figure, axes):
        orbit = np.linspace(-0.45, 1.45, 121) * yaw
        axes.plot(*paper.place(orbit, 0.0), color="black")
        axes.plot(*paper.place(gauge_alpha, gauge_s), color=COLOURS["fix"])
        _tangents(axes, paper, yaw, moved)
        _vectors(axes, paper, yaw, moved)
        _label(axes, r"$\theta$", paper.place(0.0, 0.0), (1, -11))
        _label(axes, r"$\theta_C$", paper.place(yaw, 0.0), (-14, -8))
        _label(axes, r"orbit $\mathcal{M}_\theta$", paper.place(orbit[-1], 0.0), (-36, 0))
        _label(
            axes, r"gauge $\mathcal{C}$", paper.place(gauge_alpha[0], gauge_s[0]), (-32, 3), COLOURS["fix"]
        )
        axes.text(
            0.02,
            0.03,
            rf"angle: yaw $\times$ {abs(paper.stretch):.0f}"
            "\n"
            rf"(from $\theta$ to $\theta_C$: ${np.degrees(yaw):.2f}\degree$)"
            "\nheight: $s$",
            fontsize=7,
            transform=axes.transAxes,
        )
        axes.margins(x=0.08, y=0.1)
        axes.set_xlim(right=axes.get_xlim()[1] + _FORMULA_WIDTH)
        _frame(axes)
        save_figure(figure, stem)
    rows = _curve("gauge", "C", gauge_alpha, gauge_s)
    for kind in ("at_estimate", "carried", "projected"):
        d_alpha, d_s = getattr(moved, kind)
        rows += _curve("vector", kind, np.array([d_alpha]), np.array([d_s]))
    rows += _curve("point", "theta_C", np.array([yaw]), np.zeros(1))
    write_rows(f"{stem}.csv", rows)


def _tangents(axes: Axes, paper: _Paper, yaw: float, moved: CarriedPerturbation) -> None:
    """Tangents of the orbit at both points, and of the gauge, which the projected vector spans."""
    reach = 0.3 * yaw
    for alpha, label, offset in (
        (0.0, r"$T_\theta(\mathcal{M}_\theta)$", (-22.0, 4.0)),
        (yaw, r"$T_{\theta_C}(\mathcal{M}_\theta)$", (4.0, -2.0)),
    ):
        foot, along = paper.place(alpha, 0.0), paper.vector(alpha, reach, 0.0)
        axes.plot(*np.transpose([foot - along, foot + along]), "--", color="black", linewidth=0.8)
        end = foot - along if alpha == 0.0 else foot + along
        _label(axes, label, end, offset)
    foot, along = paper.place(yaw, 0.0), paper.vector(yaw, *moved.projected)
    axes.plot(*np.transpose([foot - along, foot + 1.35 * along]), "-.", color=COLOURS["fix"], linewidth=0.8)
    _label(axes, r"$T_{\theta_C}(\mathcal{C})$", foot + 1.35 * along, (4, 5), COLOURS["fix"])


def _vectors(axes: Axes, paper: _Paper, yaw: float, moved: CarriedPerturbation) -> None:
    """The perturbation at the estimate, carried, and projected, with the ways between them."""
    at_estimate = paper.place(0.0, 0.0) + paper.vector(0.0, *moved.at_estimate)
    carried = paper.place(yaw, 0.0) + paper.vector(yaw, *moved.carried)
    projected = paper.place(yaw, 0.0) + paper.vector(yaw, *moved.projected)
    for alpha, tip in ((0.0, at_estimate), (yaw, carried), (yaw, projected)):
        _arrow(axes, paper.place(alpha, 0.0), tip, "black", 1.1)
        axes.plot(*paper.place(alpha, 0.0), "o", color=COLOURS["fix" if alpha else "free"])
    _arrow(axes, carried, projected, "0.5", 0.9)
    # Carried along the orbit: a turn on paper about the orbit's centre.
    turn = np.linspace(0.03, 0.97, 41) * paper.stretch * yaw
    sweep = np.array([np.cos(turn) * at_estimate[0] - np.sin(turn) * at_estimate[1],
                      np.sin(turn) * at_estimate[0] + np.cos(turn) * at_estimate[1]])  # fmt: skip
    axes.plot(*sweep[:, :-1], color="0.5", linewidth=0.9)
    _arrow(axes, sweep[:, -3], sweep[:, -1], "0.5", 0.9)
    half = paper.place(0.5 * yaw, 0.0)
    _arrow(axes, paper.place(0.46 * yaw, 0.0), paper.place(0.52 * yaw, 0.0), "black", 1.0)
    _label(axes, r"$g$", half, (-2, -11))
    _label(axes, r"$\Delta\theta$", at_estimate, (-10, 4))
    _label(axes, r"$\frac{\partial\theta_C}{\partial\theta}$", sweep[:, 20], (-4, 5), size=9)
    _label(axes, r"$Q$", 0.5 * (carried + projected), (-2, 5))
    _label(
        axes,
        r"$\Delta\theta_C = Q\,\frac{\partial\theta_C}{\partial\theta}\,\Delta\theta$",
        projected,
        (7, -8),
    )


def _gauge_curve(chart: Chart, height: Array, compressed: bool) -> tuple[Array, Array]:
    """The gauge C in the chart: its yaw at every s."""
    s = np.sign(height) * height**2 if compressed else height
    return np.array([chart.gauge_yaw(float(value)) for value in s]), s


def _curve(kind: str, name: str, alpha: Array, s: Array, costs: Array | None = None) -> Rows:
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


def _arrow(axes: Axes, foot: Array, tip: Array, colour: str, width: float) -> None:
    style = {"arrowstyle": "-|>", "color": colour, "linewidth": width, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", tip, foot, arrowprops=style)


def _label(axes: Axes, text: str, at: Array, offset: Offset, colour: str = "black", size: float = 7) -> None:
    axes.annotate(
        text,
        tuple(at),
        offset,
        textcoords="offset points",
        fontsize=size,
        color=colour,
        path_effects=[Stroke(linewidth=1.6, foreground="white"), Normal()],
    )


def _frame(axes: Axes) -> None:
    axes.set_aspect("equal")
    axes.set_xticks([])
    axes.set_yticks([])
