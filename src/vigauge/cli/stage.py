"""What every stage of the pipeline does around its work: arguments, log file, exit status."""

from __future__ import annotations

import argparse
import json
import logging
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from vigauge.errors import ConfigError, VigaugeError

EXIT_BAD_INPUT = 2

# The stages' own messages; libraries (fonts, images) are heard from warnings on.
LOG = logging.getLogger("vigauge")

T = TypeVar("T")


def json_argument(text: str) -> dict[str, Any]:
    """A section of the configuration, given as JSON on the command line."""
    try:
        value = json.loads(text)
    except json.JSONDecodeError as error:
        raise argparse.ArgumentTypeError(f"must be JSON: {error}") from error
    if not isinstance(value, dict):
        raise argparse.ArgumentTypeError(f"must be a JSON object, not {type(value).__name__}")
    return value


def settings_from(kind: Callable[..., T], section: dict[str, Any], name: str) -> T:
    """A settings dataclass from a config section; ConfigError for unknown or missing keys."""
    try:
        return kind(**{k: tuple(v) if isinstance(v, list) else v for k, v in section.items()})
    except TypeError as error:
        raise ConfigError(f"config section '{name}'", str(error).removeprefix(f"{kind.__name__}.")) from error


def parser(description: str | None) -> argparse.ArgumentParser:
    """An argument parser with the flag that all stages share."""
    out = argparse.ArgumentParser(description=(description or "").split("\n\n")[0])
    out.add_argument("--log", type=Path, help="file that gets the log as well as the terminal")
    return out


def run(
    work: Callable[[argparse.Namespace], None], arguments: argparse.ArgumentParser, *, defect_status: int = 1
) -> None:
    """Run a stage: bad input is one line and exit status 2.

    Any other exception is a defect: its traceback goes to the terminal and the log, and the exit
    status is ``defect_status``.
    """
    options = arguments.parse_args()
    handlers: list[logging.Handler] = [logging.StreamHandler()]
    if options.log:
        options.log.parent.mkdir(parents=True, exist_ok=True)
        handlers.append(logging.FileHandler(options.log, mode="w"))
    logging.basicConfig(level=logging.WARNING, format="%(message)s", handlers=handlers, force=True)
    LOG.setLevel(logging.INFO)
    try:
        work(options)
    except VigaugeError as error:
        LOG.error("error: %s", error)
        sys.exit(EXIT_BAD_INPUT)
    except Exception:
        LOG.exception("stage failed")
        sys.exit(defect_status)
