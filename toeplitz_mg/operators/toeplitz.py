"""Toeplitz matrices of any number of levels, as linear operators."""

from math import prod
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg.operators.convolution import ToeplitzProduct
from toeplitz_mg.operators.multilevel import MultilevelProduct, entries
from toeplitz_mg.operators.rows import as_rows

Array = NDArray[Any]


class ToeplitzOperator(LinearOperator):
    """A real Toeplitz matrix, of one level or several, that multiplies by FFT.

    With two levels this is a block Toeplitz matrix with Toeplitz blocks (BTTB): its entry for
    the grid points i and j depends on i - j only.

    Parameters
    ----------
    c : array_like of shape (n,) or (n1, n2, ...)
        First column. With one dimension as in `scipy.linalg.toeplitz`; with d dimensions the
        first column of a d-level matrix that is symmetric in every level.
    r : array_like of shape (n,), optional
        First row of a matrix that is not symmetric; its first entry is ignored, as in
        `scipy.linalg.toeplitz`. For several levels use `from_lags`.

    Attributes
    ----------
    grid_shape : tuple of int
        (n,) or (n1, n2, ...); vectors are grids flattened in C order.
    lags : ndarray of shape (2 n1 - 1, 2 n2 - 1, ...)
        The coefficients a[i - j], lag zero in the centre.
    is_symmetric : bool
    is_even : bool
        Symmetric in every level, and so given by its first column `c` alone.
    dtype : dtype
        float32 for float32 coefficients, float64 otherwise. A float32 vector times a float32
        operator is float32; otherwise the product is as NumPy would promote it.

    Raises
    ------
    TypeError
        For coefficients that are not real numbers.
    ValueError
        For coefficients that are empty or not finite, and for `r` of another length than `c`.

    Notes
    -----
    A product is exact up to rounding: any embedding in a circulant of size at least 2 n - 1
    multiplies correctly; a fast transform length is taken. It costs O(N log N), and is the work
    unit of the paper (§5.2).

    Examples
    --------
    >>> import numpy as np
    >>> from toeplitz_mg import ToeplitzOperator
    >>> A = ToeplitzOperator([2.0, -1.0, 0.0])
    >>> A.toarray()
    array([[ 2., -1.,  0.],
           [-1.,  2., -1.],
           [ 0., -1.,  2.]])
    >>> (A @ np.array([1.0, 2.0, 3.0])).round(12) + 0.0
    array([0., 0., 4.])
    """

    def __init__(self, c: ArrayLike, r: ArrayLike | None = None) -> None:
        column = _coefficients(c, "c")
        if r is None:
            self._build(column, None)
        else:
            row = _coefficients(r, "r")
            if column.ndim > 1 or row.ndim > 1:
                raise ValueError(
                    f"c and r have shapes {column.shape} and {row.shape}, but a first row is for "
                    "one level; for several levels use ToeplitzOperator.from_lags"
                )
            if len(row) != len(column):
                raise ValueError(
                    f"c has {len(column)} entries and r has {len(row)}, but the matrix is square"
                )
            self._build(None, np.concatenate([row[:0:-1], column]))

    @classmethod
    def from_lags(cls, lags: ArrayLike) -> Self:
        """Build a matrix from all its coefficients.

        Parameters
        ----------
        lags : array_like of shape (2 n1 - 1, 2 n2 - 1, ...)
            a[i - j], lag zero in the centre; any real coefficients, symmetric or not.

        Raises
        ------
        TypeError, ValueError
            As the class; also where a length is even, so that there is no centre.

        Examples
        --------
        >>> from toeplitz_mg import ToeplitzOperator
        >>> ToeplitzOperator.from_lags([1.0, 2.0, 3.0]).toarray()
        array([[2., 1.],
               [3., 2.]])
        """
        array = _coefficients(lags, "lags")
        if not all(n % 2 for n in array.shape):
            raise ValueError(
                f"lags has shape {array.shape}, but each length must be 2 n - 1, which is odd"
            )
        operator = cls.__new__(cls)
        operator._build(None, array)
        return operator

    def _build(
        self,
        column: Array | None,
        lags: Array | None,
        product: ToeplitzProduct | MultilevelProduct | None = None,
    ) -> None:
        """Take the coefficients: the first column where they are even, or else all lags.

        With a product at hand no transform is made.
        """
        if column is None:
            assert lags is not None
            shape = tuple((length + 1) // 2 for length in lags.shape)
            if all(np.array_equal(lags, np.flip(lags, k)) for k in range(lags.ndim)):
                column = lags[_centre_on(shape)]
        else:
            shape = column.shape
        # A matrix that is symmetric in every level keeps its first column only.
        coefficients = lags if column is None else column
        assert coefficients is not None
        super().__init__(coefficients.dtype, (prod(shape), prod(shape)))
        self.grid_shape = shape
        self.is_even = column is not None
        self.is_symmetric = self.is_even or np.array_equal(coefficients, np.flip(coefficients))
        self._coefficients = coefficients.copy()
        self._coefficients.flags.writeable = False
        self._product = product or self._multiplication()

    def _multiplication(self) -> ToeplitzProduct | MultilevelProduct:
        levels = [n for n in self.grid_shape if n > 1]  # of the others no transform is made
        if len(levels) > 1:
            return MultilevelProduct([[self.lags.reshape([2 * n - 1 for n in levels])]], self.dtype)
        a = self._coefficients.ravel()
        n = self.shape[0]
        column, row = (a, a) if self.is_even else (a[n - 1 :], a[n - 1 :: -1])
        return ToeplitzProduct(column, row, self.dtype)

    @property
    def lags(self) -> Array:
        """The coefficients a[i - j], shape (2 n1 - 1, ...), lag zero in the centre."""
        return _mirrored(self._coefficients) if self.is_even else self._coefficients

    @property
    def c(self) -> Array:
        """The first column on the grid, shape `grid_shape`."""
        a = self._coefficients
        return a if self.is_even else a[_centre_on(self.grid_shape)]

    @property
    def squeezed(self) -> "ToeplitzOperator":
        """The same matrix without levels of one element, which have no lags; or itself."""
        a = self._coefficients
        levels = [m for m in a.shape if m > 1] or [1]
        if len(levels) == a.ndim:
            return self
        a = a.reshape(levels)
        column, lags = (a, None) if self.is_even else (None, a)
        squeezed = type(self).__new__(type(self))
        squeezed._build(column, lags, self._product)
        return squeezed

    @property
    def norm_bound(self) -> float:
        """A bound of the 2-norm: that of the matrix in which the products embed this one."""
        return self._product.norm_bound

    @property
    def symbol(self) -> Array | None:
        """The eigenvalues that a `MultilevelProduct` of this matrix needs, if at hand."""
        return self._product.symbol[0][0] if hasattr(self._product, "symbol") else None

    def circulant(self, shape: tuple[int, ...]) -> Array:
        """Return the first column of a circulant in which this matrix is the leading block.

        Parameters
        ----------
        shape : tuple of int
            Its size in each level, at least 2 n - 1. Lags that the matrix has not are zero.
        """
        lags = self.lags.astype(np.float64, copy=False)
        column = np.zeros(shape)
        column[tuple(slice(n) for n in lags.shape)] = lags
        levels = tuple(range(lags.ndim))
        return np.roll(column, [1 - n for n in self.grid_shape], levels)

    def astype(self, dtype: DTypeLike) -> "ToeplitzOperator":
        """Return the matrix in float32 or float64, or itself where it has that precision."""
        dtype = real_precision(dtype)
        if self.dtype == dtype:
            return self
        coefficients = _coefficients(self._coefficients.astype(dtype), "lags")
        column, lags = (coefficients, None) if self.is_even else (None, coefficients)
        other = type(self).__new__(type(self))
        is_less = dtype.itemsize < self.dtype.itemsize
        other._build(column, lags, self._product.astype(dtype) if is_less else None)
        return other

    def toarray(self) -> Array:
        """Return the matrix as a dense array of shape (N, N), without any transform."""
        return self.block(np.arange(self.shape[0]))

    def block(self, index: Array) -> Array:
        """Return some rows and the same columns as a dense array.

        Parameters
        ----------
        index : ndarray of int, of shape (k,)
            Unknowns, as positions in the flattened grid.

        Returns
        -------
        ndarray of shape (k, k)
        """
        return self.entries(index, index)

    def entries(self, rows: Array, columns: Array) -> Array:
        """Return the entries in some rows and columns, positions in the flattened grid."""
        points = (np.unravel_index(index, self.grid_shape) for index in (rows, columns))
        return entries(self.lags, *points)

    def _apply(self, X: Array, out: Array | None = None) -> Array:
        return self._product(X, out)

    def _matvec(self, x: Array) -> Array:
        return self._apply(as_rows(x, self.shape[1]))

    def _matmat(self, X: Array) -> Array:
        return self._apply(X.mT).mT

    def _adjoint(self) -> "ToeplitzOperator":
        if self.is_symmetric:
            return self
        adjoint = type(self).__new__(type(self))
        adjoint._build(None, np.flip(self.lags), self._product.adjoint())
        return adjoint

    def _transpose(self) -> "ToeplitzOperator":
        return self._adjoint()

    def __repr__(self) -> str:
        grid = " x ".join(map(str, self.grid_shape))
        kind = "symmetric" if self.is_symmetric else "general"
        return f"<ToeplitzOperator {grid}, {kind}, {self.dtype}>"


def real_precision(dtype: DTypeLike) -> np.dtype[Any]:
    """Return `dtype` as one of the two that the operators have, or say that it is none."""
    try:
        result = np.dtype(dtype)
    except TypeError:
        raise TypeError(f"dtype is {dtype!r}, but must be float32 or float64") from None
    if result not in (np.float32, np.float64):
        raise TypeError(f"dtype is {result}, but must be float32 or float64")
    return result


def _coefficients(values: ArrayLike, name: str) -> Array:
    """Return `values` as a float array, or say what is wrong with them."""
    array = np.asarray(values)
    if array.dtype.kind not in "buif":
        raise TypeError(f"{name} has dtype {array.dtype}, but coefficients are real numbers")
    if array.dtype not in (np.float32, np.float64):
        array = array.astype(np.float64)
    if array.ndim == 0 or array.size == 0:
        raise ValueError(f"{name} has shape {array.shape}, but needs at least one coefficient")
    if not np.isfinite(array).all():
        where = np.argwhere(~np.isfinite(array))[0]
        at = tuple(int(k) for k in where)
        raise ValueError(f"{name} has the coefficient {array[at]} at {at}, but all must be finite")
    return array


def _mirrored(column: Array) -> Array:
    """Return all lags of the matrix that is symmetric in every level."""
    for level, n in enumerate(column.shape):
        column = np.take(column, np.abs(np.arange(1 - n, n)), axis=level)
    return column


def _centre_on(grid_shape: tuple[int, ...]) -> tuple[slice, ...]:
    """The lags 0 ... n - 1 of every level."""
    return tuple(slice(n - 1, None) for n in grid_shape)
