"""vigauge: gauge freedom in visual-inertial estimation, and covariances in any gauge.

The names below are the public library; each is loaded when first asked for, so that
importing one part does not import all.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

_PUBLIC = {
    "State": "model.state",
    "Camera": "geometry.camera",
    "ImuNoise": "model.imu",
    "ImuSamples": "model.imu",
    "preintegrate": "model.imu",
    "Problem": "model.problem",
    "InertialFactors": "model.problem",
    "load_problems": "model.archive",
    "save_problems": "model.archive",
    "FixedGauge": "gauge.gauges",
    "PriorGauge": "gauge.gauges",
    "FreeGauge": "gauge.gauges",
    "KeyframeGauge": "gauge.gauges",
    "CentroidGauge": "gauge.gauges",
    "orbit_tangent": "gauge.group",
    "solve": "solver.levenberg_marquardt",
    "Options": "solver.levenberg_marquardt",
    "Covariance": "covariance.covariance",
    "motion_covariance": "covariance.covariance",
    "keyframe_covariances": "covariance.covariance",
    "landmark_covariances": "covariance.covariance",
    "transform_covariance": "covariance.transform",
    "project_covariance": "covariance.projection",
    "covariance_from_hessian": "covariance.foreign",
    "diagnose": "observability.diagnosis",
    "diagnose_hessian": "observability.diagnosis",
    "Diagnosis": "observability.diagnosis",
    "trajectory_errors": "model.evaluation",
    "relative_frobenius": "model.evaluation",
}

__all__ = ["__version__", *_PUBLIC]


def __getattr__(name: str) -> Any:
    if name in _PUBLIC:
        return getattr(import_module(f"{__name__}.{_PUBLIC[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
