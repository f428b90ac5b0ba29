"""Reading one camera image, refusing what a decoder lets pass."""

from __future__ import annotations

from pathlib import Path
from typing import NoReturn

import cv2
import numpy as np
from numpy.typing import NDArray

from ...errors import DataError
from ...geometry.camera import Camera
from .image_header import declared_size, is_cut_short

_WHOLE = "must be a whole PNG or JPEG file that OpenCV can decode"


def read_image(path: Path, camera: Camera) -> NDArray[np.uint8]:
    """(height, width) 8-bit grey image as the camera took it, distortion and all.

    Raises
    ------
    DataError
        for a file that is missing, empty, cut short or neither PNG nor JPEG, and for an image
        that is not 8-bit grey or not of the camera's size. The size is checked before decoding.
    """
    if not path.is_file():
        raise DataError(path, "image file must exist")
    try:
        data = path.read_bytes()
    except OSError as error:
        raise DataError(path, f"image file must be readable: {error}") from error
    declared = declared_size(data)
    if declared is None or is_cut_short(data):
        raise DataError(path, _WHOLE, value=f"{len(data)} bytes")
    if declared != (camera.width, camera.height):
        _refuse_size(path, camera, *declared)
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error as error:
        raise DataError(path, _WHOLE, value=f"{len(data)} bytes") from error
    if image is None:
        raise DataError(path, _WHOLE, value=f"{len(data)} bytes")
    if image.ndim != 2 or image.dtype != np.uint8:
        found = f"{image.dtype}, {1 if image.ndim == 2 else image.shape[2]} channels"
        raise DataError(path, "must be an 8-bit grey image", value=found)
    if image.shape != (camera.height, camera.width):
        _refuse_size(path, camera, image.shape[1], image.shape[0])
    return image


def _refuse_size(path: Path, camera: Camera, width: int, height: int) -> NoReturn:
    rule = f"must be {camera.width} x {camera.height} pixels"
    raise DataError(path, rule, value=f"{width} x {height}")
