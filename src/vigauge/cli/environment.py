"""Record what the results were made with: versions, machine, configuration, commit, data sources."""

from __future__ import annotations

import argparse
import hashlib
import json
import subprocess
from pathlib import Path

from threadpoolctl import threadpool_limits

from vigauge.cli.stage import json_argument, parser, run
from vigauge.files import write_json
from vigauge.machine import describe_machine, versions


def commit_of(folder: Path) -> str:
    """Commit that the folder's checkout stands at, marked where files differ from it."""
    command = ["git", "-C", str(folder), "describe", "--always", "--dirty", "--abbrev=40", "--exclude=*"]
    try:
        return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return "not a git checkout"


def work(options: argparse.Namespace) -> None:
    config = json.dumps(options.config, sort_keys=True).encode()
    with threadpool_limits(limits=1):
        machine = describe_machine()
    write_json(
        options.output,
        {
            "versions": versions(),
            "machine": machine,
            "seed": options.config["simulation"]["seed"],
            "config_sha256": hashlib.sha256(config).hexdigest(),
            "commit": commit_of(options.checkout),
            "sequences": dict(entry.split("=", 1) for entry in options.sequence),
        },
    )


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--config", type=json_argument, required=True, help="the whole configuration")
    arguments.add_argument("--checkout", type=Path, required=True, help="folder of the project")
    arguments.add_argument("--sequence", action="append", default=[], help="NAME=euroc or NAME=rendered")
    arguments.add_argument("--output", type=Path, required=True)
    run(work, arguments)


if __name__ == "__main__":
    main()
