"""The folder of an estimate: what is in it, that it is whole, and what it never replaces."""

import csv
import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

import vigauge as vg
from vigauge.recordings import Estimate
from vigauge.recordings.estimation import folder as estimation_folder
from vigauge.recordings.estimation.folder import lines, write_estimates
from vigauge.recordings.estimation.page import page


def test_everything_comes_back_as_it_was(made: Estimate, tmp_path: Path) -> None:
    """Files of different states, sigmas of another gauge, units in the wrong columns."""
    out = tmp_path / "out"
    write_estimates(out, {"": made}, {})
    poses, sigmas = vg.load_trajectory(out / "trajectory.tum"), vg.load_trajectory(out / "trajectory.csv")
    assert np.array_equal(poses.times_ns, made.t_ns)
    np.testing.assert_allclose(poses.p_W, made.state.p_W, atol=1e-12)
    np.testing.assert_allclose(sigmas.sigma[1:], made.sigma[1:, :9], rtol=1e-9)
    whole = vg.load_trajectory(out / "trajectory.npz")
    np.testing.assert_allclose(whole.covariance[1:], made.keyframes[1:, :9, :9])
    with (out / "biases.csv").open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert [float(row["accel_bias_y_mps2"]) for row in rows] == made.biases[:, 4].tolist()
    assert [float(row["sigma_gyro_bias_z_radps"]) for row in rows] == made.sigma[:, 11].tolist()
    (problem,) = vg.load_problems(out / "problem.npz")
    assert vg.solve(problem, vg.FreeGauge()).iterations <= 2
    found = json.loads((out / "summary.json").read_text("utf-8"))
    assert found["made_by"] == "vigauge estimate" and found["truth_used"] is False and found["truth"] == []


def test_several_windows_have_a_folder_each(made: Estimate, tmp_path: Path) -> None:
    write_estimates(tmp_path / "out", {"a": made, "b": made}, {"c": "why"})
    found = json.loads((tmp_path / "out" / "summary.json").read_text("utf-8"))
    assert set(found["windows"]) == {"a", "b"} and found["refused"] == {"c": "why"}
    assert (tmp_path / "out" / "b" / "page.html").is_file()


def test_a_failed_write_leaves_the_earlier_result(
    made: Estimate, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A folder half new, half old, after a full disk."""
    out = tmp_path / "out"
    write_estimates(out, {"": made}, {})
    before = {path.name: path.read_bytes() for path in out.iterdir()}

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(estimation_folder, "write_text", full)
    with pytest.raises(vg.OutputError, match="No space left"):
        write_estimates(out, {"": replace(made, warnings=("another",))}, {})
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
    monkeypatch.undo()
    write_estimates(out, {"": replace(made, warnings=("another",))}, {})
    assert "another" in (out / "summary.json").read_text("utf-8")


class _Tags(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: list[str] = []

    def handle_starttag(self, tag: str, attrs: object) -> None:
        self.seen.append(tag)
        if tag not in ("meta", "br"):
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: object) -> None:
        self.seen.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def test_the_page_is_whole_and_loads_nothing(made: Estimate) -> None:
    """A page that needs the network, or that a browser has to mend."""
    text = page(replace(made, warnings=("sigmas < truth & more",)))
    tags = _Tags()
    tags.feed(text)
    assert not tags.open and tags.seen.count("svg") == 3
    # An ellipse a keyframe, and three bands in each of two plots of biases.
    assert tags.seen.count("polygon") == made.state.n_keyframes + 6
    assert not re.search(r"(src|href)=|https?://|@import|nan|inf,", text)
    assert "sigmas &lt; truth &amp; more" in text


def test_ellipses_are_of_the_gauge(made: Estimate) -> None:
    """Ellipses of one gauge under another one's name."""
    centroid = vg.Covariance.of(made.problem, made.state).keyframes(vg.CentroidGauge())
    assert page(made) != page(replace(made, keyframes=centroid))


def test_the_lines_name_warnings_and_where_it_is(made: Estimate) -> None:
    text = "\n".join(lines(replace(made, warnings=("doubt",)), Path("here")))
    assert "warning" in text and "doubt" in text and "here/" in text
    assert len(text.splitlines()) <= 14
