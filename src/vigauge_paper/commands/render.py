"""Render a stand-in for an image sequence, as an ASL folder. It is not EuRoC and says so."""

import argparse
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from vigauge.cli.command import LOG
from vigauge_paper.run.artefacts import FILE
from vigauge_paper.run.machine import versions
from vigauge_paper.run.progress import progress
from vigauge_paper.run.stage import Stamped, json_argument, parser, run, settings_from
from vigauge_paper.stand_in.asl_folder import write_asl_folder
from vigauge_paper.stand_in.rendering import SCENES, RenderSettings, render_sequence


def work(options: argparse.Namespace) -> None:
    settings = settings_from(RenderSettings, options.settings, "rendered scene")
    sequence = render_sequence(options.scene, settings)
    name = f"rendered_{options.scene}"

    def bar(images: Iterable[Any], total: int) -> Iterable[Any]:
        return progress(images, name, "frame", total)

    write_asl_folder(sequence, options.scene, options.output / name, versions(), bar)
    LOG.info("%s: %d stereo frames", name, len(sequence.frame_ns))


def rendered_files(options: argparse.Namespace) -> list[Path]:
    """What was made: the sequence's folder and what is said about it."""
    folder = options.output / f"rendered_{options.scene}"
    return [folder / "mav0", folder / "rendered.json"]


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--scene", choices=sorted(SCENES), required=True)
    arguments.add_argument("--output", **FILE, help="folder in which rendered_<scene> is made")
    arguments.add_argument("--settings", type=json_argument, default={}, help="section 'scene' of a stand-in")
    run(work, arguments, Stamped({}, files=rendered_files))


if __name__ == "__main__":
    main()
