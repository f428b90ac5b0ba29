"""`vigauge estimate`: what it writes and says; and its refusals, one sentence each and nothing written.

`docs/faults.csv` lists the refusals; its messages are held against what the command says here.
"""

import csv
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

import vigauge as vg
from support import ROOT
from support.uniform_motion import render_uniform_motion
from vigauge.cli import estimate as command
from vigauge.errors import DataError
from vigauge.recordings import Estimate
from vigauge.recordings.estimation.windows import Part

KEYFRAMES = 7


def run(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> int:
    """Exit status of the command, run in this process."""
    monkeypatch.setattr(sys, "argv", ["vigauge estimate", *map(str, arguments)])
    try:
        command.main()
    except SystemExit as end:
        return int(end.code or 0)
    return 0


def test_command_says_the_same_with_a_truth_in_the_folder(rendered, made: Estimate, tmp_path: Path) -> None:
    """A truth that has a part in the estimate; a flag that is not heard; a folder that lacks a file."""
    out = tmp_path / "out"
    flags = ("--keyframes", KEYFRAMES, "--gauge", "keyframe:2", "--out", out)
    words = [sys.executable, "-m", "vigauge.cli", "estimate", rendered.folder, *flags]
    done = subprocess.run([*map(str, words)], capture_output=True, text=True, check=False)
    assert done.returncode == bool(made.warnings), done.stderr
    found = vg.load_trajectory(out / "trajectory.npz")
    np.testing.assert_allclose(found.p_W, made.state.p_W, atol=1e-9)
    assert found.gauge == "keyframe:2"
    assert found.sigma[2, :3].max() < 1e-9 < found.sigma[0, :3].max()
    (truth,) = json.loads((out / "summary.json").read_text("utf-8"))["truth"]
    assert truth["name"] == "state_groundtruth_estimate0" and truth["p_rmse_m"] < 0.006
    assert "truth, unused" in done.stdout and "gauge          keyframe:2" in done.stdout


@pytest.mark.parametrize(("warnings", "status"), [((), 0), (("doubt",), 1)])
def test_exit_status_tells_of_warnings(
    made: Estimate,
    folder: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    warnings: tuple[str, ...],
    status: int,
) -> None:
    monkeypatch.setattr(command, "estimate", lambda *_, **__: replace(made, warnings=warnings))
    assert run(monkeypatch, folder, "--out", tmp_path / "out") == status


def test_windows_one_after_another(
    made: Estimate, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A window that is refused must neither stop the others nor go unsaid."""
    parts = [Part(0.0, 5.0, 9, 5.0), Part(5.0, 10.0, 9, 0.0)]

    def one(*_: object, start_s: float, **__: object) -> Estimate:
        if start_s:
            raise DataError(folder, "nothing moves")
        return made

    monkeypatch.setattr(command, "proposed_parts", lambda *_: parts)
    monkeypatch.setattr(command, "estimate", one)
    assert run(monkeypatch, folder, "--windows", "--out", tmp_path / "out") == 1
    found = json.loads((tmp_path / "out" / "summary.json").read_text("utf-8"))
    assert list(found["windows"]) == ["0.00_5.00"]
    assert "nothing moves" in found["refused"]["5.00_10.00"]


def rewrite(path: Path, text: str) -> None:
    """New content in a new file: the old one is linked to the shared rendering."""
    path.unlink()
    path.write_text(text, encoding="utf-8")


def imu(change: Callable[[np.ndarray], np.ndarray], shift_ns: int = 0) -> Callable[[Path], None]:
    """Change the inertial values (M, 6), and shift their stamps."""

    def spoil(folder: Path) -> None:
        path = folder / "mav0" / "imu0" / "data.csv"
        head, *rows = path.read_text("utf-8").splitlines()
        values = change(np.array([[float(x) for x in row.split(",")[1:]] for row in rows]))
        stamps = [int(row.split(",")[0]) + shift_ns for row in rows]
        lines = [",".join(map(repr, [t, *row])) for t, row in zip(stamps, values.tolist(), strict=True)]
        rewrite(path, "\n".join([head, *lines]) + "\n")

    return spoil


def standing(folder: Path) -> None:
    """One image with fresh noise, a resting sensor."""
    rng = np.random.default_rng(0)
    for camera in ("cam0", "cam1"):
        files = sorted((folder / "mav0" / camera / "data").iterdir())
        first = cv2.imread(str(files[0]), cv2.IMREAD_UNCHANGED)
        for path in files:
            noisy = np.clip(first + rng.integers(-2, 3, first.shape), 0, 255).astype(np.uint8)
            path.unlink()
            cv2.imwrite(str(path), noisy)
    rest, sigma = np.array([0.0, 0.02, 0.08, 9.81, 0.1, 0.05]), np.repeat([0.002, 0.03], 3)
    imu(lambda values: rest + sigma * rng.normal(size=values.shape))(folder)


def without(*names: str) -> Callable[[Path], None]:
    def spoil(folder: Path) -> None:
        for name in names:
            shutil.rmtree(folder / "mav0" / name)

    return spoil


def without_key(folder: Path) -> None:
    path = folder / "mav0" / "cam0" / "sensor.yaml"
    rewrite(path, re.sub(r"(?m)^intrinsics:.*\n(- .*\n)*", "", path.read_text("utf-8")))


def scaled(columns: slice, factor: float) -> Callable[[Path], None]:
    def change(values: np.ndarray) -> np.ndarray:
        values[:, columns] *= factor
        return values

    return imu(change)


def turning(folder: Path) -> None:
    """One camera that turns in place."""
    render_uniform_motion(folder, np.zeros(3))
    without("cam1", "state_groundtruth_estimate0")(folder)


def straight(folder: Path) -> None:
    """One camera at constant velocity, sideways."""
    render_uniform_motion(folder, [0.0, 0.8, 0.0])
    without("cam1", "state_groundtruth_estimate0")(folder)


def gap(folder: Path) -> None:
    """A tenth of a second of inertial samples is lost."""
    path = folder / "mav0" / "imu0" / "data.csv"
    rows = path.read_text("utf-8").splitlines(keepends=True)
    middle = len(rows) // 2
    rewrite(path, "".join(rows[:middle] + rows[middle + 20 :]))


def exchanged_cameras(folder: Path) -> None:
    left, right = (folder / "mav0" / name / "sensor.yaml" for name in ("cam0", "cam1"))
    texts = left.read_text("utf-8"), right.read_text("utf-8")
    rewrite(left, texts[1])
    rewrite(right, texts[0])


def black(folder: Path) -> None:
    for path in folder.glob("mav0/cam?/data/*"):
        size = cv2.imread(str(path), cv2.IMREAD_UNCHANGED).shape
        path.unlink()
        cv2.imwrite(str(path), np.zeros(size, np.uint8))


def nothing(folder: Path) -> None:
    pass


# What is spoilt, and flags.
REFUSED: dict[str, tuple[Callable[[Path], None], tuple[object, ...]]] = {
    "no images": (without("cam0", "cam1"), ()),
    "no inertial samples": (without("imu0"), ()),
    "standing still": (standing, ()),
    "one camera that only turns": (turning, ()),
    "one camera at constant velocity": (straight, ()),
    "inertial gap": (gap, ()),
    "clock 40 ms off": (imu(lambda values: values, 40_000_000), ()),
    "cameras exchanged": (exchanged_cameras, ()),
    "black images": (black, ()),
    "window too short": (nothing, ("--start", 0.2, "--end", 0.6)),
    "window outside the recording": (nothing, ("--start", 100)),
    "clocks that share no time": (imu(lambda values: values, 10**12), ()),
    "calibration without a key": (without_key, ()),
    "gyroscope in deg/s": (scaled(slice(0, 3), 180.0 / np.pi), ()),
    "accelerometer in g": (scaled(slice(3, 6), 1.0 / 9.81), ()),
    "accelerometer of the wrong sign": (scaled(slice(3, 6), -1.0), ()),
    "too many keyframes": (nothing, ("--keyframes", 1000)),
    "keyframe of the gauge missing": (nothing, ("--gauge", "keyframe:99")),
    "unknown gauge": (nothing, ("--gauge", "last")),
    "unknown loss": (nothing, ("--loss", "huber:-1")),
}


# A clock is told from more turns than the flight of the other cases has.
LONGER = "clock 40 ms off"


def says(case: str, shown: str) -> bool:
    """Whether the table's message for a case, with ... for what differs, is what was shown."""
    with (ROOT / "docs" / "faults.csv").open(encoding="utf-8", newline="") as stream:
        (row,) = [row for row in csv.DictReader(stream) if row["test"].endswith(f"[{case}]")]
    return bool(re.search(".*".join(map(re.escape, row["message"].split("..."))), shown))


@pytest.mark.parametrize("case", REFUSED)
def test_refusal_is_one_sentence_and_nothing_is_written(
    folder: Path,
    good_folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
    case: str,
) -> None:
    """A traceback, a number from bad data, or a folder that is half there."""
    spoil, flags = REFUSED[case]
    if case == LONGER:
        shutil.rmtree(folder)
        shutil.copytree(good_folder, folder, copy_function=os.link)
    spoil(folder)
    out = folder.parent / "out"
    assert run(monkeypatch, folder, "--out", out, *flags) == 2
    shown = [line for line in capfd.readouterr().err.splitlines() if "error:" in line]
    assert len(shown) == 1 and says(case, shown[0]), shown
    assert [path.name for path in folder.parent.iterdir()] == [folder.name]


def test_output_of_somebody_else_is_left_alone(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """Results over a folder of other data, or minutes of work that cannot be written."""
    (folder.parent / "notes").mkdir()
    (folder.parent / "notes" / "mine.txt").write_text("mine", encoding="utf-8")
    assert run(monkeypatch, folder, "--out", folder.parent / "notes") == 2
    assert "choose another --out" in capfd.readouterr().err
    assert run(monkeypatch, folder, "--out", folder.parent / "notes" / "mine.txt" / "out") == 2
    assert "cannot be written" in capfd.readouterr().err
    assert [path.name for path in (folder.parent / "notes").iterdir()] == ["mine.txt"]
