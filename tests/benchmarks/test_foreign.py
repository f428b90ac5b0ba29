"""The race on other solvers' matrices, at sizes of a second."""

import json

import pytest

pytest.importorskip("gtsam")
pytest.importorskip("pyceres")
pytest.importorskip("pycolmap")

from benchmarks.foreign import main
from benchmarks.foreign_rows import Sizes
from vigauge.files import read_rows

COLUMNS = ["case", "what", "ours_s", "peer", "peer_s", "ratio", "to_reach", "relative_difference", "note"]


def test_every_row_agrees_with_its_peer(tmp_path) -> None:
    """Catches a peer asked something else: a prior left in, an order of columns, another gauge."""
    main(tmp_path, Sizes(60, 20, 5, 40, 200, 20, 6, 1000))
    rows = read_rows(tmp_path / "foreign.csv")
    assert list(rows[0]) == COLUMNS
    peers = {row["peer"] for row in rows}
    assert peers >= {"GTSAM Marginals", "Ceres SPARSE_QR", "GTSAM jointMarginalCovariance", "dense SVD of J"}
    assert peers >= {"QR of J, long double", "pycolmap"}
    cases = [row["case"] for row in rows]
    assert all(any(f"{count} directions" in case for case in cases) for count in (4, 6, 7))
    assert sum(row["peer"] in ("GTSAM Marginals", "pycolmap") for row in rows) >= 9
    for row in rows:
        assert (float(row["relative_difference"]) < 1e-8) is ("they differ:" not in row["note"]), row
        assert float(row["ratio"]) == pytest.approx(float(row["peer_s"]) / float(row["ours_s"]), rel=0.02)
    about = json.loads((tmp_path / "foreign.json").read_text(encoding="utf-8"))
    assert {"gtsam", "pyceres"} <= set(about["peers"]) and about["repeats"] == 3
    assert (tmp_path / "foreign.png").stat().st_size > 0
