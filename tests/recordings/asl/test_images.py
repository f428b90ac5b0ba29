"""Images: the pixels as they are, and an error naming the file for everything else."""

import os
from pathlib import Path

import cv2
import numpy as np
import pytest

from support.asl import grey_image
from vigauge.errors import DataError
from vigauge.geometry.camera import Camera
from vigauge.recordings.asl.images import read_image

CAMERA = Camera(30.0, 30.0, 19.5, 14.5, 40, 30, (0.0, 0.0, 0.0, 0.0), np.eye(3), np.zeros(3))


def refused(path: Path) -> DataError:
    with pytest.raises(DataError) as caught:
        read_image(path, CAMERA)
    assert caught.value.file == str(path)
    return caught.value


def encoded(ending: str, image: np.ndarray) -> bytes:
    return cv2.imencode(ending, image)[1].tobytes()


def test_png_pixels_are_untouched(tmp_path):
    """Catches conversion, scaling, or rows and columns exchanged."""
    path = tmp_path / "a.png"
    path.write_bytes(encoded(".png", grey_image()))
    image = read_image(path, CAMERA)
    assert image.dtype == np.uint8
    assert np.array_equal(image, grey_image())


def test_whole_jpeg_is_read(tmp_path):
    path = tmp_path / "a.jpg"
    path.write_bytes(encoded(".jpg", grey_image()))
    assert read_image(path, CAMERA).shape == (30, 40)


def test_missing_image_is_named(tmp_path):
    """Catches None from the decoder that fails later as an attribute error."""
    assert "must exist" in refused(tmp_path / "missing.png").rule


@pytest.mark.parametrize("ending", [".png", ".jpg"])
@pytest.mark.parametrize("share", [0.0, 0.02, 0.5, 0.95])
def test_image_cut_short_is_refused(tmp_path, ending, share):
    """Catches the grey that a JPEG decoder puts where data are missing."""
    path = tmp_path / f"a{ending}"
    data = encoded(ending, grey_image())
    path.write_bytes(data[: int(share * len(data))])
    assert "whole PNG or JPEG" in refused(path).rule


def test_file_that_is_no_image_is_refused(tmp_path):
    path = tmp_path / "a.png"
    path.write_text("<html>404 Not Found</html>")
    assert "whole PNG or JPEG" in refused(path).rule


@pytest.mark.parametrize(
    ("image", "found"),
    [
        (np.zeros((30, 40, 3), np.uint8), "uint8, 3 channels"),
        (np.zeros((30, 40, 3), np.uint16), "uint16, 3 channels"),
        (np.zeros((30, 39), np.uint8), "39 x 30"),
        (np.zeros((40, 30), np.uint8), "30 x 40"),
    ],
)
def test_image_of_another_kind_is_refused(tmp_path, image, found):
    """Catches colour images turned grey in silence, and a transposed or cropped image."""
    path = tmp_path / "a.png"
    path.write_bytes(encoded(".png", image))
    assert refused(path).value == found


def test_upper_byte_of_sixteen_bits_is_read(tmp_path):
    """Catches images of TUM-VI refused, and the lower byte, which is noise."""
    deep = np.random.default_rng(0).integers(0, 2**16, (30, 40), dtype=np.uint16)
    (tmp_path / "a.png").write_bytes(encoded(".png", deep))
    assert np.array_equal(read_image(tmp_path / "a.png", CAMERA), deep // 256)


@pytest.mark.parametrize("kept", [0.3, 0.5, 0.8])
def test_damaged_jpeg_with_a_proper_end_is_refused(tmp_path, kept, capfd):
    """Catches grey in place of lost rows; the decoder says so on the terminal only."""
    data = encoded(".jpg", grey_image())
    path = tmp_path / "a.jpg"
    path.write_bytes(data[: int(kept * len(data))] + b"\xff\xd9")
    assert "Corrupt JPEG" in str(refused(path).value)
    assert "JPEG" not in capfd.readouterr().err


def test_terminal_is_as_before_after_an_image(tmp_path, capfd):
    """Catches a stderr that stays redirected."""
    path = tmp_path / "a.jpg"
    path.write_bytes(encoded(".jpg", grey_image()))
    read_image(path, CAMERA)
    os.write(2, b"heard")
    assert capfd.readouterr().err == "heard"
