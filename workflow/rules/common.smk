"""What the other files of this folder share: names, sources of sequences, sections of the configuration."""

import copy
import hashlib
import json
import os
import re
import shlex
import sys
from functools import cache
from pathlib import Path

import grimp
from snakemake.exceptions import WorkflowError
from snakemake.utils import update_config

# This file's folder is workflow/rules, whichever of the two Snakefiles was started.
ROOT = Path(str(workflow.current_basedir)).resolve().parents[1]
SOURCE = ROOT / "src"
sys.path.insert(0, str(SOURCE))

from vigauge_paper.experiments.registry import TIMED, UNTIMED
from vigauge_paper.figures.registry import FIGURES
from vigauge_paper.ids import CONFIGURATIONS, FIGURE7_ORDER, POINTS, TABLES, TRAJECTORIES
from vigauge_paper.prior import information
from vigauge_paper.run.configuration import check_config
from vigauge.errors import ConfigError

try:
    check_config(config, ROOT / "workflow/schemas/config.schema.yaml", "configuration")
except ConfigError as error:
    raise WorkflowError(str(error))

# Rules run `python -m vigauge...` with the interpreter and the sources of this workflow.
# Where Snakemake deploys the software of a rule itself, the interpreter is that one's.
search = {"PYTHONPATH": f"{SOURCE}:{os.environ.get('PYTHONPATH', '')}".rstrip(":")}
if not workflow.deployment_settings.deployment_method:
    search["PATH"] = f"{Path(sys.executable).parent}:{os.environ.get('PATH', '')}"
exports = " ".join(f"{name}={shlex.quote(value)}" for name, value in search.items())
shell.prefix(f"set -euo pipefail; export {exports}; ".replace("{", "{{").replace("}", "}}"))

# More threads than any machine has: Snakemake cuts the number down to all of them, so a
# timing job runs alone. (`workflow.cores` would make `--unlock` ask for --cores.)
WHOLE_MACHINE = 1024

EUROC_ROOT = os.environ.get("EUROC_ROOT", "") or config["euroc"]["root"]
SOURCE_OF_SEQUENCES = "euroc" if EUROC_ROOT else "rendered"


def sequence_name(key):
    """Name under which results of a configured sequence are kept: a stand-in never has EuRoC's."""
    if EUROC_ROOT:
        return key
    stand_in = config["euroc"]["sequences"][key]["stand_in"]
    return f"rendered_{stand_in}"


# A configuration that is laid over another cannot take keys away, but it can choose.
USED = config["euroc"].get("only") or list(config["euroc"]["sequences"])
for role, key in [*(("euroc.only", key) for key in USED), *config["paper"].items()]:
    known = USED if role in config["paper"] else list(config["euroc"]["sequences"])
    if key not in known:
        where = f"paper.{role}" if role in config["paper"] else role
        raise WorkflowError(f"configuration, {where}: must be one of {', '.join(known)} (found {key!r})")
unswept = sorted(set(config["figures"]["path_weights"]) - set(config["prior"]["sweep_weights"]))
if unswept:
    raise WorkflowError(
        f"configuration, figures.path_weights: must be among prior.sweep_weights (found {unswept})"
    )

# As solves need it, and with both meanings of its weight.
PRIOR_INFORMATION = information(config["prior"]["weight"], config["prior"]["reading"])
PRIOR_FLAGS = f"--prior-weight {config['prior']['weight']} --prior-reading {config['prior']['reading']}"

# Folders below the root, which are also the names in data/euroc_sources.csv.
FETCHED = sorted({entry["folder"] for entry in config["euroc"]["sequences"].values()})
DOWNLOAD = config["euroc"]["download"]
EUROC_SOURCES = os.path.relpath(ROOT / "data/euroc_sources.csv")

SEQUENCE_KEYS = {sequence_name(key): key for key in USED}
SEQUENCES = list(SEQUENCE_KEYS)
MACHINE_HALL = sequence_name(config["paper"]["machine_hall"])
VICON_ROOM = sequence_name(config["paper"]["vicon_room"])
if MACHINE_HALL == VICON_ROOM:
    raise WorkflowError(f"configuration, paper: must name two different sequences (both are {VICON_ROOM})")

