"""Large sparse information matrices: the finding of the dense ones, without a dense matrix."""

import argparse
import re
import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse

import vigauge as vg
from support.foreign import Estimate, problem
from vigauge.cli import diagnose, estimate_file
from vigauge.gauge.group import Group
from vigauge.observability.diagnosis import diagnose_hessian

KINDS = ["rotation", "position", "velocity", "bias:3"]


def made(
    count: int = 40, group: Group | None = None, loops: int = 3
) -> tuple[Any, vg.Layout, Estimate, np.ndarray]:
    """H of some 500 columns, its layout, estimate and expected directions."""
    layout = vg.Layout.by_keyframe(count, KINDS, points=10, side="right")
    at, T, J = problem(layout, group or vg.YawTranslation(), np.random.default_rng(3), loops=loops)
    return (J.T @ J).tocsc(), layout, at, T


def blocks_of(layout: vg.Layout) -> dict[str, np.ndarray]:
    return {kind: columns.ravel() for kind, columns in layout.blocks.items()} | {
        "points": layout.points.ravel()
    }


def without(H: Any, *columns: int) -> Any:
    keep = np.ones(H.shape[0])
    keep[list(columns)] = 0.0
    return scipy.sparse.diags_array(keep) @ H @ scipy.sparse.diags_array(keep)


@pytest.mark.parametrize("group", [vg.YawTranslation(), vg.Euclidean(), vg.Similarity()])
@pytest.mark.parametrize("fault", ["none", "biases", "combination", "prior", "many", "units"])
def test_findings_are_those_of_the_dense_matrix(group: Group, fault: str) -> None:
    """Catches null directions that are missed, of which there are more than columns to begin with."""
    H, layout, _, T = made(group=group)
    blocks = blocks_of(layout)
    if fault in ("biases", "many"):
        H = without(H, *blocks["bias"][: 3 if fault == "biases" else 60])
    if fault == "combination":  # a direction across kinds is taken out of H
        x = np.random.default_rng(1).standard_normal(layout.n)
        Hx = H @ x
        H = scipy.sparse.csc_array(H.toarray() - np.outer(Hx, Hx) / (x @ Hx))
    if fault == "prior":
        H = H + scipy.sparse.diags_array((np.arange(layout.n) == blocks["position"][0]) * 1.0)
    if fault == "units":
        unit = scipy.sparse.diags_array(np.where(np.arange(layout.n) % 3 == 0, 1e5, 1e-4))
        H, T = unit @ H @ unit, T / unit.diagonal()[:, None]
    found, dense = diagnose_hessian(H, T, blocks), diagnose_hessian(H.toarray(), T, blocks)
    assert (found.expected, found.missing, found.rank) == (dense.expected, dense.missing, dense.rank)
    assert (found.missing, found.degenerate) == (
        fault == "prior",
        fault in ("biases", "combination", "many"),
    )
    gap = re.compile("gap [^;]*")
    assert gap.sub("", found.sentence) == gap.sub("", dense.sentence)
    for ours, theirs in zip(found.extra, dense.extra, strict=True):
        assert ours.shares == pytest.approx(theirs.shares, abs=1e-6)
    count = len(found.eigenvalues)
    np.testing.assert_allclose(found.eigenvalues, dense.eigenvalues[:count], rtol=5e-3, atol=1e-13)
    assert found.eigenvalues[-1] > 1e-8


@pytest.mark.parametrize("size", [1e-2, 1e-8])
def test_a_negative_eigenvalue_is_refused(size: float) -> None:
    H, _, _, T = made()
    scale = np.sqrt(H.diagonal())
    values, vectors = np.linalg.eigh(H.toarray() / scale[:, None] / scale)
    x = scale * vectors[:, 4]
    H = scipy.sparse.csc_array(H.toarray() - (values[4] + size) * np.outer(x, x))
    with pytest.raises(vg.IndefiniteError, match=r"H is not positive semidefinite: -.* of parameter \d"):
        diagnose_hessian(H, T)


def test_too_many_open_directions_are_said() -> None:
    with pytest.raises(vg.DegenerateError, match="501 columns of H have no information, the first is 100"):
        diagnose_hessian(scipy.sparse.diags_array((np.arange(601) < 100) * 1.0), np.ones((601, 1)))
    apart = scipy.sparse.kron(scipy.sparse.eye_array(700), np.ones((2, 2)))
    with pytest.raises(vg.DegenerateError, match=r"more than 500 .* \(H has \d+ or more without"):
        diagnose_hessian(apart, np.ones((1400, 1)))


def test_no_dense_matrix_of_a_large_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """20 000 columns through the command: read, diagnosed and audited in a tenth of a dense matrix."""
    H, layout, at, _ = made(1664, loops=5)
    arrays = {kind: columns for kind, columns in layout.blocks.items() if kind != "bias"}
    arrays |= {"other.bias": layout.blocks["bias"], "points": layout.points, "side": "right"}
    arrays |= {"H_data": H.data, "H_indices": H.indices, "H_indptr": H.indptr}
    np.savez(tmp_path / "H.npz", **arrays, R_WB=at.R, p_W=at.p, v_W=at.v, X_W=at.X)
    n = layout.n
    assert n > 19_990
    for kind in (scipy.sparse.csc_array, scipy.sparse.csr_array):
        dense = kind.toarray

        def small(self: Any, *args: Any, dense: Any = dense, **more: Any) -> Any:
            assert max(self.shape) < n, "a large matrix is made dense"
            return dense(self, *args, **more)

        monkeypatch.setattr(kind, "toarray", small)
    parser = argparse.ArgumentParser()
    estimate_file.add_arguments(parser)
    tracemalloc.start()
    diagnose.work(parser.parse_args([str(tmp_path / "H.npz")]))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert capsys.readouterr().out.startswith(f"regular: rank {n - 4} of {n}, gap ")
    assert peak < 0.1 * 8 * n**2
