"""The ledger: each claim must be able to come out either way, from result files alone."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest

from support.results import CONFIGURATIONS, SEQUENCES, Change, Results
from vigauge.claims import CLAIMS, Criteria, Evidence, ledger

CRITERIA = Criteria(accuracy_margin=0.02, confidence=0.99, resamples=500, seed=1, sweep_span=0.02)


def judge(results: Results, source: str = "euroc") -> dict[str, str]:
    """Verdicts by claim."""
    paths = results.write()
    evidence = Evidence(
        **paths, sweep=results.sweep_file, sequences=SEQUENCES, source=source, criteria=CRITERIA
    )
    return {str(row["id"]): str(row["verdict"]) for row in ledger(evidence)}


def scaled(column: str, gauge: str, factor: float) -> Change:
    """Another size of a column under one gauge."""

    def change(table: pd.DataFrame) -> pd.DataFrame:
        table = table.astype({column: float})
        table.loc[table["gauge"] == gauge, column] *= factor
        return table

    return change


def iterations(**counts: int) -> Change:
    """Other iteration counts, a gauge each."""
    return lambda table: table.assign(iterations=table["gauge"].map(counts).fillna(table["iterations"]))


def failed(gauge: str) -> Change:
    """All runs of a gauge did not converge."""
    return lambda table: table.assign(converged=table["converged"] & (table["gauge"] != gauge))


def weights(**columns: list[float]) -> Change:
    """Other values of the sweep, one a weight."""

    def change(table: pd.DataFrame) -> pd.DataFrame:
        names = list(dict.fromkeys(table["weight"]))
        return table.assign(
            **{
                column: table["weight"].map(dict(zip(names, values, strict=True)))
                for column, values in columns.items()
            }
        )

    return change


ALTERATIONS: dict[str, dict] = {
    "rank": {"covariance": {"arc_plane": {"rank_free": 37}}},
    "weight-accuracy": {"sweep": weights(v_rmse_mps=[0.02, 0.02, 0.03, 0.02, 0.02, 0.02])},
    "weight-peak": {"sweep": weights(iterations=[4, 5, 6, 7, 8, 9])},
    "same-accuracy": {"solutions": {"rec_random": scaled("v_rmse_mps", "free", 1.1)}},
    "neither-better": {"solutions": {name: scaled("p_rmse_m", "free", 1.01) for name in CONFIGURATIONS}},
    "prior-fixation-digits": {"solutions": {"arc_plane": scaled("p_rmse_m", "prior", 1.00001)}},
    "prior-fixation": {"solutions": {"arc_plane": scaled("p_rmse_m", "prior", 1.1)}},
    "fewer-iterations": {"solutions": {"rec_plane": iterations(free=6)}},
    "sine-random": {"solutions": {"sine_random": iterations(free=5)}},
    "time-per-iteration": {"timing": {"arc_random": scaled("seconds", "prior", 0.9)}},
    "identity": {"covariance": {"V1_01_easy": {"relative_frobenius_same_point": 1e-8}}},
    "transformed-simulation": {"covariance": {"sine_plane": {"relative_frobenius_converged": 0.01}}},
    "transformed-euroc": {"covariance": {"V1_01_easy": {"relative_frobenius_converged": 0.001}}},
    "euroc-iterations": {"solutions": {"V1_01_easy": iterations(free=6)}},
    "euroc-accuracy": {"solutions": {"MH_01_easy": scaled("phi_rmse_deg", "free", 1.1)}},
}
ON_EUROC = {"transformed-euroc", "euroc-iterations", "euroc-accuracy"}


def test_results_that_agree_with_the_paper_hold_throughout(tmp_path: Path) -> None:
    """Catches a criterion that cannot be met."""
    verdicts = judge(Results(tmp_path))
    assert set(verdicts.values()) == {"holds"}, verdicts


@pytest.mark.parametrize("claim", [claim.id for claim in CLAIMS])
def test_every_claim_can_differ(tmp_path: Path, claim: str) -> None:
    """Catches a claim that holds whatever was measured: a new one needs an alteration here."""
    verdicts = judge(Results(tmp_path, **ALTERATIONS[claim]))
    assert verdicts[claim] == "differs"


def test_stand_ins_conclude_nothing_about_euroc(tmp_path: Path) -> None:
    """Catches rendered images passing for EuRoC, in claims that hold and in one that does not."""
    verdicts = judge(Results(tmp_path, **ALTERATIONS["euroc-iterations"]), source="rendered")
    assert {id for id, verdict in verdicts.items() if verdict == "not tested"} == ON_EUROC


def test_failed_runs_leave_a_claim_untested(tmp_path: Path) -> None:
    """Catches a mean over nothing that counts as agreement (nan < margin, max(0, nan))."""
    verdicts = judge(Results(tmp_path, solutions={"rec_random": failed("free"), "V1_01_easy": failed("fix")}))
    untested = {id for id, verdict in verdicts.items() if verdict == "not tested"}
    assert {"same-accuracy", "fewer-iterations", "euroc-iterations", "euroc-accuracy"} <= untested
    assert verdicts["prior-fixation"] == "holds"


def test_diverged_runs_are_not_averaged(tmp_path: Path) -> None:
    """Catches one diverged trial that spoils, or hides, a difference of accuracy."""

    def one_diverges(table: pd.DataFrame) -> pd.DataFrame:
        row = table.index[(table["gauge"] == "free") & (table["trial"] == 3)]
        table.loc[row, "p_rmse_m"] = 50.0
        table.loc[row, "converged"] = False
        return table

    assert judge(Results(tmp_path, solutions={"sine_plane": one_diverges}))["same-accuracy"] == "holds"


def test_interval_covers_and_is_repeatable(tmp_path: Path) -> None:
    """Catches an unseeded bootstrap, and an interval that leaves out the sample mean."""
    paths = Results(tmp_path).write()
    evidence = Evidence(
        **paths, sweep=tmp_path / "sweep.csv", sequences=SEQUENCES, source="euroc", criteria=CRITERIA
    )
    differences = evidence.paired("arc_plane", "p_rmse_m", "free", "fix")
    low, high = evidence.interval(differences)
    assert low < differences.mean() < high
    assert (low, high) == evidence.interval(differences)


def test_rows_have_the_columns_and_verdicts_of_the_contract(tmp_path: Path) -> None:
    """Catches a column that outside readers rely on being renamed, and a verdict of another word."""
    paths = Results(tmp_path).write()
    evidence = Evidence(
        **paths, sweep=tmp_path / "sweep.csv", sequences=SEQUENCES, source="rendered", criteria=CRITERIA
    )
    rows = ledger(evidence)
    assert len({row["id"] for row in rows}) == len(CLAIMS)
    for row in rows:
        assert list(row) == ["id", "section", "claim", "published", "measured", "criterion", "verdict"]
        assert row["verdict"] in ("holds", "differs", "not tested")
