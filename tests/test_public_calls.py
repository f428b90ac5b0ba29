"""Every argument of everything public, damaged in every way: an error of the package's own."""

# A table reads line by line.
# ruff: noqa: E501

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from dataclasses import fields, replace
from functools import partial

import numpy as np
import pytest

import vigauge as vg
from support import damage, foreign
from support.random_problem import random_problem, with_random_biases
from vigauge.adapters import ceres

RNG = np.random.default_rng(0)
PROBLEM = random_problem(0)
STATE = PROBLEM.initial
BIASED = with_random_biases(random_problem(1), RNG)
# In the order of time: without the factor that jumps back.
CHAINED = replace(BIASED, inertial=BIASED.inertial.only(np.arange(3)))
COVARIANCE = vg.Covariance.of(PROBLEM, STATE)
H, U, FIX = COVARIANCE.equations.dense(), vg.orbit_tangent(STATE), vg.FixedGauge()
FREE = vg.covariance_from_hessian(H, U)
MOTION = COVARIANCE.motion(vg.FreeGauge())
T_NS = np.arange(200) * 5_000_000
SAMPLES = vg.ImuSamples(T_NS, RNG.normal(size=(200, 3)), RNG.normal(size=(200, 3)))
NOISE = vg.ImuNoise(1e-3, 1e-2, 1e-4, 1e-3)
TIMES = np.arange(4) * 100_000_000
LAYOUT = vg.Layout.by_keyframe(3, ["position", "rotation", "velocity", "bias:6"], points=2)
AT, TANGENT, J = foreign.problem(LAYOUT, vg.YawTranslation(), RNG)
ESTIMATE = {"layout": LAYOUT, "poses": (AT.R, AT.p), "velocities": AT.v, "points": AT.X}
FOREIGN = vg.Covariance.from_jacobian(J, **ESTIMATE)
FACTOR = vg.BiasPrior(0, np.zeros(3), np.zeros(3), 0.1, 0.1)
POSE = COVARIANCE.relative_pose(0, 1)
BLOCKS = COVARIANCE.keyframes(FIX)


def of(thing: object, **changes: object) -> dict[str, object]:
    """Arguments that make a dataclass again."""
    return {f.name: getattr(thing, f.name) for f in fields(thing) if f.init} | changes


H_3 = (J.T @ J).toarray()
MOVE, POINTS = LAYOUT.points.min(), slice(LAYOUT.points.min(), None)
C = np.stack([H_3[k : k + 3, k : k + 3] for k in LAYOUT.points[:, 0]])
B = H_3[:MOVE, MOVE:]
S = H_3[:MOVE, :MOVE] - sum(
    B[:, 3 * k : 3 * k + 3] @ np.linalg.solve(C[k], B[:, 3 * k : 3 * k + 3].T) for k in range(2)
)
OF_S = vg.Layout.by_keyframe(3, ["position", "rotation", "velocity", "bias:6"])

IN_GAUGE = ("block", "entries", "joint", "keyframes", "landmarks", "log_det", "matrix", "sigma")

