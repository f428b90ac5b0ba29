"""The whole front-end: on a rendered sequence against exact truth, and on EuRoC where it is."""

import json
import os
import shutil
import subprocess
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import vigauge as vg
from vigauge.errors import DataError
from vigauge.gauge.gauges import FixedGauge, FreeGauge
from vigauge.geometry import so3
from vigauge.geometry.camera import FIELD_DEG, distort_pixels
from vigauge.model.archive import load_problems, load_states, save_problems
from vigauge.model.evaluation import TrajectoryErrors, align_first_pose, trajectory_errors
from vigauge.model.problem import Problem
from vigauge.model.state import State
from vigauge.recordings.asl.ground_truth import GroundTruth, read_ground_truth
from vigauge.recordings.asl.sequence import read_sequence
from vigauge.recordings.frontend.build import build_problem
from vigauge.recordings.frontend.report import FrontEndReport
from vigauge.recordings.frontend.settings import FrontEndSettings
from vigauge.solver.levenberg_marquardt import Solution, solve
from vigauge.solver.residuals import inertial_residual, visual_residual
from vigauge_paper.commands.front_end import _true_state
from vigauge_paper.stand_in.asl_folder import write_asl_folder
from vigauge_paper.stand_in.rendering import RenderSettings, render_sequence
from vigauge_paper.stand_in.scene import point_at_pixel

FLOW = {"tracker": "optical_flow", "keyframes": {"count": 7}, "optical_flow": {"corners": 250}}
DESCRIPTORS = {"tracker": "descriptors", "keyframes": {"count": 6}, "descriptors": {"features": 600}}
TRACKERS = {"optical_flow": FLOW, "descriptors": DESCRIPTORS}


@dataclass(frozen=True)
class Run:
    """What the front-end made of a sequence, and the truth at its keyframes."""

    problem: Problem
    t_ns: np.ndarray
    report: FrontEndReport
    truth: State


def truth_state(truth: GroundTruth, t_ns: np.ndarray) -> State:
    row = truth.nearest(t_ns)
    assert truth.v_W is not None
    return State.start(truth.p_W[row], truth.R_WB[row], truth.v_W[row], np.zeros((0, 3)))


def run_front_end(sequence, truth: GroundTruth, mapping: dict[str, Any]) -> Run:
    problem, t_ns, report = build_problem(sequence, truth, FrontEndSettings.from_mapping(mapping))
    return Run(problem, t_ns, report, truth_state(truth, t_ns))


@pytest.fixture(scope="module", params=sorted(TRACKERS))
def run(request: pytest.FixtureRequest, rendered) -> Run:
    return run_front_end(rendered.sequence, rendered.truth, TRACKERS[request.param])


def test_start_is_near_the_truth_and_solving_brings_it_nearer(run: Run) -> None:
    """Any frame, sign or unit wrong anywhere in the front-end; or a "start" that is not one."""
    problem = run.problem.with_noise(0.3, 1.0)
    start = trajectory_errors(problem.initial, run.truth)
    assert start.p_rmse_m < 0.03 and start.phi_rmse_deg < 0.5 and start.v_rmse_mps < 0.1
    solution = solve(problem, FreeGauge())
    assert solution.converged
    end = trajectory_errors(solution.state, run.truth)
    assert end.p_rmse_m < 0.006 and end.phi_rmse_deg < 0.1 and end.v_rmse_mps < 0.02
    assert end.p_rmse_m < start.p_rmse_m


