"""A rendered recording of a body that turns at constant velocity: no force tells the scale."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import ArrayLike
from scipy.interpolate import make_interp_spline

from vigauge.synthetic.spline import SplineTrajectory
from vigauge_paper.stand_in import rendering
from vigauge_paper.stand_in.asl_folder import write_asl_folder
from vigauge_paper.stand_in.flight import FlightShape, fly


def render_uniform_motion(folder: Path, v_W: ArrayLike) -> Path:
    """1.2 s in the room at ``v_W`` (3,) m/s, two cameras, truth and all, into ``folder``."""

    def straight(
        shape: FlightShape, start_s: float, end_s: float, rng: np.random.Generator
    ) -> SplineTrajectory:
        ends_s = np.array([start_s, end_s])
        path = np.asarray(shape.mean_W) + ends_s[:, None] * np.asarray(v_W)
        return replace(fly(shape, start_s, end_s, rng), position=make_interp_spline(ends_s, path, k=1))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rendering, "fly", straight)
        sequence = rendering.render_sequence("room", rendering.RenderSettings(seed=7, duration_s=1.2))
    write_asl_folder(sequence, "room", folder, versions={})
    return folder