# Of every public callable: right arguments.
CALLS: dict[str, tuple[Callable[..., object], dict[str, object]]] = {
    "BiasPrior": (vg.BiasPrior, of(FACTOR)),
    "Camera": (vg.Camera, of(PROBLEM.cameras[0])),
    "Cauchy": (vg.Cauchy, {"delta": 1.0}),
    "Huber": (vg.Huber, {"delta": 1.0}),
    "Covariance.of": (vg.Covariance.of, {"problem": PROBLEM, "state": STATE}),
    "Covariance.from_hessian": (vg.Covariance.from_hessian, {"H": (J.T @ J).toarray(), **ESTIMATE}),
    "Covariance.from_jacobian": (vg.Covariance.from_jacobian, {"J": J.toarray(), **ESTIMATE}),
    "Covariance.from_schur": (
        vg.Covariance.from_schur,
        {"S": S, **ESTIMATE, "layout": OF_S, "coupling": B, "information": C},
    ),
    "Covariance.joint": (COVARIANCE.joint, {"gauge": FIX, "indices": np.array([0, 2])}),
    "Covariance.keyframes": (COVARIANCE.keyframes, {"gauge": FIX, "indices": np.array([0, 2])}),
    "Covariance.landmarks": (COVARIANCE.landmarks, {"gauge": FIX, "indices": np.array([0, 2])}),
    "Covariance.motion": (COVARIANCE.motion, {"gauge": FIX}),
    "Covariance.sigma": (COVARIANCE.sigma, {"kind": "position", "gauge": FIX}),
    "Covariance.relative_pose": (COVARIANCE.relative_pose, {"i": 0, "j": 1}),
    "Ellipsoids.surfaces": (vg.ellipsoids(MOTION[None, :3, :3]).surfaces, {"centres": np.zeros((1, 3)), "n": 4}),
    "EstimateCovariance.block": (FOREIGN.block, {"a": 0, "b": 1, "gauge": FIX}),
    "EstimateCovariance.entries": (FOREIGN.entries, {"rows": np.arange(3), "columns": np.arange(2), "gauge": FIX}),
    "EstimateCovariance.in_gauge": (FOREIGN.in_gauge, {"gauge": TANGENT}),
    "EstimateCovariance.joint": (FOREIGN.joint, {"keys": np.array([0, 2]), "gauge": FIX}),
    "EstimateCovariance.keyframes": (FOREIGN.keyframes, {"gauge": FIX, "keys": np.array([0, 2]), "kinds": ["position"]}),
    "EstimateCovariance.keyframes in W": (FOREIGN.keyframes, {"to": "ros"}),
    "EstimateCovariance.landmarks": (FOREIGN.landmarks, {"gauge": FIX, "keys": np.array([0, 1])}),
    "EstimateCovariance.log_det": (FOREIGN.log_det, {"gauge": FIX}),
    "EstimateCovariance.matrix": (FOREIGN.matrix, {"gauge": FIX}),
    "EstimateCovariance.relative_pose": (FOREIGN.relative_pose, {"i": 0, "j": 1, "gauge": FIX}),
    "EstimateCovariance.sigma": (FOREIGN.sigma, {"kind": "position", "gauge": FIX}),
    "ImuNoise": (vg.ImuNoise, of(NOISE)),
    "ImuNoise.scaled": (NOISE.scaled, {"factor": 2.0}),
    "ImuSamples": (vg.ImuSamples, of(SAMPLES)),
    "ImuSamples.corrected": (SAMPLES.corrected, {"gyro_bias": np.zeros(3), "accel_bias": np.zeros(3)}),
    "InertialFactors": (vg.InertialFactors, of(BIASED.inertial)),
    "KeyframeGauge": (vg.KeyframeGauge, {"index": 1}),
    "PriorGauge": (vg.PriorGauge, {"weight": 1.0}),
    "Layout": (vg.Layout, {"n": 6, "blocks": {"position": np.arange(6).reshape(2, 3)}, "points": np.zeros((0, 3), int), "side": "left"}),
    "Layout.by_keyframe": (vg.Layout.by_keyframe, {"count": 2, "blocks": ["position"], "points": 1, "side": "left"}),
    "Layout.by_kind": (vg.Layout.by_kind, {"count": 2, "blocks": ["position"], "points": 1, "side": "left"}),
    "Layout.columns": (LAYOUT.columns, {"key": 0, "kind": "position"}),
    "Layout.columns_of": (LAYOUT.columns_of, {"kinds": ["position"]}),
    "Layout.having": (LAYOUT.having, {"kinds": ["position"]}),
    "Layout.places_having": (LAYOUT.places_having, {"kinds": ["position"]}),
    "Layout.place": (LAYOUT.place, {"key": 0}),
    "Layout.point_place": (LAYOUT.point_place, {"key": 0}),
    "Options": (vg.Options, of(vg.Options())),
    "Problem": (vg.Problem, of(PROBLEM)),
    "Problem of biases": (vg.Problem, of(BIASED)),
    "Problem.from_observations": (
        vg.Problem.from_observations,
        {
            "initial": STATE, "cameras": PROBLEM.cameras, "keyframe": PROBLEM.obs_keyframe, "camera": PROBLEM.obs_camera,
            "landmark": PROBLEM.obs_landmark, "uv": PROBLEM.obs_uv, "sigma_px": 1.0, "inertial": PROBLEM.inertial, "gravity": 9.81,
        },
    ),
    "Problem.with_initial": (PROBLEM.with_initial, {"initial": STATE}),
    "Problem.with_noise": (PROBLEM.with_noise, {"sigma_px": 1.0, "density_factor": 2.0}),
    "RelativePose.mahalanobis": (POSE.mahalanobis, {"measured": np.eye(4), "covariance": np.eye(6)}),
    "Similarity.act": (partial(vg.Similarity().act, STATE), {"parameters": np.zeros(7)}),
    "State.local": (STATE.local, {"other": STATE}),
    "State.retract": (STATE.retract, {"delta": np.zeros(STATE.n_parameters)}),
    "State.start": (vg.State.start, {name: getattr(STATE, name) for name in ("p_W", "R_WB", "v_W", "X_W")}),
    "State.transformed": (STATE.transformed, {"yaw": 0.1, "t_W": np.zeros(3)}),
    "State.with_biases": (STATE.with_biases, {"gyro_bias": np.zeros((4, 3)), "accel_bias": np.zeros((4, 3))}),
    "Trajectory": (vg.Trajectory, {"p_W": STATE.p_W, "R_WB": STATE.R_WB, "v_W": STATE.v_W, "times_ns": TIMES, "covariance": BLOCKS, "kinds": ("position", "rotation", "velocity"), "gauge": "fix", "frame": "W", "side": "left"}),
    "as_convention": (vg.as_convention, {"covariance": BLOCKS[:, :6, :6], "R": STATE.R_WB, "to": "gtsam", "p": STATE.p_W, "source": "left"}),
    "audit": (vg.audit, {"H": (J.T @ J).toarray(), **ESTIMATE}),
    "covariance_from_hessian": (vg.covariance_from_hessian, {"H": H, "U": U}),
    "diagnose": (vg.diagnose, {"problem": PROBLEM, "state": STATE}),
    "diagnose_hessian": (vg.diagnose_hessian, {"H": H, "U": U}),
    "ellipsoids": (vg.ellipsoids, {"covariance": BLOCKS, "k": 2.0}),
    "gauge_normal": (vg.gauge_normal, {"layout": LAYOUT, "poses": (AT.R, AT.p), "gauge": (FIX, vg.MeanDepth(0)), "group": vg.Similarity(), "points": AT.X}),
    "keyframe_covariances": (vg.keyframe_covariances, {"problem": PROBLEM, "state": STATE, "gauge": FIX, "keyframes": np.array([0])}),
    "landmark_covariances": (vg.landmark_covariances, {"problem": PROBLEM, "state": STATE, "gauge": FIX, "landmarks": np.array([0])}),
    "motion_covariance": (vg.motion_covariance, {"problem": PROBLEM, "state": STATE, "gauge": FIX}),
    "nees": (vg.nees, {"estimate": STATE.p_W, "truth": STATE.p_W + 1.0, "covariance": BLOCKS[:, 3:6, 3:6], "probability": 0.9}),
    "null_space": (vg.null_space, ESTIMATE),
    "orbit_tangent": (vg.orbit_tangent, {"state": STATE}),
    "preintegrate": (vg.preintegrate, {"samples": SAMPLES, "t_start_ns": 0, "t_end_ns": 10**8, "noise": NOISE, "largest_gap_s": 0.1}),
    "project_covariance": (vg.project_covariance, {"covariance": FREE, "U": U, "V": FIX.normal(STATE), "H": H}),
    "reintegrate": (vg.reintegrate, {"problem": CHAINED, "state": CHAINED.initial, "samples": SAMPLES, "times_ns": TIMES, "noise": NOISE}),
    "relative_frobenius": (vg.relative_frobenius, {"A": H, "reference": H}),
    "sandwich": (vg.sandwich, {"J": H, "weights": np.ones(len(H)), "residuals": np.ones(len(H)), "covariance": FREE}),
    "solve": (vg.solve, {"problem": PROBLEM, "gauge": FIX, "options": vg.Options(), "start": STATE}),
    "solve_with_samples": (vg.solve_with_samples, {"problem": CHAINED, "gauge": FIX, "samples": SAMPLES, "times_ns": TIMES, "noise": NOISE}),
    "trajectory_errors": (vg.trajectory_errors, {"estimate": STATE, "truth": STATE}),
    "transform_covariance": (vg.transform_covariance, {"covariance": MOTION, "state": STATE, "gauge": FIX, "reference": STATE}),
    "ceres.jacobian": (ceres.jacobian, {"rows": J.indptr.astype(int), "cols": J.indices.astype(int), "values": J.data, "n": LAYOUT.n}),
}  # fmt: skip


