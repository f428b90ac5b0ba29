"""The `vigauge` command: `vigauge check FOLDER`, `vigauge covariance FILE ...`, and others."""

from __future__ import annotations

import sys
from importlib import import_module

from vigauge.cli.command import EXIT_BAD_INPUT
from vigauge.errors import MissingExtraError

# Modules of this folder by the word that calls them, with what each does in a line.
COMMANDS = {
    "check": ("check_sequence", "check a recording in ASL (EuRoC) layout"),
    "covariance": ("covariance", "write the covariance of an estimate in a gauge to a file"),
    "diagnose": ("diagnose", "say what the measurements of an estimate determine"),
    "estimate": ("estimate", "estimate motion, biases and covariance from a recording"),
    "import-rosbag": ("import_rosbag", "turn a rosbag and Kalibr's calibration into an ASL folder"),
}


def main() -> None:
    word = sys.argv[1] if len(sys.argv) > 1 else ""
    if word not in COMMANDS:
        lines = [f"  vigauge {name:14s} {about}" for name, (_, about) in COMMANDS.items()]
        usage = "usage: vigauge COMMAND ...; `vigauge COMMAND --help` explains each"
        text = "\n".join([usage, "", *lines])
        if word in ("-h", "--help"):
            print(text)
            return
        print(text, file=sys.stderr)
        sys.exit(EXIT_BAD_INPUT)
    module, _ = COMMANDS[word]
    sys.argv = [f"vigauge {word}", *sys.argv[2:]]
    try:
        command = import_module(f"vigauge.cli.{module}")
    except MissingExtraError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(EXIT_BAD_INPUT)
    command.main()


if __name__ == "__main__":
    main()
