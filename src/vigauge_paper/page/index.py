"""The page: what is on it, and the template that it goes into.

Everything is in the one file, images included, and nothing in it points outside: it opens from a folder,
inside Snakemake's report, from a mail, and offline.
"""

from __future__ import annotations

import base64
import io
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from PIL import Image

from ..claims import THEMES, Verdict, evidence_links, headline
from ..claims.ledger import TIMED, UNRESOLVED
from ..experiments.registry import EXPERIMENTS
from ..figures.registry import FIGURES
from ..figures.style import COLOURS, narrow
from ..ids import STAND_IN, TABLES
from . import markdown
from .caption import caption

# Longer tables are cut in the page; the files have all.
SHOWN_ROWS = 40
# Figures that the paper does not have.
NOT_IN_THE_PAPER = ("nees", "prior_reading", "fig_errors", "biases")
# Heading in claims.md of the sensitivity sweep, which is only made when asked for.
SENSITIVITY = "Where in the range of our assumptions"


@dataclass(frozen=True)
class Material:
    """What the page is made of.

    ``rows`` of claims.csv and ``why`` by claim; ``claims`` the text of claims.md; ``figures`` (PNG, each with
    its narrow one where :func:`~..figures.style.narrow` says),
    ``tables`` (Markdown) and the ``evidence`` of experiments (CSV) by name; ``captions`` folder of the
    figures' captions;
    ``source`` of the sequences ('euroc', 'rendered' or 'other'); ``published`` figures that show the
    paper's numbers beside ours; ``environment`` as environment.json has it; ``extensions`` further results
    by title, Markdown or CSV; ``explorers`` what :mod:`.explorer` ships.
    """

    rows: Sequence[dict[str, str]]
    why: Mapping[str, str]
    claims: str
    figures: Mapping[str, Path]
    evidence: Mapping[str, Path]
    tables: Mapping[str, Path]
    captions: Path
    source: str
    published: Collection[str]
    environment: Mapping[str, Any]
    extensions: Mapping[str, Path]
    explorers: Sequence[Mapping[str, object]]


def index_page(material: Material) -> str:
    """The page as HTML."""
    environment = Environment(
        loader=PackageLoader(__package__, "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    # Style and scripts are ours and stand in the page as they are.
    environment.globals["file"] = lambda name: Markup(_text(name))
    return environment.get_template("index.html.jinja").render(_content(material))


def _content(m: Material) -> dict[str, object]:
    places = _places(m)
    by_id: dict[str, dict[str, Any]] = {
        row["id"]: {**row, "why": m.why.get(row["id"], ""), "timed": row["id"] in TIMED} for row in m.rows
    }
    rows = [{**row, "evidence": evidence_links(row["id"], places)} for row in by_id.values()]
    extensions = {title: _table(file) for title, file in m.extensions.items()}
    if found := markdown.section(m.claims, SENSITIVITY):
        extensions[SENSITIVITY] = markdown.html(found, SHOWN_ROWS)
    return {
        "headline": headline([dict(row) for row in m.rows]),
        "verdicts": {str(v): [row for row in rows if row["verdict"] == v] for v in Verdict},
        "themes": {
            theme: [by_id[claim.id] for claim in claims if claim.id in by_id]
            for theme, claims in THEMES.items()
        },
        "rows": rows,
        "places": places,
        "sections": list(dict.fromkeys(row["section"].split(",")[0] for row in m.rows)),
        "figures": [_figure(key, m) for key in FIGURES if key in m.figures and key not in NOT_IN_THE_PAPER],
        "beyond": [_figure(key, m) for key in NOT_IN_THE_PAPER if key in m.figures],
        "tables": [
            (key, TABLES[key], markdown.html(file.read_text(encoding="utf-8")))
            for key, file in m.tables.items()
        ],
        "extensions": extensions,
        "evidence": [
            (name, EXPERIMENTS[name].about if name in EXPERIMENTS else "", _read(name, m), _table(file))
            for name, file in m.evidence.items()
        ],
        "unresolved": UNRESOLVED,
        "explorers": m.explorers,
        "environment": m.environment,
        "source": m.source,
        "stand_in": STAND_IN if m.source == "rendered" else "",
        "colours": COLOURS,
    }


def _places(m: Material) -> dict[str, str]:
    """Where each evidence stands in the page; a figure, where an experiment has one of its name."""
    places = {name: f"evidence-{name}" for name in m.evidence} | {name: name for name in m.tables}
    return places | {key: f"figure-{key}" for key in m.figures}


def _figure(key: str, m: Material) -> dict[str, object]:
    figure, file = FIGURES[key], m.figures[key]
    image, stacked = file.read_bytes(), narrow(file).read_bytes()
    return {
        "key": key,
        "title": figure.title,
        "shows": figure.shows,
        "caption": caption(m.captions / f"{key}.rst", m.source, key in m.published),
        "image": base64.b64encode(image).decode("ascii"),
        # A figure of one column is as it is on a phone.
        "narrow": base64.b64encode(_small(stacked)).decode("ascii") if stacked != image else "",
        "files": [file.with_suffix(ending).name for ending in (".pdf", figure.numbers)],
        "claims": [row for row in m.rows if key in evidence_links(row["id"], m.figures)],
    }


def _small(png: bytes) -> bytes:
    """The picture with 256 colours, a third as large: the page holds every figure twice."""
    out = io.BytesIO()
    with Image.open(io.BytesIO(png)) as image:
        image.convert("RGB").quantize(256).save(out, "PNG", optimize=True)
    return out.getvalue()


def _read(name: str, m: Material) -> Markup:
    """How to read a table, where the captions have it."""
    file = m.captions / f"{name}.rst"
    return caption(file, m.source, published=False) if file.is_file() else Markup()


def _table(file: Path) -> Markup:
    if file.suffix == ".md":
        return markdown.html(file.read_text(encoding="utf-8"), SHOWN_ROWS)
    found = pd.read_csv(file, dtype=str, keep_default_na=False)
    shown = found.head(SHOWN_ROWS)
    return markdown.table(
        list(shown.columns),
        [[_short(cell) for cell in line] for line in shown.itertuples(index=False)],
        len(found) - len(shown),
    )


def _short(cell: str) -> str:
    """A number with the digits that a reader can use; the file has all."""
    try:
        return f"{float(cell):.4g}" if "." in cell or "e" in cell.lower() else cell
    except ValueError:
        return cell


def _text(name: str) -> str:
    return (Path(__file__).parent / name).read_text(encoding="utf-8")
