"""One non-linear least-squares problem, Eq. (1): measurements, noise, cameras, initial state.

Measurements are arrays, one row an observation, ordered by landmark: everything after
works on whole arrays.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ..errors import DataError
from ..geometry.camera import Camera
from ..geometry.so3 import Array
from ..kernels.covisibility import spread_pixels
from ..kernels.inertial import Increments
from ..kernels.lanes import LANES
from ..sparsity.structure import Structure
from .factors import MotionFactor
from .imu import Preintegrated
from .state import State


def _require_finite(file: str, name: str, array: Array) -> None:
    if not np.all(np.isfinite(array)):
        row = int(np.argwhere(~np.isfinite(array))[0][0])
        raise DataError(file, "must be finite", field=name, row=row, value=array[row])


def _make_contiguous(owner: object, names: tuple[str, ...], dtype: type) -> None:
    """One form for compiled code; arrays that have it are kept as they are."""
    for name in names:
        array = np.asarray(getattr(owner, name))
        if not np.can_cast(array.dtype, dtype, "same_kind"):
            raise DataError("problem", f"must hold {dtype.__name__}", field=name, value=array.dtype)
        object.__setattr__(owner, name, np.ascontiguousarray(array, dtype=dtype))


@dataclass(frozen=True)
class InertialFactors:
    """F preintegrated factors, stacked; factor f joins keyframes ``first[f]`` and ``second[f]``.

    ``dt`` (F,) s, ``dp`` (F, 3) m, ``dR`` (F, 3, 3), ``dv`` (F, 3) m/s; ``covariance``
    (F, 9, 9) in the order (dp, rotation, dv).

    Raises DataError for other shapes, non-finite numbers, a keyframe joined with itself, times that
    are not positive, or covariances that are not positive definite.
    """

    first: NDArray[np.int64]
    second: NDArray[np.int64]
    dt: Array
    dp: Array
    dR: Array
    dv: Array
    covariance: Array

    def __post_init__(self) -> None:
        _make_contiguous(self, ("first", "second"), np.int64)
        _make_contiguous(self, ("dt", "dp", "dR", "dv", "covariance"), np.float64)
        count = len(self.dt)
        for name, shape in (
            ("first", (count,)),
            ("second", (count,)),
            ("dt", (count,)),
            ("dp", (count, 3)),
            ("dR", (count, 3, 3)),
            ("dv", (count, 3)),
            ("covariance", (count, 9, 9)),
        ):
            array = getattr(self, name)
            if array.shape != shape:
                raise DataError("inertial factors", f"must have shape {shape}", field=name, value=array.shape)
            _require_finite("inertial factors", name, array)
        if np.any(self.first == self.second):
            row = int(np.argmax(self.first == self.second))
            value = int(self.second[row])
            rule = "must join two keyframes"
            raise DataError("inertial factors", rule, field="second", row=row, value=value)
        if count and self.dt.min() <= 0.0:
            row = int(np.argmin(self.dt))
            raise DataError(
                "inertial factors", "must be positive", field="dt", row=row, value=float(self.dt[row])
            )
        try:
            np.linalg.cholesky(self.covariance)
        except np.linalg.LinAlgError as error:
            row = int(np.argmin(np.linalg.eigvalsh(self.covariance)[:, 0]))
            raise DataError(
                "inertial factors", "must be positive definite", field="covariance", row=row
            ) from error

    @classmethod
    def chain(cls, factors: list[Preintegrated]) -> InertialFactors:
        """Factors between consecutive keyframes 0-1, 1-2, ..."""
        index = np.arange(len(factors), dtype=np.int64)
        return cls(
            first=index,
            second=index + 1,
            dt=np.array([f.dt for f in factors]),
            dp=np.array([f.dp for f in factors]).reshape(-1, 3),
            dR=np.array([f.dR for f in factors]).reshape(-1, 3, 3),
            dv=np.array([f.dv for f in factors]).reshape(-1, 3),
            covariance=np.array([f.covariance for f in factors]).reshape(-1, 9, 9),
        )

    @cached_property
    def whitener(self) -> Array:
        """(F, 9, 9) lower-triangular W with W cov W^T = I."""
        return np.linalg.inv(np.linalg.cholesky(self.covariance))


@dataclass(frozen=True)
class Problem:
    """Measurements and the state from which an optimisation starts.

    Attributes
    ----------
    initial : initial state theta_0, W frame
    cameras : the cameras that observations refer to
    obs_keyframe, obs_camera, obs_landmark : (M,) int64 indices, ordered by landmark, then keyframe
    obs_uv : (M, 2) ideal (undistorted) pixels
    sigma_px : standard deviation of one pixel coordinate
    inertial : preintegrated factors, biases taken off
    gravity : g in m/s^2; g_W = (0, 0, -g)
    factors : further residuals on keyframes (GNSS, compass, ...), see :class:`.factors.MotionFactor`

    Raises DataError where shapes, indices, order or numbers are wrong.
    """

    initial: State
    cameras: tuple[Camera, ...]
    obs_keyframe: NDArray[np.int64]
    obs_camera: NDArray[np.int64]
    obs_landmark: NDArray[np.int64]
    obs_uv: Array
    sigma_px: float
    inertial: InertialFactors
    gravity: float
    factors: tuple[MotionFactor, ...] = ()

    def __post_init__(self) -> None:
        _make_contiguous(self, ("obs_keyframe", "obs_camera", "obs_landmark"), np.int64)
        _make_contiguous(self, ("obs_uv",), np.float64)
        n, k, m = self.initial.n_keyframes, self.initial.n_landmarks, len(self.obs_uv)
        if self.obs_uv.shape != (m, 2):
            raise DataError("problem", f"must have shape ({m}, 2)", field="obs_uv", value=self.obs_uv.shape)
        for name, index, length, count in (
            ("obs_keyframe", self.obs_keyframe, m, n),
            ("obs_camera", self.obs_camera, m, len(self.cameras)),
            ("obs_landmark", self.obs_landmark, m, k),
            ("first", self.inertial.first, len(self.inertial.dt), n),
            ("second", self.inertial.second, len(self.inertial.dt), n),
        ):
            if index.shape != (length,):
                raise DataError("problem", f"must have shape ({length},)", field=name, value=index.shape)
            bad = np.flatnonzero((index < 0) | (index >= count))
            if bad.size:
                raise DataError(
                    "problem",
                    f"must lie in 0..{count - 1}",
                    field=name,
                    row=int(bad[0]),
                    value=int(index[bad[0]]),
                )
        self._require_order()
        _require_finite("problem", "obs_uv", self.obs_uv)
        for name in ("sigma_px", "gravity"):
            if not np.isfinite(getattr(self, name)):
                raise DataError("problem", "must be finite", field=name, value=getattr(self, name))
        for number, factor in enumerate(self.factors):
            missing = [k for k in factor.keyframes if not 0 <= k < n]
            if missing:
                raise DataError(
                    "problem",
                    f"keyframes must lie in 0..{n - 1}",
                    field="factors",
                    row=number,
                    value=missing[0],
                )
        if not self.sigma_px > 0:
            raise DataError("problem", "must be positive", field="sigma_px", value=self.sigma_px)

    def _require_order(self) -> None:
        """Observations of a landmark and keyframe are one pair, so what belongs together must be adjacent."""
        step = np.diff(self.obs_landmark)
        if np.any(step < 0):
            raise DataError("problem", "observations must be ordered by landmark", field="obs_landmark")
        if np.any(np.diff(self.obs_keyframe)[step == 0] < 0):
            raise DataError(
                "problem", "observations of a landmark must be ordered by keyframe", field="obs_keyframe"
            )
        seen = np.bincount(self.obs_landmark, minlength=self.initial.n_landmarks)
        if len(seen) and seen.min() == 0:
            raise DataError(
                "problem", "every landmark must be observed", field="obs_landmark", row=int(np.argmin(seen))
            )

    @classmethod
    def from_observations(
        cls,
        initial: State,
        cameras: tuple[Camera, ...],
        keyframe: NDArray[np.int64],
        camera: NDArray[np.int64],
        landmark: NDArray[np.int64],
        uv: Array,
        sigma_px: float,
        inertial: InertialFactors,
        gravity: float,
        factors: tuple[MotionFactor, ...] = (),
    ) -> Problem:
        """Build from observations in any order (they are sorted by landmark, keyframe, camera)."""
        order = np.lexsort((camera, keyframe, landmark))
        return cls(
            initial=initial,
            cameras=cameras,
            obs_keyframe=np.asarray(keyframe, dtype=np.int64)[order],
            obs_camera=np.asarray(camera, dtype=np.int64)[order],
            obs_landmark=np.asarray(landmark, dtype=np.int64)[order],
            obs_uv=np.asarray(uv, dtype=float)[order],
            sigma_px=sigma_px,
            inertial=inertial,
            gravity=gravity,
            factors=factors,
        )

    def with_initial(self, initial: State) -> Problem:
        """The same measurements, started elsewhere."""
        return replace(self, initial=initial)

    def with_noise(self, sigma_px: float, density_factor: float) -> Problem:
        """Another belief about the noise: pixel sigma, and a factor on both inertial densities."""
        covariance = self.inertial.covariance * density_factor**2
        return replace(self, sigma_px=sigma_px, inertial=replace(self.inertial, covariance=covariance))

    @cached_property
    def structure(self) -> Structure:
        """Which observations meet: the same at every state."""
        return Structure.of(
            self.initial.n_keyframes,
            self.initial.n_landmarks,
            len(self.cameras),
            (self.obs_keyframe, self.obs_camera, self.obs_landmark),
            self._joined,
        )

    @property
    def _joined(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Pairs of keyframes that an inertial or a motion factor joins."""
        pairs = [pair for factor in self.factors for pair in combinations(factor.keyframes, 2)]
        more = np.array(pairs, dtype=np.int64).reshape(-1, 2)
        first, second = self.inertial.first, self.inertial.second
        return np.concatenate([first, more[:, 0]]), np.concatenate([second, more[:, 1]])

    @cached_property
    def increments(self) -> Increments:
        """The inertial factors as the kernels read them."""
        f = self.inertial
        return Increments(f.first, f.second, f.dt, f.dp, f.dR, f.dv, f.whitener, float(self.gravity))

    @cached_property
    def pixels(self) -> Array:
        """(V, 3 LANES) u, v and 1 / sigma of the observations of every view, zero where there is none."""
        out = np.zeros((self.structure.n_views, 3 * LANES))
        spread_pixels(self.obs_uv, 1.0 / self.sigma_px, self.structure.obs_slot, out)
        return out

    @cached_property
    def camera_arrays(self) -> dict[str, Array]:
        """``intrinsics`` (C, 4) (fx, fy, cx, cy) and the extrinsics ``R_BC``, ``p_BC``, ``p_CB``, stacked."""
        n = len(self.cameras)
        R_BC = np.array([c.R_BC for c in self.cameras], dtype=float).reshape(n, 3, 3)
        p_BC = np.array([c.p_BC for c in self.cameras], dtype=float).reshape(n, 3)
        intrinsics = np.array([(c.fx, c.fy, c.cx, c.cy) for c in self.cameras], dtype=float).reshape(n, 4)
        return {
            "intrinsics": intrinsics,
            "R_BC": R_BC,
            "p_BC": p_BC,
            "p_CB": -np.einsum("cji,cj->ci", R_BC, p_BC),
        }
