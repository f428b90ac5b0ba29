"""Ground truth of ASL folders: poses, and where the file has them velocities and biases."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicHermiteSpline
from scipy.spatial.transform import Rotation, Slerp

from ...errors import DataError
from ...geometry import so3
from ...geometry.so3 import Array
from ...model.state import State
from .nearest import nearest_index
from .tables import FASTEST_SAMPLES_NS, read_table

_POSE_COLUMNS, _STATE_COLUMNS = 8, 17
_QUATERNION_TOLERANCE = 1e-3
# Stamps of one instant differ by rounding: 256 ns where they passed through a double.
_SAME_INSTANT_NS = 1_000
# A truth of 20 Hz and its jitter. Over it, a turn that speeds up by 5 rad/s^2 is interpolated to 2 mrad.
LARGEST_GAP_NS = 55_000_000


@dataclass(frozen=True)
class GroundTruth:
    """States of the body in the world frame of the truth, which may differ from a map's."""

    t_ns: NDArray[np.int64]  # (M,) int64, strictly increasing
    p_W: Array  # (M, 3) m
    R_WB: Array  # (M, 3, 3)
    v_W: Array | None = None  # (M, 3) m/s, or None where the file has poses only
    # (M, 3) rad/s and m/s^2, or None.
    gyro_bias: Array | None = None
    accel_bias: Array | None = None
    source: str = "ground truth"  # the file, for messages
    n_unsorted: int = 0  # rows that were out of order and have been sorted

    def nearest(self, t_ns: ArrayLike, max_distance_ns: int = 1_000_000) -> NDArray[np.intp]:
        """Index of the state nearest each stamp: published stamps of one instant may differ by 256 ns.

        Raises DataError where the nearest is further off than ``max_distance_ns``.
        """
        index, distance = nearest_index(self.t_ns, t_ns)
        if np.any(distance > max_distance_ns):
            k = int(np.argmax(distance > max_distance_ns))
            raise DataError(
                self.source,
                f"must have a state within {max_distance_ns} ns of each wanted stamp",
                row=k,
                field="timestamp",
                value=int(np.ravel(t_ns)[k]),
            )
        return index

    def serves(self, t_ns: NDArray[np.int64]) -> NDArray[np.bool_]:
        """(N,) stamps with a state at their instant, or between two states LARGEST_GAP_NS apart at most."""
        after = np.clip(np.searchsorted(self.t_ns, t_ns), 1, max(len(self.t_ns) - 1, 1))
        after = np.minimum(after, len(self.t_ns) - 1)
        before = np.maximum(after - 1, 0)
        between = (self.t_ns[before] <= t_ns) & (t_ns <= self.t_ns[after])
        between &= self.t_ns[after] - self.t_ns[before] <= LARGEST_GAP_NS
        same = nearest_index(self.t_ns, t_ns)[1] <= _SAME_INSTANT_NS
        return np.asarray(between | same)

    def states_at(self, t_ns: NDArray[np.int64]) -> State:
        """True motion at keyframe stamps (N,), without landmarks.

        A state of the same instant is taken as it is. Between states, positions follow the cubic that
        meets positions and velocities, velocities the straight line, rotations the great circle (SLERP).
        Where the truth has poses only, velocities are derived (:func:`derived_velocity`).

        Raises DataError where the truth has no states near enough (:meth:`serves`) or, of poses only, none
        that a velocity can be derived at.
        """
        if self.v_W is None:
            return self._with_derived_velocities().states_at(t_ns)
        t_ns = np.asarray(t_ns, dtype=np.int64)
        missing = ~self.serves(t_ns)
        if np.any(missing):
            k = int(np.argmax(missing))
            rule = (
                f"must have a state at each keyframe, or states {LARGEST_GAP_NS / 1e6:g} ms apart around it"
            )
            raise DataError(self.source, rule, row=k, field="timestamp", value=int(t_ns[k]))
        row, distance = nearest_index(self.t_ns, t_ns)
        p_W, R_WB, v_W = self.p_W[row], self.R_WB[row], self.v_W[row]
        off = distance > _SAME_INSTANT_NS
        if np.any(off):
            first = int(np.searchsorted(self.t_ns, t_ns[off][0])) - 1
            last = int(np.searchsorted(self.t_ns, t_ns[off][-1])) + 1
            part = slice(max(first, 0), last)
            seconds = (self.t_ns[part] - t_ns[off][0]) * 1e-9
            wanted = (t_ns[off] - t_ns[off][0]) * 1e-9
            p_W[off] = CubicHermiteSpline(seconds, self.p_W[part], self.v_W[part])(wanted)
            v_W[off] = np.column_stack([np.interp(wanted, seconds, v) for v in self.v_W[part].T])
            R_WB[off] = Slerp(seconds, Rotation.from_matrix(self.R_WB[part]))(wanted).as_matrix()
        return State.start(p_W, R_WB, v_W, np.zeros((0, 3)))

    def _with_derived_velocities(self) -> GroundTruth:
        """The states that a velocity can be derived at, with it."""
        v_W = derived_velocity(self)
        known = np.all(np.isfinite(v_W), axis=1)
        if not np.any(known):
            rule = "must have velocities (17 columns), or poses of 0.1 s at most 25 ms apart to derive them"
            raise DataError(self.source, rule, value=f"{len(self.t_ns)} poses")
        return replace(
            self, t_ns=self.t_ns[known], p_W=self.p_W[known], R_WB=self.R_WB[known], v_W=v_W[known]
        )


