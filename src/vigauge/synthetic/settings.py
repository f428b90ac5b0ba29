"""What a simulated experiment is made of. Every field is a key of the config section ``simulation``."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SimulationSettings:
    """Numbers of Section IV-A and V-B, and what the paper leaves open.

    Units are in the names; ``config/README.md`` gives each one's source.
    """

    duration_s: float
    mean_speed_mps: float
    n_keyframes: int
    n_landmarks: int
    minimum_views: int
    landmark_depth_m: tuple[float, float]
    plane_roughness_m: float
    image_size_px: tuple[int, int]
    field_of_view_deg: float
    sigma_px: float
    imu_rate_hz: float
    gyro_density: float
    accel_density: float
    gyro_bias_radps: tuple[float, float, float]
    accel_bias_mps2: tuple[float, float, float]
    rotation_amplitude_deg: float
    view_follows_path: float
    gravity_mps2: float
    perturb_position_m: float
    perturb_rotation_deg: float
    perturb_velocity_mps: float
    perturb_landmark_m: float
    n_trials: int
    redraw_noise: bool
    seed: int

    @property
    def path_length_m(self) -> float:
        return self.duration_s * self.mean_speed_mps
