"""Settings of the front-end: what is refused, and with which words."""

from typing import Any

import jsonschema
import pytest

from vigauge.errors import ConfigError
from vigauge.recordings.frontend.settings import FrontEndSettings, settings_schema

SMALLEST = {"tracker": "optical_flow"}


def test_defaults_survive_a_round_trip_and_obey_the_schema() -> None:
    """A default outside its own range, or a field that is lost on the way through JSON."""
    settings = FrontEndSettings.from_mapping(SMALLEST)
    assert FrontEndSettings.from_mapping(settings.to_mapping()) == settings
    jsonschema.validate(settings.to_mapping(), settings_schema())


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"treshold": 1}, "treshold"),
        ({"pose": {"inlier": 20}}, "pose.inlier"),
        ({"tracker": "optical flow"}, "tracker"),
        ({"pose": {"rounds": 10.5}}, "pose.rounds"),
        ({"pose": {"rounds": True}}, "pose.rounds"),
        ({"pose": {"reprojection_px": "2"}}, "pose.reprojection_px"),
        ({"pose": {"reprojection_px": float("nan")}}, "pose.reprojection_px"),
        ({"gravity_mps2": 981.0}, "gravity_mps2"),
        ({"stereo": 3}, "stereo"),
        ({"keyframes": {"window_start_s": 5.0, "window_end_s": 5.0}}, "keyframes.window_end_s"),
        ({"keyframes": {"count": 0}}, "keyframes.spacing_s"),
        ({"keyframes": {"count": 1}}, "keyframes.count"),
    ],
)
def test_bad_setting_is_named(change: dict[str, Any], field: str) -> None:
    """A misspelt key that is silently ignored, or a value of a wrong type or range that gets through."""
    with pytest.raises(ConfigError) as caught:
        FrontEndSettings.from_mapping(SMALLEST | change, "config.yaml")
    assert caught.value.field == field
    assert "config.yaml" in str(caught.value)


def test_tracker_has_no_default() -> None:
    """A sequence that is tracked the wrong way because nobody said how."""
    with pytest.raises(ConfigError, match="tracker: must be given"):
        FrontEndSettings.from_mapping({})


@pytest.mark.parametrize("change", [{"pose": {"inlier": 20}}, {"gravity_mps2": 981.0}, {"tracker": "x"}])
def test_schema_refuses_what_the_settings_refuse(change: dict[str, Any]) -> None:
    """A schema that is laxer than the code: the error would come after half an hour of other stages."""
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(SMALLEST | change, settings_schema())
