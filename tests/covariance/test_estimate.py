"""The covariance of anyone's estimate, against long-double and pseudo-inverse oracles of dense matrices."""

import numpy as np
import pytest
import scipy.sparse

import vigauge as vg
from support.foreign import Estimate, graph_jacobian, problem, random_estimate, retracted, shifted
from vigauge.covariance import information
from vigauge.covariance.sparse_inverse import SparseInverse
from vigauge.gauge.group import Group
from vigauge.geometry import so3

BLOCKS = ["rotation", "position", "velocity"]
# Groups, and a gauge of each that holds as many directions.
GROUPS: list[tuple[Group, object]] = [
    (vg.YawTranslation(), vg.KeyframeGauge(2)),
    (vg.Euclidean(), vg.CentroidGauge()),
    (vg.Similarity(), (vg.FixedGauge(), vg.Distance(0, 3))),
]


def long_inverse(A: np.ndarray) -> np.ndarray:
    """Inverse of a positive definite matrix in long double: Cholesky, column by column."""
    A, n = A.astype(np.longdouble), len(A)
    L = np.zeros_like(A)
    for j in range(n):
        L[j:, j] = A[j:, j] - L[j:, :j] @ L[j, :j]
        L[j:, j] /= np.sqrt(L[j, j])
    X = np.eye(n, dtype=np.longdouble)
    for j in range(n):
        X[j] = (X[j] - L[j, :j] @ X[:j]) / L[j, j]
    return X.T @ X


def oracle(J: np.ndarray, V: np.ndarray) -> np.ndarray:
    """Covariance in the gauge with normal V, (n, d): (H + V V^T)^-1 without its part along the orbit.

    (H + V V^T)^-1 is Q G Q^T + W W^T with W = U (V^T U)^-1, which is (H + V V^T)^-1 V.
    """
    J, V = J.astype(np.longdouble), V.astype(np.longdouble)
    unit = np.sqrt((J**2).sum(axis=0))
    J, V = J / unit, V / unit[:, None]
    V = V / np.sqrt((V**2).sum(axis=0))
    full = long_inverse(J.T @ J + V @ V.T)
    W = full @ V
    return np.asarray((full - W @ W.T) / unit[:, None] / unit, dtype=float)


def close(found: np.ndarray, expected: np.ndarray, to: float = 1e-10, floor: float = 0.0) -> None:
    """Entries agree next to the standard deviations of both, of which those that a gauge holds are zero."""
    size = np.sqrt(np.abs(np.diagonal(expected)))
    size = np.maximum(size, floor or 0.1 * np.median(size))
    assert np.max(np.abs(found - expected) / np.outer(size, size)) < to


@pytest.fixture(params=["dense", "sparse", "J"])
def build(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch):
    """Each way from a Jacobian to a covariance, on problems of any size."""

    def make(J: scipy.sparse.csr_array, *args: object, **how: object) -> vg.EstimateCovariance:
        if request.param == "J":
            return vg.Covariance.from_jacobian(J.toarray(), *args, **how)
        H = J.T @ J
        if request.param == "dense":
            return vg.Covariance.from_hessian(H.toarray(), *args, **how)
        monkeypatch.setattr(information, "_SMALL", 0)
        found = vg.Covariance.from_hessian(H, *args, **how)
        assert isinstance(found.inverse.inverse, SparseInverse)
        return found

    return make


@pytest.mark.parametrize("side", ["left", "right", "gtsam", "g2o", "colmap"])
def test_poses_in_another_convention(side: str) -> None:
    """Catches an order or side of the layout that is taken for the convention's, and a velocity lost."""
    rng = np.random.default_rng(5)
    layout = vg.Layout.by_keyframe(6, BLOCKS, points=7, side=side)
    at, _, J = problem(layout, vg.YawTranslation(), rng)
    covariance = vg.Covariance.from_jacobian(J, layout, *at.args)
    order = BLOCKS[:2] if side in ("gtsam", "colmap") else BLOCKS[1::-1]
    own = covariance.keyframes(vg.CentroidGauge(), kinds=order)
    expected = vg.as_convention(own, at.R, p=at.p, source=side, to="ros")
    found = covariance.keyframes(vg.CentroidGauge(), kinds=BLOCKS, to="ros")
    np.testing.assert_allclose(found[:, :6, :6], expected, rtol=1e-9, atol=1e-12)
    velocities = covariance.keyframes(vg.CentroidGauge(), kinds=["velocity"])
    np.testing.assert_allclose(found[:, 6:, 6:], velocities, rtol=1e-9, atol=1e-12)
    with pytest.raises(vg.DataError, match="kinds: must have position and rotation"):
        covariance.keyframes(kinds=["position"], to="ros")


