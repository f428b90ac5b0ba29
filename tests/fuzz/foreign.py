"""Readers of what other programs write: graphs, matrices, trajectories, calibrations."""

from __future__ import annotations

import io
from argparse import Namespace
from collections.abc import Callable
from contextlib import redirect_stdout
from pathlib import Path
from random import Random

import numpy as np
import scipy.sparse
from scipy.spatial.transform import Rotation

import vigauge as vg
from support import foreign
from support.foreign_files import Adjustment, Plane, Space, words
from vigauge.adapters import ceres
from vigauge.cli import covariance, diagnose
from vigauge.cli.command import parser
from vigauge.cli.estimate_file import add_arguments
from vigauge.errors import DataError, DegenerateError
from vigauge.recordings.asl.kalibr import camera_chain, imu_description

from . import mutations
from .reader import Reader, Spoil, binary_spoil, text_spoil, through

LAYOUT = vg.Layout.by_keyframe(2, ["position", "rotation"], points=1)
AT, _, JACOBIAN = foreign.problem(LAYOUT, vg.YawTranslation(), np.random.default_rng(3))
TIMES = 1_403_636_580_838_555_648 + 50_000_001 * np.arange(2)
CAMERA = """\
  camera_model: pinhole
  intrinsics: [30.0, 31.0, 19.5, 14.5]
  distortion_model: radtan
  distortion_coeffs: [-0.28, 0.07, 2e-4, 1.7e-05]
  resolution: [40, 30]
  timeshift_cam_imu: 0.0025
"""
POSE = """
  - [0.0, -1.0, 0.0, 0.1]
  - [1.0, 0.0, 0.0, 0.0]
  - [0.0, 0.0, 1.0, 0.0]
  - [0.0, 0.0, 0.0, 1.0]
"""
CHAIN = f"cam0:\n{CAMERA}  T_cam_imu:{POSE}cam1:\n{CAMERA}  T_cn_cnm1:{POSE}"
IMU = """\
gyroscope_noise_density: 1.7e-4
gyroscope_random_walk: 2e-5
accelerometer_noise_density: 2e-3
accelerometer_random_walk: 3e-3
update_rate: 200.0
"""


def foreign_readers(folder: Path) -> list[Reader]:
    """The readers of other programs' files; their files live in ``folder``."""
    graphs = [graph.write(folder / "x.g2o").read_bytes() for graph in (Space(noise=0.1), Plane())]
    adjustments = [Adjustment().write(folder / "x.txt").read_bytes()]
    matrices = [_matrix(folder / "H.npz", csr=csr) for csr in (False, True)]
    jacobians = [bytes([k]) + part.tobytes() for k, part in enumerate(_crs())]
    calibrations = [CHAIN.encode(), IMU.encode(), b"imu0:\n  " + IMU.replace("\n", "\n  ").encode()]
    trajectories, deviations = _trajectories(folder)
    return [
        Reader("g2o", graphs, through(folder / "x.g2o", _commands), _table(graphs, b" ")),
        Reader("BAL", adjustments, through(folder / "x.txt", _commands), _table(adjustments, b" ")),
        Reader("H.npz", matrices, through(folder / "H.npz", _commands), _archive(matrices)),
        Reader("Jacobian of Ceres", jacobians, _ceres(folder / "ceres"), binary_spoil(jacobians, _entry)),
        Reader(
            "calibration of Kalibr",
            calibrations,
            through(folder / "kalibr.yaml", _calibration),
            text_spoil(calibrations, mutations.YAML_TOKENS + mutations.TEXT_TOKENS),
        ),
        *(
            Reader(
                f"trajectory{suffix}",
                seeds,
                through(folder / f"trajectory{suffix}", _trajectory),
                _archive(seeds) if suffix == ".npz" else _table(seeds, b"," if suffix == ".csv" else b" "),
            )
            for suffix, seeds in trajectories.items()
        ),
        Reader(
            "sigmas of OpenVINS",
            [deviations],
            through(folder / "std.txt", _beside(folder / "state.txt", trajectories[".txt"][0])),
            _table([deviations], b" "),
        ),
    ]


def _table(seeds: list[bytes], separator: bytes) -> Spoil:
    return text_spoil(seeds, mutations.TEXT_TOKENS, separator=separator)


def _archive(seeds: list[bytes]) -> Spoil:
    return binary_spoil(seeds, mutations.spoil_npz)


