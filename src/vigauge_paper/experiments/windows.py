"""One window of a recording through everything: check, front-end, three gauges, covariance.

What cannot be used is a row that says where it stopped and why, in the words of the error.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.stats import binomtest

from vigauge.covariance.covariance import Covariance, motion_pseudo_inverse
from vigauge.covariance.transform import transform_covariance
from vigauge.errors import VigaugeError
from vigauge.gauge.gauges import FixedGauge, three_gauges
from vigauge.model.evaluation import relative_frobenius
from vigauge.model.problem import Problem
from vigauge.model.state import State
from vigauge.recordings.asl.ground_truth import read_ground_truth
from vigauge.recordings.asl.sequence import read_sequence
from vigauge.recordings.asl.truth_steps import find_steps, without_steps
from vigauge.recordings.checks.sequence import Window, check_sequence
from vigauge.recordings.frontend.build import build_problem
from vigauge.recordings.frontend.settings import FrontEndSettings
from vigauge.solver.levenberg_marquardt import Options

from .interleaved import Trial, first_solves, solution_row, solve_interleaved

Row = dict[str, object]

# Errors that are compared at the start and at the optimum: aligned by the first pose, as in the
# paper; and positions aligned over all poses, where an error of the first true pose does not
# enter every other one.
COMPARED = ("p_rmse_m", "phi_rmse_deg", "v_rmse_mps", "p_rmse_all_poses_m")
_SOLVED = (
    "status",
    "converged",
    "iterations",
    "cost",
    *(f"start_{name}" for name in COMPARED),
    *COMPARED,
)
_FROBENIUS = ("relative_frobenius_same_point", "relative_frobenius_converged")
# What stands in the columns of a window that did not get so far.
_NONE = ""


@dataclass(frozen=True)
class WindowTask:
    """A window and what to do with it.

    Attributes
    ----------
    name : of the window, as results carry it
    folder : ASL folder
    truth, biases : names of ground-truth folders, for evaluation (without its steps) and for the known biases
    settings : of the front-end; its keyframes say which part of the recording it is
    noise : noise models by name, with ``sigma_px`` and ``density_factor``
    """

    name: str
    folder: Path
    truth: str
    biases: str
    settings: FrontEndSettings
    noise: Mapping[str, Mapping[str, float]]


def run_window(task: WindowTask, options: Options, prior_weight: float) -> list[Row]:
    """A row a noise model and gauge, or one row where the window cannot be used."""
    keyframes = task.settings.keyframes
    checked = check_sequence(
        task.folder,
        sorted({task.truth, task.biases}),
        Window(keyframes.window_origin_ns, keyframes.window_start_s, keyframes.window_end_s),
        task.settings.camera_time_offset_ns,
    )
    about: Row = {
        "window": task.name,
        "sequence": checked.sequence,
        "start_s": keyframes.window_start_s,
        "end_s": keyframes.window_end_s,
        "truth": task.truth,
        "check_warnings": len(checked.of("warning")),
    }
    errors = checked.of("error")
    if errors:
        return [_refused(about, "check", "; ".join(f"{e.check}: {e.message}" for e in errors))]
    try:
        biases = read_ground_truth(task.folder / "mav0" / task.biases)
        sequence = read_sequence(task.folder)
        problem, t_ns, _ = build_problem(sequence, biases, task.settings)
        recorded = read_ground_truth(task.folder / "mav0" / task.truth)
        steps = find_steps(recorded, sequence.imu, task.settings.gravity_mps2)
        truth = without_steps(recorded, steps).states_at(t_ns)
    except VigaugeError as error:
        return [_refused(about, "front-end", f"{type(error).__name__}: {error}")]
    about |= {"keyframes": problem.initial.n_keyframes, "landmarks": problem.initial.n_landmarks}
    rows = []
    for name, model in task.noise.items():
        rows += _solve(about | {"noise": name}, problem.with_noise(**model), truth, options, prior_weight)
    return rows


def _refused(about: Row, stage: str, why: str) -> Row:
    return _row(about, {"stopped_at": stage, "why": why})


def _row(about: Row, values: Row) -> Row:
    """All columns in one order; those that are not given stay empty."""
    columns = (
        "window",
        "sequence",
        "start_s",
        "end_s",
        "truth",
        "keyframes",
        "landmarks",
        "check_warnings",
        "noise",
        "gauge",
        *_SOLVED,
        *_FROBENIUS,
        "stopped_at",
        "why",
    )
    everything = about | values
    return {name: everything.get(name, _NONE) for name in columns}


def _solve(about: Row, problem: Problem, truth: State, options: Options, prior_weight: float) -> list[Row]:
    """Rows of one noise model: the three gauges, and how far apart their covariances are."""
    gauges = three_gauges(prior_weight)
    solves = solve_interleaved([Trial({}, problem)], gauges, options, clock=lambda: 0.0, warm_up=False)
    first = first_solves(solves, gauges)
    found: Row = {"stopped_at": _NONE, "why": _NONE}
    states = {s.gauge: s.solution.state for s in first if s.solution.converged}
    failed = [f"{s.gauge}: {s.solution.status}" for s in first if not s.solution.converged]
    if failed:
        found |= {"stopped_at": "solve", "why": "; ".join(failed)}
    else:
        try:
            found |= _distances(problem, states["fix"], states["free"])
        except VigaugeError as error:
            found |= {"stopped_at": "covariance", "why": f"{type(error).__name__}: {error}"}
    rows = []
    for timed in first:
        solved = solution_row(timed, truth)
        rows.append(_row(about | {"gauge": timed.gauge}, {name: solved[name] for name in _SOLVED} | found))
    return rows


def _distances(problem: Problem, fix: State, free: State) -> Row:
    """Relative Frobenius distances of Eq. (12)'s result from the fixed covariance (Section VI)."""
    reference, fixed_gauge = problem.initial, FixedGauge()
    at_fix, at_free = Covariance.of(problem, fix), Covariance.of(problem, free)
    fixed = at_fix.motion(fixed_gauge)
    same, _ = transform_covariance(motion_pseudo_inverse(at_fix), fix, fixed_gauge, reference)
    converged, _ = transform_covariance(motion_pseudo_inverse(at_free), free, fixed_gauge, reference)
    return {
        "relative_frobenius_same_point": relative_frobenius(same, fixed),
        "relative_frobenius_converged": relative_frobenius(converged, fixed),
    }


