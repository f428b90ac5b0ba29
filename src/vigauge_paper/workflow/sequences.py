"""The image sequences of a configuration: EuRoC's or the stand-ins, their windows and harmless changes."""

from __future__ import annotations

import copy
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vigauge.errors import ConfigError
from vigauge_paper.ids import CONFIGURATIONS

EUROC, RENDERED = "euroc", "rendered"
# What the ledger is told where the sequences are recordings, but not the paper's.
OTHER = "other"
_STAND_IN_TRUTH = ["state_groundtruth_estimate0"]
_RENDERED_FOLDER = "data/rendered"

Entry = Mapping[str, Any]


@dataclass(frozen=True)
class Sequences:
    """Sequences by the names under which results are kept; a stand-in never has EuRoC's."""

    root: str  # folder that holds EuRoC's sequences; empty where stand-ins are rendered
    # Of sequences, windows and changed sequences: folder, ground truths, front-end, noise.
    entries: Mapping[str, Entry]
    # The sequences themselves; parts of them.
    names: tuple[str, ...]
    windows: tuple[str, ...]
    spread: Mapping[str, list[str]]  # each sequence, first itself, with its harmless changes
    # Each sequence, first itself, with its forms that take nothing from a ground truth.
    no_truth: Mapping[str, list[str]]
    # Those in the place of the paper's MH1 and VI1.
    machine_hall: str
    vicon_room: str
    # What the paper calls those that are its own; a stand-in is none of them.
    published_names: Mapping[str, str]

    @classmethod
    def of(cls, config: Mapping[str, Any], root: str) -> Sequences:
        """Those of a configuration that its schema allows; ConfigError where names do not fit together."""
        euroc = config["euroc"]["sequences"]
        used = config["euroc"].get("only") or list(euroc)
        for key in used:
            _require_among("euroc.only", key, euroc)
        for role, key in config["paper"].items():
            _require_among(f"paper.{role}", key, used)
        names = {key: key if root else f"rendered_{euroc[key]['stand_in']}" for key in used}
        recorded = euroc if root else _stand_ins(config["rendered"])
        entries = {name: recorded[key if root else euroc[key]["stand_in"]] for key, name in names.items()}
        hall, room = (names[config["paper"][role]] for role in ("machine_hall", "vicon_room"))
        if hall == room:
            rule = f"must name two different sequences (both are {room})"
            raise ConfigError("configuration", rule, field="paper")
        # Windows and changed sequences are sequences: what an entry leaves out is that of the one it names.
        overlaid: dict[str, list[str]] = {"windows": [], "spread": [], "no_truth": []}
        for part, found in overlaid.items():
            for name, entry in config[part][EUROC if root else RENDERED].items():
                where = f"{part}.{EUROC if root else RENDERED}.{name}"
                _require_among(f"{where}.sequence", entry["sequence"], recorded)
                if name in (*entries, *CONFIGURATIONS):
                    rule = "must have another name than a sequence or configuration"
                    raise ConfigError("configuration", rule, field=where)
                if not root or entry["sequence"] in used:
                    entries[name] = _laid_over(recorded[entry["sequence"]], entry)
                    found.append(name)

        def forms(part: str) -> dict[str, list[str]]:
            of = {name: recorded[entries[name]["sequence"]] for name in overlaid[part]}
            return {name: [name, *(c for c in of if of[c] is entries[name])] for name in names.values()}

        return cls(
            root=root,
            entries=entries,
            names=tuple(names.values()),
            windows=tuple(overlaid["windows"]),
            spread=forms("spread"),
            no_truth=forms("no_truth"),
            machine_hall=hall,
            vicon_room=room,
            published_names={
                key: euroc[key]["published"] for key in used if root and "published" in euroc[key]
            },
        )

    @property
    def source(self) -> str:
        """Where the sequences are from."""
        return EUROC if self.root else RENDERED

    @property
    def of_the_paper(self) -> tuple[str, str]:
        """Those in the place of the paper's two."""
        return self.machine_hall, self.vicon_room

    @property
    def are_published(self) -> bool:
        """Whether the paper's two are there: only beside them stand its numbers."""
        return set(self.of_the_paper) <= set(self.published_names)

    @property
    def source_of_claims(self) -> str:
        """What the ledger takes the sequences for: its claims are judged on the paper's only."""
        return self.source if self.are_published or not self.root else OTHER

    def folder(self, name: str) -> str:
        """ASL folder of a sequence: below the EuRoC root, or of the stand-in that is rendered."""
        return str(Path(self.root or _RENDERED_FOLDER, self.entries[name]["folder"]))

    def truth(self, name: str, purpose: str = "truth") -> str:
        """The first of the configured ground-truth folders that the sequence has.

        Where none exists the first is named, so that Snakemake reports it as missing.
        """
        mav0, choices = Path(self.folder(name), "mav0"), self.entries[name][purpose]
        existing = [choice for choice in choices if (mav0 / choice / "data.csv").is_file()]
        return str(mav0 / (existing or choices)[0])

    def biases(self, name: str) -> str:
        """The same, of the known biases."""
        return self.truth(name, "biases")

    def truth_names(self, name: str) -> list[str]:
        """Names of the ground-truth folders that a sequence's results rest on."""
        return sorted({Path(folder).name for folder in (self.truth(name), self.biases(name))})

    def files(self, name: str) -> list[str]:
        """The files whose change makes a sequence's problem stale (images are named by data.csv)."""
        folder = Path(self.folder(name))
        if not self.root:
            return [str(folder / "rendered.json")]
        files = [(s, f) for s in ("cam0", "cam1", "imu0") for f in ("data.csv", "sensor.yaml")]
        files += [(truth, "data.csv") for truth in self.truth_names(name)]
        return [str(folder.joinpath("mav0", *parts)) for parts in files]

    def stamps(self, name: str) -> list[str]:
        """Stamps of what a sequence was made from: a stand-in has one, a recording comes from outside."""
        return [] if self.root else [f"{self.folder(name)}/stamp.json"]

    def front_end(self, name: str) -> str:
        """Settings of the front-end, as JSON."""
        return json.dumps(self.entries[name]["front_end"], sort_keys=True)

    def noise_of(self, wildcards: Any) -> str:
        """Noise models of a job's experiment, as JSON; a simulated configuration has none."""
        entry = self.entries.get(wildcards.experiment, {})
        return json.dumps(entry.get("noise", {}), sort_keys=True)

    def accepts_of(self, wildcards: Any, input: Any) -> str:
        """A window that the check refuses goes on, to be told of in the table of windows."""
        return f"--accept-refusal {input.checked}" if wildcards.sequence in self.windows else ""

    def window(self, name: str) -> tuple[float, float, int]:
        """Begin and end of the part that the front-end looks at, s, and what they count from, ns."""
        keyframes = self.entries[name]["front_end"].get("keyframes", {})
        window = {"window_start_s": 0.0, "window_end_s": 1e6, "window_origin_ns": 0} | keyframes
        return window["window_start_s"], window["window_end_s"], window["window_origin_ns"]

    def check_flags(self, name: str) -> str:
        """Flags of the check: the part to look at, and faults with which the rules go on.

        Windows go on with every fault: their table says which were refused, and why.
        """
        start_s, end_s, origin_ns = self.window(name)
        offset_ns = self.entries[name]["front_end"].get("camera_time_offset_ns", 0)
        accepts = "--accept-errors" if name in self.windows else "--accept-warnings"
        window = f"--window {start_s} {end_s} --origin-ns {origin_ns} --camera-time-offset-ns {offset_ns}"
        return f"{window} {self.sort_flag(name)} {accepts}"

    def check(self, name: str) -> str:
        """Report of the check of a sequence; where it would look at the same as for another, that one's."""

        def looked_at(one: str) -> tuple[str, list[str], str]:
            return self.folder(one), self.truth_names(one), self.check_flags(one)

        first = next(one for one in self.entries if looked_at(one) == looked_at(name))
        return f"data/checks/{first}.json"

    def sort_flag(self, name: str) -> str:
        """Allows rows out of order in a sequence's files, where the configuration does."""
        return "--sort" if self.entries[name].get("sort", False) else ""

    def windows_shown(self) -> str:
        """What the table of windows says of each, as JSON."""
        shown = {}
        for name in self.windows:
            start_s, end_s, _ = self.window(name)
            shown[name] = {"start_s": start_s, "end_s": end_s, "truth": Path(self.truth(name)).name}
        return json.dumps(shown)


def _require_among(field: str, key: str, known: Mapping[str, Any] | list[str]) -> None:
    if key not in known:
        raise ConfigError("configuration", f"must be one of {', '.join(known)}", field=field, value=key)


def _stand_ins(rendered: Mapping[str, Entry]) -> dict[str, Entry]:
    truth = {"truth": _STAND_IN_TRUTH, "biases": _STAND_IN_TRUTH}
    return {scene: {"folder": f"rendered_{scene}", **truth, **entry} for scene, entry in rendered.items()}


def _laid_over(base: Entry, over: Entry) -> dict[str, Any]:
    """An entry with what another says instead."""
    out = copy.deepcopy(dict(base))
    for key, value in over.items():
        both = isinstance(value, Mapping) and isinstance(out.get(key), Mapping)
        out[key] = _laid_over(out[key], value) if both else value
    return out
