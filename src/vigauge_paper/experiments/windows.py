"""Windows: other parts of the recordings, which go through the rules of the paper's own sequences.

What cannot be used is a row that says where it stopped and why, in the words of the error.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from vigauge.files import read_rows

from ..ids import GAUGES, Row

# Errors that are compared at the start and at the optimum: aligned by the first pose, as in the
# paper; and positions aligned over all poses, where an error of the first true pose does not
# enter every other one.
COMPARED = ("p_rmse_m", "phi_rmse_deg", "v_rmse_mps", "p_rmse_all_poses_m")
DISTANCES = ("relative_frobenius_same_point", "relative_frobenius_converged")
_ABOUT = ("window", "sequence", "start_s", "end_s", "truth", "keyframes", "landmarks", "check_warnings")
_SOLVED = ("noise", "gauge", "status", "converged", "iterations", "cost")
_COLUMNS = (
    *_ABOUT,
    *_SOLVED,
    *(f"start_{name}" for name in COMPARED),
    *COMPARED,
    *DISTANCES,
    "stopped_at",
    "why",
)


def window_rows(data: Path, window: str, settings: Mapping[str, object]) -> list[dict[str, str]]:
    """A row a noise model and gauge, or one row where the window cannot be used.

    ``data`` is the folder of results, ``settings`` are start_s, end_s and truth. A column that a window
    did not get to is empty.
    """
    check = json.loads((data / "checks" / f"{window}.json").read_text(encoding="utf-8"))
    report = json.loads((data / "sequences" / window / "report.json").read_text(encoding="utf-8"))
    about = {**report, **settings, "window": window, "sequence": check["sequence"]}
    about["check_warnings"] = len(check["warnings"])
    solved: list[dict[str, str]] = [{}]
    if "stopped_at" not in report:
        solutions = [
            row for row in read_rows(data / "solutions" / window / "solutions.csv") if row["gauge"] in GAUGES
        ]
        covariances = {row["noise"]: row for row in read_rows(data / "covariance" / f"{window}.csv")}
        solved = [
            row | _covariance(covariances[row["noise"]], [s for s in solutions if s["noise"] == row["noise"]])
            for row in sorted(solutions, key=lambda row: row["noise"])
        ]
    return [{name: str((about | row).get(name, "")) for name in _COLUMNS} for row in solved]


def _covariance(found: Mapping[str, str], solved: Sequence[Mapping[str, str]]) -> dict[str, str]:
    """Distances of the covariances under a noise model, or why there are none."""
    failed = "; ".join(f"{row['gauge']}: {row['status']}" for row in solved if row["converged"] != "True")
    if failed:
        return {"stopped_at": "solve", "why": failed}
    if found["withheld"]:
        return {"stopped_at": "covariance", "why": found["withheld"]}
    return {name: found[name] for name in DISTANCES}


def summarise(rows: Sequence[Mapping[str, str]], gauge: str = "free") -> list[Row]:
    """Whether the optimum is nearer to the truth than the start, over all windows, in pairs.

    A row a noise model and error: windows, in how many the optimum is nearer, the median of the
    ratios of the two errors, and the two-sided p of a sign test. Windows whose run did not
    converge are counted and left out.
    """
    from scipy.stats import binomtest  # half a second, for one number

    out: list[Row] = []
    mine = [row for row in rows if row["gauge"] == gauge]
    for noise in dict.fromkeys(row["noise"] for row in mine):
        of_model = [row for row in mine if row["noise"] == noise]
        good = [row for row in of_model if str(row["converged"]) == "True"]
        for error in COMPARED:
            pairs = np.array([[float(row[f"start_{error}"]), float(row[error])] for row in good])
            if not len(pairs):
                continue
            nearer = int(np.count_nonzero(pairs[:, 1] < pairs[:, 0]))
            out.append(
                {
                    "noise": noise,
                    "error": error,
                    "windows": len(pairs),
                    "left_out": len(of_model) - len(good),
                    "optimum_nearer": nearer,
                    "median_start": float(np.median(pairs[:, 0])),
                    "median_optimum": float(np.median(pairs[:, 1])),
                    "median_ratio": float(np.median(pairs[:, 1] / pairs[:, 0])),
                    "sign_test_p": float(binomtest(nearer, len(pairs)).pvalue),
                }
            )
    return out
