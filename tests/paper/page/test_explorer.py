"""The gauge explorer in a real browser: its numbers against Python's, its sliders by mouse and keyboard."""

import hashlib
import re
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from support.material import material_of
from support.simulated import SETTINGS, TIGHT, scene, trial
from vigauge.covariance.consistency import nees
from vigauge.covariance.covariance import Covariance
from vigauge.covariance.projection import along_orbit
from vigauge.gauge.gauges import CentroidGauge, FixedGauge, FreeGauge, Gauge, KeyframeGauge, PriorGauge
from vigauge.model.problem import Problem
from vigauge.model.state import State
from vigauge.solver.levenberg_marquardt import solve
from vigauge_paper import page as package
from vigauge_paper.experiments.nees import FreeMotionGauge
from vigauge_paper.figures.chart import Chart
from vigauge_paper.page.explorer import at_truth, explorer_data, noisier
from vigauge_paper.page.index import index_page
from vigauge_paper.prior import INFORMATION, RESIDUAL, information

N = SETTINGS.n_keyframes
FREE_OF_LANDMARKS, WITH_LANDMARKS = "motion", "free"

# Ten settings of the controls, and the gauge that Python knows them as.
CASES: list[tuple[dict[str, Any], Gauge]] = [
    ({"kind": "fix"}, FixedGauge()),
    *(({"kind": "keyframe", "keyframe": k}, KeyframeGauge(k)) for k in (0, 3, N - 1)),
    ({"kind": "centroid"}, CentroidGauge()),
    ({"kind": FREE_OF_LANDMARKS}, FreeMotionGauge()),
    ({"kind": WITH_LANDMARKS}, FreeGauge()),
    *(
        ({"kind": "prior", "weight": power, "reading": what}, PriorGauge(information(10.0**power, what)))
        for power, what in ((5.0, RESIDUAL), (2.5, RESIDUAL), (5.0, INFORMATION))
    ),
]


@pytest.fixture(scope="module")
def solved() -> tuple[Problem, State, State]:
    """A problem, its estimate where the truth is, and the truth."""
    problem, truth = trial(), scene().truth
    return problem, at_truth(solve(problem, FreeGauge(), TIGHT).state, truth), truth


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    found = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if found is None:
        pytest.skip("there is no Chromium: apt-get install chromium")
    with playwright.sync_playwright() as running:
        # Containers run as root, where Chromium has no sandbox.
        started = running.chromium.launch(executable_path=found, args=["--no-sandbox"])
        yield started
        started.close()


