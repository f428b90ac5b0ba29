"""An estimate beside the ground truths of its folder, where there are any: compared with, never used."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import VigaugeError
from ...geometry.so3 import Array
from ...model.evaluation import trajectory_errors
from ...model.imu import ImuSamples
from ...model.state import State
from ..asl.ground_truth import GroundTruth, read_ground_truth, truth_folders
from ..asl.sequence import Sequence
from ..asl.truth_steps import find_steps, without_steps

# Biases move slowly; a truth row this near an instant speaks for it.
_BIAS_REACH_NS = 100_000_000


@dataclass(frozen=True)
class TruthComparison:
    """Errors against one ground truth, first poses joined.

    Attributes
    ----------
    name : its folder
    p_rmse_m, phi_rmse_deg, v_rmse_mps : over the keyframes
    gyro_bias_error, accel_bias_error : (3,) rad/s and m/s^2, mean over the keyframes of estimate less truth;
        None where the truth has no biases
    refused : why nothing could be compared, else empty
    """

    name: str
    p_rmse_m: float = float("nan")
    phi_rmse_deg: float = float("nan")
    v_rmse_mps: float = float("nan")
    gyro_bias_error: Array | None = None
    accel_bias_error: Array | None = None
    refused: str = ""

    def __str__(self) -> str:
        if self.refused:
            return f"{self.name}: not compared: {self.refused}"
        text = (
            f"{self.name}: RMSE {1e3 * self.p_rmse_m:.1f} mm, {self.phi_rmse_deg:.3f} deg, "
            f"{1e3 * self.v_rmse_mps:.1f} mm/s"
        )
        if self.gyro_bias_error is None or self.accel_bias_error is None:
            return text
        gyro, accel = (float(np.linalg.norm(e)) for e in (self.gyro_bias_error, self.accel_bias_error))
        return f"{text}; biases off by {gyro:.2g} rad/s, {accel:.2g} m/s^2"

    def to_mapping(self) -> dict[str, Any]:
        """Plain numbers and lists."""
        if self.refused:
            return {"name": self.name, "refused": self.refused}
        out: dict[str, Any] = {
            "name": self.name,
            "p_rmse_m": self.p_rmse_m,
            "phi_rmse_deg": self.phi_rmse_deg,
            "v_rmse_mps": self.v_rmse_mps,
        }
        if self.gyro_bias_error is not None and self.accel_bias_error is not None:
            out["gyro_bias_error_radps"] = self.gyro_bias_error.tolist()
            out["accel_bias_error_mps2"] = self.accel_bias_error.tolist()
        return out


def compare_with_truths(sequence: Sequence, state: State, t_ns: NDArray[np.int64]) -> list[TruthComparison]:
    """One comparison for each ground truth there is; one that cannot be used says why."""
    return list(_comparisons(sequence, state, t_ns))


def _comparisons(sequence: Sequence, state: State, t_ns: NDArray[np.int64]) -> Iterator[TruthComparison]:
    mav = sequence.folder / "mav0"
    for name in truth_folders(mav):
        try:
            truth = read_ground_truth(mav / name)
            yield _compared(name, truth, sequence.imu, state, t_ns)
        except VigaugeError as error:
            yield TruthComparison(name, refused=str(error))


def _compared(
    name: str, truth: GroundTruth, samples: ImuSamples, state: State, t_ns: NDArray[np.int64]
) -> TruthComparison:
    errors = trajectory_errors(state, without_steps(truth, find_steps(truth, samples)).states_at(t_ns))
    gyro_error, accel_error = None, None
    if truth.gyro_bias is not None and truth.accel_bias is not None:
        row = truth.nearest(t_ns, _BIAS_REACH_NS)
        assert state.gyro_bias is not None and state.accel_bias is not None
        gyro_error = np.mean(state.gyro_bias - truth.gyro_bias[row], axis=0)
        accel_error = np.mean(state.accel_bias - truth.accel_bias[row], axis=0)
    rmse = errors.p_rmse_m, errors.phi_rmse_deg, errors.v_rmse_mps
    return TruthComparison(name, *rmse, gyro_error, accel_error)
