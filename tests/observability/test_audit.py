"""The audit of an information matrix: each fault put in by hand is named, and a sound matrix has none."""

import re
from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse

import vigauge as vg
from support.foreign import Estimate, graph_jacobian, problem
from vigauge.gauge.group import Group
from vigauge.geometry import so3

GROUPS: list[Group] = [vg.YawTranslation(), vg.Euclidean(), vg.Similarity()]


def sound(side: str = "right", group: Group | None = None) -> tuple[np.ndarray, vg.Layout, Estimate]:
    layout = vg.Layout.by_keyframe(6, ["rotation", "position", "velocity"], points=5, side=side)
    at, _, J = problem(layout, group or vg.YawTranslation(), np.random.default_rng(3))
    H = (J.T @ J).toarray()
    return 0.5 * (H + H.T), layout, at


def kinds(H: object, layout: vg.Layout, at: Estimate, group: Group | None = None) -> list[str]:
    return [concern.kind for concern in vg.audit(H, layout, *at.args, group=group)]


@pytest.mark.parametrize("group", GROUPS)
@pytest.mark.parametrize("side", ["left", "right", "gtsam", "se3", "colmap", "ceres", "g2o"])
def test_a_sound_matrix_has_no_concern(side: str, group: Group) -> None:
    H, layout, at = sound(side, group)
    assert kinds(H, layout, at, group) == []
    assert kinds(scipy.sparse.csr_array(H), layout, at, group) == []


@pytest.mark.parametrize("factor", [1e-9, 1e-6, 1e-2])
@pytest.mark.parametrize(("of", "words"), [("diagonal", "of the diagonal"), ("one", "on the diagonal")])
def test_damping(factor: float, of: str, words: str) -> None:
    H, layout, at = sound()
    damped = H + factor * (np.diag(np.diag(H)) if of == "diagonal" else np.eye(len(H)))
    (concern,) = vg.audit(damped, layout, *at.args)
    share = factor / (1.0 + factor) if of == "diagonal" else factor
    assert concern.kind == "damping" and f"{share:.1e} {words}" in concern.sentence


def test_damping_that_rounding_hides_along_the_gauge() -> None:
    """One keyframe is measured far less than the others: along the gauge the damping is below rounding."""
    layout = vg.Layout.by_keyframe(6, ["rotation", "position", "velocity"])
    at, _, J = problem(layout, vg.YawTranslation(), np.random.default_rng(3))
    rows = J.toarray()
    rows[~rows[:, layout.columns(5)].any(axis=1)] *= 1e4
    (concern,) = vg.audit(rows.T @ rows + 1e-5 * np.eye(layout.n), layout, *at.args)
    assert str(concern) == "a damping of 1.0e-05 on the diagonal is left in H: take H without it"


@pytest.mark.parametrize("truth", ["left", "right", "gtsam", "colmap", "ceres", "g2o"])
@pytest.mark.parametrize("told", ["left", "gtsam"])
def test_another_chart(truth: str, told: str) -> None:
    H, layout, at = sound(truth)
    found = vg.audit(H, replace(layout, side=told), *at.args)
    assert [concern.kind for concern in found] == ([] if truth == told else ["chart"])
    assert all(f"side='{truth}', not '{told}'" in str(concern) for concern in found)


def test_a_layout_with_exchanged_columns() -> None:
    """Alone, and together with another side: both are named."""
    H, layout, at = sound("right")
    blocks = {**layout.blocks, "position": layout.blocks["rotation"], "rotation": layout.blocks["position"]}
    for side, words in (
        ("right", "exchanged in the layout, so that"),
        ("gtsam", "and poses of H .*side='right', not"),
    ):
        (concern,) = vg.audit(H, replace(layout, blocks=blocks, side=side), *at.args)
        assert concern.kind == "order" and re.search(words, concern.sentence)


