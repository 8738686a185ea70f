"""Rectangular Toeplitz matrices of any number of axes, and matrices of normal equations."""

from math import prod
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.arrays.library import NUMPY, library_of
from toeplitz_mg.operators.base import GridOperator, MatrixOperator
from toeplitz_mg.operators.coefficients import Coefficients, check_coefficients
from toeplitz_mg.operators.sums import constant_of
from toeplitz_mg.values import count, refuse_masked

Shape = tuple[int, ...]


class RectangularToeplitz(MatrixOperator):
    """A rectangular Toeplitz matrix of one or several axes, multiplied by FFT.

    Made by ``ToeplitzOperator(c, r)`` with a first column and row of different lengths, and by
    `ToeplitzOperator.from_lags` and `ToeplitzOperator.convolution`.

    Attributes
    ----------
    rows, columns : tuple of int
        The grids of the products and of the vectors, flattened in C order; on one axis (m,) and
        (n,).
    lags : ndarray of shape (m1 + n1 - 1, m2 + n2 - 1, ...)
        The coefficients a[i - j], starting with the lag 1 - n.
    dtype : dtype
        As for `ToeplitzOperator`.

    See Also
    --------
    ToeplitzOperator : square Toeplitz matrices.
    toeplitz_lstsq : least squares.

    Notes
    -----
    The matrix is a part of a square one with max(m, n) points along each axis: vectors are extended
    by zeros, multiplied, and cut. Small matrices are multiplied as dense ones.

    The preconditioners of this package also take ``A.H @ A`` and ``A.H @ A + s *
    scipy.sparse.eye_array(n)``: they use the Toeplitz matrix that equals the product or is close to
    it.

    Examples
    --------
    >>> import toeplitz_mg as tmg
    >>> A = tmg.ToeplitzOperator([1.0, 2.0, 3.0], [1.0, 5.0])
    >>> A.toarray()
    array([[1., 5.],
           [2., 1.],
           [3., 2.]])
    >>> (A.T @ [1.0, 0.0, 0.0]).round(12)
    array([1., 5.])
    """

    is_symmetric = is_hermitian = is_even = False

    def __init__(self, square: Coefficients, rows: Shape, columns: Shape, product: Any = None):
        self._square, self.rows, self.columns = square, rows, columns
        self._product = product or square.library.multiplication(square.squeezed)
        super().__init__(square.dtype, square.grid_shape, 1.0, library=square.library)
        self.shape = prod(rows), prod(columns)
        is_small = self.library is NUMPY and max(self.shape) <= NUMPY.dense
        self._dense = np.ascontiguousarray(self.toarray().T) if is_small else None

    @property
    def lags(self) -> Array:
        """The coefficients a[i - j], starting with the lag 1 - n."""
        parts = zip(self.grid_shape, self.rows, self.columns, strict=True)
        return self._square.lags[tuple(slice(N - n, N - 1 + m) for N, m, n in parts)]

    @property
    def norm_bound(self) -> float:
        """An upper bound of the 2-norm: that of the embedding circulant."""
        return float(self._product.norm_bound)

    def toarray(self) -> Array:
        """Return the matrix as a dense array, without any transform."""
        return self.entries(*map(np.arange, self.shape))

    def entries(self, rows: Array, columns: Array) -> Array:
        """Return the entries in these rows and columns, positions in the flattened grids."""
        points = (
            np.unravel_index(refuse_masked(name, index), grid)
            for name, index, grid in (
                ("rows", rows, self.rows),
                ("columns", columns, self.columns),
            )
        )
        return self._square.at(list(map(np.subtract.outer, *points)))

    def diagonal(self) -> Array:
        """Return the entries (i, i)."""
        index = np.arange(min(self.shape))
        i, j = (np.array(np.unravel_index(index, grid)) for grid in (self.rows, self.columns))
        return self._square.at(list(i - j))

    def apply(self, X: Array, out: Array | None = None) -> Array:
        """Multiply each row of `X` (see `GridOperator.apply`)."""
        if self._dense is not None:
            Y = X @ self._dense
            if out is None:
                return Y
            out[...] = Y
            return out
        library, xp, k = self.library, self.library.xp, prod(X.shape[:-1])
        grid = library.pad(xp.reshape(X, (k, *self.columns)), self.grid_shape)
        Y = xp.reshape(self._product(xp.reshape(grid, (k, -1)), None), grid.shape)
        index: Any = (..., *map(slice, self.rows))
        Y = xp.reshape(Y[index], (*X.shape[:-1], self.shape[0]))
        if out is None:
            return library.copy(Y)
        out[...] = Y
        return out

    def scaled(self, left: Any = None, right: Any = None) -> Any:
        """Return multiples of the matrix (see `GridOperator.scaled`)."""
        factor = factor_of(left, right)
        return NotImplemented if factor is None else self._of(self._square.times(factor))

    def plus(self, other: Any) -> Any:
        """Return the sum with a matrix on the same grids (see `GridOperator.plus`)."""
        if isinstance(other, RectangularToeplitz) and grids_of(other) == grids_of(self):
            return self._of(self._square.plus(other._square))
        return NotImplemented

    def composed(self, other: Any) -> Any:
        """Return the product with a matrix (see `GridOperator.composed`)."""
        return normal_matrix(self, other)

    def _of(self, square: Coefficients) -> "RectangularToeplitz":
        return RectangularToeplitz(square, self.rows, self.columns)

    def _cast(self, dtype: np.dtype[Any]) -> "RectangularToeplitz":
        return self._of(self._square.astype(dtype))

    def _adjoint(self) -> "RectangularToeplitz":
        square = self._square.transpose.conjugate
        return RectangularToeplitz(square, self.columns, self.rows, self._product.adjoint())

    def _transposed(self) -> "RectangularToeplitz":
        return RectangularToeplitz(self._square.transpose, self.columns, self.rows)

    def __repr__(self) -> str:
        rows, columns = (" x ".join(map(str, grid)) for grid in (self.rows, self.columns))
        return f"<RectangularToeplitz from {columns} to {rows}, {self.dtype}>"