# Damage that makes another right argument.
HARMLESS: dict[str, tuple[str, ...]] = {
    # Looked at once a solve has converged, which takes more steps than this start allows.
    "solve_with_samples.times_ns": ("beyond",),
    # Problems look at these, and gauges when they are asked about a state.
    "BiasPrior.keyframe": ("-1",),
    "KeyframeGauge.index": ("-1",),
    "InertialFactors.first": ("negative", "beyond"),
    "InertialFactors.second": ("negative", "beyond"),
    "Camera.cx": ("-1.0",),
    "Camera.cy": ("-1.0",),
    "Covariance.from_jacobian.J": ("a row less",),
    "Covariance.joint.indices": ("nothing",),
    "EstimateCovariance.entries.rows": ("nothing",),
    "EstimateCovariance.entries.columns": ("nothing",),
    "EstimateCovariance.joint.keys": ("complex",),
    "EstimateCovariance.keyframes.keys": ("complex",),
    "EstimateCovariance.landmarks.keys": ("complex",),
    # A tuple of gauges may be a list.
    **{f"EstimateCovariance.{name}.gauge": ("a list of it",) for name in IN_GAUGE},
    # No gauge changes a relative pose.
    "EstimateCovariance.relative_pose.gauge": ("a list of it", "its type", "a name"),
    "gauge_normal.gauge": ("a list of it",),
    "ImuSamples.t_ns": ("beyond",),
    "Trajectory.times_ns": ("beyond",),
    "Trajectory.gauge": ("'no such name'",),
    "Trajectory.frame": ("'no such name'",),
    "RelativePose.mahalanobis.measured": ("a row less",),
    "State.start.X_W": ("a row less",),
    "State.transformed.yaw": ("-1.0",),
    "ellipsoids.covariance": ("a row less",),
    "sandwich.covariance": ("a row less",),
}


