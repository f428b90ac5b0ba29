"""Every reader of outside files, its valid files, and how they are spoilt."""

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np

from support.asl import CAMERA_YAML, FRAME_NS, IMU_HEADER, IMU_NS, IMU_YAML, grey_image
from support.random_problem import random_problem
from vigauge.geometry.camera import Camera
from vigauge.model.archive import load_arrays, load_problems, load_states, save_problems, save_states
from vigauge.recordings.asl.calibration import read_camera, read_imu_noise
from vigauge.recordings.asl.ground_truth import read_ground_truth
from vigauge.recordings.asl.images import read_image
from vigauge.recordings.asl.sequence import read_frames, read_imu
from vigauge_paper.fetch.archive import extract_sequence

from . import mutations
from .foreign import foreign_readers
from .reader import Reader, binary_spoil, text_spoil, through

CAMERA = Camera(30.0, 30.0, 19.5, 14.5, 40, 30, (0.0, 0.0, 0.0, 0.0), np.eye(3), np.zeros(3))


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
        csv_spoil = [
            text_spoil(seeds, mutations.TEXT_TOKENS, separator=b",") for seeds in ([imu], truth, [frames])
        ]
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
                text_spoil(sensors, mutations.YAML_TOKENS + mutations.TEXT_TOKENS),
            ),
            Reader(
                "image",
                images,
                through(folder / "image.png", lambda path: read_image(path, CAMERA)),
                binary_spoil(images, mutations.spoil_png, lambda data: data.startswith(b"\x89PNG")),
            ),
            Reader(
                "npz",
                archives,
                through(folder / "x.npz", _archive),
                binary_spoil(archives, mutations.spoil_npz),
            ),
            Reader(
                "zip of a sequence",
                zips,
                through(folder / "sequence.zip", lambda path: _extracted(path, folder / "out")),
                binary_spoil(zips, mutations.spoil_zip),
            ),
        ]
        yield {reader.name: reader for reader in readers + foreign_readers(folder)}


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
