"""Interleaved rounds of all solvers on one problem; agreement first, times second.

Every solver runs in a process of its own with the problem loaded. Its first run is a trial: it warms
caches, chooses the faster variant, and shows where it ends. Rounds follow in which each solver has its
turn, in an order that changes from round to round. What is short runs several times in a turn, of which
the median counts: a single run of a millisecond would mostly measure that the others have emptied the
caches. A time counts only where the end agrees.
"""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from vigauge.model.problem import Problem
from vigauge.model.state import State
from vigauge.solver.residuals import cost as own_cost

from .competitors import OURS, Competitor
from .exchange import read_matrix, read_state, write_state
from .model import Model
from .process import DroppedOut, SolverProcess

COST_TOLERANCE = 1e-6
# Relative Frobenius distance to ours. GTSAM's inertial error is turned into the second keyframe's
# frame: at a point where errors are not zero its Jacobian differs by their products.
COVARIANCE_TOLERANCE = {"gtsam": 1e-3}
COVARIANCE_TOLERANCE_OTHERS = 1e-6

# Of a covariance: all of it, or the 9 x 9 blocks of the keyframes.
PARTS = ("whole", "blocks")

Say = Callable[[str], None]
Judge = Callable[[State], float]


@dataclass(frozen=True)
class Rules:
    """Limits of one race: of a request, of memory, of all runs of one solver, and of their number."""

    limit_s: float = 120.0
    memory_gib: float = 12.0
    budget_s: float = 20.0
    rounds: int = 25
    turn_s: float = 0.05

    def count(self, trial_s: float) -> int:
        """Rounds for a solver whose trial took so long: as many as fit, but three if that takes a minute."""
        if trial_s > self.budget_s:
            return 1
        return int(np.clip(self.budget_s / max(trial_s, 1e-9), 3, self.rounds))

    def runs(self, trial_s: float) -> int:
        """Runs in one turn: as many as take so long together, an odd number."""
        return 1 + 2 * int(self.turn_s / max(2.0 * trial_s, 1e-4))


@dataclass
class Entry:
    """One solver in one gauge: what it did, or why it did not."""

    solver: str
    gauge: str
    threads: int
    variant: str = ""
    status: str = "measured"
    seconds: list[float] = field(default_factory=list)
    iterations: int = 0
    trial_s: float = 0.0
    distance: float = 0.0
    peak_mib: float = 0.0
    part: str = ""
    converged: bool = True

    @property
    def label(self) -> str:
        """Who does what: of a covariance with its part."""
        return " ".join(word for word in (self.solver, self.gauge, self.part) if word)

    @property
    def counts(self) -> bool:
        return self.status == "measured" and bool(self.seconds)

    def per_iteration(self) -> list[float]:
        """Seconds a linear solve, round by round."""
        return [s / max(self.iterations, 1) for s in self.seconds]


@dataclass(frozen=True)
class Bench:
    """One problem on the bench: its files, a folder for what solvers write, and the rules."""

    problem: Problem
    files: tuple[Path, Path]
    scratch: Path
    rules: Rules
    say: Say

    @property
    def n_keyframes(self) -> int:
        return self.problem.initial.n_keyframes


class _Runners:
    """Processes by solver, started on first use; one that dropped out is not started again."""

    def __init__(self, bench: Bench, threads: int, stack: ExitStack) -> None:
        self.bench, self.threads, self.stack = bench, threads, stack
        self.running: dict[str, SolverProcess] = {}

    def of(self, competitor: Competitor) -> SolverProcess:
        """The process of a solver; DroppedOut where it is absent or cannot load the problem."""
        if competitor.absent is not None:
            raise DroppedOut("not installed")
        process = self.running.get(competitor.name)
        if process is None or process.process.poll() is not None:
            rules = self.bench.rules
            process = self.stack.enter_context(
                SolverProcess(
                    competitor.arguments(self.bench.files, self.threads),
                    self.threads,
                    limit_s=rules.limit_s,
                    memory_gib=rules.memory_gib,
                    environment=competitor.environment,
                )
            )
            self.running[competitor.name] = process
        return process