@pytest.mark.parametrize("tracker", sorted(TRACKERS))
def test_fisheye_is_as_good(tracker: str, fisheye_folder: Path) -> None:
    """A step that takes pixels of a fisheye for those of another lens, or that drops all but its middle."""
    sequence = read_sequence(fisheye_folder)
    truth = read_ground_truth(fisheye_folder / "mav0" / "state_groundtruth_estimate0")
    run = run_front_end(sequence, truth, TRACKERS[tracker])
    test_start_is_near_the_truth_and_solving_brings_it_nearer(run)
    problem = run.problem.with_noise(0.3, 1.0)
    rays = (problem.obs_uv - [254.0, 256.0]) / 190.7
    angle = np.degrees(np.arctan(np.linalg.norm(rays, axis=1)))
    assert np.mean(angle > 45.0) > 0.2 and FIELD_DEG - 5.0 < angle.max() < FIELD_DEG + 0.5
    assert problem.obs_noise is not None
    # Errors in measured pixels do not grow with the angle; on the ideal plane they are four times as long.
    error = np.linalg.norm(visual_residual(problem, solve(problem, FreeGauge()).state), axis=1)
    assert np.median(error[angle > 50.0]) < 2.0 * np.median(error[angle < 30.0])
    assert run.report.tracking_lost["outside the field"] > 0


def without_second_camera(folder: Path, target: Path) -> Path:
    """The recording of a folder as one camera would have made it."""
    shutil.copytree(folder, target, copy_function=os.link)
    shutil.rmtree(target / "mav0" / "cam1")
    return target


@pytest.mark.parametrize("biases", ["aligned", "constant"])
def test_one_camera_gets_its_scale_from_the_inertial_sensor(
    biases: str, fisheye_folder: Path, tmp_path: Path
) -> None:
    """A map in units of its own taken for metres, a lever between camera and body that is scaled too, or
    a sigma of the scale that means nothing."""
    sequence = read_sequence(without_second_camera(fisheye_folder, tmp_path / "one"))
    assert len(sequence.cameras) == 1
    truth = read_ground_truth(fisheye_folder / "mav0" / "state_groundtruth_estimate0")
    run = run_front_end(sequence, truth, {**FLOW, "keyframes": {"count": 10}, "biases": biases})
    assert set(run.problem.obs_camera.tolist()) == {0} and run.report.stereo_tried == 0
    sigma = run.report.aligned["scale_sigma"]

    def size(p_W: np.ndarray) -> float:
        return float(np.linalg.norm(p_W - p_W.mean(axis=0)))

    ratio = size(run.problem.initial.p_W) / size(run.truth.p_W)
    assert 0.0 < sigma < 0.05 and abs(ratio - 1.0) < 3.0 * sigma + 0.005
    end = trajectory_errors(solve(run.problem.with_noise(0.3, 1.0), FreeGauge()).state, run.truth)
    assert end.p_rmse_m < 0.02 and end.phi_rmse_deg < (0.5 if biases == "aligned" else 0.1)


@pytest.mark.slow
def test_lenses_are_equally_accurate(tmp_path: Path) -> None:
    """A bias of one lens that single flights do not show: ratio of errors over eight flights."""
    ratios = []
    for seed in range(8):
        errors = []
        for lens in ("equidistant", "radial-tangential"):
            settings = RenderSettings(
                seed=seed, duration_s=1.5, frame_spacing_min_s=0.25, frame_spacing_max_s=0.25, lens=lens
            )
            folder = tmp_path / f"{lens}_{seed}"
            write_asl_folder(render_sequence("room", settings), "room", folder, versions={})
            truth = read_ground_truth(folder / "mav0" / "state_groundtruth_estimate0")
            run = run_front_end(read_sequence(folder), truth, DESCRIPTORS)
            state = solve(run.problem.with_noise(0.3, 1.0), FreeGauge()).state
            found = trajectory_errors(state, run.truth)
            errors.append((found.p_rmse_m, found.phi_rmse_deg, found.v_rmse_mps))
        ratios.append(np.log(np.divide(*errors)))
    mean, deviation = np.mean(ratios, axis=0), np.std(ratios, axis=0, ddof=1) / np.sqrt(len(ratios))
    # 2.36: 95 % of Student's distribution with seven degrees of freedom.
    assert np.all(np.abs(mean) < 2.36 * deviation), np.exp([mean - deviation, mean, mean + deviation])


