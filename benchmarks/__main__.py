"""``make bench``: problems, races, tables, figure.

python -m benchmarks [--sizes small|medium|all|10,30,...] [--results FOLDER] [--data FOLDER]
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from vigauge.errors import VigaugeError
from vigauge.files import write_json, write_rows
from vigauge.gauge.gauges import FreeGauge
from vigauge.model.archive import load_problems
from vigauge.solver.levenberg_marquardt import Options, solve
from vigauge_paper.run.machine import describe_machine, versions
from vigauge_paper.tables import markdown

from .competitors import FUNCTION_TOLERANCE, GAUGES, MAXIMUM_ITERATIONS, OURS, Competitor, competitors
from .limits import iteration_stages, measure_peak
from .native import describe
from .paper_time import RESULT as PAPER_RESULT
from .paper_time import whole_paper_s
from .problems import GROWTH, SIZES, Size, cached_problem
from .process import pinned
from .race import PARTS, Bench, Entry, Rules, least_seconds, race_covariances, race_solves
from .results import Row, covariance_rows, roofline_rows, scaling_rows, solve_rows
from .targets import target_rows
from .with_biases import LARGEST as LARGEST_WITH_BIASES
from .with_biases import rows_of as rows_with_biases

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
NAMED = {"small": SIZES[:2], "medium": SIZES[:3], "all": SIZES}
# Whole 9N x 9N covariances of longer problems are nobody's wish, half a gigabyte and more; their blocks are.
LARGEST_COVARIANCE = 300
STARTS = 7

_START = """
import sys
import vigauge as vg
problem = vg.load_problems(sys.argv[1])[0]
sys.exit(not vg.solve(problem, vg.FreeGauge()).converged)
"""


def chosen_sizes(text: str) -> list[Size]:
    """Sizes by name, or by their numbers of keyframes."""
    known = dict(SIZES)
    if text in NAMED:
        return [Size(n, k) for n, k in NAMED[text]]
    names = text.split(",")
    unknown = [name for name in names if not name.isdecimal() or int(name) not in known]
    if unknown:
        choice = ", ".join([*NAMED, *map(str, known)])
        raise argparse.ArgumentTypeError(f"unknown size {', '.join(unknown)!r}: choose from {choice}")
    return [Size(int(name), known[int(name)]) for name in names]


def say(text: str) -> None:
    print(text, flush=True)


def start_seconds(path: Path) -> float:
    """Median wall time of a process that imports the package and solves a problem, caches warm."""
    seconds = []
    for _ in range(STARTS + 1):
        begin = time.perf_counter()
        subprocess.run([sys.executable, "-c", _START, str(path)], check=True, env=pinned(1))
        seconds.append(time.perf_counter() - begin)
    return statistics.median(seconds[1:])


def profiled(path: Path) -> tuple[list[Row], dict[str, float]]:
    """Time of each function in a solve, and seconds of each stage, from a process of its own."""
    command = [sys.executable, "-m", "benchmarks.profile_solve", str(path)]
    done = subprocess.run(command, check=True, capture_output=True, text=True, env=pinned(1), cwd=ROOT)
    found = json.loads(done.stdout.splitlines()[-1])
    return found["functions"], found["stages"]


class Suite:
    """All races of a run, and what they gave."""

    def __init__(self, options: argparse.Namespace) -> None:
        self.options = options
        self.field = competitors(options.build)
        self.rules = Rules(limit_s=options.limit_s, memory_gib=options.memory_gib, budget_s=options.budget_s)
        self.solves: list[Row] = []
        self.covariances: list[Row] = []
        self.biased: tuple[list[Row], list[Row]] = ([], [])
        self.roofline: list[Row] = []
        self.profile: list[Row] = []
        self.floors: dict[str, float] = {}
        self.others: dict[str, float] = {}
        self.peak = measure_peak()
        # Why a solver is not tried any more: late once is late for longer problems too.
        self.out: dict[str, str] = {}
        # Seconds of the covariances at the last size.
        self.known: dict[str, float] = {}
        self.last = Size(1, 0)

    def problem(self, size: Size) -> None:
        """Everything about one size."""
        say(f"{size.name}: problem")
        files = cached_problem(size, self.options.data)
        problem = load_problems(files[0])[0]
        stages = iteration_stages(problem)
        functions, seconds = profiled(files[0])
        self.roofline += roofline_rows(size.name, problem, stages, self.peak, seconds)
        self.floors[size.name] = sum(stage.floor_s(self.peak) for stage in stages)
        with tempfile.TemporaryDirectory() as scratch:
            bench = Bench(problem, files, Path(scratch), self.rules, say)
            for threads, gauges in ((1, GAUGES), (2, ("free",))):
                if threads > (os.cpu_count() or 1):
                    say(f"{size.name}: no second core for two threads")
                    continue
                say(f"{size.name}: solve, {threads} thread{'s' * (threads > 1)}")
                entries = self._solves(bench, size, threads, gauges)
                self.solves += solve_rows(size.name, problem, entries)
            say(f"{size.name}: motion covariance")
            state = solve(problem, FreeGauge(), Options(function_tolerance=FUNCTION_TOLERANCE)).state
            parts = PARTS if size.n_keyframes <= LARGEST_COVARIANCE else ("blocks",)
            entries = race_covariances(bench, self.field, state, 1, self._scaled(size), parts)
            self.covariances += covariance_rows(size.name, problem, entries)
            self.known, self.last = least_seconds(entries), size
        if size.n_keyframes <= LARGEST_WITH_BIASES:
            found = rows_with_biases(size, self.field, self.options.data, self.rules, say)
            self.biased = self.biased[0] + found[0], self.biased[1] + found[1]
        if size.n_keyframes in (10, 100, 1000):
            self.profile += [{"problem": size.name} | row for row in functions]
        if size.n_keyframes == 10:
            self.others["start_s"] = start_seconds(files[0])
            say(f"  a process that solves it: {self.others['start_s']:.2f} s")

    def growth(self, size: Size) -> None:
        """Our own iteration at a size that only shows how it grows."""
        say(f"{size.name}: ours alone")
        files = cached_problem(size, self.options.data)
        problem = load_problems(files[0])[0]
        self.floors[size.name] = sum(stage.floor_s(self.peak) for stage in iteration_stages(problem))
        with tempfile.TemporaryDirectory() as scratch:
            bench = Bench(problem, files, Path(scratch), self.rules, say)
            ours = [competitor for competitor in self.field if competitor.name == OURS]
            self.solves += solve_rows(size.name, problem, race_solves(bench, ours, 1, ("free",)))

    def _scaled(self, size: Size) -> dict[str, float]:
        """Least seconds to expect of each covariance at a size, from the one before."""
        factor = size.n_parameters / self.last.n_parameters
        growth = {c.name: c.growth for c in self.field}
        return {
            label: seconds * factor ** growth[label.split()[0]].get(label.split()[1], 1.0)
            for label, seconds in self.known.items()
        }

    def _solves(self, bench: Bench, size: Size, threads: int, gauges: tuple[str, ...]) -> list[Entry]:
        running: list[Competitor] = []
        entries: list[Entry] = []
        for competitor in self.field:
            if not competitor.runs_with(threads, size.n_keyframes):
                continue
            if competitor.name not in self.out:
                running.append(competitor)
                continue
            entries += [
                Entry(competitor.name, gauge, threads, status=f"not tried: {self.out[competitor.name]}")
                for gauge in competitor.gauges_at(size.n_keyframes)
                if gauge in gauges
            ]
        raced = race_solves(bench, running, threads, gauges)
        for entry in raced:
            if entry.gauge == "free" and entry.solver != OURS:
                if entry.status.startswith("over"):
                    self.out[entry.solver] = f"{entry.status} at {size.name}"
                elif entry.status == "differs" and not entry.converged:
                    self.out[entry.solver] = f"did not converge at {size.name}"
        return raced + entries

    def write(self) -> list[Row]:
        """All files of the results; returns the rows of targets.csv."""
        from .figure import draw_scaling

        folder: Path = self.options.results
        scaling = scaling_rows(self.solves, self.floors)
        found = whole_paper_s(folder / PAPER_RESULT)
        targets = target_rows(
            self.solves,
            self.covariances,
            scaling,
            self.biased[0],
            self.others | ({} if found is None else {"paper_s": found}),
        )
        for name, rows in (
            ("solve", self.solves),
            ("covariance", self.covariances),
            ("with_biases_solve", self.biased[0]),
            ("with_biases_covariance", self.biased[1]),
            ("scaling", scaling),
            ("roofline", self.roofline),
            ("profile", self.profile),
            ("targets", targets),
        ):
            write_rows(folder / f"{name}.csv", rows)
        write_json(folder / "environment.json", self.environment())
        draw_scaling(scaling, folder / "scaling")
        return targets

    def environment(self) -> dict[str, object]:
        """What the times belong to."""
        ceres = next(c for c in self.field if c.name == "ceres")
        return {
            "machine": describe_machine(),
            "versions": versions(),
            "peers": {
                "native_ceres": describe(Path(ceres.command[0]) if ceres.absent is None else None),
                "gtsam": _version("gtsam"),
                "numba": _version("numba"),
            },
            "absent": {c.name: c.absent for c in self.field if c.absent is not None},
            "peak_gflops": round(self.peak.flops / 1e9, 2),
            "bandwidth_gb_per_s": round(self.peak.bandwidth / 1e9, 2),
            "function_tolerance": FUNCTION_TOLERANCE,
            "maximum_iterations": MAXIMUM_ITERATIONS,
            "limit_s": self.rules.limit_s,
            "memory_gib": self.rules.memory_gib,
            "seconds_of_rounds": self.rules.budget_s,
            "seconds_of_a_turn": self.rules.turn_s,
            "seed": Size(10, 300).seed,
        }


def _version(package: str) -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"


def parse(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument(
        "--sizes", type=chosen_sizes, default="all", help="small, medium, all, or keyframes: 10,100"
    )
    parser.add_argument("--results", type=Path, default=HERE / "results")
    parser.add_argument("--data", type=Path, default=HERE / "data", help="problems, made once")
    parser.add_argument("--build", type=Path, default=HERE / "build", help="the compiled C++ program")
    parser.add_argument("--limit-s", type=float, default=120.0, help="a solver that takes longer drops out")
    parser.add_argument("--memory-gib", type=float, default=12.0, help="so does one that needs more")
    parser.add_argument(
        "--budget-s", type=float, default=20.0, help="time for all runs of one solver in a race"
    )
    return parser.parse_args(arguments)


def main(arguments: list[str] | None = None) -> int:
    options = parse(arguments)
    begin = time.monotonic()
    try:
        suite = Suite(options)
        for competitor in suite.field:
            if competitor.absent is not None:
                say(competitor.absent)
        for size in options.sizes:
            suite.problem(size)
            targets = suite.write()
            say(f"{size.name}: done, {time.monotonic() - begin:.0f} s so far")
        if {100, 1000} <= {size.n_keyframes for size in options.sizes}:
            for n, k in GROWTH:
                suite.growth(Size(n, k))
            targets = suite.write()
    except VigaugeError as error:
        print(f"benchmarks: {error}", file=sys.stderr)
        return 1
    say("")
    say(markdown(targets, "Ratios: their time over ours. Files: benchmarks/results."))
    return 0


if __name__ == "__main__":
    sys.exit(main())
