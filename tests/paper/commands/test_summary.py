"""The summary that goes into docs/paper.md."""

import pytest

from vigauge_paper.commands.summary import _marked


@pytest.mark.parametrize(
    ("note", "marked"),
    [
        ("RMSE in m; means over 50 trials. Bold: the smaller.", ""),
        (
            "RMSE. Left out, as they did not converge: 2 of arc.",
            " Left out, as they did not converge: 2 of arc.",
        ),
        ("RMSE. Degenerate: 1 of arc fix.", " Degenerate: 1 of arc fix."),
        ("A. Left out, as: 2. Degenerate: 1.", " Left out, as: 2. Degenerate: 1."),
    ],
)
def test_failures_of_the_tables_are_passed_on(note: str, marked: str) -> None:
    """Means on the page without the runs that are missing from them."""
    assert _marked(f"| a |\n|---|\n| 1 |\n\n{note}\n") == marked
