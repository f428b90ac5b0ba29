"""Matching stamps by nearness, against trying all."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from vigauge.recordings.asl.nearest import nearest_index

STAMPS = st.integers(10**18, 10**18 + 40)


@given(st.sets(STAMPS, min_size=1), st.lists(STAMPS))
def test_nearest_is_the_smallest_of_all_distances(stamps, wanted):
    """Catches off-by-one at both ends and in lists of one; differences need all 64 bits."""
    t_ns = np.array(sorted(stamps), dtype=np.int64)
    index, distance = nearest_index(t_ns, np.array(wanted, dtype=np.int64))
    for w, i, d in zip(wanted, index, distance, strict=True):
        assert d == abs(int(t_ns[i]) - w) == min(abs(t - w) for t in stamps)
