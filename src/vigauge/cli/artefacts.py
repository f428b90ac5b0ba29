"""What the commands of tables and figures share: lists of named files, the published numbers."""

from __future__ import annotations

import argparse
from pathlib import Path


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


def add_published(arguments: argparse.ArgumentParser) -> None:
    """``--published FOLDER`` of the paper's numbers; without it nothing is compared."""
    arguments.add_argument(
        "--published", type=Path, help="folder of the published numbers to show beside ours"
    )


def stem_of(text: str) -> Path:
    """Path without its ending: an artefact comes in several formats beside each other."""
    return Path(text).with_suffix("")
