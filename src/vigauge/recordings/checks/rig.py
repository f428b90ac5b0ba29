"""The rig: images, baseline, extrinsics, the clocks of camera and inertial sensor, stillness."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ...geometry.camera import Camera
from .findings import Findings
from .inertial import Rest
from .turning import LEAST_TURN_RAD, LEAST_TURNS, GyroRotation, TurnFit, Turns, compare_turns
from .vision import StereoSample

# Rigs of estimators have 5 to 20 cm; anything beyond a millimetre or a metre is another unit.
USUAL_BASELINE_M, POSSIBLE_BASELINE_M = (0.05, 0.2), (0.005, 2.0)
# A calibrated pair has its matches 0.1 to 0.5 px from their epipolar lines; inverted extrinsics, tens.
EPIPOLAR_WARNING_PX, EPIPOLAR_ERROR_PX = 1.0, 5.0
# Below these a tracker has nothing to follow; 8-bit noise alone has a deviation of about 2.
LEAST_FEATURES, LEAST_MATCHES, LEAST_CONTRAST = 60, 20, 8.0
# Ratio of mean brightness; exposures that differ by half are beyond what patches are compared over.
BRIGHTNESS_RATIO = 1.5
CLIPPED_SHARE = 0.35
# Poses by PnP have noise of 1e-3 rad a turn: axes come out within a degree, inverted extrinsics off by tens.
AXES_WARNING_DEG, AXES_ERROR_DEG = 3.0, 10.0
SCALE_WARNING, SCALE_ERROR = 0.05, 0.5
OFFSET_WARNING_S, OFFSET_ERROR_S = 0.003, 0.020
# An offset is only believed where it is this many times its deviation.
_OFFSET_SIGMAS = 3.0
# Images that move by less between frames a fifth of a second apart show a vehicle that stands.
STILL_PX = 1.0
# No bias of a gyroscope is this large, rad/s: a camera that sees no turn then hangs, or units are wrong.
LARGEST_BIAS_RADPS = 0.5
# A part that rests is worth a word from this share on; a single pair that moves may be a wrong pose.
STILL_SHARE, _LEAST_MOVING = 0.2, 2
_DEGREES = 180.0 / np.pi


def check_calibration(cameras: tuple[Camera, ...], out: Findings) -> None:
    """Facts on the cameras and the distance between the two, where there are two."""
    left = cameras[0]
    about: dict[str, object] = {"image_px": [left.width, left.height], "focal_px": [left.fx, left.fy]}
    if len(cameras) == 1:
        out.fact("calibration", lens=left.lens, **about)
        out.skip("stereo", "there is no cam1: the inertial sensor alone has to tell the scale")
        return
    baseline = float(np.linalg.norm(cameras[1].p_BC - cameras[0].p_BC))
    out.fact("calibration", baseline_m=baseline, lens=left.lens, **about)
    if not POSSIBLE_BASELINE_M[0] <= baseline <= POSSIBLE_BASELINE_M[1]:
        out.error(
            "baseline",
            f"the cameras are {baseline:.4g} m apart by their T_BS; {POSSIBLE_BASELINE_M[0]:g} to "
            f"{POSSIBLE_BASELINE_M[1]:g} m are possible: translations must be in metres",
        )
    elif not USUAL_BASELINE_M[0] <= baseline <= USUAL_BASELINE_M[1]:
        out.warn(
            "baseline",
            f"the cameras are {baseline:.4g} m apart by their T_BS; {USUAL_BASELINE_M[0]:g} to "
            f"{USUAL_BASELINE_M[1]:g} m are usual",
        )


def check_frozen(camera: str, frozen_ns: list[int], out: Findings) -> None:
    """Frames of ``camera`` that repeat the one before byte for byte."""
    out.fact(camera, repeated_images=len(frozen_ns))
    if frozen_ns:
        out.error(
            "frozen camera",
            f"{len(frozen_ns)} image(s) of {camera} are the same file as the one before; the first is "
            f"{frozen_ns[0]} ns: choose a window without them",
        )


def check_stereo(sample: StereoSample, explain: Callable[[], str], out: Findings) -> None:
    """Brightness, features, and the stereo calibration against matches made without it.

    ``explain`` says in words what would make a calibration fit that does not, or nothing.
    """
    out.fact(
        "images",
        sampled_frames=sample.frames,
        features=sample.features,
        stereo_matches=sample.matches,
        grey_left=sample.grey_left,
        grey_right=sample.grey_right,
        contrast=sample.contrast,
        clipped_share=sample.clipped,
    )
    out.fact("calibration", epipolar_px=sample.epipolar_px, disparity_px=sample.disparity_px)
    if sample.features < LEAST_FEATURES or sample.contrast < LEAST_CONTRAST:
        out.error(
            "images",
            f"images have {sample.features:.0f} features and a contrast of {sample.contrast:.1f} grey "
            f"levels, {LEAST_FEATURES} and {LEAST_CONTRAST:g} are needed: too dark, too "
            "bright, blurred or covered",
        )
        return
    if sample.clipped > CLIPPED_SHARE:
        out.warn("exposure", f"{100 * sample.clipped:.0f} % of the pixels are black or white")
    if not sample.is_pair:
        return
    if sample.matches < LEAST_MATCHES:
        out.error(
            "stereo",
            f"left and right image share {sample.matches:.0f} features (of {sample.features:.0f}), "
            f"{LEAST_MATCHES} are needed: the cameras do not look at the same place, or their "
            "frames do not belong together",
        )
        return
    if sample.slips:
        t_ns, later = sample.slips[0]
        out.error(
            "stereo",
            f"the images of cam1 belong to other frames: {len(sample.slips)} of {sample.frames} sampled "
            f"frames fit not their own image of cam1 but one {abs(later)} frame(s) "
            f"{'later' if later > 0 else 'earlier'}, first seen at {t_ns} ns: cam1 lost or doubled an image "
            "before that. Stamp its images anew",
        )
        return
    _judge_calibration(sample, explain, out)
    ratio = (sample.grey_left + 1.0) / (sample.grey_right + 1.0)
    if max(ratio, 1.0 / ratio) > BRIGHTNESS_RATIO:
        out.warn(
            "exposure",
            f"the cameras are exposed differently: mean grey {sample.grey_left:.0f} left, "
            f"{sample.grey_right:.0f} right",
        )


def _judge_calibration(sample: StereoSample, explain: Callable[[], str], out: Findings) -> None:
    """Whether matches lie on their epipolar lines and before the cameras, at all frames."""
    if sample.epipolar_px > EPIPOLAR_ERROR_PX:
        out.error(
            "extrinsics",
            f"matches lie {sample.epipolar_px:.1f} px from their epipolar lines (limit "
            f"{EPIPOLAR_ERROR_PX:g}): "
            + (explain() or "T_BS or the intrinsics are not those of these images"),
        )
    elif sample.epipolar_px > EPIPOLAR_WARNING_PX:
        out.warn(
            "extrinsics",
            f"matches lie {sample.epipolar_px:.2f} px from their epipolar lines (limit "
            f"{EPIPOLAR_WARNING_PX:g}): the calibration is not quite that of these images",
        )
    elif sample.disparity_px < 0.0:
        out.error("extrinsics", "matches lie behind the cameras: cam0 and cam1, or their T_BS, are exchanged")
    elif np.any(sample.frame_epipolar_px > EPIPOLAR_WARNING_PX):
        k = int(np.argmax(sample.frame_epipolar_px > EPIPOLAR_WARNING_PX))
        out.warn(
            "stereo",
            f"matches lie {sample.frame_epipolar_px[k]:.1f} px from their epipolar lines at "
            f"{sample.frame_ns[k]} ns, {sample.epipolar_px:.2f} px in the median (limit "
            f"{EPIPOLAR_WARNING_PX:g}): its images were not taken together, or the exposure was long",
        )


def check_motion(
    turns: Turns,
    moved_px: np.ndarray,
    tried: int,
    gyro: GyroRotation,
    rest: Rest,
    origin_ns: int,
    out: Findings,
) -> TurnFit | None:
    """Camera against gyroscope: stillness, units, axes, clocks; the fit, or None where nothing turns.

    ``origin_ns`` is the stamp that windows count from.
    """
    out.fact("camera against gyro", turns_tried=tried, turns_found=len(moved_px))
    if len(moved_px) == 0:
        out.warn("motion", f"no turn of the camera could be measured between {tried} pairs of frames")
        return None
    phi_B = gyro.turned(turns.first_ns, turns.second_ns)
    if _is_still(turns, moved_px, phi_B, rest, origin_ns, out):
        return None
    fit = compare_turns(gyro, turns)
    if fit is None:
        out.skip(
            "camera-IMU clocks and axes",
            f"needs {LEAST_TURNS} turns of {LEAST_TURN_RAD:g} rad, root mean square; "
            f"found {len(moved_px)} of {turns.rms_rad:.2g}",
        )
        return None
    out.fact(
        "camera against gyro",
        offset_ms=1e3 * fit.offset_s,
        offset_sigma_ms=1e3 * fit.offset_sigma_s,
        scale=fit.scale,
        axes_deg=fit.axes_deg,
        residual_deg=float(np.degrees(fit.rms_rad)),
        gyro_bias_radps=fit.gyro_bias,
    )
    if _judge_units_and_axes(fit, turns, out):
        _judge_clocks(fit, out)
    return fit


def _moving_part(moving: NDArray[np.bool_]) -> slice:
    """The longest run of moving pairs of frames."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], moving, [False]])))
    k = int(np.argmax(edges[1::2] - edges[::2])) if len(edges) else 0
    return slice(int(edges[2 * k]), int(edges[2 * k + 1])) if len(edges) else slice(0, 0)


