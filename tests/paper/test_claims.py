"""The ledger: each claim must be able to come out either way, from result files alone."""

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from support import ROOT
from support.results import Change, Results
from vigauge_paper.claims import (
    CLAIMS,
    Criteria,
    Evidence,
    Verdict,
    explanations,
    headline,
    ledger,
    paired_statistics,
)
from vigauge_paper.claims.claim import resolve, same, together
from vigauge_paper.claims.ledger import TIMED
from vigauge_paper.experiments import damping, exchange, tolerance
from vigauge_paper.experiments.evidence import NoEvidenceError
from vigauge_paper.experiments.statistics import Interval, effect_size
from vigauge_paper.ids import CONFIGURATIONS, FIX_AGAIN
from vigauge_paper.prior import READINGS, RESIDUAL

PUBLISHED = ROOT / "data/published"
CRITERIA = Criteria(
    accuracy_margin=0.025,
    cost_margin=0.043,
    covariance_margin=0.116,
    confidence=0.99,
    resamples=500,
    seed=1,
    sweep_span=0.025,
    settled_span=0.01,
)


def evidence(results: Results, source: str = "euroc") -> Evidence:
    """The evidence of made-up results, written to their folder."""
    return Evidence(
        **results.evidence(),
        sweep_configuration="sine_plane",
        source=source,
        cpu="made-up processor",
        criteria=CRITERIA,
        reading=RESIDUAL,
        machine_hall="MH_01_easy",
        vicon_room="V1_01_easy",
    )


def judge(results: Results, source: str = "euroc") -> dict[str, str]:
    """Verdicts by claim."""
    return {str(row["id"]): str(row["verdict"]) for row in ledger(evidence(results, source))}


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


def value(column: str, number: object, **where: object) -> Change:
    """One value in a column, in the rows where other columns have what is given."""

    def change(table: pd.DataFrame) -> pd.DataFrame:
        chosen = pd.Series(True, index=table.index)
        for name, wanted in where.items():
            chosen &= table[name] == wanted
        assert chosen.any()
        return table.assign(**{column: table[column].where(~chosen, number)})

    return change


def shrinking() -> np.ndarray:
    """A fixed covariance of three keyframes whose positions get more certain with time."""
    fixed = np.diag(np.full(27, 1e-4))
    fixed[range(3, 9), range(3, 9)] = [3e-4, 3e-4, 3e-4, 2e-4, 2e-4, 2e-4]
    fixed[range(3), range(3)] = 0.0
    return fixed


def lopsided() -> np.ndarray:
    """A free covariance with all of its uncertainty in the last keyframes."""
    return np.diag(np.r_[np.full(3, 1e-9), np.full(24, 1e-4)])


