"""Interleaved solves: pairing, order, and rows without times."""

import itertools
from collections.abc import Callable

from support import simulated
from vigauge.gauge.gauges import FixedGauge, FreeGauge, PriorGauge
from vigauge.solver.levenberg_marquardt import Options
from vigauge_paper.experiments.interleaved import (
    Trial,
    solution_row,
    solve_interleaved,
    solve_once,
    timing_row,
    trace_rows,
)

GAUGES = {"fix": FixedGauge(), "prior": PriorGauge(1e5), "free": FreeGauge()}


def ticking() -> Callable[[], float]:
    """A clock that gains one second a look."""
    counter = itertools.count()
    return lambda: float(next(counter))


def trials(count: int) -> list[Trial]:
    return [Trial({"trial": number}, simulated.trial(number)) for number in range(count)]


def test_every_gauge_solves_every_trial_in_every_repeat_and_takes_turns() -> None:
    """A gauge that always goes first would profit or suffer from it in every pair."""
    solves = list(solve_interleaved(trials(2), GAUGES, Options(), clock=ticking(), repeats=2))
    keys = [(s.repeat, s.trial.labels["trial"], s.gauge) for s in solves]
    assert len(keys) == len(set(keys)) == 12
    leaders = [solves[k].gauge for k in range(0, 12, 3)]
    assert leaders == ["fix", "prior", "prior", "free"]


def test_solves_for_their_outcome_are_ordered_by_trial_and_gauge() -> None:
    """Rows in the order of the turns would differ between runs with other numbers of gauges."""
    solves = solve_once(trials(3), GAUGES, Options())
    keys = [(s.trial.labels["trial"], s.gauge) for s in solves]
    assert keys == [(number, gauge) for number in range(3) for gauge in GAUGES]


def test_repeats_give_the_same_estimate() -> None:
    """State that leaks from one solve into the next."""
    solves = list(solve_interleaved(trials(1), GAUGES, Options(), clock=ticking(), repeats=2))
    for gauge in GAUGES:
        costs = {s.solution.cost for s in solves if s.gauge == gauge}
        assert len(costs) == 1


def test_rows_without_times_do_not_depend_on_the_clock() -> None:
    """Seconds in a table that must be the same in every run."""
    truth = simulated.scene().truth
    tables = []
    for clock in (ticking(), lambda: 0.0):
        solves = list(solve_interleaved(trials(1), GAUGES, Options(), clock=clock))
        tables.append([[solution_row(s, truth), *trace_rows(s)] for s in solves])
        assert all(timing_row(s)["seconds"] == s.solution.seconds for s in solves)
    assert tables[0] == tables[1]


def test_trace_of_a_run_has_a_row_an_iteration() -> None:
    solves = solve_interleaved(trials(1), GAUGES, Options(), clock=ticking())
    for timed in solves:
        rows = trace_rows(timed)
        assert len(rows) == timed.solution.iterations
        assert rows[-1]["cost"] == timed.solution.cost
