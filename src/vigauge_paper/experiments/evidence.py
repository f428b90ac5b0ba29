"""What claims are judged by: result files, read when first asked for."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import pandas as pd

from vigauge.errors import VigaugeError
from vigauge.model.archive import load_arrays

from ..ids import FIX, FIX_AGAIN, GAUGES, HEADLINE, PRIOR, PRIOR_AS_PRINTED
from ..prior import INFORMATION
from .statistics import Criteria, Interval, bootstrap, mean, median
from .timing import paired_ratios, read_timing, timing_of


class NoEvidenceError(VigaugeError):
    """The result files hold nothing that a claim could be judged by."""


@dataclass(frozen=True)
class Evidence:
    """Result files by experiment.

    ``solutions``, ``timings`` and ``covariances`` by name of configuration or sequence (a file of times may
    hold several);
    ``sweep``, ``sweep_trace`` of the prior weights, done on ``sweep_configuration``;
    ``reading`` says what a prior's weight multiplies in what is judged;
    ``reasons`` by name of the table; ``cpu`` that times were taken on; ``machine_hall`` and ``vicon_room``
    name the image sequences in the place of the paper's MH1 and VI1, from ``source``, if there are any.
    """

    solutions: Mapping[str, Path]
    timings: Mapping[str, Path]
    covariances: Mapping[str, Path]
    sweep: Path
    sweep_trace: Path
    sweep_configuration: str
    reasons: Mapping[str, Path]
    source: str
    cpu: str
    criteria: Criteria
    reading: str
    machine_hall: str = ""
    vicon_room: str = ""

    @property
    def as_printed(self) -> Evidence:
        """The same results with the prior's weight as the paper's text has it."""
        return replace(self, reading=INFORMATION)

    def _of_reading(self, table: pd.DataFrame) -> pd.DataFrame:
        """Runs of a table of solves under :attr:`reading`, whose prior is called 'prior'."""
        if self.reading == INFORMATION and (table["gauge"] == PRIOR_AS_PRINTED).any():
            table = table[table["gauge"] != PRIOR].replace({"gauge": {PRIOR_AS_PRINTED: PRIOR}})
        return table[table["gauge"].isin((*GAUGES, FIX_AGAIN))]

    def _of_sweep(self, file: Path) -> pd.DataFrame:
        """A table of the sweep under :attr:`reading`."""
        table = pd.read_csv(file, dtype={"weight": str})
        return table[table["reading"] == self.reading].drop(columns="reading")

    @property
    def sequences(self) -> tuple[str, ...]:
        return tuple(name for name in (self.machine_hall, self.vicon_room) if name)

    @property
    def configurations(self) -> tuple[str, ...]:
        return tuple(name for name in self.solutions if name not in self.sequences)

    @cached_property
    def converged(self) -> dict[str, pd.DataFrame]:
        """Solutions of each experiment under its headline noise, of the runs that converged."""
        tables = {name: self._of_reading(pd.read_csv(file)) for name, file in self.solutions.items()}
        return {
            name: table[(table["noise"] == HEADLINE) & table["converged"]] for name, table in tables.items()
        }

    @cached_property
    def timed(self) -> dict[str, pd.DataFrame]:
        """Times of each experiment, of the runs in :attr:`converged`."""
        return {
            name: timing_of(self._of_reading(read_timing(file, name)), self.converged[name])
            for name, file in self.timings.items()
        }

    def paired(self, name: str, column: str, gauge: str, reference: str) -> np.ndarray:
        """gauge minus reference, trial by trial, where both converged."""
        good = self.converged[name]
        good = good[good["gauge"].isin((gauge, reference))]
        table = good.pivot(index="trial", columns="gauge", values=column).dropna()
        if table.shape[1] < 2 or not len(table):
            raise NoEvidenceError(f"no trial of {name} converged under both {gauge} and {reference}")
        return (table[gauge] - table[reference]).to_numpy(dtype=float)

    def mean(self, name: str, column: str, gauge: str) -> float:
        """Mean over the trials that converged."""
        good = self.converged[name]
        values = good.loc[good["gauge"] == gauge, column]
        if not len(values):
            raise NoEvidenceError(f"no trial of {name} converged under {gauge}")
        return float(values.mean())

    def difference(self, names: Iterable[str], column: str, gauge: str, reference: str = "fix") -> Interval:
        """Interval of the mean paired difference, relative to the reference's mean of each experiment."""
        groups = [
            self.paired(name, column, gauge, reference) / self.mean(name, column, reference) for name in names
        ]
        return bootstrap(groups, mean, self.criteria)

    def mean_interval(self, differences: np.ndarray) -> Interval:
        """Bootstrap interval of the mean of paired differences."""
        return bootstrap([differences], mean, self.criteria)

    def time_ratio(
        self, names: Iterable[str], gauge: str, reference: str = FIX, *, each: bool = False
    ) -> Interval:
        """Interval of the median paired ratio of times, of an iteration where ``each``.

        Pairs are converged solves of one trial, each at its quickest repeat (of a sequence: of one repeat);
        they are drawn anew.
        """
        groups = []
        for name in names:
            timing = self.timed[name]
            timing = timing[timing["gauge"].isin((gauge, reference, *[FIX_AGAIN] * (reference == FIX)))]
            table = paired_ratios(timing, "gauge", reference, each=each)
            if gauge not in table or not len(table):
                raise NoEvidenceError(f"no trial of {name} converged under both {gauge} and {reference}")
            groups.append(table[gauge].to_numpy(dtype=float))
        return bootstrap(groups, median, self.criteria)

    def covariance(self, name: str) -> dict[str, np.ndarray]:
        """Covariances of trial 0; they are evidence only where its runs converged in every gauge."""
        good = self.converged[name]
        missing = set(GAUGES) - set(good.loc[good["trial"] == 0, "gauge"])
        if missing:
            raise NoEvidenceError(f"trial 0 of {name} did not converge under {', '.join(sorted(missing))}")
        arrays = load_arrays(self.covariances[name])
        if str(arrays["withheld"]):
            raise NoEvidenceError(f"{name}: {arrays['withheld']}")
        return arrays

    def reason(self, table: str, *, failed: bool = False) -> pd.DataFrame:
        """Table of an experiment that explains results, without the runs that did not converge.

        With ``failed`` they are in it: for a claim that is about failures.
        """
        rows = pd.read_csv(self.reasons[table], dtype={"weight": str, "label": str, "gauge": str})
        return rows if failed or "converged" not in rows else rows[rows["converged"]]

    def left_out(self, *tables: str) -> str:
        """How many runs of explaining experiments did not converge, for the end of a sentence, or nothing."""
        count = sum(len(self.reason(name, failed=True)) - len(self.reason(name)) for name in tables)
        return f" ({count} runs that did not converge left out)" if count else ""

    @cached_property
    def sweep_table(self) -> pd.DataFrame:
        return self._of_sweep(self.sweep).query("converged")

    @cached_property
    def sweep_paths(self) -> pd.DataFrame:
        """Iterations of the sweep."""
        return self._of_sweep(self.sweep_trace)
