"""The inverse of the reduced camera system with some columns held: one generalised inverse of H.

Any gauge's covariance follows from it by a projection of low rank, see :mod:`vigauge.covariance.covariance`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg.lapack as lapack

from ..errors import DegenerateError, SolverError
from ..geometry.so3 import Array
from ..kernels import cholesky, symmetric
from ..observability.spectrum import require_regular
from ..solver.normal_equations import ReducedSystem
from ..sparsity.layout import Factorised, Index
from .banded_inverse import banded_inverse, selected_inverse

# From this size on LAPACK's blocks are faster than our rows (measured).
_BLOCKS_PAY = 600


@dataclass(frozen=True)
class HeldInverse:
    """G: S^-1 without the ``held`` columns of the package's order, whose rows and columns in G are zero.

    Raises DegenerateError where more than the held columns is unobservable.
    """

    reduced: ReducedSystem
    held: Index
    factorised: Factorised

    @classmethod
    def of(cls, reduced: ReducedSystem, held: Index) -> HeldInverse:
        layout = reduced.structure.layout
        storage = reduced.storage.copy()
        layout.hold(storage, held)
        try:
            return cls(reduced, held, layout.factorise(storage))
        except SolverError as error:
            raise DegenerateError("the information matrix is not positive definite in this gauge") from error

    def times(self, columns: Array) -> Array:
        """G B for columns B (9N, c) in the package's order."""
        layout = self.reduced.structure.layout
        if not layout.banded:
            return self._full @ columns
        right = np.empty_like(columns)
        right[layout.stored] = columns
        right[layout.stored[self.held]] = 0.0
        return self.factorised.solve(right)[layout.stored]

    def dense(self) -> Array:
        """(9N, 9N) G in the package's order, an array of its own."""
        return self._unpacked() if self.reduced.structure.layout.banded else self._full.copy()

    def blocks(self, columns: Index) -> Array:
        """(m, c, c) entries of G over m sets of columns (m, c); in the band of S, where S has a band."""
        layout = self.reduced.structure.layout
        if not layout.banded:
            return self._full[columns[..., :, None], columns[..., None, :]]
        at = layout.stored[columns]
        row, column = at[..., :, None], at[..., None, :]
        low, high = np.minimum(row, column), np.maximum(row, column)
        held = np.isin(columns, self.held)
        return np.where(held[..., :, None] | held[..., None, :], 0.0, self._band[high - low, low])

    def across(self, columns: Index) -> Array:
        """(c, c) entries of G over columns of the package's order, cross terms included."""
        layout = self.reduced.structure.layout
        if not layout.banded:
            return self._full[np.ix_(columns, columns)]
        self._band  # noqa: B018  (refuses a singular system)
        unit = np.zeros((layout.size, len(columns)))
        unit[columns, np.arange(len(columns))] = 1.0
        G = self.times(unit)[columns]
        held = np.isin(columns, self.held)
        G[held], G[:, held] = 0.0, 0.0
        return 0.5 * (G + G.T)

    @cached_property
    def _band(self) -> Array:
        """Entries of the inverse inside the band, LAPACK's lower band form, stored order."""
        out = selected_inverse(self.factorised.factor)
        self._require_regular(out[0])
        return out

    @cached_property
    def _full(self) -> Array:
        """G, of systems that are not banded: whatever is asked of those comes from it."""
        return self._unpacked()

    def _unpacked(self) -> Array:
        layout, factor = self.reduced.structure.layout, self.factorised.factor
        if layout.banded:
            lower = banded_inverse(factor)
        elif len(factor) < _BLOCKS_PAY:
            lower = np.empty((len(factor),) * 2)
            cholesky.inverse(factor.T, lower)
        else:
            lower, _ = lapack.dpotri(factor, lower=1)
        self._require_regular(np.diagonal(lower))
        at = layout.stored[self.held]
        lower[at], lower[:, at] = 0.0, 0.0
        out = np.empty((layout.size, layout.size))
        symmetric.unpack(lower, layout.stored, out)
        return out

    def _require_regular(self, diagonal: Array) -> None:
        layout = self.reduced.structure.layout
        information = layout.diagonal(self.reduced.storage).copy()
        # Not subtracted: held entries of the inverse are one, whatever the unit of the information.
        information[layout.stored[self.held]] = 0.0
        require_regular(float(diagonal @ information), layout.size)
