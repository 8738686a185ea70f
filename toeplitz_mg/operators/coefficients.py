"""Coefficients of a Toeplitz matrix: their normal form, and what they must be."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import prod
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike

from toeplitz_mg._typing import Array
from toeplitz_mg.values import refuse_masked

HEADROOM = (
    2.0**-8
)  # Share of the largest number that a row may sum up to: the rest is for products.


@dataclass(frozen=True)
class Coefficients:
    """The coefficients a[i - j] of a Toeplitz matrix, in their normal form.

    Parameters
    ----------
    array : ndarray
        The first column, shape (n1, n2, ...), where the coefficients are even in each axis; else
        all of them, shape (2 n1 - 1, 2 n2 - 1, ...), lag zero in the centre. It is read-only.
    is_even : bool
    """

    array: Array
    is_even: bool

    def __post_init__(self) -> None:
        self.array.flags.writeable = False

    @classmethod
    def of_column(cls, c: ArrayLike) -> "Coefficients":
        """Take the first column of a matrix: Hermitian, and symmetric in each axis where real."""
        column = check_coefficients(c, "c")
        if column.dtype.kind != "c":
            return cls(column.copy(), True)
        if column.ndim > 1:
            advice = "for several axes use ToeplitzOperator.from_lags"
            if dense := name_dense(column):
                advice += f", and for the dense Toeplitz matrix that c looks like {dense}"
            raise ValueError(
                f"c is complex and has shape {column.shape}, but a first column tells all of a "
                f"Hermitian matrix on one axis only; {advice}"
            )
        return cls._normal(np.concatenate([column[:0:-1].conj(), column]))

    @classmethod
    def of_column_and_row(cls, c: ArrayLike, r: ArrayLike) -> "Coefficients":
        """Take the first column and the first row of a matrix of one axis."""
        column, row = check_coefficients(c, "c"), check_coefficients(r, "r")
        if column.ndim > 1 or row.ndim > 1:
            raise ValueError(
                f"c and r have shapes {column.shape} and {row.shape}, but a first row is for "
                "one axis; for several axes use ToeplitzOperator.from_lags"
            )
        if len(row) != len(column):
            raise ValueError(
                f"c has {len(column)} entries and r has {len(row)}, but the matrix is square"
            )
        return cls._normal(np.concatenate([row[:0:-1], column]))

    @classmethod
    def of_lags(cls, lags: ArrayLike) -> "Coefficients":
        """Take all coefficients, lag zero in the centre."""
        array = check_coefficients(lags, "lags")
        if not all(n % 2 for n in array.shape):
            raise ValueError(
                f"lags has shape {array.shape}, but each length must be 2 n - 1, which is odd"
            )
        return cls._normal(array)

    @classmethod
    def _normal(cls, lags: Array) -> "Coefficients":
        general = cls(lags.view(), False)
        if all(np.array_equal(lags, np.flip(lags, k)) for k in range(lags.ndim)):
            return cls(general.column.copy(), True)
        return cls(lags.copy(), False)

    @property
    def grid_shape(self) -> tuple[int, ...]:
        """The number of points along each axis."""
        return self.array.shape if self.is_even else tuple((m + 1) // 2 for m in self.array.shape)

    @property
    def is_symmetric(self) -> bool:
        """Whether a[-k] = a[k]."""
        return self.is_even or np.array_equal(self.array, np.flip(self.array))

    @property
    def is_hermitian(self) -> bool:
        """Whether a[-k] is the complex conjugate of a[k]."""
        if self.array.dtype.kind != "c":
            return self.is_symmetric
        conjugate = self.array.conj()
        return np.array_equal(self.array, conjugate if self.is_even else np.flip(conjugate))

    @property
    def column(self) -> Array:
        """The coefficients of the lags 0 ... n - 1 along each axis."""
        if self.is_even:
            return self.array
        return self.array[tuple(slice(n - 1, None) for n in self.grid_shape)]

    @property
    def lags(self) -> Array:
        """All coefficients, lag zero in the centre."""
        if not self.is_even:
            return self.array
        lags = self.array
        for axis, n in enumerate(self.grid_shape):
            lags = np.take(lags, np.abs(np.arange(1 - n, n)), axis=axis)
        return lags

    @property
    def squeezed(self) -> "Coefficients":
        """The coefficients without axes of one point, which have no lags; or themselves."""
        lengths = [m for m in self.array.shape if m > 1] or [1]
        if len(lengths) == self.array.ndim:
            return self
        return Coefficients(self.array.reshape(lengths), self.is_even)

    @property
    def transpose(self) -> "Coefficients":
        """The coefficients of the transpose."""
        return self if self.is_even else Coefficients(np.flip(self.array), False)

    @property
    def conjugate(self) -> "Coefficients":
        """The coefficients of the complex conjugate."""
        is_real = self.array.dtype.kind != "c"
        return self if is_real else Coefficients(self.array.conj(), self.is_even)

    def at(self, lags: Sequence[Array]) -> Array:
        """Return the coefficients of some lags, given along each axis."""
        if self.is_even:
            return self.array[tuple(map(np.abs, lags))]
        return self.array[tuple(k + m // 2 for k, m in zip(lags, self.array.shape, strict=True))]

    def times(self, factor: Any) -> "Coefficients":
        """Multiply with a number."""
        with np.errstate(over="ignore", invalid="ignore"):  # What overflows is refused.
            return Coefficients(check_coefficients(self.array * factor, "lags"), self.is_even)

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
        return self.plus(Coefficients(column, True))

    def astype(self, dtype: np.dtype[Any]) -> "Coefficients":
        """Round to this precision, or say that this is not possible."""
        return Coefficients(check_coefficients(self.array.astype(dtype), "lags"), self.is_even)


def name_dense(c: Array) -> str:
    """Return what to write for `c` if it looks like a dense Toeplitz matrix, or else nothing.

    It has three rows at least, and all entries of a diagonal are equal. In the first column of a
    matrix of two axes this makes the coefficient of the lag (1, 1) as large as that of lag zero,
    which no positive definite matrix has. A constant array may be either.
    """
    is_dense = (
        c.ndim == 2
        and c.shape[0] == c.shape[1] > 2
        and c[0, 0] == c[1, 1]  # That is soon told of a large array.
        and np.array_equal(c[1:, 1:], c[:-1, :-1])
        and not (c == c[0, 0]).all()
    )
    if not is_dense:
        return ""
    is_hermitian = np.array_equal(c[0], c[:, 0].conj())
    return f"ToeplitzOperator({'c[:, 0]' if is_hermitian else 'c[:, 0], c[0]'})"


def check_coefficients(values: ArrayLike, name: str) -> Array:
    """Return `values` as an array of real or complex numbers, or say what is wrong with them."""
    array = check_finite(values, name)
    with np.errstate(over="ignore"):  # What overflows to inf is too much.
        sizes = np.abs(array)
        total = float(sizes.sum(dtype=np.float64))
    require_digits(name, sizes.dtype, array.shape, total, float(sizes.max()))
    return array


def check_finite(values: ArrayLike, name: str) -> Array:
    """Return `values` as an array of finite numbers, of a dtype that a matrix may have."""
    array = refuse_masked(name, values)
    if array.dtype.kind not in "buifc":
        raise TypeError(f"{name} has dtype {array.dtype}, but coefficients are numbers")
    if array.dtype.char not in "fdFD":
        array = array.astype(np.complex128 if array.dtype.kind == "c" else np.float64)
    if array.ndim == 0 or array.size == 0:
        raise ValueError(f"{name} has shape {array.shape}, but needs at least one coefficient")
    if not np.isfinite(array).all():
        where = np.argwhere(~np.isfinite(array))[0]
        at = tuple(int(k) for k in where)
        raise ValueError(f"{name} has the coefficient {array[at]} at {at}, but all must be finite")
    return array


def require_digits(
    name: str, dtype: DTypeLike, shape: tuple[int, ...], total: float, largest: float
) -> None:
    """Raise ValueError where coefficients make products over- or underflow.

    Parameters
    ----------
    name : str
    dtype : float32 or float64
        That of the sizes of the coefficients.
    shape : tuple of int
        That of all coefficients.
    total, largest : float
        The sum of their sizes, and the largest.
    """
    numbers = np.finfo(dtype)
    most = float(numbers.max) * HEADROOM / 2 ** len(shape)
    if total > most:
        raise ValueError(
            f"{name} has coefficients whose sizes add up to {total:.3g}, but must be at most "
            f"{most:.3g} so that no product overflows: divide the matrix, and what it is to give, "
            "by a number"
        )
    # Some eigenvalue is as large as that. The products divide it by the length of the transforms.
    least = float(numbers.tiny) * 2 ** (len(shape) + 1) * prod(shape)
    if 0.0 < largest < least:
        raise ValueError(
            f"{name} has coefficients of size {largest:.3g} at most, but must have one of "
            f"{least:.3g} so that no product loses digits: multiply the matrix, and what it is to "
            "give, by a number"
        )


def check_precision(dtype: DTypeLike, current: np.dtype[Any]) -> np.dtype[Any]:
    """Return `dtype` as one of the two that a matrix may have, or say that it is none.

    Parameters
    ----------
    dtype : dtype
    current : dtype
        That of the matrix: a real one stays real, and a complex one complex.
    """
    is_complex = current.kind == "c"
    names = "complex64 or complex128, as A is complex" if is_complex else "float32 or float64"
    try:
        result = np.dtype(dtype)
    except TypeError:
        raise TypeError(f"dtype is {dtype!r}, but must be {names}") from None
    if result.char not in ("FD" if is_complex else "fd"):
        raise TypeError(f"dtype is {result}, but must be {names}")
    return result
