"""Why results are as they are: a sentence of an experiment each."""

from __future__ import annotations

from ..experiments import damping as _damping
from ..experiments import free_spread as _free_spread
from ..experiments import iteration_time as _iteration_time
from ..experiments import reading as _reading
from ..experiments import tolerance as _tolerance
from ..experiments.exchange import exchange_sequence, exchange_simulation

__all__ = [
    "damping",
    "exchange_sequence",
    "exchange_simulation",
    "free_spread",
    "iteration_time",
    "reading",
    "tolerance",
]

damping = _damping.sentence
reading = _reading.sentence
tolerance = _tolerance.sentence
free_spread = _free_spread.sentence
iteration_time = _iteration_time.sentence
