"""Relative poses from matches: far apart, with wrong matches and with poor depths among them."""

import numpy as np
import pytest

from vigauge.geometry import so3
from vigauge.recordings.frontend.epipolar import length_of_step, relative_pose

K = np.array([[460.0, 0.0, 370.0], [0.0, 458.0, 245.0], [0.0, 0.0, 1.0]])
R, P = so3.exp(np.array([0.05, 0.5, -0.1])), np.array([-1.1, 0.2, 0.5])


def views(seed: int, n: int = 150) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points (n, 3) m in view 1 and their pixels in both, with noise of 0.3 px."""
    rng = np.random.default_rng(seed)
    x = rng.uniform([-2.0, -1.5, 3.0], [2.0, 1.5, 7.0], (n, 3))
    uv = [y[:, :2] / y[:, 2:] * [460.0, 458.0] + [370.0, 245.0] for y in (x, x @ R.T + P)]
    return x, uv[0] + 0.3 * rng.standard_normal((n, 2)), uv[1] + 0.3 * rng.standard_normal((n, 2))


@pytest.mark.parametrize("seed", range(3))
def test_pose_stands_wrong_matches_and_depths_off_by_a_fifth(seed: int) -> None:
    """A pose that leans on depths, the step's sign or length wrong, or wrong matches kept."""
    rng = np.random.default_rng(100 + seed)
    x, uv_1, uv_2 = views(seed)
    uv_2[:50] = rng.uniform([0, 0], [752, 480], (50, 2))
    found = relative_pose(uv_1, uv_2, K, 1.5)
    assert found is not None
    R_21, t, agree = found
    assert np.count_nonzero(agree[50:]) > 85 and np.count_nonzero(agree[:50]) < 8
    depths = x * rng.normal(1.0, 0.2, (len(x), 1))
    depths[::3] = np.nan
    s = length_of_step(R_21, t, depths[agree], uv_2[agree], K)
    assert s is not None
    assert np.linalg.norm(s * t - P) < 0.1 * np.linalg.norm(P)
    assert np.linalg.norm(so3.log(R_21 @ R.T)) < np.radians(1.0)
    again = relative_pose(uv_1, uv_2, K, 1.5)
    assert again is not None and np.array_equal(again[0], R_21) and np.array_equal(again[2], agree)


def test_too_few_matches_or_depths_give_nothing() -> None:
    """OpenCV's several solutions of five matches taken for one, or a median of nothing."""
    x, uv_1, uv_2 = views(0)
    assert relative_pose(uv_1[:7], uv_2[:7], K, 1.5) is None
    assert length_of_step(R, P / np.linalg.norm(P), np.full_like(x, np.nan), uv_2, K) is None