def _commands(path: Path) -> None:
    """As `vigauge covariance` or `vigauge diagnose`, by its length; a covariance withheld is a refusal."""
    arguments = parser("")
    add_arguments(arguments)
    # What `vigauge covariance` asks for besides.
    given = Namespace(
        gauge="centroid",
        scale="distance:0:1" if path.suffix == ".txt" else "",
        of="poses",
        out=path.with_name("out.npz"),
    )
    options = arguments.parse_args([str(path), "--at-start"], given)
    work = diagnose.work if path.stat().st_size % 3 == 0 else covariance.work
    try:
        with redirect_stdout(io.StringIO()):
            work(options)
    except SystemExit as status:
        raise DegenerateError("withheld") from status


def _matrix(path: Path, *, csr: bool) -> bytes:
    """H as dense or sparse arrays, with its layout and estimate."""
    H = (JACOBIAN.T @ JACOBIAN).toarray()
    S = scipy.sparse.csr_array(H)
    np.savez(
        path,
        **({"H_data": S.data, "H_indices": S.indices, "H_indptr": S.indptr} if csr else {"H": H}),
        **LAYOUT.blocks,
        points=LAYOUT.points,
        R_WB=AT.R,
        p_W=AT.p,
        X_W=AT.X,
        times_ns=TIMES,
        side="left",
    )
    return path.read_bytes()


def _crs() -> list[np.ndarray]:
    return [JACOBIAN.indptr.astype(np.int32), JACOBIAN.indices.astype(np.int32), JACOBIAN.data]


def _ceres(folder: Path) -> Callable[[bytes], None]:
    """Takes the number of one of the three files, and its bytes."""
    folder.mkdir()
    names = ("rows.bin", "cols.bin", "values.bin")

    def take(data: bytes) -> None:
        for name, part in zip(names, _crs(), strict=True):
            (folder / name).write_bytes(part.tobytes())
        (folder / names[sum(data[:1]) % 3]).write_bytes(data[1:])
        ceres.covariance(folder, LAYOUT, (AT.R, AT.p), points=AT.X).joint([0, 1])

    return take


def _entry(rng: Random, data: bytes) -> bytes:
    """Some numbers of four bytes replaced."""
    numbers = np.frombuffer(data[1:][: (len(data) - 1) // 4 * 4], np.int32).copy()
    for _ in range(rng.choice((1, 1, 2))):
        numbers[rng.randrange(len(numbers))] = rng.choice((0, 1, -1, 14, 15, 2**31 - 1, -(2**31)))
    return data[:1] + numbers.tobytes()


def _calibration(path: Path) -> None:
    (camera_chain if b"cam" in path.read_bytes() else imu_description)(path)


def _trajectories(folder: Path) -> tuple[dict[str, list[bytes]], bytes]:
    """Valid files by ending, ours and those of ROS and OpenVINS; and a file of deviations."""
    rng = np.random.default_rng(6)
    A = rng.standard_normal((2, 6, 6))
    R, p = Rotation.from_rotvec(rng.uniform(-2.0, 2.0, (2, 3))).as_matrix(), rng.uniform(-5.0, 5.0, (2, 3))
    plain = vg.Trajectory(p, R, times_ns=TIMES)
    full = vg.Trajectory(
        p, R, times_ns=TIMES, covariance=A @ A.swapaxes(1, 2), kinds=("position", "rotation"), gauge="first"
    )

    def written(suffix: str, trajectory: vg.Trajectory, format: str = "") -> bytes:
        vg.save_trajectory(folder / f"x{suffix}", trajectory, format=format)
        return (folder / f"x{suffix}").read_bytes()

    stamps = [f"{t // 10**9}.{t % 10**9:09d}" for t in TIMES.tolist()]
    q = Rotation.from_matrix(R).as_quat()
    state = "\n".join(f"{t} {words(q[k], p[k], np.ones(9))}" for k, t in enumerate(stamps)).encode()
    deviations = "\n".join(f"{t} {words(np.ones(15))}" for t in stamps).encode()
    files = {
        ".tum": [written(".tum", plain)],
        ".csv": [written(".csv", plain), written(".csv", full), written(".csv", full, "ros")],
        ".txt": [state, written(".txt", plain), written(".txt", full, "openvins")],
        ".npz": [written(".npz", plain), written(".npz", full)],
    }
    return files, deviations


def _trajectory(path: Path) -> None:
    """With the name of a gauge, which files of some programs need, and without, which others do."""
    try:
        vg.load_trajectory(path, gauge="first")
    except DataError:
        vg.load_trajectory(path)


def _beside(state: Path, content: bytes) -> Callable[[Path], object]:
    state.write_bytes(content)
    return lambda path: vg.load_trajectory(state, gauge="first", deviations=path)
