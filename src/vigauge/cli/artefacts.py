"""What the commands of tables and figures share: lists of named files, the published numbers."""

from __future__ import annotations

import argparse
from pathlib import Path

from vigauge.cli.stage import json_argument


def named_text(text: str) -> tuple[str, str]:
    """NAME=TEXT of the command line."""
    name, equals, value = text.partition("=")
    if not equals or not name or not value:
        raise argparse.ArgumentTypeError(f"must be NAME=VALUE, not {text!r}")
    return name, value


def named_file(text: str) -> tuple[str, Path]:
    """NAME=FILE of the command line."""
    name, file = named_text(text)
    return name, Path(file)


def add_solver(arguments: argparse.ArgumentParser) -> None:
    """``--solver`` JSON: the Levenberg-Marquardt options."""
    arguments.add_argument("--solver", type=json_argument, required=True, help="config section 'solver'")


def add_prior_weight(arguments: argparse.ArgumentParser, about: str = "w^P of Section V-A") -> None:
    """``--prior-weight``, 1/m^2 and 1/rad^2."""
    arguments.add_argument("--prior-weight", type=float, required=True, help=about)


def add_published(arguments: argparse.ArgumentParser) -> None:
    """``--published FOLDER`` of the paper's numbers; without it nothing is compared."""
    arguments.add_argument(
        "--published", type=Path, help="folder of the published numbers to show beside ours"
    )


def stem_of(text: str) -> Path:
    """Path without its ending: an artefact comes in several formats beside each other."""
    return Path(text).with_suffix("")
