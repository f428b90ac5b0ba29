"""Over which part of a range of our assumptions a claim holds: claims on simulated solutions only."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from ..experiments.evidence import Evidence, NoEvidenceError
from ..experiments.statistics import Criteria
from ..ids import ERRORS, Row
from ..prior import RESIDUAL
from .claim import Verdict
from .ledger import CLAIMS, judged

SWEPT = ("same-accuracy", "prior-fixation", "prior-fixation-digits", "fewer-iterations")


def solutions_only(solutions: Mapping[str, Path], criteria: Criteria) -> Evidence:
    """Evidence of simulated solutions and nothing else."""
    nothing = Path()
    return Evidence(
        solutions=solutions,
        timings={},
        covariances={},
        sweep=nothing,
        sweep_trace=nothing,
        sweep_configuration="",
        reasons={},
        source="rendered",
        cpu="",
        criteria=criteria,
        reading=RESIDUAL,
    )


def ratios_to_published(evidence: Evidence, table2: pd.DataFrame) -> list[float]:
    """Ours over the paper's Table II: RMSE of fixation, by configuration and error."""
    theirs = table2[table2["gauge"] == "fix"].set_index("configuration")
    out = []
    for name in evidence.configurations:
        for error in ERRORS:
            try:
                out.append(evidence.mean(name, error, "fix") / float(theirs.loc[name, error]))
            except NoEvidenceError:
                continue
    return out


def judge_setting(
    parameter: str, value: str, solutions: Mapping[str, Path], criteria: Criteria, table2: pd.DataFrame
) -> list[Row]:
    """A row a claim: what was measured and the verdict with ``parameter`` at ``value``.

    ``rmse_ratio`` is the geometric mean of ours over Table II, ``rmse_ratio_low`` and ``_high`` its extremes;
    ``rmse_score`` the mean of |log ratio|.
    """
    evidence = solutions_only(solutions, criteria)
    ratios = ratios_to_published(evidence, table2)
    shared: Row = {
        "parameter": parameter,
        "value": value,
        "rmse_ratio": float(np.exp(np.mean(np.log(ratios)))) if ratios else float("nan"),
        "rmse_ratio_low": min(ratios, default=float("nan")),
        "rmse_ratio_high": max(ratios, default=float("nan")),
        "rmse_score": float(np.mean(np.abs(np.log(ratios)))) if ratios else float("nan"),
    }
    rows: list[Row] = []
    for claim in CLAIMS:
        if claim.id not in SWEPT:
            continue
        measured, verdict = judged(claim, evidence)
        rows.append({**shared, "id": claim.id, "verdict": str(verdict), "measured": measured})
    return rows


def ranges(table: pd.DataFrame) -> list[Row]:
    """A row a claim and parameter: the values at which it holds, and those at which it does not."""
    rows: list[Row] = []
    for (claim, parameter), part in table.groupby(["id", "parameter"], sort=False):
        values = {
            verdict: ", ".join(group["value"]) for verdict, group in part.groupby("verdict", sort=False)
        }
        rows.append(
            {
                "id": claim,
                "parameter": parameter,
                **{name: values.get(name, "-") for name in map(str, Verdict)},
            }
        )
    return rows
