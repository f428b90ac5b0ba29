"""Whose sequences the results in paper_figures/ show: no build replaces the other source's in silence."""

from snakemake.logging import logger

RECORD = Path(OUT, "source.json")
THIS_BUILD = {
    "source": SOURCE_OF_SEQUENCES,
    "claims": SOURCE_OF_CLAIMS,
    "published": SHOW_PUBLISHED and SEQUENCES_ARE_PUBLISHED,
}
SOURCES_IN_WORDS = {
    "euroc": "the paper's EuRoC sequences",
    "rendered": "rendered stand-ins",
    "other": "other recordings",
}


def standing_results():
    """What each result that is there was made from, by file: source, source of claims, paper's numbers."""
    if not RECORD.is_file():
        return {}
    try:
        found = json.loads(RECORD.read_text("utf-8"))
        wrong = [file for file, build in found.items() if build["claims"] not in SOURCES_IN_WORDS]
    except (ValueError, AttributeError, TypeError, KeyError) as error:
        wrong = [str(error)]
    if wrong:
        raise WorkflowError(f"{RECORD}: must be the record of a build ({wrong[0]}); delete {OUT}/")
    return {file: build for file, build in found.items() if os.path.exists(file)}


def difference(files, run):
    """In words, what stands there and what this run takes, and how to choose."""
    theirs = " and ".join(sorted({SOURCES_IN_WORDS[SHOWN[file]["claims"]] for file in files}))
    return (
        f"{len(files)} file(s) of {OUT}/ show {theirs}, and {run} would replace them by"
        f" {SOURCES_IN_WORDS[SOURCE_OF_CLAIMS]}: set EUROC_ROOT (or euroc.root) as in the build before, make"
        " this one elsewhere with --directory, or let those go with --config replace_other_source=True"
    )


def of_another_source(files):
    """Those of the files that were made from other sequences and may not be replaced."""
    allowed = config.get("replace_other_source", False)
    other = [file for file in files if file in SHOWN and SHOWN[file]["claims"] != SOURCE_OF_CLAIMS]
    return [] if allowed else other


SHOWN = standing_results()
# Captions speak of what stands there, also where the report is made without EUROC_ROOT.
config["shown"] = SHOWN
if of_another_source(SHOWN):
    logger.warning(difference(of_another_source(SHOWN), "a build of everything"))


onstart:
    jobs = [job for job in workflow.dag.needrun_jobs() if "source" in job.params.keys()]
    files = [file for job in jobs for file in job.output if file.startswith(f"{OUT}/")]
    if of_another_source(files):
        raise WorkflowError(difference(of_another_source(files), "this run"))
    # What is replaced goes first: a run that breaks off leaves no file whose record is wrong.
    for file in files:
        if SHOWN.get(file, THIS_BUILD) != THIS_BUILD:
            os.remove(file)
    if files:
        os.makedirs(OUT, exist_ok=True)
        RECORD.write_text(json.dumps(SHOWN | dict.fromkeys(files, THIS_BUILD), indent=1) + "\n", "utf-8")
