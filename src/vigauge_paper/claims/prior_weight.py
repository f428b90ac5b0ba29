"""Claims on the prior weight: Section V-A, Figs. 4 to 6."""

import numpy as np
import pandas as pd

from ..experiments import reading, weights
from ..experiments.evidence import Evidence, NoEvidenceError
from ..ids import ERRORS
from .claim import Claim, Finding, verdict

# "Smaller prior weights (e.g., 50-500)", Section V-A.
SMALL_WEIGHTS = (50.0, 500.0)


def _means(e: Evidence) -> pd.DataFrame:
    """Means by weight, in the order of the sweep."""
    weighted = e.sweep_table.query("weight != 'free'")
    return weighted.groupby("weight", sort=False)[["iterations", *ERRORS]].mean()


def _decades(first: str, last: str) -> float:
    return float(np.log10(float(last) / float(first))) if float(first) > 0.0 else np.inf


def _weight_hardly_matters(e: Evidence) -> Finding:
    means = e.sweep_table.groupby("weight")[list(ERRORS)].mean()
    span = float(((means.max() - means.min()) / means.mean()).max())
    return f"largest relative span {100 * span:.2g} %", verdict(span < e.criteria.sweep_span)


def _errors_settle(e: Evidence) -> Finding:
    means = _means(e)[list(ERRORS)]
    allowed = e.criteria.settled_span * (means.max() - means.min())
    start = means.index[-1]
    for position in range(len(means) - 1, -1, -1):
        tail = means.iloc[position:]
        if bool((tail.max() - tail.min() > allowed).any()):
            break
        start = means.index[position]
    last = means.index[-1]
    text = f"within {100 * e.criteria.settled_span:g} % of the span over all weights from {start} to {last}"
    return text, verdict(start != means.index[0] and _decades(start, last) >= 1.0)


def _peak(e: Evidence) -> Finding:
    means = _means(e)["iterations"]
    top = str(means.idxmax())
    first, last = float(means.iloc[0]), float(means.iloc[-1])
    inside = top not in (str(means.index[0]), str(means.index[-1]))
    text = f"{first:.1f} at {means.index[0]}, {means.max():.1f} at {top}, {last:.1f} at {means.index[-1]}"
    return text, verdict(inside and float(means.max()) > max(first, last) + 1.0)


def _settled_from(means: pd.Series) -> str:
    """Smallest weight from which on the mean count stays within half an iteration of the last one."""
    start = means.index[-1]
    for weight in reversed(means.index):
        if abs(means[weight] - means.iloc[-1]) > 0.5:
            break
        start = weight
    return str(start)


def _cost_settles(e: Evidence) -> Finding:
    means = _means(e)["iterations"]
    start, last = _settled_from(means), str(means.index[-1])
    good = start != means.index[0] and _decades(start, last) >= 2.0
    return f"within half an iteration from {start} on", verdict(good)


def _paths(e: Evidence) -> pd.DataFrame:
    """Means over trials by weight and iteration; a run that ended stays where it ended."""
    table = e.sweep_paths
    columns = ["mean_reprojection_px", "prior_position_m", "prior_yaw_rad"]
    wide = table.pivot(index=["weight", "trial"], columns="iteration", values=columns)
    filled = wide.T.groupby(level=0).ffill().T
    return filled.groupby("weight").mean()


def _large_weight(e: Evidence) -> Finding:
    paths = _paths(e)
    largest = max((w for w in paths.index if w != "free"), key=float)
    shares = [
        float(paths.loc[largest, column].max() / paths.loc["free", column].max())
        for column in ("prior_position_m", "prior_yaw_rad")
    ]
    pixels = paths.loc[largest, "mean_reprojection_px"]
    text = (
        f"at {largest} the prior errors stay below {max(shares):.1e} of the free gauge's while the "
        f"reprojection error falls from {pixels.iloc[0]:.1f} to {pixels.iloc[-1]:.2f} px"
    )
    return text, verdict(max(shares) <= 1e-3 and pixels.iloc[-1] < 0.5 * pixels.iloc[0])


def _small_weight(e: Evidence) -> Finding:
    paths = _paths(e)
    low, high = SMALL_WEIGHTS
    small = [w for w in paths.index if w != "free" and low <= float(w) <= high]
    if not small:
        raise NoEvidenceError(f"no weight between {low:g} and {high:g}")
    texts, good = [], []
    for weight in sorted(small, key=float):
        pixels, error = paths.loc[weight, "mean_reprojection_px"], paths.loc[weight, "prior_position_m"]
        excess = float(pixels[2] / pixels.iloc[-1] - 1.0)
        kept, left = float(error[2] / error.max()), float(error.iloc[-1] / error.max())
        texts.append(f"{weight}: {100 * excess:.1g} %, {100 * kept:.0f} %, {100 * left:.1g} %")
        good.append(excess < 0.01 and kept > 0.1 and left < 0.1)
    text = "reprojection error above its end, prior error left after two iterations, and at the end: "
    return text + "; ".join(texts), verdict(all(good))