def damaged(value: object) -> Iterator[tuple[str, object]]:
    if isinstance(value, np.ndarray):
        kinds = damage.INTEGERS if value.dtype.kind in "iu" else damage.ARRAYS
        rng = np.random.default_rng(7)
        yield from (
            (name, spoil(value, rng))
            for name, spoil in kinds.items()
            if value.size or name in ("an axis more", "ragged")
        )
    elif isinstance(value, bool) or value is None:
        return
    elif isinstance(value, (int, float, str)):
        kinds = {int: damage.COUNTS, float: damage.NUMBERS, str: damage.NAMES}[type(value)]
        yield from ((repr(wrong), wrong) for wrong in kinds)
    else:
        yield from (("nothing", None), ("a list of it", [value]), ("its type", type(value)), ("a name", "x"))


# What needs no row of its own.
EXEMPT = {
    *(
        "Concern",
        "Diagnosis",
        "Direction",
        "Ellipsoids",
        "Iteration",
        "MahalanobisTest",
        "Nees",
        "Preintegrated",
    ),
    *(
        "Covariance",
        "EstimateCovariance",
        "RelativePose",
        "Solution",
        "Status",
        "TrajectoryErrors",
    ),  # results
    *("Gauge", "Group", "MotionFactor", "Euclidean", "Similarity", "YawTranslation"),  # no arguments
    *("held", "meet", "normal", "prior", "at", "tangent", "act"),  # called by the package, which looks first
    *("Distance", "MeanDepth", "CentroidGauge", "FixedGauge", "FreeGauge"),  # keys, looked up with a layout
    *(
        "require_size",
        "require_valid",
        "require_fits",
        "stepped",
        "from_equations",
        "spectrum",
    ),  # within the package
    *("pose_rows", "world_from", "with_points", "name_of"),
    *("normal_from", "example_problem"),  # functions; no argument
    *("load_problems", "save_problems", "load_trajectory", "save_trajectory"),  # fuzzed, and tests/model
    "LinearFactor",  # as MotionFactor
    *("State", "chain", "only"),  # as State.start, whose array fields they are; as InertialFactors
}


def public_callables() -> Iterator[str]:
    for name in vg.__all__:
        value = getattr(vg, name)
        if not callable(value) or (inspect.isclass(value) and issubclass(value, Exception)):
            continue
        yield name
        if inspect.isclass(value):
            for method, function in vars(value).items():
                function = getattr(function, "__func__", function)
                public = inspect.isfunction(function) and not method.startswith("_")
                if public and len(inspect.signature(function).parameters) > 1:
                    yield f"{name}.{method}"


def test_everything_public_is_in_the_table() -> None:
    """Catches a new function that nobody gave wrong input."""
    rows = {name.split(" ")[0] for name in CALLS}
    missing = {name for name in public_callables() if not {name, name.split(".")[-1]} & (rows | EXEMPT)}
    assert not missing


@pytest.mark.parametrize("name", CALLS)
def test_right_arguments_are_taken(name):
    """Catches a row of the table that is refused whatever is damaged."""
    call, right = CALLS[name]
    call(**right)


PAIRS = [(name, argument) for name, (_, arguments) in CALLS.items() for argument in arguments]


@pytest.mark.parametrize(("name", "argument"), PAIRS)
def test_damaged_arguments_are_refused(name, argument):
    """Catches a number or NaN for input that has no answer, and errors that are not the package's."""
    call, right = CALLS[name]
    optional = inspect.signature(call).parameters[argument].default is None
    for what, wrong in damaged(right[argument]):
        if (wrong is None and optional) or what in HARMLESS.get(f"{name}.{argument}", ()):
            continue
        with pytest.raises(vg.VigaugeError):
            call(**right | {argument: wrong})
            pytest.fail(f"{what} was taken")