def test_poses_of_four_columns_in_another_convention() -> None:
    """Catches x, y, z and yaw taken for poses in the plane: z would be the angle."""
    rng = np.random.default_rng(7)
    n = 5
    at = np.arange(4 * n).reshape(n, 4)
    layout = vg.Layout(4 * n, {"position": at[:, :3], "rotation": at[:, 3:]})
    poses = so3.exp(rng.normal(size=(n, 1)) * [0.0, 0.0, 1.0]), rng.normal(size=(n, 3))
    U = vg.null_space(layout, poses)
    J = rng.normal(size=(6 * n, 4 * n))
    covariance = vg.Covariance.from_jacobian(J - J @ U @ np.linalg.pinv(U), layout, poses)
    own = covariance.keyframes(vg.CentroidGauge())
    found = covariance.keyframes(vg.CentroidGauge(), to="ros")
    moves = [0, 1, 2, 5]
    np.testing.assert_allclose(found[:, moves][:, :, moves], own, rtol=1e-9, atol=1e-12)
    assert not found[:, 3:5].any() and not found[:, :, 3:5].any()


def test_no_keyframes_have_no_covariances() -> None:
    """Catches a crash where a caller's selection is empty."""
    rng = np.random.default_rng(8)
    layout = vg.Layout.by_keyframe(4, BLOCKS, points=5, side="left")
    at, _, J = problem(layout, vg.YawTranslation(), rng)
    covariance = vg.Covariance.from_jacobian(J, layout, *at.args)
    assert covariance.keyframes(vg.CentroidGauge(), keys=[]).shape == (0, 9, 9)
    assert covariance.joint([], vg.CentroidGauge()).shape == (0, 0)


@pytest.mark.parametrize("side", ["right", "gtsam"])
def test_what_a_gauge_holds_has_no_negative_variance(build, side: str) -> None:
    """Catches rounding below zero, of which a square root would be NaN."""
    rng = np.random.default_rng(6)
    layout = vg.Layout.by_keyframe(12, BLOCKS, points=7, side=side)
    at, _, J = problem(layout, vg.YawTranslation(), rng)
    covariance = build(J, layout, *at.args)
    for key in range(12):
        gauge = vg.KeyframeGauge(key)
        for blocks in (covariance.keyframes(gauge), covariance.block(key, key, gauge)[None]):
            assert np.einsum("kcc->kc", blocks).min() >= 0.0
        np.testing.assert_array_equal(blocks := covariance.keyframes(gauge, [key]), blocks.swapaxes(1, 2))


@pytest.mark.parametrize(("group", "gauge"), GROUPS)
@pytest.mark.parametrize("side", ["left", "colmap"])
def test_every_way_is_the_oracle(build, group: Group, gauge: object, side: str) -> None:
    """Catches any error of elimination, selection or projection: 4, 6, 7 directions, two charts."""
    rng = np.random.default_rng(1)
    layout = vg.Layout.by_keyframe(12, BLOCKS, points=7, side=side)
    at, T, J = problem(layout, group, rng, loops=3)
    covariance = build(J, layout, *at.args, group=group)
    assert covariance.open == group.directions and covariance.measured == ()
    normal = vg.gauge_normal(layout, (at.R, at.p), gauge, group=group, points=at.X)
    random = T + 0.3 * rng.standard_normal(T.shape)
    for asked, V in ((None, T), (gauge, normal), (random, random)):
        expected = oracle(J.toarray(), V)
        close(covariance.matrix(asked), expected)
        blocks = covariance.keyframes(asked)
        floor = 0.1 * float(np.median(np.sqrt(np.abs(np.diagonal(expected)))))
        rows = np.array([layout.columns(k) for k in range(12)])
        for k, row in enumerate(rows):
            close(blocks[k], expected[np.ix_(row, row)], floor=floor)
        for k, block in enumerate(covariance.landmarks(asked)):
            close(block, expected[np.ix_(layout.points[k], layout.points[k])])
        two = np.concatenate([layout.columns(1), layout.columns(9)])
        there = covariance.in_gauge(V)
        close(there.joint([1, 9]), expected[np.ix_(two, two)])
        np.testing.assert_allclose(there.block(1, 9), there.joint([1, 9])[:9, 9:], atol=1e-12)
    close(covariance.matrix(), np.linalg.pinv((J.T @ J).toarray(), rcond=1e-12, hermitian=True), 1e-6)
    np.testing.assert_array_equal(
        covariance.sigma("velocity", gauge),
        np.sqrt(np.diagonal(covariance.keyframes(gauge, None, ["velocity"]), axis1=1, axis2=2)),
    )


