"""What a row of foreign.csv holds, and the clock behind it."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import vigauge as vg
from vigauge.geometry.so3 import Array

from .foreign_problems import Chain
from .results import Row

# Runs of each side: no fewer than these, and what is short runs until it has taken a second. First runs of a
# process are slower, ours and theirs: they load machine code and get fresh memory.
REPEATS, TURN_S = 3, 1.0
# What an answer is, and its seconds.
Timed = tuple[Array, float]


@dataclass(frozen=True)
class Sizes:
    keyframes: int = 2222
    poses: int = 3333
    cameras: int = 49
    points: int = 7776
    observations: int = 31843
    oracle: int = 60
    pairs: int = 50
    public: int = 2500


def runs_of(repeats: int, peer: str = "the peer") -> str:
    """What a row says of how often each side ran."""
    all_alike = f"least of {REPEATS} runs or a second's"
    return all_alike if repeats == REPEATS else f"{peer} ran once, ours {all_alike}"


_RUNS = runs_of(REPEATS)


def least(work: Callable[[], Any], repeats: int = REPEATS) -> tuple[Any, float]:
    """What ``work`` gives, and the least seconds of its runs: one, or ``repeats`` and a second's."""
    seconds: list[float] = []
    while len(seconds) < repeats or (repeats > 1 and sum(seconds) < TURN_S):
        begin = time.perf_counter()
        out = work()
        seconds.append(time.perf_counter() - begin)
    return out, min(seconds)


def row(
    case: str,
    what: str,
    ours: Timed,
    peer: str,
    theirs: Timed,
    note: str,
    runs: str = _RUNS,
    to_reach: str = "",
) -> Row:
    """``ratio`` is their time over ours; the difference is in relative Frobenius norm.

    ``to_reach``: "5 times" for the ratio, "1 s" for our time.
    """
    return {
        "case": case,
        "what": what,
        "ours_s": f"{ours[1]:.3g}",
        "peer": peer,
        "peer_s": f"{theirs[1]:.3g}",
        "ratio": f"{theirs[1] / ours[1]:.3g}",
        "to_reach": to_reach,
        "relative_difference": f"{vg.relative_frobenius(ours[0], theirs[0]):.1e}",
        "note": f"{note}; {runs}",
    }


def covariance_of(problem: Chain, H: Any) -> vg.EstimateCovariance:
    at = problem.poses, problem.velocities
    return vg.Covariance.from_hessian(H, problem.layout, *at, group=problem.group)
