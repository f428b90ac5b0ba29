"""HTML of the Markdown that this artifact itself writes: headings, paragraphs, tables, bold, code."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import groupby

from markupsafe import Markup, escape

# A bar inside a cell is written as \|.
_BAR = re.compile(r"(?<!\\)\|")
_RULE = re.compile(r"^\|(-+\|)+$")


def html(text: str, rows: int | None = None) -> Markup:
    """The text as HTML; of longer tables only the first ``rows``, and how many are left out."""
    return Markup("\n").join(_blocks(text, rows))


def section(text: str, heading: str) -> str:
    """What stands below a heading of the second level, up to the next; empty where there is none."""
    found = re.search(rf"^## {re.escape(heading)}\n(.*?)(?=^## |\Z)", text, re.MULTILINE | re.DOTALL)
    return found[1].strip() if found else ""


def _blocks(text: str, rows: int | None) -> Iterator[Markup]:
    for is_table, group in groupby(text.splitlines(), key=lambda line: line.startswith("|")):
        if is_table:
            yield _table([_cells(line) for line in group if not _RULE.match(line)], rows)
            continue
        for paragraph in re.split(r"\n\s*\n", "\n".join(group).strip("\n")):
            if heading := re.match(r"(#+) (.*)", paragraph):
                # The page has headings of its own above these.
                yield Markup("<h4>{}</h4>").format(_inline(heading[2]))
            elif paragraph:
                yield Markup("<p>{}</p>").format(_inline(paragraph))


def _cells(line: str) -> list[str]:
    return [cell.strip().replace("\\|", "|") for cell in _BAR.split(line)[1:-1]]


def _inline(text: str) -> Markup:
    out = re.sub(r"\*\*(.+?)\*\*", r"<strong>\1</strong>", str(escape(text)))
    return Markup(re.sub(r"`(.+?)`", r"<code>\1</code>", out))


def table(head: Sequence[str], body: Sequence[Sequence[str]], left_out: int = 0) -> Markup:
    """A table that scrolls sideways where it is wider than the screen, with a line on rows left out."""
    row = Markup("<tr>{}</tr>")
    top = row.format(Markup("").join(Markup('<th scope="col">{}</th>').format(_inline(c)) for c in head))
    lines = Markup("\n").join(
        row.format(Markup("").join(Markup("<td>{}</td>").format(_inline(cell)) for cell in line))
        for line in body
    )
    rest = Markup("<p>and {} more rows in the file</p>").format(left_out) if left_out else Markup()
    return Markup(
        '<div class="scroll" tabindex="0" role="region" aria-label="table"><table><thead>{}</thead>'
        "<tbody>{}</tbody></table></div>{}"
    ).format(top, lines, rest)


def _table(lines: Sequence[list[str]], rows: int | None) -> Markup:
    head, *body = lines
    shown = body if rows is None else body[:rows]
    return table(head, shown, len(body) - len(shown))
