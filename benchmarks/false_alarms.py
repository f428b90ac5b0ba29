"""What the checks of a recording say of windows of good recordings: every error here is a false alarm.

EUROC_ROOT=... python -m benchmarks.false_alarms OUTPUT.csv [LENGTH_S [STEP_S]]
"""

from __future__ import annotations

import csv
import os
import sys
from pathlib import Path

import numpy as np

from vigauge.recordings.asl.sequence import read_frames
from vigauge.recordings.checks.sequence import Window, check_sequence

COLUMNS = ("sequence", "window_start", "window_end", "check", "severity", "message")


def main(output: str, length_s: float = 3.0, step_s: float = 1.5) -> None:
    folders = sorted(path.parent for path in Path(os.environ["EUROC_ROOT"]).glob("*/mav0"))
    rows, windows = [], 0
    for folder in folders:
        t_ns = read_frames(folder / "mav0").t_ns
        seconds = (t_ns - t_ns[0]) * 1e-9
        for start in np.arange(0.0, max(seconds[-1] - length_s, 0.0) + step_s, step_s).tolist():
            end = start + length_s
            if np.count_nonzero((seconds >= start) & (seconds <= end)) < 4:
                continue
            windows += 1
            for found in check_sequence(folder, window=Window(0, start, end)).found:
                rows.append((folder.name, start, end, found.check, found.severity, found.message))
    with Path(output).open("w", encoding="utf-8", newline="") as file:
        csv.writer(file).writerows([COLUMNS, *rows])
    print(f"{windows} windows, {sum(row[4] == 'error' for row in rows)} errors, {len(rows)} findings")


if __name__ == "__main__":
    main(sys.argv[1], *map(float, sys.argv[2:]))
