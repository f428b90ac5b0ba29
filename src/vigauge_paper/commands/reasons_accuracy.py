"""Run the experiments on what the errors depend on: simulation and sequences with one thing changed.

No times are taken, so that two runs give the same bytes.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd

from vigauge.cli.command import LOG
from vigauge.gauge.gauges import FixedGauge, FreeGauge, Gauge
from vigauge.geometry.so3 import Array
from vigauge.model.archive import load_arrays, load_problems, load_states
from vigauge.model.problem import Problem
from vigauge.model.state import State
from vigauge.solver.levenberg_marquardt import Options
from vigauge.synthetic.landmarks import LAYOUTS
from vigauge.synthetic.scenario import Scene, make_scene, make_trial, measured_imu, perturbed
from vigauge.synthetic.settings import SimulationSettings
from vigauge.synthetic.trajectories import TRAJECTORIES
from vigauge_paper.experiments.accuracy import ALIGNMENTS, error_rows, expected_errors, path_length
from vigauge_paper.experiments.changes import changed
from vigauge_paper.experiments.exchange import published_magnitude
from vigauge_paper.experiments.rigid_turn import rigid_turns
from vigauge_paper.experiments.settings import AccuracySettings
from vigauge_paper.experiments.variants import (
    ACCEL_ERRORS,
    euler_increments,
    fewer_landmarks,
    keyframes_between,
    one_camera,
    with_bias_error,
)
from vigauge_paper.ids import AS_CONFIGURED
from vigauge_paper.run.artefacts import (
    add_section,
    add_solver,
    named_file,
    named_text,
    table_files,
    write_tables,
)
from vigauge_paper.run.stage import Stamped, json_argument, parser, run, settings_from

Row = dict[str, object]


def simulated(settings: SimulationSettings, solver: Options, accuracy: AccuracySettings) -> list[Row]:
    """RMSE of all six configurations under every change, one at a time."""
    unchanged: tuple[SimulationSettings, Options, Array] = (settings, solver, np.zeros(3))
    variants = {AS_CONFIGURED: unchanged}
    variants |= {change: _parsed(change, settings, solver) for change in accuracy.simulation}
    rows: list[Row] = []
    for points in LAYOUTS:
        for trajectory in TRAJECTORIES:
            name = f"{trajectory}_{points}"
            for variant, (values, options, accel) in variants.items():
                scene = make_scene(trajectory, points, values)
                problems = [make_trial(scene, trial) for trial in range(accuracy.trials)]
                if accel.any():
                    problems = [with_bias_error(problem, np.zeros(3), accel) for problem in problems]
                alignments = ALIGNMENTS if variant == AS_CONFIGURED else ("first pose",)
                rows += _errors(variant, name, problems, scene, options, alignments)
                if variant == AS_CONFIGURED:
                    for factor in accuracy.believed_density_factors:
                        believed = [p.with_noise(p.sigma_px, factor) for p in problems]
                        rows += _errors(
                            f"inertial noise believed {factor:g} times", name, believed, scene, solver
                        )
            for rate in accuracy.euler_rates_hz:
                scene = make_scene(trajectory, points, replace(settings, imu_rate_hz=rate))
                stepped = list(_euler(scene, accuracy.trials))
                rows += _errors(f"Euler steps at {rate:g} Hz", name, stepped, scene, solver)
            LOG.info("%s: %d trials a variant", name, accuracy.trials)
    return rows


def _parsed(
    change: str, settings: SimulationSettings, solver: Options
) -> tuple[SimulationSettings, Options, Array]:
    """Settings, options and constant accelerometer error (body, m/s^2) of a change given as text."""
    accel = np.zeros(3)
    for part in change.split(", "):
        parameter, _, value = part.partition("=")
        if parameter in ACCEL_ERRORS:
            accel[ACCEL_ERRORS[parameter]] = float(value)
        else:
            settings, solver = changed(settings, solver, parameter, float(value))
    return settings, solver, accel


def _errors(
    variant: str,
    name: str,
    problems: list[Problem],
    scene: Scene,
    solver: Options,
    alignments: Iterable[str] = ("first pose",),
) -> list[Row]:
    return error_rows(variant, name, problems, scene.truth, {"fix": FixedGauge()}, solver, alignments)


def _euler(scene: Scene, trials: int) -> Iterator[Problem]:
    ends = list(zip(scene.keyframe_ns[:-1].tolist(), scene.keyframe_ns[1:].tolist(), strict=True))
    for trial in range(trials):
        problem = make_trial(scene, trial)
        factors = euler_increments(measured_imu(scene, trial), ends, problem.inertial)
        yield replace(problem, inertial=factors)


def on_sequence(
    name: str,
    problem: Problem,
    truth: State,
    perturbation: SimulationSettings,
    solver: Options,
    accuracy: AccuracySettings,
    published: State | None = None,
) -> list[Row]:
    """RMSE and iterations of a sequence with one thing changed, fixed and free.

    ``published``: the truth as published, where steps were taken out of ``truth``.
    """
    rng = np.random.default_rng(accuracy.seed)
    left = one_camera(problem)
    accel, gyro = np.zeros(3), np.zeros(3)
    accel[1], gyro[2] = accuracy.accel_bias_mps2, accuracy.gyro_bias_radps
    variants = {
        AS_CONFIGURED: problem,
        "one camera": left,
        **{
            f"one camera, {count} landmarks": fewer_landmarks(left, count, rng)
            for count in accuracy.landmarks
        },
        f"accelerometer bias off by {accuracy.accel_bias_mps2:g} m/s^2": with_bias_error(
            problem, np.zeros(3), accel
        ),
        f"gyroscope bias off by {accuracy.gyro_bias_radps:g} rad/s": with_bias_error(
            problem, gyro, np.zeros(3)
        ),
        "start as in Section V-B": problem.with_initial(perturbed(problem.initial, perturbation, rng)),
    }
    gauges: dict[str, Gauge] = {"fix": FixedGauge(), "free": FreeGauge()}
    rows = []
    for variant, changed_problem in variants.items():
        rows += error_rows(variant, name, [changed_problem], truth, gauges, solver)
    if published is not None:
        rows += error_rows("truth as published", name, [problem], published, gauges, solver)
    count = truth.n_keyframes
    edges = np.linspace(0, count, accuracy.parts + 1).round().astype(int).tolist()
    for start, stop in pairwise(edges):
        part, true_part = keyframes_between(problem, truth, start, stop)
        variant = f"keyframes {start + 1} to {stop} of {count}"
        rows += error_rows(variant, name, [part], true_part, gauges, solver)
    return rows


def turns(settings: SimulationSettings) -> list[Row]:
    """What a turn of everything does to the errors, for the truth of every configuration."""
    return [
        row
        for points in LAYOUTS
        for trajectory in TRAJECTORIES
        for row in rigid_turns(f"{trajectory}_{points}", make_scene(trajectory, points, settings).truth)
    ]


def expectations(covariances: list[tuple[str, Path]], published: Path) -> list[Row]:
    """RMSE that each fixed covariance lets expect, ours and those of the paper's Figs. 9 and 10."""
    rows = []
    for name, file in covariances:
        arrays = load_arrays(file)
        rows.append(expected_errors(name, arrays["fixed"], int(arrays["n_keyframes"])))
    for figure in ("fig09", "fig10"):
        # The transformed panel: the fixed one has an entry in the wrong place.
        magnitude = published_magnitude(load_arrays(published / f"{figure}.npz"), "transformed")
        rows.append(expected_errors(f"published {figure}", magnitude, len(magnitude) // 9))
    return rows


def paths(truths: list[tuple[str, Path]], published: Path) -> list[Row]:
    """Horizontal length of every flight and of the published one of Fig. 1, metres."""
    rows: list[Row] = []
    for name, file in truths:
        rows.append({"experiment": name, "path_m": path_length(load_states(file)[0].p_W[:, :2])})
    drawn = pd.read_csv(published / "fig01_euroc_ellipses.csv").query(
        "panel == 'a' and record == 'trajectory'"
    )
    rows.append({"experiment": "published fig01", "path_m": path_length(drawn[["x", "y"]].to_numpy())})
    return rows


# Tables of this stage; other experiments write beside them.
TABLES = ("accuracy", "sequence_accuracy", "expected", "paths", "rigid_turns")


def work(options: argparse.Namespace) -> None:
    accuracy = settings_from(AccuracySettings, options.settings, "accuracy")
    simulation = settings_from(SimulationSettings, options.simulation, "simulation")
    solver = settings_from(Options, options.solver, "solver")
    noise = dict(options.noise)
    truths = dict(options.truths)
    sequences: list[Row] = []
    rows = simulated(simulation, solver, accuracy)
    for name, file in options.sequences:
        problem = load_problems(file)[0].with_noise(**json_argument(noise[name]))
        truth, *others = load_states(truths[name])
        published = next((o for o in others if not np.array_equal(o.p_W, truth.p_W)), None)
        sequences += on_sequence(name, problem, truth, simulation, solver, accuracy, published)
    tables = {
        "accuracy": rows,
        "sequence_accuracy": sequences,
        "expected": expectations(options.covariances, options.published),
        "paths": paths(options.truths, options.published),
        "rigid_turns": turns(simulation),
    }
    write_tables(options.output, TABLES, tables)


def main() -> None:
    arguments = parser(__doc__)
    for name, text in (
        ("sequences", "NAME=FILE of the sequences' problems"),
        ("truths", "NAME=FILE of the sequences' true states"),
        ("covariances", "NAME=FILE of covariances of all experiments"),
    ):
        arguments.add_argument(f"--{name}", type=named_file, nargs="+", required=True, help=text)
    arguments.add_argument(
        "--noise",
        type=named_text,
        nargs="+",
        required=True,
        help="NAME=JSON of its headline noise",
    )
    arguments.add_argument("--published", type=Path, required=True, help="folder of the published numbers")
    add_section(arguments, "--simulation", "simulation")
    add_solver(arguments)
    add_section(arguments, "--settings", "accuracy")
    arguments.add_argument("--output", type=Path, required=True, help="folder that gets the tables")
    run(
        work,
        arguments,
        Stamped(
            {"simulation": "simulation", "solver": "solver", "settings": "accuracy"},
            files=table_files(TABLES),
        ),
    )


if __name__ == "__main__":
    main()
