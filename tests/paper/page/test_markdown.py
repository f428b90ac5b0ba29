"""Our own Markdown as HTML."""

from vigauge_paper.page.markdown import html, section
from vigauge_paper.tables import markdown


def test_what_the_tables_write_is_read() -> None:
    """Catches a table whose bars, bold cells or notes get lost between the two."""
    text = html(markdown([{"a": "**x** | y", "b": 0.12345}], note="a `note`", head="head <1>"))
    assert "<p>head &lt;1&gt;</p>" in text and "<p>a <code>note</code></p>" in text
    assert "<td><strong>x</strong> | y</td><td>0.1235</td>" in text
    assert '<th scope="col">a</th>' in text


def test_long_tables_are_cut_and_say_so() -> None:
    text = html(markdown([{"a": k} for k in range(5)]), rows=3)
    assert text.count("<td>") == 3 and "and 2 more rows in the file" in text


def test_a_section_ends_where_the_next_begins() -> None:
    text = "# Top\n\n## One\n\nfirst\n\n## Two\n\nsecond\n"
    assert (
        section(text, "One") == "first" and section(text, "Two") == "second" and section(text, "Three") == ""
    )
