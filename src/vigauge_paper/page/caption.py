"""Captions of the figures, reStructuredText with Jinja as Snakemake's report has them, as HTML."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

from docutils.core import publish_parts
from jinja2 import Environment, StrictUndefined
from markupsafe import Markup

# A caption is text of ours: it reads no other file and includes no raw HTML.
_SETTINGS = {
    "file_insertion_enabled": False,
    "raw_enabled": False,
    "report_level": 5,
    "math_output": "MathML",
}


def caption(file: Path, source: str, published: bool) -> Markup:
    """The caption of a figure; ``published``: it shows the paper's numbers beside ours."""
    build = {"source": source, "claims": source, "published": published}
    snakemake = SimpleNamespace(
        config={"shown": {file.stem: build}},
        output=[file.stem],
        params=SimpleNamespace(published=published),
    )
    template = Environment(undefined=StrictUndefined).from_string(file.read_text(encoding="utf-8"))
    parts = publish_parts(template.render(snakemake=snakemake), writer="html5", settings_overrides=_SETTINGS)
    return Markup(parts["body"])
