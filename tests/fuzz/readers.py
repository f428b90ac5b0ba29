"""Every reader of outside files, its valid files, and how they are spoilt.

The property: a reader takes the file or raises VigaugeError; nothing else, and soon.
"""

import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from random import Random

import cv2
import numpy as np

from support.asl import CAMERA_YAML, FRAME_NS, IMU_HEADER, IMU_NS, IMU_YAML, grey_image
from support.random_problem import random_problem
from vigauge.errors import VigaugeError
from vigauge.geometry.camera import Camera
from vigauge.model.archive import load_arrays, load_problems, load_states, save_problems, save_states
from vigauge.recordings.asl.calibration import read_camera, read_imu_noise
from vigauge.recordings.asl.ground_truth import read_ground_truth
from vigauge.recordings.asl.images import read_image
from vigauge.recordings.asl.sequence import read_frames, read_imu
from vigauge_paper.fetch.archive import extract_sequence

from . import mutations

CAMERA = Camera(30.0, 30.0, 19.5, 14.5, 40, 30, (0.0, 0.0, 0.0, 0.0), np.eye(3), np.zeros(3))
Spoil = Callable[[Random, bytes], bytes]


@dataclass(frozen=True)
class Reader:
    """One reader: ``read`` takes the bytes of a file; ``spoil`` makes one of the ``seeds`` bad."""

    name: str
    seeds: list[bytes]
    read: Callable[[bytes], None]
    spoil: Spoil

    def input(self, seed: int) -> bytes:
        """Input number ``seed``: mostly a spoilt file, sometimes a valid one or random bytes."""
        rng = Random(f"{self.name} {seed}")
        if rng.random() < 0.03:
            return rng.randbytes(rng.choice((0, 1, 10, 1000)))
        data = rng.choice(self.seeds)
        return data if rng.random() < 0.02 else self.spoil(rng, data)


def outcome(reader: Reader, data: bytes) -> str:
    """'accepted' or the name of the error; whatever else is raised is a crash and goes on."""
    try:
        reader.read(data)
    except VigaugeError as error:
        str(error)  # a message must be possible, and short
        assert len(str(error)) < 5000, f"message of {len(str(error))} characters"
        return type(error).__name__
    return "accepted"


def _text(seeds: list[bytes], tokens: list[bytes], table: bool) -> Spoil:
    def spoil(rng: Random, data: bytes) -> bytes:
        if table and rng.random() < 0.5:
            return mutations.spoil_fields(rng, data, tokens)
        return mutations.spoil_bytes(rng, data, tokens, seeds)

    return spoil


def _binary(seeds: list[bytes], inside: Spoil, is_kind: Callable[[bytes], bool]) -> Spoil:
    def spoil(rng: Random, data: bytes) -> bytes:
        if is_kind(data) and rng.random() < 0.6:
            return inside(rng, data)
        return mutations.spoil_bytes(rng, data, [], seeds)

    return spoil


def _image_folder(mav: Path) -> bytes:
    """Two cameras with tiny images, one of them a link out of the folder; the left list."""
    rows = "".join(f"{t},{t}.png\n" for t in FRAME_NS)
    for name in ("cam0", "cam1"):
        (mav / name / "data").mkdir(parents=True)
        (mav / name / "data.csv").write_text("#timestamp [ns],filename\n" + rows)
        for t in FRAME_NS:
            (mav / name / "data" / f"{t}.png").write_bytes(b"x")
        (mav / name / "data" / "link.png").symlink_to(mav / name / "data.csv")
    return (mav / "cam0" / "data.csv").read_bytes()


