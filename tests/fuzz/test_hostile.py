"""Files made to do harm, each kind once: what fuzzing found, and what it would need luck to find."""

import struct
import time
import zipfile
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest

from support.asl import CAMERA_YAML, FRAME_NS, grey_image
from support.random_problem import random_problem
from vigauge.errors import DataError
from vigauge.geometry.camera import Camera
from vigauge.model.archive import (
    load_arrays,
    load_problems,
    load_states,
    save_arrays,
    save_problems,
    save_states,
)
from vigauge.recordings.asl.calibration import read_camera
from vigauge.recordings.asl.image_header import declared_size, is_cut_short
from vigauge.recordings.asl.images import read_image
from vigauge.recordings.asl.plain_yaml import read_plain_yaml
from vigauge.recordings.asl.sequence import read_frames
from vigauge.recordings.asl.tables import read_table

from .mutations import NPY_HEADERS, _npy

CAMERA = Camera(30.0, 30.0, 19.5, 14.5, 40, 30, (0.0, 0.0, 0.0, 0.0), np.eye(3), np.zeros(3))


def png_with(at: int, value: int) -> bytes:
    """A small PNG whose four bytes from ``at`` on are another number, its header's checksum right."""
    data = bytearray(cv2.imencode(".png", grey_image())[1].tobytes())
    data[at : at + 4] = struct.pack(">I", value)
    data[29:33] = struct.pack(">I", zlib.crc32(data[12:29]))
    return bytes(data)


@pytest.mark.parametrize(
    ("at", "value", "rule"),
    [
        (16, 100_000, "must be 40 x 30 pixels"),
        (20, 2**31 - 1, "must be 40 x 30 pixels"),
        (33, 0x60090000, "must be a whole PNG or JPEG"),  # length of the chunk after the header
        (33, 0xFFFFFFFF, "must be a whole PNG or JPEG"),
    ],
)
def test_lying_png_is_refused_without_reserving_memory(tmp_path, monkeypatch, at, value, rule):
    """Catches a decoder asked about it: OpenCV reserves what a header or a chunk length says."""
    monkeypatch.setattr(cv2, "imdecode", lambda *_: pytest.fail("the decoder was asked"))
    (tmp_path / "x.png").write_bytes(png_with(at, value))
    with pytest.raises(DataError, match=rule):
        read_image(tmp_path / "x.png", CAMERA)


@pytest.mark.parametrize("ending", [".png", ".jpg"])
def test_declared_size_is_that_of_the_image(ending):
    """Catches width and height exchanged, and a JPEG segment taken for the frame header."""
    data = cv2.imencode(ending, grey_image())[1].tobytes()
    assert declared_size(data) == (40, 30)
    assert not is_cut_short(data)
    assert is_cut_short(data[:-5])
    exif = b"\xff\xe1" + struct.pack(">H", 12) + b"\xff\xc0\x00\x11\x08\xff\xff\xff\xff\x01"
    if ending == ".jpg":
        assert declared_size(data[:2] + exif + b"\xff\xff" + data[2:]) == (40, 30)
    for length in range(40):
        assert declared_size(data[:length]) in (None, (40, 30))


def test_formats_other_than_png_and_jpeg_are_refused(tmp_path):
    """Catches decoders of rarer formats, whose headers nobody checked."""
    (tmp_path / "x.bmp").write_bytes(cv2.imencode(".bmp", grey_image())[1].tobytes())
    with pytest.raises(DataError, match="PNG or JPEG"):
        read_image(tmp_path / "x.bmp", CAMERA)


@pytest.mark.parametrize("header", NPY_HEADERS)
@pytest.mark.parametrize("version", [(1, 0), (2, 0), (3, 0)])
def test_lying_npz_is_refused_without_reserving_memory(tmp_path, monkeypatch, header, version):
    """Catches an array reserved, or a pickle loaded, for what a header says."""
    monkeypatch.setattr(np, "load", lambda *_, **__: pytest.fail("the array was loaded"))
    with zipfile.ZipFile(tmp_path / "x.npz", "w") as archive:
        archive.writestr("x.npy", _npy(header, bytes(24), version))
    with pytest.raises(DataError, match="npz archive"):
        load_arrays(tmp_path / "x.npz")


