"""One non-linear least-squares problem, Eq. (1): measurements, noise, cameras, initial state.

Measurements are arrays, one row an observation, ordered by landmark: everything after
works on whole arrays.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from itertools import combinations
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..arrays import (
    indices,
    instance,
    integers,
    number,
    reals,
    require_rotations,
    require_symmetric,
    shape_of,
    vectors,
)
from ..errors import DataError
from ..geometry.camera import Camera
from ..geometry.so3 import Array
from ..kernels.covisibility import spread_pixels
from ..kernels.lanes import LANES
from ..kernels.loss import Loss as CompiledLoss
from ..kernels.sizes import KEYFRAME, WITH_BIASES
from ..sparsity.structure import Structure
from .factors import MotionFactor
from .imu import Preintegrated
from .loss import LOSSES, Loss
from .state import State

Shape = tuple[int | str, ...]


def _take(owner: object, what: str, numbers: Mapping[str, Shape], counts: Mapping[str, Shape]) -> None:
    """One form for compiled code, finite and of the shape given; arrays that have it are kept as they are."""
    for name, shape in counts.items():
        object.__setattr__(owner, name, integers(what, getattr(owner, name), shape, field=name))
    for name, shape in numbers.items():
        object.__setattr__(owner, name, reals(what, getattr(owner, name), shape, field=name))


@dataclass(frozen=True)
class InertialFactors:
    """F preintegrated factors, stacked; factor f joins keyframes ``first[f]`` and ``second[f]``.

    ``dt`` (F,) s, ``dp`` (F, 3) m, ``dR`` (F, 3, 3), ``dv`` (F, 3) m/s; ``covariance``
    (F, 9, 9) in the order (dp, rotation, dv).

    Where biases are estimated: ``by_gyro_bias``, ``by_accel_bias`` (F, 9, 3), derivative of (dp, rotation
    vector right of dR, dv) by the first keyframe's biases; ``gyro_bias``, ``accel_bias`` (F, 3), those at
    which the increments are given; ``covariance`` (F, 15, 15) of (dp, rotation, dv, second keyframe's
    gyroscope bias less the first's, accelerometer bias likewise).

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
    by_gyro_bias: Array | None = None
    by_accel_bias: Array | None = None
    gyro_bias: Array | None = None
    accel_bias: Array | None = None

    def __post_init__(self) -> None:
        count = math.prod(shape_of("inertial factors", self.dt, field="dt"))
        of_biases: dict[str, Shape] = dict.fromkeys(("by_gyro_bias", "by_accel_bias"), (count, 9, 3))
        of_biases |= dict.fromkeys(("gyro_bias", "accel_bias"), (count, 3))
        given = [name for name in of_biases if getattr(self, name) is not None]
        if given and len(given) < len(of_biases):
            missing = next(name for name in of_biases if name not in given)
            raise DataError("inertial factors", f"must be given with {given[0]}", field=missing)
        width = WITH_BIASES if given else KEYFRAME
        _take(
            self,
            "inertial factors",
            {
                "dt": (count,),
                "dp": (count, 3),
                "dR": (count, 3, 3),
                "dv": (count, 3),
                "covariance": (count, width, width),
                **(of_biases if given else {}),
            },
            {"first": (count,), "second": (count,)},
        )
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
        require_rotations("inertial factors", self.dR, field="dR")
        require_symmetric("inertial factors", self.covariance, field="covariance")
        try:
            np.linalg.cholesky(self.covariance)
        except np.linalg.LinAlgError as error:
            row = int(np.argmin(np.linalg.eigvalsh(self.covariance)[:, 0]))
            raise DataError(
                "inertial factors", "must be positive definite", field="covariance", row=row
            ) from error

    @classmethod
    def chain(
        cls, factors: list[Preintegrated], gyro_bias: Array | None = None, accel_bias: Array | None = None
    ) -> InertialFactors:
        """Factors between consecutive keyframes 0-1, 1-2, ...

        ``gyro_bias``, ``accel_bias``: what was taken off the samples, (3,) or (F, 3), where biases are to be
        estimated; the noise must then have a random walk of both.
        """
        index = np.arange(len(factors), dtype=np.int64)
        covariance = np.array([f.covariance for f in factors]).reshape(-1, KEYFRAME, KEYFRAME)
        of_biases: dict[str, Array] = {}
        if gyro_bias is not None or accel_bias is not None:
            with_walk = np.array([f.walk_covariance for f in factors])
            with_walk = with_walk.reshape(-1, WITH_BIASES, WITH_BIASES)
            still = np.diagonal(with_walk, axis1=1, axis2=2)[:, KEYFRAME:] <= 0.0
            if still.any():
                row = int(np.argmax(still.any(axis=1)))
                rule = "must have a random walk of both biases: ImuNoise(..., gyro_walk=, accel_walk=)"
                raise DataError("inertial factors", rule, field="walk_covariance", row=row)
            with_walk[:, :KEYFRAME, :KEYFRAME] += covariance
            covariance = with_walk
            for name, bias in (("gyro_bias", gyro_bias), ("accel_bias", accel_bias)):
                of_biases[name] = vectors("inertial factors", bias, len(factors), field=name)
                by = np.array([getattr(f, f"by_{name}") for f in factors])
                of_biases[f"by_{name}"] = by.reshape(-1, KEYFRAME, 3)
        return cls(
            first=index,
            second=index + 1,
            dt=np.array([f.dt for f in factors]),
            dp=np.array([f.dp for f in factors]).reshape(-1, 3),
            dR=np.array([f.dR for f in factors]).reshape(-1, 3, 3),
            dv=np.array([f.dv for f in factors]).reshape(-1, 3),
            covariance=covariance,
            **of_biases,
        )

    def only(self, rows: NDArray[Any]) -> InertialFactors:
        """The factors of some rows: their numbers, or a mask (F,)."""
        arrays = {field.name: getattr(self, field.name) for field in fields(self)}
        return replace(self, **{name: a[rows] for name, a in arrays.items() if a is not None})

    @property
    def has_biases(self) -> bool:
        """Whether the factors say how they follow a change of the biases."""
        return self.gyro_bias is not None

    @cached_property
    def whitener(self) -> Array:
        """(F, 9, 9), with biases (F, 15, 15), lower-triangular W with W cov W^T = I."""
        return np.linalg.inv(np.linalg.cholesky(self.covariance))

    @cached_property
    def of_biases(self) -> tuple[Array, ...]:
        """(F, 9, 6) derivative by both biases and (F, 6) where increments were integrated, if estimated."""
        by_gyro, by_accel, gyro, accel = (
            self.by_gyro_bias,
            self.by_accel_bias,
            self.gyro_bias,
            self.accel_bias,
        )
        if by_gyro is None or by_accel is None or gyro is None or accel is None:
            return ()
        return np.concatenate([by_gyro, by_accel], axis=2), np.concatenate([gyro, accel], axis=1)


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
    obs_noise : (M,) factor on it for each observation, as the pixels of a fisheye need
        (``camera.ideal_size``); None: 1 for all
    inertial : preintegrated factors, known biases taken off
    gravity : g in m/s^2; g_W = (0, 0, -g)
    factors : further residuals on keyframes (GNSS, compass, ...), see :class:`.factors.MotionFactor`
    biases : "known": taken off the samples, no part of the state. "estimated": one of each sensor a
        keyframe, in the state; the inertial factors then say how they follow them
    loss : robust loss of reprojection errors, :class:`.loss.Huber` or :class:`.loss.Cauchy`; None: squares

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
    biases: Literal["known", "estimated"] = "known"
    loss: Loss | None = None
    obs_noise: Array | None = None

    def __post_init__(self) -> None:
        m = next(iter(shape_of("problem", self.obs_uv, field="obs_uv")), 0)
        counts: dict[str, Shape] = dict.fromkeys(("obs_keyframe", "obs_camera", "obs_landmark"), (m,))
        _take(self, "problem", {"obs_uv": (m, 2)}, counts)
        instance("problem, inertial", self.inertial, InertialFactors)
        for place, camera in enumerate(instance("problem, cameras", self.cameras, Sequence)):
            instance(f"problem, cameras {place}", camera, Camera)
        n, k = (
            instance("problem, initial", self.initial, State).require_valid().n_keyframes,
            self.initial.n_landmarks,
        )
        for name, index, count in (
            ("obs_keyframe", self.obs_keyframe, n),
            ("obs_camera", self.obs_camera, len(self.cameras)),
            ("obs_landmark", self.obs_landmark, k),
            ("first", self.inertial.first, n),
            ("second", self.inertial.second, n),
        ):
            indices("problem", index, count, field=name)
        self._require_order()
        self._require_biases()
        number("problem", self.sigma_px, field="sigma_px", above=0.0)
        if self.obs_noise is not None:
            _take(self, "problem", {"obs_noise": (m,)}, {})
            if m and self.obs_noise.min() <= 0.0:
                row = int(np.argmin(self.obs_noise))
                value = self.obs_noise[row]
                raise DataError("problem", "must be positive", field="obs_noise", row=row, value=value)
        if number("problem", self.gravity, field="gravity") < 0.0:
            rule = "must not be negative: it is the g of g_W = (0, 0, -g)"
            raise DataError("problem", rule, field="gravity", value=self.gravity)
        for place, factor in enumerate(instance("problem, factors", self.factors, Sequence)):
            instance(f"problem, factors {place}", factor, MotionFactor)
            indices(f"problem, factors {place}", factor.keyframes, n, field="keyframes")
        if self.loss is not None and type(self.loss) not in LOSSES.values():
            raise DataError(
                "problem", "must be vg.Huber(delta), vg.Cauchy(delta) or None", field="loss", value=self.loss
            )

    def _require_biases(self) -> None:
        """State and inertial factors must both have biases, or neither."""
        if self.biases not in ("known", "estimated"):
            raise DataError("problem", "must be 'known' or 'estimated'", field="biases", value=self.biases)
        for has, what, how in (
            (self.initial.has_biases, "initial", "state.with_biases(gyro_bias, accel_bias)"),
            (self.inertial.has_biases, "inertial", "InertialFactors.chain(factors, gyro_bias, accel_bias)"),
        ):
            if has != self.estimates_biases:
                rule = f"must have biases where they are estimated: {how}"
                if has:
                    rule = "must have no biases where they are known; say biases='estimated'"
                raise DataError("problem", rule, field=what)

    @property
    def estimates_biases(self) -> bool:
        """Whether the biases are part of the state."""
        return self.biases == "estimated"

    def _require_order(self) -> None:
        """Observations of a landmark and keyframe are one pair, so what belongs together must be adjacent."""
        step = np.diff(self.obs_landmark)
        if np.any(step < 0):
            raise DataError("problem", "observations must be ordered by landmark", field="obs_landmark")
        if np.any(np.diff(self.obs_keyframe)[step == 0] < 0):
            raise DataError(
                "problem", "observations of a landmark must be ordered by keyframe", field="obs_keyframe"
            )
        of_pair = self.obs_landmark * self.initial.n_keyframes + self.obs_keyframe
        view = of_pair * len(self.cameras) + self.obs_camera
        order = np.argsort(view, kind="stable")
        again = order[1:][np.diff(view[order]) == 0]
        if again.size:
            row = int(again.min())
            seen_by = int(self.obs_keyframe[row]), int(self.obs_camera[row])
            rule = "a keyframe's camera must see a landmark once only; keep one observation of each"
            value = f"landmark {self.obs_landmark[row]}, keyframe {seen_by[0]}, camera {seen_by[1]}"
            raise DataError("problem", rule, field="obs_uv", row=row, value=value)
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
        biases: Literal["known", "estimated"] = "known",
        loss: Loss | None = None,
        obs_noise: Array | None = None,
    ) -> Problem:
        """Build from observations in any order (they are sorted by landmark, keyframe, camera)."""
        camera, keyframe, landmark = (
            integers("problem", array, ("M",), field=f"obs_{name}")
            for name, array in (("camera", camera), ("keyframe", keyframe), ("landmark", landmark))
        )
        uv = reals("problem", uv, (len(landmark), 2), field="obs_uv")
        for name, index in (("camera", camera), ("keyframe", keyframe)):
            integers("problem", index, (len(landmark),), field=f"obs_{name}")
        if obs_noise is not None:
            obs_noise = reals("problem", obs_noise, (len(landmark),), field="obs_noise")
        order = np.lexsort((camera, keyframe, landmark))
        return cls(
            initial=initial,
            cameras=cameras,
            obs_keyframe=keyframe[order],
            obs_camera=camera[order],
            obs_landmark=landmark[order],
            obs_uv=uv[order],
            sigma_px=sigma_px,
            inertial=inertial,
            gravity=gravity,
            factors=factors,
            biases=biases,
            loss=loss,
            obs_noise=None if obs_noise is None else obs_noise[order],
        )

    def require_fits(self, state: State) -> State:
        """A state that is one, and of as many keyframes and landmarks as this problem; else DataError."""
        self.initial.require_size(instance("state", state, State).require_valid())
        return state

    def with_initial(self, initial: State) -> Problem:
        """The same measurements, started elsewhere."""
        return replace(self, initial=initial)

    def with_noise(self, sigma_px: float, density_factor: float) -> Problem:
        """Another belief about the noise: pixel sigma, and a factor on both inertial densities."""
        factor = number("with_noise", density_factor, field="density_factor", above=0.0)
        covariance = self.inertial.covariance * factor**2
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
            self.initial.width,
        )

    @property
    def _joined(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Pairs of keyframes that an inertial or a motion factor joins."""
        pairs = [pair for factor in self.factors for pair in combinations(factor.keyframes, 2)]
        more = np.array(pairs, dtype=np.int64).reshape(-1, 2)
        first, second = self.inertial.first, self.inertial.second
        return np.concatenate([first, more[:, 0]]), np.concatenate([second, more[:, 1]])

    @cached_property
    def increments(self) -> tuple[Any, ...]:
        """The inertial factors as :mod:`vigauge.kernels.inertial` reads them, or its twin with biases."""
        f = self.inertial
        return f.first, f.second, f.dt, f.dp, f.dR, f.dv, f.whitener, float(self.gravity), *f.of_biases

    @property
    def obs_weight(self) -> Array:
        """(M,) 1 / sigma of each observation, 1 / px."""
        if self.obs_noise is None:
            return np.full(len(self.obs_uv), 1.0 / self.sigma_px)
        return 1.0 / (self.sigma_px * self.obs_noise)

    @cached_property
    def pixels(self) -> Array:
        """(V, 3 LANES) u, v and 1 / sigma of the observations of every view, zero where there is none."""
        out = np.zeros((self.structure.n_views, 3 * LANES))
        spread_pixels(self.obs_uv, self.obs_weight, self.structure.obs_slot, out)
        return out

    @cached_property
    def compiled_loss(self) -> CompiledLoss:
        """The loss as the kernels read it."""
        return CompiledLoss() if self.loss is None else self.loss.compiled

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
            "p_CB": -(p_BC[:, None, :] @ R_BC)[:, 0],
        }