class NormalMatrix(GridOperator):
    """The matrix w AᴴA + s I of normal equations, for a rectangular or square Toeplitz matrix A.

    Made by ``A.H @ A``, multiples of it by positive numbers, and sums with multiples of the unit
    matrix. It multiplies by A and by Aᴴ. The preconditioners of this package use the Toeplitz
    matrix with the coefficients `lags` instead.

    Attributes
    ----------
    A : ToeplitzOperator or RectangularToeplitz
    weight, shift : float
        The numbers w and s.
    """

    is_hermitian = True

    def __init__(self, A: Any, weight: float = 1.0, shift: float = 0.0) -> None:
        self.A, self._adjoint_of_A, self.weight, self.shift = A, A.H, weight, shift
        super().__init__(A.dtype, grids_of(A)[1], 2.0 * A.work, library=A.library)
        self.is_symmetric = A.dtype.kind != "c"

    @property
    def lags(self) -> Array:
        """The coefficients of the Toeplitz matrix w FᴴF + s I, with lag zero in the centre.

        F extends A by all rows above and below in which A has coefficients. So it is AᴴA itself if
        A already has all these rows, as a full convolution does.
        """
        library, a, grid = self.library, self.A.lags, self.grid_shape
        fft, xp = library.fft, library.xp
        spectrum = fft.fftn(library.cast_numbers(a, np.complex128), [2 * k for k in a.shape])
        lags = library.to_numpy(fft.ifftn(xp.abs(spectrum) ** 2))
        lags = lags[np.ix_(*(np.arange(1 - n, n) for n in grid))]
        lags = (lags + lags.conj()[(slice(None, None, -1),) * lags.ndim]) * (self.weight / 2)
        lags[tuple(n - 1 for n in grid)] += self.shift
        lags = lags if self.dtype.kind == "c" else lags.real
        return library.from_numpy(np.ascontiguousarray(lags.astype(self.dtype)))

    @property
    def is_toeplitz(self) -> bool:
        """Whether the matrix equals the Toeplitz matrix of `lags`: A has all nonzero rows."""
        is_there, grids = self.A.lags != 0, zip(*grids_of(self.A), strict=True)
        inside = is_there[tuple(slice(n - 1, max(m, n - 1)) for m, n in grids)]
        return int(self.library.xp.sum(is_there)) == int(self.library.xp.sum(inside))

    @property
    def norm_bound(self) -> float:
        """An upper bound of the 2-norm."""
        return self.weight * float(self.A.norm_bound) ** 2 + self.shift

    def apply(self, X: Array, out: Array | None = None) -> Array:
        """Multiply each row of `X` (see `GridOperator.apply`)."""
        Y = self._adjoint_of_A.apply(self.A.apply(X))
        if self.weight != 1.0:
            Y *= self.weight
        if self.shift:
            Y += self.shift * X
        if out is None:
            return Y
        out[...] = Y
        return out

    def scaled(self, left: Any = None, right: Any = None) -> Any:
        """Return multiples by positive numbers (see `GridOperator.scaled`)."""
        factor = factor_of(left, right)
        if factor is None or not (np.imag(factor) == 0.0 and np.real(factor) > 0.0):
            return NotImplemented
        factor = float(np.real(factor))
        return NormalMatrix(self.A, factor * self.weight, factor * self.shift)

    def plus(self, other: Any) -> Any:
        """Return the sum with a multiple of the unit matrix (see `GridOperator.plus`)."""
        if isinstance(other, np.ndarray) and other.dtype.kind != "c" and (other == other[0]).all():
            return NormalMatrix(self.A, self.weight, self.shift + float(other[0]))
        return NotImplemented

    def __repr__(self) -> str:
        grid = " x ".join(map(str, self.grid_shape))
        return f"<NormalMatrix AᴴA + {self.shift:.3g} I, {grid}, {self.dtype}>"


def grids_of(A: Any) -> tuple[Shape, Shape]:
    """Return the grids of the products (rows) and of the vectors (columns) of a matrix."""
    return getattr(A, "rows", A.grid_shape), getattr(A, "columns", A.grid_shape)