def test_npz_bomb_is_refused(tmp_path, monkeypatch):
    """Catches a megabyte that unpacks to a gigabyte."""
    monkeypatch.setattr(np, "load", lambda *_, **__: pytest.fail("the array was loaded"))
    np.savez_compressed(tmp_path / "x.npz", x=np.zeros(4_000_000))
    with pytest.raises(DataError, match="would take 32000128 bytes"):
        load_arrays(tmp_path / "x.npz")


def test_npz_member_that_is_no_array_is_refused(tmp_path):
    """Catches bytes where every caller expects an array."""
    with zipfile.ZipFile(tmp_path / "x.npz", "w") as archive:
        archive.writestr("kind", b"states")
    with pytest.raises(DataError, match="npz archive"):
        load_states(tmp_path / "x.npz")


@pytest.mark.parametrize("order", "<>")
def test_npz_of_letters_beyond_unicode_is_refused(tmp_path, order):
    """Catches a text that raises SystemError wherever it is printed, also by the message about it."""
    np.savez(tmp_path / "x.npz", kind=np.array([2**30], f"{order}u4").view(f"{order}U1"))
    with pytest.raises(DataError, match=r"kind.npy must hold text in Unicode"):
        load_arrays(tmp_path / "x.npz")
    np.savez(tmp_path / "x.npz", kind=np.array("\U0010ffff", f"{order}U1"))
    assert load_arrays(tmp_path / "x.npz")["kind"] == "\U0010ffff"


@pytest.mark.parametrize("count", [10**12, -1, 2**62])
def test_npz_that_counts_more_entries_than_it_has_is_refused(tmp_path, count):
    """Catches a list of 10^12 empty entries."""
    save_problems(tmp_path / "p.npz", [random_problem(1)])
    arrays = load_arrays(tmp_path / "p.npz") | {"count": np.array(count)}
    save_arrays(tmp_path / "p.npz", arrays)
    with pytest.raises(DataError, match="number of entries"):
        load_problems(tmp_path / "p.npz")


@pytest.mark.parametrize(
    "reference", [np.zeros((0, 3)), np.eye(4), np.full((3, 3), 1e200), np.full((3, 3), np.nan)]
)
def test_reference_rotation_of_any_shape_or_size_is_refused(tmp_path, reference):
    """Catches a reshape error, and an overflow whose NaN passes for orthonormal."""
    save_states(tmp_path / "s.npz", [random_problem(1).initial])
    arrays = load_arrays(tmp_path / "s.npz") | {"0/R_WB0_ref": reference}
    save_arrays(tmp_path / "s.npz", arrays)
    with pytest.raises(DataError, match="R_WB0_ref"):
        load_states(tmp_path / "s.npz")


ALIASES = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{chr(98 + k)}: &{chr(98 + k)} [{', '.join(['*' + chr(97 + k)] * 9)}]\n" for k in range(9)
)
MERGES = "a: &a {k: v}\n" + "".join(
    f"{chr(98 + k)}: &{chr(98 + k)} {{<<: [{', '.join(['*' + chr(97 + k)] * 9)}]}}\n" for k in range(9)
)


@pytest.mark.parametrize(
    "text",
    [
        pytest.param(ALIASES, id="aliases that multiply"),
        pytest.param(MERGES, id="merges that multiply"),
        pytest.param("a: &a [*a]", id="a list that contains itself"),
        pytest.param("[" * 50_000, id="nesting without end"),
        pytest.param("{a: " * 5000, id="mappings without end"),
        pytest.param("x: !!python/object/apply:os.system ['true']", id="a call"),
        pytest.param("x: !!timestamp no", id="tag that fails in PyYAML"),
        pytest.param("x: !!bool maybe", id="another tag that fails"),
        pytest.param("x: " + "1" * 5000, id="an integer of 5000 digits"),
        pytest.param("x: 0x" + "f" * 5000, id="the same in base 16"),
        pytest.param("[1, 2]: 3", id="a key that is a list"),
    ],
)
def test_yaml_beyond_plain_data_is_refused(tmp_path, text):
    """Catches memory, time or code for a short file, and exceptions of PyYAML that are none of YAML."""
    (tmp_path / "sensor.yaml").write_text(text)
    begin = time.process_time()
    with pytest.raises(DataError, match="must be a plain YAML file") as caught:
        read_plain_yaml(tmp_path / "sensor.yaml")
    assert time.process_time() - begin < 2.0
    assert len(str(caught.value)) < 3000


