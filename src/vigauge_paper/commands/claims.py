"""Judge the paper's claims from the result files, and say why."""

import argparse
import json
import os
from collections.abc import Mapping
from pathlib import Path

import pandas as pd

from vigauge.cli.command import LOG
from vigauge.errors import MixtureError
from vigauge.files import write_rows, write_text
from vigauge_paper.claims import (
    Criteria,
    Evidence,
    evidence_links,
    explanations,
    headline,
    ledger,
    paired_statistics,
)
from vigauge_paper.claims.sensitivity import ranges
from vigauge_paper.run.artefacts import FILE, NAMED, add_reading, add_section, named_file
from vigauge_paper.run.provenance import require_coherent
from vigauge_paper.run.stage import parser, run, settings_from
from vigauge_paper.tables import markdown


def work(options: argparse.Namespace) -> None:
    criteria = settings_from(Criteria, options.criteria, "claims")
    machine = json.loads(options.machine.read_text("utf-8"))["machine"]
    evidence = Evidence(
        solutions=dict(options.solutions),
        timings=dict(options.timings),
        covariances=dict(options.covariances),
        sweep=options.sweep,
        sweep_trace=options.sweep_trace,
        sweep_configuration=options.sweep_configuration,
        reasons=dict(options.reasons),
        source=options.source,
        cpu=str(machine["processor"]),
        criteria=criteria,
        reading=options.prior_reading,
        machine_hall=options.machine_hall,
        vicon_room=options.vicon_room,
    )
    rows, reasons = ledger(evidence), explanations(evidence)
    verdicts = {row["id"]: row["verdict"] for row in rows}
    why = [{"id": row["id"], "verdict": verdicts[row["id"]], "why": row["why"]} for row in reasons]
    write_rows(options.output, rows)
    write_rows(options.why, why)
    write_rows(options.statistics, paired_statistics(evidence))
    files = dict(options.evidence)
    shown = [{**row, "evidence": _links(str(row["id"]), files, options.output.parent)} for row in rows]
    page = (
        f"# Claims of the paper\n\n{headline(rows)}\n\n"
        + markdown(shown, _note(criteria, machine))
        + "\n## Why\n\n"
        + markdown(why)
    )
    if options.sensitivity and _belongs(options):
        page += "\n## Where in the range of our assumptions\n\n" + _ranges(options.sensitivity)
    write_text(options.output.with_suffix(".md"), page)
    for row in rows:
        LOG.info("%-10s %s: %s", row["verdict"], row["claim"], row["measured"])


def _note(criteria: Criteria, machine: Mapping[str, object]) -> str:
    """Margins, and how times were taken."""
    margin = criteria.in_words()
    return (
        f"Intervals at {100 * criteria.confidence:g} %, bootstrapped over trials. Margins: accuracy "
        f"{margin['accuracy_margin']}, cost {margin['cost_margin']}, covariance "
        f"{margin['covariance_margin']}; RMSE over prior weights {margin['sweep_span']}, settled "
        f"{margin['settled_span']} of their span. Times: {machine['processor']}, {machine['cores']} cores, "
        "BLAS on one thread; each trial at its quickest repeat; of a sequence, repeats are drawn instead of "
        "trials. Paired differences with effect sizes: claims_statistics.csv; tables of the experiments that "
        "explain: data/reasons."
    )


def _belongs(options: argparse.Namespace) -> bool:
    """Whether the sweep, which is only made when asked for, is of the same configuration as the results."""
    try:
        stamps = require_coherent([*options.stamps, options.sensitivity_stamp])
    except MixtureError as error:
        LOG.warning("sensitivity sweep left out: %s", error)
        return False
    same = stamps[options.sensitivity_stamp].config["claims"] == options.criteria
    if not same:
        LOG.warning("sensitivity sweep left out: it was judged by other criteria; make 'sensitivity' again")
    return bool(same)


def _links(claim: str, files: dict[str, Path], folder: Path) -> str:
    """Evidence of a claim as links from ``folder``, where the page is."""
    links = (f"[{name}]({os.path.relpath(files[name], folder)})" for name in evidence_links(claim, files))
    return ", ".join(links)


def _ranges(summary: Path) -> str:
    """The sensitivity sweep: where each claim holds, and how near Table II each setting comes."""
    table = pd.read_csv(summary, dtype={"value": str})
    columns = ["parameter", "value", "rmse_ratio", "rmse_ratio_low", "rmse_ratio_high", "rmse_score"]
    near = table[columns].drop_duplicates().to_dict("records")
    note = (
        "RMSE of fixation over the paper's Table II: geometric mean, smallest and largest of 18, "
        "and the mean of |log ratio|."
    )
    return (
        markdown(ranges(table)) + "\n" + markdown([{str(k): v for k, v in row.items()} for row in near], note)
    )


def main() -> None:
    arguments = parser(__doc__)
    for name in ("solutions", "timings", "covariances"):
        arguments.add_argument(f"--{name}", **NAMED, help="NAME=FILE of each experiment")
    arguments.add_argument("--reasons", **NAMED, help="NAME=FILE of explaining experiments")
    arguments.add_argument("--sweep", **FILE)
    arguments.add_argument("--sweep-trace", **FILE)
    arguments.add_argument("--sweep-configuration", required=True, help="configuration of the sweep")
    arguments.add_argument("--machine-hall", required=True, help="the one in the place of the paper's MH1")
    arguments.add_argument("--vicon-room", required=True, help="the one in the place of the paper's VI1")
    arguments.add_argument("--source", choices=("euroc", "rendered", "other"), required=True)
    arguments.add_argument("--machine", **FILE, help="what the times were taken on")
    add_section(arguments, "--criteria", "claims")
    add_reading(arguments)
    arguments.add_argument("--output", **FILE, help="claims.csv; claims.md goes beside it")
    arguments.add_argument("--why", **FILE, help="output: reason of each claim")
    arguments.add_argument("--statistics", **FILE, help="output: paired differences")
    arguments.add_argument(
        "--evidence", type=named_file, nargs="*", default=[], help="NAME=FILE of evidence to link to"
    )
    arguments.add_argument(
        "--sensitivity", type=Path, help="summary of the sensitivity sweep, if there is one"
    )
    arguments.add_argument("--sensitivity-stamp", type=Path, help="stamp of that summary")
    run(work, arguments)


if __name__ == "__main__":
    main()
