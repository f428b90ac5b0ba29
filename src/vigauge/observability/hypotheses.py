"""Estimates, charts and units of which an information matrix does not see the directions of the gauge.

Where H sees directions that no measurement sees, H or the estimate is not what the caller says. Each
hypothesis here has another U; the one with H U = 0 is what the matrix was made with.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from ..gauge.group import Euclidean, Similarity, YawTranslation
from ..gauge.layout import POSE, Layout, null_space
from ..geometry.charts import CHARTS, poses_of
from ..geometry.so3 import Array

# Units that H may have in place of the estimate's, by how many of them make one of its own.
_LENGTHS = {"millimetres": 1e3, "centimetres": 1e2, "kilometres": 1e-3}
_DEGREE = 180.0 / np.pi

# Kind and sentence of a hypothesis, and its directions (n, d).
Hypothesis = tuple[str, str, Array]


def other_units(layout: Layout, U: Array) -> Iterator[Hypothesis]:
    """H in other units than the estimate."""
    kinds = [kind for kind in ("position", "velocity") if kind in layout.blocks]
    lengths = np.concatenate([*(layout.blocks[kind].ravel() for kind in kinds), layout.points.ravel()])
    turns = layout.blocks["rotation"].ravel() if "rotation" in layout.blocks else lengths[:0]
    units = [(lengths, factor, f"lengths of H are in {name}") for name, factor in _LENGTHS.items()]
    units.append((turns, _DEGREE, "rotations of H are in degrees"))
    for columns, factor, text in units:
        other = U.copy()
        other[columns[columns >= 0]] *= factor
        yield "units", f"{text}, where the estimate is in metres and radians: bring both to one unit", other


def other_layouts(given: dict[str, Any]) -> Iterator[Hypothesis]:
    """Another side of rotations, or position and rotation in each other's columns."""
    layout: Layout = given["layout"]
    for exchanged in (False, True):
        blocks = dict(layout.blocks)
        if exchanged:
            if not set(POSE) <= set(blocks) or blocks[POSE[0]].shape != blocks[POSE[1]].shape:
                return
            blocks[POSE[0]], blocks[POSE[1]] = blocks[POSE[1]], blocks[POSE[0]]
        for side, chart in CHARTS.items():
            other = chart != layout.chart
            if not (other or exchanged) or (not other and side != layout.side):
                continue
            texts = ["columns of position and rotation are exchanged in the layout"] * exchanged
            if other:
                texts.append(
                    f"poses of H are perturbed as in side='{side}', not '{layout.side}' as the layout says"
                )
            U = null_space(**{**given, "layout": replace(layout, blocks=blocks, side=side)})
            sentence = f"{', and '.join(texts)}, so that directions look measured that are not"
            yield ("order" if exchanged else "chart"), sentence, U


def other_estimates(H: Any, given: dict[str, Any]) -> Iterator[Hypothesis]:
    """Poses of the world in the body, velocities in the body, another direction of gravity."""
    layout = given["layout"]
    R, p = poses_of(given["poses"], layout.n_keyframes)
    R_T = R.swapaxes(1, 2)
    inverse = R_T, -np.einsum("nij,nj->ni", R_T, p)
    text = "poses are those of the world in the body (T_BW): give T_WB, their inverses"
    yield "poses", text, null_space(**{**given, "poses": inverse})
    if "velocity" in layout.blocks:
        v = np.einsum("nij,nj->ni", R, np.asarray(given["velocities"], dtype=float))
        text = "velocities are in the body: give those in W, R_WB v"
        yield "velocities", text, null_space(**{**given, "velocities": v})
    if given["group"] is None or isinstance(given["group"], YawTranslation):
        turns = null_space(**{**given, "group": Euclidean()})[:, :3]
        axis = np.linalg.eigh(turns.T @ (H @ turns))[1][:, 0]
        told = (
            np.array([0.0, 0.0, -1.0])
            if given["gravity"] is None
            else np.asarray(given["gravity"], dtype=float)
        )
        # No turn tells up from down: as it was told, and downwards where that does not tell.
        axis = axis if axis @ told / np.linalg.norm(told) >= 1e-6 * axis[2] else -axis
        text = (
            f"gravity is along {tuple((np.round(axis, 4) + 0.0).tolist())} in W, where H sees no turn, not"
            f" along {tuple(told.tolist())}: give gravity=, or the estimate in a world that is level"
        )
        yield "gravity", text, null_space(**{**given, "gravity": axis})


def larger_groups(given: dict[str, Any]) -> Iterator[Hypothesis]:
    """Groups with more directions than the one that was given."""
    group = given["group"] or YawTranslation()
    for other, told in ((Similarity(), "one camera alone"), (Euclidean(), "images without gravity")):
        more = [name for name in other.directions if name not in group.directions]
        if more and set(group.directions) < set(other.directions):
            text = f"H does not see {', '.join(more)} either, as for {told}"
            text += f": give group=vg.{type(other).__name__}()"
            yield "group", text, null_space(**{**given, "group": other})
