"""The figures, the paper's and ours: what each is called, in which file it stands, which module draws it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Figure:
    """A figure.

    ``stem`` of its files, PDF and PNG, and of the numbers it shows, which end in ``numbers``;
    ``title`` begins its caption, workflow/report/KEY.rst; ``module`` of this folder draws it.
    """

    key: str
    stem: str
    title: str
    module: str
    numbers: str = ".csv"


_ALL = (
    Figure("fig01", "fig01_euroc_ellipses", "Figure 1", "ellipses"),
    Figure("fig02", "fig02_optimisation_paths", "Figure 2", "orbit"),
    Figure("fig03", "fig03_scenes", "Figure 3", "scenes"),
    Figure("fig04", "fig04_prior_weight_rmse", "Figure 4", "prior"),
    Figure("fig05", "fig05_prior_weight_cost", "Figure 5", "prior"),
    Figure("fig06", "fig06_prior_error_paths", "Figure 6", "prior"),
    Figure("fig07", "fig07_simulation_cost", "Figure 7", "cost"),
    Figure("fig08", "fig08_covariance_transformation", "Figure 8", "orbit"),
    Figure("fig09", "fig09_covariance_simulation", "Figure 9", "matrices", ".npz"),
    Figure("fig10", "fig10_covariance_euroc", "Figure 10", "matrices", ".npz"),
    Figure("fig11", "fig11_euroc_cost", "Figure 11", "cost"),
    Figure("nees", "nees", "NEES", "nees"),
    Figure("prior_reading", "prior_reading", "What the prior's weight multiplies", "reading"),
    Figure("fig_errors", "fig_errors_and_sigmas", "Errors against sigmas (not in the paper)", "errors"),
)
FIGURES = {figure.key: figure for figure in _ALL}
