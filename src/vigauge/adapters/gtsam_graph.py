"""What GTSAM says of a graph at an estimate: the types of its variables, and its information matrix."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import scipy.sparse as sparse

from ..errors import DataError, MissingExtraError
from ..gauge.layout import Index
from ..geometry.so3 import Array

try:
    import gtsam
except ImportError as error:
    raise MissingExtraError(f"needs GTSAM: install it with `pip install gtsam` ({error})") from error

# The known types: how GTSAM gives them, and their columns in GTSAM's own order. A velocity may be a point.
KINDS: dict[str, tuple[Any, dict[str, int]]] = {
    "Pose3": (lambda values, key: values.atPose3(key).matrix(), {"rotation": 3, "position": 3}),
    "Pose2": (lambda values, key: gtsam.Pose3(values.atPose2(key)).matrix(), {"position": 2, "rotation": 1}),
    "velocity": (gtsam.Values.atPoint3, {"velocity": 3}),
    "bias": (gtsam.Values.atConstantBias, {"bias": 6}),
}
# A factor does not see a shift along which it has less than this of the information that it might have.
_UNSEEN = 1e-9


def variables(graph: Any, values: Any) -> dict[int, tuple[str, Any]]:
    """Kind and value of every variable of a graph by its key; poses as (4, 4), also in the plane."""
    for what, given in {"NonlinearFactorGraph": graph, "Values": values}.items():
        if not isinstance(given, getattr(gtsam, what)):
            raise DataError("graph, values", f"must be a gtsam.{what}", value=type(given).__name__)
    return {Key(key): _value(values, key) for key in sorted(graph.keyVector())}


class Key(int):
    """A key of GTSAM that messages name as GTSAM does: x3."""

    def __str__(self) -> str:
        return str(gtsam.DefaultKeyFormatter(self))

    __repr__ = __str__


def _name(key: int) -> str:
    return f"variable {Key(key)}"


def _value(values: Any, key: int) -> tuple[str, Any]:
    if not values.exists(key):
        raise DataError("values", "must have every variable of the graph", field=_name(key))
    told = ""
    for kind, (read, _) in KINDS.items():
        try:
            return kind, read(values, key)
        except RuntimeError as error:  # the only way to learn a type
            told = str(error)
    stored = re.search(r"GenericValue<(.*?)> ", told)
    rule = "must be Pose3, Pose2, a velocity (3), imuBias.ConstantBias or Point3"
    raise DataError("values", rule, field=_name(key), value=stored[1] if stored else told)


def linearised(
    linear: Any, found: dict[int, tuple[str, Any]], at: dict[int, Index], n: int
) -> tuple[Any, list[int]]:
    """H (n, n) sparse, and the keys of the 3-vectors that are points, not velocities."""
    votes: dict[int, set[str]] = {key: set() for key, (kind, _) in found.items() if kind == "velocity"}
    # How each variable moves under a shift of the world, were 3-vectors velocities.
    shift = {key: np.zeros((len(columns), 3)) for key, columns in at.items()} if votes else {}
    for key in shift:
        kind, value = found[key]
        if kind == "Pose3":
            shift[key][3:] = value[:3, :3].T
    # Columns and information of the factors, by their number of columns.
    factors: dict[int, tuple[list[Index], list[Array]]] = {}
    for index in range(linear.size()):
        factor = linear.at(index)
        if factor is None or not factor.size():
            continue
        if isinstance(factor, gtsam.JacobianFactor) and factor.isConstrained():
            rule = "must have no hard constraints, which have no information: give them a small sigma"
            raise DataError("graph", rule, row=index)
        own = list(factor.keys())
        where, information = np.concatenate([at[key] for key in own]), factor.information()
        of_this_size = factors.setdefault(len(where), ([], []))
        of_this_size[0].append(where)
        of_this_size[1].append(information)
        vectors = [key for key in own if key in votes] if votes else []
        if vectors and any(found[key][0] == "Pose3" for key in own):
            moved = [np.concatenate([shift[key] for key in own])]
            moved.append(np.concatenate([np.eye(3) if key in votes else shift[key] for key in own]))
            velocity, point = (float(np.sum(E * (information @ E))) for E in moved)
            if min(velocity, point) < _UNSEEN * max(velocity, point):
                for key in vectors:
                    votes[key].add("velocity" if velocity < point else "point")
    for key, said in votes.items():
        if len(said) != 1:
            rule = "must be a velocity or a point by its factors with poses"
            raise DataError(
                "graph", rule, field=_name(key), value=sorted(said) or "no factor, or behind every camera"
            )
    H = sparse.csc_array((n, n))
    for size, (own_columns, entries) in factors.items():
        columns = np.tile(np.array(own_columns), size)
        rows = columns.reshape(-1, size, size).swapaxes(1, 2)
        H = H + sparse.csc_array((np.ravel(entries), (rows.ravel(), columns.ravel())), shape=(n, n))
    return H, [key for key, said in votes.items() if "point" in said]
