"""What the prior weights that other systems ship do to one problem: the table of docs/which_gauge.md.

python -m benchmarks.gauge_weights    # measures, and writes the table into the page
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import vigauge as vg
from vigauge.files import atomic_path
from vigauge.gauge.gauges import push_to_first_pose
from vigauge.observability.spectrum import condition_number
from vigauge.solver.normal_equations import linearise

PAGE = Path(__file__).parents[1] / "docs" / "which_gauge.md"
START, END = "<!-- made by `python -m benchmarks.gauge_weights` -->\n\n", "\n<!-- end -->"

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


def table() -> str:
    """The measurements as Markdown: two digits, which is what another machine gives again."""
    found = {name: measured(*weights) for name, weights in SHIPPED.items()}
    head = ["system", *found["COLMAP"]]
    lines = [head, ["---"] * len(head)]
    for name, row in found.items():
        lines.append([name, *("-" if math.isnan(value) else f"{value:.2g}" for value in row.values())])
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


if __name__ == "__main__":
    before, rest = PAGE.read_text("utf-8").split(START)
    with atomic_path(PAGE) as temporary:
        temporary.write_text(f"{before}{START}{table()}{END}{rest.split(END)[1]}", "utf-8")
