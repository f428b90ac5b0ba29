"""Time the solves of several experiments in one process, experiments and gauges interleaved.

So a slow moment of the machine falls on all alike, and a drift of its speed does not pass for a difference
of experiments. Fixation is timed twice, which shows how small an effect the times can tell. BLAS runs on
one thread: more are slower at these sizes, and times would not compare.
"""

import argparse
import time
from collections.abc import Iterable
from itertools import zip_longest

from vigauge.cli.command import LOG
from vigauge.files import write_json, write_rows
from vigauge.model.archive import load_problems
from vigauge.solver.levenberg_marquardt import Options
from vigauge_paper.experiments.interleaved import Trial, solve_interleaved, timing_row
from vigauge_paper.experiments.solves import under_noise
from vigauge_paper.ids import FIX, FIX_AGAIN, HEADLINE, PRIOR
from vigauge_paper.prior import gauges as gauges_of
from vigauge_paper.run.artefacts import FILE, NAMED, PRIOR_KEYS, add_prior, add_solver
from vigauge_paper.run.machine import describe_machine, reference_seconds, versions
from vigauge_paper.run.progress import progress
from vigauge_paper.run.stage import Stamped, json_argument, parser, run, settings_from


def work(options: argparse.Namespace) -> None:
    solver = settings_from(Options, options.solver, "solver")
    gauges = gauges_of(options.prior_weight, options.prior_reading)
    # Apart from its first, in turns that go round: a solve after its like finds the caches warm.
    names = [FIX, PRIOR, FIX_AGAIN, *(name for name in gauges if name not in (FIX, PRIOR))]
    gauges = {name: gauges[FIX if name == FIX_AGAIN else name] for name in names}
    groups = []
    for name, file in options.problems:
        problems = under_noise(load_problems(file), options.noise.get(name, {}))[HEADLINE]
        groups.append([Trial({"experiment": name, "trial": i}, p) for i, p in enumerate(problems)])
    trials = [trial for turn in zip_longest(*groups) for trial in turn if trial is not None]
    reference: list[float] = []

    def repeat(turn: Iterable[Trial]) -> Iterable[Trial]:
        reference.append(reference_seconds(time.perf_counter))
        return progress(turn, f"repeat {len(reference)}", "trial", len(trials))

    timed = solve_interleaved(
        trials, gauges, solver, clock=time.perf_counter, repeats=options.repeats, progress=repeat
    )
    rows = [timing_row(s) for s in timed]
    reference.append(reference_seconds(time.perf_counter))
    drift = max(reference) / min(reference) - 1.0
    write_rows(options.timing, rows)
    record = {"machine": describe_machine(), "versions": versions()}
    write_json(options.machine, record | {"speed": {"reference_s": reference, "drift": drift}})
    LOG.info("%d solves; speed of the processor within %.1f %%", len(rows), 100 * drift)


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--problems", **NAMED, help="NAME=problems.npz of each experiment")
    add_prior(arguments)
    add_solver(arguments)
    arguments.add_argument(
        "--noise", type=json_argument, default={}, help="noise models of an experiment, by its name"
    )
    arguments.add_argument("--repeats", type=int, required=True, help="timed repeats of every trial")
    arguments.add_argument("--timing", **FILE, help="output: seconds of each solve")
    arguments.add_argument(
        "--machine",
        **FILE,
        help="output: what it ran on, and seconds of a fixed computation before each repeat and at the end",
    )
    run(work, arguments, Stamped({"solver": "solver"} | PRIOR_KEYS, timings=("timing", "machine")))


if __name__ == "__main__":
    main()