@contextmanager
def all_readers() -> Iterator[dict[str, Reader]]:
    """The readers by name; their files live in a temporary folder."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)

        def through(path: Path, read_path: Callable[[Path], object]) -> Callable[[bytes], None]:
            path.parent.mkdir(parents=True, exist_ok=True)

            def read(data: bytes) -> None:
                path.write_bytes(data)
                read_path(path)

            return read

        rows = "".join(f"{t},0.1,-0.2,0.3,9.7,0.4,{k / 100}\n" for k, t in enumerate(IMU_NS))
        imu = (IMU_HEADER + rows).encode()
        row = "1,2,3,0.5,0.5,-0.5,0.5,0.1,0.2,0.3,0.01,0.02,0.03,-0.1,-0.2,-0.3"
        names = "#timestamp,px,py,pz,q_RS_w,qx,qy,qz"
        truth = [
            (names + "\n" + "".join(f"{t},{values}\n" for t in IMU_NS[:10])).encode()
            for values in (row, ",".join(row.split(",")[:7]))
        ]
        frames = _image_folder(folder / "frames" / "mav0")
        sensors = [CAMERA_YAML.format(x=0.1).encode(), IMU_YAML.encode(), b"%YAML:1.0\n" + IMU_YAML.encode()]
        images = [
            cv2.imencode(ending, grey_image(k) if k < 2 else np.zeros((30, 40, 3), np.uint8))[1].tobytes()
            for k, ending in enumerate((".png", ".jpg", ".png"))
        ]
        save_problems(folder / "p.npz", [random_problem(2, n_keyframes=2, n_landmarks=1)])
        save_states(folder / "s.npz", [random_problem(1).initial])
        archives = [(folder / "p.npz").read_bytes(), (folder / "s.npz").read_bytes()]
        zips = [mutations.zip_of([("mav0/a", b"x" * 50), ("mav0/cam0/data.csv", b"1,2\n" * 9), ("x", b"y")])]
        csv_spoil = [_text(seeds, mutations.TEXT_TOKENS, table=True) for seeds in ([imu], truth, [frames])]
        readers = [
            Reader("imu data.csv", [imu], through(folder / "imu" / "data.csv", read_imu), csv_spoil[0]),
            Reader(
                "ground truth data.csv",
                truth,
                through(folder / "truth" / "data.csv", lambda path: read_ground_truth(path.parent)),
                csv_spoil[1],
            ),
            Reader(
                "camera data.csv",
                [frames],
                through(
                    folder / "frames" / "mav0" / "cam0" / "data.csv",
                    lambda path: _inside(read_frames(path.parents[1]).left, path.parent / "data"),
                ),
                csv_spoil[2],
            ),
            Reader(
                "sensor.yaml",
                sensors,
                through(folder / "sensor.yaml", _sensor),
                _text(sensors, mutations.YAML_TOKENS + mutations.TEXT_TOKENS, table=False),
            ),
            Reader(
                "image",
                images,
                through(folder / "image.png", lambda path: read_image(path, CAMERA)),
                _binary(images, mutations.spoil_png, lambda data: data.startswith(b"\x89PNG")),
            ),
            Reader(
                "npz",
                archives,
                through(folder / "x.npz", _archive),
                _binary(archives, mutations.spoil_npz, lambda data: True),
            ),
            Reader(
                "zip of a sequence",
                zips,
                through(folder / "sequence.zip", lambda path: _extracted(path, folder / "out")),
                _binary(zips, mutations.spoil_zip, lambda data: True),
            ),
        ]
        yield {reader.name: reader for reader in readers}


def _sensor(path: Path) -> None:
    """As a camera's where it looks like one, else as an inertial sensor's."""
    (read_camera if b"camera" in path.read_bytes() else read_imu_noise)(path)


def _archive(path: Path) -> None:
    """As problems, states or arrays, whichever it looks like."""
    data = path.read_bytes()
    if len(data) % 5 == 0:
        load_arrays(path)
    else:
        (load_problems if b"inertial.dt" in data else load_states)(path)


def _extracted(path: Path, out: Path) -> None:
    """Unpack into a folder that is removed; nothing may appear beside it."""
    before = set(out.parent.iterdir())
    try:
        extract_sequence(path, "XX", out, str(path), 10**6)
        assert not any(made.is_symlink() for made in out.rglob("*"))
    finally:
        shutil.rmtree(out, ignore_errors=True)
        assert set(out.parent.iterdir()) == before


def _inside(paths: tuple[Path, ...], folder: Path) -> None:
    """What was accepted must lie in the folder: checked here by other means than the reader's."""
    real = str(folder.resolve())
    for path in paths:
        assert str(path.resolve()).startswith(real + "/"), path