@pytest.mark.parametrize(("weak", "to"), [(1e-3, 2e-6), (1e-4, 1e-3)])
def test_digits_of_a_large_sparse_jacobian(weak: float, to: float) -> None:
    """Catches a square that costs more digits than the docstring says: two halves that weak rows join."""
    layout = vg.Layout.by_kind(60, BLOCKS, side="right")
    at, _, J = problem(layout, vg.YawTranslation(), np.random.default_rng(1))
    first = np.concatenate([layout.columns(k) for k in range(30)])
    size = abs(J)
    joins = (size[:, first].sum(axis=1) > 0) & (np.delete(size.toarray(), first, axis=1).sum(axis=1) > 0)
    J = scipy.sparse.csr_array(scipy.sparse.diags_array(np.where(joins, weak, 1.0)) @ J)
    gauge = vg.CentroidGauge()
    squared, dense = (vg.Covariance.from_jacobian(A, layout, *at.args) for A in (J, J.toarray()))
    assert isinstance(squared.inverse.inverse, SparseInverse)
    np.testing.assert_allclose(squared.matrix(gauge).diagonal(), dense.matrix(gauge).diagonal(), rtol=to)
    weaker = scipy.sparse.csr_array(scipy.sparse.diags_array(np.where(joins, 1e-5 / weak, 1.0)) @ J)
    with pytest.raises(vg.DegenerateError):
        vg.Covariance.from_jacobian(weaker, layout, *at.args)
    vg.Covariance.from_jacobian(weaker.toarray(), layout, *at.args)


@pytest.mark.parametrize("loops", [0, 40])
def test_a_large_sparse_matrix_is_as_the_dense_one(loops: int) -> None:
    """Catches fronts and paths that only hold for small graphs: a long flight, and one with loops."""
    layout = vg.Layout.by_kind(150, BLOCKS, points=60, side="right")
    at, T, J = problem(layout, vg.YawTranslation(), np.random.default_rng(14), loops=loops)
    H = J.T @ J
    dense = vg.Covariance.from_hessian(H.toarray(), layout, *at.args)
    large = vg.Covariance.from_hessian(H, layout, *at.args)
    assert isinstance(large.inverse.inverse, SparseInverse)
    gauge = vg.CentroidGauge()
    for one, other in (
        (large.keyframes(gauge), dense.keyframes(gauge)),
        (large.landmarks(gauge), dense.landmarks(gauge)),
        (large.joint([3, 140], gauge), dense.joint([3, 140], gauge)),
        (large.relative_pose(2, 147).covariance, dense.relative_pose(2, 147).covariance),
    ):
        np.testing.assert_allclose(one, other, atol=1e-10 * np.abs(other).max())
    np.testing.assert_allclose(large.log_det(gauge), dense.log_det(gauge), rtol=1e-10)


