"""Rendered sequences: exact geometry behind the pixels, consistent inertial data, same seed same bytes."""

import json
import subprocess
import sys
from dataclasses import replace
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.stats import chi2

from vigauge.errors import ConfigError, DataError
from vigauge.geometry import so3
from vigauge.geometry.camera import Camera, distort_pixels, in_field
from vigauge.model.imu import preintegrate
from vigauge.recordings.asl.ground_truth import read_ground_truth
from vigauge.recordings.asl.images import read_image
from vigauge.recordings.asl.sequence import read_sequence
from vigauge_paper.stand_in import rendering
from vigauge_paper.stand_in.asl_folder import write_asl_folder
from vigauge_paper.stand_in.flight import EUROC_BIAS_WALK, EUROC_IMU_NOISE, RIGS, euroc_cameras
from vigauge_paper.stand_in.rendering import START_NS, RenderedSequence, RenderSettings, View, render_sequence
from vigauge_paper.stand_in.scene import point_at_pixel

STEPS = ([3, 0], [-3, 0], [0, 3], [0, -3])
SHORT = RenderSettings(seed=3, duration_s=0.5, frame_spacing_min_s=0.25, frame_spacing_max_s=0.25)


@cache
def short(scene: str = "room", lens: str = "radial-tangential") -> RenderedSequence:
    """Three frames in half a second."""
    return render_sequence(scene, replace(SHORT, lens=lens))