ALTERATIONS: dict[str, dict] = {
    "invariance": {"reasons": {"orbit": value("relative_change", 1e-6, experiment="arc_plane")}},
    "rank": {"covariance": {"arc_plane": {"rank_free": 37}}},
    "parameters": {"covariance": {"V1_01_easy": {"rank_prior": 38}}},
    "yaw-parametrisation": {"reasons": {"yaw": value("yaw_deg", 0.0, update="(8)")}},
    "weight-accuracy": {"sweep": weights(v_rmse_mps=[0.02, 0.02, 0.03, 0.02, 0.02, 0.02])},
    "weight-accuracy-settles": {"sweep": weights(phi_rmse_deg=[0.12, 0.12, 0.12, 0.12, 0.12, 0.1201])},
    "weight-peak": {"sweep": weights(iterations=[4, 5, 6, 7, 8, 9])},
    "weight-cost-settles": {"sweep": weights(iterations=[4, 12, 8, 6, 5, 9])},
    "regime-large": {"trace": value("prior_position_m", 0.01, weight="1e8", iteration=2)},
    "regime-small": {"trace": value("mean_reprojection_px", 2.0, weight="100", iteration=2)},
    "regime-zero": {"trace": value("cost", 99.0, weight="0", iteration=4)},
    "large-weights-unstable": {"reasons": {"weights": value("converged", True)}},
    "same-accuracy": {"solutions": {"rec_random": scaled("v_rmse_mps", "free", 1.1)}},
    "neither-better": {"reasons": {"tolerance": scaled("p_rmse_m", "free", 1.01)}},
    "prior-fixation-digits": {"solutions": {"arc_plane": scaled("p_rmse_m", "prior", 1.00001)}},
    "prior-fixation": {"solutions": {"arc_plane": scaled("p_rmse_m", "prior", 1.1)}},
    "fewer-iterations": {"solutions": {"rec_plane": iterations(free=6)}},
    "free-faster": {"timing": {name: scaled("seconds", "free", 1.3) for name in CONFIGURATIONS}},
    "time-per-iteration": {"timing": {name: scaled("seconds", "prior", 0.9) for name in CONFIGURATIONS}},
    "prior-cost": {"solutions": {name: iterations(prior=8) for name in CONFIGURATIONS}},
    "fixed-grows": {"covariance": {"sine_plane": {"fixed": shrinking()}}},
    "fixed-grows-euroc": {"covariance": {"V1_01_easy": {"fixed": shrinking()}}},
    "free-spreads": {"covariance": {"rec_random": {"free": lopsided()}}},
    "prior-covariance": {"covariance": {"V1_01_easy": {"relative_frobenius_prior": 18.0}}},
    "identity": {"covariance": {"V1_01_easy": {"relative_frobenius_same_point": 1e-8}}},
    "transformed-simulation": {"covariance": {"sine_plane": {"relative_frobenius_converged": 0.01}}},
    "transformed-euroc": {"covariance": {"V1_01_easy": {"relative_frobenius_converged": 0.001}}},
    "ellipses-euroc": {"covariance": {"MH_01_easy": {"transformed": shrinking()}}},
    "euroc-iterations": {"solutions": {"V1_01_easy": iterations(free=6)}},
    "euroc-time": {"timing": {"MH_01_easy": scaled("seconds", "free", 1.5)}},
    "euroc-prior-iterations": {"solutions": {"V1_01_easy": iterations(prior=7)}},
    "euroc-accuracy": {"solutions": {"MH_01_easy": scaled("phi_rmse_deg", "free", 1.1)}},
}
ON_EUROC = {
    "fixed-grows-euroc",
    "transformed-euroc",
    "ellipses-euroc",
    "euroc-iterations",
    "euroc-time",
    "euroc-prior-iterations",
    "euroc-accuracy",
}


def published_sweep() -> dict:
    """The paper's Figs. 4 to 6 as tables of one trial."""
    fig04 = pd.read_csv(PUBLISHED / "fig04_prior_weight_rmse.csv")
    fig05 = pd.read_csv(PUBLISHED / "fig05_prior_weight_cost.csv").query("quantity == 'iterations'")
    fig06 = pd.read_csv(PUBLISHED / "fig06_prior_error_paths.csv", dtype={"weight": str})
    counts = dict(zip(fig05["weight"].astype(float), fig05["median"], strict=True))

    def sweep(table: pd.DataFrame) -> pd.DataFrame:
        rows = []
        for _, row in fig04.iterrows():
            weight = float(row["weight_guess"])
            below = max(w for w in counts if w <= weight)
            rows.append(
                {
                    "weight": f"{weight:g}",
                    "iterations": counts[below],
                    "p_rmse_m": row["p_rmse_m"],
                    "phi_rmse_deg": row["phi_rmse_rad"],
                    "v_rmse_mps": row["v_rmse_mps"],
                }
            )
        one = pd.DataFrame(rows).assign(trial=0, converged=True, status="function tolerance")
        return pd.concat([one.assign(reading=reading) for reading in READINGS])

    def trace(table: pd.DataFrame) -> pd.DataFrame:
        wide = fig06.pivot(index=["weight", "step"], columns="panel", values=["prior_error"])
        wide.columns = [f"prior_{panel}" for _, panel in wide.columns]
        pixels = fig06.groupby(["weight", "step"])["mean_reprojection_px"].first()
        one = wide.join(pixels).reset_index().rename(columns={"step": "iteration"}).assign(trial=0, cost=1.0)
        return pd.concat([one.assign(reading=reading) for reading in READINGS])

    return {"sweep": sweep, "trace": trace}


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
    found = evidence(Results(tmp_path))
    differences = found.paired("arc_plane", "p_rmse_m", "free", "fix")
    interval = found.mean_interval(differences)
    assert interval.low < differences.mean() < interval.high
    assert interval == found.mean_interval(differences)


