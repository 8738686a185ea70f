"""Toeplitz matrices of any number of axes, as linear operators."""

import warnings
from math import prod
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.multilevel import MultilevelProduct
from toeplitz_mg.operators.base import GridOperator, MatrixOperator
from toeplitz_mg.operators.coefficients import Coefficients, name_dense
from toeplitz_mg.operators.rectangular import (
    convolution,
    normal_matrix,
    of_column_and_row,
    of_lags,
    read_grids,
)
from toeplitz_mg.operators.sums import Term, ToeplitzSum, simplify
from toeplitz_mg.values import refuse_masked


class ToeplitzOperator(MatrixOperator):
    """A real or complex Toeplitz matrix of one or several axes, multiplied by FFT.

    The entry for the grid points i and j depends on i - j only. On a grid of two axes this is a
    block Toeplitz matrix with Toeplitz blocks (BTTB).

    Parameters
    ----------
    c : array_like of shape (n,) or (n1, n2, ...)
        First column. On one axis as in `scipy.linalg.toeplitz`: without `r` the first row is the
        conjugate of `c`, so the matrix is symmetric if `c` is real, and Hermitian if `c` is complex
        with a real ``c[0]``. On several axes `c` is the first column, as a grid, of a real matrix
        that is symmetric along each axis.
    r : array_like of shape (n,), optional
        First row, on one axis; its first entry is ignored, as in `scipy.linalg.toeplitz`. If its
        length differs from that of `c`, the matrix is rectangular, a `RectangularToeplitz`. For
        several axes use `from_lags`.

    Attributes
    ----------
    grid_shape : tuple of int
        (n,) or (n1, n2, ...); vectors are grids flattened in C order.
    lags : ndarray of shape (2 n1 - 1, 2 n2 - 1, ...)
        The coefficients a[i - j], lag zero in the centre.
    is_symmetric : bool
        Equal to its transpose ``A.T``.
    is_hermitian : bool
        Equal to its conjugate transpose ``A.H``. For a real matrix this is the same.
    is_even : bool
        Symmetric along each axis, and so determined by its first column `c`.
    dtype : dtype
        float32 or complex64 for coefficients in that precision, otherwise float64 or complex128. A
        float32 vector times a float32 operator is float32; otherwise the product has the dtype to
        which NumPy promotes it, and the accuracy of the operator.

    Raises
    ------
    TypeError
        If the coefficients are not numbers.
    ValueError
        If coefficients are missing or not finite, or so large or small that products over- or
        underflow (for a million unknowns above some 1e305 or below 1e-302 in double precision,
        above 1e36 or below 1e-32 in single). Also for a complex `c` of several axes, which does not
        determine the matrix.

    Warns
    -----
    UserWarning
        If `c` looks like a dense Toeplitz matrix: square, constant along its diagonals but not
        everywhere. It is taken for the first column of a matrix of two axes.

    See Also
    --------
    MaskedOperator : the restriction to a part of the grid.
    CoupledOperator : a matrix with Toeplitz blocks.
    RectangularToeplitz : a Toeplitz matrix that is not square.
    toeplitz_lstsq : least squares.
    ToeplitzSum : sums and products with diagonal matrices.
    scipy.linalg.toeplitz : the dense matrix, on one axis.

    Notes
    -----
    A product costs O(N log N) operations, the work unit of the paper (§5.2), and is exact up to
    rounding: the matrix is embedded in a circulant of a fast transform length of at least 2 n - 1.

    If the coefficients are symmetric (or Hermitian) up to 8 eps of the largest, as autocorrelations
    computed by FFT are, they are made exactly so by averaging.

    Operators support the operations of matrices: ``2 * A``, ``A + B`` and ``A + s * eye_array(n)``,
    with `scipy.sparse.eye_array`, are Toeplitz matrices again. With a diagonal matrix D made by
    `scipy.sparse.diags_array`, ``A + D`` and ``D @ A`` are a `ToeplitzSum`, which every
    preconditioner takes. ``A[i, j]`` (also with slices), ``A.diagonal()`` and ``A.trace()`` return
    the entries of the dense matrix.

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
    >>> (A - A.T / 2)[0, :2]
    array([ 1. , -0.5])
    """

    _is_toeplitz = True

    def __new__(cls, c: Any = None, r: Any = None, **kwargs: Any) -> Any:
        """Return a `RectangularToeplitz` if `c` and `r` have different lengths."""
        made = None
        if r is not None and not isinstance(c, Coefficients):
            made = of_column_and_row(c, r)
        return super().__new__(cls) if made is None else made

    def __init__(
        self,
        c: ArrayLike | Coefficients,
        r: ArrayLike | None = None,
        *,
        product: Any = None,
    ) -> None:
        if isinstance(c, Coefficients):
            self._coefficients = c
        elif r is None:
            self._coefficients = Coefficients.of_column(c)
            warn_of_dense(self._coefficients.array, stacklevel=3)
        else:
            self._coefficients = Coefficients.of_column_and_row(c, r)
        a = self._coefficients
        self._product = product or a.library.multiplication(a.squeezed)
        work = 1.0 if product is None else product.points / prod(a.grid_shape)
        super().__init__(a.dtype, a.grid_shape, work, library=a.library)
        self.is_even = a.is_even
        self.is_symmetric, self.is_hermitian = a.is_symmetric, a.is_hermitian

    @classmethod
    def from_lags(cls, lags: ArrayLike, shape: Any = None) -> Any:
        """Return the matrix with all these coefficients.

        Parameters
        ----------
        lags : array_like of shape (2 n1 - 1, 2 n2 - 1, ...)
            a[i - j], with lag zero in the centre; real or complex, symmetric or not.
        shape : tuple, optional
            For a rectangular matrix the grids of its rows and columns: (m, n) on one axis,
            ((m1, m2, ...), (n1, n2, ...)) on several. Then `lags` has the shape
            (m1 + n1 - 1, m2 + n2 - 1, ...) and starts with the lag 1 - n.

        Raises
        ------
        TypeError, ValueError
            If the class refuses the coefficients, a length is even (it has no centre), or the
            shape of `lags` does not fit `shape`.

        Examples
        --------
        >>> from toeplitz_mg import ToeplitzOperator
        >>> ToeplitzOperator.from_lags([1.0, 2.0, 3.0]).toarray()
        array([[2., 1.],
               [3., 2.]])
        >>> ToeplitzOperator.from_lags([1.0, 2.0, 3.0], (1, 3)).toarray()
        array([[3., 2., 1.]])
        """
        if shape is not None:
            rows, columns = read_grids(shape)
            if rows != columns:
                return of_lags(lags, rows, columns)
        return cls(Coefficients.of_lags(lags))

    @classmethod
    def convolution(
        cls, h: ArrayLike, shape: Any, mode: Literal["full", "same", "valid"] = "full"
    ) -> Any:
        """Return the matrix that convolves fields with a kernel, like `scipy.signal.convolve`.

        Parameters
        ----------
        h : array_like of shape (p,) or (p1, p2, ...)
            The kernel.
        shape : int or tuple of int
            The shape of the fields.
        mode : {"full", "same", "valid"}
            Which points of the convolution are returned, as in `scipy.signal.convolve`: all, as
            many as the field has, or those where the kernel lies within the field.

        Returns
        -------
        RectangularToeplitz, or ToeplitzOperator with "same"

        Raises
        ------
        TypeError, ValueError
            If the class refuses the coefficients, the mode is unknown, the numbers of axes differ,
            or with "valid" the kernel is larger than the field.

        Examples
        --------
        >>> from toeplitz_mg import ToeplitzOperator
        >>> ToeplitzOperator.convolution([1.0, 2.0], 2).toarray()
        array([[1., 0.],
               [2., 1.],
               [0., 2.]])
        """
        return cls.from_lags(*convolution(h, shape, mode))

    @property
    def lags(self) -> Array:
        """The coefficients a[i - j], shape (2 n1 - 1, ...), with lag zero in the centre."""
        return self._coefficients.lags

    @property
    def c(self) -> Array:
        """The first column on the grid, shape `grid_shape`."""
        return self._coefficients.column

    @property
    def squeezed(self) -> "ToeplitzOperator":
        """The matrix without axes of length one, or itself if there are none."""
        squeezed = self._coefficients.squeezed
        if squeezed is self._coefficients:
            return self
        return ToeplitzOperator(squeezed, product=self._product)

    @property
    def norm_bound(self) -> float:
        """An upper bound of the 2-norm: that of the embedding circulant."""
        return self._product.norm_bound

    @property
    def embedding_spectrum(self) -> Array | None:
        """The eigenvalues that a `MultilevelProduct` on this grid needs, or None."""
        if self._coefficients.squeezed is not self._coefficients:
            return None
        if isinstance(self._product, MultilevelProduct) and self._product.spectrum:
            return self._product.spectrum[0][0]
        return None

    def circulant(self, shape: tuple[int, ...]) -> Array:
        """Return the first column of a circulant with this matrix as its leading block.

        Parameters
        ----------
        shape : tuple of int
            The size of the circulant along each axis, at least 2 n - 1. Lags that the matrix does
            not have are zero.
        """
        lags = self.lags
        library = self.library
        column = library.pad(library.cast(lags, np.result_type(self.dtype, np.float64)), shape)
        shifts = tuple(1 - n for n in self.grid_shape)
        return library.xp.roll(column, shifts, axis=tuple(range(lags.ndim)))

    def _cast(self, dtype: np.dtype[Any]) -> "ToeplitzOperator":
        is_less = dtype.itemsize < self.dtype.itemsize
        product = self._product.astype(dtype) if is_less else None
        return ToeplitzOperator(self._coefficients.astype(dtype), product=product)

    @property
    def diagonal_entry(self) -> Any:
        """The coefficient of lag zero."""
        return self._coefficients.library.to_numpy(self.c[(slice(1),) * self.c.ndim]).flat[0]

    @property
    def coefficients(self) -> Coefficients:
        """The coefficients, in their normal form."""
        return self._coefficients

    def block(self, index: Array) -> Array:
        """Return a principal submatrix as a dense array.

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
        """Return the entries in these rows and columns, positions in the flattened grid."""
        points = (
            np.unravel_index(refuse_masked(name, index), self.grid_shape)
            for name, index in (("rows", rows), ("columns", columns))
        )
        return self._coefficients.at(list(map(np.subtract.outer, *points)))

    def diagonal(self) -> Array:
        """Return the entries (i, i), shape (N,), which are all the same."""
        return np.full(self.shape[0], self.diagonal_entry)

    def scaled(self, left: Any = None, right: Any = None) -> Any:
        """Return L A R: a ToeplitzOperator for numbers (see `GridOperator.scaled`)."""
        return simplify([Term(left, self, right)])

    def times(self, factor: Any) -> "ToeplitzOperator":
        """Return the matrix times a number."""
        return ToeplitzOperator(self._coefficients.times(factor))

    def plus(self, other: Any) -> Any:
        """Return the sum: a ToeplitzOperator with one (see `GridOperator.plus`)."""
        if isinstance(other, np.ndarray):
            return simplify([Term(None, self, None)], other)
        if isinstance(other, GridOperator) and other.library is not self.library:
            raise TypeError(
                f"A has arrays of {self.library.name} ({self.library.device}), and the other "
                f"summand those of {other.library.name} ({other.library.device}), but both must "
                "have arrays of one library on one device"
            )
        if isinstance(other, ToeplitzSum):
            return other.plus(self)
        if isinstance(other, ToeplitzOperator) and other.grid_shape == self.grid_shape:
            return ToeplitzOperator(self._coefficients.plus(other._coefficients))
        return NotImplemented

    def plus_unit(self, factor: Any) -> "ToeplitzOperator":
        """Return the sum with a multiple of the unit matrix."""
        return ToeplitzOperator(self._coefficients.plus_unit(factor))

    def composed(self, other: Any) -> Any:
        """Return the product with a matrix (see `GridOperator.composed`)."""
        return normal_matrix(self, other)

    def equals(self, other: LinearOperator) -> bool:
        """Whether another operator is the same matrix."""
        return self is other or (
            isinstance(other, ToeplitzOperator)
            and self.library is other.library
            and self.lags.shape == other.lags.shape
            and bool(self.library.xp.all(self.lags == other.lags))
        )

    def apply(self, X: Array, out: Array | None = None) -> Array:
        """Multiply each row of `X` (see `GridOperator.apply`)."""
        return self._product(X, out)

    def _adjoint(self) -> "ToeplitzOperator":
        if self.is_hermitian:
            return self
        coefficients = self._coefficients.transpose.conjugate
        return ToeplitzOperator(coefficients, product=self._product.adjoint())

    def _transposed(self) -> "ToeplitzOperator":
        return ToeplitzOperator(self._coefficients.transpose)

    def __repr__(self) -> str:
        return f"<ToeplitzOperator {self._describe()}>"


def warn_of_dense(c: Array, stacklevel: int) -> None:
    """Issue a warning if the coefficients look like a dense Toeplitz matrix."""
    if dense := name_dense(c):
        n = c.shape[0]
        warnings.warn(
            f"c has shape {(n, n)} and is constant along its diagonals, as a dense Toeplitz matrix "
            "is, but is taken for the first column of a matrix of two axes and "
            f"{n**2} unknowns: for the dense matrix c itself use {dense}",
            stacklevel=stacklevel,
        )