def unpainted(scene: str, settings: RenderSettings) -> RenderedSequence:
    """A sequence whose images are not wanted: painting the hall takes two seconds."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rendering, "paint", lambda *_: None)
        return render_sequence(scene, settings)


@cache
def clean_view(number: int, lens: str = "radial-tangential") -> View:
    return View(RIGS[lens]()[number], vignetting=0.0)


def clean_image(sequence: RenderedSequence, number: int, t_ns: int) -> np.ndarray:
    """Image of a camera without noise and vignetting."""
    view = clean_view(number, sequence.settings.lens)
    return view.render(sequence.scene, sequence.atlas, *sequence.pose(t_ns))


def project(camera: Camera, R_WB: np.ndarray, p_W: np.ndarray, X_W: np.ndarray) -> np.ndarray:
    """Distorted pixels of points, written out here from the definitions."""
    X_C = ((X_W - p_W) @ R_WB - camera.p_BC) @ camera.R_BC
    ideal = X_C[:, :2] / X_C[:, 2:] * [camera.fx, camera.fy] + [camera.cx, camera.cy]
    return np.where(X_C[:, 2:] > 0.1, distort_pixels(camera, ideal), -1.0)


def sample(image: np.ndarray, uv: np.ndarray) -> np.ndarray:
    u, v = uv.T.astype(np.float32)
    return cv2.remap(image, u[:, None], v[:, None], cv2.INTER_CUBIC)[:, 0]


@pytest.mark.parametrize(
    ("scene", "lens"), [("hall", "radial-tangential"), ("room", "radial-tangential"), ("room", "equidistant")]
)
@pytest.mark.parametrize(("other_camera", "other_frame"), [(1, 0), (0, 1)], ids=["right", "later"])
def test_point_behind_a_pixel_has_the_same_texture_in_another_view(scene, lens, other_camera, other_frame):
    """Catches half a pixel, a wrong pose, distortion or extrinsics: the views must agree to 0.03 px."""
    sequence = short(scene, lens)
    t0, t1 = int(sequence.frame_ns[0]), int(sequence.frame_ns[other_frame])
    left, camera = sequence.cameras[0], sequence.cameras[other_camera]
    rng = np.random.default_rng(0)
    size = np.array([left.width, left.height])
    uv = rng.integers(10, size - 10, (20_000, 2)).astype(float)
    uv = uv[np.all([in_field(left, uv + step) for step in STEPS], axis=0)]
    X_W, _, face = point_at_pixel(sequence.scene, left, *sequence.pose(t0), uv)
    seen = project(camera, *sequence.pose(t1), X_W)
    framed = np.all((seen > 5) & (seen < size - 6), axis=1)
    framed &= np.all([in_field(camera, seen + step) for step in STEPS], axis=0)
    uv, X_W, seen, face = uv[framed], X_W[framed], seen[framed], face[framed]
    back, _, face_there = point_at_pixel(sequence.scene, camera, *sequence.pose(t1), seen)
    same = (np.linalg.norm(back - X_W, axis=1) < 1e-6) & (face == face_there)
    assert same.mean() > 0.8  # the rest is hidden there
    # One surface, away from its silhouette: the pixels around see it too.
    for step in STEPS:
        same &= point_at_pixel(sequence.scene, camera, *sequence.pose(t1), seen + step)[2] == face
        same &= point_at_pixel(sequence.scene, left, *sequence.pose(t0), uv + step)[2] == face
    here = sample(clean_image(sequence, 0, t0), uv[same])
    image = clean_image(sequence, other_camera, t1)
    there = sample(image, seen[same])
    assert np.median(np.abs(here - there)) < 2.0
    # Least-squares shift between the two, robust by leaving out the pixels that differ most.
    gradient = np.column_stack(
        [
            0.5 * (sample(image, seen[same] + e) - sample(image, seen[same] - e))
            for e in (np.array([1.0, 0.0]), np.array([0.0, 1.0]))
        ]
    )
    difference = here - there
    keep = np.abs(difference) < 20.0
    shift, *_ = np.linalg.lstsq(gradient[keep], difference[keep])
    assert np.abs(shift).max() < 0.03
    wrong = sample(image, seen[same] + [2.0, 0.0])
    assert np.median(np.abs(here - wrong)) > 2.0 * np.median(np.abs(here - there))


@pytest.mark.parametrize("yaw", [0.0, 1.5, 3.0, -1.6])
def test_leaving_out_boxes_outside_the_window_changes_no_pixel(yaw, monkeypatch):
    """Catches a window that cuts a box off, also where the box is partly behind the camera."""
    sequence = short("room")
    R_WB = so3.yaw_rotation(yaw) @ sequence.pose(START_NS)[0]
    for p_W in (np.array([-0.6, 0.0, 1.5]), np.array([2.0, 2.0, 1.0])):
        quick = clean_view(0).render(sequence.scene, sequence.atlas, R_WB, p_W)
        with monkeypatch.context() as patch:
            patch.setattr(View, "_window", lambda *_: (slice(None), slice(None)))
            thorough = clean_view(0).render(sequence.scene, sequence.atlas, R_WB, p_W)
        assert np.array_equal(quick, thorough)


def test_coarser_camera_sees_the_average_of_the_finer_one(monkeypatch):
    """Catches aliasing and blur: mip levels three finer or two coarser must both be clearly worse."""
    sequence, fine, factor = short("hall"), euroc_cameras()[0], 4
    coarse = replace(
        fine,
        fx=fine.fx / factor,
        fy=fine.fy / factor,
        cx=(fine.cx + 0.5) / factor - 0.5,  # pixel centres have whole coordinates
        cy=(fine.cy + 0.5) / factor - 0.5,
        width=fine.width // factor,
        height=fine.height // factor,
    )
    pose = sequence.pose(START_NS)
    full = clean_view(0).render(sequence.scene, sequence.atlas, *pose)
    averaged = cv2.resize(full, (coarse.width, coarse.height), interpolation=cv2.INTER_AREA)
    view = View(coarse, vignetting=0.0)
    uv = np.indices((coarse.height, coarse.width))[::-1].reshape(2, -1).T
    face = point_at_pixel(sequence.scene, coarse, *pose, uv)[2].reshape(averaged.shape)
    spread = np.ones((3, 3), np.uint8)
    low, high = (change(face.astype(np.uint8), spread) for change in (cv2.erode, cv2.dilate))
    inside = low == high  # silhouettes are one sample a pixel, by design

    def error(more_levels: float) -> float:
        monkeypatch.setattr(rendering, "_LEVEL_BIAS", bias + more_levels)
        image = view.render(sequence.scene, sequence.atlas, *pose)
        return float(np.sqrt(np.mean((image - averaged)[inside] ** 2)))

    bias = rendering._LEVEL_BIAS
    errors = {levels: error(levels) for levels in (-3.0, 0.0, 2.0)}
    assert errors[0.0] < 0.7 * min(errors[-3.0], errors[2.0])


@pytest.mark.parametrize("scene", ["hall", "room"])
def test_images_are_rich_in_features_all_over(scene):
    """Catches a bare wall, which no tracker can follow, and washed-out or clipped grey levels."""
    for image in next(short(scene).images()):
        corners = cv2.FastFeatureDetector_create(threshold=20).detect(image)
        cells, _, _ = np.histogram2d(
            *np.array([k.pt for k in corners]).T, bins=(8, 5), range=((0, 752), (0, 480))
        )
        assert len(corners) > 2000
        assert cells.min() >= 5
        assert len(cv2.SIFT_create(2000).detect(image)) > 1000
        assert 80 < image.mean() < 160 and image.std() > 35
        assert np.mean((image == 0) | (image == 255)) < 0.02


def test_pixel_noise_and_vignetting_have_the_stated_size():
    """Catches variance for deviation, noise shared by the two cameras, and vignetting upside down."""
    sequence = short("room")
    noise = []
    for number, image in enumerate(next(sequence.images())):
        view = View(sequence.cameras[number], SHORT.vignetting)
        exact = view.render(sequence.scene, sequence.atlas, *sequence.pose(START_NS))
        clean = clean_image(sequence, number, START_NS)
        fall = exact / np.maximum(clean, 1.0)
        assert fall[:5, :5].max() < 1.0 - 0.7 * SHORT.vignetting
        assert fall[235:255, 365:375].min() > 0.99
        noise.append(np.where((exact > 12) & (exact < 243), image - exact, 0.0)[::2])
        # Rounding to whole grey levels adds 1/12.
        spread = noise[-1][noise[-1] != 0.0].std()
        assert spread == pytest.approx(np.sqrt(SHORT.image_noise_grey**2 + 1 / 12), rel=0.01)
    assert abs(np.corrcoef(noise[0].ravel(), noise[1].ravel())[0, 1]) < 0.02


@pytest.mark.parametrize("scene", ["hall", "room"])
def test_preintegrated_samples_agree_with_the_exact_motion(scene):
    """Catches biases of the wrong sign, noise of another size, and stamps off by a sample."""
    sequence = unpainted(scene, replace(SHORT, duration_s=8.0))
    imu, motion, g = sequence.imu, sequence.trajectory, sequence.settings.gravity_mps2
    samples = imu.samples.corrected(imu.gyro_bias, imu.accel_bias)
    gravity_W = np.array([0.0, 0.0, -g])
    step_ns = 300_000_000
    total, parts = 0.0, []
    for start in range(START_NS, START_NS + 8_000_000_000 - step_ns, step_ns):
        factor = preintegrate(samples, start, start + step_ns, EUROC_IMU_NOISE)
        a, b = (start - START_NS) * 1e-9, (start + step_ns - START_NS) * 1e-9
        R_a, dt = motion.R_WB(a), b - a
        dp = R_a.T @ (motion.p_W(b) - motion.p_W(a) - motion.v_W(a) * dt - 0.5 * gravity_W * dt**2)
        dv = R_a.T @ (motion.v_W(b) - motion.v_W(a) - gravity_W * dt)
        turn = so3.log(factor.dR.T @ R_a.T @ motion.R_WB(b))
        error = np.concatenate([dp - factor.dp, turn, dv - factor.dv])
        parts.append(error @ np.linalg.solve(factor.covariance, error))
        total += parts[-1]
    low, high = chi2.interval(0.999, 9 * len(parts))
    assert low < total < high


@pytest.mark.parametrize("scene", ["hall", "room"])
def test_flight_is_lively_and_stays_off_the_walls(scene):
    """Catches a flight without excitation, or one that a camera cannot follow, for any seed."""
    for seed in range(5):
        sequence = unpainted(scene, replace(SHORT, seed=seed, duration_s=14.0))
        motion, world = sequence.trajectory, sequence.scene
        t = np.arange(0.0, 14.0, 0.02)
        force, rate = motion.a_W(t), motion.omega_B(t)
        assert 0.8 < np.linalg.norm(force, axis=1).max() < 4.0
        assert 0.4 < np.linalg.norm(rate, axis=1).max() < 1.5
        p_W = motion.p_W(t)
        assert np.ptp(p_W, axis=0).max() > 1.0
        assert np.linalg.norm(motion.rotation(t), axis=1).max() < 2.5
        for box in world.boxes:
            gap = np.maximum(np.maximum(np.array(box.low) - p_W, p_W - np.array(box.high)), 0.0)
            assert np.linalg.norm(gap, axis=1).min() > 0.4
        assert np.all((p_W > np.array(world.room.low) + 0.4) & (p_W < np.array(world.room.high) - 0.4))


def test_truth_columns_are_exact_and_bias_walk_is_recorded():
    """Catches constant biases written for a walk: truth minus samples must leave white noise only."""
    walking = unpainted("room", replace(SHORT, bias_random_walk=True, duration_s=8.0))
    still = unpainted("room", replace(SHORT, duration_s=8.0))
    assert np.ptp(still.imu.gyro_bias, axis=0).max() == 0.0
    assert still.imu.accel_bias[5].tolist() == list(SHORT.accel_bias_mps2)
    n = len(walking.imu.samples.t_ns)
    steps = np.diff(walking.imu.accel_bias, axis=0)
    low, high = chi2.interval(0.9999, steps.size)
    assert low < np.sum((steps / (EUROC_BIAS_WALK.accel_density / np.sqrt(200.0))) ** 2) < high
    t = (walking.imu.samples.t_ns - START_NS) * 1e-9
    white = walking.imu.samples.gyro - walking.imu.gyro_bias - walking.trajectory.omega_B(t)
    low, high = chi2.interval(0.9999, 3 * n)
    assert low < np.sum((white / (EUROC_IMU_NOISE.gyro_density * np.sqrt(200.0))) ** 2) < high


def test_frame_times_keep_to_the_spacing_asked_for():
    """Catches spacing off the camera's clock, and a last frame beyond the duration."""
    even = unpainted("room", replace(SHORT, frame_spacing_min_s=0.05, frame_spacing_max_s=0.05))
    assert np.diff(even.frame_ns).tolist() == [50_000_000] * 10
    sparse = unpainted("room", replace(SHORT, frame_spacing_max_s=0.5, duration_s=14.0))
    gaps = np.diff(sparse.frame_ns)
    assert set(gaps % 50_000_000) == {0}
    assert (gaps.min(), gaps.max()) == (250_000_000, 500_000_000)
    assert sparse.frame_ns[-1] <= START_NS + 14_000_000_000
    assert np.isin(sparse.frame_ns, sparse.imu.samples.t_ns).all()