def _is_still(
    turns: Turns, moved_px: np.ndarray, phi_B: np.ndarray, rest: Rest, origin_ns: int, out: Findings
) -> bool:
    """Whether the images stand still all the time, and what that means; else the part that moves."""
    still = moved_px <= STILL_PX
    moved = float(np.median(moved_px))
    rates = np.linalg.norm(phi_B, axis=1) / ((turns.second_ns - turns.first_ns) * 1e-9)
    out.fact("camera against gyro", image_motion_px=moved, gyro_rate_radps=float(np.median(rates)))
    out.fact("camera against gyro", still_share=float(np.mean(still)))
    rate = float(np.median(rates[still])) if np.any(still) else 0.0
    part = _moving_part(~still)
    usable = part.stop - part.start >= _LEAST_MOVING
    if (moved > STILL_PX or usable) and (np.mean(still) < STILL_SHARE or rate <= LARGEST_BIAS_RADPS):
        if np.mean(still) >= STILL_SHARE and usable:
            begin, end = (t - origin_ns for t in (turns.first_ns[part][0], turns.second_ns[part][-1]))
            out.warn(
                "standing still",
                f"nothing moves in {100 * np.mean(still):.0f} % of the pairs of frames. The longest part "
                f"that moves is --window {begin * 1e-9:.2f} {end * 1e-9:.2f}: choose it",
            )
        return False
    if rate > LARGEST_BIAS_RADPS:
        out.error(
            "frozen camera",
            f"images stand still while the gyroscope turns at {rate:.3g} rad/s: the camera hangs, or "
            "the gyroscope is not in rad/s",
        )
    else:
        out.error(
            "standing still",
            f"nothing moves: images by {moved:.2f} px, the inertial sensor rests "
            f"{100 * rest.share:.0f} % of the time. Landmarks get no "
            "parallax but that of the stereo pair; no covariance is given",
        )
    return True