# Entries of sequences, whatever their source: folder, ground truths, front-end, noise.
RECORDINGS = EUROC_ROOT or "data/rendered"
STAND_IN_TRUTH = ["state_groundtruth_estimate0"]
RECORDED = (
    config["euroc"]["sequences"]
    if EUROC_ROOT
    else {
        scene: {"folder": f"rendered_{scene}", "truth": STAND_IN_TRUTH, "biases": STAND_IN_TRUTH, **entry}
        for scene, entry in config["rendered"].items()
    }
)
ENTRIES = {
    name: RECORDED[key if EUROC_ROOT else config["euroc"]["sequences"][key]["stand_in"]]
    for name, key in SEQUENCE_KEYS.items()
}
# Windows, and sequences with a harmless change, are sequences: what an entry leaves out is that of
# the sequence it names.
OVERLAID = {"windows": [], "spread": []}
for part, names in OVERLAID.items():
    for name, entry in config[part][SOURCE_OF_SEQUENCES].items():
        where = f"configuration, {part}.{SOURCE_OF_SEQUENCES}.{name}"
        if entry["sequence"] not in RECORDED:
            known = ", ".join(RECORDED)
            raise WorkflowError(f"{where}.sequence: must be one of {known} (found {entry['sequence']!r})")
        if name in (*ENTRIES, *CONFIGURATIONS):
            raise WorkflowError(f"{where}: must have another name than a sequence or configuration")
        if not EUROC_ROOT or entry["sequence"] in USED:
            ENTRIES[name] = copy.deepcopy(RECORDED[entry["sequence"]])
            update_config(ENTRIES[name], entry)
            names.append(name)
WINDOWS = OVERLAID["windows"]
# Each changed sequence by the one it is a change of, which comes first.
SPREAD = {
    name: [name, *(v for v in OVERLAID["spread"] if RECORDED[ENTRIES[v]["sequence"]] is ENTRIES[name])]
    for name in SEQUENCES
}
PAPER_SEQUENCES = [MACHINE_HALL, VICON_ROOM]
EXPERIMENTS = [*CONFIGURATIONS, *PAPER_SEQUENCES]
# Estimates of the gauge explorer, and their problems.
EXPLORED = {
    config["prior"][
        "sweep_configuration"
    ]: f"data/simulation/{config['prior']['sweep_configuration']}/problems.npz",
    **{name: f"data/sequences/{name}/problem.npz" for name in PAPER_SEQUENCES},
}
# Experiments that are timed in one process share a file.
TIMINGS = {name: "data/timing/simulation.csv" for name in CONFIGURATIONS} | {
    name: f"data/timing/{SOURCE_OF_SEQUENCES}.csv" for name in PAPER_SEQUENCES
}
TIMING_STAMPS = expand("data/timing/{name}.stamp.json", name=["simulation", SOURCE_OF_SEQUENCES])
# The paper's name for a sequence, where it is one of the paper's; a stand-in is none of them.
PUBLISHED_NAMES = {
    name: config["euroc"]["sequences"][key]["published"]
    for name, key in SEQUENCE_KEYS.items()
    if EUROC_ROOT and "published" in config["euroc"]["sequences"][key]
}
SEQUENCES_ARE_PUBLISHED = set(PAPER_SEQUENCES) <= set(PUBLISHED_NAMES)
# The paper's claims on sequences are judged on its sequences only.
SOURCE_OF_CLAIMS = SOURCE_OF_SEQUENCES if SEQUENCES_ARE_PUBLISHED or not EUROC_ROOT else "other"