def test_landmarks_lie_where_the_scene_has_them(run: Run, rendered) -> None:
    """Landmarks bent by wrong matches, which a small reprojection error can hide."""
    state = align_first_pose(solve(run.problem.with_noise(0.3, 1.0), FreeGauge()).state, run.truth)
    problem = run.problem
    first = np.searchsorted(problem.obs_landmark, np.arange(state.n_landmarks))
    error = np.full(state.n_landmarks, np.nan)
    depth = np.full(state.n_landmarks, np.nan)
    exact = rendered.exact
    for keyframe in range(state.n_keyframes):
        for index, camera in enumerate(problem.cameras):
            k = np.flatnonzero(
                (problem.obs_keyframe[first] == keyframe) & (problem.obs_camera[first] == index)
            )
            if len(k) == 0:
                continue
            R_WB, p_W = exact.pose(int(run.t_ns[keyframe]))
            raw = distort_pixels(camera, problem.obs_uv[first[k]])
            X_W, depth[k], _ = point_at_pixel(exact.scene, camera, R_WB, p_W, raw)
            error[k] = np.linalg.norm(state.X_W[k] - X_W, axis=1)
    assert np.all(np.isfinite(error))
    # 0.3 px at the least parallax of 2 degrees are 2 % of the depth.
    assert np.median(error / depth) < 0.02
    # What is left are corners between near and far: which of the two a pixel shows is a matter of luck.
    assert np.mean(error / depth < 0.1) > 0.95


def test_gravity_is_down_and_the_first_keyframe_at_the_origin(run: Run) -> None:
    """A world frame upside down still gives small reprojection errors."""
    tilt = np.arccos((run.problem.initial.R_WB[0] @ run.truth.R_WB[0].T)[2, 2])
    assert np.degrees(tilt) < 0.5
    assert run.report.free_gravity_mps2 == pytest.approx(9.81, abs=0.1)
    np.testing.assert_array_equal(run.problem.initial.p_W[0], 0.0)


def test_problem_has_both_cameras_and_landmarks_of_two_keyframes(run: Run) -> None:
    """Right observations lost on the way, or landmarks that one keyframe alone holds."""
    problem, report = run.problem, run.report
    assert problem.initial.n_landmarks > 60
    assert 0.2 < np.mean(problem.obs_camera) < 0.6
    pairs = np.unique(np.column_stack([problem.obs_landmark, problem.obs_keyframe]), axis=0)
    assert np.bincount(pairs[:, 0]).min() >= 2
    once = np.column_stack([problem.obs_landmark, problem.obs_keyframe, problem.obs_camera])
    assert len(np.unique(once, axis=0)) == len(once)
    assert (problem.sigma_px, problem.gravity) == (1.0, 9.81)
    assert report.landmarks == problem.initial.n_landmarks
    assert report.observations == len(problem.obs_uv)


def test_report_adds_up_and_is_plain(run: Run) -> None:
    """Counts that do not account for every track, or numbers that JSON cannot hold."""
    report = run.report
    refused = sum(report.triangulation_rejected.values())
    assert report.tracks == refused + report.landmarks + report.outlier_landmarks
    assert sum(report.tracks_per_keyframe) + report.observations_right == report.observations
    assert 0 < report.stereo_matched < report.stereo_tried
    assert all(i <= t for i, t in zip(report.pnp_inliers, report.pnp_tried, strict=True))
    assert max(report.median_reprojection_end_px, report.median_reprojection_start_px) < 1.0
    assert json.loads(json.dumps(report.to_mapping(), allow_nan=False)) == report.to_mapping()


