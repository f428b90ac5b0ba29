"""A stereo-inertial sequence rendered through EuRoC's calibration, or TUM-VI's: the stand-in for images.

For every measured, distorted pixel the ray of sight is known, so an image is a ray-cast and
a texture look-up: distortion is exact, and so is the truth behind each pixel
(:func:`~vigauge_paper.stand_in.scene.point_at_pixel`).
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from vigauge.errors import ConfigError
from vigauge.geometry.camera import RADIAL_TANGENTIAL, Camera, distort, undistort_where
from vigauge.geometry.so3 import Array
from vigauge.model.imu import ImuNoise
from vigauge.synthetic.spline import SplineTrajectory

from .flight import (
    EUROC_BIAS_WALK,
    EUROC_CAMERA_RATE_HZ,
    EUROC_IMU_NOISE,
    EUROC_IMU_RATE_HZ,
    HALL_FLIGHT,
    RIGS,
    ROOM_FLIGHT,
    FlightShape,
    ImuRecord,
    fly,
    record_imu,
)
from .scene import FACES_PER_BOX, Scene, enter_room, hall, meet_box, room
from .texture import N_LEVELS, TextureAtlas, paint

Image = NDArray[np.uint8]

# Stamps must look like a clock's; the value itself means nothing.
START_NS = 1_500_000_000_000_000_000
_IMU_PERIOD_NS = 1_000_000_000 // EUROC_IMU_RATE_HZ
_CAMERA_PERIOD_NS = 1_000_000_000 // EUROC_CAMERA_RATE_HZ
# Slanted surfaces are finer in one direction than the mean that picks the mip level.
_LEVEL_BIAS = -0.25

SCENES: dict[str, tuple[Callable[[], Scene], FlightShape]] = {
    "hall": (hall, HALL_FLIGHT),
    "room": (room, ROOM_FLIGHT),
}


@dataclass(frozen=True)
class RenderSettings:
    """What may be chosen about a rendered sequence."""

    seed: int = 1  # of texture, flight, frame times and noise
    duration_s: float = 8.5  # from the first to (at most) the last frame
    # Spacing is drawn from the multiples of the camera period (0.05 s) in this range; equal values give an
    # even rate.
    frame_spacing_min_s: float = 0.05
    frame_spacing_max_s: float = 0.05
    imu_margin_s: float = 1.0  # inertial data and truth before the first and after the last frame
    gravity_mps2: float = 9.81  # magnitude of gravity
    # Biases at the first inertial sample, body frame.
    gyro_bias_radps: tuple[float, float, float] = (-0.002, 0.021, 0.077)
    accel_bias_mps2: tuple[float, float, float] = (-0.02, 0.13, 0.075)
    bias_random_walk: bool = False  # let the biases wander with EuRoC's random-walk densities
    imu_noise_factor: float = 1.0  # times EuRoC's published white-noise densities
    image_noise_grey: float = 2.0  # standard deviation of a pixel's noise, grey levels of 256
    vignetting: float = 0.2  # share of brightness lost in the corner of the image
    lens: str = RADIAL_TANGENTIAL  # "radial-tangential", EuRoC's, or "equidistant", TUM-VI's fisheye

    def __post_init__(self) -> None:
        """Raises ConfigError for a value that no sequence can be made with."""
        period_s = 1.0 / EUROC_CAMERA_RATE_HZ
        for field, valid, rule in (
            ("seed", self.seed >= 0, "must not be negative"),
            ("duration_s", self.duration_s > 0.0, "must be positive"),
            ("frame_spacing_min_s", self.frame_spacing_min_s >= period_s, f"must be at least {period_s:g}"),
            (
                "frame_spacing_max_s",
                self.frame_spacing_max_s >= self.frame_spacing_min_s,
                "must be at least frame_spacing_min_s",
            ),
            ("imu_margin_s", self.imu_margin_s > 0.0, "must be positive"),
            ("gravity_mps2", self.gravity_mps2 > 0.0, "must be positive"),
            ("imu_noise_factor", self.imu_noise_factor > 0.0, "must be positive"),
            ("image_noise_grey", self.image_noise_grey >= 0.0, "must not be negative"),
            ("vignetting", 0.0 <= self.vignetting < 1.0, "must be in [0, 1)"),
            ("lens", self.lens in RIGS, f"must be one of {', '.join(RIGS)}"),
        ):
            if not valid:
                raise ConfigError("rendered scene", rule, field=field, value=getattr(self, field))


@dataclass(frozen=True)
class RenderedSequence:
    """Everything about a rendered sequence but its pixels, which :meth:`images` makes."""

    # The world and its paint.
    scene: Scene
    atlas: TextureAtlas
    trajectory: SplineTrajectory  # the exact motion; its t = 0 is ``START_NS``
    cameras: tuple[Camera, Camera]  # left and right
    frame_ns: NDArray[np.int64]  # (F,) stamps of the stereo frames
    imu: ImuRecord  # inertial record and its biases
    imu_noise: ImuNoise  # the white-noise densities in it
    settings: RenderSettings  # what it was made from

    def pose(self, t_ns: int) -> tuple[Array, Array]:
        """Exact (R_WB, p_W) at a stamp."""
        t = (t_ns - START_NS) * 1e-9
        return self.trajectory.R_WB(t), self.trajectory.p_W(t)

    def images(self) -> Iterator[tuple[Image, Image]]:
        """Left and right image of each frame in turn; the noise is the same on every call."""
        rng = _generators(self.settings.seed)["pixels"]
        views = [View(camera, self.settings.vignetting) for camera in self.cameras]
        for t_ns in self.frame_ns:
            R_WB, p_W = self.pose(int(t_ns))
            left, right = (
                _expose(view.render(self.scene, self.atlas, R_WB, p_W), self.settings.image_noise_grey, rng)
                for view in views
            )
            yield left, right


def render_sequence(scene_name: str, settings: RenderSettings) -> RenderedSequence:
    """Paint a scene of :data:`SCENES` and fly through it; images are made on demand."""
    make_scene, shape = SCENES[scene_name]
    generators = _generators(settings.seed)
    scene = make_scene()
    frame_ns = _frame_stamps(settings, generators["frames"])
    margin_ns = round(settings.imu_margin_s * EUROC_IMU_RATE_HZ) * _IMU_PERIOD_NS
    imu_ns = np.arange(frame_ns[0] - margin_ns, frame_ns[-1] + margin_ns + 1, _IMU_PERIOD_NS)
    start_s, end_s = ((t - START_NS) * 1e-9 for t in (imu_ns[0], imu_ns[-1]))
    trajectory = fly(shape, start_s, end_s, generators["flight"])
    noise = EUROC_IMU_NOISE.scaled(settings.imu_noise_factor)
    imu = record_imu(
        trajectory,
        imu_ns,
        START_NS,
        settings.gravity_mps2,
        noise,
        (settings.gyro_bias_radps, settings.accel_bias_mps2),
        EUROC_BIAS_WALK if settings.bias_random_walk else None,
        generators["imu"],
    )
    atlas = paint(scene, generators["texture"])
    return RenderedSequence(scene, atlas, trajectory, RIGS[settings.lens](), frame_ns, imu, noise, settings)


def _generators(seed: int) -> dict[str, np.random.Generator]:
    """One independent stream a purpose, so that a change to one leaves the others alone."""
    names = ("texture", "flight", "frames", "imu", "pixels")
    children = np.random.SeedSequence(seed).spawn(len(names))
    return {name: np.random.default_rng(child) for name, child in zip(names, children, strict=True)}


def _frame_stamps(settings: RenderSettings, rng: np.random.Generator) -> NDArray[np.int64]:
    low, high = (
        max(round(spacing * EUROC_CAMERA_RATE_HZ), 1)
        for spacing in (settings.frame_spacing_min_s, settings.frame_spacing_max_s)
    )
    last = int(settings.duration_s * EUROC_CAMERA_RATE_HZ + 1e-6)
    ticks = np.concatenate([[0], np.cumsum(rng.integers(low, high + 1, last // low + 1))])
    return START_NS + ticks[ticks <= last] * np.int64(_CAMERA_PERIOD_NS)


class View:
    """A camera's rays, prepared once: what is needed to render from any pose."""

    def __init__(self, camera: Camera, vignetting: float) -> None:
        self._camera = camera
        rows, columns = np.indices((camera.height, camera.width))
        focal, centre = np.array([camera.fx, camera.fy]), np.array([camera.cx, camera.cy])
        normalised = (np.stack([columns, rows], axis=-1) - centre) / focal
        ideal, seen = undistort_where(normalised, camera.distortion, camera.lens)
        ideal[~seen] = 0.0
        _, jacobian = distort(ideal, camera.distortion, camera.lens)
        rays = np.concatenate([ideal, np.ones(ideal.shape[:2] + (1,))], axis=-1)
        self._rays_C = rays.reshape(-1, 3).T.astype(np.float32)
        # Side of a pixel on the plane at depth 1, the square root of its area.
        area = 1.0 / (camera.fx * camera.fy * np.linalg.det(jacobian))
        self._pixel_size = np.sqrt(area).astype(np.float32)
        radius2 = np.sum((normalised / np.abs(normalised).max(axis=(0, 1))) ** 2, axis=-1) / 2.0
        # Where the lens throws no light the sensor is dark.
        self._gain = np.where(seen, 1.0 - vignetting * radius2, 0.0).astype(np.float32)

    def render(self, scene: Scene, atlas: TextureAtlas, R_WB: Array, p_W: Array) -> NDArray[np.float32]:
        """(height, width) noise-free grey levels, seen from a body at R_WB, p_W (m)."""
        camera = self._camera
        R_WC = R_WB @ camera.R_BC
        origin_W = R_WB @ camera.p_BC + p_W
        rays_W = (R_WC.astype(np.float32) @ self._rays_C).reshape(3, camera.height, camera.width)
        depth, face = enter_room(scene.room, origin_W, rays_W)
        for number, box in enumerate(scene.boxes, start=1):
            window = self._window(box.corners(), R_WC, origin_W)
            if window is not None:
                meet_box(box, number, origin_W, rays_W[(slice(None), *window)], depth[window], face[window])
        return self._look_up(atlas, origin_W, rays_W, depth, face) * self._gain

    def _window(self, corners_W: Array, R_WC: Array, origin_W: Array) -> tuple[slice, slice] | None:
        """Rows and columns that can see the box; None where none can."""
        camera = self._camera
        whole = (slice(0, camera.height), slice(0, camera.width))
        corners_C = (corners_W - origin_W) @ R_WC
        if np.all(corners_C[:, 2] <= 0.0):
            return None
        if np.any(corners_C[:, 2] < 0.1):
            return whole
        # Pinhole bounds of the box against the rays themselves: no distortion to invert.
        low, high = (
            (corners_C[:, :2] / corners_C[:, 2:]).min(axis=0),
            (corners_C[:, :2] / corners_C[:, 2:]).max(axis=0),
        )
        x = self._rays_C[0].reshape(camera.height, camera.width)
        y = self._rays_C[1].reshape(camera.height, camera.width)
        seen = (x > low[0]) & (x < high[0]) & (y > low[1]) & (y < high[1])
        rows, columns = np.flatnonzero(seen.any(axis=1)), np.flatnonzero(seen.any(axis=0))
        if len(rows) == 0:
            return None
        return slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)

    def _look_up(
        self,
        atlas: TextureAtlas,
        origin_W: Array,
        rays_W: NDArray[np.float32],
        depth: NDArray[np.float32],
        face: NDArray[np.int64],
    ) -> NDArray[np.float32]:
        """Texture at the points met, between the two mip levels nearest the pixel's footprint."""
        axis = (face % FACES_PER_BOX) // 2
        x, y, z = (np.float32(origin_W[k]) + depth * rays_W[k] for k in range(3))
        a, b = np.where(axis == 0, y, x), np.where(axis == 2, y, z)
        shift = (atlas.offset - atlas.origin_m / atlas.texel_m[:, None]).astype(np.float32)
        density = (1.0 / atlas.texel_m).astype(np.float32)[face]
        u = a * density + shift[:, 0][face]
        v = b * density + shift[:, 1][face]
        # A pixel of area s^2 at depth 1 covers depth^2 s^2 / |n . ray| of the surface.
        slant = np.abs(np.where(axis == 0, rays_W[0], np.where(axis == 1, rays_W[1], rays_W[2])))
        footprint = depth * self._pixel_size * density / np.sqrt(slant)
        level = np.clip(np.log2(footprint) + np.float32(_LEVEL_BIAS), 0.0, N_LEVELS - 1.001)
        lower = level.astype(np.int64)
        weight = level - lower
        coarse = _sample(atlas, u, v, lower + 1)
        fine = _sample(atlas, u, v, lower)
        return fine + weight * (coarse - fine)


def _sample(
    atlas: TextureAtlas, u: NDArray[np.float32], v: NDArray[np.float32], level: NDArray[np.int64]
) -> NDArray[np.float32]:
    shrink = np.float32(0.5) ** np.arange(N_LEVELS, dtype=np.float32)
    centre = 0.5 * shrink - np.float32(0.5)
    scale = shrink[level]
    map_u = u * scale + (centre + atlas.level_offset[:, 0].astype(np.float32))[level]
    map_v = v * scale + (centre + atlas.level_offset[:, 1].astype(np.float32))[level]
    return cv2.remap(atlas.image, map_u, map_v, cv2.INTER_LINEAR).astype(np.float32)


def _expose(grey: NDArray[np.float32], sigma: float, rng: np.random.Generator) -> Image:
    noise = rng.standard_normal(grey.shape, dtype=np.float32)
    return np.clip(np.rint(grey + np.float32(sigma) * noise), 0.0, 255.0).astype(np.uint8)