def _rounds(entries: Sequence[Entry], run: Callable[[Entry], float], rules: Rules) -> None:
    """Interleaved rounds; slow solvers leave after fewer of them.

    Where only one round is due, the trial is it: what takes so long needs no warming.
    """
    live = [entry for entry in entries if entry.status == "measured"]
    due = {id(entry): rules.count(entry.trial_s) for entry in live}
    for entry in live:
        if due[id(entry)] == 1:
            entry.seconds.append(entry.trial_s)
    for number in range(rules.rounds):
        turn = number % max(len(live), 1)
        for entry in live[turn:] + live[:turn]:
            if entry.status != "measured" or number >= due[id(entry)] or due[id(entry)] == 1:
                continue
            try:
                entry.seconds.append(statistics.median(run(entry) for _ in range(rules.runs(entry.trial_s))))
            except DroppedOut as reason:
                entry.status = str(reason)


def race_solves(
    bench: Bench, field_: Iterable[Competitor], threads: int, gauges: Sequence[str]
) -> list[Entry]:
    """All solvers in all gauges on one problem; entries with times where the costs agree."""
    judge = _judge(bench.problem)
    entries: list[Entry] = []
    costs: dict[int, float] = {}
    with ExitStack() as stack:
        runners = _Runners(bench, threads, stack)
        by_name = {competitor.name: competitor for competitor in field_}
        for competitor in by_name.values():
            for gauge in (g for g in competitor.gauges_at(bench.n_keyframes) if g in gauges):
                entry = Entry(competitor.name, gauge, threads)
                entries.append(entry)
                try:
                    cost = _try_solve(bench, runners.of(competitor), competitor, entry, judge)
                    costs[id(entry)] = cost
                except DroppedOut as reason:
                    entry.status = str(reason)
                bench.say(f"  {_told(entry)}")
        lowest = min(costs.values(), default=0.0)
        for entry in entries:
            if id(entry) in costs:
                entry.distance = costs[id(entry)] / lowest - 1.0
                # Not a number is no agreement either.
                if not entry.distance <= COST_TOLERANCE:
                    entry.status = "differs"
                    bench.say(f"  {entry.solver} {entry.gauge}: cost {entry.distance:.1e} above the lowest")

        def run(entry: Entry) -> float:
            answer = runners.of(by_name[entry.solver]).ask("solve", entry.gauge, entry.variant)
            return float(answer["seconds"])

        _rounds(entries, run, bench.rules)
    return entries


def _judge(problem: Problem) -> Judge:
    """Cost of a state: with known biases by plain NumPy, else by the package, which tests hold to GTSAM."""
    if problem.estimates_biases:
        return lambda state: own_cost(problem, state)
    return Model(problem).cost


def _try_solve(
    bench: Bench, process: SolverProcess, competitor: Competitor, entry: Entry, judge: Judge
) -> float:
    """First run in every variant; keeps the faster one and returns the judge's cost of its end."""
    best = np.inf
    cost = np.nan
    process.ask("prepare", entry.gauge)
    for variant in competitor.variants(bench.n_keyframes):
        answer = process.ask("solve", entry.gauge, variant)
        if competitor.name == OURS:
            entry.peak_mib = float(answer["peak_mib"])
            answer = process.ask("solve", entry.gauge, variant)  # without compilation
        each = answer["seconds"] / max(answer["iterations"], 1)
        if each < best:
            best = each
            entry.variant, entry.iterations = variant, int(answer["iterations"])
            entry.trial_s, entry.peak_mib = float(answer["seconds"]), max(entry.peak_mib, answer["peak_mib"])
            file = bench.scratch / f"{competitor.name}_{entry.gauge}.state"
            process.ask("state", file)
            cost = judge(read_state(file, bench.problem.initial))
            entry.converged = bool(answer["converged"])
            if not entry.converged:
                bench.say(f"  {competitor.name} {entry.gauge}: stopped before it converged")
    return cost


