"""Covariance of an information matrix that another solver made, beside what that solver's users would ask.

python -m benchmarks.foreign [FOLDER]

One process, one thread. The matrices are random but see exactly the directions that a real one sees: the
rows of each measurement are orthogonal to the gauge's.
"""

from __future__ import annotations

import os
import sys
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

import gtsam
import numpy as np

import vigauge as vg
from vigauge.covariance.relative import relative_pose
from vigauge.files import write_json, write_rows
from vigauge.geometry.so3 import Array
from vigauge_paper.figures.style import COLOURS, PAGE, new_figure, save_pictures
from vigauge_paper.run.machine import describe_machine, versions

from .foreign_colmap import colmap_row
from .foreign_dense import agreement_rows, camera_rows
from .foreign_graphs import graph_row, public_rows
from .foreign_peers import ceres_blocks, gtsam_marginals, prior_rows
from .foreign_problems import chain
from .foreign_rows import REPEATS, TURN_S, Sizes, covariance_of, least, row, runs_of
from .process import pinned
from .results import Row

RESULTS = Path(__file__).resolve().parent / "results"
FULL = Sizes()


def keyframe_rows(sizes: Sizes) -> list[Row]:
    """All 9 x 9 blocks of a long chain with loops, and relative poses once these are known."""
    problem = chain(sizes.keyframes, vg.YawTranslation())
    J = problem.jacobian()
    H = (J.T @ J).tocsc()
    prior, share = prior_rows(problem)
    ours, ours_s = least(lambda: blocks_at_centroid(covariance_of(problem, H)))
    fixed = ours.keyframes(vg.FixedGauge())
    start, count = gtsam_marginals(problem, prior), sizes.keyframes

    def marginals() -> tuple[Any, Array]:
        found = start()
        return found, np.array([found.marginalCovariance(k) for k in range(count)])

    (found, theirs), gtsam_s = least(marginals)
    case, what = f"keyframes, n = {H.shape[0]}", "all 9 x 9 blocks, centroid gauge"
    note = "peer: prior on the first keyframe, its share taken off, compared in our fixed gauge"
    peer = theirs - share, gtsam_s
    rows = [row(case, what, (fixed, ours_s), "GTSAM Marginals", peer, note, to_reach="5 times")]
    theirs, ceres_s = least(ceres_blocks(problem, prior), 1)
    peer, runs = (theirs - share, ceres_s), runs_of(1, "Ceres")
    rows.append(row(case, what, (fixed, ours_s), "Ceres SPARSE_QR", peer, note, runs, "20 times"))

    R, p = problem.poses
    far = np.random.default_rng(4).permutation(count)[: 2 * (min(sizes.pairs, count // 2))]
    pairs = np.sort(far.reshape(-1, 2), axis=1).tolist()

    def joint(i: int, j: int) -> Array:
        _, J_i, J_j = relative_pose(R[i], p[i], R[j], p[j])
        both = found.jointMarginalCovariance(gtsam.KeyVector([i, j])).fullMatrix()
        D = np.zeros((6, 18))
        D[:, [3, 4, 5, 0, 1, 2]], D[:, [12, 13, 14, 9, 10, 11]] = J_i, J_j
        return D @ both @ D.T

    mine = least(lambda: np.array([ours.relative_pose(i, j).covariance for i, j in pairs]))
    theirs = least(lambda: np.array([joint(i, j) for i, j in pairs]))
    mine, theirs = ((value, seconds / len(pairs)) for value, seconds in (mine, theirs))
    note = f"seconds a pair, mean of {len(pairs)} random pairs"
    what = "relative pose of any pair, after the blocks"
    other = "GTSAM jointMarginalCovariance"
    return [*rows, row(case, what, mine, other, theirs, note, to_reach="0.001 s")]


def blocks_at_centroid(found: vg.EstimateCovariance) -> vg.EstimateCovariance:
    """The covariance, after all blocks were asked for."""
    found.in_gauge(vg.CentroidGauge()).keyframes()
    return found


def draw(rows: list[Row], stem: Path) -> None:
    """``stem``.pdf and .png: a bar for each ratio; right of the line we are faster."""
    goals = [f" (to reach: {r['to_reach']})" if r["to_reach"] else "" for r in rows[::-1]]
    names = [f"{r['case']}: {r['what']}\n{r['peer']}" for r in rows[::-1]]
    labels = [name + goal for name, goal in zip(names, goals, strict=True)]
    ratios = [float(str(r["ratio"])) for r in rows[::-1]]
    with new_figure(PAGE, 3.4) as (figure, axes):
        axes.barh(labels, [ratio - 1.0 for ratio in ratios], left=1.0, color=COLOURS["free"])
        for k, ratio in enumerate(ratios):
            axes.annotate(
                f"{ratio:.3g}" if ratio < 1e3 else f"{ratio:.0f}",
                (max(ratio, 1.0), k),
                (3, 0),
                textcoords="offset points",
                va="center",
            )
        axes.margins(x=0.18)
        axes.axvline(1.0, color="k", lw=0.8)
        axes.set_xscale("log")
        axes.set_xlabel("their time over ours")
        save_pictures(figure, stem)


def main(folder: Path = RESULTS, sizes: Sizes = FULL) -> list[Row]:
    raced = [*keyframe_rows(sizes), graph_row(sizes), *camera_rows(sizes)]
    rows = [*raced, *agreement_rows(sizes), *public_rows(sizes), colmap_row()]
    write_rows(folder / "foreign.csv", rows)
    peers = {name: version(name) for name in ("gtsam", "pyceres", "pycolmap", "numba")}
    about = {"machine": describe_machine(), "versions": versions(), "peers": peers, "sizes": asdict(sizes)}
    threads = {name: value for name, value in sorted(os.environ.items()) if name.endswith("_NUM_THREADS")}
    write_json(
        folder / "foreign.json", about | {"repeats": REPEATS, "seconds_of_a_turn": TURN_S, "threads": threads}
    )
    draw(raced, folder / "foreign")
    return rows


if __name__ == "__main__":
    if pinned(1).items() - os.environ.items():  # libraries read these when they are loaded
        os.execve(sys.executable, [sys.executable, "-m", "benchmarks.foreign", *sys.argv[1:]], pinned(1))
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else RESULTS)
