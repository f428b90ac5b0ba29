"""NEES of simulated trials: the same in every gauge, in its band, and outside where something is broken."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

from support.simulated import SETTINGS, TIGHT, scene, trial
from vigauge.covariance.covariance import Covariance
from vigauge.solver.residuals import inertial_residual
from vigauge_paper.experiments import nees as experiment
from vigauge_paper.experiments.experiment import Material
from vigauge_paper.experiments.nees import (
    BROKEN,
    LAST,
    LIKELIHOOD,
    RIGHT,
    SHARED,
    WITH_LANDMARKS,
    FreeMotionGauge,
    Settings,
    inertial_factors,
    nees_by_gauge,
)
from vigauge_paper.figures import nees as figure


@pytest.fixture(scope="module")
def table() -> pd.DataFrame:
    """The experiment's table on few landmarks and trials."""
    material = Material(
        SETTINGS,
        TIGHT,
        1e10,
        "sine_plane",
        float,
        problems=dict.fromkeys(("arc_random", "sine_plane"), Path()),
    )
    settings = Settings(24, 0.999, 20, sigma_factor=0.5, prior_offset=10.0, samples_per_factor=2)
    return pd.DataFrame(experiment.rows(material, settings))


def test_motion_has_one_nees_in_all_gauges() -> None:
    """Catches an error that is not taken to the gauge of its covariance, and a wrong number of freedoms."""
    problem, truth = trial(), scene().truth
    found = nees_by_gauge(problem, truth, TIGHT)
    assert found is not None
    dof = 9 * truth.n_keyframes - 4
    for gauge in ("keyframe", "centroid", "free"):
        assert found[gauge] == (dof, pytest.approx(found["fix"][1], rel=1e-6)), gauge
    assert found[LIKELIHOOD][0] == truth.n_parameters - 4
    assert found[LAST][0] == 9
    # The landmarks' hold on the gauge is four numbers more.
    assert found[WITH_LANDMARKS][0] == dof + 4 and found[WITH_LANDMARKS][1] > found["fix"][1]


def test_free_gauge_of_the_motion_is_the_pseudo_inverse_of_the_reduced_system() -> None:
    problem, truth = trial(), scene().truth
    covariance = Covariance.of(problem, truth)
    block = covariance.motion(FreeMotionGauge())
    S = covariance.reduced.matrix
    assert np.allclose(S @ block @ S, S, rtol=1e-6, atol=1e-6 * np.abs(S).max())
    U = covariance.U[: len(block)]
    sigma = np.sqrt(np.diagonal(block))
    assert np.abs(block @ U).max() < 1e-8 * sigma.max() ** 2 * np.abs(U).max()


def test_all_is_in_its_band_as_simulated(table: pd.DataFrame) -> None:
    """Catches a covariance that is too small or too large, in any configuration or gauge."""
    good = table[table["case"].isin((RIGHT, *BROKEN.values()))]
    assert set(good["configuration"]) == {"arc_random", "sine_plane"}
    assert good["inside"].all(), good[~good["inside"]]
    assert (good["trials"] == 24).all()


@pytest.mark.parametrize("case", [case for case in BROKEN if case != SHARED])
def test_what_is_broken_leaves_its_band(table: pd.DataFrame, case: str) -> None:
    """Catches a band that nothing can leave."""
    broken = table[table["case"] == case]
    assert len(broken) == 7
    assert not broken["inside"].any(), broken[broken["inside"]]


def test_shared_samples_correlate_factors_whose_own_covariance_is_right() -> None:
    """Catches samples that are called shared and are not, and a path error of few samples taken for noise."""
    sparse = scene(n_landmarks=20, imu_rate_hz=2 * 9 / 2.5)
    problem = trial(n_landmarks=20, imu_rate_hz=2 * 9 / 2.5)
    correlation = {}
    for shared in (True, False):
        residuals = np.array(
            [
                inertial_residual(
                    replace(problem, inertial=inertial_factors(sparse, number, shared)), sparse.truth
                )
                for number in range(60)
            ]
        ).reshape(60, 9, 9)
        assert np.mean(residuals**2) == pytest.approx(1.0, abs=0.08)
        turns = residuals[..., 3:6]
        correlation[shared] = float(np.mean(turns[:, 1:] * turns[:, :-1]))
    assert correlation[False] == pytest.approx(0.0, abs=0.1)
    assert correlation[True] == pytest.approx(1.0 / 6.0, abs=0.08)


def test_errors_that_add_up_show_shared_samples() -> None:
    """Catches a case of shared samples that nothing in the table shows."""
    changes = {"n_landmarks": 20, "imu_rate_hz": 2 * 9 / 2.5, "sigma_px": 0.01}
    sparse = scene(**changes)
    means = []
    for shared in (True, False):
        found = [
            nees_by_gauge(
                replace(trial(number, **changes), inertial=inertial_factors(sparse, number, shared)),
                sparse.truth,
                TIGHT,
            )
            for number in range(60)
        ]
        means.append(np.mean([one[LAST][1] for one in found if one]) / 9.0)
    assert means[0] > 1.15 > 1.1 > means[1] > 0.9


def test_figure_says_how_many_are_in_their_band(
    table: pd.DataFrame, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Catches a case under another's name, and a figure whose numbers are not those beside it."""
    table.to_csv(tmp_path / "table.csv", index=False)
    texts: list[str] = []

    def keep(drawn: Figure, stem: object) -> None:
        texts.extend(artist.get_text() for artist in drawn.findobj(Text))

    monkeypatch.setattr(figure, "save_figure", keep)
    figure.draw_nees(tmp_path / "table.csv", tmp_path / "nees")
    assert "As simulated: 14 of 14 in their band" in texts
    outside = int((~table[table["case"].isin(BROKEN)]["inside"]).sum())
    assert any(f"Broken on purpose: {outside} of 21 outside their band" in text for text in texts)
    written = pd.read_csv(tmp_path / "nees.csv")
    assert written["mean"].tolist() == pytest.approx(table["mean"].tolist())
