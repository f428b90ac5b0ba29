"""The pages of docs: their Python as a reader runs it, each answer against another way to it."""

import importlib.util
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse

import vigauge as vg
from benchmarks.gauge_weights import SHIPPED, cost_table, measured, shown
from docs import pages, picture
from support import ROOT, foreign, foreign_files
from vigauge.cli.__main__ import COMMANDS
from vigauge.geometry.charts import CHARTS
from vigauge_paper.figures.style import COLOURS

ESTIMATOR, CONVENTIONS, GAUGE = (
    (ROOT / "docs" / f"{name}.md").read_text("utf-8")
    for name in ("from_your_estimator", "conventions", "which_gauge")
)


def section(page: str, title: str) -> str:
    return page.split(f"\n## {title}\n")[1].split("\n## ")[0]


def cells(text: str) -> list[list[str]]:
    """Rows of the first table in a text, and of those after it, without the first head."""
    rows = re.findall(r"^\|(.*)\|$", text, re.MULTILINE)
    return [[cell.strip(" `") for cell in row.split(" | ")] for row in rows[2:]]


def code_of(title: str, language: str = "python", page: str = ESTIMATOR) -> str:
    """The block of a section."""
    (code,) = re.findall(rf"^```{language}\n(.*?)^```", section(page, title), re.MULTILINE | re.DOTALL)
    return code


def run(title: str, page: str = ESTIMATOR) -> dict[str, Any]:
    names: dict[str, Any] = {}
    exec(compile(code_of(title, page=page), title, "exec"), names)
    return names