@pytest.mark.parametrize("sparse", [False, True])
def test_another_estimate_than_that_of_H(sparse: bool) -> None:
    """Poses of the world in the body, velocities in the body, and gravity along another axis."""
    H, layout, at = sound()
    if sparse:
        H = scipy.sparse.csr_array(H)
    R_T = at.R.swapaxes(1, 2)
    inverse = R_T, -np.einsum("nij,nj->ni", R_T, at.p)
    body = np.einsum("nij,nj->ni", R_T, at.v)
    assert [c.kind for c in vg.audit(H, layout, inverse, at.v, at.X)] == ["poses"]
    assert [c.kind for c in vg.audit(H, layout, (at.R, at.p), body, at.X)] == ["velocities"]
    (concern,) = vg.audit(H, layout, *at.args, gravity=(0.02, 0.0, -1.0))
    assert concern.kind == "gravity" and "along (0.0, 0.0, -1.0) in W" in concern.sentence
    assert not vg.audit(H, layout, *at.args, gravity=(0.0, 0.0, 9.81))  # the axis is what counts


@pytest.mark.parametrize("sparse", [False, True])
def test_what_nothing_measures_is_named(sparse: bool) -> None:
    """A point that one view saw, and a velocity without measurements, beside a gauge that is open."""
    layout = vg.Layout.by_keyframe(6, ["rotation", "position", "velocity"], points=5, side="right")
    at, _, J = problem(layout, vg.YawTranslation(), np.random.default_rng(3))
    rows = J.toarray()
    seen = np.flatnonzero(np.abs(rows[:, layout.points[3]]).sum(axis=1) > 0.0)
    rows = np.delete(rows, seen[2:], axis=0)
    rows = rows[np.abs(rows[:, layout.columns(1, "velocity")]).sum(axis=1) == 0.0]
    H = rows.T @ rows
    found = vg.audit(scipy.sparse.csc_array(H) if sparse else H, layout, *at.args)
    names = [str(concern) for concern in found if concern.kind == "unmeasured"]
    assert names and "velocity of keyframe 1 in 3 directions, point 3 in 1 direction:" in names[0]


def test_parts_that_nothing_joins() -> None:
    layout = vg.Layout.by_keyframe(6, ["rotation", "position", "velocity"], side="right")
    at, _, J = problem(layout, vg.YawTranslation(), np.random.default_rng(3))
    cut = layout.columns(2).min()
    rows = J.toarray()
    both = (np.abs(rows[:, :cut]).sum(axis=1) > 0.0) & (np.abs(rows[:, cut:]).sum(axis=1) > 0.0)
    H = rows[~both].T @ rows[~both]
    (concern,) = vg.audit(H, layout, *at.args)
    assert concern.kind == "parts" and "keyframes 0, 1 and keyframes 2, 3, 4, 5:" in concern.sentence


def test_positions_in_one_place_have_no_scale() -> None:
    """Catches a direction that moves nothing, taken for one that nothing measures."""
    layout = vg.Layout.by_keyframe(4, ["position", "rotation"])
    R = so3.exp(np.random.default_rng(3).normal(size=(4, 3)))
    T = vg.null_space(layout, (R, np.ones((4, 3))), group=vg.Euclidean())
    J = graph_jacobian(layout, T, np.random.default_rng(4)).toarray()
    assert not vg.audit(J.T @ J, layout, (R, np.ones((4, 3))), group=vg.Euclidean())


def test_a_prior_on_a_velocity() -> None:
    """It measures yaw where the body moves, and has no gauge of its own to ask in."""
    H, layout, at = sound()
    columns = layout.columns(2, "velocity")
    blocks = {kind: np.vstack([own, np.full((1, 3), -1)]) for kind, own in layout.blocks.items()}
    blocks["velocity"][[2, 6]] = blocks["velocity"][[6, 2]]  # a variable of its own, as in GTSAM
    H[columns, columns] += 1e4
    R, p, v = (
        np.vstack([at.R, np.eye(3)[None]]),
        np.vstack([at.p, at.p.mean(axis=0)]),
        np.vstack([at.v, at.v[2:3]]),
    )
    (concern,) = vg.audit(H, replace(layout, blocks=blocks), (R, p), v, at.X)
    assert concern.kind == "prior" and concern.sentence.endswith(
        "keyframe 6: where it was not measured, leave it out of H"
    )
    assert "along 1 direction of" in concern.sentence


