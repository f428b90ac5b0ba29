"""What every stage of the pipeline does around its work: arguments, log file, exit status."""

from __future__ import annotations

import argparse
import errno
import inspect
import json
import logging
import os
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from threadpoolctl import threadpool_limits

from vigauge import __version__
from vigauge.errors import ConfigError, OutputError, VigaugeError
from vigauge.machine import versions
from vigauge.provenance import (
    Stamp,
    code_digest,
    digest_file,
    digest_of,
    digests,
    require_coherent,
    write_stamp,
)

EXIT_BAD_INPUT = 2

# The stages' own messages; libraries (fonts, images) are heard from warnings on.
LOG = logging.getLogger("vigauge")

T = TypeVar("T")

# What the operating system says where nothing can be written: no defect of the stage.
_REFUSED = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES, errno.EPERM, errno.EFBIG})

# Numbers depend on these; versions of what draws or schedules may change between results.
_NUMERICAL = ("python", "numpy", "scipy", "opencv-python-headless", "pycolmap")


@dataclass(frozen=True)
class Stamped:
    """What the stamp of a stage records; names are those of its options.

    ``config``: option to the key of the configuration that it carries, one value for all
    results; ``outputs`` and ``timings``: options that name files made, the latter different from
    run to run. ``sources`` lists files from outside the workflow, ``files`` further outputs.
    Whatever else is no path is a label of this job alone.
    """

    config: Mapping[str, str]
    outputs: tuple[str, ...] = ()
    timings: tuple[str, ...] = ()
    sources: Callable[[argparse.Namespace], list[Path]] = lambda options: []
    files: Callable[[argparse.Namespace], list[Path]] = lambda options: []


def _is_label(value: object) -> bool:
    """Whether an option's value is a setting and not a place: paths, also named ones, belong to a machine."""
    if isinstance(value, (list, tuple)):
        return all(_is_label(part) for part in value)
    return not isinstance(value, Path)


def stamp_of(
    work: Callable[..., None], options: argparse.Namespace, stamped: Stamped, inputs: Mapping[Path, Stamp]
) -> Stamp:
    """The stamp of a finished stage. ``inputs`` are the stamps of what it read, theirs included."""
    values = {name: value for name, value in vars(options).items() if name not in ("log", "stamp", "stamps")}
    folder = options.stamp.parent
    config = {key: values.pop(name) for name, key in stamped.config.items()}
    labels = {name: value for name, value in values.items() if _is_label(value)}
    modules = [m for name, m in sys.modules.items() if name.split(".")[0] == "vigauge" or name == "__main__"]
    seeds = {seed for stamp in inputs.values() for seed in stamp.seeds}
    seeds |= {s["seed"] for s in (*config.values(), *labels.values()) if isinstance(s, dict) and "seed" in s}
    return Stamp(
        stage=Path(inspect.getfile(work)).stem,
        version=__version__,
        code=code_digest(Path(module.__file__) for module in modules if module.__file__),
        packages={name: version for name, version in versions().items() if name in _NUMERICAL},
        config=config,
        config_sha256=digest_of(config),
        labels=labels,
        seeds=tuple(sorted(seeds)),
        inputs={
            Path(os.path.relpath(path, folder)).as_posix(): inputs[path].identity for path in options.stamps
        },
        sources={"/".join(path.parts[-2:]): digest_file(path) for path in sorted(stamped.sources(options))},
        outputs=digests([*(values[name] for name in stamped.outputs), *stamped.files(options)], folder),
        timings=digests([values[name] for name in stamped.timings], folder),
    )


class _LogFile(logging.FileHandler):
    """A log file that is given up, with one line on the terminal, once it cannot be written."""

    def handleError(self, record: logging.LogRecord) -> None:
        LOG.removeHandler(self)
        LOG.warning("%s: the log cannot be written: %s", self.baseFilename, sys.exc_info()[1])


def _log_file(path: Path) -> logging.Handler:
    """A handler that writes the log, or OutputError where it cannot be written."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        return _LogFile(path, mode="w")
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error.strerror}") from error


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
    out.add_argument(
        "--stamps",
        type=Path,
        nargs="*",
        default=[],
        help="stamps of what is read, refused where mixed",
    )
    return out


def run(
    work: Callable[[argparse.Namespace], None],
    arguments: argparse.ArgumentParser,
    stamped: Stamped | None = None,
    *,
    defect_status: int = 1,
) -> None:
    """Run a stage: bad input and results that cannot be written are one line and exit status 2.

    Results that ``--stamps`` names are refused where they do not belong together; with
    ``stamped``, ``--stamp`` writes the stamp of what this stage made. Any other exception is a
    defect: its traceback goes to the terminal and the log, and the exit status is ``defect_status``.
    BLAS runs on one thread in every stage.
    """
    if stamped is not None:
        arguments.add_argument("--stamp", type=Path, help="output: what the results were made from")
    options = arguments.parse_args()
    logging.basicConfig(level=logging.WARNING, format="%(message)s", force=True)
    LOG.setLevel(logging.INFO)
    try:
        if options.log:
            LOG.addHandler(_log_file(options.log))
        inputs = require_coherent(options.stamps)
        # At these sizes several threads of BLAS are slower than one, and sums depend on their number.
        with threadpool_limits(limits=1, user_api="blas"):
            work(options)
        if stamped is not None and options.stamp:
            write_stamp(options.stamp, stamp_of(work, options, stamped, inputs))
    except VigaugeError as error:
        LOG.error("error: %s", error)
        sys.exit(EXIT_BAD_INPUT)
    except OSError as error:
        if error.errno not in _REFUSED:
            LOG.exception("stage failed")
            sys.exit(defect_status)
        LOG.error("error: %s: cannot be written: %s", error.filename or "output", error.strerror)
        sys.exit(EXIT_BAD_INPUT)
    except Exception:
        LOG.exception("stage failed")
        sys.exit(defect_status)
