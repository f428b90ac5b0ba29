"""What a turn of everything about one axis does to the errors: which axis an error can be about.

A turn by phi about the unit axis u makes velocity errors of phi |u x v|, and position errors of
phi |u x (p - p_0)| once the first positions are joined.
"""

from __future__ import annotations

import numpy as np

from vigauge.geometry.so3 import Array
from vigauge.model.state import State

Row = dict[str, object]


def _rms_per_degree(axis: Array, vectors: Array) -> float:
    across = np.cross(axis, vectors)
    return float(np.radians(1.0) * np.sqrt(np.mean(np.sum(across**2, axis=1))))


def rigid_turns(name: str, truth: State) -> list[Row]:
    """RMSE a degree of turn: about the vertical, and about the level axis that turns velocities least."""
    level = truth.v_W[:, :2]
    along = np.linalg.eigh(level.T @ level)[1][:, -1]
    axes = {"vertical": np.array([0.0, 0.0, 1.0]), "level": np.array([along[0], along[1], 0.0])}
    return [
        {
            "experiment": name,
            "axis": label,
            "p_rmse_m": _rms_per_degree(axis, truth.p_W - truth.p_W[0]),
            "v_rmse_mps": _rms_per_degree(axis, truth.v_W),
        }
        for label, axis in axes.items()
    ]