def test_truth_gives_biases_only_and_same_input_gives_same_bytes(run: Run, rendered, tmp_path: Path) -> None:
    """Poses or velocities of the truth leaking into the start; a thread or a seed that changes results."""
    rng = np.random.default_rng(0)
    n = len(rendered.truth.t_ns)
    scrambled = replace(
        rendered.truth,
        p_W=rng.standard_normal((n, 3)),
        R_WB=so3.exp(rng.standard_normal((n, 3))),
        v_W=rng.standard_normal((n, 3)),
    )
    again, t_ns, _ = build_problem(
        rendered.sequence, scrambled, FrontEndSettings.from_mapping(TRACKERS[run.report.tracker])
    )
    np.testing.assert_array_equal(t_ns, run.t_ns)
    for name, problem in (("a", run.problem), ("b", again)):
        save_problems(tmp_path / f"{name}.npz", [problem])
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


def test_constant_biases_are_another_problem(rendered) -> None:
    """A setting that is read and not used."""
    known = {m: FrontEndSettings.from_mapping(FLOW | {"biases": m}) for m in ("constant", "per_interval")}
    gyro = rendered.truth.gyro_bias + np.linspace(0.0, 0.01, len(rendered.truth.t_ns))[:, None]
    drifting = replace(rendered.truth, gyro_bias=gyro)
    problems = {m: build_problem(rendered.sequence, drifting, s)[0] for m, s in known.items()}
    assert not np.allclose(problems["constant"].inertial.dR, problems["per_interval"].inertial.dR, atol=1e-5)


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"keyframes": {"count": 40}}, "window"),
        ({"pose": {"inliers": 5000}}, "map must agree"),
        ({"largest_imu_gap_s": 0.001}, "gap"),
        ({"triangulation": {"parallax_deg": 80.0}}, "landmark must pass"),
    ],
)
def test_what_cannot_be_used_is_one_clear_error(rendered, change: dict[str, Any], word: str) -> None:
    """A numpy error from the depth of the pipeline instead of what is wrong with the input."""
    with pytest.raises(DataError, match=word):
        build_problem(rendered.sequence, rendered.truth, FrontEndSettings.from_mapping(FLOW | change))


@pytest.fixture(scope="module")
def aligned(rendered) -> Run:
    settings = FrontEndSettings.from_mapping(FLOW | {"biases": "aligned"})
    problem, t_ns, report = build_problem(rendered.sequence, None, settings)
    return Run(problem, t_ns, report, truth_state(rendered.truth, t_ns))


def test_without_truth_biases_are_found_and_the_problem_is_nearly_the_same(aligned: Run, rendered) -> None:
    """Biases of the wrong sign or body axis, or found and then not taken off."""
    found, truth = aligned.report.aligned, rendered.truth
    for name, true in (("gyro_bias", truth.gyro_bias[0]), ("accel_bias", truth.accel_bias[0])):
        units = "radps" if name == "gyro_bias" else "mps2"
        error = np.array(found[f"{name}_{units}"]) - true
        assert np.abs(error / found[f"{name}_sigma_{units}"]).max() < 4.0
    problem = aligned.problem.with_noise(0.3, 1.0)
    start = trajectory_errors(problem.initial, aligned.truth)
    assert start.p_rmse_m < 0.03 and start.phi_rmse_deg < 1.0 and start.v_rmse_mps < 0.2
    end = trajectory_errors(solve(problem, FreeGauge()).state, aligned.truth)
    assert end.p_rmse_m < 0.012 and end.phi_rmse_deg < 0.5 and end.v_rmse_mps < 0.1


def test_aligned_biases_take_nothing_from_a_truth_that_is_there(aligned: Run, rendered) -> None:
    """A truth that leaks into a result which says that it used none."""
    settings = FrontEndSettings.from_mapping(FLOW | {"biases": "aligned"})
    wrong = replace(rendered.truth, gyro_bias=1.0 + rendered.truth.gyro_bias)
    again, _, report = build_problem(rendered.sequence, wrong, settings)
    assert report == aligned.report
    np.testing.assert_array_equal(again.inertial.dv, aligned.problem.inertial.dv)


