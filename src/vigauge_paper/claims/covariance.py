"""Claims on covariances: Section VI, Figs. 1, 9, 10."""

import numpy as np

from vigauge.geometry.so3 import Array

from ..experiments.evidence import Evidence
from ..experiments.exchange import sentence as exchanged_pair
from ..ids import ERRORS, FIX
from ..prior import INFORMATION
from .claim import Claim, Finding, on_euroc, spread, verdict

# Caption of Fig. 9: relative Frobenius distance of the transformed covariance to the fixed one.
PUBLISHED_CONVERGED = 0.0011


def position_variance(e: Evidence, name: str, gauge: str) -> Array:
    """(N,) variance of each keyframe's position, m^2: trace of its block."""
    arrays = e.covariance(name)
    n = int(arrays["n_keyframes"])
    return np.diagonal(arrays[gauge])[: 3 * n].reshape(n, 3).sum(axis=1)


def _grows(e: Evidence, name: str) -> Finding:
    variance = position_variance(e, name, "fixed")
    first, middle, last = (float(part.mean()) for part in np.array_split(variance, 3))
    deviation = 1e3 * np.sqrt([variance[0], first, middle, last])
    text = (
        f"{name}: {deviation[0]:.2g} mm at the first keyframe; root of the mean variance of the first third "
        f"{deviation[1]:.2g}, of the middle {deviation[2]:.2g}, of the last {deviation[3]:.2g} mm"
    )
    return text, verdict(variance[0] == 0.0 and first < middle < last)


def _ratio(variance: Array) -> float:
    return float(variance.max() / variance.min()) if variance.min() > 0.0 else float("inf")


def _spread_under_free(e: Evidence) -> Finding:
    free = {name: _ratio(position_variance(e, name, "free")) for name in e.covariances}
    fixed = {name: _ratio(position_variance(e, name, "fixed")[1:]) for name in e.covariances}
    closest = max(free, key=lambda name: free[name] / fixed[name])
    text = (
        f"largest over smallest position variance {spread(list(free.values()), '.2g')}; nearest to that of "
        f"fixation in {closest}, {free[closest]:.2g} against {fixed[closest]:.2g}"
    )
    return text, verdict(free[closest] < fixed[closest])


def _prior_covariance(e: Evidence) -> Finding:
    key = "relative_frobenius_prior" + ("_as_printed" if e.reading == INFORMATION else "")
    worst = max(float(e.covariance(name)[key]) for name in e.covariances)
    text = f"relative Frobenius distance at most {100 * worst:.2g} %"
    return text, verdict(worst < e.criteria.covariance_margin)


def _identity(e: Evidence) -> Finding:
    worst = max(float(e.covariance(name)["relative_frobenius_same_point"]) for name in e.covariances)
    return f"at most {worst:.1e}", verdict(worst <= 1e-9)


def _converged(e: Evidence, name: str, published: float) -> Finding:
    value = float(e.covariance(name)["relative_frobenius_converged"])
    return f"{100 * value:.2g} % ({name})", verdict(value <= published)


def _ellipses(e: Evidence) -> Finding:
    name = e.machine_hall
    transformed, fixed = (position_variance(e, name, gauge)[1:] for gauge in ("transformed", "fixed"))
    worst = float(np.max(np.abs(transformed / fixed - 1.0)))
    text = f"position variances differ by up to {100 * worst:.2g} % ({name})"
    return on_euroc(e, text, verdict(worst < 0.058))


def _beside_errors(e: Evidence, name: str, why: str) -> str:
    """The reason, and how errors compare with the sigmas that the claim is about, both in the fixed gauge."""
    if e.source != "euroc":
        return why
    variances = np.diagonal(e.covariance(name)["fixed"]).reshape(3, -1, 3).sum(axis=2).mean(axis=1)
    sigmas = np.sqrt(variances) * (1.0, 180.0 / np.pi, 1.0)
    ratios = [e.mean(name, error, FIX) / sigma for error, sigma in zip(ERRORS, sigmas, strict=True)]
    return (
        f"{why} On {name} errors are {spread(ratios, '.2g')} times the predicted sigmas (RMSE of position, "
        "rotation, velocity over the root of the mean variance), so the claim compares covariances with one "
        "another, not with errors."
    )


COVARIANCE = (
    Claim(
        "fixed-grows",
        ("fig09",),
        "VI-A, Fig. 9",
        "Under fixation the first position's uncertainty is zero, and it increases afterwards",
        "shown",
        "zero at the first keyframe; mean position variance of each third above that of the third before",
        lambda e: _grows(e, e.sweep_configuration),
        "Errors of the relative motion add up with the distance from the pose that is held.",
    ),
    Claim(
        "fixed-grows-euroc",
        ("fig10",),
        "VI-A, Figs. 1, 10",
        "The same on EuRoC",
        "shown",
        "as above, on the sequence of Fig. 10",
        lambda e: on_euroc(e, *_grows(e, e.vicon_room)),
        lambda e: _beside_errors(
            e,
            e.vicon_room,
            "It is seen where the camera flies on; one that looks at one place does not lose its position.",
        ),
    ),
    Claim(
        "free-spreads",
        ("fig01", "fig09", "fig10"),
        "VI-A, Figs. 1, 9, 10",
        "In the free gauge the uncertainty is spread over all positions",
        "ratios 1.7 to 2.3",
        "largest over smallest position variance below fixation's, whose first pose is left out, everywhere",
        _spread_under_free,
        "The free gauge holds the mean of all points; no pose is singled out.",
    ),
    Claim(
        "prior-covariance",
        ("fig09", "reading"),
        "VI-A",
        "With a high weight the prior's covariance is similar to fixation's",
        "similar",
        "relative Frobenius distance below {covariance_margin} in every experiment",
        _prior_covariance,
        "The prior's own covariance, the inverse of its information, comes on top of the fixed one.",
    ),
    Claim(
        "identity",
        ("fig09", "fig10"),
        "VI-B",
        "The transformed free covariance is that of the gauge, Eq. (12)",
        "agrees well",
        "relative Frobenius distance at one linearisation point at most 1e-9",
        _identity,
        "The transformation is an identity of linear algebra at one linearisation point.",
    ),
    Claim(
        "transformed-simulation",
        ("fig09", "exchange"),
        "VI-B, Fig. 9",
        "Transformed and fixed covariance differ little",
        "0.11 %",
        "relative Frobenius distance between the converged estimates at most the published",
        lambda e: _converged(e, e.sweep_configuration, PUBLISHED_CONVERGED),
        lambda e: exchanged_pair(e, e.sweep_configuration),
    ),
    Claim(
        "transformed-euroc",
        ("fig10", "exchange"),
        "VI-B, Fig. 10",
        "The same on EuRoC V1",
        "0.02 %",
        "relative Frobenius distance between the converged estimates at most the published",
        lambda e: on_euroc(e, *_converged(e, e.vicon_room, 0.0002)),
        lambda e: _beside_errors(
            e,
            e.vicon_room,
            "Here too the published number holds the exchanged pair; ours is the distance of two runs.",
        ),
    ),
    Claim(
        "ellipses-euroc",
        ("fig01",),
        "Fig. 1",
        "Transformed position uncertainties agree well with fixation's on EuRoC MH",
        "within 5.8 %",
        "position variances of all keyframes within the published difference",
        _ellipses,
        lambda e: _beside_errors(
            e,
            e.machine_hall,
            "Both runs converge to nearly one point, where the two covariances are one.",
        ),
    ),
)