def derived_velocity(truth: GroundTruth) -> Array:
    """(M, 3) m/s by central differences over a tenth of a second; NaN at the ends and in holes."""
    half = 50_000_000
    before, off_before = nearest_index(truth.t_ns, truth.t_ns - half)
    after, off_after = nearest_index(truth.t_ns, truth.t_ns + half)
    dt = (truth.t_ns[after] - truth.t_ns[before])[:, None] * 1e-9
    v_W = (truth.p_W[after] - truth.p_W[before]) / np.where(dt > 0.0, dt, np.nan)
    v_W[(off_before > half // 2) | (off_after > half // 2)] = np.nan
    return v_W


def truth_folders(mav: Path) -> list[str]:
    """Names of the folders of a ``mav0`` that hold a ground truth: ASL's, then TUM-VI's ``mocap0``."""
    return sorted(path.name for path in (*mav.glob("state_groundtruth_*"), *mav.glob("mocap0")))


def read_ground_truth(folder: Path, *, sort: bool = False) -> GroundTruth:
    """Read ``data.csv`` of a ``state_groundtruth_*`` folder, or of TUM-VI's ``mocap0``.

    Columns: stamp, position, quaternion (w first); with 17 columns also velocity,
    gyroscope bias, accelerometer bias, which are absent with 8, as ``mocap0`` has. ``sort`` puts rows in
    order of time; without it, rows out of order are an error.
    """
    table = read_table(
        Path(folder) / "data.csv", (_POSE_COLUMNS, _STATE_COLUMNS), sort=sort, fastest_ns=FASTEST_SAMPLES_NS
    )
    _require_w_first(table.path, table.columns)
    values = table.numbers()
    quaternion = values[:, 3:7]
    norm = np.linalg.norm(quaternion, axis=1)
    wrong = np.abs(norm - 1.0) > _QUATERNION_TOLERANCE
    if np.any(wrong):
        k = int(np.argmax(wrong))
        row = int(table.lines[k])
        rule = "quaternion must have unit length"
        raise DataError(table.path, rule, row=row, field="q", value=quaternion[k].tolist())
    full = values.shape[1] == _STATE_COLUMNS - 1
    return GroundTruth(
        t_ns=table.t_ns,
        p_W=values[:, 0:3],
        R_WB=so3.from_quaternion(quaternion / norm[:, None]),
        v_W=values[:, 7:10] if full else None,
        gyro_bias=values[:, 10:13] if full else None,
        accel_bias=values[:, 13:16] if full else None,
        source=str(table.path),
        n_unsorted=table.n_unsorted,
    )


def _require_w_first(path: Path, columns: tuple[str, ...]) -> None:
    """The format puts w first; a header that names another component there is refused."""
    if len(columns) > 4:
        name = columns[4].split("[")[0].strip().lower()
        if name.startswith("q") and not name.endswith("w"):
            raise DataError(path, "quaternion must have w first", row=1, field="header", value=columns[4])
