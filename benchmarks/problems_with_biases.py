"""The problems of :mod:`benchmarks.problems` with biases to estimate, and their samples beside them."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vigauge.geometry.so3 import Array
from vigauge.model.archive import load_arrays, load_problems, save_arrays, save_problems
from vigauge.model.imu import ImuNoise, ImuSamples, preintegrate
from vigauge.model.problem import InertialFactors, Problem
from vigauge.synthetic.measurements import corrupt_imu, ideal_imu, random_walk

from . import exchange, problems
from .problems import Size

# The walks of the sensor that EuRoC flew, an ADIS16448, as its sequences give them.
GYRO_WALK = 1.9393e-5
ACCEL_WALK = 3.0e-3

# Samples, keyframe times, noise, and the gyroscope's and the accelerometer's bias at which factors are made.
Samples = tuple[ImuSamples, NDArray[np.int64], ImuNoise, Array, Array]


def make_samples(size: Size) -> Samples:
    """Inertial samples of the flight of a size, with biases that begin at the configuration's and walk."""
    settings = problems.settings_of(size)
    motion, t_ns, keyframe_ns = problems.motion_of(settings)
    noise = ImuNoise(settings.gyro_density, settings.accel_density, GYRO_WALK, ACCEL_WALK)
    rng = np.random.default_rng([size.seed, size.n_keyframes])
    gyro, accel = np.array(settings.gyro_bias_radps), np.array(settings.accel_bias_mps2)
    walks = random_walk(gyro, GYRO_WALK, t_ns, rng), random_walk(accel, ACCEL_WALK, t_ns, rng)
    return (
        corrupt_imu(ideal_imu(motion, t_ns, settings.gravity_mps2), noise, *walks, rng),
        keyframe_ns,
        noise,
        gyro,
        accel,
    )


def make_problem(size: Size, samples: Samples) -> Problem:
    """The images and the start of the problem with known biases, and factors of the samples.

    Where GTSAM is installed the factors are of its own preintegration, so that it has the same problem.
    """
    imu, keyframe_ns, noise, *biases = samples
    known = problems.make_problem(size)
    if find_spec("gtsam"):
        from . import peer_gtsam_biases as peer

        inertial = peer.factors_of(peer.preintegrated(*samples, known.gravity))
    else:
        ends = zip(keyframe_ns[:-1], keyframe_ns[1:], strict=True)
        integrated = [
            preintegrate(imu, int(a), int(b), noise, biases=(biases[0], biases[1])) for a, b in ends
        ]
        inertial = InertialFactors.chain(integrated, *biases)
    return replace(known, initial=known.initial.with_biases(*biases), inertial=inertial, biases="estimated")


def _beside(problem_file: Path) -> Path:
    return problem_file.with_suffix(".imu.npz")


def read_samples(problem_file: Path) -> Samples:
    """The samples of a problem's file, from the file beside it."""
    a = load_arrays(_beside(problem_file))
    samples = ImuSamples(a["t_ns"], a["gyro"], a["accel"])
    return samples, a["keyframe_ns"], ImuNoise(*map(float, a["noise"])), a["gyro_bias"], a["accel_bias"]


def cached_problem(size: Size, folder: Path) -> tuple[Path, Path]:
    """As :func:`benchmarks.problems.cached_problem`, with the samples beside."""
    sources = Path(__file__), Path(problems.__file__), Path(exchange.__file__), problems.CONFIG
    recipe = hashlib.sha256(
        b"".join(path.read_bytes() for path in sources) + repr(bool(find_spec("gtsam"))).encode()
    )
    stem = f"{size.name}_s{size.seed}_biases_{recipe.hexdigest()[:8]}"
    npz, binary = folder / f"{stem}.npz", folder / f"{stem}.bin"
    if not npz.is_file():
        samples = make_samples(size)
        imu, keyframe_ns, noise, gyro, accel = samples
        densities = [noise.gyro_density, noise.accel_density, noise.gyro_walk, noise.accel_walk]
        arrays = {"t_ns": imu.t_ns, "gyro": imu.gyro, "accel": imu.accel, "keyframe_ns": keyframe_ns}
        save_arrays(
            _beside(npz), arrays | {"noise": np.array(densities), "gyro_bias": gyro, "accel_bias": accel}
        )
        save_problems(npz, [make_problem(size, samples)])
    if not binary.is_file():
        exchange.write_problem(binary, load_problems(npz)[0])
    return npz, binary
