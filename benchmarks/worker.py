"""A Python solver behind one problem, in a process of its own.

    python -m benchmarks.worker SOLVER PROBLEM.npz THREADS FUNCTION_TOLERANCE MAXIMUM_ITERATIONS

It speaks the protocol of ``ceres_solver.cpp``: one request a line on stdin, one line of JSON on
stdout for each. Reading the file and translating it to the solver's own classes is not timed.
"""

from __future__ import annotations

import json
import resource
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from vigauge.covariance.covariance import keyframe_covariances, motion_covariance
from vigauge.gauge.gauges import FixedGauge, FreeGauge, Gauge, PriorGauge
from vigauge.geometry.so3 import Array
from vigauge.model.archive import load_problems
from vigauge.model.problem import Problem
from vigauge.model.state import State
from vigauge.solver.levenberg_marquardt import Options, Status, solve

from .exchange import read_state, write_matrix, write_state

PRIOR_WEIGHT = 1e5  # Section V-A; also in ceres_solver.cpp


class Solver(Protocol):
    """What a worker asks of a solver; ``variant`` is one of its own ways of doing the same."""

    def prepare(self, gauge: str) -> None:
        """Translate the problem, before anything is timed."""

    def solve(self, gauge: str, variant: str) -> tuple[State, dict[str, Any]]:
        """Estimate from the problem's start; seconds, iterations (linear solves), cost, converged."""

    def covariance(self, state: State, gauge: str, variant: str) -> tuple[Array, float]:
        """Motion covariance and the seconds it took: (9N, 9N), or with the variant "blocks" its diagonal
        blocks (N, 9, 9) of (position, rotation, velocity)."""


class Vigauge:
    """This package.

    What it keeps of a problem's structure from run to run is thrown away before each: the others
    analyse it anew too.
    """

    def __init__(self, problem: Problem, threads: int, tolerance: float, limit: int, path: str) -> None:
        self.problem = problem
        self.gauges: dict[str, Gauge] = {
            "fix": FixedGauge(),
            "prior": PriorGauge(PRIOR_WEIGHT),
            "free": FreeGauge(),
        }
        self.options = Options(function_tolerance=tolerance, maximum_iterations=limit, threads=threads)

    def prepare(self, gauge: str) -> None:
        pass

    def _forgotten(self) -> Problem:
        return replace(self.problem)

    def solve(self, gauge: str, variant: str) -> tuple[State, dict[str, Any]]:
        problem = self._forgotten()
        solution = solve(problem, self.gauges[gauge], self.options, clock=time.perf_counter)
        # The trace has the start, and lacks the step that met a tolerance and was not taken.
        untaken = solution.status in (Status.FUNCTION_TOLERANCE, Status.PARAMETER_TOLERANCE)
        return solution.state, {
            "seconds": solution.seconds,
            "iterations": len(solution.trace) - 1 + untaken,
            "cost": solution.cost,
            "converged": solution.converged,
        }

    def covariance(self, state: State, gauge: str, variant: str) -> tuple[Array, float]:
        compute = keyframe_covariances if variant == "blocks" else motion_covariance
        problem = self._forgotten()
        begin = time.perf_counter()
        covariance = compute(problem, state, self.gauges[gauge])
        return covariance, time.perf_counter() - begin


class Gtsam:
    """GTSAM's Levenberg-Marquardt with its Ceres-like settings, and its marginals."""

    def __init__(self, problem: Problem, threads: int, tolerance: float, limit: int, path: str) -> None:
        from . import peer_gtsam, peer_gtsam_biases

        self.peer: Any = peer_gtsam
        if problem.estimates_biases:
            self.peer = peer_gtsam_biases.Peer(problem.gravity, Path(path))
        self.problem, self.tolerance, self.limit = problem, tolerance, limit
        self.values = self.peer.values_with_biases(problem, problem.initial)
        self.graphs: dict[str, Any] = {}

    def prepare(self, gauge: str) -> None:
        self._graph(gauge)

    def _graph(self, gauge: str) -> Any:
        if gauge not in self.graphs:
            self.graphs[gauge] = self.peer.graph_of(self.problem, PRIOR_WEIGHT if gauge == "prior" else None)
        return self.graphs[gauge]

    def solve(self, gauge: str, variant: str) -> tuple[State, dict[str, Any]]:
        import gtsam

        graph = self._graph(gauge)
        parameters = gtsam.LevenbergMarquardtParams.CeresDefaults()
        parameters.setRelativeErrorTol(self.tolerance)
        parameters.setMaxIterations(self.limit)
        parameters.setOrderingType(variant.upper())
        begin = time.perf_counter()
        optimizer = gtsam.LevenbergMarquardtOptimizer(graph, self.values, parameters)
        values = optimizer.optimize()
        seconds = time.perf_counter() - begin
        return self.peer.state_of(values, self.problem.initial), {
            "seconds": seconds,
            "iterations": optimizer.iterations(),
            "cost": optimizer.error(),
            "converged": optimizer.iterations() < self.limit,
        }

    def covariance(self, state: State, gauge: str, variant: str) -> tuple[Array, float]:
        import gtsam

        graph, values = self._graph(gauge), self.peer.values_with_biases(self.problem, state)
        if variant == "blocks":
            pairs = self.peer.keyframe_keys(state.n_keyframes)
            begin = time.perf_counter()
            marginals = gtsam.Marginals(graph, values)
            joints = [marginals.jointMarginalCovariance(pair) for pair in pairs]
            seconds = time.perf_counter() - begin
            return self.peer.blocks_in_our_parameters(joints, state), seconds
        keys = self.peer.motion_keys(state.n_keyframes)
        begin = time.perf_counter()
        joint = gtsam.Marginals(graph, values).jointMarginalCovariance(keys)
        seconds = time.perf_counter() - begin
        return self.peer.in_our_parameters(joint, state), seconds


