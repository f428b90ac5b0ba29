"""The ledger as one page of HTML that holds its evidence: a click on a row's evidence shows it.

Images and tables are in the page itself, so that it works from a folder, inside a report, and offline.
"""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path

import pandas as pd

from .ledger import CLAIMS

# Longer tables are cut in the page; the files have all.
SHOWN_ROWS = 40

_STYLE = """
body { font: 14px sans-serif; margin: 1.5em; color: #222; }
table { border-collapse: collapse; margin: 0.7em 0; }
th, td { border: 1px solid #ccc; padding: 0.25em 0.5em; text-align: left; vertical-align: top; }
th { background: #eee; }
tr.differs td.verdict { background: #f6d5c0; }
tr.holds td.verdict { background: #d5ead5; }
section { border-top: 2px solid #888; margin-top: 2em; }
section table { font-size: 11px; }
img { max-width: 100%; }
"""


def evidence_links(claim_id: str, files: Mapping[str, Path]) -> list[str]:
    """Names of a claim's evidence that there are files of."""
    (claim,) = (claim for claim in CLAIMS if claim.id == claim_id)
    return [name for name in claim.evidence if name in files]


def claims_page(rows: Sequence[Mapping[str, str]], why: Mapping[str, str], files: Mapping[str, Path]) -> str:
    """The page. ``rows`` of claims.csv, ``why`` by claim, ``files`` of evidence by name (PNG or CSV)."""
    names = list(dict.fromkeys(name for row in rows for name in evidence_links(row["id"], files)))
    used = {name: [row["id"] for row in rows if name in evidence_links(row["id"], files)] for name in names}
    parts = [
        "<!doctype html>",
        '<html lang="en"><head><meta charset="utf-8"><title>Claims</title>',
        f"<style>{_STYLE}</style></head><body>",
        '<h1 id="claims">Claims of the paper</h1>',
        _claims_table(rows, why, files),
        *(_section(name, files[name], used[name]) for name in names),
        "</body></html>",
    ]
    return "\n".join(parts) + "\n"


def _link(target: str, text: str) -> str:
    return f'<a href="#{escape(target)}">{escape(text)}</a>'


def _claims_table(
    rows: Sequence[Mapping[str, str]], why: Mapping[str, str], files: Mapping[str, Path]
) -> str:
    columns = ["claim", "section", "published", "measured", "criterion", "verdict"]
    head = "".join(f"<th>{name}</th>" for name in [*columns, "evidence", "why"])
    lines = [f"<table><thead><tr>{head}</tr></thead><tbody>"]
    for row in rows:
        cells = "".join(f'<td class="{name}">{escape(row[name])}</td>' for name in columns)
        links = ", ".join(_link(f"evidence-{name}", name) for name in evidence_links(row["id"], files))
        reason = why.get(row["id"], "")
        shown = f"<details><summary>why</summary>{escape(reason)}</details>" if reason else ""
        verdict = escape(row["verdict"].replace(" ", "-"))
        lines.append(
            f'<tr id="claim-{escape(row["id"])}" class="{verdict}">'
            f"{cells}<td>{links}</td><td>{shown}</td></tr>"
        )
    return "\n".join([*lines, "</tbody></table>"])


def _section(name: str, file: Path, claims: Sequence[str]) -> str:
    back = ", ".join(_link(f"claim-{claim}", claim) for claim in claims)
    shown = _image(name, file) if file.suffix == ".png" else _table(file)
    return (
        f'<section id="evidence-{escape(name)}"><h2>{escape(name)}</h2>'
        f"<p>{escape(file.as_posix())}; for {back}</p>\n{shown}</section>"
    )


def _image(name: str, file: Path) -> str:
    data = base64.b64encode(file.read_bytes()).decode("ascii")
    return f'<img alt="{escape(name)}" src="data:image/png;base64,{data}">'


def _table(file: Path) -> str:
    table = pd.read_csv(file, dtype=str, keep_default_na=False)
    text = str(table.head(SHOWN_ROWS).to_html(index=False, border=0))
    rest = len(table) - SHOWN_ROWS
    return text + (f"<p>and {rest} more rows in the file</p>" if rest > 0 else "")
