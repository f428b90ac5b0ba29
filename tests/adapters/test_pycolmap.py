"""COLMAP's synthetic reconstructions by the adapter, against 18 digits and COLMAP's own."""

import zlib  # noqa: F401  isort: skip
from typing import Any

import numpy as np
import pytest

import vigauge as vg
from benchmarks.long_double import jacobian, pseudo_inverse, turned

pycolmap = pytest.importorskip("pycolmap", reason="needs pycolmap: pip install pycolmap")
from benchmarks.foreign_colmap import of_colmap, two_camera_gauge  # noqa: E402
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


# Places of fx, fy, cx, cy, k1, k2, p1, p2 among a model's parameters; -1 for none.
PLACES = {
    "SIMPLE_PINHOLE": (0, 0, 1, 2, -1, -1, -1, -1),
    "PINHOLE": (0, 1, 2, 3, -1, -1, -1, -1),
    "SIMPLE_RADIAL": (0, 0, 1, 2, 3, -1, -1, -1),
    "RADIAL": (0, 0, 1, 2, 3, 4, -1, -1),
    "OPENCV": (0, 1, 2, 3, 4, 5, 6, 7),
}


class Plain:
    """Pixels as COLMAP's manual defines them, with 18 digits; Ceres' quaternion manifold moves the poses.

    Poses ``R``, ``t`` are those of images or, where a rig has several cameras, of frames.
    """

    def __init__(self, reconstruction: Any) -> None:
        points = [point for _, point in sorted(reconstruction.points3D.items())]
        seen = [(reconstruction.image(e.image_id), k) for k, X in enumerate(points) for e in X.track.elements]
        rigs = any(rig.num_sensors() > 1 for rig in reconstruction.rigs.values())
        at = [image.frame_id if rigs else image.image_id for image, _ in seen]
        keys = sorted(set(at))
        self.pose, self.point = np.array([keys.index(key) for key in at]), np.array([k for _, k in seen])
        T, self.X = np.zeros((len(keys), 3, 4), np.longdouble), np.array([point.xyz for point in points])
        S = np.zeros((len(seen), 3, 4), np.longdouble)
        self.intrinsics = np.zeros((len(seen), 8))
        for k, (image, _) in enumerate(seen):
            rig, sensor, camera = image.frame.rig, image.data_id.sensor_id, image.camera
            first = not rigs or rig.is_ref_sensor(sensor)
            S[k] = np.eye(3, 4) if first else rig.sensor_from_rig(sensor).matrix()
            T[self.pose[k]] = (image.frame.rig_from_world if rigs else image.cam_from_world()).matrix()
            self.intrinsics[k] = np.append(camera.params, 0.0)[[*PLACES[camera.model_name]]]
        self.R, self.t, self.R_S, self.t_S = T[:, :, :3], T[:, :, 3], S[:, :, :3], S[:, :, 3]
        self.n = 6 * len(T) + 3 * len(points)
        theirs = [i.camera.img_from_cam(i.cam_from_world() * points[k].xyz) for i, k in seen]
        mine = self.pixels(np.zeros(self.n)).astype(float)
        np.testing.assert_allclose(mine, np.ravel(theirs), rtol=1e-11)

    def pixels(self, delta: np.ndarray) -> np.ndarray:
        d, dX = np.split(delta, [6 * len(self.R)])
        d, X = d.reshape(-1, 6)[self.pose], self.X + dX.reshape(-1, 3)
        P = np.einsum("mij,mj->mi", turned(2 * d[:, :3]) @ self.R[self.pose], X[self.point])
        P = np.einsum("mij,mj->mi", self.R_S, P + self.t[self.pose] + d[:, 3:]) + self.t_S
        x, y = P[:, 0] / P[:, 2], P[:, 1] / P[:, 2]
        fx, fy, cx, cy, k1, k2, p1, p2 = self.intrinsics.T
        r2 = x * x + y * y
        radial = 1 + k1 * r2 + k2 * r2 * r2
        u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
        v = y * radial + 2 * p2 * x * y + p1 * (r2 + 2 * y * y)
        return np.column_stack([fx * u + cx, fy * v + cy]).ravel()

    def jacobian(self) -> np.ndarray:
        return jacobian(self.pixels, self.n)

    def null_space(self) -> np.ndarray:
        """(n, 7) shifts, turns about the origin and the scale of the world."""
        T = np.zeros((self.n, 7), np.longdouble)
        poses, points = np.split(T, [6 * len(self.R)])
        poses, points = poses.reshape(-1, 6, 7), points.reshape(-1, 3, 7)
        poses[:, 3:, :3], poses[:, :3, 3:6], poses[:, 3:, 6] = -self.R, -0.5 * self.R, self.t
        points[:, :, :3], points[:, :, 6] = np.eye(3), self.X
        points[:, :, 3:6] = np.cross(np.eye(3)[None], self.X[:, None]).swapaxes(1, 2)
        return T


