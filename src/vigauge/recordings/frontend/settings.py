"""Settings of the front-end, read from plain mappings and checked: unit and range beside each.

The dataclass fields are the one place where a setting is declared; :func:`settings_schema`
gives the same as a JSON schema.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, field, fields
from typing import Any, TypeVar

from ...errors import ConfigError

T = TypeVar("T")
_SOURCE = "front-end settings"


def _real(unit: str, about: str, low: float, high: float, default: Any = MISSING) -> Any:
    """A number with its unit, meaning and closed range."""
    return field(
        default=default, metadata={"unit": unit, "about": about, "range": (low, high), "kind": float}
    )


def _count(unit: str, about: str, low: int, high: int, default: Any = MISSING) -> Any:
    """A whole number with its unit, meaning and closed range."""
    return field(default=default, metadata={"unit": unit, "about": about, "range": (low, high), "kind": int})


def _choice(about: str, options: tuple[str, ...], default: Any = MISSING) -> Any:
    return field(default=default, metadata={"unit": "", "about": about, "options": options, "kind": str})


def _group(kind: type) -> Any:
    return field(default_factory=kind, metadata={"kind": kind})


@dataclass(frozen=True)
class KeyframeSettings:
    """Which frames become keyframes: a time window, and either a count or a spacing."""

    window_origin_ns: int = _count(
        "ns", "stamp that the window counts from; 0: the first frame", 0, 2**63 - 1, 0
    )
    window_start_s: float = _real("s", "begin of the window, after its origin", 0.0, 1e6, 0.0)
    window_end_s: float = _real("s", "end of the window, after its origin", 0.0, 1e6, 1e6)
    count: int = _count(
        "keyframes", "number of keyframes, spread evenly in time; 0: use spacing_s", 0, 10_000, 30
    )
    spacing_s: float = _real("s", "least time between keyframes; used where count is 0", 0.0, 60.0, 0.0)
    least_contrast: float = _real(
        "grey levels", "least deviation of the pixels of a frame; below, it is skipped", 0.0, 128.0, 8.0
    )
    most_skipped: int = _count(
        "frames", "frames of the window that may be skipped: no right image, or no contrast", 0, 10_000, 5
    )


@dataclass(frozen=True)
class FlowSettings:
    """Corners and pyramidal optical flow, for contiguous stereo."""

    corners: int = _count("corners", "corners that are tracked at a time", 20, 5000, 600)
    corner_distance_px: float = _real("px", "least distance between corners", 2.0, 100.0, 12.0)
    corner_quality: float = _real("1", "least corner response, relative to the best", 1e-5, 0.5, 0.005)
    window_px: int = _count("px", "side of the patch that is tracked", 5, 61, 21)
    levels: int = _count("levels", "pyramid levels above the image", 0, 8, 3)
    forward_backward_px: float = _real("px", "largest forward-backward error", 0.01, 10.0, 0.5)
    border_px: int = _count("px", "width of the rim of the image that is left out", 0, 100, 8)
    patch: str = _choice(
        "how a patch may change from keyframe to keyframe: shifted, or affine, by which points walk less",
        ("shifted", "affine"),
        "shifted",
    )


@dataclass(frozen=True)
class DescriptorSettings:
    """SIFT matching, for sparse keyframes."""

    features: int = _count("features", "features an image", 50, 20_000, 2000)
    contrast: float = _real("1", "SIFT contrast threshold", 0.0, 1.0, 0.02)
    ratio: float = _real("1", "largest nearest to second nearest descriptor distance", 0.1, 1.0, 0.8)
    stereo_ratio: float = _real("1", "the same along epipolar lines between the cameras", 0.1, 1.0, 0.8)
    look_back: int = _count("keyframes", "earlier keyframes that each is matched with", 1, 100, 6)
    sure_matches: int = _count(
        "matches", "where a keyframe has fewer with all just before it, all match widely", 0, 20_000, 100
    )
    pair_inliers: int = _count("matches", "least matches that agree on a relative pose", 5, 1000, 15)


@dataclass(frozen=True)
class StereoSettings:
    """Left-right matching."""

    epipolar_px: float = _real("px", "largest distance from the epipolar line", 0.05, 20.0, 1.5)
    largest_disparity_px: float = _real("px", "largest rectified disparity", 8.0, 500.0, 140.0)
    patch_px: int = _count("px", "side of the correlation patch (optical flow only)", 5, 61, 17)
    correlation: float = _real("1", "least normalised correlation (optical flow only)", 0.0, 1.0, 0.8)
    second_peak: float = _real("1", "largest second to best correlation (optical flow only)", 0.1, 1.0, 0.95)


@dataclass(frozen=True)
class PoseSettings:
    """Keyframe poses by RANSAC PnP against the points of the keyframes before."""

    reprojection_px: float = _real("px", "largest reprojection error of an inlier", 0.1, 50.0, 2.5)
    rounds: int = _count("rounds", "RANSAC rounds", 10, 100_000, 300)
    seed: int = _count("1", "order in which RANSAC meets the points; 0: as they are", 0, 2**31 - 1, 0)
    inliers: int = _count("points", "least inliers of a keyframe", 5, 10_000, 20)
    sure_inliers: int = _count(
        "points", "inliers that need no more keyframes; with fewer, the map grows", 5, 10_000, 60
    )
    map_keyframes: int = _count(
        "keyframes", "keyframes just before, whose points a pose is found by; more where needed", 1, 1000, 1
    )
    map_parallax_deg: float = _real("deg", "least parallax of these points", 0.0, 45.0, 0.4)


@dataclass(frozen=True)
class TriangulationSettings:
    """Which landmarks are kept."""

    least_depth_m: float = _real("m", "least depth in every view", 0.0, 1e3, 0.3)
    largest_depth_m: float = _real("m", "largest depth in every view", 0.1, 1e6, 60.0)
    parallax_deg: float = _real("deg", "least parallax, stereo baseline included", 0.0, 90.0, 2.0)
    reprojection_px: float = _real("px", "largest reprojection error at the start", 0.1, 100.0, 5.0)
    keyframes: int = _count("keyframes", "least keyframes that see a landmark", 1, 100, 2)


@dataclass(frozen=True)
class OutlierSettings:
    """Outlier removal by solving before the gauges are compared."""

    reprojection_px: float = _real("px", "largest reprojection error that is kept", 0.1, 100.0, 3.0)
    rounds: int = _count("rounds", "most rounds of solving and dropping", 0, 50, 15)
    sigma_px: float = _real("px", "pixel noise that these rounds assume", 0.01, 20.0, 1.0)
    density_factor: float = _real("1", "factor on the inertial densities in these rounds", 0.1, 1000.0, 4.0)


@dataclass(frozen=True)
class FrontEndSettings:
    """All settings of the front-end."""

    tracker: str = _choice("how points are followed between images", ("optical_flow", "descriptors"))
    biases: str = _choice(
        "known biases: of the truth nearest each interval's middle, or nearest the first keyframe for all; "
        "aligned: nothing of the truth, but one pair estimated with the start from poses and samples; "
        "estimated: the same, as the start of biases that the problem estimates at each keyframe",
        ("per_interval", "constant", "aligned", "estimated"),
        "per_interval",
    )
    accel_bias_sigma_mps2: float = _real(
        "m/s^2", "prior of the accelerometer's bias about zero, where no truth gives it", 1e-4, 5.0, 0.2
    )
    gravity_mps2: float = _real("m/s^2", "magnitude of gravity", 9.7, 9.9, 9.81)
    camera_time_offset_ns: int = _count(
        "ns", "added to the stamps of frames to get the clock of the inertial sensor", -(10**9), 10**9, 0
    )
    largest_imu_gap_s: float = _real("s", "largest gap between inertial samples", 1e-4, 1.0, 0.02)
    keyframes: KeyframeSettings = _group(KeyframeSettings)
    optical_flow: FlowSettings = _group(FlowSettings)
    descriptors: DescriptorSettings = _group(DescriptorSettings)
    stereo: StereoSettings = _group(StereoSettings)
    pose: PoseSettings = _group(PoseSettings)
    triangulation: TriangulationSettings = _group(TriangulationSettings)
    outliers: OutlierSettings = _group(OutlierSettings)

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, Any], source: str = _SOURCE) -> FrontEndSettings:
        """Settings from nested mappings (JSON or YAML); what is left out keeps its default.

        Raises ConfigError naming ``source`` and the key that is unknown, missing, of the wrong type or out of
        range.
        """
        settings = _from_mapping(cls, mapping, source, "")
        window = settings.keyframes
        if window.window_end_s <= window.window_start_s:
            rule = "must lie after window_start_s"
            raise ConfigError(source, rule, field="keyframes.window_end_s", value=window.window_end_s)
        if window.count == 0 and window.spacing_s == 0.0:
            raise ConfigError(
                source, "must be positive where count is 0", field="keyframes.spacing_s", value=0.0
            )
        if window.count == 1:
            raise ConfigError(source, "must be 0 or at least 2", field="keyframes.count", value=1)
        return settings

    def to_mapping(self) -> dict[str, Any]:
        """Nested plain dictionaries, the inverse of :meth:`from_mapping`."""
        return dataclasses.asdict(self)


def _from_mapping(kind: type[T], mapping: object, source: str, prefix: str) -> T:
    if not isinstance(mapping, Mapping):
        raise ConfigError(
            source, "must be a mapping of settings", field=prefix.rstrip(".") or None, value=mapping
        )
    known = {f.name: f for f in fields(kind)}  # type: ignore[arg-type]
    for key in mapping:
        if key not in known:
            rule = f"unknown setting; known are {', '.join(known)}"
            raise ConfigError(source, rule, field=f"{prefix}{key}", value=mapping[key])
    values: dict[str, Any] = {}
    for name, entry in known.items():
        if name in mapping:
            values[name] = _checked(entry.metadata, mapping[name], source, prefix + name)
        elif entry.default is MISSING and entry.default_factory is MISSING:
            raise ConfigError(source, "must be given", field=prefix + name)
    return kind(**values)


def _checked(metadata: Mapping[str, Any], value: object, source: str, name: str) -> Any:
    kind = metadata["kind"]
    if dataclasses.is_dataclass(kind):
        return _from_mapping(kind, value, source, name + ".")  # type: ignore[arg-type]
    if kind is str:
        if value not in metadata["options"]:
            raise ConfigError(
                source, f"must be one of {', '.join(metadata['options'])}", field=name, value=value
            )
        return value
    low, high = metadata["range"]
    accepted = (int,) if kind is int else (int, float)
    if isinstance(value, bool) or not isinstance(value, accepted) or not low <= value <= high:
        noun = "a whole number" if kind is int else "a number"
        raise ConfigError(
            source, f"must be {noun} from {low} to {high} ({metadata['unit']})", field=name, value=value
        )
    return kind(value)


def settings_schema(kind: type = FrontEndSettings) -> dict[str, Any]:
    """JSON schema of the settings: type, unit, range and default of each; unknown keys refused."""
    properties: dict[str, Any] = {}
    required = []
    for entry in fields(kind):
        about = entry.metadata
        if dataclasses.is_dataclass(about["kind"]):
            properties[entry.name] = settings_schema(about["kind"])  # type: ignore[arg-type]
            continue
        unit = f" [{about['unit']}]" if about["unit"] else ""
        node: dict[str, Any] = {"description": about["about"] + unit}
        if about["kind"] is str:
            node["enum"] = list(about["options"])
        else:
            node["type"] = "integer" if about["kind"] is int else "number"
            node["minimum"], node["maximum"] = about["range"]
        if entry.default is MISSING:
            required.append(entry.name)
        else:
            node["default"] = entry.default
        properties[entry.name] = node
    schema: dict[str, Any] = {"type": "object", "additionalProperties": False, "properties": properties}
    if kind.__doc__:
        schema["description"] = kind.__doc__
    if required:
        schema["required"] = required
    return schema