def run_commands(lines: str) -> None:
    for line in lines.splitlines():
        done = subprocess.run([sys.executable, "-m", *line.replace("vigauge", "vigauge.cli", 1).split()])
        assert done.returncode == 0, line


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def save_poses(at: foreign.Estimate) -> None:
    poses = np.tile(np.eye(4), (len(at.p), 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = at.R, at.p
    np.save("poses.npy", poses)


def in_gauge(J: Any, T: np.ndarray, V: np.ndarray) -> np.ndarray:
    """The dense pseudo-inverse, carried along the orbit to V."""
    Q = np.eye(len(T)) - T @ np.linalg.solve(V.T @ T, V.T)
    return Q @ np.linalg.pinv((J.T @ J).toarray(), rcond=1e-12, hermitian=True) @ Q.T


def test_sections_and_languages() -> None:
    assert re.findall(r"^## (.*)$", ESTIMATOR, re.MULTILINE) == [
        "GTSAM",
        "COLMAP",
        "Files of g2o and BAL",
        "Ceres",
        "Your own information matrix",
        "Another order of columns",
        "What may be wrong",
        "A sliding window",
        "To and from ROS and OpenVINS",
        "Outliers",
    ]


@pytest.mark.oracle
def test_gtsam(folder: Path) -> None:
    gtsam = pytest.importorskip("gtsam", reason="needs GTSAM: pip install gtsam")
    names = run("GTSAM")
    X, graph = names["X"], names["graph"]
    prior = gtsam.noiseModel.Isotropic.Sigma(6, 1e-5)
    graph.add(gtsam.PriorFactorPose3(X(0), gtsam.Pose3(), prior))
    expected = gtsam.Marginals(graph, names["values"]).marginalCovariance(X(2))
    assert vg.relative_frobenius(names["block"], expected) < 1e-6  # the prior's own share


@pytest.mark.oracle
def test_colmap(folder: Path) -> None:
    pytest.importorskip("pycolmap", reason="needs pycolmap: pip install pycolmap")
    names = run("COLMAP")
    ids, found = (names["first"], names["second"], names["third"]), names["covariance"]
    np.testing.assert_allclose(found.block(ids[0], ids[0], names["gauge"]), 0.0, atol=1e-12)
    # The centre p = -R t by hand: dp = R (2 dq x t) - R dt.
    place = found.layout.place(ids[2])
    R, p, C = found.R[place], found.p[place], names["block"]
    J = np.concatenate([2.0 * R @ np.cross(np.eye(3), -R.T @ p).T, -R], axis=1)
    expected = J @ C @ J.T
    assert vg.relative_frobenius(names["in_world"][0, :3, :3], expected) < 1e-9


def test_files_of_g2o_and_bal(folder: Path) -> None:
    """Catches keys, conventions or a scale that the page names and the adapters do not have."""
    foreign_files.Space(noise=0.0).write(Path("graph.g2o"))
    foreign_files.Adjustment().write(Path("bal.txt"))
    names = run("Files of g2o and BAL")
    graph, block = names["graph"], names["block"]
    turn = graph.R[graph.layout.place(3)]
    np.testing.assert_allclose(names["in_world"][3:, 3:], 4.0 * turn @ block[3:, 3:] @ turn.T, rtol=1e-9)
    assert names["camera"].shape == (9, 9)
    run_commands(code_of("Files of g2o and BAL", "text"))


def test_commands_of_the_library_page(folder: Path) -> None:
    """Catches commands that need a file of which the page does not say how to make it."""
    title, page = "On the command line", PAGES["library"]
    (save,) = re.findall(r"`(vg\.save_problems\(.*?\))`", section(page, title))
    eval(save, {"vg": vg, "problem": vg.example_problem()})
    run_commands(code_of(title, "", page))


def test_a_sliding_window() -> None:
    """Catches a prior from older estimates that passes for a measurement of yaw."""
    names = run("A sliding window")
    assert names["as_it_is"].measured == ("yaw",)
    covariance, H, U = (
        names["covariance"],
        names["H"] + names["P"] @ names["H_prior"] @ names["P"],
        names["U"],
    )
    assert covariance.measured == ()
    assert np.abs(names["block"][:3, :3]).max() < 1e-12
    V = vg.gauge_normal(names["layout"], names["poses"], vg.KeyframeGauge(3))
    expected = vg.covariance_from_hessian(H, U, V)[:15, :15]
    assert vg.relative_frobenius(covariance.block(0, 0, vg.KeyframeGauge(3)), expected) < 1e-9


def test_ceres(folder: Path) -> None:
    layout = vg.Layout.by_keyframe(6, ["position", "rotation"], points=8, side="ceres")
    at, T, J = foreign.problem(layout, vg.Euclidean(), np.random.default_rng(4))
    save_poses(at)
    np.save("points.npy", at.X)
    J.indptr.astype(np.int32).tofile("rows.bin")
    J.indices.astype(np.int32).tofile("cols.bin")
    J.data.tofile("values.bin")
    V = vg.gauge_normal(layout, (at.R, at.p), vg.CentroidGauge(), group=vg.Euclidean())
    rows = layout.columns(3)
    assert vg.relative_frobenius(run("Ceres")["block"], in_gauge(J, T, V)[np.ix_(rows, rows)]) < 1e-8


def test_own_matrix(folder: Path) -> None:
    blocks = ["position", "rotation", "velocity", "bias:6"]
    layout = vg.Layout.by_keyframe(6, blocks, side="right")
    at, T, J = foreign.problem(layout, vg.YawTranslation(), np.random.default_rng(5))
    save_poses(at)
    np.save("velocities.npy", at.v)
    scipy.sparse.save_npz("H.npz", (J.T @ J).tocsc())
    V = vg.gauge_normal(layout, (at.R, at.p), vg.KeyframeGauge(0))
    rows = layout.columns(3)
    found = run("Your own information matrix")["block"]
    assert vg.relative_frobenius(found, in_gauge(J, T, V)[np.ix_(rows, rows)]) < 1e-8


def test_another_order_of_columns(folder: Path) -> None:
    layout = run("Another order of columns")["layout"]
    assert layout.name_of(0) == "point 0" and layout.name_of(150) == "velocity of keyframe 0"
    assert layout.name_of(154) == "rotation of keyframe 0" and layout.name_of(layout.n - 1)[:8] == "position"


def test_kinds_of_concerns() -> None:
    """Catches a finding of the audit that the page does not list, or lists under another name."""
    told = {
        kind
        for row in cells(section(ESTIMATOR, "What may be wrong"))
        for kind in re.findall(r'"(\w+)"', row[1])
    }
    assert told | {"spread"} == set(re.findall(r'"(\w+)"', vg.Concern.__doc__ or ""))


def test_ros_and_openvins(folder: Path) -> None:
    """Catches a file that is not read, or a gauge and frame that do not reach ROS."""
    row = " 0 0 0 1 1 2 3 4 5 6" + " 0" * 6
    Path("ov_estimate.txt").write_text(f"1.5{row}\n2.5{row}\n")
    Path("ov_estimate_std.txt").write_text("1.5 .1 .2 .3 4 5 6 7 8 9" + " 0" * 6 + "\n2.5" + " 1" * 15)
    names = run("To and from ROS and OpenVINS")
    assert names["filtered"].sigma[0].tolist() == [4, 5, 6, 0.1, 0.2, 0.3, 7, 8, 9]
    written = vg.load_trajectory("poses.csv", gauge="first")
    assert written.frame == "map" and written.covariance.shape == (10, 6, 6)
    np.testing.assert_allclose(written.covariance[3], names["blocks"][3][:6, :6], rtol=1e-9, atol=1e-15)
    assert names["found"].semi_axes.shape == (10, 3)


def test_outliers() -> None:
    """Catches an example whose loss does not help, or that counts other observations than the wrong ones."""
    names = run("Outliers")
    robust, plain = (names[run].state for run in ("solution", "plain"))
    right = vg.solve(vg.example_problem(), vg.FixedGauge()).state
    assert np.abs(robust.p_W - right.p_W).max() < 0.3 * np.abs(plain.p_W - right.p_W).max()
    wrong = len(names["problem"].obs_uv) / 10
    assert wrong < names["solution"].down_weighted < 2.0 * wrong


def test_convention_is_checked_by_differences() -> None:
    names = run("Convert a block, and check it", CONVENTIONS)
    assert vg.relative_frobenius(names["ros"], names["gtsam"]) > 0.1  # or the page shows nothing


def test_all_conventions_are_listed() -> None:
    listed = [row[0] for row in cells(section(CONVENTIONS, "Side of a rotation"))]
    assert listed == list(CHARTS)


def test_scores_of_designs() -> None:
    title = "Scores of optimal design"
    best = run(title, GAUGE)["best"]
    printed = cells(section(GAUGE, title))
    assert [row[1:] for row in printed] == [[str(row[score]) for score in "DAE"] for row in best.values()]


def test_cost_of_gauges_is_as_expected() -> None:
    """Catches a table of iterations that was typed, or that a renewed expected value left behind."""
    assert shown("cost", GAUGE) == cost_table(), "python -m benchmarks.gauge_weights"


@pytest.mark.parametrize("system", SHIPPED)
def test_shipped_weights_are_as_printed(system: str) -> None:
    (row,) = [row[1:] for row in cells(shown("weights", GAUGE)) if row[0] == system]
    for text, (name, value) in zip(row, measured(*SHIPPED[system]).items(), strict=True):
        number = float("nan" if text == "-" else text)
        if number < 1e-6:  # rounding or the last step of a solve, which differ by machine
            assert value < 1e-6, name
        else:
            np.testing.assert_allclose(value, number, rtol=0.06, err_msg=name)


WHOLE = ("index", "tutorial")  # run from top to bottom
BY_SECTION = {
    "from_your_estimator": 9,
    "conventions": 1,
    "which_gauge": 1,
}  # run one by one, by the tests above
LANGUAGES = {"", "python", "text", "cpp", "yaml", "{toctree}", "{eval-rst}", "{csv-table}", "{include}"}
PAGES = {path.stem: path.read_text("utf-8") for path in pages.DOCS.glob("*.md")}


def test_every_block_is_run() -> None:
    """Catches a page or a section whose Python no test runs, or that hides behind another mark."""
    found = {name: len(pages.blocks(text)) for name, text in PAGES.items() if name not in WHOLE}
    assert {name: count for name, count in found.items() if count} == BY_SECTION
    for name, text in PAGES.items():
        marks = re.findall(r"^ *(?:```|~~~)(.*)$", text, re.MULTILINE)
        assert {mark.partition(" ")[0] for mark in marks} <= LANGUAGES, name


def test_commands_exist() -> None:
    """Catches a command that was renamed under the pages that name it."""
    others = [ROOT / name for name in ("README.md", "CONTRIBUTING.md", ".github/workflows/ci.yml")]
    text = "\n".join([*PAGES.values(), *(path.read_text("utf-8") for path in others)])
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE))
    before = r"(?:^|`|run: |sudo )"
    named = re.findall(rf"{before}(?:EUROC_ROOT=\S+ )?make ([a-z-]+)", text, re.MULTILINE)
    modules = re.findall(r"python -m ((?:vigauge|benchmarks)[\w.]*)(?![\w.<])", text)
    words = re.findall(r"`\n?vigauge ([a-z-]+)", text)
    rules = "\n".join(path.read_text("utf-8") for path in (ROOT / "workflow" / "rules").glob("*.smk"))
    asked = re.findall(r"`snakemake --cores 2 ([a-z_]+)`", text)
    assert set(asked) >= {"windows", "paper_page"} and all(f"rule {rule}:" in rules for rule in asked)
    assert {"paper", "check-results"} <= set(named) <= targets
    assert {"check", "estimate"} <= set(words) <= set(COMMANDS)
    assert modules and all(map(importlib.util.find_spec, modules))


