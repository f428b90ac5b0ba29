"""The figures, the paper's and ours: what each is called, in which file it stands, which module draws it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Figure:
    """A figure.

    ``stem`` of its files, PDF and PNG, and of the numbers it shows, which end in ``numbers``;
    ``title`` begins its caption, workflow/report/KEY.rst; ``module`` of this folder draws it; ``shows``
    says in a plain sentence what a reader who is new to the matter sees.
    """

    key: str
    stem: str
    title: str
    module: str
    shows: str
    numbers: str = ".csv"


_ALL = (
    Figure(
        "fig01",
        "fig01_euroc_ellipses",
        "Figure 1",
        "ellipses",
        "Seen from above: with the first pose held, the uncertainty of a position starts at zero; it grows "
        "while the camera flies on, and levels off where it stays within decimetres. The free gauge spreads "
        "it over all keyframes, and Eq. (12) turns the one picture into the other.",
    ),
    Figure(
        "fig02",
        "fig02_optimisation_paths",
        "Figure 2",
        "orbit",
        "From one start all three approaches reach the same curve of equally good estimates; fixation and "
        "the prior end at the same point of it, the free gauge at another.",
    ),
    Figure(
        "fig03",
        "fig03_scenes",
        "Figure 3",
        "scenes",
        "Two of the simulated flights, and the landmarks that the camera sees.",
    ),
    Figure(
        "fig04",
        "fig04_prior_weight_rmse",
        "Figure 4",
        "prior",
        "Does the prior's weight change the accuracy? The vertical axis is the change of the mean "
        "error, in per cent.",
    ),
    Figure(
        "fig05",
        "fig05_prior_weight_cost",
        "Figure 5",
        "prior",
        "What the prior's weight costs: iterations peak between weights too weak to matter and "
        "weights that hold the first pose.",
    ),
    Figure(
        "fig06",
        "fig06_prior_error_paths",
        "Figure 6",
        "prior",
        "Two ways to the minimum: a strong prior holds the first pose while the images come to fit; a "
        "weak one lets the images fit first and then moves back along the curve of equal cost.",
    ),
    Figure(
        "fig07",
        "fig07_simulation_cost",
        "Figure 7",
        "cost",
        "Time and iterations of the three approaches on the six simulated flights, with ratios to "
        "gauge fixation paired run by run.",
    ),
    Figure(
        "fig08",
        "fig08_covariance_transformation",
        "Figure 8",
        "orbit",
        "What Eq. (12) does to a small error of the free estimate: it carries it along the curve of "
        "equal cost and projects it onto the gauge.",
    ),
    Figure(
        "fig09",
        "fig09_covariance_simulation",
        "Figure 9",
        "matrices",
        "The covariance of one simulated estimate, entry by entry: the free gauge (a) looks unlike "
        "gauge fixation (c); transformed by Eq. (12) it is the same matrix (b).",
        ".npz",
    ),
    Figure(
        "fig10",
        "fig10_covariance_euroc",
        "Figure 10",
        "matrices",
        "The same matrices as in Figure 9, for an image sequence.",
        ".npz",
    ),
    Figure(
        "fig11",
        "fig11_euroc_cost",
        "Figure 11",
        "cost",
        "Time and iterations of the three approaches on the image sequences.",
    ),
    Figure(
        "nees",
        "nees",
        "NEES",
        "nees",
        "Are the covariances as large as the errors? A value of one says yes; the grey bars say how "
        "far from one chance may lead.",
    ),
    Figure(
        "prior_reading",
        "prior_reading",
        "What the prior's weight multiplies",
        "reading",
        "The paper's text and its figures differ in what a prior's weight means; the first step of "
        "the optimisation tells which of the two a curve follows.",
    ),
    Figure(
        "fig_errors",
        "fig_errors_and_sigmas",
        "Errors against sigmas (not in the paper)",
        "errors",
        "Errors on the image sequences against their predicted standard deviations: points above the "
        "line say that the prediction is too small.",
    ),
    Figure(
        "biases",
        "biases",
        "Biases in the state (not in the paper)",
        "biases",
        "Do the gauges still agree when the sensor's biases are estimated with the rest? Hollow marks: with "
        "known biases, as in the paper; filled ones: with estimated biases.",
    ),
)
FIGURES = {figure.key: figure for figure in _ALL}
