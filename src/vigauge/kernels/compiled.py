"""How every kernel is compiled."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., Any])

FLAGS: dict[str, Any] = {
    "nogil": True,
    # Division by zero gives infinity as in NumPy: a trial step may put a landmark at depth zero.
    "error_model": "numpy",
    # One kernel inside another becomes part of it. Else the process that compiles both calls the one's own
    # code, later ones the copy on disk, and the last digits differ.
    "forceinline": True,
    # Fused multiply-add and sums in any order are allowed; infinities and NaN keep their meaning.
    "fastmath": {"contract", "reassoc", "nsz"},
}


def kernel(function: F) -> F:
    """``function`` as machine code without the interpreter's lock, kept on disk where that can be written."""
    return _compiled(function, FLAGS)


def part(function: F) -> F:
    """A kernel that makes no array: a part of others, most of all.

    Numba then leaves out the counting of references to the arrays it is given (``_nrt``, as its own
    functions do), which costs as much as a small loop.
    """
    return _compiled(function, FLAGS | {"_nrt": False})


def _compiled(function: F, flags: dict[str, Any]) -> F:
    try:
        return cast(F, numba.njit(cache=True, **flags)(function))
    except RuntimeError as error:  # neither this folder nor the user's cache folder
        warnings.warn(f"kernels are compiled anew in every process: {error}", stacklevel=3)
        return cast(F, numba.njit(**flags)(function))
