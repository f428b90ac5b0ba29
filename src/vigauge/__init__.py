"""Covariance of visual-inertial estimates in any gauge, and fast visual-inertial least squares.

Where to start: ``vg.solve(vg.example_problem(), vg.FreeGauge())``. The public names:

"""

from importlib import import_module
from typing import Any

__version__ = "0.2.0"

# Public names: the module of each, and what it is. A name is loaded when first asked for, so that `import
# vigauge` costs nothing. Type checkers read the same names in __init__.pyi.
_PUBLIC = {
    "example_problem": ("", "a small simulated problem, which comes with the package"),
    "load_problems": ("model.archive", "problems from a file"),
    "save_problems": ("model.archive", "problems into a file"),
    "save_trajectory": (
        "model.trajectory_files",
        "an estimate and its covariance into a TUM, CSV or npz file",
    ),
    "load_trajectory": ("model.trajectory_files", "the same from a file"),
    "Trajectory": ("model.trajectory", "poses with times, sigmas, gauge, frame and side"),
    "Problem": ("model.problem", "measurements, cameras, noise, and the state to start from"),
    "State": ("model.state", "poses and velocities of keyframes, and landmarks"),
    "Camera": ("geometry.camera", "one calibrated camera on the body"),
    "InertialFactors": ("model.problem", "preintegrated factors between keyframes, stacked"),
    "ImuSamples": ("model.imu", "gyroscope and accelerometer samples"),
    "ImuNoise": ("model.imu", "their noise densities"),
    "Preintegrated": ("model.imu", "increments between two keyframes, and their covariance"),
    "preintegrate": ("model.imu", "inertial samples between two times as one factor"),
    "solve": ("solver.levenberg_marquardt", "minimise a problem under a gauge"),
    "solve_with_samples": ("solver.reintegration", "the same, integrating anew at the biases found"),
    "reintegrate": ("solver.reintegration", "inertial factors at the biases of a state"),
    "Options": ("solver.levenberg_marquardt", "tolerances, limits and threads of a solve"),
    "Solution": ("solver.levenberg_marquardt", "the estimate, how the run ended, and its trace"),
    "Status": ("solver.levenberg_marquardt", "why a run ended"),
    "Iteration": ("solver.levenberg_marquardt", "one row of the trace"),
    "Gauge": ("gauge.gauges", "what the solver and the covariance ask of a gauge (protocol)"),
    "Huber": ("model.loss", "a robust loss of reprojection errors: linear beyond delta sigmas"),
    "Cauchy": ("model.loss", "one that nearly ignores errors far beyond delta sigmas"),
    "MotionFactor": ("model.factors", "a further residual on keyframes, such as a GNSS position (protocol)"),
    "LinearFactor": ("model.factors", "its residual and Jacobian at one state"),
    "BiasPrior": ("model.factors", "what is known of a keyframe's biases beforehand"),
    "FixedGauge": ("gauge.gauges", "first position and yaw are held"),
    "PriorGauge": ("gauge.gauges", "first position and yaw have a prior"),
    "FreeGauge": ("gauge.gauges", "nothing is held; covariances are pseudo-inverses"),
    "KeyframeGauge": ("gauge.gauges", "position and heading of any keyframe"),
    "CentroidGauge": ("gauge.gauges", "mean position and mean yaw of all keyframes"),
    "Group": ("gauge.group", "motions that no measurement sees (protocol)"),
    "YawTranslation": ("gauge.group", "the group of visual-inertial problems: 4 directions"),
    "Euclidean": ("gauge.group", "the group of stereo images alone: 6 directions"),
    "Similarity": ("gauge.group", "the group of one camera's images alone: 7 directions"),
    "orbit_tangent": ("gauge.group", "the four directions that no measurement sees"),
    "Covariance": ("covariance.covariance", "the covariance of an estimate, one inverse for all gauges"),
    "motion_covariance": ("covariance.covariance", "covariance of all keyframes in a gauge"),
    "keyframe_covariances": ("covariance.covariance", "blocks of single keyframes, without the whole matrix"),
    "landmark_covariances": ("covariance.covariance", "blocks of single landmarks, without the whole matrix"),
    "transform_covariance": ("covariance.transform", "covariance and estimate moved from gauge to gauge"),
    "project_covariance": ("covariance.projection", "any covariance to another gauge, at the same point"),
    "covariance_from_hessian": ("covariance.foreign", "covariance from any estimator's information matrix"),
    "EstimateCovariance": ("covariance.estimate", "the covariance of anyone's estimate in any gauge"),
    "Layout": ("gauge.layout", "which columns of an information matrix belong to what"),
    "null_space": ("gauge.layout", "the directions that no measurement sees, by a layout"),
    "gauge_normal": ("gauge.normals", "the constraints of a gauge, by a layout"),
    "normal_from": ("gauge.normals", "the same of a gauge of one's own, by differences"),
    "Distance": ("gauge.normals", "the scale by the distance of two keyframes"),
    "MeanDepth": ("gauge.normals", "the scale by the mean distance of points from a keyframe"),
    "RelativePose": ("covariance.relative", "one keyframe in another's frame, and its covariance"),
    "MahalanobisTest": ("covariance.relative", "whether a measured relative pose fits"),
    "nees": ("covariance.calibration", "errors in units of their covariances, with the band that fits"),
    "Nees": ("covariance.calibration", "the answer to that"),
    "sandwich": ("covariance.calibration", "the covariance under a robust loss, from the residuals"),
    "ellipsoids": ("covariance.ellipsoids", "covariances of positions as ellipsoids, for pictures"),
    "Ellipsoids": ("covariance.ellipsoids", "their semi-axes, rotations and surfaces"),
    "as_convention": ("geometry.charts", "covariances of poses in another side, order and unit"),
    "diagnose": ("observability.diagnosis", "what is unobservable beyond the gauge, and why"),
    "diagnose_hessian": ("observability.diagnosis", "the same of any information matrix"),
    "Diagnosis": ("observability.diagnosis", "the answer, with a sentence"),
    "Direction": ("observability.diagnosis", "one kind of unobservable direction"),
    "audit": ("observability.audit", "what looks wrong with an information matrix from elsewhere"),
    "Concern": ("observability.audit", "one such finding, with a sentence"),
    "trajectory_errors": ("model.evaluation", "RMSE of an estimate against the truth"),
    "TrajectoryErrors": ("model.evaluation", "position, rotation and velocity RMSE"),
    "relative_frobenius": ("model.evaluation", "how far two covariances are apart"),
    "VigaugeError": ("errors", "base of every error raised on purpose"),
    "DataError": ("errors", "bad input: where, what was found, and the rule that it breaks"),
    "SolverError": ("errors", "the optimiser could not go on"),
    "DegenerateError": ("errors", "more than the gauge is unobservable: no covariance"),
    "IndefiniteError": ("errors", "an information matrix with a negative eigenvalue"),
    "OutputError": ("errors", "a result could not be written"),
    "MissingExtraError": ("errors", "packages of an extra are not installed"),
}

