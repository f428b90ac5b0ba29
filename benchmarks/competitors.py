"""Who takes part, in which gauges and ways, and how to start each."""

from __future__ import annotations

import sys
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path

from .native import Unavailable, build

# The function tolerance is tighter than Ceres' default 1e-6, so that all stop at one cost to 1e-6.
FUNCTION_TOLERANCE = 1e-9
MAXIMUM_ITERATIONS = 200

OURS = "vigauge"
GAUGES = ("fix", "prior", "free")


@dataclass(frozen=True)
class Competitor:
    """One solver.

    Attributes
    ----------
    name : of the rows in the results
    command : arguments before (problem file, threads, tolerance, iterations)
    binary : whether it reads the ``.bin`` file instead of the ``.npz``
    gauges : those it can solve in
    covariances : gauge to its way of computing the whole motion covariance there
    blocks : gauges in which it computes the diagonal blocks alone
    environment : set for its process, on top of as many threads for every library
    growth : gauge to the power of the number of parameters with which a covariance's time grows at least
    absent : why it is not to be had here, or None
    """

    name: str
    command: tuple[str, ...]
    binary: bool
    gauges: tuple[str, ...]
    covariances: dict[str, str]
    blocks: tuple[str, ...] = ()
    growth: dict[str, float] = field(default_factory=dict)
    environment: dict[str, str] = field(default_factory=dict)
    absent: str | None = None

    def arguments(self, files: tuple[Path, Path], threads: int) -> list[str]:
        """The whole command line for a problem."""
        problem = files[1] if self.binary else files[0]
        return [*self.command, str(problem), str(threads), repr(FUNCTION_TOLERANCE), str(MAXIMUM_ITERATIONS)]

    def runs_with(self, threads: int, n_keyframes: int) -> bool:
        """Whether it races with more than one thread.

        SciPy has no use for a second one, nor has this GTSAM, which shows it up to where that costs minutes.
        """
        return (
            threads == 1
            or self.name not in ("scipy", "gtsam")
            or (self.name == "gtsam" and n_keyframes <= 300)
        )

    def gauges_at(self, n_keyframes: int) -> tuple[str, ...]:
        """Gauges solved in at a size: peers of long problems in the free one only, for time's sake."""
        return tuple(g for g in self.gauges if n_keyframes < 300 or self.name == OURS or g == "free")

    def variants(self, n_keyframes: int) -> tuple[str, ...]:
        """Ways to solve, all tried in the first round; the faster one counts.

        Where the outcome is known from smaller sizes, and a try costs minutes, only the better is tried.
        """
        if self.name == "ceres":
            if n_keyframes > 300:
                return ("sparse_schur",)
            return ("dense_schur", "sparse_schur") if n_keyframes > 10 else ("dense_schur",)
        if self.name == "gtsam":
            return ("colamd", "metis") if n_keyframes <= 100 else ("colamd",)
        return ("-",)


def competitors(build_folder: Path) -> list[Competitor]:
    """All of them, with the reason where one is absent."""

    def python(name: str) -> tuple[str, ...]:
        return (sys.executable, "-m", "benchmarks.worker", name)

    program, absent = "", None
    try:
        program = str(build(build_folder))
    except Unavailable as error:
        absent = str(error)
    no_gtsam = (
        None if find_spec("gtsam") else "gtsam is left out: it is not installed (pip install vigauge[bench])"
    )
    return [
        Competitor(
            OURS,
            python("vigauge"),
            False,
            GAUGES,
            dict.fromkeys(GAUGES, "-"),
            GAUGES,
            # Its loops have the threads; those of BLAS would only get in their way.
            environment={"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"},
        ),
        Competitor(
            "ceres",
            (program,),
            True,
            GAUGES,
            {"fix": "sparse_qr", "free": "dense_svd"},
            growth={"free": 2.5},
            absent=absent,
        ),
        Competitor(
            "gtsam", python("gtsam"), False, ("prior", "free"), {"prior": "-"}, ("prior",), absent=no_gtsam
        ),
        Competitor("scipy", python("scipy"), False, ("free",), {}),
        Competitor("pinv", python("pinv"), False, (), {"free": "full"}, growth={"free": 2.5}),
    ]
