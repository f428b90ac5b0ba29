"""The site: Sphinx reads the pages as Markdown (MyST) and the API from the docstrings.

    make docs    # into build/docs

Nothing is fetched, neither for the build nor by a reader: formulas are MathML, and their font is in the site.
"""

from __future__ import annotations

import re
from enum import Enum
from pathlib import Path
from typing import Any

import latex2mathml.converter
import numpy as np
import numpy.typing
import ziamath
from docutils import nodes
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment
from sphinx.util.docutils import SphinxDirective

import vigauge


class _AnyArray:
    """An array in a signature is an ndarray: the docstring gives its shape and unit."""

    def __class_getitem__(cls, dtype: object) -> type[np.ndarray]:
        return np.ndarray


numpy.typing.NDArray = _AnyArray  # before the modules of vigauge, which load when first asked for

project, author, release = "vigauge", "The vigauge authors", vigauge.__version__
copyright = author
extensions = ["myst_parser", "sphinx.ext.autodoc"]
myst_enable_extensions = ["dollarmath", "amsmath"]
myst_heading_anchors = 3
autodoc_default_options = {"members": True}
autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
maximum_signature_line_length = 88
highlight_language = "text"
html_theme = "furo"
html_title = "vigauge"
html_math_renderer = "mathml"
html_static_path = ["_static", str(Path(ziamath.__file__).parent / "fonts")]
html_css_files = ["site.css"]
html_copy_source = html_show_sourcelink = False

# "name : meaning" in a section of a docstring becomes an entry of a list.
SECTION = re.compile(r"^(Attributes|Parameters|Returns|Raises|Yields)$")
ENTRY = re.compile(r"^(\*{0,2}\w[\w, .*]*?) : (.*)$")


class PublicNames(SphinxDirective):
    """All public names of one folder of the package, in the order of the package's own table."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        lines: list[str] = []
        for name, (module, _) in vigauge._PUBLIC.items():
            if module.split(".")[0] == self.arguments[0]:
                thing = getattr(vigauge, name)
                parents = thing.__mro__ if isinstance(thing, type) else ()
                kind = "exception" if Exception in parents else "class" if parents else "function"
                # A protocol is not called; members of an enumeration say what they mean by their names.
                call = "()" if getattr(thing, "_is_protocol", False) else ""
                lines.append(f".. auto{kind}:: vigauge.{name}{call}")
                lines += ["   :undoc-members:"] * (Enum in parents)
        return self.parse_text_to_nodes("\n".join(lines))


def docstring_sections(
    app: Sphinx, what: str, name: str, thing: object, options: object, lines: list[str]
) -> None:
    """Sections in the project's style (a name, a colon, its meaning) as reStructuredText; in place."""
    out: list[str] = []
    section = ""
    for line, following in zip(lines, [*lines[1:], ""], strict=True):
        if SECTION.match(line) and set(following) == {"-"}:
            section = line
            out += [f".. rubric:: {line}", ""]
        elif section and line and set(line) == {"-"}:
            continue
        elif section in ("Attributes", "Parameters") and (entry := ENTRY.match(line)):
            out.append(f"* **{entry[1]}**: {entry[2]}")
        elif section in ("Attributes", "Parameters") and line.startswith("    "):
            out.append(f"  {line.strip()}")
        elif section:  # running text: a line that goes on is no definition
            out.append(line.strip())
        else:
            out.append(line)
    lines[:] = out


def public_name(
    app: Sphinx, env: BuildEnvironment, node: pending_xref, content: nodes.Element
) -> nodes.Node | None:
    """A class is documented under its public name, whatever module an annotation finds it in."""
    name = node.get("reftarget", "").split(".")[-1]
    if name not in vigauge.__all__ or node.get("refdomain") != "py":
        return None
    domain = env.domains.python_domain
    return domain.resolve_xref(env, node["refdoc"], app.builder, "obj", f"vigauge.{name}", node, content)


def mathml(self: Any, node: nodes.math | nodes.math_block) -> None:
    """A formula as MathML, which browsers show without a script."""
    display = "block" if isinstance(node, nodes.math_block) else "inline"
    self.body.append(latex2mathml.converter.convert(node.astext(), display=display))
    raise nodes.SkipNode


def list_external_links(app: Sphinx, error: Exception | None) -> None:
    """Addresses outside the site that pages link to: listed, never fetched."""
    if error is None and app.builder.format == "html":
        found = {
            (node["refuri"], page)
            for page in app.env.found_docs
            for node in app.env.get_doctree(page).findall(nodes.reference)
            if re.match(r"\w+://", node.get("refuri", ""))
        }
        text = "".join(f"{address}  {page}\n" for address, page in sorted(found))
        Path(app.outdir, "external_links.txt").write_text(text, encoding="utf-8")


def setup(app: Sphinx) -> None:
    app.add_html_math_renderer("mathml", inline_renderers=(mathml, None), block_renderers=(mathml, None))
    app.add_directive("public-names", PublicNames)
    app.connect("autodoc-process-docstring", docstring_sections)
    app.connect("missing-reference", public_name)
    app.connect("build-finished", list_external_links)
