"""The page of the paper, its generated part, and what README.md says of it."""

import re
from collections import Counter

import pytest

from support import ROOT
from vigauge.errors import DataError
from vigauge.files import read_rows
from vigauge_paper.claims import CLAIMS
from vigauge_paper.commands.paper_page import BEGIN, END, insert

PAGE = (ROOT / "docs" / "paper.md").read_text("utf-8")
TABLE = PAGE.split(BEGIN)[1].split(END)[0]
ROWS = [line.strip("| ").split(" | ") for line in TABLE.splitlines() if line.startswith("|")]
# The verdict of each claim, by the claim's text.
VERDICTS = {row[0]: row[-1] for row in ROWS[ROWS.index(["claim", "section", "published", "verdict"]) + 2 :]}


def test_page_has_every_claim_with_the_expected_verdict() -> None:
    """Catches a page that was typed by hand, or that a renewed expected value or a new claim left behind."""
    assert ROWS[0][:2] == ["case", "gauge"]
    assert list(VERDICTS) == [claim.claim for claim in CLAIMS]
    rows = [row for row in read_rows(ROOT / "data" / "expected.csv") if row["artefact"] == "claims"]
    expected = {r["row"]: r["value"] for r in rows if (r["source"], r["quantity"]) == ("euroc", "verdict")}
    shown = {claim.id: VERDICTS[claim.claim] for claim in CLAIMS}
    assert expected == {name: shown[name] for name in expected}


@pytest.mark.parametrize(
    ("page", "pattern"),
    [
        ("README.md", r"(\d+) of the (\d+) claims that we take from the paper hold, and (\d+) differ"),
        (
            "joss/paper.md",
            r"judges (\d+) claims of the paper: in our reproduction (\d+) hold and (\d+) differ",
        ),
    ],
)
def test_other_pages_count_the_verdicts_as_this_one(page: str, pattern: str) -> None:
    """Catches a count that the ledger has left behind."""
    (found,) = re.findall(pattern, " ".join((ROOT / page).read_text("utf-8").split()))
    count = Counter(VERDICTS.values())
    assert sorted(map(int, found)) == sorted([count["holds"], len(VERDICTS), count["differs"]])


def test_inserting_twice_is_inserting_once() -> None:
    """Tables that pile up at every run."""
    text = f"before\n{BEGIN}\nold\n{END}\nafter\n"
    once = insert(text, "new", "page.md")
    assert "old" not in once and "new" in once
    assert insert(once, "new", "page.md") == once
    assert once.startswith("before\n") and once.endswith("\nafter\n")


@pytest.mark.parametrize("text", ["nothing", f"{BEGIN}", f"{BEGIN}{BEGIN}{END}"])
def test_missing_or_double_marks_are_refused(text: str) -> None:
    with pytest.raises(DataError, match="must hold the mark"):
        insert(text, "new", "page.md")
