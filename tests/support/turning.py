"""A rendered recording of a body that turns on the spot."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vigauge_paper.stand_in import rendering
from vigauge_paper.stand_in.asl_folder import write_asl_folder


def render_turning(folder: Path) -> Path:
    """1.2 s in the room, two cameras, truth and all, into ``folder``."""
    make_scene, flight = rendering.SCENES["room"]
    only_turns = replace(flight, position_m=np.zeros_like(flight.position_m))
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(rendering.SCENES, "room", (make_scene, only_turns))
        sequence = rendering.render_sequence("room", rendering.RenderSettings(seed=7, duration_s=1.2))
    write_asl_folder(sequence, "room", folder, versions={})
    return folder
