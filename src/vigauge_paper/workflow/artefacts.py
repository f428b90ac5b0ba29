"""The rules of tables and figures: a command each, with what it reads, settings and the paper's numbers."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from vigauge_paper.figures.registry import FIGURES
from vigauge_paper.ids import CONFIGURATIONS, FIGURE7_ORDER, TABLES

from .sequences import Sequences


@dataclass(frozen=True)
class Read:
    """Results behind a flag: their kind, the experiments, and whether the command wants NAME=FILE."""

    kind: str
    names: tuple[str, ...]
    named: bool = False


@dataclass(frozen=True)
class Artefact:
    """A command that makes a table or draws figures."""

    # Of the rule; module of vigauge_paper.commands.
    name: str
    command: str
    shows: Mapping[str, str]  # keys of its table or figures, by the flag of the file
    # What goes behind further flags.
    reads: Mapping[str, Read]
    settings: Mapping[str, Any] = field(default_factory=dict)
    published: tuple[str, ...] = ()  # files of the paper's numbers, none where they are not shown
    by_folder: bool = True  # whether the command wants their folder, not the file
    source: str = ""  # of the sequences shown, or empty
    numbers: Mapping[str, str] = field(
        default_factory=dict
    )  # keys of figures whose numbers it reads, by flag
    # A table that is made only when asked for, by flag; shown where someone has.
    aside: Mapping[str, str] = field(default_factory=dict)

    @property
    def title(self) -> str:
        """What a terminal says while it is made."""
        return ", ".join(TABLES[key] if key in TABLES else FIGURES[key].title for key in self.shows.values())

    @property
    def settings_line(self) -> str:
        """Flags that come from the configuration; a rule depends on them."""
        parts = []
        for flag, value in self.settings.items():
            parts += [f"--{flag}", *map(str, value if isinstance(value, list | tuple) else [value])]
        return shlex.join(parts)

    def files_line(self, wildcards: Any, input: Any) -> str:
        """Parameter of the rule: flags of the files that a job reads."""
        parts = []
        for flag, read in self.reads.items():
            files = list(getattr(input, flag))
            pairs = zip(read.names, files, strict=True) if read.named else ()
            parts += [f"--{flag}", *([f"{name}={file}" for name, file in pairs] or files)]
        for flag in self.numbers:
            parts += [f"--{flag}", str(getattr(input, flag))]
        if input.published:
            file = str(input.published[0])
            parts += ["--published", str(Path(file).parent)] if self.by_folder else ["--published-file", file]
        return shlex.join(parts)

    def outputs_line(self, wildcards: Any, output: Any) -> str:
        """Parameter of the rule: flags of the files that it makes."""
        return shlex.join(word for flag in self.shows for word in (f"--{flag}", getattr(output, flag)))


def artefacts(config: Mapping[str, Any], sequences: Sequences, spread: str) -> list[Artefact]:
    """All tables and figures under a configuration; ``spread`` is the table of harmless changes."""
    figures, reading, source = config["figures"], config["prior"]["reading"], sequences.source
    sweep, paper = (config["prior"]["sweep_configuration"],), sequences.of_the_paper
    hall, room = ((name,) for name in paper)
    scenes = tuple(figures["scenes"])
    show = figures["show_published"]
    # On sequences, the paper's numbers stand beside its own only.
    show_on_sequences = show and sequences.are_published

    def stems(*keys: str) -> tuple[str, ...]:
        return tuple(f"{FIGURES[key].stem}.csv" for key in keys)

    def cost(name: str, key: str, names: tuple[str, ...], made_from: str, theirs: Sequence[str]) -> Artefact:
        reads = {"solutions": Read("solutions", names, True), "timings": Read("timings", names, True)}
        beside = {"published-file": stems(key)[0], "published-names": list(theirs)} if theirs else {}
        shown = stems(key) if theirs else ()
        settings = {"source": made_from, **beside}
        return Artefact(
            name, "figure_cost", {"output": key}, reads, settings, shown, source=_shown(made_from)
        )

    def covariance(
        name: str, key: str, reads: Mapping[str, Read], kind: str, made_from: str, published: tuple[str, ...]
    ) -> Artefact:
        settings = {"kind": kind, "source": made_from}
        return Artefact(
            name, "figure_covariance", {"output": key}, reads, settings, published, False, _shown(made_from)
        )

    names = sequences.names
    return [
        Artefact(
            "table1", "tables", {"output": "table1"}, {"covariance": Read("covariances", sweep)}, {"table": 1}
        ),
        Artefact(
            "table2",
            "tables",
            {"output": "table2"},
            {"solutions": Read("solutions", tuple(CONFIGURATIONS), True)},
            {"table": 2},
            published=("table2.csv",) if show else (),
        ),
        Artefact(
            "table3",
            "tables",
            {"output": "table3"},
            {"solutions": Read("solutions", names, True), "reports": Read("reports", names, True)},
            {
                "table": 3,
                "source": source,
                "published-names": [f"{name}={theirs}" for name, theirs in sequences.published_names.items()],
            },
            numbers={"errors": "fig_errors"},
            aside={"spread": spread},
            published=("table3.csv",) if show else (),
            source=source,
        ),
        covariance(
            "figure_ellipses",
            "fig01",
            {"covariance": Read("covariances", hall), "beside": Read("covariances", room)},
            "ellipses",
            source,
            stems("fig01") if show_on_sequences else (),
        ),
        Artefact(
            "figure_orbit",
            "figure_orbit",
            {"paths": "fig02", "transformation": "fig08"},
            {"problems": Read("problems", sweep)},
            {
                "trial": figures["orbit_trial"],
                "prior-weight": figures["orbit_prior_weight"],
                "prior-reading": reading,
                "solver": json.dumps(config["solver"], sort_keys=True),
            },
        ),
        Artefact(
            "figure_scenes",
            "figure_scenes",
            {"output": "fig03"},
            {"truths": Read("truths", scenes), "paths": Read("paths", scenes)},
            {"names": scenes},
        ),
        Artefact(
            "figure_prior",
            "figure_prior",
            {"accuracy": "fig04", "cost": "fig05", "paths": "fig06"},
            {
                "sweep": Read("sweep", sweep),
                "timing": Read("sweep_timing", sweep),
                "trace": Read("sweep_trace", sweep),
            },
            {"path-weights": figures["path_weights"], "prior-reading": reading},
            stems("fig04", "fig05", "fig06") if show else (),
        ),
        cost("figure_simulation_cost", "fig07", FIGURE7_ORDER, "simulation", FIGURE7_ORDER if show else ()),
        covariance(
            "figure_covariance_simulation",
            "fig09",
            {"covariance": Read("covariances", sweep)},
            "matrices",
            "simulation",
            ("fig09.npz",) if show else (),
        ),
        covariance(
            "figure_covariance_sequence",
            "fig10",
            {"covariance": Read("covariances", room)},
            "matrices",
            source,
            ("fig10.npz",) if show_on_sequences else (),
        ),
        cost(
            "figure_sequence_cost",
            "fig11",
            paper,
            source,
            [sequences.published_names[name] for name in paper] if show_on_sequences else (),
        ),
        Artefact("figure_nees", "figure_nees", {"output": "nees"}, {"table": Read("reasons", ("nees",))}),
        Artefact(
            "figure_reading",
            "figure_reading",
            {"output": "prior_reading"},
            {"pulls": Read("reasons", ("reading",))},
        ),
        Artefact(
            "figure_errors",
            "figure_errors",
            {"output": "fig_errors"},
            {"covariances": Read("covariances", paper, True), "truths": Read("truths", paper, True)},
            {"source": source},
            source=source,
        ),
    ]


def _shown(made_from: str) -> str:
    """Source of sequences that a figure shows: a simulation shows none."""
    return "" if made_from == "simulation" else made_from
