"""Ways to damage an argument: no answer is right for any of them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

Damage = Callable[[np.ndarray, np.random.Generator], object]


def _spoilt(array: np.ndarray, rng: np.random.Generator, value: float) -> np.ndarray:
    out = np.array(array, dtype=float)
    out.flat[rng.integers(out.size)] = value
    return out


ARRAYS: dict[str, Damage] = {
    "NaN": lambda a, rng: _spoilt(a, rng, np.nan),
    "infinity": lambda a, rng: _spoilt(a, rng, -np.inf),
    "overflow": lambda a, rng: _spoilt(a, rng, 1e200),
    "a row less": lambda a, rng: a[:-1],
    "an axis more": lambda a, rng: a[None],
    "complex": lambda a, rng: a + 0j,
    "objects": lambda a, rng: a.astype(object),
    "strings": lambda a, rng: a.astype(str),
    "booleans": lambda a, rng: a > 0.0,
    "a mask": lambda a, rng: np.ma.masked_array(a, rng.random(a.shape) < 0.5),
    "nothing": lambda a, rng: None,
    "ragged": lambda a, rng: [[1.0], [1.0, 2.0]],
}
INTEGERS: dict[str, Damage] = {
    "halves": lambda a, rng: a + 0.5,
    "negative": lambda a, rng: -1 - a,
    "beyond": lambda a, rng: a + 10**9,
    **{
        name: ARRAYS[name] for name in ("an axis more", "complex", "strings", "booleans", "nothing", "ragged")
    },
}
NUMBERS = [np.nan, np.inf, -1.0, True, "1", None, 1j, [1.0, 2.0]]
COUNTS = [1.5, -1, True, "0", None, [0]]
NAMES = ["no such name", None, 3]
