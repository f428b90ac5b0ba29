"""Inverses of banded matrices against the dense inverse."""

import numpy as np
import pytest
import scipy.linalg.lapack as lapack
from hypothesis import given
from hypothesis import strategies as st

from vigauge.covariance.banded_inverse import banded_inverse, selected_inverse


def banded(n: int, width: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """A positive definite matrix with width - 1 diagonals below the main one, and its factor's band."""
    band = np.random.default_rng(seed).normal(size=(width, n))
    band[0] = 3.0 * width
    dense = np.zeros((n, n))
    for k in range(min(width, n)):
        dense[np.arange(k, n), np.arange(n - k)] = band[k, : n - k]
    factor, info = lapack.dpbtrf(band, lower=1)
    assert info == 0
    return np.tril(dense) + np.tril(dense, -1).T, factor


SHAPES = st.tuples(st.integers(1, 230), st.integers(1, 130), st.integers(0, 3)).filter(lambda s: s[1] <= s[0])


@given(SHAPES)
def test_whole_inverse(shape):
    """Catches a block that stops short of the band or of the last column, and halves that differ."""
    dense, factor = banded(*shape)
    found = banded_inverse(factor)
    assert np.abs(found - np.linalg.inv(dense)).max() < 1e-13 * np.abs(found).max()
    assert np.array_equal(found, found.T)


@given(SHAPES)
def test_inverse_inside_the_band(shape):
    """Catches a window of the later blocks that is shifted or too small; beyond the corner it is zero."""
    dense, factor = banded(*shape)
    found, inverse = selected_inverse(factor), np.linalg.inv(dense)
    n, width = shape[:2]
    for k in range(width):
        expected = np.append(np.diagonal(inverse, -k), np.zeros(k))
        assert np.abs(found[k] - expected).max() < 1e-13 * np.abs(inverse).max()


@pytest.mark.parametrize("invert", [banded_inverse, selected_inverse])
def test_factor_is_kept(invert):
    """Catches a factor that is overwritten while it is still needed for products."""
    _, factor = banded(100, 20)
    before = factor.copy()
    invert(factor)
    assert np.array_equal(factor, before)