def race_covariances(
    bench: Bench,
    field_: Iterable[Competitor],
    state: State,
    threads: int,
    known_s: Mapping[str, float],
    parts: Sequence[str] = PARTS,
) -> list[Entry]:
    """Motion covariances at one state, the whole matrix and its diagonal blocks, as ``parts`` says.

    ``known_s`` maps "solver gauge part" to the least seconds that are to be expected here; whoever would be
    late is not tried.
    """
    place = bench.scratch / "estimate.state"
    write_state(place, state)
    entries: list[Entry] = []
    ours: dict[tuple[str, str], np.ndarray] = {}
    with ExitStack() as stack:
        runners = _Runners(bench, threads, stack)
        by_name = {competitor.name: competitor for competitor in field_}
        for competitor in by_name.values():
            for gauge, variant, part in _covariances(competitor, parts):
                entry = Entry(competitor.name, gauge, threads, variant=variant, part=part)
                entries.append(entry)
                if known_s.get(entry.label, 0.0) > bench.rules.limit_s:
                    entry.status = f"not tried: over {bench.rules.limit_s:g} s expected from smaller sizes"
                    bench.say(f"  {_told(entry)}")
                    continue
                try:
                    matrix = _try_covariance(bench, runners.of(competitor), competitor, entry, place)
                except DroppedOut as reason:
                    entry.status = str(reason)
                else:
                    if competitor.name == OURS:
                        ours[gauge, part] = matrix
                    _judge_covariance(entry, matrix, ours.get((gauge, part)))
                bench.say(f"  {_told(entry)}")

        def run(entry: Entry) -> float:
            process = runners.of(by_name[entry.solver])
            return float(process.ask("covariance", entry.gauge, entry.variant)["seconds"])

        _rounds(entries, run, bench.rules)
    return entries


def _covariances(competitor: Competitor, parts: Sequence[str]) -> Iterator[tuple[str, str, str]]:
    """(gauge, variant, part) of all that a solver computes."""
    if "whole" in parts:
        yield from ((gauge, variant, "whole") for gauge, variant in competitor.covariances.items())
    if "blocks" in parts:
        yield from ((gauge, "blocks", "blocks") for gauge in competitor.blocks)


def _try_covariance(
    bench: Bench, process: SolverProcess, competitor: Competitor, entry: Entry, place: Path
) -> np.ndarray:
    process.ask("prepare", entry.gauge)
    process.ask("at", place)
    for _ in range(2 if competitor.name == OURS else 1):  # ours compiles in its first
        answer = process.ask("covariance", entry.gauge, entry.variant)
    entry.iterations = 1
    entry.trial_s, entry.peak_mib = float(answer["seconds"]), float(answer["peak_mib"])
    file = bench.scratch / f"{competitor.name}_{entry.gauge}_{entry.part}.matrix"
    process.ask("matrix", file)
    n = bench.n_keyframes
    width = bench.problem.initial.width
    matrix = read_matrix(file, (n, width, width) if entry.part == "blocks" else (width * n, width * n))
    file.unlink()
    return matrix


def _judge_covariance(entry: Entry, matrix: np.ndarray, ours: np.ndarray | None) -> None:
    if ours is None:
        entry.status = "nothing to compare with"
        return
    entry.distance = float(np.linalg.norm(matrix - ours) / np.linalg.norm(ours))
    if not entry.distance <= COVARIANCE_TOLERANCE.get(entry.solver, COVARIANCE_TOLERANCE_OTHERS):
        entry.status = "differs"


def _told(entry: Entry) -> str:
    """One line of progress."""
    if entry.status != "measured":
        return f"{entry.label}: {entry.status}"
    steps = "" if entry.part else f", {entry.iterations} steps ({entry.variant})"
    return f"{entry.label}: {1e3 * entry.trial_s:.1f} ms{steps}"


def least_seconds(entries: Iterable[Entry]) -> dict[str, float]:
    """Seconds of each "solver gauge part" of a race; infinite for who was late, and so stays late."""
    return {
        e.label: float("inf") if e.status.startswith(("over", "not tried")) else e.trial_s for e in entries
    }
