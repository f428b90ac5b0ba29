"""What the front-end did, in numbers that can be written as JSON."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class FrontEndReport:
    """Counts and errors of one run of the front-end."""

    # Name of the sequence, and how points were followed.
    sequence: str
    tracker: str
    # In the window, and chosen among them.
    frames: int
    keyframes: int
    tracks: int  # tracks that were followed, before any check
    # In the problem.
    landmarks: int
    observations: int
    observations_right: int  # of them in the right camera
    tracks_per_keyframe: list[int]  # landmarks of the problem that each keyframe sees in the left camera
    # Points searched for in the right image, and found and verified.
    stereo_tried: int
    stereo_matched: int
    tracking_lost: dict[str, int]  # points or matches lost while tracking, by reason
    # Points of the map seen at each keyframe, and those that agree with its pose.
    pnp_tried: list[int]
    pnp_inliers: list[int]
    pnp_refused_observations: int  # observations that PnP refused
    triangulation_rejected: dict[str, int]  # tracks refused by reason, at the start poses
    rejected_share: dict[str, float]  # the same as shares of all tracks
    # Dropped by solving, and rounds of it.
    outlier_observations: int
    outlier_landmarks: int
    outlier_rounds: int
    # Over the observations of the problem, at its start and at the solution of the last outlier round.
    median_reprojection_start_px: float
    median_reprojection_end_px: float
    free_gravity_mps2: float  # length of gravity where the alignment does not force it
    # What the alignment leaves over.
    alignment_rms_position_m: float
    alignment_rms_velocity_mps: float
    image_pairs_without_right: int  # left frames without a right one, in the whole recording
    frames_skipped: dict[str, int]  # frames of the window that were left out, by reason
    # Biases and their sigmas as the alignment tells them (beside known ones, what is left of them); of one
    # camera ``scale``, metres a unit of its map, and ``scale_sigma``, relative; empty where the truth gave
    # the biases of two cameras.
    aligned: dict[str, Any]

    def to_mapping(self) -> dict[str, Any]:
        """Plain numbers, lists and dictionaries."""
        return dataclasses.asdict(self)