# Of the checkout, also where results go elsewhere with --directory.
PUBLISHED_FOLDER = os.path.relpath(ROOT / "data/published")
WINDOWS_TABLE = "paper_figures/windows.md"
# Made by a target of its own; the ledger shows it where it is there.
SENSITIVITY = "data/sensitivity/summary.csv"
SENSITIVITY_STAMP = "data/sensitivity/summary.stamp.json"
SPREAD_TABLE = "data/spread/spread.csv"
SPREAD_STAMP = "data/spread/spread.stamp.json"
LEDGER_FILES = [
    "claims.csv",
    "claims.md",
    "index.html",
    "claims_why.csv",
    "claims_statistics.csv",
    "comparison.csv",
    "comparison.md",
    "summary.md",
    "environment.json",
]
SUMMARY_FILES = ["table2", "table3", *(FIGURES[key].stem for key in ("fig07", "fig11"))]
COMPARED_FILES = [
    *(f"{name}.csv" for name in ["table2", "table3"]),
    *(f"{FIGURES[key].stem}.csv" for key in ("fig01", "fig04", "fig05", "fig06", "fig07", "fig11")),
    "fig09.npz",
    "fig10.npz",
]
SHOW_PUBLISHED = config["figures"]["show_published"]
PUBLISHED_FLAG = f"--published {shlex.quote(PUBLISHED_FOLDER)}" if SHOW_PUBLISHED else ""
# Stand-ins and other sequences are not set beside the paper's EuRoC results.
FIGURE11_PUBLISHED = (
    f"{PUBLISHED_FLAG} --published-file {FIGURES['fig11'].stem}.csv"
    f" --published-names {' '.join(PUBLISHED_NAMES[name] for name in PAPER_SEQUENCES)}"
    if SHOW_PUBLISHED and SEQUENCES_ARE_PUBLISHED
    else ""
)


wildcard_constraints:
    trajectory="|".join(TRAJECTORIES),
    points="|".join(POINTS),
    configuration="|".join(CONFIGURATIONS),
    sequence="|".join(re.escape(name) for name in ENTRIES),
    scene="hall|room",
    experiment="|".join(TIMED),
    estimate="|".join(re.escape(name) for name in EXPLORED),
    fetched="|".join(re.escape(name) for name in FETCHED),
    parameter="|".join(config["sensitivity"]["values"]),
    value="[0-9.e-]+",


@cache
def import_graph():
    return grimp.build_graph("vigauge", "vigauge_paper", cache_dir=None)


@cache
def code_of(stage):
    """Source files that a stage runs: the module of its command and all that it imports.

    Given as inputs, so that an edit reruns the rules that use the module, and no others.
    """
    graph = import_graph()
    # Both sides have a `covariance`; rules mean the artifact's wherever it has one.
    command = f"vigauge_paper.commands.{stage}"
    if command not in graph.modules:
        command = f"vigauge.cli.{stage}"
    modules = {command} | graph.find_upstream_modules(command)
    stems = [SOURCE.joinpath(*module.split(".")) for module in modules]
    files = [stem / "__init__.py" if stem.is_dir() else stem.with_suffix(".py") for stem in stems]
    return sorted(os.path.relpath(file) for file in files if file.is_file())


def section(*keys):
    """A part of the configuration as JSON, for a command line; it is what a rule depends on."""
    value = config
    for key in keys:
        value = value[key]
    return json.dumps(value, sort_keys=True)


def sequence_section(name, part):
    """A part of the entry of a sequence, as JSON."""
    return json.dumps(ENTRIES[name][part], sort_keys=True)


def sequence_folder(name):
    """ASL folder of a sequence: below the EuRoC root, or of the stand-in that is rendered."""
    return str(Path(RECORDINGS, ENTRIES[name]["folder"]))


def explored_problems(wildcards):
    """The problem of an estimate of the gauge explorer."""
    return EXPLORED[wildcards.estimate]


def explored_truth(wildcards):
    return f"{os.path.dirname(explored_problems(wildcards))}/truth.npz"


def explored_stamps(wildcards):
    name, folder = wildcards.estimate, os.path.dirname(explored_problems(wildcards))
    return [f"{folder}/stamp.json", f"data/solutions/{name}/stamp.json", f"data/covariance/{name}.stamp.json"]


