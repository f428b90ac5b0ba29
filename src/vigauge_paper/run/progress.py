"""How far long work has got: a bar on a terminal, lines elsewhere."""

import time
from collections.abc import Iterable, Iterator
from typing import TypeVar

from tqdm import tqdm

from vigauge.cli.command import LOG

T = TypeVar("T")

_EVERY_S = 5.0


def progress(items: Iterable[T], what: str, unit: str, total: int) -> Iterator[T]:
    """The items; where standard error is no terminal, the log says every few seconds how many are done."""
    bar = tqdm(items, total=total, desc=what, unit=unit, leave=False, disable=None)
    told = time.monotonic()
    for done, item in enumerate(bar):
        if bar.disable and time.monotonic() - told > _EVERY_S:
            told = time.monotonic()
            LOG.info("%s: %d of %d %ss", what, done, total, unit)
        yield item