def test_directions_that_are_measured_are_found(build) -> None:
    """Catches a null space that is taken for granted: 4, 3, 1 and 0 open directions."""
    rng = np.random.default_rng(2)
    layout = vg.Layout.by_keyframe(10, BLOCKS)
    at, T, J = problem(layout, vg.YawTranslation(), rng)
    height = np.zeros((1, layout.n))
    height[0, layout.columns(4, "position")[2]] = 0.1
    place = np.zeros((3, layout.n))
    place[np.arange(3), layout.columns(4, "position")] = 0.1
    heading = np.zeros((1, layout.n))
    heading[0, layout.columns(7, "rotation")[2]] = 3.0
    for extra, opened, measured in (
        (height, ("yaw", "x", "y"), ("z",)),
        (place, ("combination of yaw, x, y",), ("yaw", "x", "y", "z")),
        (np.concatenate([place, heading]), (), ("yaw", "x", "y", "z")),
    ):
        more = scipy.sparse.vstack([J, scipy.sparse.csr_array(extra)]).tocsr()
        covariance = build(more, layout, *at.args)
        assert covariance.open == opened and covariance.measured == measured
        H = (more.T @ more).toarray()
        if not opened:
            for gauge in (None, vg.CentroidGauge()):
                close(covariance.matrix(gauge), np.asarray(long_inverse(H), dtype=float))
            continue
        close(covariance.matrix(), oracle(more.toarray(), covariance.U))
        # In a gauge of four constraints, those that stop open directions hold.
        C = covariance.matrix(vg.KeyframeGauge(6))
        assert np.abs(H @ C @ H - H).max() < 1e-9 * np.abs(H).max()
        assert np.linalg.matrix_rank(C, tol=1e-10 * np.abs(C).max()) == layout.n - len(opened)


def test_a_weak_prior_is_no_null_direction(build) -> None:
    """Catches an absolute threshold: a prior 1e-8 of the rest is information, and sigmas say how little."""
    layout = vg.Layout.by_keyframe(6, BLOCKS)
    at, T, J = problem(layout, vg.YawTranslation(), np.random.default_rng(3))
    prior = np.zeros((4, layout.n))
    prior[np.arange(3), layout.columns(0, "position")] = prior[3, layout.columns(0, "rotation")[2]] = 1e-4
    more = scipy.sparse.vstack([J, scipy.sparse.csr_array(prior)]).tocsr()
    covariance = build(more, layout, *at.args)
    assert covariance.open == ()
    np.testing.assert_allclose(covariance.sigma("position")[0], 1e4, rtol=1e-5)


@pytest.mark.parametrize("origin", [1e5, 6.4e6])
def test_far_from_the_origin(build, origin: float) -> None:
    rng = np.random.default_rng(4)
    layout = vg.Layout.by_keyframe(10, BLOCKS, points=4, side="gtsam")
    at, T, J = problem(layout, vg.YawTranslation(), rng)
    far = shifted(at, origin * np.array([1.0, -0.7, 0.4]))
    expected = oracle(J.toarray(), T)
    close(build(J, layout, *far.args).matrix(), expected, 1e-7)


def test_relative_poses_are_gauge_free(build) -> None:
    """Catches a relative pose that moves with the gauge, or whose Jacobian is not that of the pose."""
    layout = vg.Layout.by_keyframe(9, BLOCKS, side="gtsam")
    at, T, J = problem(layout, vg.YawTranslation(), np.random.default_rng(5))
    covariance = build(J, layout, *at.args)

    def relative(now: Estimate) -> np.ndarray:
        R, p = now.R[2].T @ now.R[7], now.R[2].T @ (now.p[7] - now.p[2])
        return np.append(p, so3.log(R @ (at.R[2].T @ at.R[7]).T))

    gradient = vg.normal_from(relative, lambda d: retracted(layout, at, d), layout.n)
    found = covariance.relative_pose(2, 7)
    for V in (T, np.random.default_rng(6).standard_normal(T.shape)):
        close(found.covariance, gradient.T @ oracle(J.toarray(), V) @ gradient, 1e-8)
    error = np.random.default_rng(7).multivariate_normal(np.zeros(6), found.covariance)
    for wrong in (np.eye(5)[:, :4], np.zeros(6)):
        with pytest.raises(vg.DataError, match=r"measured|\(N, 3, 4\)"):
            found.mahalanobis(wrong)
    test = found.mahalanobis((so3.exp(error[3:]) @ found.R, found.p + error[:3]))
    np.testing.assert_allclose(
        test.squared_distance, error @ np.linalg.solve(found.covariance, error), rtol=1e-9
    )
    assert 0.0 < test.probability < 1.0


