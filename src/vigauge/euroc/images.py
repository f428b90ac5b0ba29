"""Reading one camera image, refusing what a decoder lets pass."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..errors import DataError

_JPEG_START, _JPEG_END = b"\xff\xd8", b"\xff\xd9"


def read_image(path: Path, camera: Camera) -> NDArray[np.uint8]:
    """(height, width) 8-bit grey image as the camera took it, distortion and all.

    Raises
    ------
    DataError
        for a file that is missing, empty, cut short or not an image, and for an image that
        is not 8-bit grey or not of the camera's size.
    """
    if not path.is_file():
        raise DataError(path, "image file must exist")
    try:
        data = path.read_bytes()
    except OSError as error:
        raise DataError(path, f"image file must be readable: {error}") from error
    # A JPEG decoder fills what is missing at the end with grey and says nothing.
    cut_short = data.startswith(_JPEG_START) and not data.rstrip(b"\x00").endswith(_JPEG_END)
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED) if data else None
    if image is None or cut_short:
        raise DataError(path, "must be a whole image file that OpenCV can decode", value=f"{len(data)} bytes")
    if image.ndim != 2 or image.dtype != np.uint8:
        found = f"{image.dtype}, {1 if image.ndim == 2 else image.shape[2]} channels"
        raise DataError(path, "must be an 8-bit grey image", value=found)
    if image.shape != (camera.height, camera.width):
        found = f"{image.shape[1]} x {image.shape[0]}"
        raise DataError(path, f"must be {camera.width} x {camera.height} pixels", value=found)
    return image
