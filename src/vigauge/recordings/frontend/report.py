"""What the front-end did, in numbers that can be written as JSON."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class FrontEndReport:
    """Counts and errors of one run of the front-end.

    Attributes
    ----------
    sequence, tracker : name of the sequence, and how points were followed
    frames, keyframes : in the window, and chosen among them
    tracks : tracks that were followed, before any check
    landmarks, observations : in the problem
    observations_right : of them in the right camera
    tracks_per_keyframe : landmarks of the problem that each keyframe sees in the left camera
    stereo_tried, stereo_matched : points searched for in the right image, and found and verified
    tracking_lost : points or matches lost while tracking, by reason
    pnp_tried, pnp_inliers : points of the map seen at each keyframe, and those that agree with its pose
    pnp_refused_observations : observations that PnP refused
    triangulation_rejected : tracks refused by reason, at the start poses
    rejected_share : the same as shares of all tracks
    outlier_observations, outlier_landmarks, outlier_rounds : dropped by solving, and rounds of it
    median_reprojection_start_px, median_reprojection_end_px : over the observations of the
        problem, at its start and at the solution of the last outlier round
    free_gravity_mps2 : length of gravity where the alignment does not force it
    alignment_rms_position_m, alignment_rms_velocity_mps : what the alignment leaves over
    image_pairs_without_right : left frames without a right one, in the whole recording
    frames_skipped : frames of the window that were left out, by reason
    aligned : biases and their sigmas as the alignment tells them (beside known ones, what is left of them);
        of one camera ``scale``, metres a unit of its map, and ``scale_sigma``, relative; empty where the
        truth gave the biases of two cameras
    """

    sequence: str
    tracker: str
    frames: int
    keyframes: int
    tracks: int
    landmarks: int
    observations: int
    observations_right: int
    tracks_per_keyframe: list[int]
    stereo_tried: int
    stereo_matched: int
    tracking_lost: dict[str, int]
    pnp_tried: list[int]
    pnp_inliers: list[int]
    pnp_refused_observations: int
    triangulation_rejected: dict[str, int]
    rejected_share: dict[str, float]
    outlier_observations: int
    outlier_landmarks: int
    outlier_rounds: int
    median_reprojection_start_px: float
    median_reprojection_end_px: float
    free_gravity_mps2: float
    alignment_rms_position_m: float
    alignment_rms_velocity_mps: float
    image_pairs_without_right: int
    frames_skipped: dict[str, int]
    aligned: dict[str, Any]

    def to_mapping(self) -> dict[str, Any]:
        """Plain numbers, lists and dictionaries."""
        return dataclasses.asdict(self)
