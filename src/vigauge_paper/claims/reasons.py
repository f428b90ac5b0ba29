"""Why results are as they are: sentences of the experiments, alone or joined."""

from __future__ import annotations

from ..experiments import damping as _damping
from ..experiments import free_spread as _free_spread
from ..experiments import iteration_time as _iteration_time
from ..experiments import plateau as _plateau
from ..experiments import squared as _squared
from ..experiments import tolerance as _tolerance
from ..experiments import weights as _weights
from ..experiments.evidence import Evidence
from ..experiments.exchange import exchange_sequence, exchange_simulation
from ..experiments.first_step import (
    prior_against_damping,
    prior_against_damping_on_sequences,
    squared_weight,
)

__all__ = [
    "damping",
    "exchange_sequence",
    "exchange_simulation",
    "free_spread",
    "iteration_time",
    "plateau",
    "prior_against_damping",
    "prior_against_damping_on_sequences",
    "prior_covariance",
    "prior_digits",
    "squared_weight",
    "tolerance",
]

damping = _damping.sentence
tolerance = _tolerance.sentence
free_spread = _free_spread.sentence
iteration_time = _iteration_time.sentence


def plateau(e: Evidence) -> str:
    """What moves the two ends of the peak, and our counts at the squared weights."""
    return f"{_plateau.sentence(e)}. {squared_weight(e)}. {_squared.sentence(e)}"


def prior_covariance(e: Evidence) -> str:
    """What the squared weight does to the prior's covariance."""
    squared = [float(e.covariance(name)["relative_frobenius_prior_squared"]) for name in e.covariances]
    return (
        f"the prior's own covariance, I / w^P, comes on top of the fixed one. {squared_weight(e)}; under the "
        f"square of the weight the distance is {100 * min(squared):.1g} % to {100 * max(squared):.1g} %"
    )


def prior_digits(e: Evidence) -> str:
    """Both halves: the weight and the tolerance."""
    return f"{squared_weight(e)}; {_weights.sentence(e)}; {tolerance(e)}"
