"""One way to run a loop on one core or on several: same pieces, same order of sums, same bytes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from threadpoolctl import threadpool_limits

Item = TypeVar("Item")
Result = TypeVar("Result")


class Workers:
    """Threads for compiled code, which runs without the interpreter's lock. One thread is the caller itself.

    The pieces of a loop do not depend on the number of threads and results come back in order,
    so neither do the numbers. Close after use, or use as a context.
    """

    def __init__(self, threads: int = 1) -> None:
        self._pool = ThreadPoolExecutor(threads) if threads > 1 else None
        # Threads of BLAS under ours would wait for each other.
        self._limit = threadpool_limits(limits=1, user_api="blas") if threads > 1 else None

    def map(self, function: Callable[[Item], Result], items: Iterable[Item]) -> Iterator[Result]:
        """Results of ``function`` in the order of ``items``."""
        return map(function, items) if self._pool is None else self._pool.map(function, items)

    def __enter__(self) -> Workers:
        return self

    def __exit__(self, *_: object) -> None:
        if self._pool is not None and self._limit is not None:
            self._pool.shutdown()
            self._limit.restore_original_limits()


ALONE = Workers()
