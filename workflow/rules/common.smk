"""What the other files of this folder share: the checked configuration, the sequences, small helpers."""

import json
import os
import re
import sys
from pathlib import Path

from snakemake.exceptions import WorkflowError

# Of the checkout, whatever the working folder; jobs inherit its sources and this interpreter.
ROOT = Path(str(workflow.current_basedir)).resolve().parents[1]
SOURCE = str(ROOT / "src")
sys.path.insert(0, SOURCE)
for variable, folder in (("PYTHONPATH", SOURCE), ("PATH", os.path.dirname(sys.executable))):
    others = [other for other in os.environ.get(variable, "").split(":") if other not in ("", folder)]
    os.environ[variable] = ":".join([folder, *others])

from vigauge.errors import VigaugeError
from vigauge_paper.experiments.registry import EXPERIMENTS as EXPLAINING
from vigauge_paper.experiments.registry import TIMED, UNTIMED
from vigauge_paper.figures.registry import FIGURES
from vigauge_paper.ids import CONFIGURATIONS, TABLES
from vigauge_paper.prior import information
from vigauge_paper.run.configuration import check_config, read_numbers
from vigauge_paper.workflow.builds import Builds
from vigauge_paper.workflow.cross_field import check_between_keys, check_front_ends
from vigauge_paper.workflow.artefacts import artefacts
from vigauge_paper.workflow import parameters
from vigauge_paper.workflow.results import digest_where_made, producer, used_configuration, where_made
from vigauge_paper.workflow.sequences import Sequences
from vigauge_paper.workflow.sources import code_of

EUROC_ROOT = os.environ.get("EUROC_ROOT", "") or config["euroc"]["root"]
if EUROC_ROOT and not Path(EUROC_ROOT).is_dir():
    raise WorkflowError(f"EuRoC root {EUROC_ROOT!r} (EUROC_ROOT or euroc.root) must be an existing folder")
SCHEMA = ROOT / "workflow/schemas/config.schema.yaml"
try:
    read_numbers(config, SCHEMA)
    check_config(config, SCHEMA, "configuration")
    check_between_keys(config, SCHEMA)
    SEQUENCES = Sequences.of(config, EUROC_ROOT)
    check_front_ends(SEQUENCES.entries)
except VigaugeError as error:
    raise WorkflowError(str(error))

OUT = "paper_figures"
# Each figure with its panels stacked, for the page on a phone.
NARROW = {key: f"{OUT}/narrow/{figure.stem}.png" for key, figure in FIGURES.items()}
# Resources of a timed job, so that nothing runs beside it. On this machine, it takes all 1000 of `timed`, of
# which profiles/default gives every other job one. On Slurm, it asks for a node to itself.
ALONE = {"timed": 1000, "slurm_extra": "--exclusive"}
SWEEP = config["prior"]["sweep_configuration"]
READING = config["prior"]["reading"]
# As solves need it, and with both meanings of its weight.
PRIOR_INFORMATION = information(config["prior"]["weight"], READING)
PRIOR_FLAGS = f"--prior-weight {config['prior']['weight']} --prior-reading {READING}"
PAPER_SEQUENCES = SEQUENCES.of_the_paper
EXPERIMENTS = [*CONFIGURATIONS, *PAPER_SEQUENCES]
# The paper's names of the sequences that are its own, for a command line.
PUBLISHED_NAMES = [f"{name}={theirs}" for name, theirs in SEQUENCES.published_names.items()]


def names_of(names):
    """Names as a regular expression of wildcards."""
    return "|".join(re.escape(name) for name in names)


wildcard_constraints:
    configuration=names_of(CONFIGURATIONS),
    sequence=names_of(SEQUENCES.entries),
    experiment=names_of([*CONFIGURATIONS, *SEQUENCES.entries]),


def section(*keys):
    """A part of the configuration as JSON, for a command line; it is what a rule depends on."""
    value = config
    for key in keys:
        value = value[key]
    return json.dumps(value, sort_keys=True)


def made(kind, names, stamp=False):
    """The files of one kind of result, one for each experiment named; with ``stamp``, the stamps of these."""
    files = []
    for name in names:
        maker, output = producer(kind, name)
        file = getattr(getattr(rules, maker).output, "stamp" if stamp else output)
        files += expand(file, configuration=name, sequence=name, experiment=name, timed=name, untimed=name)
    return files


def reads(**names):
    """Inputs of a rule: the results of each kind of the experiments named, and the stamps of all."""
    stamps = [stamp for kind, some in names.items() for stamp in made(kind, some, stamp=True)]
    return {kind: made(kind, some) for kind, some in names.items()} | {"stamps": list(dict.fromkeys(stamps))}


def published(*files):
    """Files of the paper's numbers, which belong to the checkout: a module's prefix is not for them.

    They are named as they lie from here: so commands can be pasted, and a project that moves reruns nothing.
    """
    return [local(os.path.relpath(ROOT / "data/published" / file)) for file in files]


def results_of(*kinds):
    """Inputs of a rule: results of the experiment that a job is for, simulated or from images."""
    return lambda wildcards: reads(**{kind: [wildcards.experiment] for kind in kinds})


def usable_windows(*kinds):
    """Inputs of their table: results of the windows that neither check nor front-end refused, a checkpoint."""

    def files(wildcards):
        reports = {name: checkpoints.front_end.get(sequence=name).output.report for name in SEQUENCES.windows}
        usable = [name for name in reports if "stopped_at" not in json.loads(Path(reports[name]).read_text())]
        made = reads(problems=usable, solutions=usable, distances=usable)
        return [file for kind in kinds for file in made[kind]]

    return files


def in_report(file, category, figure, shows, source="simulation", caption=None):
    """A result in paper_figures/ that the report shows, with what its list there says of it."""
    labels = {"result": figure, "shows": shows, "source": source}
    caption = f"../report/{caption or Path(file).stem}.rst"
    return report(f"{OUT}/{file}", caption=caption, category=category, labels=labels)


def shown(key, source):
    """A table, or the PNG of a figure, in the report."""
    if key in TABLES:
        return in_report(f"{key}.csv", "Tables", TABLES[key], "the paper's table", source or "simulation")
    figure = FIGURES[key]
    # Of no source: the files of Figures 1, 10 and 11 have EuRoC in their names, whatever they show.
    shows = re.sub(r"^fig\d*_", "", figure.stem).replace("euroc_", "").replace("_euroc", "").replace("_", " ")
    return in_report(f"{figure.stem}.png", "Figures", figure.title, shows, source or "simulation", key)


def beside(key):
    """What stands beside it: further formats, and the numbers shown in a figure."""
    if key in TABLES:
        return multiext(f"{OUT}/{key}", ".md", ".tex")
    return [*multiext(f"{OUT}/{FIGURES[key].stem}", ".pdf", FIGURES[key].numbers), NARROW[key]]


def reads_of(artefact):
    """Inputs of a table or figure: results and numbers by flag, and the stamps of all."""
    files = {flag: made(read.kind, read.names) for flag, read in artefact.reads.items()}
    stamps = [stamp for read in artefact.reads.values() for stamp in made(read.kind, read.names, stamp=True)]
    numbers = {flag: f"{OUT}/{FIGURES[key].stem}.csv" for flag, key in artefact.numbers.items()}
    return {**files, **numbers, "stamps": list(dict.fromkeys(stamps))}
