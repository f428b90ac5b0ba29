"""The rules that draw figures: one command each, with what it reads, its settings and the paper's numbers."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from vigauge_paper.figures.registry import FIGURES
from vigauge_paper.ids import FIGURE7_ORDER

from .sequences import Sequences


@dataclass(frozen=True)
class Read:
    """Results behind a flag: their kind, the experiments, and whether the command wants NAME=FILE."""

    kind: str
    names: tuple[str, ...]
    named: bool = False


@dataclass(frozen=True)
class Drawing:
    """A command that draws figures.

    Attributes
    ----------
    name, command : of the rule; module of vigauge_paper.commands
    figures : keys of the figures, by the flag of their image
    reads, settings : what goes behind further flags
    published : files of the paper's numbers, none where they are not shown
    by_folder : whether the command wants their folder, not the file
    source : of the sequences shown, or empty
    """

    name: str
    command: str
    figures: Mapping[str, str]
    reads: Mapping[str, Read]
    settings: Mapping[str, Any] = field(default_factory=dict)
    published: tuple[str, ...] = ()
    by_folder: bool = True
    source: str = ""

    @property
    def title(self) -> str:
        """What a terminal says while it is drawn."""
        return ", ".join(FIGURES[key].title for key in self.figures.values())

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
        if input.published:
            file = str(input.published[0])
            parts += ["--published", str(Path(file).parent)] if self.by_folder else ["--published-file", file]
        return shlex.join(parts)

    def images_line(self, wildcards: Any, output: Any) -> str:
        """Parameter of the rule: flags of the images that it draws."""
        return shlex.join(word for flag in self.figures for word in (f"--{flag}", getattr(output, flag)))


def drawings(config: Mapping[str, Any], sequences: Sequences) -> list[Drawing]:
    """All that are drawn, under a configuration."""
    figures, reading, source = config["figures"], config["prior"]["reading"], sequences.source
    sweep, paper = (config["prior"]["sweep_configuration"],), sequences.of_the_paper
    hall, room = ((name,) for name in paper)
    scenes = tuple(figures["scenes"])
    show = figures["show_published"]
    # On sequences, the paper's numbers stand beside its own only.
    show_on_sequences = show and sequences.are_published

    def stems(*keys: str) -> tuple[str, ...]:
        return tuple(f"{FIGURES[key].stem}.csv" for key in keys)

    def cost(name: str, key: str, names: tuple[str, ...], made_from: str, theirs: Sequence[str]) -> Drawing:
        reads = {"solutions": Read("solutions", names, True), "timings": Read("timings", names, True)}
        beside = {"published-file": stems(key)[0], "published-names": list(theirs)} if theirs else {}
        shown = stems(key) if theirs else ()
        settings = {"source": made_from, **beside}
        return Drawing(name, "figure_cost", {"output": key}, reads, settings, shown, source=_shown(made_from))

    def covariance(
        name: str, key: str, reads: Mapping[str, Read], kind: str, made_from: str, published: tuple[str, ...]
    ) -> Drawing:
        settings = {"kind": kind, "source": made_from}
        return Drawing(
            name, "figure_covariance", {"output": key}, reads, settings, published, False, _shown(made_from)
        )

    return [
        covariance(
            "figure_ellipses",
            "fig01",
            {"covariance": Read("covariances", hall), "beside": Read("covariances", room)},
            "ellipses",
            source,
            stems("fig01") if show_on_sequences else (),
        ),
        Drawing(
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
        Drawing(
            "figure_scenes",
            "figure_scenes",
            {"output": "fig03"},
            {"truths": Read("truths", scenes), "paths": Read("paths", scenes)},
            {"names": scenes},
        ),
        Drawing(
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
        Drawing("figure_nees", "figure_nees", {"output": "nees"}, {"table": Read("reasons", ("nees",))}),
        Drawing(
            "figure_reading",
            "figure_reading",
            {"output": "prior_reading"},
            {"pulls": Read("reasons", ("reading",))},
        ),
        Drawing(
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
