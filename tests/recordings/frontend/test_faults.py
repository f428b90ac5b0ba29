"""Faulty sequences through the front-end's command: one message and status 2, or mended and counted.

`docs/faults.csv` lists the faults; its messages and exit statuses are held against what
the command does here.
"""

import json
import os
import re
import shutil
import sys
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from support import ROOT
from vigauge import FreeGauge, load_problems, motion_covariance, solve
from vigauge.files import read_rows
from vigauge_paper.commands import front_end

SETTINGS = {"tracker": "optical_flow", "keyframes": {"count": 7}}
IMU, CAMERA = "imu0/data.csv", "cam0/data.csv"
TRUTH = "state_groundtruth_estimate0/data.csv"


def rewrite(path: Path, data: bytes) -> None:
    """New content in a new file: the old one is linked to the shared rendering."""
    path.unlink()
    path.write_bytes(data)


def edit(name: str, change: Callable[[list[str]], list[str]]) -> Callable[[Path], None]:
    """Change the lines of a file below mav0."""

    def spoil(mav: Path) -> None:
        lines = (mav / name).read_text("utf-8").splitlines()
        rewrite(mav / name, ("\n".join(change(lines)) + "\n").encode())

    return spoil


def with_field(line: str, k: int, value: str) -> str:
    fields = line.split(",")
    fields[k] = value
    return ",".join(fields)


def first_image(mav: Path) -> Path:
    return min((mav / "cam0" / "data").iterdir())


def image(make: Callable[[bytes], bytes]) -> Callable[[Path], None]:
    return lambda mav: rewrite(first_image(mav), make(first_image(mav).read_bytes()))


def png(array: np.ndarray) -> bytes:
    return cv2.imencode(".png", array)[1].tobytes()


def corrupted(data: bytes) -> bytes:
    at = data.index(b"IDAT") + 1000
    return data[:at] + bytes([data[at] ^ 0x55]) + data[at + 1 :]


