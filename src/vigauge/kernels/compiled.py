"""How every kernel is compiled."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., Any])


def kernel(function: F) -> F:
    """``function`` as machine code: kept on disk, without the interpreter's lock, with IEEE specials.

    Division by zero gives infinity as in NumPy: a trial step may put a landmark at depth zero.
    Fused multiply-add and sums in any order are allowed, infinities and NaN keep their meaning.
    """
    decorate = numba.njit(
        cache=True, nogil=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"}
    )
    return cast(F, decorate(function))
