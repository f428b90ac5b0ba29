"""COLMAP's synthetic reconstructions by the adapter, against the dense pseudo-inverse and COLMAP's own."""

from __future__ import annotations

import zlib  # noqa: F401  isort: skip
from typing import Any

import numpy as np
import pytest

import vigauge as vg
from support.foreign import half_angles, quaternion_product
from vigauge.geometry import so3

pycolmap = pytest.importorskip("pycolmap", reason="needs pycolmap: pip install pycolmap")
from vigauge.adapters.pycolmap import covariance  # noqa: E402

pytestmark = pytest.mark.oracle

MODELS = {
    "SIMPLE_PINHOLE": [500.0, 320.0, 240.0],
    "PINHOLE": [500.0, 480.0, 320.0, 240.0],
    "SIMPLE_RADIAL": [500.0, 320.0, 240.0, 0.05],
    "RADIAL": [500.0, 320.0, 240.0, 0.05, -0.02],
    "OPENCV": [500.0, 480.0, 320.0, 240.0, 0.05, -0.02, 0.003, -0.002],
}


def reconstruction_of(model: str, **more: Any) -> Any:
    pycolmap.set_random_seed(1)
    options = pycolmap.SyntheticDatasetOptions(
        num_rigs=5,
        num_cameras_per_rig=1,
        num_frames_per_rig=1,
        num_points3D=20,
        num_points2D_without_point3D=0,
    )
    options.camera_width, options.camera_height = 640, 480
    options.camera_model_id = getattr(pycolmap.CameraModelId, model)
    options.camera_params = MODELS.get(model, [500.0, 500.0, 320.0, 240.0, 0.0, 0.0, 0.0, 0.0])
    for name, value in more.items():
        setattr(options, name, value)
    return pycolmap.synthesize_dataset(options)


def jacobian(reconstruction: Any) -> np.ndarray:
    """By differences of COLMAP's own projection, moved by Ceres' quaternion manifold."""
    step, images = 1e-3, [reconstruction.image(k) for k in sorted(reconstruction.reg_image_ids())]
    points = dict(sorted(reconstruction.points3D.items()))
    row, n = {image.image_id: k for k, image in enumerate(images)}, 6 * len(images)
    blocks = []
    for j, point in enumerate(points.values()):
        for element in point.track.elements:
            image = images[row[element.image_id]]
            T = image.cam_from_world().matrix()

            def pixel(delta: np.ndarray, T: np.ndarray = T, X: Any = point.xyz, c: Any = image.camera) -> Any:
                q = quaternion_product(half_angles(delta[:3]), so3.quaternion(T[:, :3]))
                return c.img_from_cam(so3.from_quaternion(q) @ (X + delta[6:]) + T[:, 3] + delta[3:6])

            J = np.zeros((2, n + 3 * len(points)))
            at = [*range(6 * row[element.image_id], 6 * row[element.image_id] + 6)]
            for k, column in enumerate([*at, *range(n + 3 * j, n + 3 * j + 3)]):
                e = step * np.eye(9)[k]
                near, far = pixel(e) - pixel(-e), pixel(2 * e) - pixel(-2 * e)
                J[:, column] = (8.0 * near - far) / (12.0 * step)
            blocks.append(J)
    return np.concatenate(blocks)


