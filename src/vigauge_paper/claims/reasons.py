"""Sentences that say why, with the numbers of the experiments in data/reasons."""

from __future__ import annotations

from collections.abc import Iterable

import pandas as pd

from vigauge.geometry.so3 import Array

from ..experiments.free_spread import position_variances
from ..ids import ERRORS, FIX, NOT_FIXED
from .evidence import Evidence, NoEvidenceError
from .statistics import bootstrap, median

# Largest over smallest position variance of the free gauge: twice the paper's largest (Figs. 1, 9, 10), 2.3.
LARGEST_SPREAD = 4.6


def damping(e: Evidence) -> str:
    """Fewer iterations of the free gauge come from the damping."""
    table = e.reason("damping")
    radius = table["initial_radius"].max()
    counts = table[table["initial_radius"] == radius].groupby(["experiment", "gauge"])["iterations"].mean()
    undamped = counts.unstack()
    after = (undamped["free"] - undamped["fix"]).mean()
    usual = e.reason("tolerance")
    usual = usual[usual["function_tolerance"] == usual["function_tolerance"].max()]
    means = usual.groupby("gauge")["iterations"].mean()
    before = means["free"] - means["fix"]
    largest = (undamped["free"] - undamped["fix"]).abs().max()
    return (
        f"Levenberg-Marquardt damping: with the first radius at {radius:g} (damping {1 / radius:g} of the "
        f"diagonal) the mean difference of free and fix is {after:+.2f} iterations instead of {before:+.2f}, "
        f"in no configuration more than {largest:.2f}; means: fix {undamped['fix'].mean():.2f}, "
        f"prior {undamped['prior'].mean():.2f}, free {undamped['free'].mean():.2f}"
        f"{e.left_out('damping', 'tolerance')}"
    )


def tolerance(e: Evidence) -> str:
    """Differences of RMSE come from where each run stops."""
    table = e.reason("tolerance")
    texts = []
    for value in sorted(table["function_tolerance"].unique(), reverse=True):
        means = (
            table[table["function_tolerance"] == value].groupby(["experiment", "gauge"])[list(ERRORS)].mean()
        )
        fix = means.xs("fix", level="gauge")
        worst = {
            gauge: ((means.xs(gauge, level="gauge") - fix) / fix).abs().to_numpy().max()
            for gauge in NOT_FIXED
        }
        texts.append(f"{value:g}: free {worst['free']:.1e}, prior {worst['prior']:.1e}")
    return (
        "where each run stops: largest relative difference of mean RMSE to fixation at function tolerance "
        + "; ".join(texts)
        + e.left_out("tolerance")
    )


def squared_weight(e: Evidence) -> str:
    """The weights of the paper's figures multiply the residual: they act as their squares."""
    steps = e.reason("first_step")
    theirs = steps[steps["experiment"] == "published fig06"]
    if theirs.empty:
        raise NoEvidenceError("no published first steps")
    plain = theirs["damping_weight"]
    squares = plain * theirs["weight"].astype(float)
    return (
        "the paper's weights act as their squares: the prior error after one step of its Fig. 6 asks for a "
        f"damping along the orbit of {squares.min():.3g} to {squares.max():.3g} if w^P is the square of the "
        f"weight shown (the residual of (11) times w), but {plain.min():.2g} to {plain.max():.3g} "
        "if it is the weight"
    )


def squared_counts(e: Evidence) -> str:
    """Our iterations at the squared weights against the published medians."""
    table = e.reason("squared")
    means = table.groupby(["label", "power"], sort=False)["iterations"].mean().unstack()
    medians = table.groupby("label", sort=False)["published_median"].first()
    shown = [
        f"{label}: {medians[label]:g} / {means.loc[label, 2]:.1f} (unsquared {means.loc[label, 1]:.1f})"
        for label in means.index
    ]
    counts = f"{', '.join(shown)}{e.left_out('squared')}"
    return f"{squared_weight(e)}. Iterations, paper / ours at the squared weight: {counts}"


def plateau(e: Evidence) -> str:
    """What moves the two ends of the peak."""
    parts = []
    for _, rows in e.reason("plateau").groupby("variant", sort=False):
        means = rows.groupby("weight", sort=False)["iterations"].mean()
        parts.append(
            f"radius {rows['initial_radius'].iloc[0]:g}, tolerance {rows['function_tolerance'].iloc[0]:g}, "
            f"damping along the orbit {rows['damping_weight'].median():.2g}: "
            f"peak {means.max():.1f} at {means.idxmax()}, settled from {plateau_start(means)}"
        )
    return (
        "the peak begins where the function tolerance notices the prior and ends where the prior outweighs "
        f"the damping along the orbit: {'; '.join(parts)}{e.left_out('plateau')}. {squared_counts(e)}"
    )


def plateau_start(means: pd.Series) -> str:
    """Smallest weight from which on the mean count stays within half an iteration of the last one."""
    start = means.index[-1]
    for weight in reversed(means.index):
        if abs(means[weight] - means.iloc[-1]) > 0.5:
            break
        start = weight
    return str(start)


def prior_covariance(e: Evidence) -> str:
    """What the squared weight does to the prior's covariance."""
    squared = [float(e.covariance(name)["relative_frobenius_prior_squared"]) for name in e.covariances]
    return (
        f"the prior's own covariance, I / w^P, comes on top of the fixed one. {squared_weight(e)}; under the "
        f"square of the weight the distance is {100 * min(squared):.1g} % to {100 * max(squared):.1g} %"
    )