def contents(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def test_what_is_written_reads_back_and_same_seed_gives_same_bytes(tmp_path):
    """Catches digits lost on the way, pictures under the wrong stamp, and anything unseeded."""
    sequence = short("room")
    write_asl_folder(sequence, "room", tmp_path / "a", {"vigauge": "x"})
    again = render_sequence("room", SHORT)
    write_asl_folder(again, "room", tmp_path / "b", {"vigauge": "x"})
    assert contents(tmp_path / "a") == contents(tmp_path / "b")

    read = read_sequence(tmp_path / "a")
    assert np.array_equal(read.frames.t_ns, sequence.frame_ns)
    assert np.array_equal(read.imu.t_ns, sequence.imu.samples.t_ns)
    assert np.array_equal(read.imu.gyro, sequence.imu.samples.gyro)
    assert np.array_equal(read.imu.accel, sequence.imu.samples.accel)
    walks = {"gyro_walk": EUROC_BIAS_WALK.gyro_density, "accel_walk": EUROC_BIAS_WALK.accel_density}
    assert read.imu_noise == replace(EUROC_IMU_NOISE, **walks)
    for camera, written in zip(read.cameras, sequence.cameras, strict=True):
        same = {"R_BC": np.eye(3), "p_BC": np.zeros(3)}
        assert repr(replace(camera, **same)) == repr(replace(written, **same))
        assert np.abs(camera.T_BC - written.T_BC).max() < 1e-11
    for k, pair in enumerate(sequence.images()):
        assert np.array_equal(read_image(read.frames.left[k], read.cameras[0]), pair[0])
        assert np.array_equal(read_image(read.frames.right[k], read.cameras[1]), pair[1])

    truth = read_ground_truth(tmp_path / "a" / "mav0" / "state_groundtruth_estimate0")
    row = truth.nearest(sequence.frame_ns)
    for k, t_ns in enumerate(sequence.frame_ns):
        R_WB, p_W = sequence.pose(int(t_ns))
        assert np.array_equal(truth.p_W[row[k]], p_W)
        assert np.abs(truth.R_WB[row[k]] - R_WB).max() < 1e-14
    t = (truth.t_ns - START_NS) * 1e-9
    assert truth.v_W is not None and np.array_equal(truth.v_W, sequence.trajectory.v_W(t))
    assert np.array_equal(truth.gyro_bias, sequence.imu.gyro_bias)
    about = json.loads((tmp_path / "a" / "rendered.json").read_text())
    assert about["notice"] == "rendered stand-in, not EuRoC"
    assert (about["scene"], about["settings"]["seed"]) == ("room", SHORT.seed)


def test_another_seed_gives_another_world_flight_and_noise():
    """Catches a seed that reaches only some of the streams."""
    one, two = short("room"), render_sequence("room", replace(SHORT, seed=4))
    assert not np.array_equal(one.atlas.image, two.atlas.image)
    assert not np.allclose(one.pose(START_NS)[1], two.pose(START_NS)[1])
    white = [
        s.imu.samples.gyro - s.trajectory.omega_B((s.imu.samples.t_ns - START_NS) * 1e-9) for s in (one, two)
    ]
    assert abs(np.corrcoef(white[0][:, 0], white[1][:, 0])[0, 1]) < 0.3


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("seed", -1),
        ("duration_s", 0.0),
        ("frame_spacing_min_s", 0.01),
        ("frame_spacing_max_s", 0.2),
        ("imu_margin_s", 0.0),
        ("gravity_mps2", -9.81),
        ("imu_noise_factor", 0.0),
        ("image_noise_grey", -1.0),
        ("vignetting", 1.0),
        ("duration_s", float("nan")),
    ],
)
def test_setting_that_cannot_be_is_named(field, value):
    """Catches a traceback, or a folder that the reader then refuses, where the setting is to blame."""
    with pytest.raises(ConfigError) as caught:
        replace(SHORT, **{field: value})
    assert caught.value.field == field


