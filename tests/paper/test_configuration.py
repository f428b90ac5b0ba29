"""The shipped configuration and its schema."""

import copy
import dataclasses
from typing import Any

import pytest
import yaml

from support import ROOT
from vigauge.errors import ConfigError
from vigauge.recordings.frontend.settings import settings_schema
from vigauge.solver.levenberg_marquardt import Options
from vigauge.synthetic.settings import SimulationSettings
from vigauge_paper.run.configuration import check_config, load_validator, read_numbers
from vigauge_paper.stand_in.rendering import RenderSettings
from vigauge_paper.workflow.cross_field import check_between_keys

SCHEMA = ROOT / "workflow" / "schemas" / "config.schema.yaml"


@pytest.fixture
def config() -> dict[str, Any]:
    return yaml.safe_load((ROOT / "config" / "config.yaml").read_text("utf-8"))


def merged(base: dict[str, Any], over: dict[str, Any]) -> dict[str, Any]:
    out = copy.deepcopy(base)
    for key, value in over.items():
        out[key] = merged(out[key], value) if isinstance(value, dict) and key in out else value
    return out


def test_shipped_configurations_are_valid(config: dict[str, Any]) -> None:
    check_config(config, SCHEMA, "config.yaml")
    smoke = yaml.safe_load((ROOT / "config" / "smoke.yaml").read_text("utf-8"))
    check_config(merged(config, smoke), SCHEMA, "smoke.yaml")
    check_between_keys(config, SCHEMA)
    check_between_keys(merged(config, smoke), SCHEMA)


def test_text_is_read_as_the_schema_says(config: dict[str, Any]) -> None:
    """Catches numbers of --config, and 1e-3 of YAML, that stay text; what is no number is refused by name."""
    text = {"simulation": {"n_trials": "4", "sigma_px": "1e-3", "redraw_noise": "False"}}
    given = merged(config, text) | {"prior": config["prior"] | {"sweep_weights": ["0", "7"]}}
    read_numbers(given, SCHEMA)
    found = given["simulation"]
    assert (found["n_trials"], found["sigma_px"], found["redraw_noise"]) == (4, 1e-3, False)
    assert given["prior"]["sweep_weights"] == ["0", "7"]
    wrong = merged(config, {"simulation": {"n_trials": "4.5"}})
    read_numbers(wrong, SCHEMA)
    with pytest.raises(ConfigError, match=r"simulation\.n_trials: '4\.5' is not of type 'integer'"):
        check_config(wrong, SCHEMA, "configuration")


def test_front_end_schema_says_what_the_settings_say() -> None:
    """A setting that was added in the code but is refused, or undocumented, in the schema."""
    written = yaml.safe_load((SCHEMA.parent / "front_end.schema.yaml").read_text("utf-8"))
    assert written == settings_schema()


@pytest.mark.parametrize(
    ("kind", "schema"), [(SimulationSettings, "simulation"), (RenderSettings, None), (Options, "solver")]
)
def test_schema_and_dataclass_have_the_same_keys(kind: type, schema: str | None) -> None:
    """A key that the schema allows but the code does not know, or the other way round."""
    if schema is None:
        text = yaml.safe_load((SCHEMA.parent / "render.schema.yaml").read_text("utf-8"))
    else:
        text = yaml.safe_load(SCHEMA.read_text("utf-8"))["properties"][schema]
    names = {field.name for field in dataclasses.fields(kind)}
    assert set(text["properties"]) <= names
    if schema == "simulation":
        assert set(text["properties"]) == names


def every_object(schema: Any) -> list[dict[str, Any]]:
    if isinstance(schema, list):
        return [found for item in schema for found in every_object(item)]
    if not isinstance(schema, dict):
        return []
    own = [schema] if "properties" in schema and schema.get("type") == "object" else []
    return own + [found for value in schema.values() for found in every_object(value)]


def test_every_section_refuses_unknown_keys() -> None:
    for file in SCHEMA.parent.glob("*.yaml"):
        for section in every_object(yaml.safe_load(file.read_text("utf-8"))):
            assert section.get("additionalProperties") is not True
            assert "additionalProperties" in section, (file.name, sorted(section["properties"]))


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (("simulation", "n_trails"), 3, "simulation: unknown key n_trails"),
        (("simulation", "sigma_px"), -1.0, r"simulation.sigma_px: .*px \(found -1.0\)"),
        (("simulation", "n_keyframes"), "ten", "simulation.n_keyframes"),
        (("prior", "sweep_weights"), ["0", "many"], "prior.sweep_weights.1"),
        (("euroc", "sequences", "MH_01_easy", "front_end", "tracker"), "magic", "front_end.tracker"),
        (("rendered", "hall", "scene", "duration_s"), 0.0, "rendered.hall.scene.duration_s"),
    ],
)
def test_bad_values_are_named_with_their_rule(
    config: dict[str, Any], path: tuple[str, ...], value: object, message: str
) -> None:
    section = config
    for key in path[:-1]:
        section = section[key]
    section[path[-1]] = value
    with pytest.raises(ConfigError, match=message):
        check_config(config, SCHEMA, "config.yaml")


def test_missing_key_is_named(config: dict[str, Any]) -> None:
    del config["simulation"]["seed"]
    with pytest.raises(ConfigError, match="simulation: missing key seed"):
        check_config(config, SCHEMA, "config.yaml")


def test_schema_itself_is_valid() -> None:
    validator = load_validator(SCHEMA)
    validator.check_schema(validator.schema)


@pytest.mark.parametrize(
    ("over", "rule"),
    [
        ({1: 2}, r"\(top level\): keys must be text"),
        ({"simulation": {"sigma_px": float("nan")}}, "simulation.sigma_px: must be finite"),
        ({"prior": {"sweep_weights": [1.0, float("inf")]}}, "prior.sweep_weights.1: must be finite"),
    ],
)
def test_what_the_schema_lets_pass_is_refused(
    config: dict[str, Any], over: dict[Any, Any], rule: str
) -> None:
    """NaN passes every bound of a schema; a key that is a number ends in a traceback."""
    with pytest.raises(ConfigError, match=rule):
        check_config(merged(config, over), SCHEMA, "config.yaml")