def test_biases_that_the_problem_estimates_come_near_the_truth(
    aligned: Run, rendered, tmp_path: Path
) -> None:
    """A bias that the factors hold, a prior that counts the data twice, outlier rounds that lose it."""
    settings = FrontEndSettings.from_mapping(FLOW | {"biases": "estimated"})
    problem, _, _ = build_problem(rendered.sequence, None, settings)
    save_problems(tmp_path / "p.npz", [problem])
    (problem,) = load_problems(tmp_path / "p.npz")
    estimate = solve(problem.with_noise(0.3, 1.0), FreeGauge()).state
    assert np.abs(estimate.gyro_bias.mean(0) - rendered.truth.gyro_bias[0]).max() < 2e-3
    assert np.abs(estimate.accel_bias.mean(0) - rendered.truth.accel_bias[0]).max() < 0.1
    errors = trajectory_errors(estimate, aligned.truth)
    assert errors.p_rmse_m < 0.006 and errors.phi_rmse_deg < 0.5


def test_known_biases_without_truth_are_refused(rendered) -> None:
    """Biases of zero where nobody said that they are."""
    with pytest.raises(DataError, match='"aligned"'):
        build_problem(rendered.sequence, None, FrontEndSettings.from_mapping(FLOW))


def stage(
    folder: Path, out: Path, settings: dict[str, Any], **more: Path
) -> subprocess.CompletedProcess[str]:
    truth = folder / "mav0" / "state_groundtruth_estimate0"
    arguments = {
        "sequence": folder,
        "biases": truth,
        "truth": truth,
        "settings": json.dumps(settings),
        "output": out / "problem.npz",
        "truth-output": out / "truth.npz",
        "report": out / "report.json",
        **more,
    }
    flags = [part for name, value in arguments.items() for part in (f"--{name}", str(value))]
    command = [sys.executable, "-m", "vigauge_paper.commands.front_end", *flags]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)


def test_stage_writes_problem_truth_and_report(rendered, tmp_path: Path) -> None:
    """Files that do not fit together, or cannot be read back."""
    done = stage(rendered.folder, tmp_path, FLOW)
    assert done.returncode == 0, done.stderr
    (problem,) = load_problems(tmp_path / "problem.npz")
    truth, published = load_states(tmp_path / "truth.npz")
    report = json.loads((tmp_path / "report.json").read_text("utf-8"))
    assert problem.initial.n_keyframes == truth.n_keyframes == report["keyframes"] == 7
    assert trajectory_errors(problem.initial, truth).p_rmse_m < 0.03
    assert report["truth_steps"] == [] and np.array_equal(truth.p_W, published.p_W)


def test_truth_has_biases_where_they_are_estimated(rendered) -> None:
    """Biases whose errors nobody measures; or a truth of another shape than the estimate."""
    problem, t_ns = vg.example_problem(biases="estimated"), rendered.sequence.frames.t_ns[::5]
    rows = rendered.truth.nearest(t_ns)
    state = _true_state(rendered.truth, t_ns, problem)
    assert np.array_equal(state.gyro_bias, rendered.truth.gyro_bias[rows])
    assert np.array_equal(state.accel_bias, rendered.truth.accel_bias[rows])
    poses = replace(rendered.truth, gyro_bias=None, accel_bias=None)
    assert not _true_state(poses, t_ns, problem).has_biases
    assert not _true_state(rendered.truth, t_ns, vg.example_problem()).has_biases


