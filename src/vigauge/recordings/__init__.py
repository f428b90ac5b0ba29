"""Recordings in ASL (EuRoC) layout: readers, checks, import from rosbags, front-end, and :func:`estimate`.

Needs the packages of the extra ``recordings``; the rest of the library runs without them.
"""

from importlib import import_module
from importlib.util import find_spec
from typing import Any

from ..errors import MissingExtraError

_PACKAGES = {"cv2": "OpenCV", "pycolmap": "pycolmap", "yaml": "PyYAML", "tqdm": "tqdm"}

_missing = [name for module, name in _PACKAGES.items() if find_spec(module) is None]
if _missing:
    raise MissingExtraError(
        f"recordings need {', '.join(_missing)}: install them with `pip install vigauge[recordings]`"
    )

_PUBLIC = ("Estimate", "estimate", "proposed_parts")


def __getattr__(name: str) -> Any:
    # By name: readers of a table need neither OpenCV nor the solver.
    if name in _PUBLIC:
        return getattr(import_module(".estimation.estimate", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
