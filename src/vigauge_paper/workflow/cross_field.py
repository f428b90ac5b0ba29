"""Rules between keys of the configuration, which its schema cannot state: found before any job runs."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from vigauge.errors import ConfigError
from vigauge.recordings.frontend.settings import FrontEndSettings
from vigauge.solver.levenberg_marquardt import Options
from vigauge_paper.run.configuration import check_config

# Pairs of keys in one section, of which the first may not be above the second.
_ORDERED = (("minimum_views", "n_keyframes"), ("frame_spacing_min_s", "frame_spacing_max_s"))

Config = Mapping[str, Any]


def check_between_keys(config: Config, schema: Path) -> None:
    """Refuse a configuration whose keys contradict each other; ConfigError with key, value and rule."""
    simulation = config["simulation"]
    _check_order(simulation, "simulation")
    for scene, stand_in in config["rendered"].items():
        _check_order(stand_in["scene"], f"rendered.{scene}.scene")
    near, far = simulation["landmark_depth_m"]
    _require(near <= far, "simulation.landmark_depth_m", "must begin with the nearest", [near, far])
    sweep = config["prior"]["sweep_weights"]
    for weight in config["figures"]["path_weights"]:
        _require(weight in sweep, "figures.path_weights", "must be among prior.sweep_weights", weight)
    trial, trials = config["figures"]["orbit_trial"], simulation["n_trials"]
    _require(trial < trials, "figures.orbit_trial", f"must be below n_trials, {trials}", trial)
    for count in config["reasons"]["iteration_time"]["n_keyframes"]:
        rule = f"must not be below simulation.minimum_views, {simulation['minimum_views']}"
        _require(count >= simulation["minimum_views"], "reasons.iteration_time.n_keyframes", rule, count)
    for key, values in config["sensitivity"]["values"].items():
        _check_swept(config, key, values, schema)


def check_front_ends(entries: Mapping[str, Config]) -> None:
    """Refuse front-end settings that contradict each other, of sequences, windows and changes by name."""
    for name, entry in entries.items():
        FrontEndSettings.from_mapping(entry["front_end"], f"configuration, front-end of {name}")


def _check_swept(config: Config, key: str, values: list[str], schema: Path) -> None:
    """Every value of the sweep must be one that the configuration could have."""
    field = f"sensitivity.values.{key}"
    numbers = {**config["simulation"], **asdict(Options()), **config["solver"]}
    known = [name for name, number in numbers.items() if type(number) in (int, float)]
    _require(key in known, field, f"must be one of {', '.join(known)}", key)
    for value in values:
        changed = copy.deepcopy(dict(config))
        part = "simulation" if key in config["simulation"] else "solver"
        changed[part][key] = type(numbers[key])(float(value))
        check_config(changed, schema, f"configuration, {field} of {value}")
        _check_order(changed[part], part, f"configuration, {field} of {value}")


def _check_order(section: Config, field: str, file: str = "configuration") -> None:
    for low, high in _ORDERED:
        if low in section and high in section:
            rule = f"must not be above {high}, {section[high]}"
            _require(section[low] <= section[high], f"{field}.{low}", rule, section[low], file)


def _require(holds: bool, field: str, rule: str, value: object, file: str = "configuration") -> None:
    if not holds:
        raise ConfigError(file, rule, field=field, value=value)
