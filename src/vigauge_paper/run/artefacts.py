"""What commands share: lists of named files, sections of the configuration, the published numbers."""

import argparse
from pathlib import Path
from typing import Any

from vigauge_paper.prior import READINGS
from vigauge_paper.run.stage import json_argument


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


def stem_of(text: str) -> Path:
    """Path without its ending: an artefact comes in several formats beside each other."""
    return Path(text).with_suffix("")


# What most flags are: one file or folder, NAME=FILE of several, an artefact without its ending.
FILE: dict[str, Any] = {"type": Path, "required": True}
NAMED: dict[str, Any] = {"type": named_file, "nargs": "+", "required": True}
STEM: dict[str, Any] = {"type": stem_of, "required": True}


def add_section(arguments: argparse.ArgumentParser, flag: str, section: str) -> None:
    """A flag that carries a section of the configuration as JSON."""
    arguments.add_argument(flag, type=json_argument, required=True, help=f"config section '{section}'")


def add_solver(arguments: argparse.ArgumentParser) -> None:
    """``--solver`` JSON: the Levenberg-Marquardt options."""
    add_section(arguments, "--solver", "solver")


def add_prior_information(arguments: argparse.ArgumentParser) -> None:
    """``--prior-information``, 1/m^2 and 1/rad^2."""
    arguments.add_argument(
        "--prior-information", type=float, required=True, help="of the prior, 1/m^2 and 1/rad^2"
    )


# Flags of :func:`add_prior` by the key of the configuration that they come from.
PRIOR_KEYS = {"prior_weight": "prior.weight", "prior_reading": "prior.reading"}


def add_prior(arguments: argparse.ArgumentParser) -> None:
    """``--prior-weight`` and ``--prior-reading``: w^P of Section V-A, and what it multiplies."""
    arguments.add_argument("--prior-weight", type=float, required=True, help="w^P of Section V-A")
    add_reading(arguments)


def add_reading(arguments: argparse.ArgumentParser) -> None:
    """``--prior-reading``: what a prior's weight multiplies."""
    arguments.add_argument(
        "--prior-reading", choices=READINGS, required=True, help="what a prior's weight multiplies"
    )


def add_published(arguments: argparse.ArgumentParser) -> None:
    """``--published FOLDER`` of the paper's numbers; without it nothing is compared."""
    arguments.add_argument(
        "--published", type=Path, help="folder of the published numbers to show beside ours"
    )


def add_published_names(arguments: argparse.ArgumentParser) -> None:
    """``--published-names``: which sequences are the paper's, and what it calls them."""
    arguments.add_argument(
        "--published-names",
        type=named_text,
        nargs="*",
        default=[],
        help="NAME=the paper's name of a sequence",
    )
