"""Simulate one configuration: the problems of all trials, the truth, and a report.

Section IV-A and V-B of the paper.
"""

import argparse

import numpy as np

from vigauge.cli.command import LOG
from vigauge.files import write_json, write_rows
from vigauge.model.archive import save_problems, save_states
from vigauge.synthetic.checks import chi_square_at_truth, describe
from vigauge.synthetic.scenario import make_scene, make_trials
from vigauge.synthetic.settings import SimulationSettings
from vigauge_paper.run.artefacts import FILE, add_section
from vigauge_paper.run.progress import progress
from vigauge_paper.run.stage import Stamped, parser, run, settings_from


def work(options: argparse.Namespace) -> None:
    settings = settings_from(SimulationSettings, options.settings, "simulation")
    scene = make_scene(options.trajectory, options.points, settings)
    problems = list(progress(make_trials(scene), "simulated", "trial", settings.n_trials))
    save_problems(options.problems, problems)
    save_states(options.truth, [scene.truth])
    path_W = scene.trajectory.p_W(np.linspace(0.0, settings.duration_s, 501))
    write_rows(options.path, [dict(zip(("x_m", "y_m", "z_m"), map(float, p), strict=True)) for p in path_W])
    report = describe(scene) | {"seed": settings.seed, "chi_square": chi_square_at_truth(problems, scene)}
    write_json(options.report, report)
    LOG.info(
        "%s %s: %d trials, %d landmarks, %d observations",
        options.trajectory,
        options.points,
        len(problems),
        scene.truth.n_landmarks,
        len(scene.uv),
    )


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--trajectory", required=True)
    arguments.add_argument("--points", required=True)
    add_section(arguments, "--settings", "simulation")
    arguments.add_argument("--problems", **FILE, help="output: one problem a trial")
    arguments.add_argument("--truth", **FILE, help="output: the true state")
    arguments.add_argument("--path", **FILE, help="output: the dense trajectory")
    arguments.add_argument("--report", **FILE, help="output: what was simulated, chi-squares")
    run(work, arguments, Stamped({"settings": "simulation"}, outputs=("problems", "truth", "path", "report")))


if __name__ == "__main__":
    main()
