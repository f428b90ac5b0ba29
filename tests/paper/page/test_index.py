"""The page a reader opens first: what is on it, where its links lead, and that nothing points outside."""

import base64
import io
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import pytest
from markupsafe import escape
from PIL import Image

from support.material import PIXEL, material_of
from vigauge_paper.claims import CLAIMS, THEMES
from vigauge_paper.figures.registry import FIGURES
from vigauge_paper.figures.style import narrow
from vigauge_paper.ids import STAND_IN, TABLES
from vigauge_paper.page.index import Material, index_page


@pytest.fixture
def material(tmp_path: Path) -> Material:
    return material_of(tmp_path)


class Attributes(HTMLParser):
    """All attributes of a page: (tag, name, value)."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.found: list[tuple[str, str, str]] = []
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found += [(tag, name, value or "") for name, value in attrs]

    def named(self, *names: str) -> list[str]:
        return [value for _, name, value in self.found if name in names]


def test_every_claim_has_evidence_and_a_theme() -> None:
    """Catches a claim that nothing shows, and a theme that is not on the page."""
    assert not [claim.id for claim in CLAIMS if not claim.evidence]
    assert [claim.id for claims in THEMES.values() for claim in claims] == [claim.id for claim in CLAIMS]


def test_every_link_leads_somewhere_in_the_page(material: Material) -> None:
    """Catches evidence that is named and missing, and links out of the page, dead in a report or offline."""
    page = Attributes(index_page(material))
    identifiers = page.named("id")
    assert len(identifiers) == len(set(identifiers))
    targets = set(page.named("href")) - {"data:,"}
    assert all(target.startswith("#") for target in targets)
    assert {target.removeprefix("#") for target in targets} <= set(identifiers)
    assert {f"claim-{claim.id}" for claim in CLAIMS} <= set(identifiers)
    assert {f"figure-{key}" for key in FIGURES} | set(TABLES) <= set(identifiers)


def test_nothing_is_fetched_from_anywhere(material: Material) -> None:
    """Catches a script, style, font or image from a server: the page would need a network."""
    # With the explorer's library, whose first line has the address of its home.
    text = index_page(replace(material, explorers=[{"name": "still", "withheld": "It does not move"}]))
    assert "Mike Bostock" in text
    assert all(source.startswith("data:") for source in Attributes(text).named("src"))
    # Names of XML vocabularies are no addresses: nobody fetches them.
    addresses = {
        a for a in re.findall(r"\bhttps?://[^\s\"'`)<]*", text) if not a.startswith("http://www.w3.org/")
    }
    assert not addresses
    assert not re.search(r"@import|url\((?!#)", text)


def test_verdicts_reasons_and_failures_are_in_sight(material: Material) -> None:
    """Catches a claim that falls and is not named at the top, and a reason that only a click shows."""
    text = index_page(material)
    falls = text[text.index('<section id="falls">') : text.index('<section id="data">')]
    for k, row in enumerate(material.rows):
        assert (f'href="#claim-{row["id"]}"' in falls) == (k % 4 == 0)
        ledger_row = re.search(rf'<tr id="claim-{row["id"]}".*?</tr>', text, re.DOTALL)
        assert ledger_row and f"Because of {row['id']} &amp; more." in ledger_row[0]
        assert "<details" not in ledger_row[0] and "1 &lt; 2" in ledger_row[0]
    assert f"{sum(row['verdict'] == 'holds' for row in material.rows)} of {len(CLAIMS)} claims" in text


def test_figures_tables_and_experiments_are_in_the_page(material: Material) -> None:
    """Catches an artefact that the page forgets, and text of a file that becomes markup."""
    text = index_page(material)
    assert text.count(base64.b64encode(PIXEL).decode()) == len(FIGURES)
    for figure in FIGURES.values():
        assert figure.shows.endswith(".") and str(escape(figure.shows)) in text
    assert text.count("<td><strong>1</strong></td><td>2 | 3</td>") == len(TABLES)
    assert "&lt;orbit&gt;" in text and "<orbit>" not in text
    assert '<summary>orbit <span class="about">The cost on an orbit, Eq. (3)</span></summary>' in text
    assert "and 2 more rows in the file" in text and "0.1235" in text


def test_a_phone_gets_the_stacked_picture(material: Material) -> None:
    """Catches a figure of two columns that a phone shrinks until nobody can read it."""
    Image.new("RGB", (3, 7)).save(narrow(material.figures["fig09"]), "PNG")
    sources = [value for tag, _, value in Attributes(index_page(material)).found if tag == "source"]
    assert len(sources) == 2 and sources[0] == "screen and (max-width: 46rem)"
    found = base64.b64decode(str(sources[1]).removeprefix("data:image/png;base64,"))
    assert Image.open(io.BytesIO(found)).size == (3, 7)


def test_a_stand_in_is_never_shown_as_euroc(material: Material) -> None:
    """Catches a page of rendered sequences that reads like one of EuRoC."""
    rendered, euroc = index_page(material), index_page(replace(material, source="euroc"))
    assert rendered.lower().count(STAND_IN.lower()) > 4 and 'class="banner"' in rendered
    assert STAND_IN.lower() not in euroc.lower() and 'class="banner"' not in euroc


def test_a_figure_that_was_not_made_is_not_linked(material: Material) -> None:
    """Catches dead links where an artefact was not made."""
    figures = {key: file for key, file in material.figures.items() if key != "fig09"}
    assert "figure-fig09" not in index_page(replace(material, figures=figures))


def test_further_results_are_shown_where_they_are(material: Material, tmp_path: Path) -> None:
    """Catches windows, or the sensitivity sweep, that were made and are on no page."""
    windows = tmp_path / "windows.md"
    windows.write_text("# Windows\n\n| window |\n|---|\n| MH_01_w1 |\n", "utf-8")
    claims = "# Claims\n\n## Where in the range of our assumptions\n\n| parameter |\n|---|\n| noise |\n"
    text = index_page(replace(material, claims=claims, extensions={"Other parts": windows}))
    assert "<h3>Other parts</h3>" in text and "<td>MH_01_w1</td>" in text and "<td>noise</td>" in text


def test_the_largest_drift_of_the_processor_stands_beside_the_times(material: Material) -> None:
    """Catches times whose machine slowed down meanwhile, and nobody reads that."""
    assert re.search(r"speed\s+changed by up to 2\.7 %", index_page(material))
