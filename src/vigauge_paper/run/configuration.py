"""The configuration against its JSON schema: what is wrong is one sentence that names the key."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import yaml
from jsonschema import Draft202012Validator, ValidationError
from jsonschema.exceptions import best_match
from referencing import Registry
from referencing.jsonschema import DRAFT202012

from vigauge.errors import ConfigError

# Ours has about 200 values on 7 levels. Aliases of YAML make larger ones than any file could hold.
_MOST_VALUES = 100_000
_DEEPEST = 30
_LARGEST_INTEGER = 2**63


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


def load_validator(schema: Path) -> Draft202012Validator:
    """Validator of a YAML schema, which may refer to the other schemas of its folder by file name."""
    contents = {file.name: yaml.safe_load(file.read_text("utf-8")) for file in schema.parent.glob("*.yaml")}
    resources = [(name, DRAFT202012.create_resource(text)) for name, text in contents.items()]
    return Draft202012Validator(contents[schema.name], registry=Registry().with_resources(resources))


def _values(value: object, place: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], object]]:
    """Every value below ``value`` with the keys that lead to it, aliased ones each time they occur."""
    yield place, value
    if isinstance(value, Mapping):
        for key, entry in value.items():
            yield from _values(entry, (*place, str(key)))
    elif isinstance(value, list):
        for number, entry in enumerate(value):
            yield from _values(entry, (*place, str(number)))


def _require_plain(config: Mapping[str, Any], file: str) -> None:
    """Refuse what a schema lets pass or cannot look at: sizes without end, NaN, keys that are no text."""
    for number, (place, value) in enumerate(_values(config)):
        rule = ""
        if len(place) > _DEEPEST or number > _MOST_VALUES:
            raise ConfigError(file, f"must have at most {_MOST_VALUES} values, {_DEEPEST} levels deep")
        if isinstance(value, Mapping) and not all(isinstance(key, str) for key in value):
            rule = "keys must be text"
        elif isinstance(value, float) and not math.isfinite(value):
            rule = "must be finite"
        elif isinstance(value, int) and abs(value) > _LARGEST_INTEGER:
            rule, value = "must be an integer of at most 64 bits", None
        elif not isinstance(value, Mapping | list | str | int | float | None):
            rule = "must be text, a number, true, false, null, a list or a mapping"
        if rule:
            raise ConfigError(file, rule, field=".".join(place) or "(top level)", value=value)


def check_config(config: Mapping[str, Any], schema: Path, file: str) -> None:
    """Refuse a configuration that its schema does not allow, or that is no plain data of modest size.

    Raises ConfigError with the key, the value and the rule it breaks, unit included.
    """
    check_with(load_validator(schema), config, file)


def check_with(validator: Draft202012Validator, config: Mapping[str, Any], file: str) -> None:
    """:func:`check_config` by a validator that is there already."""
    _require_plain(config, file)
    error = best_match(validator.iter_errors(config))
    if error is not None:
        rule, value = _rule(error)
        raise ConfigError(file, rule, field=_key(error), value=value)
