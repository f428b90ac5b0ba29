"""Recordings in ASL (EuRoC) layout: readers, checks, import from rosbags, and the stereo front-end.

Needs the packages of the extra ``recordings``; the rest of the library runs without them.
"""

from importlib.util import find_spec

from ..errors import MissingExtraError

_PACKAGES = {"cv2": "OpenCV", "pycolmap": "pycolmap", "yaml": "PyYAML", "tqdm": "tqdm"}

_missing = [name for module, name in _PACKAGES.items() if find_spec(module) is None]
if _missing:
    raise MissingExtraError(
        f"recordings need {', '.join(_missing)}: install them with `pip install vigauge[recordings]`"
    )