def explored_noise(wildcards):
    """Noise models of that estimate, as JSON; a simulated one has its own noise."""
    return sequence_section(wildcards.estimate, "noise") if wildcards.estimate in ENTRIES else "{}"


def noise_models(wildcards):
    """Noise models of a sequence, as JSON."""
    return sequence_section(wildcards.sequence, "noise")


def ground_truth_folder(name, purpose):
    """The first of the configured ground-truth folders that the sequence has.

    Where none exists the first is named, so that Snakemake reports it as missing.
    """
    mav0 = Path(sequence_folder(name), "mav0")
    choices = ENTRIES[name][purpose]
    existing = [choice for choice in choices if (mav0 / choice / "data.csv").is_file()]
    return str(mav0 / (existing or choices)[0])


def sequence_files(wildcards):
    """The files whose change makes a sequence's problem stale (images are named by data.csv)."""
    folder = Path(sequence_folder(wildcards.sequence))
    if not EUROC_ROOT:
        return [str(folder / "rendered.json")]
    sensors = [
        folder / "mav0" / sensor / file
        for sensor in ("cam0", "cam1", "imu0")
        for file in ("data.csv", "sensor.yaml")
    ]
    truths = {ground_truth_folder(wildcards.sequence, purpose) for purpose in ("truth", "biases")}
    return [*map(str, sensors), *sorted(f"{truth}/data.csv" for truth in truths)]


def stamps_of_sequence(wildcards):
    """Stamps of what a sequence was made from: a stand-in has one, a recording comes from outside."""
    return [] if EUROC_ROOT else [f"{sequence_folder(wildcards.sequence)}/stamp.json"]


def front_end_folder(wildcards):
    return sequence_folder(wildcards.sequence)


def front_end_truth(wildcards):
    return ground_truth_folder(wildcards.sequence, "truth")


def front_end_biases(wildcards):
    return ground_truth_folder(wildcards.sequence, "biases")


def front_end_settings(wildcards):
    """Settings of a sequence's front-end, as JSON."""
    return sequence_section(wildcards.sequence, "front_end")


def truth_names(wildcards):
    """Ground-truth folders that a sequence's results rest on."""
    return sorted({Path(ground_truth_folder(wildcards.sequence, use)).name for use in ("truth", "biases")})


def check_window(wildcards):
    """The part of a recording that a front-end looks at, as flags of its check."""
    front_end = ENTRIES[wildcards.sequence]["front_end"]
    start_s, end_s, origin_ns = window_of(front_end)
    offset_ns = front_end.get("camera_time_offset_ns", 0)
    return f"--window {start_s} {end_s} --origin-ns {origin_ns} --camera-time-offset-ns {offset_ns}"


def window_of(front_end):
    """Begin and end of the part of a recording that a front-end looks at, s, and what they count from, ns."""
    window = {"window_start_s": 0.0, "window_end_s": 1e6, "window_origin_ns": 0} | front_end.get(
        "keyframes", {}
    )
    return window["window_start_s"], window["window_end_s"], window["window_origin_ns"]


def sort_flag(wildcards):
    """Allows rows out of order in a sequence's files, where the configuration does."""
    return "--sort" if ENTRIES[wildcards.sequence].get("sort", False) else ""


def check_accepts(wildcards):
    """Faults with which the rules go on: the table of windows says which were refused, and why."""
    return "--accept-errors" if wildcards.sequence in WINDOWS else "--accept-warnings"


def front_end_accepts(wildcards, input):
    return f"--accept-refusal {input.checked}" if wildcards.sequence in WINDOWS else ""


def settings_of_windows(wildcards):
    """What the table of windows says of each, as JSON."""
    settings = {}
    for name in WINDOWS:
        start_s, end_s, _ = window_of(ENTRIES[name]["front_end"])
        truth = Path(ground_truth_folder(name, "truth")).name
        settings[name] = {"start_s": start_s, "end_s": end_s, "truth": truth}
    return json.dumps(settings)


