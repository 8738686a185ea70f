"""Approximate inverses on contact areas: by a cosine transform, or by FSAI if fragmented."""

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

FEW = 2**11  # With fewer elements in contact, single precision saves no time for friction.
# The inverse of A decays as the cube of the distance, so FSAI remains useful after up to this share
# of the elements has changed: for the new elements the diagonal is good enough.
ALIKE = 0.1
PATIENCE = 40  # Iterations on a line that take about as long as the set-up of FSAI.
WIDE = 2**17  # On larger grids, transforms take longer than FSAI on a few elements.


class LocalInverse:
    """FSAI on the elements C, and the identity on the others."""

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
    """Return FSAI on some elements, or None if it is refused or not worth its set-up.

    A is the matrix on the grid. A share `change` of the elements is new. By default FSAI has the
    precision of A.
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

    It is in single precision, unless A is too ill-conditioned, its numbers are out of range, or
    there are too few elements to save time.
    """
    dtype = precision_for(grid.diagonal(A)) if grid.vectors.count(C) > FEW else np.float64
    everywhere = extend_to_components(grid, A, C)
    if is_fsai_worthwhile(_count(grid, A), partial(grid.fragmentation, C), 0.0):
        with suppress(np.linalg.LinAlgError):
            return grid.invert_by_fsai(A, everywhere, dtype)
    return grid.restrict(_invert_by_transform(grid, A, dtype), everywhere)


def invert_steady(grid: Grid, K: Any, C: Array, dtype: DTypeLike) -> Any:
    """Return approximate inverses of the matrix of steady rolling plus ν I, on a contact."""
    own: tuple[Any, ...] = ()
    if not grid.is_line and is_fsai_worthwhile(_count(grid, K), partial(grid.fragmentation, C)):
        with suppress(np.linalg.LinAlgError):
            own = grid.invert_on_runs(C, dtype)
    return grid.invert_shifted(K, dtype, own)


def _invert_by_transform(grid: Grid, A: Any, dtype: DTypeLike) -> Any:
    """Return an approximate inverse on the whole grid, in this precision if sufficient."""
    with suppress(np.linalg.LinAlgError):  # The symbol may be lost in rounding errors.
        return grid.invert_by_transform(A, dtype)
    return grid.invert_by_transform(A)


def extend_to_components(grid: Grid, A: Any, C: Array) -> Array:
    """Return the same elements for each component of a matrix."""
    everywhere: Array = grid.vectors.xp.broadcast_to(C, (*A.grid_shape[: -C.ndim], *C.shape))
    return everywhere


def _count(grid: Grid, A: Any) -> int:
    """Return the number of unknowns of a matrix on the whole grid."""
    return prod(A.grid_shape[: len(A.grid_shape) - len(grid.shape)]) * prod(grid.shape)


class Inverse:
    """An approximate inverse for sets of elements that change.

    Parameters
    ----------
    grid : Grid
    A : ToeplitzOperator
        A matrix on the grid with unit diagonal.
    everywhere : LinearOperator, optional
        Its inverse on the whole grid, if known: then A is the inverse of a contact matrix, and sets
        have few elements (see `normal.starts`).

    Attributes
    ----------
    dtype : dtype
        Single precision, unless A is too ill-conditioned for it, as for very long elements.
    is_slow : bool
        Whether the iterations on sets of a line took as long as a set-up of FSAI. If they did on a
        coarser grid, they will on this one.
    """

    def __init__(self, grid: Grid, A: ToeplitzOperator, everywhere: Any = None) -> None:
        self._grid, self._A, self._decays = grid, A, everywhere is not None
        self._before: Array | None = None
        self._local: LocalInverse | None = None
        self.is_slow, self._applied = False, 0
        self._everywhere = everywhere or _invert_by_transform(grid, A, np.float32)
        self.dtype = self._everywhere.dtype

    def fit(self, C: Array, *, is_near: bool = False) -> None:
        """Choose the inverse for a set: keep FSAI of a similar set, or set it up anew.

        If the set is close to the final one (`is_near`), the set-up pays off at once, otherwise
        when the set changes less.
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
            return  # A has an exact inverse there, by Fourier transform, as cheap as a product.
        before, self._before = self._before, C
        if self._local is not None and is_fsai_kept(self._measure_change(C, self._local.C)):
            return
        change = float(not is_near)
        if before is not None and not is_near:
            change = self._measure_change(C, before)
        self._local = invert_locally(self._grid, self._A, C, change=change, dtype=self.dtype)

    def _set_up(self, C: Array) -> LocalInverse | None:
        """Return FSAI on a set, or None if it is refused."""
        with suppress(np.linalg.LinAlgError):
            return LocalInverse(self._grid.invert_by_fsai(self._A, C, self.dtype), C)
        return None

    def __call__(self, r: Array, out: Array | None = None) -> Array:
        """Apply it to a field that is zero outside of the set; the result is not.

        The result may be in `out`.
        """
        self._applied += 1
        self.is_slow |= self._applied > PATIENCE
        if self._local is not None:
            return self._local(r)
        reshape = self._grid.vectors.reshape
        memory = None if out is None else reshape(out, (-1,))
        return reshape(apply_to_rows(self._everywhere, reshape(r, (-1,)), memory), r.shape)

    def _measure_change(self, C: Array, before: Array) -> float:
        """Return the number of changed elements as a share of the set."""
        return self._grid.vectors.count(C ^ before) / self._grid.vectors.count(C)
