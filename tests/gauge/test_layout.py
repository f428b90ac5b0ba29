"""Foreign layouts: the null space and the normals against differences of the group's action."""

import numpy as np
import pytest

import vigauge as vg
from support.foreign import Estimate, moved, random_estimate, retracted, retracted_pose
from vigauge.gauge.group import Group
from vigauge.geometry import so3
from vigauge.geometry.charts import CHARTS

SIDES = [name for name in CHARTS if name != "ros"]
GROUPS = [vg.YawTranslation(), vg.Euclidean(), vg.Similarity()]
STEP = 1e-5
AT_ORIGIN = np.tile(np.eye(4), (4, 1, 1))


def layout_of(side: str) -> vg.Layout:
    blocks = ["rotation", "position", "velocity", "bias:6"]
    return vg.Layout.by_keyframe(4, blocks, points=5, side=side)


def numbers(at: Estimate) -> np.ndarray:
    return np.concatenate([part.ravel() for part in (at.R, at.p, at.v, at.X)])


def element(name: str, size: float, up: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    turn, shift = np.zeros(3), np.zeros(3)
    if name == "scale":
        return turn, shift, np.exp(size)
    if name in "xyz":
        shift["xyz".index(name)] = size
    elif name == "yaw":
        turn = size * up
    else:
        turn[["roll", "pitch"].index(name)] = size
    return turn, shift, 1.0


@pytest.mark.parametrize("group", GROUPS)
@pytest.mark.parametrize("side", SIDES)
def test_null_space_is_the_derivative_of_the_action(side: str, group: Group) -> None:
    """Catches a wrong side, factor, sign or order: U moves the estimate as the group does."""
    layout, at = layout_of(side), random_estimate(4, 5, np.random.default_rng(1))
    up = np.array([0.6, 0.0, 0.8]) if isinstance(group, vg.YawTranslation) else np.array([0, 0, 1.0])
    U = vg.null_space(layout, *at.args, group=group, gravity=-9.8 * up)
    assert U.shape == (layout.n, len(group.directions))
    for name, column in zip(group.directions, U.T, strict=True):
        by_group = [numbers(moved(at, *element(name, s, up))) for s in (STEP, -STEP)]
        by_chart = [numbers(retracted(layout, at, s * column)) for s in (STEP, -STEP)]
        expected = (by_group[0] - by_group[1]) / (2 * STEP)
        found = (by_chart[0] - by_chart[1]) / (2 * STEP)
        np.testing.assert_allclose(found, expected, atol=1e-8 * max(1.0, np.abs(expected).max()))
    assert not U[layout.blocks["bias"]].any()


def test_by_kind_is_a_permutation_of_by_keyframe() -> None:
    at = random_estimate(4, 5, np.random.default_rng(2))
    one = layout_of("right")
    other = vg.Layout.by_kind(4, ["rotation", "position", "velocity", "bias:6"], points=5, side="right")
    U_one, U_other = vg.null_space(one, *at.args), vg.null_space(other, *at.args)
    for kind in ("rotation", "position", "velocity"):
        np.testing.assert_array_equal(U_one[one.blocks[kind]], U_other[other.blocks[kind]])
    assert other.blocks["rotation"][1, 0] == 3 and one.blocks["rotation"][1, 0] == 15


def test_a_plane_has_three_directions_and_a_missing_block_none() -> None:
    at = random_estimate(3, 0, np.random.default_rng(3))
    R = so3.exp(np.outer([0.1, 1.0, 2.0], [0, 0, 1.0]))
    columns = np.array([[-1, -1, -1], [0, 1, 2], [3, 4, 5]])
    flat = vg.Layout(6, {"position": columns[:, :2], "rotation": columns[:, 2:]}, side="gtsam")
    U = vg.null_space(flat, (R, at.p))
    assert U.shape == (6, 4) and not U[:, 3].any()
    np.testing.assert_allclose(U[:2, 1], R[1].T[:2, 0])
    np.testing.assert_array_equal(U[[2, 5], 0], 1.0)


@pytest.mark.parametrize("side", SIDES)
def test_normals_are_those_of_the_constraints(side: str) -> None:
    """Catches a normal by another side: against differences of the constraint under the retraction."""
    layout, at = layout_of(side), random_estimate(4, 5, np.random.default_rng(4))
    up = np.array([0.0, 0.6, 0.8])

    def keyframe(now: Estimate) -> np.ndarray:
        return np.append(now.p[2], up @ so3.log(now.R[2] @ at.R[2].T))

    def centroid(now: Estimate) -> np.ndarray:
        return np.append(now.p.mean(axis=0), up @ so3.log(now.R @ at.R.swapaxes(1, 2)).mean(axis=0))

    def distance(now: Estimate) -> float:
        return float(np.linalg.norm(now.p[3] - now.p[1]))

    def depth(now: Estimate) -> float:
        return float(np.linalg.norm(now.X - now.p[2], axis=1).mean())

    for gauge, order, constraint in (
        (vg.KeyframeGauge(2), [1, 2, 3, 0], keyframe),
        (vg.CentroidGauge(), [1, 2, 3, 0], centroid),
        (vg.Distance(1, 3), [0], distance),
        (vg.MeanDepth(2), [0], depth),
    ):
        V = vg.gauge_normal(layout, (at.R, at.p), gauge, points=at.X, gravity=-up)
        found = vg.normal_from(constraint, lambda d: retracted(layout, at, d), layout.n)
        np.testing.assert_allclose(V[:, order], found, atol=1e-10)


@pytest.mark.parametrize("to", SIDES)
@pytest.mark.parametrize("source", SIDES)
def test_conventions_agree_with_differences(source: str, to: str) -> None:
    """Catches a convention whose Jacobian is not that of one retraction written by the other."""
    at = random_estimate(1, 0, np.random.default_rng(5))
    R, p = at.R[0], at.p[0]
    half = np.random.default_rng(6).standard_normal((6, 6))
    given = half @ half.T

    def chart_jacobian(side: str) -> np.ndarray:
        """(12, 6) derivative of (R, p) by the increment in the convention's order."""
        columns = []
        for step in np.eye(6) * STEP:
            turn, shift = (step[:3], step[3:]) if CHARTS[side].rotation_first else (step[3:], step[:3])
            ends = [np.append(*retracted_pose(side, R, p, s * shift, s * turn)) for s in (1.0, -1.0)]
            columns.append((ends[0] - ends[1]) / (2 * STEP))
        return np.array(columns).T

    J = np.linalg.lstsq(chart_jacobian(to), chart_jacobian(source), rcond=None)[0]
    found = vg.as_convention(given, R, p=p, source=source, to=to)
    np.testing.assert_allclose(found, J @ given @ J.T, rtol=1e-7, atol=1e-7 * np.abs(found).max())
    back = vg.as_convention(found, R, p=p, source=to, to=source)
    np.testing.assert_allclose(back, given, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: vg.Layout(3, {"position": [[0, 1, 3]]}), r"0\.\.2"),
        (lambda: vg.Layout(6, {"position": [[0, 1, 2]], "rotation": [[2, 3, 4]]}), "column 2"),
        (lambda: vg.Layout(3, {"position": [[0, 1, 2]]}, side="body"), "left, ros, right"),
        (lambda: vg.Layout.by_keyframe(2, ["bias"]), "name:columns"),
        (lambda: vg.Layout.by_keyframe(2, ["position"], keys=["a", "a"]), "different names"),
        (lambda: layout_of("left").columns(9), "keyframe of the layout, such as 0"),
        (lambda: vg.null_space(layout_of("left"), np.zeros((4, 3, 4))), "rotation"),
        (lambda: vg.null_space(layout_of("left"), AT_ORIGIN), "velocities"),
        (lambda: vg.as_convention(np.eye(6), np.eye(3), to="colmap"), "must be given"),
        (lambda: vg.gauge_normal(layout_of("left"), AT_ORIGIN, vg.PriorGauge(1.0)), "FixedGauge"),
        (lambda: vg.gauge_normal(layout_of("left"), AT_ORIGIN, vg.Distance(0, 1)), "apart"),
    ],
)
def test_refusals(call: object, words: str) -> None:
    with pytest.raises(vg.DataError, match=words):
        call()