def _judge_units_and_axes(fit: TurnFit, turns: Turns, out: Findings) -> bool:
    """Errors and warnings on scale and axes; False where clocks cannot be judged beside them."""
    if abs(fit.scale - 1.0) > SCALE_ERROR:
        degrees = abs(fit.scale / _DEGREES - 1.0) < 0.2
        hint = "; it looks like deg/s" if degrees else ""
        out.error(
            "gyro units",
            f"the gyroscope turns {fit.scale:.3g} times as far as the camera; it must be in rad/s{hint}",
        )
        return False
    left_over = fit.rms_rad / turns.rms_rad
    if fit.axes_deg > AXES_ERROR_DEG or left_over > 0.5:
        out.error(
            "extrinsics",
            f"the camera turns about axes {fit.axes_deg:.1f} deg from those of the gyroscope "
            f"(limit {AXES_ERROR_DEG:g}; {100 * left_over:.0f} % of its turns are left over): "
            "T_BS must take camera to body coordinates, and distortion_model must be that of the lens",
        )
        return False
    if fit.axes_deg > AXES_WARNING_DEG:
        out.warn(
            "extrinsics",
            f"the camera turns about axes {fit.axes_deg:.1f} deg from those of the gyroscope "
            f"(limit {AXES_WARNING_DEG:g})",
        )
    if abs(fit.scale - 1.0) > SCALE_WARNING:
        out.warn("gyro units", f"the gyroscope turns {fit.scale:.3f} times as far as the camera")
    return True


def _judge_clocks(fit: TurnFit, out: Findings) -> None:
    if _OFFSET_SIGMAS * fit.offset_sigma_s > OFFSET_ERROR_S:
        out.skip(
            "camera-IMU clocks", f"the motion tells the offset to {1e3 * fit.offset_sigma_s:.0f} ms only"
        )
        return
    believed = abs(fit.offset_s) > _OFFSET_SIGMAS * fit.offset_sigma_s
    words = (
        f"the inertial clock is {1e3 * fit.offset_s:+.1f} ms from the camera's "
        f"(deviation {1e3 * fit.offset_sigma_s:.1f})"
    )
    offset_ns = round(fit.offset_s * 1e9)
    remedy = (
        f"set camera_time_offset_ns: {offset_ns} in the front-end settings, or give "
        f"--camera-time-offset-ns {offset_ns}"
    )
    if believed and abs(fit.offset_s) > OFFSET_ERROR_S:
        out.error("clock offset", f"{words}, limit {1e3 * OFFSET_ERROR_S:g}: {remedy}")
    elif believed and abs(fit.offset_s) > OFFSET_WARNING_S:
        out.warn("clock offset", f"{words}, limit {1e3 * OFFSET_WARNING_S:g}: {remedy}")
