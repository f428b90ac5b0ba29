"""Every published number of Tables II and III and of Figures 1, 4 to 7 and 9 to 11 beside ours."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from vigauge.model.archive import load_arrays, load_problems
from vigauge.solver.levenberg_marquardt import Options

from ..experiments.exchange import published_magnitude
from ..experiments.timing import paired_ratios, read_timing, timing_of
from ..figures.registry import FIGURES
from ..figures.statistics import converged_only
from ..ids import CONFIGURATIONS, ERRORS, FIX, FREE
from .number import Number, number
from .sigmas import deviations, of_trials

_BOX = {"q1": 25, "median": 50, "q3": 75}
# Our columns of the two panels of Fig. 6.
_PANELS = {"yaw_rad": "prior_yaw_rad", "position_m": "prior_position_m"}
_BLOCKS = ("sigma_p_m", "sigma_phi_rad", "sigma_v_mps")


@dataclass(frozen=True)
class Results:
    """Where our results and the paper's numbers are.

    ``solutions``, ``timings`` and ``covariances`` of all experiments by name; tables of the sweep, of which
    those under ``reading`` count; ``problems`` of ``sweep_configuration``, for Fig. 9; ``published`` is the
    folder of the paper's numbers. ``sequences`` maps our names to the paper's (MH, VI), empty where ours are
    not the paper's.
    """

    solutions: Mapping[str, Path]
    timings: Mapping[str, Path]
    covariances: Mapping[str, Path]
    sweep: Path
    sweep_timing: Path
    sweep_trace: Path
    reading: str
    problems: Path
    solver: Options
    published: Path
    sequences: Mapping[str, str]

    def paper(self, name: str) -> pd.DataFrame:
        stem = FIGURES[name].stem if name in FIGURES else name
        return pd.read_csv(self.published / f"{stem}.csv", dtype={"weight": str})

    def solved(self, name: str) -> pd.DataFrame:
        """Converged runs of an experiment under the headline noise."""
        return converged_only(pd.read_csv(self.solutions[name]).query("noise == 'headline'"))[0]

    def swept(self, file: Path) -> pd.DataFrame:
        """A table of the sweep under the reading that counts, weights as numbers; the free gauge's is nan."""
        table = pd.read_csv(file, dtype={"weight": str}).query("reading == @self.reading")
        return table.assign(number=pd.to_numeric(table["weight"], errors="coerce"))


def numbers(results: Results) -> tuple[list[Number], list[Number]]:
    """All numbers but times, and all times."""
    simulated = dict.fromkeys(CONFIGURATIONS)
    found = [
        *_table(results, "table2", {name: name for name in simulated}),
        *_table(results, "table3", results.sequences),
        *_prior_accuracy(results),
        *_prior_cost(results),
        *_prior_paths(results),
        *_cost(results, "fig07", {name: name for name in simulated}),
        *_cost(results, "fig11", results.sequences),
        *_simulated_sigmas(results),
        *_sequence_sigmas(results),
    ]
    timed = [n.quantity.startswith("time_s") for n in found]
    return (
        [n for n, time in zip(found, timed, strict=True) if not time],
        [n for n, time in zip(found, timed, strict=True) if time],
    )


def _table(results: Results, artefact: str, names: Mapping[str, str]) -> Iterator[Number]:
    paper = results.paper(artefact)
    for name, their_name in names.items():
        solved = results.solved(name)
        for _, row in paper[paper.iloc[:, 0] == their_name].iterrows():
            own = solved[solved["gauge"] == row["gauge"]]
            for error in ERRORS:
                yield number(artefact, name, row["gauge"], error, row[error], own[error], np.mean)


def _prior_accuracy(results: Results) -> Iterator[Number]:
    own, _ = converged_only(results.swept(results.sweep))
    for _, row in results.paper("fig04").iterrows():
        weight = float(row["weight_guess"])
        match = own[own["number"] == weight]
        # The published column of the rotation says rad and holds degrees.
        for error, column in zip(ERRORS, ("p_rmse_m", "phi_rmse_rad", "v_rmse_mps"), strict=True):
            if len(match):
                yield number("fig04", f"{weight:g}", "prior", error, row[column], match[error], np.mean)


def _prior_cost(results: Results) -> Iterator[Number]:
    own, _ = converged_only(results.swept(results.sweep))
    times = timing_of(results.swept(results.sweep_timing), own, "weight")
    for _, row in results.paper("fig05").iterrows():
        weight = float(row["weight"])
        table, column = (own, "iterations") if row["quantity"] == "iterations" else (times, "seconds")
        values = table.loc[table["number"] == weight, column]
        if len(values):
            yield from _box("fig05", f"{weight:g}", "prior", row, values)


