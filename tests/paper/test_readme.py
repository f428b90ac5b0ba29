"""The README's generated part."""

from __future__ import annotations

import pytest

from support import ROOT
from vigauge.errors import DataError
from vigauge_paper.commands.readme import BEGIN, END, insert

README = ROOT / "README.md"


def test_readme_has_both_marks_and_a_filled_table() -> None:
    """A README whose numbers were typed by hand, or never made."""
    text = README.read_text("utf-8")
    table = text.split(BEGIN)[1].split(END)[0]
    assert "| case | gauge |" in table
    assert "| claim | section | published | verdict |" in table


def test_inserting_twice_is_inserting_once() -> None:
    """Tables that pile up at every run."""
    text = f"before\n{BEGIN}\nold\n{END}\nafter\n"
    once = insert(text, "new", "README.md")
    assert "old" not in once and "new" in once
    assert insert(once, "new", "README.md") == once
    assert once.startswith("before\n") and once.endswith("\nafter\n")


@pytest.mark.parametrize("text", ["nothing", f"{BEGIN}", f"{BEGIN}{BEGIN}{END}"])
def test_missing_or_double_marks_are_refused(text: str) -> None:
    with pytest.raises(DataError, match="must hold the mark"):
        insert(text, "new", "README.md")