def test_camera_of_gigapixels_is_refused(tmp_path):
    """Catches a sensor.yaml that makes a lying image header pass."""
    path = tmp_path / "sensor.yaml"
    path.write_text(CAMERA_YAML.format(x=0.1).replace("[40, 30]", "[100000, 100000]"))
    with pytest.raises(DataError, match="from 1 to 16384"):
        read_camera(path)


@pytest.mark.parametrize("field", ["9" * 200_000 + "x", "." + "9" * 200_000 + "e", "-" * 200_000])
def test_number_of_many_digits_takes_no_time(tmp_path, field):
    """Catches a pattern that tries every split of the digits: hours for this row."""
    path = tmp_path / "data.csv"
    path.write_text(f"1403636580763555584,{field}\n")
    begin = time.process_time()
    with pytest.raises(DataError, match="finite number") as caught:
        read_table(path, (2,)).numbers()
    assert time.process_time() - begin < 1.0
    assert len(str(caught.value)) < 1000


@pytest.fixture
def frames(tmp_path: Path) -> Path:
    """The image lists of a sequence whose left camera has two images."""
    for name in ("cam0", "cam1"):
        (tmp_path / name / "data").mkdir(parents=True)
        rows = "".join(f"{t},{t}.png\n" for t in FRAME_NS[:2])
        (tmp_path / name / "data.csv").write_text("#timestamp [ns],filename\n" + rows)
        for t in FRAME_NS[:2]:
            (tmp_path / name / "data" / f"{t}.png").write_bytes(b"x")
    return tmp_path


@pytest.mark.parametrize("through", ["file", "folder"])
def test_image_behind_a_link_out_of_the_folder_is_refused(frames, tmp_path_factory, through):
    """Catches a sequence that makes the reader open any file of the machine, by a link in it."""
    outside = tmp_path_factory.mktemp("outside")
    (outside / "secret.png").write_bytes(b"x")
    data = frames / "cam0" / "data"
    if through == "file":
        (data / "link.png").symlink_to(outside / "secret.png")
    else:
        (data / "sub").symlink_to(outside)
    name = "link.png" if through == "file" else "sub/secret.png"
    (frames / "cam0" / "data.csv").write_text(f"{FRAME_NS[0]},{FRAME_NS[0]}.png\n{FRAME_NS[1]},{name}\n")
    with pytest.raises(DataError, match="must not lead out of the data folder through a link") as caught:
        read_frames(frames)
    assert (caught.value.row, caught.value.value) == (2, name)


def test_data_folder_that_is_itself_a_link_is_read(frames, tmp_path_factory):
    """Catches the guard above refusing images that the user keeps on another disk."""
    elsewhere = tmp_path_factory.mktemp("disk") / "data"
    (frames / "cam0" / "data").rename(elsewhere)
    (frames / "cam0" / "data").symlink_to(elsewhere)
    assert len(read_frames(frames).left) == 2


def test_image_name_longer_than_a_name_can_be_is_refused(frames):
    """Catches the error of the operating system passed on as it is."""
    (frames / "cam0" / "data.csv").write_text(f"{FRAME_NS[0]},{'x' * 5000}.png\n")
    with pytest.raises(DataError, match=r"filename: (must name a file|image file must exist)"):
        read_frames(frames)


def test_message_about_a_value_of_any_size_is_short():
    """Catches a message as long as the file that it is about."""
    nested: object = "x" * 10**6
    for _ in range(50):
        nested = [nested, nested]
    for value in (nested, 10**6000, "y" * 10**7, dict.fromkeys(range(1000), nested)):
        assert len(str(DataError("file", "rule " * 1000, field="f" * 10**6, value=value))) < 20_000
    assert str(DataError("f", "must be short", value="ab")) == "f: must be short (found 'ab')"
