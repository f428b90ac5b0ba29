"""Claims on covariances: Section VI, Figs. 1, 9, 10."""

from __future__ import annotations

import numpy as np

from ..experiments.evidence import Evidence
from ..experiments.free_spread import LARGEST_SPREAD, free_ratios, position_variance
from ..prior import INFORMATION
from . import reasons
from .claim import Claim, Finding, on_euroc


def _grows(e: Evidence, name: str) -> tuple[str, bool]:
    variance = position_variance(e, name, "fixed")
    first, middle, last = (float(part.mean()) for part in np.array_split(variance, 3))
    deviation = 1e3 * np.sqrt([variance[0], first, middle, last])
    text = (
        f"{name}: {deviation[0]:.2g} mm at the first keyframe; root of the mean variance of the first third "
        f"{deviation[1]:.2g}, of the middle {deviation[2]:.2g}, of the last {deviation[3]:.2g} mm"
    )
    return text, variance[0] == 0.0 and first < middle < last


def _grows_simulation(e: Evidence) -> Finding:
    return _grows(e, e.sweep_configuration)


def _grows_euroc(e: Evidence) -> Finding:
    return on_euroc(e, *_grows(e, e.machine_hall))


def _spread_under_free(e: Evidence) -> Finding:
    ratios = free_ratios(e)
    shown = ", ".join(f"{name} {ratio:.2g}" for name, ratio in ratios.items())
    return f"largest over smallest position variance: {shown}", max(ratios.values()) < LARGEST_SPREAD


def _prior_covariance(e: Evidence) -> Finding:
    key = "relative_frobenius_prior" + ("_as_printed" if e.reading == INFORMATION else "")
    found = {name: float(e.covariance(name)[key]) for name in e.covariances}
    text = ", ".join(f"{name} {100 * value:.3g} %" for name, value in found.items())
    return f"relative Frobenius distance {text}", max(found.values()) < e.criteria.covariance_margin


def _identity(e: Evidence) -> Finding:
    worst = max(float(e.covariance(name)["relative_frobenius_same_point"]) for name in e.covariances)
    return f"at most {worst:.1e}", worst <= 1e-9


def _converged_simulation(e: Evidence) -> Finding:
    name = e.sweep_configuration
    value = float(e.covariance(name)["relative_frobenius_converged"])
    return f"{100 * value:.2g} % ({name})", value <= 0.0011


def _converged_euroc(e: Evidence) -> Finding:
    name = e.vicon_room
    value = float(e.covariance(name)["relative_frobenius_converged"])
    return on_euroc(e, f"{100 * value:.2g} % ({name})", value <= 0.0002)


def _ellipses(e: Evidence) -> Finding:
    name = e.machine_hall
    transformed, fixed = (position_variance(e, name, gauge)[1:] for gauge in ("transformed", "fixed"))
    worst = float(np.max(np.abs(transformed / fixed - 1.0)))
    return on_euroc(e, f"position variances differ by up to {100 * worst:.2g} % ({name})", worst < 0.058)


COVARIANCE = (
    Claim(
        "fixed-grows",
        ("fig09",),
        "VI-A, Fig. 9",
        "Under fixation the first position's uncertainty is zero, and it increases afterwards",
        "shown",
        "zero at the first keyframe; mean position variance of each third above that of the third before",
        _grows_simulation,
    ),
    Claim(
        "fixed-grows-euroc",
        ("fig01",),
        "VI-A, Figs. 1, 10",
        "The same on EuRoC",
        "shown",
        "as above, on the sequence of Fig. 1",
        _grows_euroc,
    ),
    Claim(
        "free-spreads",
        ("fig01", "fig09", "fig10", "free_spread"),
        "VI-A, Figs. 1, 9, 10",
        "In the free gauge the uncertainty is spread over all positions",
        "ratios 1.7 to 2.3",
        "largest over smallest position variance below twice the largest published, 2.3, in every experiment",
        _spread_under_free,
        reasons.free_spread,
    ),
    Claim(
        "prior-covariance",
        ("fig09", "reading"),
        "VI-A",
        "With a high weight the prior's covariance is similar to fixation's",
        "similar",
        "relative Frobenius distance below the covariance margin in every experiment",
        _prior_covariance,
        reasons.reading,
    ),
    Claim(
        "identity",
        ("fig09", "fig10"),
        "VI-B",
        "The transformed free covariance is that of the gauge, Eq. (12)",
        "agrees well",
        "relative Frobenius distance at one linearisation point at most 1e-9",
        _identity,
    ),
    Claim(
        "transformed-simulation",
        ("fig09", "exchange"),
        "VI-B, Fig. 9",
        "Transformed and fixed covariance differ little",
        "0.11 %",
        "relative Frobenius distance between the converged estimates at most the published",
        _converged_simulation,
        reasons.exchange_simulation,
    ),
    Claim(
        "transformed-euroc",
        ("fig10", "exchange"),
        "VI-B, Fig. 10",
        "The same on EuRoC V1",
        "0.02 %",
        "relative Frobenius distance between the converged estimates at most the published",
        _converged_euroc,
        reasons.exchange_sequence,
    ),
    Claim(
        "ellipses-euroc",
        ("fig01",),
        "Fig. 1",
        "Transformed position uncertainties agree well with fixation's on EuRoC MH",
        "within 5.8 %",
        "position variances of all keyframes within the published difference",
        _ellipses,
    ),
)
