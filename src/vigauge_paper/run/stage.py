"""What every stage of the pipeline does around its work: arguments, log file, exit status."""

import argparse
import inspect
import json
import os
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from vigauge import __version__
from vigauge.cli import command
from vigauge.errors import ConfigError
from vigauge_paper.run.machine import versions
from vigauge_paper.run.provenance import (
    Stamp,
    code_digest,
    digest_file,
    digests,
    require_coherent,
    write_stamp,
)

T = TypeVar("T")

# Numbers depend on these; versions of what draws or schedules may change between results.
_NUMERICAL = ("python", "numpy", "scipy", "opencv-python-headless", "pycolmap")


@dataclass(frozen=True)
class Stamped:
    """What the stamp of a stage records; names are those of its options.

    ``config`` maps an option to the key of the configuration that it carries. ``outputs`` and
    ``timings`` are options that name files made; timings differ from run to run. ``sources``
    lists files from outside the workflow, ``files`` further outputs. Every other option that
    is no path becomes a label of this job.
    """

    config: Mapping[str, str]
    outputs: tuple[str, ...] = ()
    timings: tuple[str, ...] = ()
    sources: Callable[[argparse.Namespace], list[Path]] = lambda options: []
    files: Callable[[argparse.Namespace], list[Path]] = lambda options: []


def _is_label(value: object) -> bool:
    """Whether an option's value is a setting: paths, also named ones, differ between machines."""
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
    ours = ("vigauge", "vigauge_paper", "__main__")
    modules = [module for name, module in sys.modules.items() if name.split(".")[0] in ours]
    seeds = {seed for stamp in inputs.values() for seed in stamp.seeds}
    seeds |= {s["seed"] for s in (*config.values(), *labels.values()) if isinstance(s, dict) and "seed" in s}
    return Stamp(
        stage=Path(inspect.getfile(work)).stem,
        version=__version__,
        code=code_digest(Path(module.__file__) for module in modules if module.__file__),
        packages={name: version for name, version in versions().items() if name in _NUMERICAL},
        config=config,
        labels=labels,
        seeds=tuple(sorted(seeds)),
        inputs={
            Path(os.path.relpath(path, folder)).as_posix(): inputs[path].identity for path in options.stamps
        },
        sources={"/".join(path.parts[-2:]): digest_file(path) for path in sorted(stamped.sources(options))},
        outputs=digests([*(values[name] for name in stamped.outputs), *stamped.files(options)], folder),
        timings=digests([values[name] for name in stamped.timings], folder),
    )


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
    """An argument parser with the flags that all stages share."""
    out = command.parser(description)
    out.add_argument(
        "--stamps", type=Path, nargs="*", default=[], help="stamps of the inputs; mixtures are refused"
    )
    return out


def run(
    work: Callable[[argparse.Namespace], None],
    arguments: argparse.ArgumentParser,
    stamped: Stamped | None = None,
) -> None:
    """Run a stage with :func:`vigauge.cli.command.run`.

    Before it, inputs whose ``--stamps`` do not belong together are refused. After it, with
    ``stamped``, the stamp of what this stage made is written to ``--stamp``.
    """
    if stamped is not None:
        arguments.add_argument("--stamp", type=Path, help="output: what the results were made from")

    def between_stamps(options: argparse.Namespace) -> None:
        inputs = require_coherent(options.stamps)
        work(options)
        if stamped is not None and options.stamp:
            write_stamp(options.stamp, stamp_of(work, options, stamped, inputs))

    command.run(between_stamps, arguments)
