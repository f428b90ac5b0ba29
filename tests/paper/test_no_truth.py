"""Table III without any ground truth in the estimate: whose rows, and what is said of them."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml

import vigauge as vg
from support import ROOT
from vigauge.files import write_rows
from vigauge_paper.experiments.solves import bias_errors
from vigauge_paper.ids import BIAS_ERRORS
from vigauge_paper.no_truth import no_truth_rows, no_truth_sentence
from vigauge_paper.workflow.sequences import Sequences

FORMS = {"hall": ["hall", "hall_no_truth"], "room": ["room"]}
GAUGES = ("fix", "free", "prior")


def results(
    folder: Path, converged: bool = True, free: float = 1.001
) -> tuple[dict[str, Path], dict[str, Path]]:
    """Files of both forms: without truth, errors are twice as large, and larger in the free gauge."""
    files: tuple[dict[str, Path], dict[str, Path]] = ({}, {})
    for name, size in (("hall", 1.0), ("hall_no_truth", 2.0)):
        solved = [
            {
                "noise": noise,
                "gauge": gauge,
                "converged": converged or gauge == "fix",
                "iterations": 5 + GAUGES.index(gauge),
                **dict.fromkeys(
                    ("p_rmse_m", "phi_rmse_deg", "v_rmse_mps"),
                    wrong * size * (free if gauge == "free" else 1.0),
                ),
                **dict.fromkeys(BIAS_ERRORS, 0.01 * wrong if name == "hall_no_truth" else ""),
            }
            for noise, wrong in (("consistent", 10.0), ("headline", 1.0))
            for gauge in GAUGES
        ]
        apart = [
            {"noise": noise, "relative_frobenius_same_point": 1e-12, "relative_frobenius_converged": value}
            for noise, value in (("consistent", 1.0), ("headline", 1e-5 * size))
        ]
        for kind, rows in zip(files, (solved, apart), strict=True):
            kind[name] = folder / f"{name}_{'solutions' if rows is solved else 'distances'}.csv"
            write_rows(kind[name], rows)
    return files


def test_rows_are_those_of_each_form_at_the_headline_noise(tmp_path: Path) -> None:
    """Catches forms exchanged, the other noise model, and a sequence that has no other form."""
    rows = pd.DataFrame(no_truth_rows(FORMS, *results(tmp_path), "rendered"))
    assert rows["form"].tolist() == ["hall"] * 3 + ["hall_no_truth"] * 3
    assert rows["biases"].tolist() == ["known"] * 3 + ["estimated"] * 3
    assert rows["gauge"].tolist() == [*GAUGES, *GAUGES]
    assert rows["p_rmse_m"].tolist() == [1.0, 1.001, 1.0, 2.0, 2.002, 2.0]
    assert rows["gyro_bias_rmse_radps"].tolist() == [""] * 3 + [0.01] * 3
    assert rows["relative_frobenius_converged"].tolist() == [1e-5] * 3 + [2e-5] * 3


def test_the_sentence_says_whether_gauges_agree(tmp_path: Path) -> None:
    """Catches a difference that is not relative to fixation, a wrong ratio, and a run that failed unsaid."""
    text = no_truth_sentence(no_truth_rows(FORMS, *results(tmp_path), "rendered"), 0.025)
    assert "at most 0.1 %, which counts as the same (margin 2.5 %)" in text
    assert "2, 2, 2 times those of hall" in text and "fix 5, free 6, prior 7" in text
    assert "biases are 0.01 rad/s and 0.01 m/s^2 from the truth's" in text
    apart = no_truth_sentence(no_truth_rows(FORMS, *results(tmp_path, free=1.2), "rendered"), 0.025)
    assert "at most 20 %, which does not count as the same" in apart
    failed = no_truth_sentence(no_truth_rows(FORMS, *results(tmp_path, converged=False), "rendered"), 0.025)
    assert failed == "hall_no_truth: a run did not converge."


def test_biases_off_by_three_and_four_are_five_off() -> None:
    """Catches an error a coordinate instead of a vector's, exchanged sensors, and a truth without biases."""
    motion = vg.example_problem().initial
    truth = motion.with_biases(np.zeros(3), np.zeros(3))
    errors = bias_errors(motion.with_biases(np.array([3.0, 4.0, 0.0]), np.array([0.0, 0.0, 0.1])), truth)
    assert [errors[name] for name in BIAS_ERRORS] == pytest.approx([5.0, 0.1])
    assert set(bias_errors(truth, motion).values()) == {""} == set(bias_errors(motion, truth).values())


def test_nothing_where_no_sequence_has_another_form() -> None:
    """Catches rows of a sequence that is compared with nothing."""
    assert no_truth_rows({"room": ["room"]}, {}, {}, "euroc") == []


def test_every_sequence_of_the_configuration_has_a_form_without_truth() -> None:
    """Catches a form that still takes biases from a truth, and one that stands under another sequence."""
    config = yaml.safe_load((ROOT / "config" / "config.yaml").read_text("utf-8"))
    for root, names in (("", ("hall", "room")), ("somewhere", ("MH_01", "V1_01"))):
        sequences = Sequences.of(config, root)
        assert len(sequences.no_truth) == 2
        for name, (sequence, forms) in zip(names, sequences.no_truth.items(), strict=True):
            assert forms == [sequence, f"{name}_no_truth"]
            assert sequences.entries[forms[1]]["front_end"]["biases"] == "estimated"
            assert sequences.entries[forms[1]]["folder"] == sequences.entries[sequence]["folder"]