def summarise(rows: Sequence[Mapping[str, str]], gauge: str = "free") -> list[Row]:
    """Whether the optimum is nearer to the truth than the start, over all windows, in pairs.

    A row a noise model and error: windows, in how many the optimum is nearer, the median of the
    ratios of the two errors, and the two-sided p of a sign test. Windows whose run did not
    converge are counted and left out.
    """
    out: list[Row] = []
    mine = [row for row in rows if row["gauge"] == gauge]
    for noise in dict.fromkeys(row["noise"] for row in mine):
        of_model = [row for row in mine if row["noise"] == noise]
        good = [row for row in of_model if str(row["converged"]) == "True"]
        for error in COMPARED:
            pairs = np.array([[float(row[f"start_{error}"]), float(row[error])] for row in good])
            if not len(pairs):
                continue
            nearer = int(np.count_nonzero(pairs[:, 1] < pairs[:, 0]))
            out.append(
                {
                    "noise": noise,
                    "error": error,
                    "windows": len(pairs),
                    "left_out": len(of_model) - len(good),
                    "optimum_nearer": nearer,
                    "median_start": float(np.median(pairs[:, 0])),
                    "median_optimum": float(np.median(pairs[:, 1])),
                    "median_ratio": float(np.median(pairs[:, 1] / pairs[:, 0])),
                    "sign_test_p": float(binomtest(nearer, len(pairs)).pvalue),
                }
            )
    return out