def test_jump_of_the_truth_is_taken_out_and_reported(rendered, tmp_path: Path) -> None:
    """A start and estimates that are judged against a truth known to be wrong, or one changed in silence."""
    folder = tmp_path / "copy"
    shutil.copytree(rendered.folder, folder)
    file = folder / "mav0" / "state_groundtruth_estimate0" / "data.csv"
    head, *rows = file.read_text("utf-8").splitlines()
    fields = [row.split(",") for row in rows]
    for field in fields[len(fields) // 2 :]:
        field[3] = repr(float(field[3]) + 0.05)
    file.write_text("\n".join([head, *(",".join(field) for field in fields)]) + "\n", "utf-8")
    done = stage(folder, tmp_path, FLOW)
    assert done.returncode == 0, done.stderr
    assert "the truth's position jumps by 50.0 mm" in done.stderr + done.stdout
    (step,) = json.loads((tmp_path / "report.json").read_text("utf-8"))["truth_steps"]
    assert step["shift_m"] == pytest.approx([0.0, 0.0, 0.05], abs=1e-4)
    assert step["t_ns"] == int(fields[len(fields) // 2][0])
    (problem,) = load_problems(tmp_path / "problem.npz")
    truth, published = load_states(tmp_path / "truth.npz")
    assert trajectory_errors(problem.initial, truth).p_rmse_m < 0.03
    assert trajectory_errors(problem.initial, published).p_rmse_m > 0.02
    assert np.abs(published.p_W - truth.p_W).max() == pytest.approx(0.05, abs=1e-4)


@pytest.mark.parametrize("fault", ["no folder", "broken image", "unknown setting"])
def test_stage_refuses_bad_input_in_one_line(fault: str, rendered, tmp_path: Path) -> None:
    """A traceback, an exit status of 0, or half of the output left behind."""
    folder, settings, word = rendered.folder, FLOW, ""
    if fault == "no folder":
        folder, word = tmp_path / "nowhere", "nowhere"
    elif fault == "unknown setting":
        settings, word = FLOW | {"trcker": 1}, "trcker"
    else:
        folder = tmp_path / "copy"
        mav = folder / "mav0"
        mav.mkdir(parents=True)
        for name in ("cam1", "imu0", "state_groundtruth_estimate0"):
            (mav / name).symlink_to(rendered.folder / "mav0" / name)
        (mav / "cam0" / "data").mkdir(parents=True)
        for name in ("data.csv", "sensor.yaml"):
            (mav / "cam0" / name).symlink_to(rendered.folder / "mav0" / "cam0" / name)
        images = sorted((rendered.folder / "mav0" / "cam0" / "data").iterdir())
        for image in images[1:]:
            (mav / "cam0" / "data" / image.name).hardlink_to(image)
        (mav / "cam0" / "data" / images[0].name).write_bytes(images[0].read_bytes()[:5000])
        word = images[0].name
    out = tmp_path / "out"
    done = stage(folder, out, settings)
    assert done.returncode == 2
    assert word in done.stderr and "Traceback" not in done.stderr
    assert not out.exists() or not list(out.iterdir())


@pytest.mark.parametrize(
    ("errors", "settings", "stage_name", "why"),
    [
        ([], FLOW | {"keyframes": {"count": 40}}, "front-end", "DataError: frames: the window"),
        ([{"check": "imu gap", "message": "is long"}], FLOW, "check", "imu gap: is long"),
    ],
)
def test_accepted_refusal_is_a_report_that_says_where_and_why(
    rendered, errors: list, settings: dict[str, Any], stage_name: str, why: str, tmp_path: Path
) -> None:
    """A front-end that runs on what the check refused; an archive that could pass for a problem."""
    check = tmp_path / "check.json"
    check.write_text(json.dumps({"errors": errors}), "utf-8")
    done = stage(rendered.folder, tmp_path, settings, **{"accept-refusal": check})
    assert done.returncode == 0, done.stderr
    report = json.loads((tmp_path / "report.json").read_text("utf-8"))
    assert report["stopped_at"] == stage_name and report["why"].startswith(why)
    with pytest.raises(DataError, match="npz archive"):
        load_problems(tmp_path / "problem.npz")
    misspelt = stage(rendered.folder, tmp_path, FLOW | {"trcker": 1}, **{"accept-refusal": check})
    assert misspelt.returncode == 2 and "trcker" in misspelt.stderr


EUROC: dict[str, dict[str, Any]] = {
    "MH_01_easy": {
        "truth": "state_groundtruth_derived0",
        "front_end": {"tracker": "optical_flow", "keyframes": {"count": 30}},
        "landmarks": 1000,
        "end": TrajectoryErrors(0.02, np.radians(0.25), 0.03),
        "start_p_m": 0.05,
        "chi_square": 4.0,
    },
    "V1_01_easy": {
        "truth": "state_groundtruth_openvins0",
        "front_end": {
            "tracker": "descriptors",
            "keyframes": {"window_start_s": 121.0, "window_end_s": 136.0, "count": 30},
        },
        "landmarks": 3000,
        "end": TrajectoryErrors(0.03, np.radians(0.65), 0.03),
        "start_p_m": 0.06,
        "chi_square": 12.0,
    },
}


@pytest.mark.euroc
@pytest.mark.parametrize("name", sorted(EUROC))
def test_euroc_start_and_optimum(name: str, euroc_root: Path) -> None:
    """Everything that synthetic data cannot show: calibration as published, blur, exposure, real noise."""
    case = EUROC[name]
    folder = euroc_root / name
    truth_folder = folder / "mav0" / case["truth"]
    if not truth_folder.is_dir():
        pytest.skip(f"{truth_folder.name} is not there")
    run = run_front_end(read_sequence(folder), read_ground_truth(truth_folder), case["front_end"])
    assert run.problem.initial.n_landmarks > case["landmarks"]
    assert 9.7 < run.report.free_gravity_mps2 < 9.9
    assert run.report.median_reprojection_end_px < 0.6
    start = trajectory_errors(run.problem.initial, run.truth)
    solutions: dict[str, Solution] = {g.name: solve(run.problem, g) for g in (FreeGauge(), FixedGauge())}
    assert all(solution.converged for solution in solutions.values())
    assert solutions["free"].iterations <= solutions["fix"].iterations <= 12
    state = solutions["free"].state
    end = trajectory_errors(state, run.truth)
    limit = case["end"]
    assert end.p_rmse_m < limit.p_rmse_m
    assert end.phi_rmse_rad < limit.phi_rmse_rad
    assert end.v_rmse_mps < limit.v_rmse_mps
    assert end.p_rmse_m < start.p_rmse_m < case["start_p_m"]
    residual = inertial_residual(run.problem, state)
    assert np.mean(residual**2) < case["chi_square"]


@pytest.mark.euroc
@pytest.mark.parametrize("name", sorted(EUROC))
def test_euroc_without_truth_is_as_good_in_position(name: str, euroc_root: Path) -> None:
    """Real biases, which are large against what the motion tells, and errors that are not white."""
    case = EUROC[name]
    truth_folder = euroc_root / name / "mav0" / case["truth"]
    if not truth_folder.is_dir():
        pytest.skip(f"{truth_folder.name} is not there")
    settings = FrontEndSettings.from_mapping(case["front_end"] | {"biases": "estimated"})
    problem, t_ns, report = build_problem(read_sequence(euroc_root / name), None, settings)
    solution = solve(problem.with_noise(0.5, 4.0), FreeGauge())
    assert solution.converged
    truth = read_ground_truth(truth_folder)
    end = trajectory_errors(solution.state, truth_state(truth, t_ns))
    assert end.p_rmse_m < case["end"].p_rmse_m and end.v_rmse_mps < case["end"].v_rmse_mps
    row = truth.nearest(t_ns)
    found = solution.state.gyro_bias - truth.gyro_bias[row], solution.state.accel_bias - truth.accel_bias[row]
    assert np.abs(found[0].mean(0)).max() < 1.5e-3 and np.abs(found[1].mean(0)).max() < 0.08
    assert report.aligned["remarks"] == []
