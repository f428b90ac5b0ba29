"""The source code that a stage runs, as one digest."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import grimp

import vigauge
from vigauge_paper.run.provenance import code_digest

# What the import graph tells of, and what Python makes of it.
_CODE = (".py", ".pyc", ".pyi", "")
# Folder of both packages: in a checkout they lie side by side.
SOURCE = Path(vigauge.__file__).resolve().parents[1]


@cache
def _import_graph() -> grimp.ImportGraph:
    return grimp.build_graph("vigauge", "vigauge_paper", cache_dir=None)


@cache
def code_of(stage: str) -> str:
    """Digest of the module of a stage's command, of all that it imports, and of data files beside packages.

    A rule has it among its parameters, so that an edit reruns the rules that use the module, and no
    others; a file that is only touched reruns none.
    """
    graph = _import_graph()
    # Both sides have a `covariance`; rules mean the artifact's wherever it has one.
    command = f"vigauge_paper.commands.{stage}"
    if command not in graph.modules:
        command = f"vigauge.cli.{stage}"
    stems = [SOURCE.joinpath(*m.split(".")) for m in {command} | graph.find_upstream_modules(command)]
    files = [stem / "__init__.py" if stem.is_dir() else stem.with_suffix(".py") for stem in stems]
    files += [file for stem in stems if stem.is_dir() for file in stem.iterdir() if file.suffix not in _CODE]
    return code_digest(file for file in files if file.is_file())