def normal_matrix(B: Any, A: Any) -> Any:
    """Return B A as a NormalMatrix if B is the adjoint of the Toeplitz matrix A."""
    is_toeplitz = isinstance(A, GridOperator) and hasattr(A, "lags") and hasattr(A, "entries")
    if not is_toeplitz or B.library is not A.library or grids_of(B) != grids_of(A)[::-1]:
        return NotImplemented
    xp = A.library.xp
    if xp.any(B.lags != A.library.conj(xp.flip(A.lags))):
        return NotImplemented
    return NormalMatrix(A)


def of_column_and_row(c: ArrayLike, r: ArrayLike) -> RectangularToeplitz | None:
    """Return the matrix with this first column and row; None if it is square."""
    column, row = check_coefficients(c, "c"), check_coefficients(r, "r")
    if column.ndim != 1 or row.ndim != 1 or column.shape == row.shape:
        return None
    library_of(column).read("r", row)
    lags = library_of(column).xp.concat([library_of(column).xp.flip(row[1:]), column])
    return of_lags(lags, column.shape, row.shape)


def read_grids(shape: Any) -> tuple[Shape, Shape]:
    """Return the grids of the rows and of the columns for a `shape` argument."""
    try:
        rows, columns = ((n,) if np.ndim(n) == 0 else tuple(n) for n in shape)
    except (TypeError, ValueError):
        raise TypeError(
            f"shape is {shape!r}, but must be (m, n), or for several axes "
            "((m1, m2, ...), (n1, n2, ...))"
        ) from None
    rows, columns = (tuple(count("shape", n) for n in grid) for grid in (rows, columns))
    if len(rows) != len(columns):
        raise ValueError(f"shape is {shape!r}, but must have as many axes for rows as for columns")
    return rows, columns


def of_lags(lags: ArrayLike, rows: Shape, columns: Shape) -> RectangularToeplitz:
    """Return the matrix with these coefficients, starting with the lag 1 - n."""
    array = check_coefficients(lags, "lags")
    wanted = tuple(m + n - 1 for m, n in zip(rows, columns, strict=True))
    if tuple(array.shape) != wanted:
        raise ValueError(
            f"lags has shape {tuple(array.shape)}, but must have {wanted}, m + n - 1 along each "
            f"axis, for rows on the grid {rows} and columns on {columns}"
        )
    side = tuple(map(max, rows, columns))
    start = tuple(n - N for N, n in zip(side, columns, strict=True))  # The first lag is 1 - N.
    square = _window(array, start, tuple(2 * N - 1 for N in side))
    return RectangularToeplitz(Coefficients(square, False), rows, columns)


def convolution(
    h: ArrayLike, shape: Any, mode: Literal["full", "same", "valid"]
) -> tuple[Array, tuple[Shape, Shape]]:
    """Return the lags and the grids of the convolution of fields of this shape with h."""
    kernel = check_coefficients(h, "h")
    columns = read_grids((shape, shape))[1]
    if len(columns) != kernel.ndim:
        raise ValueError(f"shape is {shape}, but must have the {kernel.ndim} axes of h")
    pairs = list(zip(columns, kernel.shape, strict=True))
    if mode not in ("full", "same", "valid"):
        raise ValueError(f"mode is {mode!r}, but must be 'full', 'same' or 'valid'")
    if mode == "full":
        rows, first = [n + p - 1 for n, p in pairs], [0] * kernel.ndim
    elif mode == "same":
        rows, first = list(columns), [(p - 1) // 2 for p in kernel.shape]
    else:
        rows, first = [n - p + 1 for n, p in pairs], [p - 1 for p in kernel.shape]
    if min(rows) < 1:
        raise ValueError(
            f"h has shape {tuple(kernel.shape)}, but with mode='valid' must be no larger than the "
            f"fields, of shape {columns}"
        )
    # Row i is Σ x[j] h[i - j + first]; the first lag is 1 - n.
    start = tuple(k - (n - 1) for k, n in zip(first, columns, strict=True))
    shape_of_lags = tuple(m + n - 1 for m, n in zip(rows, columns, strict=True))
    return _window(kernel, start, shape_of_lags), (tuple(rows), columns)


def _window(array: Array, start: tuple[int, ...], shape: Shape) -> Array:
    """Return a window of an array that continues with zeros; it may start before the array."""
    library = library_of(array)
    begin = [max(k, 0) for k in start]
    ends = [max(k + n, lo) for k, n, lo in zip(start, shape, begin, strict=True)]
    part = array[tuple(map(slice, begin, ends))]
    shifts = tuple(lo - k for lo, k in zip(begin, start, strict=True))
    return library.xp.roll(library.pad(part, shape), shifts, axis=tuple(range(len(shape))))


def factor_of(left: Any, right: Any) -> Any:
    """Return the product of two factors (None counts as 1); None if one is not a constant."""
    factor: Any = 1.0
    for given in (left, right):
        constant = 1.0 if given is None else constant_of(given)
        if constant is None:
            return None
        factor = factor * constant
    return factor
