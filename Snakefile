from pathlib import Path

from snakemake.utils import min_version

min_version("9.10")

# With --directory the configuration is that of the folder, or else the one beside this file.
BESIDE = Path(str(workflow.current_basedir), "config/config.yaml")


configfile: "config/config.yaml" if Path("config/config.yaml").is_file() else str(BESIDE)


report: "workflow/report/workflow.rst"


include: "workflow/rules/common.smk"
include: "workflow/rules/simulation.smk"
include: "workflow/rules/sequences.smk"
include: "workflow/rules/fetch.smk"
include: "workflow/rules/solve.smk"
include: "workflow/rules/covariance.smk"
include: "workflow/rules/reasons.smk"
include: "workflow/rules/sensitivity.smk"
include: "workflow/rules/paper.smk"
include: "workflow/rules/windows.smk"
include: "workflow/rules/spread.smk"
include: "workflow/rules/standing.smk"


localrules:
    all,


rule all:
    default_target: True
    input:
        paper_targets(),
