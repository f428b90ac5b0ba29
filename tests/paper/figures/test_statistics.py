"""Numbers behind boxes and ratios."""

import numpy as np
import pytest

from support.results import solutions, timing
from vigauge_paper.experiments.timing import timing_of
from vigauge_paper.figures.statistics import box, box_row, converged_only, time_per_iteration_ratios
from vigauge_paper.ids import FIX_AGAIN


def test_whiskers_end_at_data_and_leave_out_outliers() -> None:
    """Catches whiskers at the fences, or at an outlier."""
    found = box(np.array([1.0, 2.0, 3.0, 4.0, 100.0]))
    assert (found["whislo"], found["q1"], found["med"], found["q3"], found["whishi"]) == (1, 2, 3, 4, 4)


def test_no_values_give_an_empty_box() -> None:
    """Catches a figure that fails because all runs of one gauge failed."""
    row = box_row(np.empty(0), gauge="fix")
    assert row["count"] == 0
    assert np.isnan(float(str(row["median"])))


def test_failed_runs_are_counted_and_their_times_left_out() -> None:
    """Catches times of diverged runs in the boxes."""
    solved = solutions("arc_plane")
    solved.loc[(solved["gauge"] == "free") & (solved["trial"] < 2), "converged"] = False
    good, failed = converged_only(solved)
    assert failed == 2
    times = timing_of(timing("arc_plane"), good)
    assert len(times[times["gauge"] != FIX_AGAIN]) == len(good)
    assert not ((times["gauge"] == "free") & (times["trial"] < 2)).any()
    assert {len(values) for values in time_per_iteration_ratios(times).values()} == {12 - 2}


def test_ratios_are_paired_by_trial() -> None:
    """Catches a ratio of medians: here every pair has 1.02, while trials differ by more than that."""
    shuffled = timing("arc_plane").sample(frac=1.0, random_state=1)
    ratios = time_per_iteration_ratios(timing_of(shuffled, solutions("arc_plane")))
    assert ratios["fix"] == pytest.approx(1.0)
    assert ratios["free"] == pytest.approx(1.02)


def test_ratios_without_the_reference_are_empty() -> None:
    """Catches a crash where fixation never converged."""
    table = timing_of(timing("arc_plane"), solutions("arc_plane").query("gauge != 'fix'"))
    assert all(not len(values) for values in time_per_iteration_ratios(table).values())