def test_the_scale_makes_relative_poses_depend_on_the_gauge() -> None:
    layout = vg.Layout.by_keyframe(6, BLOCKS[:2])
    at, T, J = problem(layout, vg.Similarity(), np.random.default_rng(8))
    covariance = vg.Covariance.from_jacobian(J, layout, *at.args, group=vg.Similarity())
    with pytest.raises(vg.DataError, match="scale"):
        covariance.relative_pose(0, 1)
    known = covariance.relative_pose(0, 1, (vg.FixedGauge(), vg.Distance(0, 1)))
    ray = known.p / np.linalg.norm(known.p)
    assert ray @ known.covariance[:3, :3] @ ray < 1e-12 * np.abs(known.covariance).max()
    with pytest.raises(vg.DataError, match="7 open directions.*Distance"):
        covariance.matrix(vg.CentroidGauge())


def test_log_det_is_that_of_the_covariance_in_the_gauge(build) -> None:
    """D-optimality differences are the same in every gauge; those of the trace are not."""
    rng = np.random.default_rng(9)
    layout = vg.Layout.by_keyframe(8, BLOCKS)
    at, T, J = problem(layout, vg.YawTranslation(), rng)
    better = scipy.sparse.vstack([J, graph_jacobian(layout, T, rng, reach=1, loops=2)]).tocsr()
    one, two = build(J, layout, *at.args), build(better, layout, *at.args)
    steps, traces = [], []
    for gauge in (vg.FreeGauge(), vg.FixedGauge(), vg.CentroidGauge(), rng.standard_normal(T.shape)):
        values = np.linalg.eigvalsh(one.matrix(gauge))[4:]
        np.testing.assert_allclose(one.log_det(gauge), np.log(values).sum(), rtol=1e-8)
        steps.append(one.log_det(gauge) - two.log_det(gauge))
        traces.append(np.trace(one.matrix(gauge)) - np.trace(two.matrix(gauge)))
    np.testing.assert_allclose(steps, steps[0], rtol=1e-9)
    assert np.ptp(traces) > 0.1 * np.min(traces)


@pytest.fixture(scope="module")
def schur():
    """A bundle problem: H with points, its Schur complement, and what was eliminated."""
    rng = np.random.default_rng(10)
    layout = vg.Layout.by_keyframe(7, BLOCKS[:2], points=30, side="colmap")
    at, T, J = problem(layout, vg.Similarity(), rng)
    H, n = (J.T @ J).toarray(), 42
    B, C = H[:n, n:], np.array([H[n + 3 * k : n + 3 * k + 3, n + 3 * k : n + 3 * k + 3] for k in range(30)])
    S = H[:n, :n] - B @ np.linalg.solve(H[n:, n:], B.T)
    return layout, vg.Layout.by_keyframe(7, BLOCKS[:2], side="colmap"), at, J, 0.5 * (S + S.T), B, C