def test_a_group_that_is_too_small() -> None:
    for true, told, word in ((1, 0, "Euclidean"), (2, 0, "Similarity"), (2, 1, "Similarity")):
        H, layout, at = sound(group=GROUPS[true])
        concerns = vg.audit(H, layout, *at.args, group=GROUPS[told])
        assert [c.kind for c in concerns] == ["group"] and f"group=vg.{word}()" in str(concerns[0])


@pytest.mark.parametrize(("unit", "factor"), [("millimetres", 1e3), ("degrees", 180.0 / np.pi)])
def test_other_units(unit: str, factor: float) -> None:
    H, layout, at = sound()
    D = np.ones(len(H))
    turns = layout.blocks["rotation"].ravel()
    D[turns if unit == "degrees" else np.setdiff1d(np.arange(len(H)), turns)] = 1.0 / factor
    (concern,) = vg.audit(D[:, None] * H * D, layout, *at.args)
    assert concern.kind == "units" and unit in concern.sentence


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("count", [6, 4])
def test_a_prior_that_holds_more_than_is_free(side: str, count: int) -> None:
    """Six directions of one pose where four are free; position and yaw alone hold no more than that.

    Catches columns that are counted: yaw about W is in three columns of an increment in B.
    """
    H, layout, at = sound(side)
    turn = np.eye(3) if side == "left" else at.R[2]
    J = np.zeros((count, layout.n))
    J[:3, layout.columns(2, "position")] = np.eye(3)
    J[3:, layout.columns(2, "rotation")] = turn[::-1][: count - 3]
    for matrix in (H + 1e6 * J.T @ J, scipy.sparse.csr_array(H + 1e6 * J.T @ J)):
        (concern,) = vg.audit(matrix, layout, *at.args)
        assert concern.kind == "prior" and "a prior on keyframe 2" in concern.sentence
        assert ("holds 6 directions where 4 are free" in concern.sentence) is (count == 6)


def test_a_lost_block() -> None:
    H, layout, at = sound()
    i, j = layout.columns(3), layout.columns(4)
    H[np.ix_(i, j)] = H[np.ix_(j, i)] = 0.0
    for matrix in (H, scipy.sparse.csc_array(H)):
        (concern,) = vg.audit(matrix, layout, *at.args)
        assert concern.kind == "block" and "between keyframe 3 and keyframe 4 is empty" in concern.sentence


def test_absolute_measurements_are_no_fault() -> None:
    """Positions of two keyframes that nothing joins directly, and of three."""
    for keyframes in ((0, 5), (0, 2, 5)):
        H, layout, at = sound()
        for number, k in enumerate(keyframes):
            columns = layout.columns(k, "position")
            H[columns, columns] += 4.0 + number
        assert kinds(H, layout, at) == []


def test_a_wide_diagonal() -> None:
    layout = vg.Layout.by_keyframe(6, ["rotation", "position", "bias:3"])
    at, _, J = problem(layout, vg.YawTranslation(), np.random.default_rng(3))
    D = np.ones(layout.n)
    D[layout.blocks["bias"]] = 1e-7
    (concern,) = vg.audit(D[:, None] * (J.T @ J).toarray() * D, layout, (at.R, at.p))
    assert concern.kind == "spread" and "bias of keyframe" in concern.sentence


def test_bad_input_is_refused() -> None:
    H, layout, at = sound()
    with pytest.raises(vg.DataError, match="symmetric"):
        vg.audit(np.triu(H), layout, *at.args)
    with pytest.raises(vg.DataError, match="velocities: must be given"):
        vg.audit(H, layout, (at.R, at.p), None, at.X)
