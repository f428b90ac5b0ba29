"""The list of figures: nothing draws a figure that is not in it, and nothing in it is missing."""

import importlib
import pkgutil

from support import ROOT
from vigauge_paper import figures
from vigauge_paper.figures.registry import FIGURES

# What several figures share, and the figure of an experiment that is none of the paper's.
SHARED = {"chart", "narrow", "registry", "statistics", "style"}


def test_every_module_draws_a_listed_figure() -> None:
    """Catches a module that nobody can find from the list, and a figure whose module has gone."""
    modules = {module.name for module in pkgutil.iter_modules(figures.__path__)}
    assert modules - SHARED == {figure.module for figure in FIGURES.values()}
    for figure in FIGURES.values():
        module = importlib.import_module(f"{figures.__name__}.{figure.module}")
        assert any(name.startswith("draw_") for name in vars(module)), figure.key


def test_every_figure_has_a_caption_with_its_title() -> None:
    """Catches a caption that is left out, or stands under another figure."""
    for key, figure in FIGURES.items():
        assert figure.key == key and f"{figure.stem}_".startswith(f"{key}_")
        text = (ROOT / "workflow" / "report" / f"{key}.rst").read_text("utf-8")
        assert text.startswith((f"{figure.title}.", f"{figure.title},")), key
    captions = {file.stem for file in (ROOT / "workflow" / "report").glob("fig*.rst")}
    assert captions == {key for key in FIGURES if key.startswith("fig")}
