"""The code blocks of the pages, run as a reader runs them: by the tests, and for the tutorial's pictures."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from contextlib import redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib

DOCS = Path(__file__).resolve().parent
# A block, and what the page says that it prints.
BLOCK = re.compile(r"^```python\n(.*?)^```\n(?:\n```text\n(.*?)^```\n)?", re.MULTILINE | re.DOTALL)


@dataclass(frozen=True)
class Block:
    """One block of a page: its line there, its code, the output that the page shows below it."""

    line: int
    code: str
    shown: str


def blocks(text: str) -> list[Block]:
    return [Block(text.count("\n", 0, found.start(1)), *found.groups("")) for found in BLOCK.finditer(text)]


def run(page: Path, names: dict[str, Any] | None = None) -> Iterator[tuple[Block, str]]:
    """Each Python block of a page and what it prints, one after another with common names.

    Pictures go into the working folder. A traceback names the line of the page.
    """
    matplotlib.use("agg")
    names = {} if names is None else names
    for block in blocks(page.read_text("utf-8")):
        with redirect_stdout(io.StringIO()) as printed:
            exec(compile("\n" * block.line + block.code, page, "exec"), names)
        yield block, printed.getvalue()