@pytest.mark.parametrize(
    "name", ["README.md", "CONTRIBUTING.md", "CHANGELOG.md", *(f"docs/{n}.md" for n in PAGES)]
)
def test_links_inside_the_repository_lead_somewhere(name: str) -> None:
    """Catches a page, a picture or a heading that was renamed under a link to it."""
    page = ROOT / name
    for path, heading in re.findall(r"\]\((?!https?:)([^)#\s]*)#?([^)\s]*)\)", page.read_text("utf-8")):
        target = page.parent / path if path else page
        assert target.exists(), path
        if heading:
            headings = re.findall(r"^#+ (.*)$", target.read_text("utf-8"), re.MULTILINE)
            assert heading in {re.sub(r"[^\w -]", "", h.lower()).replace(" ", "-") for h in headings}, heading


def test_readme_is_short_and_pictures_are_light(tmp_path: Path) -> None:
    """Catches a README that grows again, a picture no longer drawn or too heavy to ship."""
    assert len((ROOT / "README.md").read_text("utf-8").splitlines()) <= 150
    picture.draw(tmp_path / "gauges.png")
    for path in (tmp_path / "gauges.png", *pages.DOCS.glob("*.png")):
        assert 10_000 < path.stat().st_size < 60_000, path.name


def test_site_is_strict_and_fetches_nothing(tmp_path: Path) -> None:
    """Catches a broken link, a malformed docstring, a public name without a place, an outside address."""
    for package in ("sphinx", "myst_parser", "furo", "latex2mathml", "ziamath"):
        pytest.importorskip(package, reason="needs the extra docs")
    site = tmp_path / "site"
    command = [sys.executable, "-m", "sphinx", "--quiet", "--fail-on-warning", "--doctree-dir"]
    done = subprocess.run(
        [*command, tmp_path / "doctrees", "docs", site], cwd=ROOT, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    loads = re.compile(
        r"""<(?!a\b)\w[^>]*\b(?:src|href|data)=["']?(?:https?:)?//|url\(["']?(?:https?:)?//|@import"""
    )
    for path in [*site.rglob("*.html"), *site.rglob("*.css")]:
        assert not loads.search(path.read_text("utf-8")), path.name
    assert (site / "_static" / "STIXTwoMath-Regular.ttf").exists()
    listed = re.findall(r'<dt [^>]*id="vigauge\.(\w+)"', (site / "api.html").read_text("utf-8"))
    assert sorted(listed) == sorted(set(vg.__all__) - {"__version__"})
    assert "<math" in (site / "tutorial.html").read_text("utf-8")
    assert "https://doi.org/10.1109/LRA.2018.2833152  tutorial\n" in (site / "external_links.txt").read_text(
        "utf-8"
    )


NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


@pytest.mark.parametrize("name", WHOLE)
def test_page_prints_what_it_shows(name: str, folder: Path) -> None:
    """Catches a block that fails, prints something else than the page says, or draws no picture for it."""
    page = pages.DOCS / f"{name}.md"
    names: dict[str, Any] = {}
    for block, printed in pages.run(page, names):
        assert NUMBER.sub("0", printed) == NUMBER.sub("0", block.shown), f"{page.name}, line {block.line}"
        found, expected = (np.array(NUMBER.findall(text), float) for text in (printed, block.shown))
        np.testing.assert_allclose(found, expected, rtol=0.02, err_msg=f"{page.name}, line {block.line}")
    pictures = re.findall(r"^!\[.*\]\((.*)\)$", page.read_text("utf-8"), re.MULTILINE)
    assert sorted(pictures) == sorted(path.name for path in folder.iterdir())
    # One gauge has one colour, in the tutorial and in the figures.
    assert names.get("COLOURS", {}).items() <= COLOURS.items()