def run_stage(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "vigauge_paper.commands.render", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=120)


def test_stage_writes_a_sequence_and_refuses_bad_settings(tmp_path):
    """Catches a stage that leaves half a folder, or ends well, when its input is wrong."""
    settings = {"seed": 3, "duration_s": 0.1}
    good = run_stage("--scene", "room", "--output", str(tmp_path / "out"), "--settings", json.dumps(settings))
    assert good.returncode == 0, good.stderr
    assert len(read_sequence(tmp_path / "out" / "rendered_room").frames.t_ns) == 3
    for bad, said in (({"sead": 1}, "sead"), ({"duration_s": -1}, "duration_s")):
        done = run_stage("--scene", "room", "--output", str(tmp_path / "no"), "--settings", json.dumps(bad))
        assert done.returncode == 2
        assert said in done.stderr and "Traceback" not in done.stderr
        assert not (tmp_path / "no").exists()


def test_real_data_are_never_replaced(tmp_path: Path) -> None:
    """A rendering written over a sequence that was recorded."""
    image = tmp_path / "mav0" / "cam0" / "data" / "1.png"
    image.parent.mkdir(parents=True)
    image.write_bytes(b"recorded")
    sequence = render_sequence("room", RenderSettings(duration_s=0.5))
    with pytest.raises(DataError, match="real data are never replaced"):
        write_asl_folder(sequence, "room", tmp_path, {})
    assert image.read_bytes() == b"recorded"
    assert not (tmp_path / "rendered.json").exists()
