"""The sweep of assumptions: the setting that was asked for is the one that is run and judged."""

from pathlib import Path

import pandas as pd
import pytest

from paper.test_claims import ALTERATIONS, CRITERIA
from support.results import SEQUENCES, Results
from support.simulated import SETTINGS
from vigauge.errors import ConfigError
from vigauge.solver.levenberg_marquardt import Options
from vigauge_paper.claims import CLAIMS
from vigauge_paper.claims.sensitivity import SWEPT, judge_setting, ranges
from vigauge_paper.experiments.changes import changed
from vigauge_paper.ids import CONFIGURATIONS

TABLE2 = pd.DataFrame(
    [
        {"configuration": name, "gauge": "fix", "p_rmse_m": 0.03, "phi_rmse_deg": 0.24, "v_rmse_mps": 0.02}
        for name in CONFIGURATIONS
    ]
)


def verdicts(results: Results) -> dict[str, str]:
    files = {name: file for name, file in results.write()["solutions"].items() if name not in SEQUENCES}
    rows = judge_setting("n_landmarks", "60", files, CRITERIA, TABLE2)
    assert all(0.4 < float(str(row["rmse_ratio_low"])) < 0.6 for row in rows), "rotation is half the paper's"
    return {str(row["id"]): str(row["verdict"]) for row in rows}


def test_claims_are_judged_on_solutions_alone(tmp_path: Path) -> None:
    """Catches a swept claim that needs files which the sweep does not make."""
    assert verdicts(Results(tmp_path)) == dict.fromkeys((c.id for c in CLAIMS if c.id in SWEPT), "holds")


@pytest.mark.parametrize("claim", SWEPT)
def test_swept_claims_can_differ(tmp_path: Path, claim: str) -> None:
    assert verdicts(Results(tmp_path, **ALTERATIONS[claim]))[claim] == "differs"


def test_ranges_list_the_values_by_verdict() -> None:
    table = pd.DataFrame(
        {
            "id": "rank",
            "parameter": "sigma_px",
            "value": ["0.5", "1", "2"],
            "verdict": ["holds", "holds", "differs"],
        }
    )
    assert ranges(table) == [
        {
            "id": "rank",
            "parameter": "sigma_px",
            "holds": "0.5, 1",
            "differs": "2",
            "not resolvable": "-",
            "not tested": "-",
        }
    ]


def test_one_number_is_changed_and_keeps_its_type() -> None:
    """Catches a value that goes nowhere, and 20.0 keyframes."""
    settings, solver = changed(SETTINGS, Options(), "n_keyframes", 20.0)
    assert settings.n_keyframes == 20 and isinstance(settings.n_keyframes, int) and solver == Options()
    settings, solver = changed(SETTINGS, Options(), "function_tolerance", 1e-8)
    assert settings == SETTINGS and solver.function_tolerance == 1e-8
    with pytest.raises(ConfigError, match="sensitivity"):
        changed(SETTINGS, Options(), "n_keyframe", 20.0)
