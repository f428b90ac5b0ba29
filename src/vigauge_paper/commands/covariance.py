"""Covariances of one experiment in every gauge, and how well Eq. (12) joins them (Section VI).

Three comparisons with the fixed covariance: the transformed free one at the same point, where
(12) is an identity; the same between the separately converged estimates, as in the paper; and
the prior's, under its weight and under the square of it, as which the paper's weights act.

Where the problem is degenerate, or a run did not converge, there is no covariance: the archive
then has the reason under ``withheld`` (otherwise empty), and the spectrum, but no matrices.
"""

import argparse
from collections.abc import Mapping

import numpy as np

from vigauge.cli.command import LOG
from vigauge.covariance.covariance import Covariance, motion_pseudo_inverse
from vigauge.covariance.transform import transform_covariance
from vigauge.errors import DegenerateError
from vigauge.files import write_rows
from vigauge.gauge.gauges import FixedGauge, PriorGauge, three_gauges
from vigauge.model.archive import load_problems, load_states, load_statuses, save_arrays
from vigauge.model.evaluation import covariance_defects, relative_frobenius
from vigauge.model.problem import Problem
from vigauge.model.state import State
from vigauge.observability.diagnosis import Diagnosis, diagnose
from vigauge.observability.spectrum import Spectrum
from vigauge.solver.levenberg_marquardt import CONVERGED, Status
from vigauge_paper.experiments.solves import under_noise
from vigauge_paper.ids import FIX, FREE, HEADLINE, PRIOR
from vigauge_paper.prior import information
from vigauge_paper.run.artefacts import FILE, PRIOR_KEYS, add_prior
from vigauge_paper.run.stage import Stamped, json_argument, parser, run

# Covariances of the archive, and how far from symmetric and positive they may be: rounding errors.
MATRICES = ("free", "fixed", "prior", "transformed", "transformed_same_point")
DEFECT_LIMIT = 1e-8
# What is told of every noise model.
DISTANCES = tuple(f"relative_frobenius_{name}" for name in ("same_point", "converged", "prior"))

Archive = dict[str, np.ndarray | float | int]


def compare_gauges(
    problem: Problem, states: Mapping[str, State], prior_weight: float, prior_reading: str
) -> Archive:
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
        "R_WB_fixed": fix.R_WB,
        "v_W_fixed": fix.v_W,
        "n_keyframes": free.n_keyframes,
        "n_landmarks": free.n_landmarks,
        "n_parameters": free.n_parameters,
        "rank_free": found.rank,
        "rank_fix": at_fix.spectrum(fixed_gauge.held(fix)).rank,
        "rank_prior": Spectrum.of(pulled.eliminate()).rank,
        "eigenvalues": found.eigenvalues,
        "gap": found.gap,
    }


def without_covariance(state: State, found: Diagnosis, withheld: str) -> Archive:
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


def archive_of(
    problem: Problem,
    states: Mapping[str, State],
    statuses: Mapping[str, str],
    prior_weight: float,
    prior_reading: str,
) -> Archive:
    """Covariances of one problem, or why there are none, by the estimates of the gauges."""
    found = diagnose(problem, states[FREE])
    failed = [f"{gauge} ({status})" for gauge, status in statuses.items() if Status(status) not in CONVERGED]
    withheld = found.withheld or (f"the run did not converge: {', '.join(failed)}" if failed else "")
    if withheld:
        LOG.warning("covariance withheld; %s", withheld)
        return without_covariance(states[FREE], found, withheld)
    arrays = compare_gauges(problem, states, prior_weight, prior_reading)
    defects = {name: covariance_defects(np.asarray(arrays[name])) for name in MATRICES}
    for name, found_defects in defects.items():
        if max(found_defects.asymmetry, found_defects.negativity) > DEFECT_LIMIT:
            raise DegenerateError(f"covariance '{name}' is none: {found_defects}")
    arrays |= {f"asymmetry_{name}": d.asymmetry for name, d in defects.items()}
    arrays |= {f"negativity_{name}": d.negativity for name, d in defects.items()}
    LOG.info("%s", found.sentence)
    LOG.info(
        "relative Frobenius distance to fixed: %.2e at the same point, %.2e converged, %.2e prior",
        *(arrays[name] for name in DISTANCES),
    )
    return {"withheld": np.array(""), **arrays}


def work(options: argparse.Namespace) -> None:
    models = under_noise(load_problems(options.problems)[:1], options.noise)
    # As solve writes them.
    gauges = [*three_gauges(1.0)]
    states, statuses = load_states(options.states), load_statuses(options.states)
    rows = []
    for index, (name, (problem,)) in enumerate(models.items()):
        mine = slice(index * len(gauges), (index + 1) * len(gauges))
        archive = archive_of(
            problem,
            dict(zip(gauges, states[mine], strict=True)),
            dict(zip(gauges, statuses[mine], strict=True)),
            options.prior_weight,
            options.prior_reading,
        )
        if name == HEADLINE:
            save_arrays(options.output, archive)
        distances = {key: archive.get(key, np.nan) for key in DISTANCES}
        rows.append({"noise": name, "withheld": archive["withheld"], **distances})
    write_rows(options.distances, rows)


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--problems", **FILE, help="archive; its first problem is used")
    arguments.add_argument("--states", **FILE, help="estimates as solve writes them")
    add_prior(arguments)
    arguments.add_argument("--noise", type=json_argument, default={}, help="noise models by name")
    arguments.add_argument("--output", **FILE, help="output: covariances of the headline noise")
    arguments.add_argument("--distances", **FILE, help="output: their distances, a row a noise model")
    run(work, arguments, Stamped(PRIOR_KEYS, outputs=("output", "distances")))


if __name__ == "__main__":
    main()
