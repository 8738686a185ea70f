"""Hankel matrices of any number of axes: their entries depend on i + j."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.arrays.library import library_of
from toeplitz_mg.operators.base import MatrixOperator
from toeplitz_mg.operators.coefficients import check_coefficients
from toeplitz_mg.operators.rectangular import (
    RectangularToeplitz,
    factor_of,
    grids_of,
    of_lags,
    read_grids,
)


class HankelOperator(MatrixOperator):
    """A Hankel matrix, whose entry in row i and column j is h[i + j], that multiplies by FFT.

    It is a Toeplitz matrix times the reversal of a vector. Trajectory matrices of time series are
    Hankel matrices; ``T + H`` with a Toeplitz matrix T is an operator too.

    Parameters
    ----------
    c : array_like of shape (m,)
        First column, real or complex.
    r : array_like of shape (n,), optional
        Last row, zero by default; its first entry is ignored, as in `scipy.linalg.hankel`. For
        several axes, or all of h at once, use `from_values`.

    Attributes
    ----------
    rows, columns : tuple of int
        The grids of the products and of the vectors, flattened in C order.
    values : ndarray of shape (m1 + n1 - 1, m2 + n2 - 1, ...)
        h.
    is_symmetric, is_hermitian : bool

    Raises
    ------
    TypeError, ValueError
        For coefficients that are not numbers, not finite, or so large or so small that products
        over- or underflow (see `ToeplitzOperator`).

    See Also
    --------
    ToeplitzOperator : entries that depend on i - j.
    scipy.linalg.hankel : the dense matrix.

    Examples
    --------
    >>> from toeplitz_mg import HankelOperator
    >>> H = HankelOperator([1.0, 2.0, 3.0], [3.0, 4.0])
    >>> H.toarray()
    array([[1., 2.],
           [2., 3.],
           [3., 4.]])
    >>> (H @ [1.0, 0.0]).round(12)
    array([1., 2., 3.])
    """

    def __init__(self, c: ArrayLike, r: ArrayLike | None = None) -> None:
        column = check_coefficients(c, "c")
        xp = library_of(column).xp
        row = xp.zeros_like(column) if r is None else check_coefficients(r, "r")
        if column.ndim != 1 or row.ndim != 1:
            raise ValueError(
                f"c and r have shapes {tuple(column.shape)} and {tuple(row.shape)}, but must have "
                "one axis: for several use HankelOperator.from_values"
            )
        self._begin(of_lags(xp.concat([column, row[1:]]), column.shape, row.shape))

    @classmethod
    def from_values(cls, values: ArrayLike, shape: Any) -> "HankelOperator":
        """Return the matrix with the entries h[i + j].

        Parameters
        ----------
        values : array_like of shape (m1 + n1 - 1, m2 + n2 - 1, ...)
            h. For a time series the rows of the matrix are its windows.
        shape : tuple
            (m, n), or for several axes ((m1, m2, ...), (n1, n2, ...)).

        Raises
        ------
        TypeError, ValueError
            As for the class; also if the shape of `values` does not fit `shape`.

        Examples
        --------
        >>> from toeplitz_mg import HankelOperator
        >>> HankelOperator.from_values([1.0, 2.0, 3.0, 4.0], (2, 3)).toarray()
        array([[1., 2., 3.],
               [2., 3., 4.]])
        """
        return cls._of(of_lags(values, *read_grids(shape)))

    @classmethod
    def _of(cls, A: RectangularToeplitz) -> "HankelOperator":
        H = cls.__new__(cls)
        H._begin(A)
        return H

    def _begin(self, A: RectangularToeplitz) -> None:
        """Initialise from the Toeplitz matrix with the columns reversed along each axis."""
        self._toeplitz, self.rows, self.columns = A, A.rows, A.columns
        super().__init__(A.dtype, A.grid_shape, A.work, library=A.library)
        self.shape = A.shape
        self.is_symmetric = self.rows == self.columns
        is_real = A.dtype.kind != "c" or not bool(A.library.xp.any(A.lags.imag != 0))
        self.is_hermitian = self.is_symmetric and is_real

    @property
    def values(self) -> Array:
        """All h[i + j], shape (m1 + n1 - 1, ...)."""
        return self._toeplitz.lags

    @property
    def norm_bound(self) -> float:
        """An upper bound of the 2-norm."""
        return self._toeplitz.norm_bound

    def toarray(self) -> Array:
        """Return the matrix as a dense array, without any transform."""
        return self.entries(*map(np.arange, self.shape))

    def entries(self, rows: Array, columns: Array) -> Array:
        """Return the entries in these rows and columns, positions in the flattened grids."""
        # In C order the last point of a grid is the first one of the reversed grid.
        return self._toeplitz.entries(rows, self.shape[1] - 1 - np.asarray(columns))

    def diagonal(self) -> Array:
        """Return the entries (i, i)."""
        index = np.arange(min(self.shape))
        points = zip(*(np.unravel_index(index, grid) for grid in grids_of(self)), strict=True)
        values = self.library.to_numpy(self.values)
        return values[tuple(i + j for i, j in points)]

    def apply(self, X: Array, out: Array | None = None) -> Array:
        """Multiply each row of `X` (see `GridOperator.apply`)."""
        return self._toeplitz.apply(self.library.xp.flip(X, axis=-1), out)

    def scaled(self, left: Any = None, right: Any = None) -> Any:
        """Return multiples of the matrix (see `GridOperator.scaled`)."""
        factor = factor_of(left, right)
        return NotImplemented if factor is None else self._of(self._toeplitz.scaled(factor))

    def plus(self, other: Any) -> Any:
        """Return the sum with a matrix on the same grids (see `GridOperator.plus`)."""
        if isinstance(other, HankelOperator) and grids_of(other) == grids_of(self):
            return self._of(self._toeplitz.plus(other._toeplitz))
        return NotImplemented

    def _cast(self, dtype: np.dtype[Any]) -> "HankelOperator":
        return self._of(self._toeplitz.astype(dtype))

    def _adjoint(self) -> "HankelOperator":
        if self.is_hermitian:
            return self
        values = self.library.conj(self.values)
        return self._of(of_lags(values, self.columns, self.rows))

    def _transposed(self) -> "HankelOperator":
        return self._of(of_lags(self.values, self.columns, self.rows))

    def __repr__(self) -> str:
        rows, columns = (" x ".join(map(str, grid)) for grid in (self.rows, self.columns))
        return f"<HankelOperator from {columns} to {rows}, {self.dtype}>"
