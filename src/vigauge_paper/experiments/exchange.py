"""One exchanged pair in the fixed covariance: what it does to the distance of Figs. 9 and 10.

In both published matrices the variance that belongs at (3N+1, 3N+1), the first keyframe's
rotation about y, stands at (3N+1, 3N), and its own entry is zero.
"""

from collections.abc import Mapping

import numpy as np

from vigauge.geometry.so3 import Array
from vigauge.model.archive import load_arrays
from vigauge.model.evaluation import relative_frobenius

from ..ids import Row
from .evidence import Evidence, NoEvidenceError
from .experiment import Experiment, Material, NoSettings


def exchanged(covariance: Array) -> Array:
    """A (9N, 9N) covariance with entries (3N+1, 3N) and (3N+1, 3N+1) exchanged; twice is nothing."""
    first = len(covariance) // 3
    out = covariance.copy()
    out[first + 1, [first, first + 1]] = covariance[first + 1, [first + 1, first]]
    return out


def _row(name: str, right: float, wrong: float) -> Row:
    return {"experiment": name, "relative_frobenius": right, "with_exchanged_pair": wrong}


def exchange(name: str, transformed: Array, fixed: Array) -> Row:
    """Distance of transformed and fixed as they are, and with the pair exchanged in fixed."""
    return _row(
        name, relative_frobenius(transformed, fixed), relative_frobenius(transformed, exchanged(fixed))
    )


def published_magnitude(arrays: Mapping[str, Array], panel: str) -> Array:
    """|sigma| of a panel of the paper's Fig. 9 or 10, to half a grey level; zero where it is yellow."""
    size = 10.0 ** arrays[panel] - float(arrays["eps"])
    return np.where(arrays[f"{panel}_zero_mask"].astype(bool) | np.isnan(size), 0.0, size)


def exchange_published(name: str, arrays: Mapping[str, Array]) -> Row:
    """The same from a published figure (magnitudes only), where the pair is exchanged already.

    The first keyframe's variance about y goes back to its place; the entry that it took is
    filled from its mirror image, which has the covariance.
    """
    transformed, printed = (published_magnitude(arrays, panel) for panel in ("transformed", "fixed"))
    first = len(printed) // 3
    right = exchanged(printed)
    right[first + 1, first] = right[first, first + 1]
    return _row(name, relative_frobenius(transformed, right), relative_frobenius(transformed, printed))


def rows(material: Material, settings: NoSettings) -> list[Row]:
    """Every result whose covariance is not withheld, and the paper's two figures."""
    out: list[Row] = []
    for name, file in material.covariances.items():
        arrays = load_arrays(file)
        if not str(arrays["withheld"]):
            out.append(exchange(name, arrays["transformed"], arrays["fixed"]))
    for figure in ("fig09", "fig10"):
        arrays = load_arrays(material.published / f"{figure}.npz")
        out.append(exchange_published(f"published {figure}", arrays))
    return out


def sentence(e: Evidence, name: str) -> str:
    """What the exchanged pair does to the distance of an experiment."""
    table = 100 * e.reason("exchange").set_index("experiment")
    if name not in table.index:
        raise NoEvidenceError(f"the covariance of {name} is withheld")
    ours = table.loc[name]
    return (
        "In the published matrix two neighbours in row 3N+1, columns 3N and 3N+1, changed places: so our "
        f"{ours['relative_frobenius']:.2g} % becomes {ours['with_exchanged_pair']:.2g} %."
    )


EXPERIMENT = Experiment("exchange", rows, reads=("covariances",))
