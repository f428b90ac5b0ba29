"""The list of explaining experiments: complete, configured, and cited."""

import dataclasses
import importlib
import inspect
import pkgutil
import re
import sys

import pytest
import yaml

from support import ROOT
from support.results import reasons
from vigauge_paper import experiments
from vigauge_paper.claims import CLAIMS
from vigauge_paper.experiments.experiment import Experiment
from vigauge_paper.experiments.registry import EXPERIMENTS
from vigauge_paper.figures.registry import FIGURES


def test_every_experiment_is_listed() -> None:
    """Catches a module whose experiment nobody runs."""
    modules = [
        importlib.import_module(f"{experiments.__name__}.{module.name}")
        for module in pkgutil.iter_modules(experiments.__path__)
    ]
    found = {module.EXPERIMENT.name for module in modules if hasattr(module, "EXPERIMENT")}
    assert found == set(EXPERIMENTS)
    assert all(isinstance(experiment, Experiment) for experiment in EXPERIMENTS.values())


def test_every_experiment_is_cited_or_drawn() -> None:
    """Catches an experiment that no claim, figure or comparison reads, and made-up results that lack one."""
    cited = {name for claim in CLAIMS for name in claim.evidence} | {"bias_hypothesis", *FIGURES}
    assert set(EXPERIMENTS) <= cited
    assert set(reasons()) <= set(EXPERIMENTS)


@pytest.mark.parametrize("experiment", EXPERIMENTS.values(), ids=EXPERIMENTS)
def test_an_experiment_waits_for_all_that_it_reads(experiment: Experiment) -> None:
    """Catches an experiment that is given no files, and so writes a table without rows."""
    source = inspect.getsource(sys.modules[experiment.rows.__module__])
    by_method = {"trials": "problems", "truth": "truths"}
    read = {by_method.get(name, name) for name in re.findall(r"material\.(\w+)", source)}
    assert read & {"problems", "truths", "covariances", "sweep_trace"} == set(experiment.reads)


def test_configuration_has_the_settings_of_every_experiment() -> None:
    """Catches a setting that the schema knows and the experiment does not, or the other way round."""
    schema = yaml.safe_load((ROOT / "workflow" / "schemas" / "config.schema.yaml").read_text("utf-8"))
    sections = schema["properties"]["reasons"]["properties"]
    wanted = {
        name: {field.name for field in dataclasses.fields(experiment.settings)}
        for name, experiment in EXPERIMENTS.items()
    }
    assert {name: set(part["properties"]) for name, part in sections.items()} == {
        name: fields for name, fields in wanted.items() if fields
    }
