"""Which rule makes a kind of result: rules say what they read by kind and experiment, not by path."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vigauge_paper.experiments.registry import TIMED
from vigauge_paper.ids import CONFIGURATIONS
from vigauge_paper.run.provenance import digest_file

from .sequences import Sequences

# Sections of the configuration that results in paper_figures/ depend on.
_USED = ("simulation", "solver", "prior", "timing", "paper", "figures", "reasons", "claims")

# Kind: rule for a simulated configuration, rule for a sequence, name among the rule's outputs.
_PRODUCERS = {
    "problems": ("simulate", "front_end", "problems"),
    "truths": ("simulate", "front_end", "truth"),
    "reports": ("simulate", "front_end", "report"),
    "paths": ("simulate", "simulate", "path"),
    "solutions": ("solve", "solve", "solutions"),
    "traces": ("solve", "solve", "trace"),
    "states": ("solve", "solve", "states"),
    "covariances": ("covariance", "covariance", "covariance"),
    "distances": ("covariance", "covariance", "distances"),
    "timings": ("time_simulation", "time_sequences", "timing"),
    "machines": ("time_simulation", "time_sequences", "machine"),
    "sweep": ("prior_sweep", "prior_sweep", "sweep"),
    "sweep_timing": ("time_sweep", "time_sweep", "timing"),
    "sweep_trace": ("prior_sweep", "prior_sweep", "trace"),
}


def producer(kind: str, name: str) -> tuple[str, str]:
    """Rule that makes a kind of result of an experiment, and the name that the result has there."""
    if kind == "reasons":
        return ("reasons_time" if name in TIMED else "reasons"), "table"
    simulated, sequence, output = _PRODUCERS[kind]
    return simulated if name in CONFIGURATIONS else sequence, output


def where_made(flag: str, table: str) -> str:
    """Flags that show what is only made when asked for, a sweep or a spread, where someone has made it.

    Not an input: whoever shows it would then make it.
    """
    stamp = Path(table).with_suffix(".stamp.json")
    there = Path(table).is_file() and stamp.is_file()
    return shlex.join([f"--{flag}", table, f"--{flag}-stamp", str(stamp)]) if there else ""


def digest_where_made(table: str) -> str:
    """Changes with the table, so that what shows it is written again; empty where nobody has made it."""
    return digest_file(Path(table)) if Path(table).is_file() else ""


def used_configuration(config: Mapping[str, Any], sequences: Sequences) -> str:
    """What results in paper_figures/ depend on, as JSON.

    Not where EuRoC lies, nor what is made only when asked for, nor sequences that are not used.
    """
    entries = {name: sequences.entries[name] for name in sequences.names}
    used = {key: config[key] for key in _USED} | {"sequences": entries}
    return json.dumps(used, sort_keys=True)
