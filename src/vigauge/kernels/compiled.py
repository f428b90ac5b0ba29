"""How every kernel is compiled."""

from __future__ import annotations

import hashlib
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

from ..geometry import so3

_CONFIG: Any = numba.config
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


# Kernels are made of parts and constants in other files: machine code on disk is that of all sources
# as they are now.
_FILES = (*sorted(Path(__file__).parent.glob("*.py")), Path(so3.__file__))
SOURCES = hashlib.sha256(b"".join(file.read_bytes() for file in _FILES)).hexdigest()


def _compiled(function: F, flags: dict[str, Any]) -> F:
    try:
        dispatcher: Any = _dispatcher(function, cache=True, **flags)
    except RuntimeError as error:  # neither this folder nor the user's cache folder
        warnings.warn(f"kernels are compiled anew in every process: {error}", stacklevel=3)
        return cast(F, _dispatcher(function, **flags))
    # Numba looks at the time and size of the kernel's own file only.
    dispatcher._cache._cache_file._source_stamp = SOURCES
    return cast(F, dispatcher)


def _dispatcher(function: Callable[..., Any], **options: Any) -> Any:
    """The kernel, compiled also where NUMBA_DISABLE_JIT=1 is set to debug other code."""
    if not _CONFIG.DISABLE_JIT:
        return numba.njit(**options)(function)
    with _enabled():
        dispatcher = numba.njit(**options)(function)
    compile_later = dispatcher.compile

    def compile_enabled(*arguments: Any) -> Any:
        with _enabled():
            return compile_later(*arguments)

    dispatcher.compile = compile_enabled
    return dispatcher


@contextmanager
def _enabled() -> Iterator[None]:
    """Compilation for as long as it takes; the user's functions stay as they asked for."""
    disabled, _CONFIG.DISABLE_JIT = _CONFIG.DISABLE_JIT, 0
    try:
        yield
    finally:
        _CONFIG.DISABLE_JIT = disabled
