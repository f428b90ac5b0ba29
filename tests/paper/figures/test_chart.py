"""The chart of Figures 2 and 8, and the operators of (12) in it, against the dense matrices."""

import numpy as np
import pytest

from support.simulated import estimate, trial
from vigauge.covariance.projection import oblique_projector
from vigauge.gauge.gauges import FixedGauge
from vigauge.gauge.group import orbit_tangent
from vigauge.model.state import State
from vigauge_paper.figures.chart import Chart, carry_perturbation

TURN = 0.3


@pytest.fixture(scope="module")
def chart() -> Chart:
    return Chart.around(trial(), estimate())


def same(a: State, b: State) -> bool:
    return all(np.allclose(getattr(a, f), getattr(b, f), atol=1e-9) for f in ("p_W", "R_WB", "v_W", "X_W"))


@pytest.mark.parametrize("s", [-0.3, 0.0, 1.0])
@pytest.mark.parametrize("alpha", [-1.0, 0.02, 3.0])
def test_cost_is_constant_along_the_orbit(chart: Chart, alpha: float, s: float) -> None:
    """Eq. (3): catches a chart that turns something else than the whole state, so that shades would lie."""
    assert chart.cost(s, alpha) == pytest.approx(chart.cost(s), rel=1e-9)


def test_start_and_minimum_are_where_the_chart_says(chart: Chart) -> None:
    """Catches a wrong sign of the yaw: the start's, and the way back from a state to the chart."""
    assert chart.locate(chart.problem.initial) == pytest.approx((chart.start_yaw, 1.0), abs=1e-9)
    assert chart.locate(chart.state(TURN, 0.0)) == pytest.approx((TURN, 0.0), abs=1e-9)
    start = chart.state(chart.start_yaw, 1.0)
    assert np.allclose(start.R_WB, chart.problem.initial.R_WB, atol=1e-9)


def test_gauge_passes_through_the_start(chart: Chart) -> None:
    """Eq. (10) holds at the start by definition; catches a gauge curve of another reference."""
    assert chart.gauge_yaw(1.0) == pytest.approx(chart.start_yaw, abs=1e-9)
    on_gauge = chart.state(chart.gauge_yaw(0.4), 0.4)
    assert on_gauge.dphi_0[2] == pytest.approx(0.0, abs=1e-9)


def test_metric_is_that_of_the_dense_hessian(chart: Chart) -> None:
    """Catches a block of H that is left out or counted twice in the product with a vector."""
    vector = np.random.default_rng(3).normal(size=chart.minimum.n_parameters)
    H = chart.equations.dense()
    assert np.allclose(chart.equations.times(vector), H @ vector, rtol=1e-9, atol=1e-9 * np.abs(H).max())


def test_carried_perturbation_is_that_of_the_dense_operators(chart: Chart) -> None:
    """Catches coordinates of Figure 8 that are not those of Q D delta with Eqs. (12), (14), (15)."""
    a, b = 0.02, 0.1
    found = carry_perturbation(chart, a, b)
    moved, yaw = FixedGauge().meet(chart.minimum, chart.problem.initial)
    assert found.yaw == yaw == pytest.approx(chart.gauge_yaw(0.0))
    U, V = orbit_tangent(moved), FixedGauge().normal(moved)
    # d(theta_C)/d(theta) by differences of the map itself, with the translation that goes with it.
    step = 1e-6
    tangent = np.concatenate([[1.0], -np.cross([0.0, 0.0, 1.0], chart.pivot_W)])
    perturbation = a * (orbit_tangent(chart.minimum) @ tangent) + b * chart.direction
    ends = [chart.minimum.retract(sign * step * perturbation) for sign in (1.0, -1.0)]
    t_W = moved.p_W[0] - chart.minimum.transformed(yaw, np.zeros(3)).p_W[0]
    forward, backward = (moved.local(end.transformed(yaw, t_W)) for end in ends)
    carried = (forward - backward) / (2.0 * step)
    projected = oblique_projector(U, V) @ carried
    assert np.abs(V.T @ projected).max() < 1e-9, "the projected perturbation lies in the gauge"
    along = np.linalg.lstsq(U, carried - projected, rcond=None)[0][0]
    assert found.carried == pytest.approx((a, b), rel=1e-12)
    assert found.projected == pytest.approx((a - along, b), abs=1e-6)


def test_projected_perturbation_is_tangent_to_the_gauge_curve(chart: Chart) -> None:
    """Catches an arrow of Figure 8 that leaves the curve that it is drawn along."""
    found = carry_perturbation(chart, 0.01, 0.1)
    step = 1e-5
    slope = (chart.gauge_yaw(step) - chart.gauge_yaw(-step)) / (2.0 * step)
    assert found.projected[0] / found.projected[1] == pytest.approx(slope, rel=1e-4)
