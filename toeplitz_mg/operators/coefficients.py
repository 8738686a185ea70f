"""The coefficients of a Toeplitz matrix: their normal form and their checks."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from math import prod
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike
from scipy.sparse import issparse

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.arrays.library import Library, library_of
from toeplitz_mg.engine.embedding import cut
from toeplitz_mg.engine.ranks import is_serial
from toeplitz_mg.values import is_foreign, is_traced

# Largest sum of a row, relative to the largest number of a precision: room for the products.
HEADROOM = 2.0**-8
ALIKE = 1e-12  # Entries of a dense matrix that differ by less, relative to the largest, are equal.
ROUNDING = 8.0  # Lags that differ from their mirror by less, in eps of the largest lag, are equal.


@dataclass(frozen=True)
class Coefficients:
    """The coefficients a[i - j] of a Toeplitz matrix, in their normal form.

    Parameters
    ----------
    array : ndarray
        The first column, shape (n1, n2, ...), if the coefficients are even in each axis; otherwise
        all of them, shape (2 n1 - 1, 2 n2 - 1, ...), with lag zero in the centre. Read-only.
    is_even : bool
    """

    array: Array
    is_even: bool

    def __post_init__(self) -> None:
        self.library.keep(self.array)

    @cached_property
    def library(self) -> Library:
        """The library of the array."""
        return library_of(self.array)

    @property
    def dtype(self) -> np.dtype[Any]:
        """NumPy's dtype of the coefficients."""
        return self.library.dtype(self.array)

    @classmethod
    def of_column(cls, c: ArrayLike) -> "Coefficients":
        """Read the first column of a Hermitian matrix; if real it is symmetric in each axis."""
        if isinstance(c, tuple) and len(c) == 2 and all(_is_line(a) for a in c):
            raise ValueError(
                "c is a tuple of two arrays of one axis, but must be one array: for a first column "
                "and a first row use ToeplitzOperator(c, r), for a grid of two rows np.array(c)"
            )
        column = check_coefficients(c, "c")
        xp = (library := library_of(column)).xp
        if library.dtype(column).kind != "c":
            return cls(xp.asarray(column, copy=True), True)
        if column.ndim > 1:
            advice = "for several axes use ToeplitzOperator.from_lags"
            if dense := name_dense(column):
                advice += f", and for the dense Toeplitz matrix that c looks like {dense}"
            raise ValueError(
                f"c is complex and has shape {column.shape}, but a first column determines a "
                f"Hermitian matrix on one axis only; {advice}"
            )
        return cls._normal(xp.concat([xp.conj(xp.flip(column[1:])), column]))

    @classmethod
    def of_column_and_row(cls, c: ArrayLike, r: ArrayLike) -> "Coefficients":
        """Read the first column and the first row of a matrix of one axis."""
        column, row = check_coefficients(c, "c"), check_coefficients(r, "r")
        library_of(column).read("r", row)
        xp = library_of(column).xp
        if column.ndim > 1 or row.ndim > 1:
            raise ValueError(
                f"c and r have shapes {column.shape} and {row.shape}, but must have one "
                "axis for a first row: for several axes use ToeplitzOperator.from_lags"
            )
        (n,), (m,) = column.shape, row.shape
        if n != m:
            raise ValueError(f"c has {n} entries and r has {m}, but must have as many here")
        return cls._normal(xp.concat([xp.flip(row[1:]), column]))

    @classmethod
    def of_lags(cls, lags: ArrayLike) -> "Coefficients":
        """Read all coefficients, with lag zero in the centre."""
        array = check_coefficients(lags, "lags")
        if not all(n % 2 for n in array.shape):
            raise ValueError(
                f"lags has shape {array.shape}, but each length must be 2 n - 1, which is odd"
            )
        return cls._normal(array)

    @classmethod
    def _normal(cls, lags: Array) -> "Coefficients":
        """Normalise all coefficients; average them with mirrored ones that differ by rounding."""
        library = library_of(lags)
        flip = library.xp.flip
        along_each = [partial(flip, axis=k) for k in range(lags.ndim)]
        lags, is_even = _symmetrise(library, lags, along_each)
        if not is_even and lags.ndim > 1:
            lags, _ = _symmetrise(library, lags, [flip])
        if library.dtype(lags).kind == "c":
            lags, _ = make_hermitian(lags)
        general = cls(lags[...], False)
        column = general.column if is_even else lags
        return cls(library.xp.asarray(column, copy=True), is_even)

    @property
    def grid_shape(self) -> tuple[int, ...]:
        """The number of points along each axis."""
        return self.array.shape if self.is_even else tuple((m + 1) // 2 for m in self.array.shape)

    @property
    def is_symmetric(self) -> bool:
        """Whether a[-k] = a[k]."""
        xp = self.library.xp
        return self.is_even or bool(xp.all(self.array == xp.flip(self.array)))

    @property
    def is_hermitian(self) -> bool:
        """Whether a[-k] is the complex conjugate of a[k]."""
        if self.dtype.kind != "c":
            return self.is_symmetric
        xp = self.library.xp
        conjugate = xp.conj(self.array)
        return bool(xp.all(self.array == (conjugate if self.is_even else xp.flip(conjugate))))

    @property
    def asymmetry(self) -> float:
        """The largest difference between a[-k] and conj(a[k]), over the largest coefficient.

        It is 0 if the matrix is Hermitian.
        """
        return _differs(self.library, self.lags, partial(_flip_conjugate, self.library))

    @property
    def column(self) -> Array:
        """The coefficients of the lags 0 … n - 1 along each axis."""
        if self.is_even:
            return self.array
        return self.array[tuple(slice(n - 1, None) for n in self.grid_shape)]

    @property
    def lags(self) -> Array:
        """All coefficients, with lag zero in the centre."""
        if not self.is_even:
            return self.array
        lags, xp = self.array, self.library.xp
        for axis in range(lags.ndim):
            behind = xp.flip(lags[cut(axis, 1)], axis=axis)
            lags = xp.concat([behind, lags], axis=axis)
        return lags

    @property
    def squeezed(self) -> "Coefficients":
        """The coefficients without axes of length one."""
        lengths = [m for m in self.array.shape if m > 1] or [1]
        if len(lengths) == self.array.ndim:
            return self
        return Coefficients(self.library.xp.reshape(self.array, tuple(lengths)), self.is_even)

    @property
    def transpose(self) -> "Coefficients":
        """The coefficients of the transpose."""
        return self if self.is_even else Coefficients(self.library.xp.flip(self.array), False)

    @property
    def conjugate(self) -> "Coefficients":
        """The coefficients of the complex conjugate."""
        is_real = self.dtype.kind != "c"
        return self if is_real else Coefficients(self.library.xp.conj(self.array), self.is_even)

    def at(self, lags: Sequence[Array]) -> Array:
        """Return the coefficients at these lags (one array for each axis) as a NumPy array."""
        array = self.library.to_numpy(self.array)
        if self.is_even:
            return array[tuple(map(np.abs, lags))]
        return array[tuple(k + m // 2 for k, m in zip(lags, array.shape, strict=True))]

    def times(self, factor: Any) -> "Coefficients":
        """Multiply with a number."""
        with np.errstate(over="ignore", invalid="ignore"):  # An overflow is refused below.
            return Coefficients(
                check_coefficients(self.array * self.library.number(factor), "lags"), self.is_even
            )

    def plus(self, other: "Coefficients") -> "Coefficients":
        """Add the coefficients of a matrix on the same grid."""
        with np.errstate(over="ignore"):
            if self.is_even and other.is_even:
                return Coefficients(check_coefficients(self.array + other.array, "lags"), True)
            return Coefficients.of_lags(self.lags + other.lags)

    def plus_unit(self, factor: Any) -> "Coefficients":
        """Add a multiple of the unit matrix."""
        column = np.zeros(self.grid_shape, np.result_type(factor))
        column.flat[0] = factor
        return self.plus(Coefficients(self.library.from_numpy(column), True))

    def astype(self, dtype: np.dtype[Any]) -> "Coefficients":
        """Round to this precision, or raise an error if that overflows."""
        array = self.library.cast(self.array, dtype)
        return Coefficients(check_coefficients(array, "lags"), self.is_even)


def make_hermitian(lags: Array) -> tuple[Array, bool]:
    """Return coefficients, averaged to be exactly Hermitian if they are so up to rounding.

    The second result is True then. Otherwise they are returned unchanged, with False.
    """
    library = library_of(lags)
    return _symmetrise(library, lags, [partial(_flip_conjugate, library)])


def _flip_conjugate(library: Library, lags: Array) -> Array:
    """Return the coefficients of the conjugate transpose."""
    return library.conj(library.xp.flip(lags))


def _differs(library: Library, lags: Array, mirror: Callable[[Array], Array]) -> float:
    """Return the largest difference of coefficients and their mirror, relative to the largest."""
    xp, mirrored = library.xp, mirror(lags)
    if xp.all(lags == mirrored):
        return 0.0
    return float(xp.max(xp.abs(lags - mirrored))) / float(xp.max(xp.abs(lags)))


def _symmetrise(
    library: Library, lags: Array, mirrors: Sequence[Callable[[Array], Array]]
) -> tuple[Array, bool]:
    """Return coefficients averaged with their mirrors, and whether they agree up to rounding.

    If they do not agree with a mirror, they are returned unchanged.
    """
    rounding = ROUNDING * float(np.finfo(library.dtype(lags)).eps)
    differences = [_differs(library, lags, mirror) for mirror in mirrors]
    if max(differences) > rounding:
        return lags, False
    for mirror, difference in zip(mirrors, differences, strict=True):
        if difference:
            lags = (lags + mirror(lags)) / 2
    return lags, True


def _is_line(a: Any) -> bool:
    """Whether this is an array with one axis, or a list of numbers."""
    return getattr(a, "ndim", 0) == 1 or (isinstance(a, list) and np.ndim(a) == 1)


def name_dense(c: Array) -> str:
    """Return the call to recommend if `c` looks like a dense Toeplitz matrix, or an empty string.

    It does if it has two rows or more and constant diagonals up to rounding. As the first column of
    a matrix of two axes, the coefficient of the lag (1, 1) would be as large as that of lag zero,
    so that the matrix is not positive definite. A constant array may be either.
    """
    if c.ndim != 2 or not c.shape[0] == c.shape[1] > 1:
        return ""
    library = library_of(c)
    row, column, corner = (library.to_numpy(part) for part in (c[0, :], c[:, 0], c[:2, :2]))
    size = max(np.abs(row).max(), np.abs(column).max())
    error = size * max(ALIKE, 16.0 * float(np.finfo(row.dtype).eps))
    # Test two entries first, which is fast for a large array.
    if abs(corner[0, 0] - corner[1, 1]) > error:
        return ""
    c = library.to_numpy(c)
    is_dense = (np.abs(c[1:, 1:] - c[:-1, :-1]) <= error).all()
    if not is_dense or (np.abs(c - corner[0, 0]) <= error).all():
        return ""
    is_hermitian = (np.abs(row - column.conj()) <= error).all()
    return f"ToeplitzOperator({'c[:, 0]' if is_hermitian else 'c[:, 0], c[0]'})"


def check_coefficients(values: ArrayLike, name: str) -> Array:
    """Return `values` as an array of valid coefficients; raise an error if they are not."""
    array = check_finite(values, name)
    library = library_of(array)
    xp = library.xp
    with np.errstate(over="ignore"):  # If the sum overflows to inf it is refused.
        sizes = xp.abs(array)
        total = float(xp.sum(sizes, dtype=library.native(np.float64)))
    require_digits(name, library.dtype(sizes), array.shape, total, float(xp.max(sizes)))
    return array


def check_finite(values: ArrayLike, name: str) -> Array:
    """Return `values` as an array of finite numbers with a dtype that a matrix may have."""
    if is_foreign(values) and is_traced(values):
        raise TypeError(
            f"{name} is traced by JAX, and has no numbers yet, but must have them: make operators "
            "outside of jit and grad, and multiply inside; solve_toeplitz works inside them"
        )
    library = library_of(values)
    array = library.read(name, values)
    dtype = library.dtype(array)
    if not is_serial(values):
        raise TypeError(
            f"{name} is {values!r}, an operator on slabs, but must be an array of coefficients: "
            "use toeplitz_mg.slabs, where each rank has some of their rows"
        )
    if issparse(values):
        raise TypeError(
            f"{name} is a sparse matrix, but must be an array of coefficients: for a Toeplitz "
            "matrix A use its first column, A[:, [0]].toarray().ravel()"
        )
    if dtype.kind not in "buifc":
        what = f"has dtype {array.dtype}" if array.ndim else f"is {array.item()!r}"
        raise TypeError(f"{name} {what}, but must be an array of coefficients, which are numbers")
    if dtype.char not in "fdFD":
        array = library.cast(array, np.complex128 if dtype.kind == "c" else np.float64)
    elif not dtype.isnative:
        array = library.cast(array, dtype.newbyteorder("="))
    if array.ndim == 0 or prod(array.shape) == 0:
        shape = tuple(array.shape)
        raise ValueError(f"{name} has shape {shape}, but must have at least one coefficient")
    if not library.xp.all(library.xp.isfinite(array)):
        array = library.to_numpy(array)
        where = np.argwhere(~np.isfinite(array))[0]
        at = tuple(int(k) for k in where)
        raise ValueError(f"{name} has the coefficient {array[at]} at {at}, but all must be finite")
    return array


def require_digits(
    name: str, dtype: DTypeLike, shape: tuple[int, ...], total: float, largest: float
) -> None:
    """Raise a ValueError if products with these coefficients may overflow or underflow.

    Parameters
    ----------
    name : str
    dtype : float32 or float64
        The dtype of the absolute values.
    shape : tuple of int
        The shape of all coefficients.
    total, largest : float
        The sum and the maximum of the absolute values.
    """
    numbers = np.finfo(dtype)
    most = float(numbers.max) * HEADROOM / 2 ** len(shape)
    if total > most:
        raise ValueError(
            f"{name} has coefficients whose sizes add up to {total:.3g}, but must be at most "
            f"{most:.3g} so that no product overflows: divide the matrix and the right-hand side "
            "by a number"
        )
    # Some eigenvalue is at least this large. Products divide it by the length of the transforms.
    least = float(numbers.tiny) * 2 ** (len(shape) + 1) * prod(shape)
    if 0.0 < largest < least:
        raise ValueError(
            f"{name} has coefficients of size {largest:.3g} at most, but must have one of "
            f"{least:.3g} so that no product loses digits: multiply the matrix and the right-hand "
            "side by a number"
        )


def check_precision(dtype: DTypeLike, current: np.dtype[Any]) -> np.dtype[Any]:
    """Return `dtype` if a matrix may have it; raise an error otherwise.

    Parameters
    ----------
    dtype : dtype
    current : dtype
        The dtype of the matrix: a real one stays real, a complex one complex.
    """
    is_complex = current.kind == "c"
    names = "complex64 or complex128, as A is complex" if is_complex else "float32 or float64"
    try:
        result = np.dtype(dtype)
    except TypeError:
        raise TypeError(f"dtype is {dtype!r}, but must be {names}") from None
    if result.char not in ("FD" if is_complex else "fd"):
        raise TypeError(f"dtype is {result}, but must be {names}")
    return result.newbyteorder("=")


def require_range(diagonal: float, dtype: np.dtype[Any], subject: str = "A") -> None:
    """Raise a ValueError if the diagonal of a matrix is nearly outside the range of float32."""
    single = np.finfo(np.float32)
    low, high = float(single.tiny / single.eps), float(single.max * single.eps)
    if dtype.char in "fF" and diagonal and not low <= diagonal <= high:
        raise ValueError(
            f"the diagonal of {subject} is {diagonal:.3g}, but for a preconditioner in {dtype} it "
            f"must be between {low:.1g} and {high:.1g}: scale A"
        )
