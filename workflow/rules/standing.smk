"""Before the first job: no build replaces the other source's results in silence, and stages are timed alone."""

from snakemake.logging import logger

THIS_BUILD = {
    "source": SEQUENCES.source,
    "claims": SEQUENCES.source_of_claims,
    "published": config["figures"]["show_published"] and SEQUENCES.are_published,
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
    alone = "timed" in workflow.global_resources or workflow.cores == 1 or not workflow.local_exec
    if not alone and any(job.resources.get("timed") for job in workflow.dag.needrun_jobs()):
        logger.warning(
            "stages may be timed beside others: no limit on `timed`, which profiles/default has"
        )
    jobs = [job for job in workflow.dag.needrun_jobs() if "source" in job.params.keys()]
    files = [file for job in jobs for file in job.output if file.startswith(f"{OUT}/")]
    if refusal := BUILDS.conflict(files, "this run"):
        raise WorkflowError(refusal)
    BUILDS.begin(files)
