"""Reading one camera image, refusing what a decoder lets pass."""

from __future__ import annotations

import os
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NoReturn

import cv2
import numpy as np
from numpy.typing import NDArray

from ...errors import DataError
from ...geometry.camera import Camera
from .image_header import declared_size, is_cut_short

# File descriptor of what C code calls stderr; it belongs to the process, so one thread at a time moves it.
_TERMINAL = 2
_ONE_DECODER = threading.Lock()
_WHOLE = "must be a whole PNG or JPEG file that OpenCV can decode"


def read_image(path: Path, camera: Camera) -> NDArray[np.uint8]:
    """(height, width) 8-bit grey image as the camera took it, distortion and all; of 16 bits the upper 8.

    A 16-bit image without any value in its upper 8 bits is refused: it holds values of 8 bits.

    Raises DataError for a file that is missing, empty, cut short or neither PNG nor JPEG, and for an image
    that is not grey of 8 or 16 bits or not of the camera's size. The size is checked before decoding.
    """
    if not path.is_file():
        raise DataError(path, "image file must exist")
    try:
        data = path.read_bytes()
    except OSError as error:
        raise DataError(path, f"image file must be readable: {error}") from error
    declared = _declared(data, str(path), None)
    if declared != (camera.width, camera.height):
        _refuse_size(path, camera, *declared)
    image = _decoded(data, str(path), None)
    if image.dtype == np.uint16 and image.ndim == 2:  # as TUM-VI has them
        largest = int(image.max())
        if largest < 256:
            raise DataError(path, "must use the upper 8 of its 16 bits; save it with 8 bits", value=largest)
        image = (image >> 8).astype(np.uint8)
    if image.ndim != 2 or image.dtype != np.uint8:
        found = f"{image.dtype}, {1 if image.ndim == 2 else image.shape[2]} channels"
        raise DataError(path, "must be a grey image of 8 or 16 bits", value=found)
    if image.shape != (camera.height, camera.width):
        _refuse_size(path, camera, image.shape[1], image.shape[0])
    return image


def decode_image(data: bytes, file: str, field: str) -> NDArray[np.uint8]:
    """(height, width) or (height, width, 3) 8-bit image of a message, BGR where it is colour.

    DataError, on ``field`` of ``file``, for damage and for other depths and channels.
    """
    _declared(data, file, field)
    image = _decoded(data, file, field)
    if image.dtype != np.uint8 or image.shape[2:] not in ((), (3,)):
        found = f"{image.dtype}, {1 if image.ndim == 2 else image.shape[2]} channels"
        raise DataError(file, "must be 8-bit images, grey or colour", field=field, value=found)
    return image


def _declared(data: bytes, file: str, field: str | None) -> tuple[int, int]:
    """(width, height) by the header of a file that does not end too soon."""
    declared = declared_size(data)
    if declared is None or is_cut_short(data):
        raise DataError(file, _WHOLE, field=field, value=f"{len(data)} bytes")
    return declared


def _decoded(data: bytes, file: str, field: str | None) -> NDArray[Any]:
    """The pixels as they are stored; what the decoder complains of is an error."""
    with _complaints() as complaints:
        try:
            image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
        except cv2.error:
            image = None
    if image is None or complaints:
        value = "; ".join(complaints) or f"{len(data)} bytes"
        raise DataError(file, _WHOLE, field=field, value=value)
    return image


@contextmanager
def _complaints() -> Iterator[list[str]]:
    """Lines that C code writes to the terminal meanwhile: OpenCV has no other sign of damage in a JPEG."""
    lines: list[str] = []
    with _ONE_DECODER, tempfile.TemporaryFile() as words:
        terminal = os.dup(_TERMINAL)
        try:
            os.dup2(words.fileno(), _TERMINAL)
            yield lines
        finally:
            os.dup2(terminal, _TERMINAL)
            os.close(terminal)
        words.seek(0)
        lines += words.read().decode(errors="replace").split("\n")[:-1]


def _refuse_size(path: Path, camera: Camera, width: int, height: int) -> NoReturn:
    rule = f"must be {camera.width} x {camera.height} pixels"
    raise DataError(path, rule, value=f"{width} x {height}")
