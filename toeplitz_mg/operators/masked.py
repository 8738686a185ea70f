"""Rows and columns of an operator on part of its grid: extend, multiply, restrict."""

from math import prod
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array, Mask
from toeplitz_mg.engine.arrays.library import library_of
from toeplitz_mg.operators.base import (
    GridOperator,
    MatrixOperator,
    apply_to_rows,
    library_for,
    require_serial,
    work_of,
)
from toeplitz_mg.operators.coupled import CoupledOperator
from toeplitz_mg.values import refuse_masked


class MaskedOperator(MatrixOperator):
    """The rows and columns of an operator where a mask is true (paper, §5.4).

    The Toeplitz structure is lost, but products stay fast: the vector is extended by zeros,
    multiplied on the whole grid, and restricted to the mask.

    Parameters
    ----------
    A : ToeplitzOperator
        An operator on a whole grid. Any LinearOperator with an attribute ``grid_shape`` that acts
        on vectors of all points of that grid will do, such as a DiagonalisedOperator.
    mask : array_like of bool, of shape ``A.grid_shape``
        True at the unknowns. For coupled components, one mask may serve all.

    Attributes
    ----------
    full : LinearOperator
        `A`, on the whole grid.
    mask : ndarray of bool
    grid_shape : tuple of int

    Raises
    ------
    TypeError
        If the mask is not boolean, or `A` is not an operator on a whole grid (but, for example, on
        part of one).
    ValueError
        If the mask has another shape than the grid, or is nowhere true.

    See Also
    --------
    ToeplitzOperator : the matrix on the whole grid.
    fsai_preconditioner : a preconditioner for any mask.

    Notes
    -----
    Vectors have the ``mask.sum()`` unknowns in C order, ``grid[mask]``. Back to the grid:
    ``grid = np.zeros(A.grid_shape); grid[mask] = x``.

    Examples
    --------
    >>> import numpy as np
    >>> from toeplitz_mg import MaskedOperator, ToeplitzOperator
    >>> A = MaskedOperator(ToeplitzOperator([3.0, 2.0, 1.0]), [True, False, True])
    >>> (A @ np.array([1.0, 1.0])).round(12)
    array([4., 4.])
    """

    def __init__(self, A: LinearOperator, mask: ArrayLike) -> None:
        require_serial("A", A, "its mask is a toeplitz_mg.slabs.MaskedOperator")
        grid_shape = getattr(A, "grid_shape", None)
        if grid_shape is None or isinstance(A, MaskedOperator):
            raise TypeError(
                f"A is of type {type(A).__name__}, but must be an operator on a whole grid, "
                "such as a ToeplitzOperator"
            )
        if A.shape != (prod(grid_shape),) * 2:
            raise TypeError(
                f"A has the shape {A.shape} on a grid {grid_shape}, of which it is a part already, "
                "but must be an operator on a whole grid: use the matrix or the "
                "preconditioner of the whole grid"
            )
        self.full = A
        mask = library_of(mask).to_numpy(mask)
        self.mask = check_mask(mask, grid_shape, isinstance(A, CoupledOperator))
        self._index = np.flatnonzero(self.mask)
        library = library_for(A)
        super().__init__(A.dtype, grid_shape, work_of(A), len(self._index), library)
        self._cells = library.cells(self._index, self.mask.size)

    def toarray(self) -> Array:
        """Return the dense matrix, shape (N, N), N = ``mask.sum()``.

        The entries of a Toeplitz matrix are copied without any transform; other operators are
        multiplied with the unit matrix.
        """
        if isinstance(self.full, MatrixOperator):
            return self.full.entries(self._index, self._index)
        return self.apply(np.eye(self.shape[0], dtype=self.dtype)).T

    def astype(self, dtype: DTypeLike) -> "MaskedOperator":
        """Return the matrix in another precision, or itself if it has that precision."""
        if self.dtype == dtype:
            return self
        if not hasattr(self.full, "astype"):
            raise TypeError(f"{self.full!r} has a fixed precision: give dtype to its function")
        return MaskedOperator(self.full.astype(dtype), self.mask)

    def scaled(self, left: Any = None, right: Any = None) -> Any:
        """Return L A R, on the same mask (see `GridOperator.scaled`)."""
        if not isinstance(self.full, GridOperator):
            return NotImplemented
        return self._restrict(self.full.scaled(self._extend(left), self._extend(right)))

    def plus(self, other: Any) -> Any:
        """Return the sum, on the same mask (see `GridOperator.plus`)."""
        if not isinstance(self.full, GridOperator):
            return NotImplemented
        if isinstance(other, np.ndarray):
            return self._restrict(self.full.plus(self._extend(other)))
        if isinstance(other, MaskedOperator) and np.array_equal(other.mask, self.mask):
            return self._restrict(self.full.plus(other.full))
        return NotImplemented

    def _extend(self, factor: Any) -> Any:
        """Return a diagonal on the whole grid, with the mean where there is no unknown."""
        if np.ndim(factor) == 0:
            return factor
        # With the mean, a constant diagonal stays constant; the other values are never used.
        grid = np.full(self.mask.size, factor.mean(), np.result_type(factor, np.float32))
        grid[self._index] = factor
        return grid

    def _restrict(self, full: Any) -> Any:
        if full is self.full:
            return self
        return full if full is NotImplemented else MaskedOperator(full, self.mask)

    @property
    def is_symmetric(self) -> bool:
        """Whether the matrix on the whole grid equals its transpose."""
        return bool(self.full.is_symmetric)

    @property
    def is_hermitian(self) -> bool:
        """Whether the matrix on the whole grid equals its conjugate transpose."""
        return bool(self.full.is_hermitian)

    @property
    def norm_bound(self) -> float:
        """An upper bound of the 2-norm: that of the matrix on the whole grid."""
        return float(self._whole().norm_bound)

    def entries(self, rows: Array, columns: Array) -> Array:
        """Return the entries in these rows and columns, positions among the unknowns."""
        rows, columns = refuse_masked("rows", rows), refuse_masked("columns", columns)
        return self._whole().entries(self._index[rows], self._index[columns])

    def diagonal(self) -> Array:
        """Return the entries (i, i), shape (N,)."""
        return self._whole().diagonal()[self._index]

    def _whole(self) -> Any:
        if not hasattr(self.full, "entries"):
            raise TypeError(f"{self.full!r} has no known entries: multiply it with unit vectors")
        return self.full

    def apply(self, X: Array, out: Array | None = None) -> Array:
        """Multiply each row of `X` (see `GridOperator.apply`)."""
        library = self.library
        if out is None:
            out = library.allocate(X, self.dtype)
        grid = library.extend(X, self._cells, out)
        return library.restrict(apply_to_rows(self.full, grid, grid), self._cells, out)

    def _adjoint(self) -> "MaskedOperator":
        return self._restrict(self.full.H)

    def _transpose(self) -> "MaskedOperator":
        return self._restrict(self.full.T)

    def __repr__(self) -> str:
        return f"<MaskedOperator {self.shape[0]} of {self.mask.size} points of {self.full!r}>"


