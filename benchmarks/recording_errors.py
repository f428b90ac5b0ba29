"""How far `vigauge estimate` is from the truth in EuRoC's windows, beside the same with the truth's biases.

EUROC_ROOT=... python -m benchmarks.recording_errors OUTPUT.csv

The windows are those of `windows.euroc` in config/config.yaml that are not refused. First poses are joined. A
bias is the mean over the keyframes; its error is the length of the vector, in sigmas the RMS over the axes.
Seconds are processor time of the whole command. docs/recording_errors.csv is the record.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import yaml

import vigauge as vg
from vigauge.files import write_rows
from vigauge.recordings.asl.ground_truth import read_ground_truth
from vigauge.recordings.asl.sequence import read_frames, read_sequence
from vigauge.recordings.asl.truth_steps import find_steps, without_steps
from vigauge.recordings.estimation.estimate import front_end_settings
from vigauge.recordings.estimation.windows import part_of
from vigauge.recordings.frontend.build import build_problem
from vigauge_paper.workflow.sequences import Sequences

CONFIG = Path(__file__).parents[1] / "config" / "config.yaml"
REFUSED = 2
# Of the summary: an error and its factor to the unit of the column, its sigma and the same factor.
ERRORS = (
    ("p", "mm", "p_rmse_m", 1e3, "position_m", 1e3),
    ("phi", "deg", "phi_rmse_deg", 1.0, "rotation_rad", float(np.degrees(1.0))),
    ("v", "mmps", "v_rmse_mps", 1e3, "velocity_mps", 1e3),
)


def commanded(folder: Path, start_s: float, end_s: float) -> tuple[dict[str, Any], float]:
    """What the command says of a window, nothing where it refuses; and its seconds."""
    with TemporaryDirectory() as scratch:
        out = Path(scratch, "out")
        flags = ["--start", f"{start_s:.3f}", "--end", f"{end_s:.3f}", "--out", str(out)]
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run([sys.executable, "-m", "vigauge.cli", "estimate", folder, *flags], check=False)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        found = json.loads((out / "summary.json").read_text("utf-8")) if done.returncode < REFUSED else {}
    return found, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def with_known_biases(folder: Path, truth_folder: Path, found: dict[str, Any]) -> vg.TrajectoryErrors:
    """Errors by the same front-end at the same noise, with biases taken from the truth."""
    sequence, truth = read_sequence(folder), read_ground_truth(truth_folder)
    part, noise = part_of(sequence, *found["window_s"]), found["noise"]
    settings = front_end_settings(sequence, part, found["tracker"], found["keyframes"])
    problem, t_ns, _ = build_problem(sequence, truth, replace(settings, biases="per_interval"))
    solution = vg.solve(problem.with_noise(noise["sigma_px"], noise["density_factor"]), vg.FreeGauge())
    true = without_steps(truth, find_steps(truth, sequence.imu)).states_at(t_ns)
    return vg.trajectory_errors(solution.state, true)


def rows(sequences: Sequences) -> Iterator[dict[str, object]]:
    """A row for each window."""
    for name in sequences.windows:
        folder, truth = Path(sequences.folder(name)), Path(sequences.truth(name))
        start_s, end_s, origin_ns = sequences.window(name)
        later_s = (int(read_frames(folder / "mav0").t_ns[0]) - origin_ns) * 1e-9 if origin_ns else 0.0
        found, seconds = commanded(folder, max(start_s - later_s, 0.0), end_s - later_s)
        if not found:
            continue
        known = with_known_biases(folder, Path(sequences.biases(name)), found)
        (errors,) = (one for one in found["truth"] if one["name"] == truth.name)
        row: dict[str, object] = {"window": name, "truth": truth.name}
        row |= {key: found[key] for key in ("tracker", "keyframes")}
        for kind, unit, key, scale, sigma_key, sigma_scale in ERRORS:
            value, other = scale * errors[key], scale * getattr(known, key)
            row |= {f"{kind}_rmse_{unit}": value, f"{kind}_rmse_known_biases_{unit}": other}
            row[f"{kind}_ratio"] = value / other
            row[f"{kind}_in_sigmas"] = value / (sigma_scale * found["sigma_rms"][sigma_key])
        for kind, unit in (("gyro", "radps"), ("accel", "mps2")):
            error = np.array(errors[f"{kind}_bias_error_{unit}"])
            sigma = np.array(found["biases"][f"{kind}_sigma_{unit}"])
            row[f"{kind}_bias_error_{unit}"] = float(np.linalg.norm(error))
            row[f"{kind}_bias_in_sigmas"] = float(np.sqrt(np.mean((error / sigma) ** 2)))
        row |= {"sigma_px": found["noise"]["sigma_px"], "density_factor": found["noise"]["density_factor"]}
        row["seconds"] = seconds
        yield {key: f"{value:.3g}" if isinstance(value, float) else value for key, value in row.items()}


if __name__ == "__main__":
    config = yaml.safe_load(CONFIG.read_text("utf-8"))
    write_rows(sys.argv[1], list(rows(Sequences.of(config, os.environ["EUROC_ROOT"]))))