@pytest.mark.parametrize("sparse", [False, True])
def test_a_schur_complement_answers_as_the_whole(
    schur, sparse: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole_layout, layout, at, J, S, B, C = schur
    if sparse:
        monkeypatch.setattr(information, "_SMALL", 0)
        S, B = scipy.sparse.csr_array(S), scipy.sparse.csr_array(B)
    group = vg.Similarity()
    whole = vg.Covariance.from_jacobian(J, whole_layout, *at.args, group=group)
    found = vg.Covariance.from_schur(
        S, layout, (at.R, at.p), points=at.X, coupling=B, information=C, group=group
    )
    for gauge in (None, (vg.FixedGauge(), vg.Distance(0, 1)), (vg.CentroidGauge(), vg.MeanDepth(2))):
        close(found.matrix(gauge), whole.matrix(gauge), 1e-8)
        np.testing.assert_allclose(found.landmarks(gauge), whole.landmarks(gauge), rtol=1e-6, atol=1e-9)
        np.testing.assert_allclose(found.log_det(gauge), whole.log_det(gauge), rtol=1e-8)


def test_a_schur_complement_of_other_points_is_refused(schur) -> None:
    """Catches points in another order than the coupling, or a coupling of the other sign."""
    _, layout, at, J, S, B, C = schur
    for X, coupling in ((at.X[::-1], B), (at.X, -B)):
        with pytest.raises(vg.DataError, match="coupling.*must belong"):
            vg.Covariance.from_schur(
                S, layout, (at.R, at.p), points=X, coupling=coupling, information=C, group=vg.Similarity()
            )
    with pytest.raises(vg.DataError, match="or none of the three"):
        vg.Covariance.from_schur(S, layout, (at.R, at.p), points=at.X, group=vg.Similarity())


def test_a_schur_complement_alone_asks_for_the_rest(schur) -> None:
    """Catches the free gauge of the poses alone that passes for that of the whole."""
    whole_layout, layout, at, J, S, B, C = schur
    whole = vg.Covariance.from_jacobian(J, whole_layout, *at.args, group=vg.Similarity())
    found = vg.Covariance.from_schur(S, layout, (at.R, at.p), group=vg.Similarity())
    gauge = (vg.FixedGauge(), vg.Distance(0, 1))
    close(found.matrix(gauge), whole.matrix(gauge)[:42, :42], 1e-8)
    with pytest.raises(vg.DataError, match="coupling and information"):
        found.keyframes()
    close(found.matrix(found.U), np.linalg.pinv(S, rcond=1e-12, hermitian=True), 1e-6)


def test_a_keyframe_that_the_solver_held_has_no_columns(build) -> None:
    """Catches a null space where a held pose leaves none, or the scale alone."""
    layout = vg.Layout.by_keyframe(8, BLOCKS[:2], points=9, side="colmap")
    at, T, J = problem(layout, vg.Similarity(), np.random.default_rng(15))
    blocks = {kind: columns - 6 for kind, columns in layout.blocks.items()}
    for columns in blocks.values():
        columns[0] = -1
    held = vg.Layout(layout.n - 6, blocks, layout.points - 6, "colmap")
    covariance = build(J[:, 6:], held, *at.args, group=vg.Similarity())
    assert len(covariance.open) == 1 and "scale" in covariance.open[0]
    gauge = (vg.KeyframeGauge(1), vg.Distance(2, 3))
    with pytest.raises(vg.DataError, match="no pose"):
        covariance.matrix((vg.KeyframeGauge(0), vg.Distance(2, 3)))
    with pytest.raises(vg.DataError, match="keyframe 0: must have columns of rotation, position"):
        covariance.keyframes(gauge)
    close(covariance.matrix(), oracle(J[:, 6:].toarray(), covariance.U), 1e-9)
    # The distance is constraint enough, and the first pose is fixed already.
    close(
        covariance.matrix((vg.FixedGauge(), vg.Distance(2, 3))),
        oracle(J[:, 6:].toarray(), vg.gauge_normal(held, (at.R, at.p), vg.Distance(2, 3))),
        1e-9,
    )


def test_a_plane_has_three_directions(build) -> None:
    at = random_estimate(9, 0, np.random.default_rng(16))
    R = so3.exp(np.random.default_rng(17).normal(size=(9, 1)) * np.array([0, 0, 1.0]))
    columns = np.arange(27).reshape(9, 3)
    layout = vg.Layout(27, {"position": columns[:, :2], "rotation": columns[:, 2:]}, side="gtsam")
    T = vg.null_space(layout, (R, at.p))[:, :3]
    J = graph_jacobian(layout, T, np.random.default_rng(18))
    covariance = build(J, layout, (R, at.p))
    assert covariance.open == ("yaw", "x", "y")
    close(covariance.matrix(), oracle(J.toarray(), T))
    fixed = covariance.matrix(vg.KeyframeGauge(4))
    assert np.abs(fixed[12:15]).max() < 1e-12 * np.abs(fixed).max()
    kept = np.delete(np.arange(27), [12, 13, 14])
    close(fixed[np.ix_(kept, kept)], np.linalg.inv((J.T @ J).toarray()[np.ix_(kept, kept)]))


def test_poses_of_few_digits_are_right_or_refused(build) -> None:
    """Catches poses stored in single precision that quietly turn null directions into weak measurements."""
    layout = vg.Layout.by_keyframe(8, BLOCKS)
    at, T, J = problem(layout, vg.YawTranslation(), np.random.default_rng(19))
    coarse = (at.R, np.float64(np.float32(at.p))), np.float64(np.float32(at.v))
    try:
        covariance = build(J, layout, *coarse)
    except vg.VigaugeError as error:
        assert "poses" in str(error)
    else:
        close(covariance.matrix(), oracle(J.toarray(), T), 1e-3)


def test_refusals(build) -> None:
    rng = np.random.default_rng(11)
    layout = vg.Layout.by_keyframe(8, BLOCKS)
    at, T, J = problem(layout, vg.YawTranslation(), rng)
    # Two parts that nothing joins: a second gauge.
    touching = np.flatnonzero((np.abs(J[:, :36]).sum(axis=1) > 0) & (np.abs(J[:, 36:]).sum(axis=1) > 0))
    apart = J[np.setdiff1d(np.arange(J.shape[0]), touching)].tocsr()
    with pytest.raises(vg.DegenerateError, match="unobservable"):
        build(apart, layout, *at.args)
    # Poses of another estimate.
    other = random_estimate(8, 0, rng)
    with pytest.raises(vg.DegenerateError, match="points are not those"):
        build(J, layout, *other.args)
    with pytest.raises(vg.DataError, match="keyframe of the layout"):
        build(J, layout, *at.args).block(0, 8)


def test_a_refusal_says_what_the_audit_finds(build) -> None:
    """Inverted poses, and a point that one view saw: catches a user left with 'singular' alone."""
    layout = vg.Layout.by_keyframe(8, BLOCKS, points=5, side="right")
    at, _, J = problem(layout, vg.YawTranslation(), np.random.default_rng(11))
    R_T = at.R.swapaxes(1, 2)
    with pytest.raises(vg.DegenerateError, match="An audit finds: poses are those of the world in the body"):
        build(J, layout, (R_T, -np.einsum("nij,nj->ni", R_T, at.p)), at.v, at.X)
    seen = np.flatnonzero(np.abs(J[:, layout.points[3]]).sum(axis=1) > 0.0)
    once = J[np.setdiff1d(np.arange(J.shape[0]), seen[2:])].tocsr()
    with pytest.raises(vg.DegenerateError, match="An audit finds: nothing measures point 3 in 1 direction"):
        build(once, layout, *at.args)


def test_a_direction_that_no_audit_explains_is_named() -> None:
    """The biases of two keyframes are measured as a sum only: neither block is singular by itself."""
    layout = vg.Layout.by_keyframe(4, [*BLOCKS, "bias:1"])
    at, _, J = problem(layout, vg.YawTranslation(), np.random.default_rng(11))
    J = J.toarray()
    a, b = layout.columns(1, "bias")[0], layout.columns(3, "bias")[0]
    J[:, b] = J[:, a]
    words = r"\((bias of keyframe 1, bias of keyframe 3|bias of keyframe 3, bias of keyframe 1)\)"
    with pytest.raises(vg.DegenerateError, match=words):
        vg.Covariance.from_hessian(J.T @ J, layout, (at.R, at.p), at.v)
    few = np.random.default_rng(2).standard_normal((20, len(J))) @ J
    with pytest.raises(vg.DegenerateError, match="too small a rank, with 20 rows for 36 parameters"):
        vg.Covariance.from_jacobian(few, layout, (at.R, at.p), at.v)


@pytest.mark.parametrize("sparse", [False, True])
def test_refused_matrices(sparse: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(information, "_SMALL", 0)
    layout = vg.Layout.by_keyframe(8, BLOCKS)
    at, T, J = problem(layout, vg.YawTranslation(), np.random.default_rng(12))
    H = (J.T @ J).toarray()

    def refused(matrix: np.ndarray, error: type[Exception], words: str) -> None:
        with pytest.raises(error, match=words):
            vg.Covariance.from_hessian(scipy.sparse.csc_array(matrix) if sparse else matrix, layout, *at.args)

    spoilt = H.copy()
    spoilt[3, 5] *= 1.1
    refused(spoilt, vg.DataError, "symmetric")
    spoilt[3, 5] = np.nan
    refused(spoilt, vg.DataError, "finite")
    refused(H[:-1, :-1], vg.DataError, "shape")
    refused(H.astype(np.float32), vg.DataError, "64-bit")
    gap = np.where((np.arange(72) == 5)[:, None] | (np.arange(72) == 5), 0.0, H)
    refused(gap, vg.DataError, "row 5, position of keyframe 0: .* nothing measures this parameter")
    refused(np.triu(H), vg.DataError, "both triangles")
    w = np.random.default_rng(13).standard_normal(72)
    basis, _ = np.linalg.qr(T)
    w -= basis @ (basis.T @ w)
    negative = H - 2.0 * np.outer(w, w) / (w @ np.linalg.pinv(H) @ w)
    refused(
        negative,
        vg.IndefiniteError,
        r"not positive semidefinite.* \((position|rotation|velocity) of keyframe",
    )