class Scipy:
    """``scipy.optimize.least_squares``, trust region reflective, with the analytic sparse Jacobian."""

    def __init__(self, problem: Problem, threads: int, tolerance: float, limit: int, path: str) -> None:
        from .model import Model

        self.model, self.tolerance, self.limit = Model(problem), tolerance, limit

    def prepare(self, gauge: str) -> None:
        pass

    def solve(self, gauge: str, variant: str) -> tuple[State, dict[str, Any]]:
        from scipy.optimize import least_squares

        model = self.model
        begin = time.perf_counter()
        result = least_squares(
            lambda x: model.residual(model.state(x)),
            np.zeros(model.problem.initial.n_parameters),
            jac=lambda x: model.jacobian(model.state(x), total=True),
            method="trf",
            tr_solver="lsmr",
            x_scale="jac",
            ftol=self.tolerance,
            max_nfev=self.limit,
        )
        return model.state(result.x), {
            "seconds": time.perf_counter() - begin,
            "iterations": result.nfev - 1,
            "cost": float(result.cost),
            "converged": bool(result.success),
        }

    def covariance(self, state: State, gauge: str, variant: str) -> tuple[Array, float]:
        raise NotImplementedError("SciPy's covariances are those of numpy.linalg.pinv")


class Pinv:
    """``numpy.linalg.pinv`` of the dense free Hessian; the Hessian itself is not timed."""

    def __init__(self, problem: Problem, threads: int, tolerance: float, limit: int, path: str) -> None:
        from .model import Model

        self.model = Model(problem)

    def prepare(self, gauge: str) -> None:
        pass

    def solve(self, gauge: str, variant: str) -> tuple[State, dict[str, Any]]:
        raise NotImplementedError("a pseudo-inverse solves no problem")

    def covariance(self, state: State, gauge: str, variant: str) -> tuple[Array, float]:
        J = self.model.jacobian(state, total=False)
        H = (J.T @ J).toarray()
        # Scaled singular values span 1e-9 and less; the four of the gauge are some 1e-16.
        begin = time.perf_counter()
        inverse = np.linalg.pinv(H, rcond=1e-13, hermitian=variant == "hermitian")
        seconds = time.perf_counter() - begin
        motion = 9 * state.n_keyframes
        return inverse[:motion, :motion], seconds


SOLVERS: dict[str, Callable[[Problem, int, float, int, str], Solver]] = {
    "vigauge": Vigauge,
    "gtsam": Gtsam,
    "scipy": Scipy,
    "pinv": Pinv,
}


def peak_mib() -> float:
    """Most memory that this process has had, MiB (kilobytes on Linux, bytes on macOS)."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (2**20 if sys.platform == "darwin" else 2**10)


def serve(solver: Solver, problem: Problem) -> None:
    """Answer requests until stdin ends."""
    state = problem.initial
    matrix: Array = np.empty((0, 0))
    for line in sys.stdin:
        verb, *words = line.split()
        answer: dict[str, Any] = {}
        if verb == "prepare":
            solver.prepare(*words)
        elif verb == "solve":
            state, answer = solver.solve(*words)
        elif verb == "state":
            write_state(Path(words[0]), state)
        elif verb == "at":
            state = read_state(Path(words[0]), problem.initial)
        elif verb == "covariance":
            matrix, seconds = solver.covariance(state, *words)
            answer = {"seconds": seconds}
        elif verb == "matrix":
            write_matrix(Path(words[0]), matrix)
        else:
            raise ValueError(f"unknown request {verb}")
        print(json.dumps(answer | {"peak_mib": peak_mib()}), flush=True)


def main(arguments: list[str]) -> None:
    name, path, threads, tolerance, limit = arguments
    problem = load_problems(path)[0]
    solver = SOLVERS[name](problem, int(threads), float(tolerance), int(limit), path)
    print(json.dumps({"ready": True}), flush=True)
    serve(solver, problem)


if __name__ == "__main__":
    main(sys.argv[1:])