@pytest.mark.parametrize(("model", "small"), [*((model, 400) for model in MODELS), ("OPENCV", 0)])
def test_free_gauge_is_the_dense_pseudo_inverse(
    model: str, small: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Catches a half angle, a side, a distortion's derivative or a column out of place; also eliminated."""
    monkeypatch.setattr("vigauge.adapters.pycolmap._SMALL", small)
    reconstruction = reconstruction_of(model)
    found = covariance(reconstruction, sigma=0.7)
    assert found.open == vg.Similarity().directions
    J = jacobian(reconstruction) / 0.7
    _, s, V = np.linalg.svd(J, full_matrices=False)
    half = V[:-7].T / s[:-7]
    assert s[-7] < 1e-6 * s[-8]
    assert vg.relative_frobenius(found.matrix(), half @ half.T) < 1e-8
    point = max(reconstruction.points3D)
    rows = half[found.layout.points[-1]]
    assert vg.relative_frobenius(found.landmarks(keys=[point])[0], rows @ rows.T) < 1e-8


RIGS = {"num_rigs": 2, "num_cameras_per_rig": 3, "num_frames_per_rig": 4}


@pytest.mark.parametrize("small", [400, 0])
def test_rigs_are_one_pose_a_frame(small: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Catches images of one frame that move apart, and a scale that known baselines leave open."""
    monkeypatch.setattr("vigauge.adapters.pycolmap._SMALL", small)
    reconstruction = reconstruction_of("SIMPLE_RADIAL", **RIGS)
    found, step, frames = covariance(reconstruction), 1e-4, sorted(reconstruction.reg_frame_ids())
    assert (list(found.layout.keys), found.measured) == (frames, ("scale",))
    images = sorted(reconstruction.reg_image_ids())
    by_image, n = jacobian(reconstruction), 6 * len(images)
    # By differences of COLMAP's composition: how a frame's increment moves its images.
    J = np.zeros((n, 6 * len(frames)))
    for i, key in enumerate(images):
        image = reconstruction.image(key)
        rig, own = image.frame.rig_from_world, image.cam_from_world()
        on_rig = own * rig.inverse()
        for column in range(6):
            ends = []
            for sign in (1, -1):
                d = sign * step * np.eye(6)[column]
                q = quaternion_product(half_angles(d[:3]), so3.quaternion(rig.rotation.matrix()))
                T = on_rig.matrix()[:, :3] @ np.column_stack(
                    [so3.from_quaternion(q), rig.translation + d[3:]]
                )
                turn = T[:, :3] @ own.rotation.matrix().T
                ends.append([*(0.5 * so3.log(turn)), *(T[:, 3] + on_rig.translation)])
            J[6 * i : 6 * i + 6, 6 * frames.index(image.frame_id) + column] = np.subtract(*ends) / (2 * step)
    whole = np.concatenate([by_image[:, :n] @ J, by_image[:, n:]], axis=1)
    _, s, V = np.linalg.svd(whole, full_matrices=False)
    half = V[:-6].T / s[:-6]
    assert s[-6] < 1e-6 * s[-7]
    assert vg.relative_frobenius(found.matrix(), half @ half.T) < 1e-6
    gauge = vg.KeyframeGauge(frames[2])
    np.testing.assert_allclose(found.block(frames[2], frames[2], gauge), 0.0, atol=1e-12)


def test_two_camera_gauge_is_that_of_colmap() -> None:
    """Catches what our own derivatives share with the test's: COLMAP linearises and inverts itself."""
    reconstruction = reconstruction_of("SIMPLE_RADIAL")
    config = pycolmap.BundleAdjustmentConfig()
    for key in reconstruction.reg_image_ids():
        config.add_image(key)
    for key in reconstruction.cameras:
        config.set_constant_cam_intrinsics(key)
    config.fix_gauge(pycolmap.BundleAdjustmentGauge.TWO_CAMS_FROM_WORLD)
    adjuster = pycolmap.create_default_ceres_bundle_adjuster(
        pycolmap.BundleAdjustmentOptions(), config, reconstruction
    )
    options = pycolmap.BACovarianceOptions(params=pycolmap.BACovarianceOptionsParams.POSES_AND_POINTS)
    options.damping = 0.0
    expected = pycolmap.estimate_ba_covariance(options, reconstruction, adjuster)
    found = covariance(reconstruction)
    ids = sorted(reconstruction.reg_image_ids())
    given = {key: expected.get_cam_cov_from_world(key) for key in ids}
    (first,) = (key for key in ids if given[key] is None)
    (second,) = (key for key in ids if given[key] is not None and len(given[key]) == 5)
    # COLMAP holds the coordinate along which the second camera is farthest, seen from the first.
    poses = [reconstruction.image(key).cam_from_world() for key in (first, second)]
    axis = int(np.argmax(np.abs((poses[0] * poses[1].inverse()).translation)))
    gauge = np.zeros((found.layout.n, 7))
    gauge[found.layout.columns(first), range(6)] = 1.0
    gauge[found.layout.columns(second, "position")[axis], 6] = 1.0
    for key in set(ids) - {first}:
        rest = np.delete(np.arange(6), 3 + axis) if key == second else np.arange(6)
        block = found.block(key, key, gauge)[np.ix_(rest, rest)]
        assert vg.relative_frobenius(block, given[key]) < 1e-8
    # COLMAP's covariances of points are those for poses that are known.
    J = jacobian(reconstruction)
    for key in reconstruction.points3D:
        own = J[:, found.layout.points[found.layout.point_place(key)]]
        assert vg.relative_frobenius(np.linalg.inv(own.T @ own), expected.get_point_cov(key)) < 1e-8


def test_scale_gauge_by_image_ids() -> None:
    reconstruction = reconstruction_of("PINHOLE")
    found = covariance(reconstruction)
    first, second = sorted(reconstruction.reg_image_ids())[:2]
    gauge = (vg.KeyframeGauge(first), vg.Distance(first, second))
    np.testing.assert_allclose(found.block(first, first, gauge), 0.0, atol=1e-12)
    pose = found.relative_pose(first, second, gauge)
    ray = pose.p / np.linalg.norm(pose.p)
    variance = ray @ pose.covariance[:3, :3] @ ray
    assert variance < 1e-9 * np.trace(pose.covariance[:3, :3])


def test_refusals() -> None:
    with pytest.raises(vg.DataError, match=r"image \d+: must have cameras among .*OPENCV_FISHEYE"):
        covariance(reconstruction_of("OPENCV_FISHEYE"))
    reconstruction = reconstruction_of("PINHOLE", **RIGS)
    next(iter(reconstruction.rigs.values())).reset_sensor_from_rig(
        next(iter(next(iter(reconstruction.rigs.values())).non_ref_sensors))
    )
    with pytest.raises(vg.DataError, match=r"image \d+: must know where this camera is on its rig"):
        covariance(reconstruction)
    with pytest.raises(vg.DataError, match=r"must be a pycolmap.Reconstruction \(found 'dict'\)"):
        covariance({})
    with pytest.raises(vg.DataError, match="must have registered images"):
        covariance(pycolmap.Reconstruction())
    with pytest.raises(vg.DataError, match="sigma: must be positive"):
        covariance(pycolmap.Reconstruction(), sigma=0.0)
    reconstruction = reconstruction_of("PINHOLE")
    reconstruction.add_point3D(np.zeros(3), pycolmap.Track(), np.zeros(3, np.uint8))
    with pytest.raises(vg.DataError, match=r", point \d+: points must be seen by two"):
        covariance(reconstruction)
    reconstruction = reconstruction_of("PINHOLE")
    next(iter(reconstruction.points3D.values())).xyz = np.array([0.0, 0.0, 1e4])
    with pytest.raises(vg.DataError, match=r"image \d+: must have its points in front of"):
        covariance(reconstruction)
