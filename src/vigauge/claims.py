"""The ledger: the paper's claims, each with a criterion, our measurement and a computed verdict.

A claim is one function of the evidence. It returns what was measured and whether the
criterion holds, or None for the latter where the evidence cannot tell (a stand-in is not
EuRoC; no run converged). Accuracy is compared as equivalence: a paired interval inside a stated margin.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import pandas as pd

from .archive import load_arrays
from .errors import VigaugeError

Row = dict[str, object]
Finding = tuple[str, bool | None]

ERRORS = ("p_rmse_m", "phi_rmse_deg", "v_rmse_mps")
FREE_NEEDS_FEWER = ("sine_plane", "arc_plane", "rec_plane", "arc_random", "rec_random")


class NoEvidenceError(VigaugeError):
    """The result files hold nothing that a claim could be judged by."""


@dataclass(frozen=True)
class Criteria:
    """Margins of the ledger.

    ``accuracy_margin`` relative difference of RMSE that counts as the same; ``confidence`` of
    intervals; ``resamples`` and ``seed`` of the bootstrap; ``sweep_span`` relative span of the
    RMSE over prior weights that counts as "very similar".
    """

    accuracy_margin: float
    confidence: float
    resamples: int
    seed: int
    sweep_span: float


@dataclass(frozen=True)
class Evidence:
    """Result files by experiment, read when first asked for.

    ``solutions`` and ``timings`` by name of configuration or sequence; ``covariances`` too;
    ``sequences`` are the names among them that are image sequences, from ``source``.
    """

    solutions: Mapping[str, Path]
    timings: Mapping[str, Path]
    covariances: Mapping[str, Path]
    sweep: Path
    sequences: tuple[str, ...]
    source: str
    criteria: Criteria

    @property
    def configurations(self) -> tuple[str, ...]:
        return tuple(name for name in self.solutions if name not in self.sequences)

    @cached_property
    def converged(self) -> dict[str, pd.DataFrame]:
        """Solutions of each experiment under its headline noise, of the runs that converged."""
        tables = {name: pd.read_csv(file) for name, file in self.solutions.items()}
        return {
            name: table[(table["noise"] == "headline") & table["converged"]] for name, table in tables.items()
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

    def covariance(self, name: str) -> dict[str, np.ndarray]:
        return load_arrays(self.covariances[name])

    @cached_property
    def sweep_table(self) -> pd.DataFrame:
        return pd.read_csv(self.sweep, dtype={"weight": str}).query("converged")

    def interval(self, differences: np.ndarray) -> tuple[float, float]:
        """Bootstrap interval of the mean of paired differences."""
        rng = np.random.default_rng(self.criteria.seed)
        picks = rng.integers(0, len(differences), (self.criteria.resamples, len(differences)))
        tail = 50.0 * (1.0 - self.criteria.confidence)
        low, high = np.percentile(differences[picks].mean(axis=1), [tail, 100.0 - tail])
        return float(low), float(high)


@dataclass(frozen=True)
class Claim:
    """One statement of the paper and how it is judged."""

    id: str
    section: str
    claim: str
    published: str
    criterion: str
    judge: Callable[[Evidence], Finding]


def _worst_difference(e: Evidence, names: Iterable[str], gauge: str) -> float:
    """Largest relative bound of the intervals of gauge minus fixation, over names and errors."""
    worst = 0.0
    for name in names:
        for error in ERRORS:
            bounds = e.interval(e.paired(name, error, gauge, "fix"))
            worst = max(worst, *(abs(bound) / e.mean(name, error, "fix") for bound in bounds))
    return worst


def _same_accuracy(e: Evidence) -> Finding:
    worst = _worst_difference(e, e.configurations, "free")
    return f"intervals within {100 * worst:.2g} % of the RMSE", worst < e.criteria.accuracy_margin


def _neither_better(e: Evidence) -> Finding:
    wins = {"fix": 0, "free": 0}
    for name in e.configurations:
        for error in ERRORS:
            difference = e.mean(name, error, "free") - e.mean(name, error, "fix")
            wins["free" if difference < 0 else "fix"] += 1
    return f"smaller mean: fix {wins['fix']}, free {wins['free']} of {sum(wins.values())}", min(
        wins.values()
    ) > 0


def _iterations(e: Evidence, names: Iterable[str]) -> tuple[list[str], list[tuple[float, float]]]:
    texts, intervals = [], []
    for name in names:
        low, high = e.interval(e.paired(name, "iterations", "free", "fix"))
        intervals.append((low, high))
        means = e.mean(name, "iterations", "free"), e.mean(name, "iterations", "fix")
        texts.append(f"{name} {means[0]:.2f} against {means[1]:.2f}")
    return texts, intervals


def _free_needs_fewer(e: Evidence) -> Finding:
    texts, intervals = _iterations(e, [n for n in FREE_NEEDS_FEWER if n in e.solutions])
    return "; ".join(texts), all(high < 0 for _, high in intervals)


def _sine_random_is_the_exception(e: Evidence) -> Finding:
    texts, ((low, high),) = _iterations(e, ["sine_random"])
    return texts[0], low <= 0 <= high


def _prior_is_fixation(e: Evidence) -> Finding:
    worst = max(
        abs(e.mean(name, error, "prior") - e.mean(name, error, "fix"))
        for name in e.configurations
        for error in ERRORS
    )
    return f"means differ by up to {worst:.1e} (m, deg, m/s)", worst < 0.5e-8


def _prior_is_fixation_within_margin(e: Evidence) -> Finding:
    worst = _worst_difference(e, e.configurations, "prior")
    return f"intervals within {100 * worst:.2g} % of the RMSE", worst < e.criteria.accuracy_margin


def _fixation_is_fastest_an_iteration(e: Evidence) -> Finding:
    medians = pd.DataFrame({name: _time_ratios(e.timings[name]) for name in e.configurations}).T
    texts = [f"{gauge} {medians[gauge].min():.3f} to {medians[gauge].max():.3f}" for gauge in medians]
    return f"medians of ratios to fix: {', '.join(texts)}", bool((medians >= 1.0).to_numpy().all())


def _time_ratios(file: Path) -> pd.Series:
    """Median over trials and repeats of the paired ratio of time per iteration to fixation's, by gauge."""
    timing = pd.read_csv(file)
    timing = timing.assign(each=timing["seconds"] / timing["iterations"])
    table = timing.pivot(index=["trial", "repeat"], columns="gauge", values="each")
    return table[["free", "prior"]].div(table["fix"], axis=0).median()


