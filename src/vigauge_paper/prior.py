"""What a prior's weight means: the paper's text and its figures differ.

In the text of Section V-A the weight w^P is the information of the prior, 1 / sigma^2. In the paper's own
figures it multiplies the residual of Eq. (11), so that the information is its square: experiment ``reading``.
"""

from collections.abc import Iterable

from vigauge.gauge.gauges import FreeGauge, Gauge, PriorGauge, three_gauges

from .ids import FREE, PRIOR_AS_PRINTED

# What a weight multiplies.
RESIDUAL, INFORMATION = "residual", "information"
READINGS = (RESIDUAL, INFORMATION)
MEANING = {RESIDUAL: "multiplies the residual", INFORMATION: "is the information"}


def information(weight: float | str, reading: str) -> float:
    """Information (1/m^2, 1/rad^2) of a prior whose weight is read so."""
    return {RESIDUAL: float(weight) ** 2, INFORMATION: float(weight)}[reading]


def gauges(weight: float, reading: str) -> dict[str, Gauge]:
    """The three approaches, and the prior as the text has it where ``reading`` is another."""
    out = three_gauges(information(weight, reading))
    if reading != INFORMATION:
        out[PRIOR_AS_PRINTED] = PriorGauge(weight)
    return out


def swept(weights: Iterable[str], reading: str) -> dict[str, Gauge]:
    """A prior for every weight of a sweep, by the weight as it is written, and the free gauge."""
    out: dict[str, Gauge] = {weight: PriorGauge(information(weight, reading)) for weight in weights}
    return out | {FREE: FreeGauge()}
