"""What tests of single figures share."""

import importlib

import pytest
from matplotlib.figure import Figure

from vigauge_paper import figures
from vigauge_paper.figures.registry import FIGURES


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    """The figures that are drawn, laid out but not written."""
    found: list[Figure] = []

    def keep(figure: Figure, stem: object) -> None:
        figure.draw_without_rendering()
        found.append(figure)

    for module in {figure.module for figure in FIGURES.values()}:
        drawing = importlib.import_module(f"{figures.__name__}.{module}")
        monkeypatch.setattr(drawing, "save_figure", keep)
    return found