def _rank(e: Evidence) -> Finding:
    nullities, gaps = [], []
    for name in e.covariances:
        arrays = e.covariance(name)
        nullities.append(int(arrays["n_parameters"]) - int(arrays["rank_free"]))
        gaps.append(float(arrays["gap"]))
    found = f"nullity {min(nullities)} to {max(nullities)}, gap in the spectrum at least {min(gaps):.0e}"
    return found, set(nullities) == {4} and min(gaps) > 1e8


def _identity(e: Evidence) -> Finding:
    worst = max(float(e.covariance(name)["relative_frobenius_same_point"]) for name in e.covariances)
    return f"at most {worst:.1e}", worst <= 1e-9


def _converged_simulation(e: Evidence) -> Finding:
    value = float(e.covariance("sine_plane")["relative_frobenius_converged"])
    return f"{100 * value:.2g} % (sine plane)", value <= 0.0011


def _on_euroc(e: Evidence, text: str, holds: bool) -> Finding:
    """A finding on image sequences; on stand-ins it is shown, and nothing is concluded."""
    if e.source != "euroc":
        return f"{text} (rendered stand-in, not EuRoC)", None
    return text, holds


def _converged_euroc(e: Evidence) -> Finding:
    name = e.sequences[-1]
    value = float(e.covariance(name)["relative_frobenius_converged"])
    return _on_euroc(e, f"{100 * value:.2g} % ({name})", value <= 0.0002)


def _euroc_iterations(e: Evidence) -> Finding:
    texts, fewer = [], []
    for name in e.sequences:
        free, fix = (e.mean(name, "iterations", gauge) for gauge in ("free", "fix"))
        texts.append(f"{name} {free:g} against {fix:g}")
        fewer.append(free < fix)
    return _on_euroc(e, "; ".join(texts), all(fewer))


def _euroc_accuracy(e: Evidence) -> Finding:
    worst = max(
        abs(e.mean(name, error, "free") / e.mean(name, error, "fix") - 1.0)
        for name in e.sequences
        for error in ERRORS
    )
    return _on_euroc(e, f"RMSE differ by up to {100 * worst:.2g} %", worst < e.criteria.accuracy_margin)


def _peak(e: Evidence) -> Finding:
    means = e.sweep_table.groupby("weight", sort=False)["iterations"].mean().drop("free", errors="ignore")
    top = str(means.idxmax())
    first, last = float(means.iloc[0]), float(means.iloc[-1])
    inside = top not in (str(means.index[0]), str(means.index[-1]))
    text = f"{first:.1f} at {means.index[0]}, {means.max():.1f} at {top}, {last:.1f} at {means.index[-1]}"
    return text, inside and float(means.max()) > max(first, last) + 1.0


