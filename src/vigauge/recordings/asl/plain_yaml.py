"""YAML as sensor files use it: mappings, lists, numbers and text.

Plain safe loading still expands aliases, so a short file can stand for a value of any
size, and it turns explicit tags into exceptions of any kind.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from ...errors import DataError

# A sensor.yaml has four levels.
_DEEPEST = 20
_LARGEST_INTEGER = 2**63


class _PlainLoader(yaml.SafeLoader):
    """Safe loading without anchors, aliases, explicit tags, or deep nesting."""

    depth = 0

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        event = self.peek_event()
        if isinstance(event, yaml.AliasEvent) or event.anchor is not None:
            raise yaml.YAMLError("anchors and aliases are not allowed")
        if event.tag is not None:
            raise yaml.YAMLError(f"tags are not allowed: {event.tag}")
        if self.depth >= _DEEPEST:
            raise yaml.YAMLError(f"must not be nested more than {_DEEPEST} levels deep")
        self.depth += 1
        node = super().compose_node(parent, index)
        self.depth -= 1
        return node

    def construct_yaml_int(self, node: yaml.ScalarNode) -> int:
        number = super().construct_yaml_int(node)
        if abs(number) >= _LARGEST_INTEGER:
            raise yaml.YAMLError("whole numbers must have at most 64 bits")
        return number


_PlainLoader.add_constructor("tag:yaml.org,2002:int", _PlainLoader.construct_yaml_int)


def read_plain_yaml(path: Path) -> Any:
    """Content of a small YAML file.

    Some copies of sensor files begin with ``%YAML:1.0``, which OpenCV writes and YAML
    itself forbids; that line is skipped.

    Raises DataError for a file that is missing, no YAML, or YAML with anchors, aliases, tags or deep nesting.
    """
    if not path.is_file():
        raise DataError(path, "file must exist")
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
        if lines and lines[0].startswith("%YAML"):
            lines[0] = ""
        return yaml.load("\n".join(lines), _PlainLoader)
    except (UnicodeDecodeError, OSError, yaml.YAMLError, ValueError) as error:
        # ValueError: a number of more digits than Python converts, or a date that no calendar has.
        raise DataError(path, f"must be a plain YAML file: {error}") from error