SPOILT: dict[str, Callable[[Path], None]] = {
    "data.csv missing": lambda mav: (mav / IMU).unlink(),
    "data.csv empty": edit(IMU, lambda lines: []),
    "data.csv with a header only": edit(IMU, lambda lines: lines[:1]),
    "data.csv with a trailing comma": edit(IMU, lambda lines: [*lines[:7], lines[7] + ",", *lines[8:]]),
    "stamps unsorted": edit(IMU, lambda lines: [*lines[:7], lines[8], lines[7], *lines[9:]]),
    "inertial stamp repeated with other values": edit(
        IMU, lambda lines: [*lines[:7], with_field(lines[7], 1, "0.25"), *lines[7:]]
    ),
    "stamps as floats": edit(IMU, lambda lines: [*lines[:7], with_field(lines[7], 0, "1.4e18"), *lines[8:]]),
    "NaN in inertial data": edit(IMU, lambda lines: [*lines[:7], with_field(lines[7], 4, "nan"), *lines[8:]]),
    "Inf in ground truth": edit(
        TRUTH, lambda lines: [*lines[:7], with_field(lines[7], 8, "inf"), *lines[8:]]
    ),
    "image corrupt": image(corrupted),
    "image truncated": image(lambda data: data[: len(data) // 2]),
    "image of another size": image(lambda data: png(np.zeros((480, 640), np.uint8))),
    "image of another depth": image(lambda data: png(np.zeros((480, 752), np.uint16))),
}


def copy_of(folder: Path, target: Path) -> Path:
    """The rendered sequence by hard links."""
    shutil.copytree(folder, target, copy_function=os.link)
    return target


def run(folder: Path, out: Path, *flags: str) -> int:
    """Exit status of the front-end's command on a sequence."""
    truth = folder / "mav0" / "state_groundtruth_estimate0"
    arguments = [
        *("--sequence", folder, "--biases", truth, "--truth", truth, "--settings", json.dumps(SETTINGS)),
        *(
            "--output",
            out / "problem.npz",
            "--truth-output",
            out / "truth.npz",
            "--report",
            out / "report.json",
        ),
    ]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["front_end", *map(str, arguments), *flags])
        try:
            front_end.main()
        except SystemExit as end:
            return int(end.code or 0)
    return 0


def table() -> list[dict[str, str]]:
    return read_rows(ROOT / "docs" / "faults.csv")


@pytest.mark.parametrize("fault", SPOILT)
def test_faulty_sequence_is_one_message(rendered, tmp_path: Path, capsys, fault: str) -> None:
    """Catches a traceback, status 0, output of half a run, or a table of faults that tells stories."""
    (row,) = [row for row in table() if row["input"] == fault]
    folder = copy_of(rendered.folder, tmp_path / "flight")
    SPOILT[fault](folder / "mav0")
    status = run(folder, tmp_path / "out")
    shown = capsys.readouterr().err
    assert status == 2 and row["outcome"].endswith("exit status 2")
    assert "Traceback" not in shown
    assert re.fullmatch(message_pattern(row["message"]), shown.strip().splitlines()[-1]), shown
    assert not (tmp_path / "out").exists()


def message_pattern(message: str) -> str:
    """A message of the table as a pattern: '...' stands for paths and values."""
    return "error: " + ".*".join(re.escape(part) for part in message.split("..."))


def test_harmless_and_mendable_faults_change_nothing_but_counts(rendered, tmp_path: Path) -> None:
    """Catches a byte-order mark, CRLF, repeated or (when allowed) unsorted rows that lose or move data."""
    assert run(rendered.folder, tmp_path / "clean") == 0
    folder = copy_of(rendered.folder, tmp_path / "flight")
    mav = folder / "mav0"
    edit(IMU, lambda lines: [*lines[:7], lines[6], lines[8], lines[7], *lines[9:]])(mav)
    edit(CAMERA, lambda lines: [lines[0], *reversed(lines[1:])])(mav)
    for name in (IMU, CAMERA, TRUTH):
        data = (mav / name).read_bytes()
        rewrite(mav / name, b"\xef\xbb\xbf" + data.replace(b"\n", b"\r\n"))
    assert run(folder, tmp_path / "mended", "--sort") == 0
    for name in ("problem.npz", "truth.npz"):
        assert (tmp_path / "mended" / name).read_bytes() == (tmp_path / "clean" / name).read_bytes()
    report = json.loads((tmp_path / "mended" / "report.json").read_text("utf-8"))
    counts = {name: report[name] for name in ("imu_rows_repeated", "imu_rows_sorted", "image_rows_sorted")}
    assert counts == {"imu_rows_repeated": 1, "imu_rows_sorted": 1, "image_rows_sorted": 30}


def test_a_recording_in_map_coordinates_is_solved_as_at_the_origin(rendered, tmp_path: Path) -> None:
    """Catches digits lost to a far origin: positions of a map projection, a million metres away."""
    origin = np.array([4.5e5, 5.2e6, 4e2])

    def moved(lines: list[str]) -> list[str]:
        rows = [line.split(",") for line in lines[1:]]
        for row in rows:
            row[1:4] = [
                repr(float(value) + float(shift)) for value, shift in zip(row[1:4], origin, strict=True)
            ]
        return [lines[0], *(",".join(row) for row in rows)]

    far = copy_of(rendered.folder, tmp_path / "far")
    edit(TRUTH, moved)(far / "mav0")
    found = {}
    for name, folder in (("near", rendered.folder), ("far", far)):
        assert run(folder, tmp_path / name) == 0
        (problem,) = load_problems(tmp_path / name / "problem.npz")
        state = solve(problem, FreeGauge()).state
        found[name] = state, np.sqrt(np.diagonal(motion_covariance(problem, state, FreeGauge())))
    (near, sigma), (away, far_sigma) = found["near"], found["far"]
    assert len(near.X_W) == len(away.X_W)
    assert np.abs(away.p_W - near.p_W).max() < 1e-6  # both count from the first keyframe
    assert np.abs(away.R_WB - near.R_WB).max() < 1e-6
    assert far_sigma == pytest.approx(sigma, rel=1e-5)