def _box(artefact: str, case: str, gauge: str, row: pd.Series, values: pd.Series) -> Iterator[Number]:
    """The quartiles of a box of the paper; of times the median only."""
    for part, percent in _BOX.items():
        if part == "median" or row["quantity"] == "iterations":
            quantity = f"{row['quantity']} {part}"
            quartile = partial(np.percentile, q=percent)
            yield number(artefact, case, gauge, quantity, row[part], values, quartile)


def _prior_paths(results: Results) -> Iterator[Number]:
    trace = results.swept(results.sweep_trace)
    for _, row in results.paper("fig06").iterrows():
        own = trace[(trace["weight"] == row["weight"]) & (trace["iteration"] <= row["step"])]
        if own.empty:
            continue
        # A run that has ended stays where it ended.
        own = own.sort_values("iteration").groupby("trial").last()
        gauge = FREE if row["weight"] == FREE else "prior"
        case, column = f"{row['weight']}, step {row['step']}", _PANELS[row["panel"]]
        if row["step"] > 0:
            yield number("fig06", case, gauge, column, row["prior_error"], own[column])
        if row["panel"] == "yaw_rad":  # the abscissa is the same in both panels
            quantity = "mean_reprojection_px"
            yield number("fig06", case, gauge, quantity, row[quantity], own[quantity])


def _cost(results: Results, artefact: str, names: Mapping[str, str]) -> Iterator[Number]:
    paper = results.paper(artefact)
    for name, their_name in names.items():
        solved = results.solved(name)
        timed = timing_of(read_timing(results.timings[name], name), solved)
        ratios = paired_ratios(timed, each=True)
        for _, row in paper[paper.iloc[:, 0] == their_name].iterrows():
            gauge, quantity = row["gauge"], row["quantity"]
            if quantity == "time_per_iteration_ratio":
                if gauge != FIX:  # one by definition
                    yield number(artefact, name, gauge, quantity, row["value"], ratios[gauge])
                continue
            table, column = (solved, "iterations") if quantity == "iterations" else (timed, "seconds")
            yield from _box(artefact, name, gauge, row, table.loc[table["gauge"] == gauge, column])


def _simulated_sigmas(results: Results) -> Iterator[Number]:
    """Fig. 9: its configuration is not stated; ours is that of the sweep, in all trials."""
    arrays = load_arrays(results.published / "fig09.npz")
    problems = load_problems(results.problems)
    if 9 * problems[0].initial.n_keyframes != len(arrays["fixed"]):
        return
    for panel, own in of_trials(problems, results.solver).items():
        theirs = deviations(published_magnitude(arrays, panel))
        yield from _sigmas("fig09", panel, theirs, own)


def _sequence_sigmas(results: Results) -> Iterator[Number]:
    """Figs. 10 and 1: one problem each, so that there is no range. Fig. 1 shows x and y of positions."""
    named = {theirs: name for name, theirs in results.sequences.items()}
    for artefact, sequence in (("fig01", "MH"), ("fig10", "VI")):
        if sequence not in named:
            continue
        own = load_arrays(results.covariances[named[sequence]])
        for panel in () if str(own["withheld"]) else ("free", "fixed"):
            if artefact == "fig10":
                arrays = load_arrays(results.published / "fig10.npz")
                theirs, ours = deviations(published_magnitude(arrays, panel)), deviations(own[panel])
            else:
                shown = results.paper("fig01").query("record == 'ellipse' and curve == @panel")
                theirs = np.sqrt(shown.sort_values("keyframe")[["var_x_m2", "var_y_m2"]].sum(axis=1))
                variance = np.diagonal(own[panel])[: len(own[panel]) // 3].reshape(-1, 3)
                theirs = theirs.to_numpy()[:, None]
                ours = np.sqrt(variance[:, :2].sum(axis=1))[:, None]
            if len(theirs) == len(ours):
                yield from _sigmas(artefact, panel, theirs, ours[None])


def _sigmas(artefact: str, panel: str, theirs: np.ndarray, own: np.ndarray) -> Iterator[Number]:
    """Sigmas (N, blocks) against those of trials (T, N, blocks); the fixed gauge's first keyframe is held."""
    gauge = FIX if panel == "fixed" else FREE
    for keyframe in range(1 if gauge == FIX else 0, len(theirs)):
        for block in range(theirs.shape[1]):
            values = own[:, keyframe, block]
            case = f"keyframe {keyframe}"
            yield number(artefact, case, gauge, _BLOCKS[block], theirs[keyframe, block], values)
