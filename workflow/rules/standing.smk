"""Before the first job: no results of another source or of more trials go in silence; stages are timed alone."""

from collections import Counter
from csv import DictReader

from snakemake.logging import logger

THIS_BUILD = {
    "source": SEQUENCES.source,
    "claims": SEQUENCES.source_of_claims,
    "published": config["figures"]["show_published"] and SEQUENCES.are_published,
    "trials": config["simulation"]["n_trials"],
}
try:
    BUILDS = Builds.read(Path(OUT, "source.json"), THIS_BUILD, config.get("replace_other_source", False))
except VigaugeError as error:
    raise WorkflowError(str(error))
# Captions speak of what stands there, also where the report is made without EUROC_ROOT.
config["shown"] = BUILDS.shown
if warning := BUILDS.conflict(BUILDS.shown, "a build of everything"):
    logger.warning(warning)


onstart:
    # A run on a cluster has no number of cores, and asking for it is an error.
    alone = not workflow.local_exec or "timed" in workflow.global_resources or workflow.cores == 1
    if not alone and any(job.resources.get("timed") for job in workflow.dag.needrun_jobs()):
        logger.warning(
            "stages may be timed beside others: no limit on `timed`, which profiles/default has"
        )
    # Results of a rule with a parameter `source` show sequences.
    files = {
        file: "source" in job.params.keys()
        for job in workflow.dag.needrun_jobs()
        for file in job.output
        if file.startswith(f"{OUT}/")
    }
    if refusal := BUILDS.conflict(files, "this run"):
        raise WorkflowError(refusal)
    BUILDS.begin(files)


onsuccess:
    if any(rules.index.output[0] in job.output for job in workflow.dag.jobs):
        with open(rules.claims.output.csv, encoding="utf-8", newline="") as stream:
            count = Counter(row["verdict"] for row in DictReader(stream))
        verdicts = ", ".join(f"{number} {verdict}" for verdict, number in count.most_common())
        # The expected values are those of the configuration of this checkout.
        ours = not workflow.overwrite_configfiles and Path.cwd() == ROOT
        check = " To compare with the expected values: make check-results" if ours else ""
        logger.info(
            f"The page to open: {Path(rules.index.output[0]).resolve()} (claims: {verdicts}).{check}"
        )
