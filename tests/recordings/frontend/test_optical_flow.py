"""Corners and optical flow on images whose motion is known."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from support.stereo_tracks import texture
from vigauge.errors import DataError
from vigauge.geometry import so3
from vigauge.geometry.camera import distort_pixels, undistort_pixels
from vigauge.recordings.frontend.optical_flow import FlowTracker, track_by_flow
from vigauge.recordings.frontend.settings import FlowSettings, StereoSettings
from vigauge.recordings.frontend.stereo import StereoGeometry, raw_pixels
from vigauge.recordings.frontend.tracks import LEFT, RIGHT
from vigauge_paper.stand_in.flight import euroc_cameras

GEOMETRY = StereoGeometry(*euroc_cameras())
FLOW, STEREO = FlowSettings(corners=150, corner_distance_px=25.0), StereoSettings()
SIZE = (752, 480)
WIDE = texture(1, 700, 1100)
STILL = np.eye(3)


def shifted(step: int, by: tuple[float, float] = (3.0, 2.0)) -> np.ndarray:
    """What a camera sees of the texture after ``step`` shifts (px): points move by minus that."""
    A = np.array([[1.0, 0.0, -150.0 - step * by[0]], [0.0, 1.0, -100.0 - step * by[1]]])
    return cv2.warpAffine(WIDE, A, SIZE, flags=cv2.INTER_LINEAR)


def seen_from_a_plane(R_WC: np.ndarray, camera: int, shift_m: float = 0.0) -> np.ndarray:
    """The raw image of a textured plane 3 m ahead, through one camera's distortion (rows vectorised)."""
    source = (GEOMETRY.left, GEOMETRY.right)[camera]
    columns, rows = np.meshgrid(np.arange(752.0), np.arange(480.0))
    ideal = undistort_pixels(source, np.stack([columns, rows], axis=-1).reshape(-1, 2))
    rays_C = np.column_stack([ideal, np.ones(len(ideal))]) @ np.linalg.inv(source.K).T
    # Both cameras in the frame of the left one.
    R_LC = np.eye(3) if camera == LEFT else GEOMETRY.R_RL.T
    centre = np.zeros(3) if camera == LEFT else -GEOMETRY.R_RL.T @ GEOMETRY.p_RL
    rays = rays_C @ (R_WC @ R_LC).T
    origin = R_WC @ centre + [shift_m, 0.0, 0.0]
    on_plane = origin[:2] + rays[:, :2] * ((3.0 - origin[2]) / rays[:, 2])[:, None]
    place = (on_plane * 150.0 + [550.0, 350.0]).astype(np.float32).reshape(480, 752, 2)
    return cv2.remap(WIDE, place[..., 0], place[..., 1], cv2.INTER_LINEAR)


def test_corners_follow_a_known_shift_to_a_tenth_of_a_pixel() -> None:
    """Drift from frame to frame, or points that swap places when some are lost."""
    tracks, counts = track_by_flow(
        lambda frame, _: shifted(frame),
        range(7),
        np.array([0, 3, 6]),
        np.tile(STILL, (6, 1, 1)),
        GEOMETRY,
        FLOW,
        STEREO,
    )
    places = []
    for keyframe in (0, 2):
        _, track, uv = tracks.seen_at(keyframe, LEFT)
        places.append(dict(zip(track.tolist(), distort_pixels(GEOMETRY.left, uv), strict=True)))
    moved = np.array([places[1][t] - places[0][t] for t in places[1] if t in places[0]])
    assert len(moved) > 100
    np.testing.assert_allclose(np.median(moved, axis=0), [-18.0, -12.0], atol=0.02)
    assert np.mean(np.linalg.norm(moved - [-18.0, -12.0], axis=1) < 0.1) > 0.97
    assert counts.lost["image border"] > 0


def rolled(step: int) -> np.ndarray:
    """What a camera sees of the texture that rolls by a degree a step about the middle of the image."""
    A = cv2.getRotationMatrix2D((526.0, 340.0), 1.0 * step, 1.0)
    A[:, 2] -= [150.0, 100.0]
    return cv2.warpAffine(WIDE, A, SIZE, flags=cv2.INTER_LINEAR)


@pytest.mark.parametrize(("patch", "low", "high"), [("shifted", 0.2, 2.0), ("affine", 0.0, 0.1)])
def test_points_of_a_rolling_camera_do_not_walk_in_affine_patches(
    patch: str, low: float, high: float
) -> None:
    """A patch that is only shifted finds the middle of its texture; over keyframes the point walks away."""
    flow, R_BC = replace(FLOW, patch=patch), GEOMETRY.left.R_BC
    dR_B = R_BC @ so3.exp(np.array([0.0, 0.0, np.radians(1.0)])) @ R_BC.T
    one = StereoGeometry.of(euroc_cameras()[:1])
    frames = np.array([0, 4, 8, 12])
    tracks, _ = track_by_flow(
        lambda frame, _: rolled(frame), range(13), frames, np.tile(dR_B, (12, 1, 1)), one, flow, STEREO
    )
    (_, first, uv_0), (_, last, uv) = tracks.seen_at(0, LEFT), tracks.seen_at(3, LEFT)
    _, here, there = np.intersect1d(first, last, return_indices=True)
    before, after = (distort_pixels(GEOMETRY.left, x) for x in (uv_0[here], uv[there]))
    A = cv2.getRotationMatrix2D((376.0, 240.0), 12.0, 1.0)
    error = np.linalg.norm(after - before @ A[:, :2].T - A[:, 2], axis=1)
    assert len(error) > 60 and low < np.median(error) < high