def test_equivalence_is_no_failed_test_of_difference(tmp_path: Path) -> None:
    """Catches "no significant difference" passing for "the same": a wide interval shows nothing."""

    def noisy(table: pd.DataFrame) -> pd.DataFrame:
        sign = table["trial"].map({trial: (-1) ** trial for trial in range(12)})
        factor = (1.0 + 0.2 * sign).where(table["gauge"] == "free", 1.0)
        return table.assign(v_rmse_mps=table["v_rmse_mps"] * factor)

    found = evidence(Results(tmp_path, solutions={"arc_plane": noisy}))
    interval = found.difference(["arc_plane"], "v_rmse_mps", "free")
    assert interval.low < 0.0 < interval.high
    assert {row["id"]: row["verdict"] for row in ledger(found)}["same-accuracy"] == "not resolvable"
    (row,) = (
        row
        for row in paired_statistics(found)
        if (row["configuration"], row["gauge"], row["quantity"]) == ("arc_plane", "free", "v_rmse_mps")
    )
    assert not row["equivalent"]


def test_time_ratios_are_paired(tmp_path: Path) -> None:
    """Catches a ratio of medians: a machine that slows from trial to trial must not widen the interval."""

    def slowing(table: pd.DataFrame) -> pd.DataFrame:
        return table.assign(seconds=table["seconds"] * 2.0 ** table["trial"])

    ratio = evidence(Results(tmp_path, timing={"arc_plane": slowing})).time_ratio(["arc_plane"], "prior")
    assert ratio.within(0.001, centre=1.02)


def test_a_disturbed_repeat_moves_no_ratio(tmp_path: Path) -> None:
    """An effect of 2 % drowned by whatever else ran during most of the repeats."""

    def disturbed(table: pd.DataFrame) -> pd.DataFrame:
        slow = 1.0 + np.random.default_rng(0).exponential(0.3, len(table))
        quiet = table["repeat"] == table["trial"] % table["repeat"].nunique()
        return table.assign(seconds=table["seconds"] * np.where(quiet, 1.0, slow))

    ratio = evidence(Results(tmp_path, timing={"arc_plane": disturbed})).time_ratio(["arc_plane"], "prior")
    assert ratio.within(0.005, centre=1.02)


def test_a_slow_moment_of_one_reference_moves_a_ratio_by_half(tmp_path: Path) -> None:
    """Catches a second timing of fixation that nothing but its own ratio is read off."""
    slow = {"timing": {"arc_plane": scaled("seconds", "fix", 1.02)}}
    found = evidence(Results(tmp_path, **slow))
    assert found.time_ratio(["arc_plane"], "prior").within(1e-6, centre=1.02 / 1.01)
    assert found.time_ratio(["arc_plane"], FIX_AGAIN).within(1e-6, centre=1.0 / 1.02)


def test_effect_size() -> None:
    """Catches a division by zero where all trials agree, and a sign lost."""
    assert effect_size(np.zeros(4)) == 0.0
    assert effect_size(np.full(4, -1.0)) == -np.inf
    assert effect_size(np.array([1.0, 3.0])) == pytest.approx(np.sqrt(2.0))


def test_reasons_are_given_for_all_claims(tmp_path: Path) -> None:
    """Catches a reason that fails on its tables; and times without their CPU."""
    found = evidence(Results(tmp_path))
    said = [str(row["why"]) for row in explanations(found)]
    assert not [why for why in said if why.startswith("Not explained") or "nan" in why]
    measured = {str(row["id"]): str(row["measured"]) for row in ledger(found)}
    for claim in ("free-faster", "time-per-iteration", "prior-cost", "euroc-time"):
        assert "made-up processor" in measured[claim]
    assert "to itself, timed twice, 1 [1, 1]" in measured["time-per-iteration"]


