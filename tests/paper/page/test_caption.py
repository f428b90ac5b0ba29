"""Captions of the report, in the page."""

import pytest

from support import ROOT
from vigauge_paper.figures.registry import FIGURES
from vigauge_paper.ids import STAND_IN
from vigauge_paper.page.caption import caption

CAPTIONS = ROOT / "workflow" / "report"


@pytest.mark.parametrize("key", FIGURES)
def test_every_caption_is_html_without_leftovers(key: str) -> None:
    """Catches a caption that the page cannot read: Jinja or reStructuredText is left in it, or an error."""
    for source, published in (("euroc", True), ("rendered", False)):
        text = caption(CAPTIONS / f"{key}.rst", source, published)
        assert text.startswith("<p>") and FIGURES[key].title in text
        assert not any(left in text for left in ("{%", "**", "``", "system-message", ":sup:"))


def test_a_caption_says_what_the_sequences_are() -> None:
    """Catches the caption of one build under the figure of another."""
    assert STAND_IN in caption(CAPTIONS / "fig10.rst", "rendered", False).lower().replace("euroc", "EuRoC")
    assert "stand-in" not in caption(CAPTIONS / "fig10.rst", "euroc", True)
    assert "the paper" in caption(CAPTIONS / "fig01.rst", "euroc", True)