@pytest.mark.parametrize(("model", "small"), [*((model, 400) for model in MODELS), ("OPENCV", 0)])
def test_free_gauge_is_the_dense_pseudo_inverse(
    model: str, small: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Catches a half angle, a side, a distortion's derivative or a column out of place; also eliminated."""
    monkeypatch.setattr("vigauge.adapters.pycolmap._SMALL", small)
    reconstruction = reconstruction_of(model)
    found = covariance(reconstruction, sigma=0.7)
    assert found.open == vg.Similarity().directions
    plain = Plain(reconstruction)
    expected = pseudo_inverse(plain.jacobian() / 0.7, plain.null_space())
    assert_equal(found, expected)
    point, rows = max(reconstruction.points3D), found.layout.points[-1]
    assert vg.relative_frobenius(found.landmarks(keys=[point])[0], expected[np.ix_(rows, rows)]) < 1e-10


def assert_equal(found: vg.EstimateCovariance, expected: np.ndarray) -> None:
    """To ten digits of each pair of sigmas."""
    sigmas = np.sqrt(np.diagonal(expected))
    assert np.abs((found.matrix() - expected) / np.outer(sigmas, sigmas)).max() < 1e-10


RIGS = {"num_rigs": 2, "num_cameras_per_rig": 3, "num_frames_per_rig": 4}


@pytest.mark.parametrize("small", [400, 0])
def test_rigs_are_one_pose_a_frame(small: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Catches images of one frame that move apart, and a scale that known baselines leave open."""
    monkeypatch.setattr("vigauge.adapters.pycolmap._SMALL", small)
    reconstruction = reconstruction_of("SIMPLE_RADIAL", **RIGS)
    found, frames = covariance(reconstruction), sorted(reconstruction.reg_frame_ids())
    assert (list(found.layout.keys), found.measured) == (frames, ("scale",))
    plain = Plain(reconstruction)
    assert_equal(found, pseudo_inverse(plain.jacobian(), plain.null_space()[:, :6]))
    gauge = vg.KeyframeGauge(frames[2])
    np.testing.assert_allclose(found.block(frames[2], frames[2], gauge), 0.0, atol=1e-12)


def test_two_camera_gauge_is_that_of_colmap() -> None:
    """Catches what our own derivatives share with the test's: COLMAP linearises and inverts itself."""
    reconstruction = reconstruction_of("SIMPLE_RADIAL")
    found, expected = covariance(reconstruction), of_colmap(reconstruction)
    gauge, columns = two_camera_gauge(found, reconstruction, expected)
    for key, own in columns.items():
        given = expected.get_cam_cov_from_world(key)
        assert vg.relative_frobenius(found.entries(own, own, gauge), given) < 1e-8
    # COLMAP's covariances of points are those for poses that are known.
    J = Plain(reconstruction).jacobian().astype(float)
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
