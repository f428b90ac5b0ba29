"""Matching stamps of two sorted lists: by nearness, since equal instants may differ by rounding."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def nearest_index(
    t_ns: NDArray[np.int64], wanted_ns: ArrayLike
) -> tuple[NDArray[np.intp], NDArray[np.int64]]:
    """Index into sorted ``t_ns`` (not empty) of the stamp nearest each wanted one, and |difference|, ns."""
    wanted = np.asarray(wanted_ns, dtype=np.int64)
    after = np.clip(np.searchsorted(t_ns, wanted), 1, max(len(t_ns) - 1, 1))
    after = np.minimum(after, len(t_ns) - 1)
    before = np.maximum(after - 1, 0)
    index = np.where(np.abs(wanted - t_ns[before]) <= np.abs(t_ns[after] - wanted), before, after)
    return index, np.abs(t_ns[index] - wanted)
