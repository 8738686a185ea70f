"""Approximate inverses on areas of contact: by a cosine transform, on fragmented ones by FSAI."""

from contextlib import suppress
from functools import partial
from math import prod
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.dense import precision_for
from toeplitz_mg.contact.grid import Grid
from toeplitz_mg.operators import ToeplitzOperator, apply_to_rows
from toeplitz_mg.operators.base import library_for
from toeplitz_mg.preconditioners.choice import is_fsai_kept, is_fsai_worthwhile

FEW = 2**11  # Elements in contact up to which friction in single precision saves no time.
# The inverse of A decays as the cube of the distance, so that FSAI of it serves sets of which up to
# this share has changed: the diagonal alone is good enough for the others.
ALIKE = 0.1
PATIENCE = 40  # Iterations on sets of a line that take about as long as a set-up of FSAI.
WIDE = 2**17  # Fewest elements of a grid whose transforms take longer than FSAI of a few of them.


class LocalInverse:
    """FSAI of some elements C, an approximate inverse P on them, and the identity on others."""

    def __init__(self, P: Any, C: Array) -> None:
        self.C, self._library, self._apply = C, library_for(P), partial(apply_to_rows, P)
        on_host = self._library.to_numpy(C)
        self._cells = self._library.cells(np.flatnonzero(on_host), on_host.size)

    def __call__(self, r: Array) -> Array:
        """Apply it to a field."""
        return self._library.replace(r, self._cells, self._apply)


def invert_locally(
    grid: Grid, A: Any, C: Array, *, change: float = 0.0, dtype: DTypeLike | None = None
) -> LocalInverse | None:
    """Return FSAI on some elements, or None where it is refused, or not worth its set-up.

    The matrix A is of the grid. A share of the elements has just changed. By default FSAI is kept,
    and applied, in the precision of A.
    """
    if not is_fsai_worthwhile(_count(grid, A), partial(grid.fragmentation, C), change):
        return None
    C = extend_to_components(grid, A, C)
    try:
        return LocalInverse(grid.invert_by_fsai(A, C, dtype), C)
    except np.linalg.LinAlgError:
        return None


def invert_on(grid: Grid, A: Any, C: Array) -> Any:
    """Return an approximate inverse of the rows and columns of A for some elements.

    It is in single precision, unless A is too ill-conditioned for it, its numbers are out of range,
    or the elements so few that it saves nothing.
    """
    dtype = precision_for(grid.diagonal(A)) if grid.vectors.count(C) > FEW else np.float64
    everywhere = extend_to_components(grid, A, C)
    if is_fsai_worthwhile(_count(grid, A), partial(grid.fragmentation, C), 0.0):
        with suppress(np.linalg.LinAlgError):
            return grid.invert_by_fsai(A, everywhere, dtype)
    return grid.restrict(_invert_by_transform(grid, A, dtype), everywhere)


def invert_steady(grid: Grid, K: Any, C: Array, dtype: DTypeLike) -> Any:
    """Return approximate inverses of the matrix of steady rolling with additions, on a contact."""
    own: tuple[Any, ...] = ()
    if not grid.is_line and is_fsai_worthwhile(_count(grid, K), partial(grid.fragmentation, C)):
        with suppress(np.linalg.LinAlgError):
            own = grid.invert_on_runs(C, dtype)
    return grid.invert_shifted(K, dtype, own)


def _invert_by_transform(grid: Grid, A: Any, dtype: DTypeLike) -> Any:
    """Return an approximate inverse on the whole grid, of this precision where that is enough."""
    with suppress(np.linalg.LinAlgError):  # The symbol may sink into the rounding.
        return grid.invert_by_transform(A, dtype)
    return grid.invert_by_transform(A)


def extend_to_components(grid: Grid, A: Any, C: Array) -> Array:
    """Return the same elements for each component of a matrix."""
    everywhere: Array = grid.vectors.xp.broadcast_to(C, (*A.grid_shape[: -C.ndim], *C.shape))
    return everywhere


def _count(grid: Grid, A: Any) -> int:
    """Return the unknowns of a matrix on the whole grid."""
    return prod(A.grid_shape[: len(A.grid_shape) - len(grid.shape)]) * prod(grid.shape)


class Inverse:
    """An approximate inverse for sets that change.

    Parameters
    ----------
    grid : Grid
    A : ToeplitzOperator
        A matrix of the grid, whose diagonal is 1.
    everywhere : LinearOperator, optional
        An inverse of it on the whole grid, where that is known: A is itself an inverse, of a matrix
        of contact, and sets are of few elements (see `normal.starts`).

    Attributes
    ----------
    dtype : dtype
        Single precision, unless A is too ill-conditioned for that, as it is of very long elements.
    is_slow : bool
        Whether iterations on sets of a line have taken as long as a set-up of FSAI. Where they have
        on a coarser grid, they will here.
    """

    def __init__(self, grid: Grid, A: ToeplitzOperator, everywhere: Any = None) -> None:
        self._grid, self._A, self._decays = grid, A, everywhere is not None
        self._before: Array | None = None
        self._local: LocalInverse | None = None
        self.is_slow, self._applied = False, 0
        self._everywhere = everywhere or _invert_by_transform(grid, A, np.float32)
        self.dtype = self._everywhere.dtype

    def fit(self, C: Array, *, is_near: bool = False) -> None:
        """Choose for a set: FSAI of one that is alike is kept, and else it is set up anew.

        Where the set is near that to be found it is worth that at once, else when it changes less.
        """
        if self._decays:  # From the second set on, as the first is far from the last.
            is_first, self._before = self._before is None, C
            if is_first or prod(self._grid.shape) < WIDE:
                return
            if self._local is None or self._measure_change(C, self._local.C) > ALIKE:
                self._local = self._set_up(C) or self._local
            return
        if self._grid.is_line:
            # Once the iterations on other sets have taken as long as a set-up.
            is_kept = self._local and is_fsai_kept(self._measure_change(C, self._local.C))
            if self.is_slow and not is_kept:
                self._local = self._set_up(C)
            return
        if any(self._grid.periodic):
            return  # There A itself has an inverse, that of its waves, as cheap as a product.
        before, self._before = self._before, C
        if self._local is not None and is_fsai_kept(self._measure_change(C, self._local.C)):
            return
        change = float(not is_near)
        if before is not None and not is_near:
            change = self._measure_change(C, before)
        self._local = invert_locally(self._grid, self._A, C, change=change, dtype=self.dtype)

    def _set_up(self, C: Array) -> LocalInverse | None:
        """Return FSAI on a set, or None where it is refused."""
        with suppress(np.linalg.LinAlgError):
            return LocalInverse(self._grid.invert_by_fsai(self._A, C, self.dtype), C)
        return None

    def __call__(self, r: Array, out: Array | None = None) -> Array:
        """Apply it to a field that is zero outside of the set; the result is not.

        It may be in `out`.
        """
        self._applied += 1
        self.is_slow |= self._applied > PATIENCE
        if self._local is not None:
            return self._local(r)
        reshape = self._grid.vectors.reshape
        memory = None if out is None else reshape(out, (-1,))
        return reshape(apply_to_rows(self._everywhere, reshape(r, (-1,)), memory), r.shape)

    def _measure_change(self, C: Array, before: Array) -> float:
        """Return the elements that differ, as a share of those of the set."""
        return self._grid.vectors.count(C ^ before) / self._grid.vectors.count(C)