def _weight_hardly_matters(e: Evidence) -> Finding:
    means = e.sweep_table.groupby("weight")[list(ERRORS)].mean()
    span = float(((means.max() - means.min()) / means.mean()).max())
    return f"largest relative span {100 * span:.2g} %", span < e.criteria.sweep_span


CLAIMS = (
    Claim(
        "rank",
        "III, Table I",
        "The Hessian has a rank deficiency of four",
        "4",
        "nullity 4 in every experiment, with a gap above 1e8 in the spectrum",
        _rank,
    ),
    Claim(
        "weight-accuracy",
        "V-A, Fig. 4",
        "Errors of different prior weights are very similar",
        "spans 0.005 to 0.02 %",
        "relative span of the mean RMSE over all weights below the stated one",
        _weight_hardly_matters,
    ),
    Claim(
        "weight-peak",
        "V-A, Fig. 5",
        "Iterations peak between weight zero and the threshold",
        "4 at 0, 12 at 7, 5 at 5000",
        "the mean has its maximum inside the range, more than one iteration above both ends",
        _peak,
    ),
    Claim(
        "same-accuracy",
        "V-B, Table II",
        "Fixation and free gauge have almost the same accuracy",
        "differences up to 1.2 %",
        "paired bootstrap intervals of free minus fix inside the margin, all configurations and errors",
        _same_accuracy,
    ),
    Claim(
        "neither-better",
        "V-B, Table II",
        "Neither has the better accuracy in all configurations",
        "mixed",
        "each has the smaller mean at least once",
        _neither_better,
    ),
    Claim(
        "prior-fixation-digits",
        "V-B",
        "Prior at 1e5 and fixation agree to about 8 digits",
        "8 digits",
        "mean RMSE equal to 0.5e-8",
        _prior_is_fixation,
    ),
    Claim(
        "prior-fixation",
        "V-B",
        "Prior at 1e5 has the accuracy of fixation",
        "identical",
        "paired bootstrap intervals of prior minus fix inside the margin",
        _prior_is_fixation_within_margin,
    ),
    Claim(
        "fewer-iterations",
        "V-B, Fig. 7",
        "Free takes fewer iterations (all but sine random)",
        "medians 4-6 against 5-7",
        "interval of the paired difference below zero in each of the five",
        _free_needs_fewer,
    ),
    Claim(
        "sine-random",
        "V-B, Fig. 7",
        "On sine random free takes as many iterations as fixation",
        "5 against 5",
        "interval of the paired difference contains zero",
        _sine_random_is_the_exception,
    ),
    Claim(
        "time-per-iteration",
        "V-B, Fig. 7",
        "Fixation takes the least time per iteration",
        "ratios 1.000 to 1.026",
        "median of paired ratios of free and prior to fix at least 1 in every configuration",
        _fixation_is_fastest_an_iteration,
    ),
    Claim(
        "identity",
        "VI-B",
        "The transformed free covariance is that of the gauge, Eq. (12)",
        "agrees well",
        "relative Frobenius distance at one linearisation point at most 1e-9",
        _identity,
    ),
    Claim(
        "transformed-simulation",
        "VI-B, Fig. 9",
        "Transformed and fixed covariance differ little",
        "0.11 %",
        "relative Frobenius distance between the converged estimates at most the published",
        _converged_simulation,
    ),
    Claim(
        "transformed-euroc",
        "VI-B, Fig. 10",
        "The same on EuRoC V1",
        "0.02 %",
        "relative Frobenius distance between the converged estimates at most the published",
        _converged_euroc,
    ),
    Claim(
        "euroc-iterations",
        "VII, Fig. 11",
        "Free requires fewer iterations on EuRoC",
        "8 against 10, 10 against 11",
        "fewer on both sequences",
        _euroc_iterations,
    ),
    Claim(
        "euroc-accuracy",
        "VII, Table III",
        "All have similar estimation error on EuRoC",
        "differences up to 0.3 %",
        "RMSE of free and fix within the margin",
        _euroc_accuracy,
    ),
)

_VERDICTS = {True: "holds", False: "differs", None: "not tested"}


def ledger(evidence: Evidence) -> list[Row]:
    """All claims judged: id, section, claim, published, measured, criterion, verdict."""
    rows: list[Row] = []
    for claim in CLAIMS:
        try:
            measured, holds = claim.judge(evidence)
        except NoEvidenceError as error:
            measured, holds = str(error), None
        rows.append(
            {
                "id": claim.id,
                "section": claim.section,
                "claim": claim.claim,
                "published": claim.published,
                "measured": measured,
                "criterion": claim.criterion,
                "verdict": _VERDICTS[None if holds is None else bool(holds)],
            }
        )
    return rows
