"""Sequences with known biases beside the same without any ground truth in the estimate."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import pandas as pd

from .ids import BIAS_ERRORS, ERRORS, ESTIMATED, FIX, GAUGES, HEADLINE, KNOWN, Row

DISTANCES = ("relative_frobenius_same_point", "relative_frobenius_converged")


def no_truth_rows(
    forms: Mapping[str, Sequence[str]],
    solutions: Mapping[str, Path],
    distances: Mapping[str, Path],
    source: str,
) -> list[Row]:
    """A row a sequence, form and gauge, under the headline noise.

    ``forms`` of each sequence, itself first; one that has no other is left out. ``source`` is 'euroc' or
    'rendered'. Distances are those of the covariances of a form, the same in its three rows.
    """
    rows: list[Row] = []
    for sequence, names in forms.items():
        for name in names if len(names) > 1 else ():
            solved = pd.read_csv(solutions[name]).query("noise == @HEADLINE").set_index("gauge")
            about = pd.read_csv(distances[name]).set_index("noise").loc[HEADLINE]
            rows += [
                {
                    "sequence": sequence,
                    "source": source,
                    "form": name,
                    "biases": KNOWN if name == sequence else ESTIMATED,
                    "gauge": gauge,
                    **{error: float(solved.at[gauge, error]) for error in ERRORS},
                    **{error: _or_empty(solved.at[gauge, error]) for error in BIAS_ERRORS},
                    "converged": bool(solved.at[gauge, "converged"]),
                    "iterations": int(solved.at[gauge, "iterations"]),
                    **{distance: float(about[distance]) for distance in DISTANCES},
                }
                for gauge in GAUGES
            ]
    return rows


def _of_biases(own: pd.DataFrame) -> str:
    """How far the biases of fixation are from those of the truth, where it has any."""
    gyro, accel = (own.at[FIX, error] for error in BIAS_ERRORS)
    return (
        f"biases are {gyro:.2g} rad/s and {accel:.2g} m/s^2 from the truth's (RMSE); " if gyro != "" else ""
    )


def _or_empty(value: float) -> float | str:
    return "" if pd.isna(value) else float(value)


def no_truth_sentence(rows: Sequence[Row], margin: float) -> str:
    """Whether gauges agree without ground truth, and what it costs; up to ``margin`` is the same."""
    parts = []
    table = pd.DataFrame(rows)
    for sequence, part in table.groupby("sequence", sort=False):
        known = part[part["biases"] == KNOWN].set_index("gauge")
        for form, own in part[part["biases"] == ESTIMATED].groupby("form", sort=False):
            own = own.set_index("gauge")
            if not (own["converged"].all() and known["converged"].all()):
                parts.append(f"{form}: a run did not converge")
                continue
            errors = own[list(ERRORS)].astype(float)
            apart = float((errors / errors.loc[FIX] - 1.0).abs().to_numpy().max())
            ratio = errors.loc[FIX] / known.loc[FIX, list(ERRORS)].astype(float)
            counts = ", ".join(f"{gauge} {own.at[gauge, 'iterations']}" for gauge in GAUGES)
            parts.append(
                f"{form}: errors of the gauges differ by at most {100.0 * apart:.2g} %, which "
                f"{'counts' if apart < margin else 'does not count'} as the same "
                f"(margin {100.0 * margin:.2g} %), and are "
                f"{', '.join(f'{value:.2g}' for value in ratio)} times those of {sequence} with known biases "
                f"(position, rotation, velocity); {_of_biases(own)}iterations {counts}"
            )
    return f"{'. '.join(parts)}."