def test_covariance_claims_on_euroc_say_how_errors_compare_with_sigmas(tmp_path: Path) -> None:
    """Catches a covariance that "holds" on EuRoC, and nothing beside it says that errors are far larger."""
    results = Results(tmp_path / "a")
    euroc = evidence(results)
    position, rotation, velocity = (
        np.sqrt(np.diagonal(block).sum() / euroc.covariance("MH_01_easy")["n_keyframes"])
        for k in range(3)
        for n in [len(euroc.covariance("MH_01_easy")["fixed"]) // 3]
        for block in [euroc.covariance("MH_01_easy")["fixed"][k * n : (k + 1) * n, k * n : (k + 1) * n]]
    )
    ratios = [
        euroc.mean("MH_01_easy", "p_rmse_m", "fix") / position,
        np.radians(euroc.mean("MH_01_easy", "phi_rmse_deg", "fix")) / rotation,
        euroc.mean("MH_01_easy", "v_rmse_mps", "fix") / velocity,
    ]
    expected = f"On MH_01_easy errors are {min(ratios):.2g} to {max(ratios):.2g} times the predicted sigmas"
    said = {row["id"]: str(row["why"]) for row in explanations(euroc)}
    assert expected in said["ellipses-euroc"]
    assert all("not with errors" in said[name] for name in ("fixed-grows-euroc", "transformed-euroc"))
    rendered = explanations(evidence(Results(tmp_path / "b"), source="rendered"))
    assert not [row for row in rendered if "not with errors" in str(row["why"])]


def test_rows_have_the_columns_and_verdicts_of_the_contract(tmp_path: Path) -> None:
    """Catches a column that outside readers rely on being renamed, and a verdict of another word."""
    rows = ledger(evidence(Results(tmp_path), source="rendered"))
    assert len({row["id"] for row in rows}) == len(CLAIMS)
    for row in rows:
        assert list(row) == [
            *("id", "section", "claim", "published", "measured", "criterion"),
            *("verdict", "verdict_as_printed"),
        ]
        assert {row["verdict"], row["verdict_as_printed"]} <= set(Verdict)


def test_times_of_runs_that_did_not_converge_enter_no_ratio(tmp_path: Path) -> None:
    """A run that stopped at the iteration limit and took ten times as long, judged as a slow gauge."""

    def failed(table: pd.DataFrame) -> pd.DataFrame:
        table.loc[(table["gauge"] == "free") & (table["trial"] % 2 == 0), "converged"] = False
        return table

    def slow(table: pd.DataFrame) -> pd.DataFrame:
        table.loc[(table["gauge"] == "free") & (table["trial"] % 2 == 0), "seconds"] *= 10.0
        return table

    results = Results(tmp_path, solutions={"arc_plane": failed}, timing={"arc_plane": slow})
    ratio = evidence(results).time_ratio(["arc_plane"], "free", each=True)
    assert ratio.estimate == pytest.approx(1.02)
    assert ratio.high == pytest.approx(1.02)


def test_failed_runs_enter_no_reason_and_are_counted(tmp_path: Path) -> None:
    """An explanation that averages runs which never arrived."""

    def fail(table: pd.DataFrame) -> pd.DataFrame:
        bad = (table["gauge"] == "free") & (table["trial"] == 0)
        return table.assign(
            converged=~bad,
            iterations=table["iterations"].mask(bad, 1000),
            p_rmse_m=table["p_rmse_m"].mask(bad, 1e9),
        )

    def fail_sweep(table: pd.DataFrame) -> pd.DataFrame:
        return table.assign(converged=table["weight"] != "1e8")

    good = evidence(Results(tmp_path / "good"))
    altered = {"damping": fail, "tolerance": fail}
    bad = evidence(Results(tmp_path / "bad", reasons=altered, sweep=fail_sweep))
    for why in (damping.sentence, tolerance.sentence):
        assert "left out" not in why(good)
        said = why(bad)
        assert "runs that did not converge left out)" in said
        assert said.replace(said[said.rindex(" (") : -1], "") == why(good)
    weights = (set(found.sweep_table["weight"]) for found in (good, bad))
    assert ["1e8" in found for found in weights] == [True, False]


def test_a_withheld_covariance_explains_nothing(tmp_path: Path) -> None:
    """A reason made of numbers that are not there."""
    gone = {"exchange": lambda table: table[table["experiment"] != "sine_plane"]}
    with pytest.raises(NoEvidenceError, match="the covariance of sine_plane is withheld"):
        exchange.sentence(evidence(Results(tmp_path, reasons=gone)), "sine_plane")


def test_an_interval_that_holds_the_effect_and_none_resolves_nothing() -> None:
    """Catches a verdict from too few trials, and an effect of the other sign that holds."""
    assert resolve(Interval(-0.5, -1.2, 0.2), -1.0) == "not resolvable"
    assert resolve(Interval(-0.1, -0.3, 0.2), -1.0) == "differs"
    assert resolve(Interval(-0.9, -1.1, -0.7), -1.0) == "holds"
    assert resolve(Interval(0.9, 0.7, 1.1), -1.0) == "differs"
    assert together([Verdict.HOLDS, Verdict.UNRESOLVED]) == "not resolvable"


def test_an_interval_over_the_limit_of_the_same_resolves_nothing() -> None:
    """Catches a difference that is seen, and may be too large or not, called the same or another."""
    assert same(Interval(1.04, 1.03, 1.05), 0.043, 1.0) == "not resolvable"
    assert same(Interval(1.03, 1.02, 1.04), 0.043, 1.0) == "holds"
    assert same(Interval(1.05, 1.04, 1.06), 0.043, 1.0) == "not resolvable"
    assert same(Interval(0.04, -0.01, 0.09), 0.025) == "not resolvable"
    assert same(Interval(1.05, 1.045, 1.06), 0.043, 1.0) == "differs"
    assert same(Interval(0.95, 0.94, 0.955), 0.043, 1.0) == "differs"


def test_criteria_have_their_margins_as_numbers(tmp_path: Path) -> None:
    """Catches a criterion whose limit only a note says, and verdicts on times that are not marked."""
    rows = ledger(evidence(Results(tmp_path)))
    criteria = {row["id"]: str(row["criterion"]) for row in rows}
    assert not [text for text in criteria.values() if "{" in text or "margin" in text]
    assert f"{100 * CRITERIA.cost_margin:g} %" in criteria["prior-cost"]
    assert {row["id"] for row in rows if "made-up processor" in str(row["measured"])} == set(TIMED)
    assert f"{len(TIMED)} verdicts rest on times" in headline(rows)


def test_criteria_hold_on_the_papers_own_figures(tmp_path: Path) -> None:
    """Catches a criterion that the published numbers themselves fail."""
    found = evidence(Results(tmp_path, **published_sweep()))
    verdicts = {row["id"]: row["verdict"] for row in ledger(found)}
    claims = ("weight-accuracy", "weight-accuracy-settles", "weight-peak", "weight-cost-settles")
    assert {verdicts[name] for name in (*claims, "regime-large", "regime-small")} == {"holds"}, verdicts


def test_every_claim_says_why_in_one_sentence_with_two_numbers(tmp_path: Path) -> None:
    """Catches a reason that is a table in disguise, and one that stands in two rows."""
    said = [str(row["why"]) for row in explanations(evidence(Results(tmp_path)))]
    assert len(set(said)) == len(CLAIMS)
    for why in said:
        plain = re.sub(r"(Fig|Eq)\. \S+", "", why)
        numbers = re.findall(r"(?<![\w.(+])[-+]?\d+\.?\d*(?:e[-+]?\d+)?(?=[) %]|\.|;|,|$)", plain)
        assert why.endswith(".") and len(numbers) <= 2, why


def test_the_head_names_what_differs_with_the_unstable_weights_first(tmp_path: Path) -> None:
    altered = {"weights": value("converged", True), "orbit": value("relative_change", 1e-6)}
    text = headline(ledger(evidence(Results(tmp_path, reasons=altered))))
    assert text.index("Extremely large weights") < text.index("The cost is invariant")
