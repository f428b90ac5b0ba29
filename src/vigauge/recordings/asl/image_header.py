"""What an image file says of itself before anything is decoded.

A decoder reserves memory for the sizes that headers name, however small the file is.
"""

from __future__ import annotations

_PNG_START = b"\x89PNG\r\n\x1a\n"
_JPEG_START, _JPEG_END = b"\xff\xd8", b"\xff\xd9"
# Start of frame: C0 to CF but for tables (C4), reserved (C8) and arithmetic conditioning (CC).
_FRAME = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
# Markers that stand alone, without a length behind them.
_ALONE = frozenset([0x01, *range(0xD0, 0xD9)])


def declared_size(data: bytes) -> tuple[int, int] | None:
    """(width, height) in pixels that a PNG or JPEG file names; None for anything else."""
    if data.startswith(_PNG_START):
        return _png_size(data)
    if data.startswith(_JPEG_START):
        return _jpeg_size(data)
    return None


def is_cut_short(data: bytes) -> bool:
    """Whether the end of a PNG or JPEG file is missing, or a chunk of a PNG is longer than the file.

    A JPEG decoder fills what is missing with grey and says nothing.
    """
    if data.startswith(_PNG_START):
        return not _png_ends(data)
    return not data.rstrip(b"\x00").endswith(_JPEG_END)


def _png_ends(data: bytes) -> bool:
    """Whether chunk after chunk leads to the end chunk."""
    at = len(_PNG_START)
    while at + 12 <= len(data):
        length, name = int.from_bytes(data[at : at + 4], "big"), data[at + 4 : at + 8]
        at += 12 + length
        if name == b"IEND":
            return at <= len(data)
    return False


def _png_size(data: bytes) -> tuple[int, int] | None:
    if len(data) < 24 or data[12:16] != b"IHDR":
        return None
    return int.from_bytes(data[16:20], "big"), int.from_bytes(data[20:24], "big")


def _jpeg_size(data: bytes) -> tuple[int, int] | None:
    """From the first frame header; segments before it are skipped by their lengths."""
    at = 2
    while at + 9 <= len(data) and data[at] == 0xFF:
        marker = data[at + 1]
        if marker in _FRAME:
            return int.from_bytes(data[at + 7 : at + 9], "big"), int.from_bytes(data[at + 5 : at + 7], "big")
        if marker == 0xFF:
            at += 1  # fill byte
        elif marker in _ALONE:
            at += 2
        else:
            at += 2 + int.from_bytes(data[at + 2 : at + 4], "big")
    return None