__all__ = ["__version__", *_PUBLIC]
__doc__ += "\n".join(f"{name:23s} {meaning}" for name, (_, meaning) in _PUBLIC.items())


def example_problem(biases: str = "known") -> Any:
    """A small simulated Problem: ten keyframes on a sine path, two hundred landmarks, 2.5 s of inertial data.

    Every call gives the same numbers. The start is off by 5 cm, 6 degrees and 5 cm/s a keyframe.

    Parameters
    ----------
    biases : "known", there are none; or "estimated", with the biases of both sensors in the state. These
        start at zero. The true ones begin at (0.01, -0.02, 0.015) rad/s and (0.05, -0.1, 0.08) m/s^2, body
        frame, and walk as those of a MEMS sensor do: over 2.5 s by 3e-5 rad/s and 5e-3 m/s^2, one sigma.

    Raises DataError for another word.
    """
    from pathlib import Path

    # By name, as the names above: to a tool that reads imports, `import vigauge` brings none of the library.
    files = {"known": "example.npz", "estimated": "example_biases.npz"}
    if biases not in files:
        raise __getattr__("DataError")(
            "example_problem", 'must be "known" or "estimated"', field="biases", value=biases
        )
    return __getattr__("load_problems")(Path(__file__).with_name(files[biases]))[0]


def __getattr__(name: str) -> Any:
    if name in _PUBLIC:
        value = getattr(import_module(f"{__name__}.{_PUBLIC[name][0]}"), name)
        globals()[name] = value  # found at once the next time
        return value
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
