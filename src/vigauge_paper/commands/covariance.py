"""Covariances of one experiment in every gauge, and how well Eq. (12) joins them (Section VI).

Three comparisons with the fixed covariance: the transformed free one at the same point, where
(12) is an identity; the same between the separately converged estimates, as in the paper; and
the prior's, under its weight and under the square of it, as which the paper's weights act.

Where the problem is degenerate, or a run did not converge, there is no covariance: the archive
then has the reason under ``withheld`` (otherwise empty), and the spectrum, but no matrices.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from vigauge.cli.command import LOG
from vigauge.covariance.covariance import Covariance, motion_pseudo_inverse
from vigauge.covariance.transform import transform_covariance
from vigauge.errors import DegenerateError
from vigauge.gauge.gauges import FixedGauge, PriorGauge, three_gauges
from vigauge.model.archive import load_problems, load_states, load_statuses, save_arrays
from vigauge.model.evaluation import covariance_defects, relative_frobenius
from vigauge.model.problem import Problem
from vigauge.model.state import State
from vigauge.observability.diagnosis import Diagnosis, diagnose
from vigauge.observability.spectrum import Spectrum
from vigauge.solver.levenberg_marquardt import CONVERGED, Status
from vigauge_paper.ids import FIX, FREE, PRIOR
from vigauge_paper.prior import information
from vigauge_paper.run.artefacts import add_prior
from vigauge_paper.run.stage import Stamped, json_argument, parser, run

# Covariances of the archive, and how far from symmetric and positive they may be: rounding errors.
MATRICES = ("free", "fixed", "prior", "transformed", "transformed_same_point")
DEFECT_LIMIT = 1e-8


def compare_gauges(
    problem: Problem, states: Mapping[str, State], prior_weight: float, prior_reading: str
) -> dict[str, np.ndarray | float | int]:
    """Covariances at the three estimates and at one common point, and their distances."""
    reference, fixed_gauge = problem.initial, FixedGauge()
    fix, prior, free = (states[gauge] for gauge in (FIX, PRIOR, FREE))
    prior_gauge = PriorGauge(information(prior_weight, prior_reading))
    at_fix, at_prior, at_free = (Covariance.of(problem, state) for state in (fix, prior, free))
    fixed = at_fix.motion(fixed_gauge)
    free_covariance = motion_pseudo_inverse(at_free)
    transformed, moved = transform_covariance(free_covariance, free, fixed_gauge, reference)
    with_prior = at_prior.motion(prior_gauge)
    printed = at_fix.motion(PriorGauge(prior_weight))
    same_point, _ = transform_covariance(motion_pseudo_inverse(at_fix), fix, fixed_gauge, reference)
    found = at_free.spectrum()
    pulled = at_prior.equations.with_factor(prior_gauge.factor.at(prior, reference))
    return {
        "free": free_covariance,
        "transformed": transformed,
        "fixed": fixed,
        "prior": with_prior,
        "transformed_same_point": same_point,
        "relative_frobenius_same_point": relative_frobenius(same_point, fixed),
        "relative_frobenius_converged": relative_frobenius(transformed, fixed),
        "relative_frobenius_prior": relative_frobenius(with_prior, fixed),
        "relative_frobenius_prior_as_printed": relative_frobenius(printed, fixed),
        "p_W_free": free.p_W,
        "p_W_transformed": moved.p_W,
        "p_W_fixed": fix.p_W,
        "n_keyframes": free.n_keyframes,
        "n_landmarks": free.n_landmarks,
        "n_parameters": free.n_parameters,
        "rank_free": found.rank,
        "rank_fix": at_fix.spectrum(fixed_gauge.held(fix)).rank,
        "rank_prior": Spectrum.of(pulled.eliminate()).rank,
        "eigenvalues": found.eigenvalues,
        "gap": found.gap,
    }


def without_covariance(state: State, found: Diagnosis, withheld: str) -> dict[str, np.ndarray | float | int]:
    """What the archive holds instead of covariances that would mean nothing."""
    return {
        "withheld": np.array(withheld),
        "n_keyframes": state.n_keyframes,
        "n_landmarks": state.n_landmarks,
        "n_parameters": state.n_parameters,
        # Holding four columns along the orbit takes no rank away, a prior on them adds four.
        "rank_free": found.rank,
        "rank_fix": found.rank,
        "rank_prior": found.rank + found.expected,
        "eigenvalues": found.eigenvalues,
        "gap": found.gap,
    }


def work(options: argparse.Namespace) -> None:
    problem = load_problems(options.problems)[0]
    if options.noise:
        problem = problem.with_noise(**options.noise)
    # As solve writes them.
    gauges = tuple(three_gauges(1.0))
    states = dict(zip(gauges, load_states(options.states), strict=True))
    failed = [
        f"{gauge} ({status})"
        for gauge, status in zip(gauges, load_statuses(options.states), strict=True)
        if Status(status) not in CONVERGED
    ]
    found = diagnose(problem, states[FREE])
    withheld = found.withheld or (f"the run did not converge: {', '.join(failed)}" if failed else "")
    if withheld:
        save_arrays(options.output, without_covariance(states[FREE], found, withheld))
        LOG.warning("covariance withheld; %s", withheld)
        return
    arrays = compare_gauges(problem, states, options.prior_weight, options.prior_reading)
    defects = {name: covariance_defects(np.asarray(arrays[name])) for name in MATRICES}
    for name, found_defects in defects.items():
        if max(found_defects.asymmetry, found_defects.negativity) > DEFECT_LIMIT:
            raise DegenerateError(f"covariance '{name}' is none: {found_defects}")
    arrays |= {f"asymmetry_{name}": d.asymmetry for name, d in defects.items()}
    arrays |= {f"negativity_{name}": d.negativity for name, d in defects.items()}
    save_arrays(options.output, {"withheld": np.array(""), **arrays})
    LOG.info("%s", found.sentence)
    LOG.info(
        "relative Frobenius distance to fixed: %.2e at the same point, %.2e converged, %.2e prior",
        arrays["relative_frobenius_same_point"],
        arrays["relative_frobenius_converged"],
        arrays["relative_frobenius_prior"],
    )


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--problems", type=Path, required=True, help="archive; its first problem is used")
    arguments.add_argument("--states", type=Path, required=True, help="estimates as solve writes them")
    add_prior(arguments)
    arguments.add_argument("--noise", type=json_argument, default={}, help="noise model, as in the config")
    arguments.add_argument(
        "--output", type=Path, required=True, help="output: covariances and their distances"
    )
    stamped = Stamped({"prior_weight": "prior.weight", "prior_reading": "prior.reading"}, outputs=("output",))
    run(work, arguments, stamped)


if __name__ == "__main__":
    main()
