"""YAML as sensor files use it: mappings, lists, numbers and text; nothing that costs more than its size.

Plain safe loading still expands aliases, so a short file can stand for a value of any
size, and it turns explicit tags into exceptions of any kind.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from ...errors import DataError

# A sensor.yaml has about 1 kB and four levels.
_LARGEST_BYTES = 100_000
_DEEPEST = 20
_LARGEST_INTEGER = 2**63


class _PlainLoader(yaml.SafeLoader):
    """Safe loading without anchors, aliases, explicit tags, dates, or nesting without end."""

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
# Dates stay text: YAML 1.1 also takes those that no calendar has.
_PlainLoader.yaml_implicit_resolvers = {
    first: [(tag, pattern) for tag, pattern in resolvers if tag != "tag:yaml.org,2002:timestamp"]
    for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
}


def read_plain_yaml(path: Path) -> Any:
    """Content of a small YAML file.

    Some copies of sensor files begin with ``%YAML:1.0``, which OpenCV writes and YAML
    itself forbids; that line is skipped.

    Raises
    ------
    DataError
        for a file that is missing, too large for what it is, no YAML, or YAML beyond
        mappings, lists, numbers and text.
    """
    if not path.is_file():
        raise DataError(path, "file must exist")
    size = path.stat().st_size
    if size > _LARGEST_BYTES:
        raise DataError(path, f"must have at most {_LARGEST_BYTES} bytes", value=size)
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
        if lines and lines[0].startswith("%YAML"):
            lines[0] = ""
        return yaml.load("\n".join(lines), _PlainLoader)
    except (UnicodeDecodeError, OSError, yaml.YAMLError, ValueError) as error:
        # ValueError: a whole number of more digits than Python converts.
        raise DataError(path, f"must be a plain YAML file: {error}") from error
