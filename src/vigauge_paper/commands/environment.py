"""Record what the results were made with: versions, machine, configuration, commit, data sources.

Machine and versions are those that the timed solves recorded, not those of this command.
"""

import argparse
import hashlib
import json
import subprocess
from pathlib import Path
from typing import Any

from vigauge.cli.command import LOG
from vigauge.errors import DataError
from vigauge.files import write_json
from vigauge_paper.run.artefacts import FILE, NAMED
from vigauge_paper.run.stage import json_argument, parser, run


def commit_of(folder: Path) -> str:
    """Commit of the folder's checkout, marked where files differ from it, or why there is none."""
    command = ["git", "-C", str(folder), "describe", "--always", "--dirty", "--abbrev=40", "--exclude=*"]
    try:
        done = subprocess.run(command, check=False, capture_output=True, text=True)
    except OSError as error:
        return f"unknown: {error}"
    return done.stdout.strip() or f"unknown: {done.stderr.strip()}"


def _agreed(files: list[Path]) -> dict[str, Any]:
    """Machine, versions and steadiness of the timed solves; DataError where versions differ."""
    records: list[dict[str, Any]] = [json.loads(file.read_text(encoding="utf-8")) for file in files]
    for file, record in zip(files, records, strict=True):
        if record["versions"] != records[0]["versions"]:
            raise DataError(file, f"versions must be those of {files[0]}", value=record["versions"])
        if record["machine"]["processor"] != records[0]["machine"]["processor"]:
            LOG.warning("%s was timed on another processor than %s", file, files[0])
    return records[0] | {
        "speed": {file.stem: record["speed"] for file, record in zip(files, records, strict=True)}
    }


def work(options: argparse.Namespace) -> None:
    config = json.dumps(options.config, sort_keys=True).encode()
    reports = {name: json.loads(file.read_text(encoding="utf-8")) for name, file in options.reports}
    write_json(
        options.output,
        {
            **_agreed(options.timings),
            "seed": options.config["simulation"]["seed"],
            "config_sha256": hashlib.sha256(config).hexdigest(),
            "commit": commit_of(options.checkout),
            "sequences": {
                name: {"source": options.source, "truth": report["truth"], "biases": report["biases"]}
                for name, report in reports.items()
            },
        },
    )


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--config", type=json_argument, required=True, help="the whole configuration")
    arguments.add_argument("--checkout", **FILE, help="folder of the project")
    arguments.add_argument("--source", choices=("euroc", "rendered"), required=True)
    arguments.add_argument("--reports", **NAMED, help="NAME=report.json")
    arguments.add_argument("--timings", **FILE, nargs="+", help="JSON of the timed solves")
    arguments.add_argument("--output", **FILE)
    run(work, arguments)


if __name__ == "__main__":
    main()
