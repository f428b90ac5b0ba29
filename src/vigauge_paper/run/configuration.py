"""The configuration against its JSON schema: what is wrong is one sentence that names the key."""

import contextlib
import math
from collections.abc import Callable, Mapping, MutableMapping
from functools import cache
from pathlib import Path
from typing import Any

import yaml
from jsonschema import Draft202012Validator, ValidationError
from jsonschema.exceptions import best_match
from referencing import Registry
from referencing.jsonschema import DRAFT202012

from vigauge.errors import ConfigError

# How text becomes a value of a type of JSON.
_READ: dict[str, Callable[[str], object]] = {
    "integer": int,
    "number": float,
    "boolean": lambda text: {"true": True, "false": False}[text.lower()],
}


def _key(error: ValidationError) -> str:
    return ".".join(str(part) for part in error.absolute_path) or "(top level)"


def _rule(error: ValidationError) -> tuple[str, object]:
    """What must hold, in words, and the value to show."""
    if error.validator == "additionalProperties":
        known = sorted(error.schema.get("properties", {}))
        unknown = sorted(set(error.instance) - set(known))
        return f"unknown key {', '.join(unknown)}; known keys: {', '.join(known)}", None
    if error.validator == "required":
        missing = sorted(set(error.validator_value) - set(error.instance))
        return f"missing key {', '.join(missing)}", None
    about = error.schema.get("description") if isinstance(error.schema, Mapping) else None
    return error.message + (f"; {about}" if about else ""), error.instance


@cache
def load_validator(schema: Path) -> Draft202012Validator:
    """Validator of a YAML schema, which may refer to the other schemas of its folder by file name."""
    contents = {file.name: yaml.safe_load(file.read_text("utf-8")) for file in schema.parent.glob("*.yaml")}
    resources = [(name, DRAFT202012.create_resource(text)) for name, text in contents.items()]
    return Draft202012Validator(contents[schema.name], registry=Registry().with_resources(resources))


def _require_plain(value: object, file: str, place: tuple[str, ...] = ()) -> None:
    """Refuse what the schema lets pass or cannot name: NaN, infinities, keys that are not text."""
    rule = ""
    if isinstance(value, float) and not math.isfinite(value):
        rule = "must be finite"
    elif isinstance(value, Mapping) and not all(isinstance(key, str) for key in value):
        rule = "keys must be text"
    if rule:
        raise ConfigError(file, rule, field=".".join(place) or "(top level)", value=value)
    if isinstance(value, Mapping | list):
        for key, entry in value.items() if isinstance(value, Mapping) else enumerate(value):
            _require_plain(entry, file, (*place, str(key)))


def read_numbers(config: MutableMapping[str, Any], schema: Path) -> None:
    """Turn text into the number or truth value that the schema asks for, in place.

    ``--config`` hands everything on as text, and YAML reads 1e-3, without a point, as text. What cannot be
    read stays as it is, for :func:`check_config` to refuse.
    """
    for error in load_validator(schema).iter_errors(config):
        read = _READ.get(str(error.validator_value)) if error.validator == "type" else None
        if read and isinstance(error.instance, str):
            *path, last = error.absolute_path
            place: Any = config
            for key in path:
                place = place[key]
            with contextlib.suppress(ValueError, KeyError):
                place[last] = read(error.instance)


def check_config(config: Mapping[str, Any], schema: Path, file: str) -> None:
    """Refuse a configuration that its schema does not allow.

    Raises ConfigError with the key, the value and the rule it breaks, unit included.
    """
    _require_plain(config, file)
    error = best_match(load_validator(schema).iter_errors(config))
    if error is not None:
        rule, value = _rule(error)
        raise ConfigError(file, rule, field=_key(error), value=value)