def test_stereo_matches_of_a_plane_have_its_depth() -> None:
    """Right pixels of the wrong repeat, or left and right undistorted with each other's model."""
    tracker = FlowTracker(GEOMETRY, FLOW, STEREO)
    tracker.advance(tracker.equalised(seen_from_a_plane(STILL, LEFT)), STILL)
    tracker.keyframe(0, tracker.equalised(seen_from_a_plane(STILL, RIGHT)))
    left, right = tracker.observations
    pairs = {int(t): uv for t, uv in zip(right.track, right.uv, strict=True)}
    assert len(pairs) > 100
    uv_left = np.array([uv for t, uv in zip(left.track, left.uv, strict=True) if int(t) in pairs])
    uv_right = np.array(list(pairs.values()))
    R_VL, K_V = GEOMETRY.rectified.R_VC[0], GEOMETRY.rectified.K_V
    baseline = np.linalg.norm(GEOMETRY.left.p_BC - GEOMETRY.right.p_BC)
    rays = np.column_stack([uv_left, np.ones(len(uv_left))]) @ np.linalg.inv(GEOMETRY.left.K).T
    expected = K_V[0, 0] * baseline / (3.0 * (rays @ R_VL[2]))  # depth in the rectified view
    error = GEOMETRY.disparity(uv_left, uv_right) - expected
    assert np.abs(np.median(error)) < 0.05 and np.mean(np.abs(error) < 0.5) > 0.97
    assert tracker.counts.stereo_matched == len(pairs) <= tracker.counts.stereo_tried


def test_gyroscope_guides_through_a_fast_turn() -> None:
    """A turn applied the wrong way round: points further off than without any guess."""
    R_C = so3.exp(np.array([0.0, 0.14, 0.05]))  # about 70 px
    R_BC = GEOMETRY.left.R_BC
    dR_B = R_BC @ R_C @ R_BC.T  # from the second frame to the first
    left = [seen_from_a_plane(R, LEFT) for R in (STILL, R_C)]
    kept = {}
    for name, guess in (("guided", dR_B), ("opposite", dR_B.T)):
        tracker = FlowTracker(GEOMETRY, FLOW, STEREO)
        tracker.advance(left[0], STILL)
        tracker.keyframe(0, seen_from_a_plane(STILL, RIGHT))
        before = dict(zip(tracker.track.tolist(), tracker.points, strict=True))
        tracker.advance(left[1], guess)
        start = np.array([before[t] for t in tracker.track.tolist()]).reshape(-1, 2)
        rays = np.column_stack([undistort_pixels(GEOMETRY.left, start), np.ones(len(start))])
        turned = rays @ np.linalg.inv(GEOMETRY.left.K).T @ R_C @ GEOMETRY.left.K.T
        expected = turned[:, :2] / turned[:, 2:]
        error = np.linalg.norm(undistort_pixels(GEOMETRY.left, tracker.points) - expected, axis=1)
        kept[name] = int(np.count_nonzero(error < 0.5))
    assert kept["guided"] > 80 and kept["guided"] > 3 * kept["opposite"]


def test_exposure_of_the_cameras_does_not_matter() -> None:
    """A right image at half the brightness loses the matches (a documented trait of EuRoC)."""
    tracker = FlowTracker(GEOMETRY, FLOW, STEREO)
    dark = (seen_from_a_plane(STILL, RIGHT) * 0.5).astype(np.uint8)
    tracker.advance(tracker.equalised(seen_from_a_plane(STILL, LEFT)), STILL)
    tracker.keyframe(0, tracker.equalised(dark))
    assert tracker.counts.stereo_matched > 90


def test_blank_images_give_no_tracks_and_no_error() -> None:
    """OpenCV's None for "no corners" taken for an array."""
    tracker = FlowTracker(GEOMETRY, FLOW, STEREO)
    grey = np.full(SIZE[::-1], 100, np.uint8)
    for index in range(2):
        tracker.advance(grey, STILL)
        tracker.keyframe(index, grey)
    assert tracker.n_tracks == 0 and all(len(part.track) == 0 for part in tracker.observations)


def test_frozen_camera_is_refused() -> None:
    """Zero flow with a turning gyroscope: poses that stand still."""
    with pytest.raises(DataError, match="frozen") as caught:
        track_by_flow(
            lambda frame, camera: shifted(min(frame, 2)),
            range(5),
            np.array([0, 4]),
            np.tile(STILL, (4, 1, 1)),
            GEOMETRY,
            FLOW,
            STEREO,
        )
    assert caught.value.row == 3


def test_corners_keep_their_distance() -> None:
    """Corners on top of those that are followed: one point counted as several."""
    tracker = FlowTracker(GEOMETRY, FLOW, STEREO)
    for index in range(3):
        tracker.advance(shifted(4 * index), STILL)
        tracker.keyframe(index, shifted(4 * index + 5))
    gaps = np.linalg.norm(tracker.points[:, None] - tracker.points[None], axis=2)
    gaps[np.diag_indices(len(gaps))] = np.inf
    assert gaps.min() > FLOW.corner_distance_px - 3.0
    assert len(tracker.points) <= FLOW.corners
    assert len(np.unique(tracker.track)) == len(tracker.track)


def test_raw_pixels_are_what_the_tracker_searches_from() -> None:
    """The guess for the right image in ideal instead of raw pixels: tens of pixels off in the corners."""
    corner_V = np.array([[120.0, 90.0]])
    for camera, source in ((LEFT, GEOMETRY.left), (RIGHT, GEOMETRY.right)):
        ideal = GEOMETRY.from_rectified(corner_V, camera)
        raw = raw_pixels(GEOMETRY, corner_V, camera)
        assert np.linalg.norm(raw - ideal) > 10.0
        np.testing.assert_allclose(undistort_pixels(source, raw), ideal, atol=1e-6)