def prior_digits(e: Evidence) -> str:
    """Both halves: the weight and the tolerance."""
    table = e.reason("weights").groupby(["experiment", "gauge"])[list(ERRORS)].mean()
    fix = table.xs("fix", level="gauge")
    parts = [
        f"{weight}: {(table.xs(weight, level='gauge') - fix).abs().to_numpy().max():.1e}"
        for weight in e.reason("weights")["gauge"].drop_duplicates()
        if weight != "fix"
    ]
    shown = f"{', '.join(parts)}{e.left_out('weights')}"
    by_weight = f"largest difference of mean RMSE to fixation by w^P: {shown}"
    return f"{squared_weight(e)}; {by_weight}; {tolerance(e)}"


def iteration_time(e: Evidence) -> str:
    """What the smaller system of fixation can save of an iteration, against what is measured."""
    table = e.reason("iteration_time")
    texts = []
    for keyframes, rows in table.groupby("n_keyframes"):
        wide = rows.pivot(index="repeat", columns="what", values="seconds")
        middle = wide.median()
        share = 100 * middle["dense 9N"] / middle["free"]
        saved = 100 * (middle["dense 9N"] - middle["dense 9N - 4"]) / middle["free"]
        ratios = ", ".join(
            f"{gauge} {bootstrap([(wide[gauge] / wide[FIX]).to_numpy()], median, e.criteria)}"
            for gauge in NOT_FIXED
        )
        texts.append(
            f"N = {keyframes}: dense solve {share:.1f} % of an iteration of {1e3 * middle['free']:.2g} ms, "
            f"four rows fewer save {saved:.2g} % of it, ratio to fix measured {ratios}"
        )
    return (
        "fixation can save no more than four rows of the dense reduced system. In runs of equal length: "
        f"{'; '.join(texts)}; published up to 2.6 %"
    )


def position_variance(e: Evidence, name: str, gauge: str) -> Array:
    """(N,) variance of each keyframe's position, m^2: trace of its block."""
    arrays = e.covariance(name)
    return position_variances(arrays[gauge], int(arrays["n_keyframes"]))


def free_ratios(e: Evidence) -> dict[str, float]:
    """Largest over smallest position variance of the free gauge in every experiment."""
    ratios = {}
    for name in e.covariances:
        variance = position_variance(e, name, "free")
        ratios[name] = float(variance.max() / variance.min()) if variance.min() > 0.0 else float("inf")
    return ratios


def free_spread(e: Evidence) -> str:
    """Which landmarks are drawn decides how far from the centre of all points the keyframes lie.

    It explains a ratio that is too large if in most of the other draws of that experiment it is not.
    """
    table = e.reason("free_spread")
    ratios = free_ratios(e)
    outside = [name for name, ratio in ratios.items() if ratio >= LARGEST_SPREAD]
    worst = max(outside or e.configurations, key=lambda name: ratios[name])
    drawn = table.loc[table["experiment"] == worst, "ratio"]
    if drawn.empty:
        return f"not explained: {worst} is not simulated, and has no other draw"
    inside = int((drawn < LARGEST_SPREAD).sum())
    text = (
        f"which landmarks are drawn: in {len(drawn)} other draws of {worst} the ratio is "
        f"{drawn.min():.2g} to {drawn.max():.2g}, below {LARGEST_SPREAD:g} in {inside}. The variance goes "
        "with the squared distance to the centre of all positions and landmarks (over keyframes, correlation "
        f"{table['correlation'].min():.2f} to {table['correlation'].max():.2f} in all configurations)"
        f"{e.left_out('free_spread')}"
    )
    return text if 2 * inside > len(drawn) else f"not explained: {text}"


def _exchange(e: Evidence, name: str, figure: str) -> str:
    table = 100 * e.reason("exchange").set_index("experiment")
    if name not in table.index:
        raise NoEvidenceError(f"the covariance of {name} is withheld")
    ours, theirs = table.loc[name], table.loc[f"published {figure}"]
    return (
        "one exchanged pair, (3N+1, 3N) and (3N+1, 3N+1), in the published fixed covariance: with it our "
        f"{ours['relative_frobenius']:.2g} % becomes {ours['with_exchanged_pair']:.2g} %; the published "
        f"pixels give {theirs['with_exchanged_pair']:.2g} % as printed and "
        f"{theirs['relative_frobenius']:.2g} % with the pair put back "
        "(both with the rounding to 256 grey levels)"
    )


def exchange_simulation(e: Evidence) -> str:
    """The exchanged pair, in Fig. 9."""
    table = e.reason("exchange").set_index("experiment")
    shown = 100 * table.loc[[name for name in e.configurations if name in table.index], "with_exchanged_pair"]
    return (
        f"{_exchange(e, e.sweep_configuration, 'fig09')}; with the pair exchanged, our {len(shown)} "
        f"configurations give {shown.min():.2g} to {shown.max():.2g} %"
    )


def exchange_sequence(e: Evidence) -> str:
    """The exchanged pair, in Fig. 10."""
    return _exchange(e, e.vicon_room, "fig10")


def _orbit_damping(e: Evidence, names: Iterable[str]) -> str:
    steps = e.reason("first_step").set_index("experiment")["damping_weight"]
    shown = ", ".join(f"{name} {steps[name]:.2g}" for name in names)
    return f"damping along the orbit, read off the first step, in units of w^P: {shown}"


def prior_against_damping(e: Evidence) -> str:
    """The prior outweighs the damping in simulation."""
    return f"the prior outweighs the {_orbit_damping(e, e.configurations)}"


def prior_against_damping_on_sequences(e: Evidence) -> str:
    """With their many landmarks the sequences damp the orbit more than the prior pulls."""
    return (
        f"with more landmarks the diagonal grows, and so does the {_orbit_damping(e, e.sequences)}; "
        f"that slows the prior. {squared_weight(e)}"
    )