@pytest.fixture(scope="module")
def file(solved: tuple[Problem, State, State], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A page with a simulated estimate, and the same as a recording, whose landmarks have no truth."""
    problem, estimate, truth = solved
    recording = replace(truth, X_W=np.empty((0, 3)))
    folder = tmp_path_factory.mktemp("page")
    explorers = [
        explorer_data("simulated", problem, estimate, truth),
        explorer_data("recording", problem, estimate, recording),
        {"name": "still", "withheld": "It does not move"},
    ]
    (folder / "index.html").write_text(index_page(material_of(folder, explorers)), "utf-8")
    return folder / "index.html"


@pytest.fixture
def page(browser: Any, file: Path) -> Iterator[Any]:
    """The page at its start; whatever it complains of, or asks the network for, fails the test."""
    opened = browser.new_page(viewport={"width": 1300, "height": 950})
    complaints: list[str] = []
    opened.on("console", lambda message: complaints.append(message.text))
    opened.on("pageerror", lambda error: complaints.append(str(error)))
    opened.on("request", lambda r: r.url.startswith(("file:", "data:")) or complaints.append(r.url))
    opened.goto(file.as_uri())
    yield opened
    opened.close()
    assert not complaints


def set_controls(page: Any, controls: dict[str, Any]) -> None:
    page.evaluate(
        """controls => {
            const form = document.getElementById("gauge-form");
            for (const [name, value] of Object.entries(controls)) form.elements[name].value =
                name === "weight" ? String(value) : value;
            form.dispatchEvent(new Event("input", { bubbles: true }));
        }""",
        controls,
    )


def numbers(page: Any) -> dict[str, Any]:
    """What the explorer shows, unrounded."""
    return page.evaluate(
        """() => {
            const { now, relative, i, j } = gaugeExplorer.numbers();
            return { ...now, C: [...now.C], slope: [...now.slope], relative: [...relative], i, j };
        }"""
    )


def log_det(covariance: np.ndarray, zeros: int) -> float:
    """Of the eigenvalues that are not zero; those of a strong prior are far below the others."""
    if zeros:
        return float(np.log(np.linalg.eigvalsh(covariance)[zeros:]).sum())
    sigma = np.sqrt(np.diagonal(covariance))
    return float(np.linalg.slogdet(covariance / np.outer(sigma, sigma))[1] + 2.0 * np.log(sigma).sum())


@pytest.mark.parametrize(("controls", "gauge"), CASES)
def test_numbers_are_those_of_the_library(
    page: Any, solved: tuple[Problem, State, State], controls: dict[str, Any], gauge: Gauge
) -> None:
    """Catches a formula of the page that is not the library's: covariance, traces, relative pose, NEES,
    difference of log det, and what Fig. 8 projects."""
    problem, state, truth = solved
    set_controls(page, controls)
    found = numbers(page)
    covariance, worse = Covariance.of(problem, state), Covariance.of(noisier(problem), state)
    motion = covariance.motion(gauge)
    scale = np.sqrt(np.diagonal(motion))
    unit = np.outer(np.where(scale > 0, scale, 1.0), np.where(scale > 0, scale, 1.0))
    C = np.reshape(found["C"], motion.shape)
    assert np.abs((C - motion) / unit).max() < 1e-9
    np.testing.assert_allclose(found["traces"], np.diagonal(motion).reshape(3, -1).sum(axis=1), rtol=1e-9)
    relative = covariance.relative_pose(found["i"], found["j"]).covariance
    tolerance = 1e-9 * np.sqrt(np.outer(np.diagonal(relative), np.diagonal(relative)))
    assert np.all(np.abs(np.reshape(found["relative"], (6, 6)) - relative) < tolerance)
    V, U, error = gauge.normal(state), covariance.U, state.local(truth)
    there = (error - along_orbit(U, V) @ (V.T @ error))[: len(motion)]
    held = 0 if controls["kind"] in (WITH_LANDMARKS, "prior") else 4
    dof = len(motion) - (0 if controls["kind"] == WITH_LANDMARKS else 4)
    assert found["dof"] == dof
    assert found["nees"] == pytest.approx(nees(there, motion, len(motion) - held), rel=1e-9)
    difference = log_det(worse.motion(gauge), held) - log_det(motion, held)
    assert found["logDetDifference"] == pytest.approx(difference, rel=1e-9)
    direction = Chart.around(problem, state).direction
    slope = -np.linalg.solve(V.T @ U, V.T @ direction)
    np.testing.assert_allclose(found["slope"], slope, rtol=1e-9, atol=1e-12)


def test_what_can_be_measured_stays_and_the_rest_changes(page: Any) -> None:
    """Catches an explorer that shows the same gauge whatever is chosen."""
    set_controls(page, {"kind": "fix"})
    fixed = numbers(page)
    for controls, _ in CASES[1:]:
        set_controls(page, controls)
        found = numbers(page)
        assert found["relative"] == pytest.approx(fixed["relative"], rel=1e-6, abs=1e-15)
        if controls["kind"] != WITH_LANDMARKS:
            assert found["nees"] == pytest.approx(fixed["nees"], rel=1e-8)
            assert found["logDetDifference"] == pytest.approx(fixed["logDetDifference"], rel=1e-8)
        if controls["kind"] not in ("fix", "prior") and controls.get("keyframe") != 0:
            assert abs(found["traces"][0] / fixed["traces"][0] - 1) > 0.01


@pytest.mark.parametrize("reading", [RESIDUAL, INFORMATION])
def test_a_freedom_too_large_for_a_linear_covariance_is_named(
    page: Any, solved: tuple[Problem, State, State], reading: str
) -> None:
    """Catches ellipses of kilometres that nothing warns of, and a warning in every gauge."""
    problem, state, _ = solved
    covariance, warning = Covariance.of(problem, state), page.locator("#too-large")
    warned = set()
    for power in (0.0, 0.7, 0.8, 1.4, 1.6, 4.0):
        set_controls(page, {"kind": "prior", "weight": power, "reading": reading})
        motion = covariance.motion(PriorGauge(information(10.0**power, reading)))
        yaw = np.degrees(np.sqrt(np.diagonal(motion)[3 * N : 6 * N][2::3].max()))
        shown = warning.inner_text() if warning.is_visible() else ""
        found = re.search(r"yaw has a standard deviation of ([\d.]+)°", shown)
        assert (found is not None) == (yaw > 10.0)
        assert found is None or float(found[1]) == pytest.approx(yaw, rel=5e-3)
        assert ("not how large errors are" in shown) == bool(shown)
        warned.add(bool(shown))
    assert warned == {True, False}
    set_controls(page, {"kind": "fix"})
    assert warning.is_hidden()


def test_the_scale_has_the_greys_of_the_matrix(page: Any) -> None:
    """Catches a scale that is not that of the picture: its ticks, read as greys, give the pixels."""
    set_controls(page, {"kind": "keyframe", "keyframe": 3})
    C = np.reshape(numbers(page)["C"], (9 * N, 9 * N))
    bar, ticks, pixels = page.evaluate(
        """() => {
            const [canvas, bar] = [document.getElementById("matrix"), document.querySelector("#scale rect")];
            const ticks = [...document.querySelectorAll("#scale .tick")].filter((tick) => tick.textContent);
            return [
                [bar.x.baseVal.value, bar.width.baseVal.value],
                ticks.map((t) => [Number(t.textContent.replace("−", "-")), t.transform.baseVal[0].matrix.e]),
                [...canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data],
            ];
        }"""
    )
    values, places = np.transpose(ticks)
    assert len(values) >= 2
    slope, start = np.polyfit(np.log10(values), (places - bar[0]) / bar[1], 1)
    red, green, blue = np.moveaxis(np.reshape(pixels, (*C.shape, 4)), 2, 0)[:3]
    grey = (red == green) & (green == blue)
    assert 0.5 < grey.mean() < 1.0  # what is held is yellow
    expected = 255.0 * (1.0 - start - slope * np.log10(np.abs(C) + 1e-7))
    assert np.abs(red - expected)[grey].max() < 2.0


def test_sliders_move_by_keyboard_and_mouse(page: Any) -> None:
    """Catches a control that only looks like one."""
    page.get_by_label("one keyframe").check()
    slider = page.locator("input[name=keyframe]")
    before = int(slider.input_value())
    slider.focus()
    page.keyboard.press("ArrowRight")
    assert int(slider.input_value()) == before + 1
    assert page.locator("output[name=keyframe-text]").inner_text() == str(before + 1)
    held = np.reshape(numbers(page)["C"], (9 * N, 9 * N))[3 * (before + 1), 3 * (before + 1)]
    assert abs(held) < 1e-15
    slider.scroll_into_view_if_needed()
    box = slider.bounding_box()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.down()
    page.mouse.move(box["x"] + 3, box["y"] + box["height"] / 2, steps=4)
    page.mouse.up()
    assert slider.input_value() == "0"


def test_keyframes_are_chosen_by_click_and_by_key(page: Any) -> None:
    keyframes = page.locator("circle.keyframe")
    assert keyframes.count() == N
    keyframes.nth(1).click(force=True)
    keyframes.nth(4).focus()
    page.keyboard.press("Enter")
    assert (numbers(page)["i"], numbers(page)["j"]) == (1, 4)
    assert page.locator("#stays th").first.inner_text().startswith("σ of 4 seen from 1")


def test_the_error_of_figure_8_is_dragged(page: Any) -> None:
    """Catches handles that do not follow the mouse, and a projection that the way along the orbit changes."""
    note = page.locator("#orbit-note")
    handle = page.locator("#orbit circle").nth(1)
    handle.scroll_into_view_if_needed()
    before, text = page.locator("#orbit-form input[name=a]").input_value(), note.inner_text()
    box = handle.bounding_box()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.down()
    page.mouse.move(box["x"] + 70, box["y"] + box["height"] / 2 - 5, steps=5)
    page.mouse.up()
    assert float(page.locator("#orbit-form input[name=a]").input_value()) > float(before)
    assert note.inner_text() != text
    across = page.locator("#orbit-form input[name=b]").input_value()
    drawn = page.locator("#orbit path.line").last.get_attribute("d")
    place = page.locator("#orbit-form input[name=place]")
    place.focus()
    page.keyboard.press("ArrowRight")
    assert page.locator("#orbit-form input[name=b]").input_value() == across
    assert page.locator("#orbit path.line").last.get_attribute("d") == drawn


def test_it_opens_where_the_gauge_makes_a_difference(page: Any) -> None:
    """Catches an explorer that opens with two equal columns, the first pose held beside itself."""
    for row in page.locator("#changes tr").all():
        here, held = row.locator("td").all_inner_texts()
        assert here != held


def test_a_recording_says_what_it_does_not_know(page: Any) -> None:
    """Catches a NEES of the free gauge from landmarks whose truth nobody has, and a withheld covariance."""
    set_controls(page, {"estimate": "1", "kind": "free"})
    assert "not known" in page.locator("#stays").inner_text()
    page.get_by_label("(fixation)").check()
    assert "not known" not in page.locator("#stays").inner_text()
    assert "still is not shown: its covariance is withheld. It does not move." in page.inner_text("#explorer")


def test_the_ledger_is_filtered(page: Any) -> None:
    """Catches a filter that hides nothing, or hides the row that a link leads to."""
    rows = page.locator(".ledger tbody tr:visible")
    every = rows.count()
    page.get_by_label("Verdict").select_option("differs")
    differing = rows.count()
    assert 0 < differing < every
    page.locator("#filter input[name=text]").fill("iterations")
    assert 0 < rows.count() < differing
    page.locator("#figure-fig09 a").first.click()
    assert rows.count() == every
    page.locator("#filter input[name=text]").fill("nowhere to be found")
    assert rows.count() == 0
    assert page.locator("#filter output").inner_text() == f"0 of {every} claims"


@pytest.mark.parametrize("width", [400, 1300])
def test_nothing_is_wider_than_the_screen(page: Any, width: int) -> None:
    """Catches a table or figure that makes the whole page scroll sideways on a phone."""
    page.set_viewport_size({"width": width, "height": 860})
    assert page.evaluate("document.documentElement.scrollWidth") <= width


def test_d3_is_the_published_one() -> None:
    """Catches an edited or truncated copy of the vendored library (the sum is that of its npm package)."""
    data = (Path(package.__file__).parent / "d3.min.js").read_bytes()
    found = hashlib.sha256(data).hexdigest()
    assert found == "f2094bbf6141b359722c4fe454eb6c4b0f0e42cc10cc7af921fc158fceb86539"
