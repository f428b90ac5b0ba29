"""The ledger's page: a row's evidence is one click away, and in the page."""

from __future__ import annotations

import base64
import re
from pathlib import Path

import pytest

from vigauge_paper.claims import CLAIMS
from vigauge_paper.claims.page import SHOWN_ROWS, claims_page, evidence_links

PIXEL = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNkYPhfDwAChwGA60e6kgAAAABJRU5ErkJggg=="
)


@pytest.fixture
def files(tmp_path: Path) -> dict[str, Path]:
    """A file of every evidence that a claim names."""
    out = {}
    for name in {name for claim in CLAIMS for name in claim.evidence}:
        out[name] = tmp_path / (f"{name}.png" if name.startswith("fig") else f"{name}.csv")
        if name.startswith("fig"):
            out[name].write_bytes(PIXEL)
        else:
            out[name].write_text("a,b\n" + f"<{name}>,1\n" * (SHOWN_ROWS + 2), "utf-8")
    return out


def _rows() -> list[dict[str, str]]:
    return [
        {
            "id": claim.id,
            "section": claim.section,
            "claim": claim.claim,
            "published": claim.published,
            "measured": "1 < 2",
            "criterion": claim.criterion,
            "verdict": "holds",
        }
        for claim in CLAIMS
    ]


def test_every_claim_has_evidence() -> None:
    assert not [claim.id for claim in CLAIMS if not claim.evidence]


def test_every_link_leads_somewhere_in_the_page(files: dict[str, Path]) -> None:
    """Catches evidence that is named and not there, and links out of the page, dead in a report."""
    page = claims_page(_rows(), {"rank": "a < b & c"}, files)
    targets = re.findall(r'href="([^"]*)"', page)
    identifiers = re.findall(r'id="([^"]*)"', page)
    assert len(identifiers) == len(set(identifiers))
    assert {target.removeprefix("#") for target in targets} <= set(identifiers)
    assert all(target.startswith("#") for target in targets)
    for claim in CLAIMS:
        row = re.search(rf'<tr id="claim-{claim.id}".*?</tr>', page, flags=re.DOTALL)
        assert row is not None
        assert all(f'href="#evidence-{name}"' in row.group() for name in claim.evidence)


def test_evidence_is_in_the_page(files: dict[str, Path]) -> None:
    page = claims_page(_rows(), {}, files)
    assert page.count(base64.b64encode(PIXEL).decode()) == sum(f.suffix == ".png" for f in files.values())
    assert "&lt;orbit&gt;" in page and "<orbit>" not in page
    assert "and 2 more rows in the file" in page
    assert "1 &lt; 2" in page


def test_evidence_without_a_file_is_not_linked(files: dict[str, Path]) -> None:
    """Catches dead links where an artefact was not made."""
    del files["fig09"]
    assert evidence_links("rank", files) == ["table1", "fig10"]
    assert "evidence-fig09" not in claims_page(_rows(), {}, files)