def check_mask(mask: ArrayLike, grid_shape: tuple[int, ...], is_coupled: bool = False) -> Mask:
    """Return a read-only copy of a mask, or raise an error that says what is wrong.

    Parameters
    ----------
    mask : array_like of bool, of shape `grid_shape`
    grid_shape : tuple of int
    is_coupled : bool
        Whether the first axis of the grid counts components; one mask may then serve all.
    """
    checked = check_booleans(mask, grid_shape, is_coupled)
    if not checked.any():
        raise ValueError(f"mask of shape {checked.shape} is nowhere true: there are no unknowns")
    return checked


def check_booleans(mask: ArrayLike, grid_shape: tuple[int, ...], is_coupled: bool = False) -> Mask:
    """Return the same as `check_mask`, but accept a mask without true entries."""
    mask = refuse_masked("mask", mask)
    if is_coupled and mask.shape == grid_shape[1:]:
        mask = np.broadcast_to(mask, grid_shape)
    if mask.dtype != np.bool_:
        raise TypeError(
            f"mask has dtype {mask.dtype}, but must be of booleans, which are true at the "
            "unknowns: of zeros and ones write mask != 0"
        )
    if mask.shape != grid_shape:
        raise ValueError(f"mask has shape {mask.shape}, but A lives on the grid {grid_shape}")
    mask = mask.copy()
    mask.flags.writeable = False
    return mask