def _zero_weight(e: Evidence) -> Finding:
    table = e.sweep_paths
    keys = ["trial", "iteration"]
    zero = next((w for w in table["weight"].unique() if w != "free" and float(w) == 0.0), None)
    if zero is None:
        raise NoEvidenceError("weight zero is not in the sweep")
    both = [table[table["weight"] == w].set_index(keys) for w in (zero, "free")]
    same_length = both[0].index.sort_values().equals(both[1].index.sort_values())
    columns = ["cost", "mean_reprojection_px", "prior_position_m"]
    difference = (both[0][columns] - both[1][columns]).abs() / (1e-300 + both[1][columns].abs())
    worst = float(difference.max().max())
    return f"largest relative difference of the paths {worst:.1e}", verdict(same_length and worst <= 1e-9)


def _unstable(e: Evidence) -> Finding:
    table = e.reason("weights", failed=True)
    fix = table[table["gauge"] == "fix"].set_index(["experiment", "trial"])
    large = table[table["gauge"] != "fix"].set_index(["experiment", "trial"])
    ratio = large["cost"] / fix["cost"].reindex(large.index)
    bad = (
        ~large["converged"]
        | (ratio > 1.01)
        | (large["iterations"] > 2 * fix["iterations"].reindex(large.index))
    )
    weights = list(dict.fromkeys(large["gauge"]))
    text = (
        f"{int(bad.sum())} of {len(bad)} runs at {weights[0]} to {weights[-1]} fail; cost at most "
        f"{ratio.max() - 1.0:.1e} above fixation's, {int((large['rejected'] > 0).sum())} with a rejected step"
    )
    return text, verdict(bool(bad.any()))


PRIOR_WEIGHT = (
    Claim(
        "weight-accuracy",
        ("fig04", "tolerance"),
        "V-A, Fig. 4",
        "Errors of different prior weights are very similar",
        "spans 0.005 to 0.02 %",
        "relative span of the mean RMSE over all weights below {sweep_span}, which counts as very similar",
        _weight_hardly_matters,
        "The prior only chooses among equal minima; runs stop at slightly different points of them.",
    ),
    Claim(
        "weight-accuracy-settles",
        ("fig04", "tolerance"),
        "V-A, Fig. 4",
        "The RMSE stabilises above a threshold of the prior weight",
        "1e-7 from 1e4 on",
        "from some weight on, for at least a decade, span at most {settled_span} of that over all weights",
        _errors_settle,
        "A strong prior holds the first pose as fixation does, so nothing is left to change.",
    ),
    Claim(
        "weight-peak",
        ("fig05", "reading"),
        "V-A, Fig. 5",
        "Iterations peak between weight zero and the threshold",
        "4 at 0, 12 at 7, 5 at 5000",
        "the mean has its maximum inside the range, more than one iteration above both ends",
        _peak,
        "A weak prior is reached last: it pulls along the orbit when all else has converged.",
    ),
    Claim(
        "weight-cost-settles",
        ("fig05", "prior_reading", "reading"),
        "V-A, Fig. 5",
        "Iterations stabilise above a threshold of the prior weight",
        "5 from 500 on",
        "means within half an iteration of the last from some weight on, for at least two decades",
        _cost_settles,
        reading.sentence,
    ),
    Claim(
        "regime-large",
        ("fig06",),
        "V-A, Fig. 6",
        "Large weights keep the prior error almost at zero while the reprojection error falls",
        "1e-11 of free's at 1e8",
        "prior errors at the largest weight at most 1e-3 of the free gauge's; reprojection error halved",
        _large_weight,
        "A prior that outweighs the damping leaves no way along the orbit.",
    ),
    Claim(
        "regime-small",
        ("fig06", "reading"),
        "V-A, Fig. 6",
        "Weights of 50-500 cut the reprojection error in two iterations, then move along the orbit",
        "0.02 %, 60 % (position), 1 % at 100",
        "within 1 % of the end after two iterations, over a tenth of the prior error left; at the end less",
        _small_weight,
        "The prior's pull is weaker than the damping, so the way along the orbit takes more steps.",
    ),
    Claim(
        "regime-zero",
        ("fig06",),
        "V-A, Fig. 6",
        "The free gauge behaves as weight zero",
        "stated",
        "paths of the same length, equal to 1e-9",
        _zero_weight,
        "A prior of weight zero adds nothing to the cost.",
    ),
    Claim(
        "large-weights-unstable",
        ("weights", "reading"),
        "V-A",
        "Extremely large weights sometimes make the optimisation unstable",
        "sometimes",
        "a run fails, costs 1 % more than fixation's, or takes twice as many iterations",
        _unstable,
        weights.sentence,
    ),
)
