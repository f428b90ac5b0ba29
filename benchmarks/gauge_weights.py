"""The tables of docs/which_gauge.md: cost of the paper's three gauges, and what shipped prior weights do.

The first is read from data/expected.csv, the second is measured on one problem.

python -m benchmarks.gauge_weights    # writes both into the page
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import vigauge as vg
from vigauge.files import atomic_path
from vigauge.gauge.gauges import push_to_first_pose
from vigauge.observability.spectrum import condition_number
from vigauge.solver.normal_equations import linearise
from vigauge_paper.comparison.expected import EUROC, SIMULATION, read_expected

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "which_gauge.md"
START, END = "<!-- {}: made by `python -m benchmarks.gauge_weights` -->\n\n", "\n<!-- end -->"

# Information of the position (1/m^2), and of yaw and tilt (1/rad^2), of the first keyframe.
SHIPPED: dict[str, tuple[float, float, float]] = {
    "VINS-Mono": (0.0, 0.0, 0.0),
    "Meta VIBA": (1e6, 1e6, 0.0),
    "OKVIS2": (1e8, 1e2, 0.0),
    "OKVIS at first": (1e8, 1e8, 0.0),
    "Basalt": (1e8, 1e8, 0.0),
    "Kimera-VIO": (1e10, 3.3e5, 33.0),
    "OpenVINS": (1e10, 1e10, 0.0),
    "OKVIS later": (1e14, 1e14, 0.0),
    "OpenVINS MLE test": (1e16, 1e16, 0.0),
    "COLMAP": (math.inf, math.inf, 0.0),
}


@dataclass(frozen=True)
class FirstPosePrior(vg.FreeGauge):
    """A prior on the first pose with a weight of its own for position, yaw and tilt."""

    position: float = 0.0
    yaw: float = 0.0
    tilt: float = 0.0

    def prior(self, state: vg.State, reference: vg.State) -> vg.LinearFactor:
        columns = np.r_[:3, 3 * state.n_keyframes + np.arange(3)]
        weights = np.sqrt([self.position] * 3 + [self.tilt, self.tilt, self.yaw])
        error = np.r_[state.p_W[0] - reference.p_W[0], state.dphi_0]
        used = weights > 0.0
        return vg.LinearFactor(columns, weights[used] * error[used], np.diag(weights)[used], total=True)


def measured(position: float, yaw: float, tilt: float) -> dict[str, float]:
    """Row of one set of weights; the estimate and the covariance are compared with those of fixation."""
    problem, options, fixation = vg.example_problem(), vg.Options(function_tolerance=1e-14), vg.FixedGauge()
    fixed = vg.solve(problem, fixation, options).state
    gauge: vg.Gauge = FirstPosePrior(position=position, yaw=yaw, tilt=tilt)
    if not position or math.isinf(position):
        gauge = fixation if position else vg.FreeGauge()
    state = vg.solve(problem, gauge, options).state
    if not position:  # what VINS-Mono does by hand
        state = push_to_first_pose(state, problem.initial)[0]
    covariance, prior = vg.Covariance.of(problem, state), gauge.prior(state, problem.initial)
    condition = covariance.spectrum(gauge.held(state)).condition
    S = np.delete(np.delete(covariance.reduced.matrix, gauge.held(state), 0), gauge.held(state), 1)
    by_inverse = projected = math.nan
    if prior is not None:
        equations = linearise(problem, state).with_factor(prior)
        condition, S = condition_number(equations), equations.eliminate().matrix
        C, expected = np.linalg.inv(S), covariance.motion(fixation)
        U, V = covariance.U[: len(C)], fixation.normal(state)[: len(C)]
        by_inverse = vg.relative_frobenius(C, expected)
        projected = vg.relative_frobenius(vg.project_covariance(C, U, V), expected)
    return {
        "iterations": vg.solve(problem, gauge).iterations,
        "condition": condition,
        "unscaled": float(np.linalg.cond(S)) if math.isfinite(condition) else math.inf,
        "estimate": float(np.linalg.norm(state.p_W - fixed.p_W) / np.linalg.norm(fixed.p_W - fixed.p_W[0])),
        "covariance": by_inverse,
        "projected": projected,
    }


def cost_table() -> str:
    """Mean iterations, and time over fixation's, of Figs. 7 and 11, from the expected values."""
    values = {value.key: value.value for value in read_expected(ROOT / "data" / "expected.csv")}
    lines: dict[str, list[str]] = {}
    for artefact, source, row, quantity in values:
        if (artefact, source) in (("fig07", SIMULATION), ("fig11", EUROC)) and quantity == "iterations mean":
            problem, gauge = row.split()
            iterations = values[artefact, source, row, quantity]
            time = values.get((artefact, source, row, "time over fixation's"), 1.0)
            cells = lines.setdefault(problem, [problem, "", "", ""])
            cells[1 + ["fix", "prior", "free"].index(gauge)] = f"{iterations:.2f} / {time:.2f}"
    return _markdown(["problem", "fixed", "prior", "free"], lines.values())


def weight_table() -> str:
    """The measurements as Markdown: two digits, which is what another machine gives again."""
    found = {name: measured(*weights) for name, weights in SHIPPED.items()}
    lines = (
        [name, *("-" if math.isnan(value) else f"{value:.2g}" for value in row.values())]
        for name, row in found.items()
    )
    return _markdown(["system", *found["COLMAP"]], lines)


def _markdown(head: list[str], lines: Iterable[list[str]]) -> str:
    return "".join(f"| {' | '.join(line)} |\n" for line in [head, ["---"] * len(head), *lines])


def shown(name: str, page: str) -> str:
    """The table that stands in the page under this name."""
    return page.split(START.format(name))[1].split(END)[0]


if __name__ == "__main__":
    page = PAGE.read_text("utf-8")
    for name, table in (("cost", cost_table), ("weights", weight_table)):
        before, rest = page.split(START.format(name))
        page = f"{before}{START.format(name)}{table()}{END}{rest.split(END, 1)[1]}"
    with atomic_path(PAGE) as temporary:
        temporary.write_text(page, "utf-8")