def usable_windows():
    """Windows that neither check nor front-end refused."""
    reports = {name: checkpoints.front_end.get(sequence=name).output.report for name in WINDOWS}
    return [name for name, file in reports.items() if "stopped_at" not in json.loads(Path(file).read_text())]


def results_of_windows(wildcards):
    files = ["data/solutions/{name}/solutions.csv", "data/covariance/{name}.csv"]
    return expand(files, name=usable_windows())


def stamps_of_windows(wildcards):
    folders = ["data/sequences/{name}/", "data/solutions/{name}/", "data/covariance/{name}."]
    return expand("{folder}stamp.json", folder=expand(folders, name=usable_windows()))


def scene_settings(wildcards):
    return section("rendered", wildcards.scene, "scene")


if EUROC_ROOT and not Path(EUROC_ROOT).is_dir():
    raise WorkflowError(f"EuRoC root {EUROC_ROOT!r} (EUROC_ROOT or euroc.root) must be an existing folder")


def whole_configuration():
    """The configuration as JSON, without what no result depends on: where EuRoC is, what may be replaced."""
    numbers = {key: value for key, value in config.items() if key != "replace_other_source"}
    return json.dumps({**numbers, "euroc": {**config["euroc"], "root": ""}}, sort_keys=True)


def figure_image(key):
    """The PNG of a figure, with its caption in the report."""
    return report(f"{OUT}/{FIGURES[key].stem}.png", caption=f"../report/{key}.rst", category="Figures")


def beside_image(key):
    """What stands beside the PNG: the PDF, and the numbers shown."""
    return multiext(f"{OUT}/{FIGURES[key].stem}", ".pdf", FIGURES[key].numbers)


def paper_targets():
    """Everything in paper_figures/."""
    tables = [f"{OUT}/{table}.{ending}" for table in TABLES for ending in ("csv", "md", "tex")]
    figures = [f"{OUT}/{figure.stem}.{ending}" for figure in FIGURES.values() for ending in ("pdf", "png")]
    ledger = [f"{OUT}/{name}" for name in LEDGER_FILES]
    return [*tables, *figures, *ledger]


def where_made(flag, table, stamp):
    """Flags that show what is only made when asked for, a sweep or a spread, where someone has made it.

    Not an input: whoever shows it would then make it.
    """
    there = os.path.isfile(table) and os.path.isfile(stamp)
    return f"{flag} {table} {flag}-stamp {stamp}" if there else ""


def digest_where_made(table):
    """Changes with the table, so that what shows it is written again."""
    file = Path(table)
    return hashlib.sha256(file.read_bytes()).hexdigest() if file.is_file() else ""


def figures_beside_the_paper():
    """Figures that show the paper's numbers where there are any: on sequences only if they are the paper's."""
    if not SHOW_PUBLISHED:
        return []
    return [key for key in FIGURES if SEQUENCES_ARE_PUBLISHED or key not in ("fig01", "fig10", "fig11")]


def extensions(wildcards):
    """Results that are only made when asked for, where they are of this build's sequences."""
    made = SHOWN.get(WINDOWS_TABLE, {}).get("claims") == SOURCE_OF_CLAIMS
    return [f"Other parts of the recordings={WINDOWS_TABLE}"] if made else []


def folder_of_output(wildcards, output):
    return os.path.dirname(output[0])


def folder_of_captions(wildcards, input):
    return os.path.dirname(input.captions[0])


def folder_of_published(wildcards, input):
    return os.path.dirname(input.published[0])


def published_files(*names):
    """Files of the paper's numbers that a rule shows, so that a correction of one reruns it."""
    return [f"{PUBLISHED_FOLDER}/{name}" for name in names] if SHOW_PUBLISHED else []


def published(*names):
    """The same, by the names of their CSV."""
    return published_files(*(f"{name}.csv" for name in names))


def published_on_sequences(*names):
    """The same, where the sequences are the paper's: nothing else is set beside its EuRoC results."""
    return published_files(*names) if SEQUENCES_ARE_PUBLISHED else []


def published_file_flag(wildcards, input):
    return f"--published-file {input.published[0]}" if input.published else ""
