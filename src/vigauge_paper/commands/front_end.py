"""Front-end: from an ASL sequence to a problem, the truth at its keyframes, and a report.

Ground truth gives the known biases; the truth that is written serves evaluation only: first without the
steps that the accelerometer rules out, then as published.
"""

import argparse
import json
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vigauge.cli.command import LOG
from vigauge.errors import VigaugeError
from vigauge.files import write_json, write_text
from vigauge.model.archive import save_problems, save_states
from vigauge.model.problem import Problem
from vigauge.model.state import State
from vigauge.recordings.asl.ground_truth import LARGEST_GAP_NS, GroundTruth, read_ground_truth
from vigauge.recordings.asl.sequence import read_sequence
from vigauge.recordings.asl.truth_steps import find_steps, steps_between, without_steps
from vigauge.recordings.frontend.build import build_problem
from vigauge.recordings.frontend.settings import FrontEndSettings
from vigauge_paper.run.artefacts import FILE
from vigauge_paper.run.stage import Stamped, json_argument, parser, run


def work(options: argparse.Namespace) -> None:
    settings = FrontEndSettings.from_mapping(options.settings)
    if not options.accept_refusal:
        _build(options, settings)
    elif refusal := _refusal(options, settings):
        write_json(options.report, refusal)
        for output in (options.output, options.truth_output):
            write_text(output, "")
        LOG.warning("%s: stopped at %s: %s", options.sequence.name, *refusal.values())


def _refusal(options: argparse.Namespace, settings: FrontEndSettings) -> dict[str, str]:
    """Where and why the sequence cannot be used; empty where its problem was built."""
    errors = json.loads(options.accept_refusal.read_text(encoding="utf-8"))["errors"]
    if errors:
        return {"stopped_at": "check", "why": "; ".join(f"{e['check']}: {e['message']}" for e in errors)}
    try:
        _build(options, settings)
    except VigaugeError as error:
        return {"stopped_at": "front-end", "why": f"{type(error).__name__}: {error}"}
    return {}


def _true_state(truth: GroundTruth, t_ns: NDArray[np.int64], problem: Problem) -> State:
    """The truth at the keyframes, with its biases where the problem estimates some and the truth has any."""
    state = truth.states_at(t_ns)
    if not problem.estimates_biases or truth.gyro_bias is None or truth.accel_bias is None:
        return state
    row = truth.nearest(t_ns, LARGEST_GAP_NS)
    return state.with_biases(truth.gyro_bias[row], truth.accel_bias[row])


def _build(options: argparse.Namespace, settings: FrontEndSettings) -> None:
    sequence = read_sequence(options.sequence, sort=options.sort)
    biases = read_ground_truth(options.biases, sort=options.sort)
    same = options.truth == options.biases
    truth = biases if same else read_ground_truth(options.truth, sort=options.sort)
    mended = {
        "imu_rows_repeated": sequence.n_repeated_imu,
        "imu_rows_sorted": sequence.n_unsorted_imu,
        "image_rows_sorted": sequence.frames.n_unsorted,
        "truth_rows_sorted": truth.n_unsorted,
    }
    for what, count in mended.items():
        if count:
            LOG.warning("%s: %s: %d", sequence.name, what.replace("_", " "), count)
    problem, t_ns, report = build_problem(sequence, biases, settings, progress=True)
    steps = find_steps(truth, sequence.imu, settings.gravity_mps2)
    inside = steps_between(steps, int(t_ns[0]), int(t_ns[-1]))
    for step in inside:
        LOG.warning(
            "%s: the truth's position jumps by %.1f mm at %d ns; taken out",
            sequence.name,
            1e3 * step.length_m,
            step.t_ns,
        )
    truths = [_true_state(one, t_ns, problem) for one in (without_steps(truth, steps), truth)]
    save_states(options.truth_output, truths)
    save_problems(options.output, [problem])
    details = report.to_mapping()
    found_steps = [{"t_ns": step.t_ns, "shift_m": step.shift_W.tolist()} for step in inside]
    evaluation = {
        "truth": options.truth.name,
        "biases": settings.biases if settings.biases in ("aligned", "estimated") else options.biases.name,
        **_frame_gaps(sequence.frames.t_ns + settings.camera_time_offset_ns, t_ns),
        "truth_steps": None if steps is None else found_steps,
    }
    write_json(options.report, details | mended | evaluation)
    LOG.info(
        "%s: %d keyframes, %d landmarks, %d observations, median reprojection error %.2f px",
        sequence.name,
        len(t_ns),
        problem.initial.n_landmarks,
        len(problem.obs_uv),
        details["median_reprojection_end_px"],
    )


def _frame_gaps(frames_ns: NDArray[np.int64], t_ns: NDArray[np.int64]) -> dict[str, float]:
    """Frames that were recorded, and how far apart they are between the first keyframe and the last."""
    gaps_s = 1e-9 * np.diff(frames_ns[(frames_ns >= t_ns[0]) & (frames_ns <= t_ns[-1])])
    return {
        "frames_recorded": len(frames_ns),
        "frame_gap_median_s": float(np.median(gaps_s)),
        "frame_gap_max_s": float(gaps_s.max()),
    }


def sources_of(options: argparse.Namespace) -> list[Path]:
    """Tables of the sequence, by which its data are known; images are named in them."""
    mav0 = options.sequence / "mav0"
    tables = {mav0 / sensor / "data.csv" for sensor in ("cam0", "cam1", "imu0")}
    return sorted(tables | {options.biases / "data.csv", options.truth / "data.csv"})


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--sequence", **FILE, help="folder with mav0/ in it")
    arguments.add_argument("--biases", **FILE, help="ground-truth folder of the known biases")
    arguments.add_argument("--truth", **FILE, help="ground-truth folder for evaluation")
    arguments.add_argument("--settings", type=json_argument, required=True, help="front-end settings")
    arguments.add_argument("--sort", action="store_true", help="put rows in order of time, and count them")
    arguments.add_argument(
        "--accept-refusal",
        type=Path,
        metavar="CHECK",
        help="report of the check: where it or the front-end refuses the sequence, the report says why,"
        " and the archives are empty files",
    )
    arguments.add_argument("--output", **FILE, help="output: the problem")
    arguments.add_argument(
        "--truth-output", **FILE, help="output: true states at the keyframes, without steps and as published"
    )
    arguments.add_argument("--report", **FILE, help="output: counts and errors")
    run(work, arguments, Stamped({}, outputs=("output", "truth_output", "report"), sources=sources_of))


if __name__ == "__main__":
    main()
