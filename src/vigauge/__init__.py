"""vigauge: gauge freedom in visual-inertial estimation, and covariances in any gauge.

The names below are the public library; each is loaded when first asked for, so that
importing one part does not import all.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

_PUBLIC = {
    "State": "state",
    "Camera": "camera",
    "ImuNoise": "imu",
    "ImuSamples": "imu",
    "preintegrate": "imu",
    "Problem": "problem",
    "InertialFactors": "problem",
    "load_problems": "archive",
    "save_problems": "archive",
    "FixedGauge": "gauge",
    "PriorGauge": "gauge",
    "FreeGauge": "gauge",
    "KeyframeGauge": "gauge",
    "CentroidGauge": "gauge",
    "orbit_tangent": "gauge",
    "solve": "levenberg_marquardt",
    "Options": "levenberg_marquardt",
    "motion_covariance": "covariance",
    "keyframe_covariances": "marginals",
    "landmark_covariances": "marginals",
    "transform_covariance": "covariance",
    "project_covariance": "covariance",
    "covariance_from_hessian": "covariance",
    "diagnose": "diagnosis",
    "diagnose_hessian": "diagnosis",
    "Diagnosis": "diagnosis",
    "trajectory_errors": "evaluation",
    "relative_frobenius": "evaluation",
}

__all__ = ["__version__", *_PUBLIC]


def __getattr__(name: str) -> Any:
    if name in _PUBLIC:
        return getattr(import_module(f"{__name__}.{_PUBLIC[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
