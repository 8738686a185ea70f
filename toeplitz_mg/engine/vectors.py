"""Inner products and updates of vectors, part by part, for all iterations.

For a long vector BLAS takes as many threads as it has, which wait for each other, and then for more
to do on the cores that the products need. So it is given parts that are too short for that. What
threads do for us, as many as `scipy.fft.set_workers` says, is done in larger pieces by NumPy: calls
as short as those of BLAS would leave them to wait for the interpreter.

A vector may be a field of any shape, real or complex. The sums of its parts are added in double
precision.

The functions are for vectors that this process has. `Vectors` has them as methods, for vectors of
which each of several processes has a part: iterations take their inner products from there. Those
of fields of several axes are the same bits then, whoever has which rows (see `row_sums`).
"""

from collections.abc import Callable, Sequence
from functools import cache
from math import hypot, inf, isnan, sqrt
from typing import Any

import numpy as np
from numpy.typing import DTypeLike
from scipy.linalg import get_blas_funcs

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.row_sums import (
    AT_ONCE,
    PART,
    TOO_MANY,
    RowsOf,
    add_exactly,
    count_grains,
    grain_near,
    round_to,
    row_dots,
)
from toeplitz_mg.engine.threads import (
    PIECE,
    WORTH_THREADS,
    elementwise,
    share,
    share_rows,
    share_slices,
)
from toeplitz_mg.engine.workspace import workspace

REDUCED = 2**18  # Numbers of a field that a thread reduces to one at once.

# From a number, or an array of them, to those of all processes, in the same order in each of them.
Gather = Callable[[Any], Sequence[Any]]


def dot(x: Array, y: Array) -> float:
    """Return the inner product of two vectors; of complex ones its real part."""
    if x.ndim == 1 and len(x) <= PART:
        return float(np.vdot(x, y).real if x.dtype.kind == "c" else x @ y)
    return float(dots(x[None], y)[0].real)


def dots(X: Array, y: Array) -> Array:
    """Return the inner products of the vectors along the first axis of X with another.

    Parameters
    ----------
    X : ndarray of shape (k, ...)
        The complex conjugates of its entries are taken.
    y : ndarray of shape (...), of the dtype of `X`

    Returns
    -------
    ndarray of shape (k,), float64 or complex128
    """
    if y.ndim == 1 and y.size <= PART and X.dtype.char in "dD":
        return np.vecdot(X, y)  # In a small system each call more is a part of the time.
    rest: Any = 0.0
    if y.shape[-1] > PART:
        X, y = X.reshape(len(X), -1), y.reshape(-1)
        n = y.size // PART * PART
        rest = np.vecdot(X[:, n:], y[n:])
        X, y = X[:, :n].reshape(len(X), -1, PART), y[:n].reshape(-1, PART)
    if y.size < WORTH_THREADS:
        sums = np.vecdot(X, y)
    else:
        sums = np.empty(X.shape[:-1], X.dtype)

        def work(rows: range) -> None:
            some = slice(rows.start, rows.stop)
            np.vecdot(X[:, some], y[some], out=sums[:, some])

        share(work, len(y), y.size)
    # The sum of rows has a smaller rounding error than that over all of a field at once.
    double = np.result_type(X, np.float64)
    return sums.reshape(len(X), -1).sum(axis=1, dtype=double) + rest


def gram(X: Array) -> Array:
    """Return the inner products of the real vectors along the first axis of X with each other.

    Parameters
    ----------
    X : ndarray of shape (k, ...)

    Returns
    -------
    ndarray of shape (k, k), float64
    """
    if X[0].size <= PART:
        rows = X.reshape(len(X), -1)
        return np.vecdot(rows[:, None], rows).astype(np.float64)
    products = np.empty((len(X), len(X)))
    for k, x in enumerate(X):
        products[k, : k + 1] = products[: k + 1, k] = dots(X[: k + 1], x)
    return products


def norm(x: Array) -> float:
    """Return the 2-norm of a vector, real or complex; no square of a number over- or underflows."""
    if x.ndim > 1:
        x = x.reshape(-1)
    nrm2 = _blas("nrm2", x.dtype.char)
    if x.size <= PART:
        return float(nrm2(x)) if x.size else 0.0
    if x.size >= WORTH_THREADS:
        limits = np.finfo(x.dtype)
        with np.errstate(over="ignore", under="ignore", invalid="ignore"):
            square = dot(x, x)
        # Squares that underflow are lost in the rounding of such a sum.
        if x.size * float(limits.tiny) / float(limits.eps) < square < inf:
            return sqrt(square)
    return hypot(*(nrm2(x[k : k + PART]) for k in range(0, x.size, PART)))


def axpy(a: complex, x: Array, y: Array) -> Array:
    """Add a x to y, in place, and return y.

    Parameters
    ----------
    a : float or complex
    x : ndarray
    y : ndarray of the shape and the dtype of `x`
        It is changed, and must be C-contiguous.
    """
    _require_contiguous(y)
    a = y.dtype.type(a)
    if y.size <= AT_ONCE:
        y += a * x
        return y
    # BLAS rounds the last few numbers otherwise on some processors, and so those of some ranks.
    x_line, y_line = (x.reshape(-1), y.reshape(-1)) if y.ndim > 1 else (x, y)

    def work(piece: slice) -> None:
        product = workspace((y_line[piece].size,), y.dtype)
        np.multiply(x_line[piece], a, out=product)
        y_line[piece] += product

    share_slices(work, y.size, PIECE, y.size)
    return y


def aypx(a: complex, x: Array, y: Array) -> Array:
    """Multiply y by a and add x, in place, and return y.

    Parameters
    ----------
    a : float or complex
    x : ndarray
    y : ndarray of the shape and the dtype of `x`
        It is changed, and must be C-contiguous.
    """
    _require_contiguous(y)
    if y.size < WORTH_THREADS:
        y *= a
        y += x
        return y
    x_line, y_line = (x.reshape(-1), y.reshape(-1)) if y.ndim > 1 else (x, y)

    def work(piece: slice) -> None:
        part = y_line[piece]
        part *= a
        part += x_line[piece]

    share_rows(work, y_line)
    return y


def combine(weights: Array, X: Array) -> Array:
    """Return the sum of the vectors along the first axis of X with these weights.

    Parameters
    ----------
    weights : ndarray of shape (k,)
    X : ndarray of shape (k, ...)

    Returns
    -------
    ndarray of shape (...), of the dtype of `X`
    """
    total = np.zeros(X.shape[1:], X.dtype)
    add_combination(weights, X, total)
    return total


def add_combination(weights: Array, X: Array, y: Array) -> None:
    """Add the sum of the vectors along the first axis of X with these weights to y, in place.

    Parameters
    ----------
    weights : ndarray of shape (k,)
    X : ndarray of shape (k, ...)
    y : ndarray of shape (...), of the dtype of `X`
        It is changed, and must be C-contiguous.
    """
    _require_contiguous(y)
    rows, y = X.reshape(len(X), y.size), y.reshape(-1)
    if y.size <= PART and y.dtype.kind == "f" and len(X) > 2:
        y += np.einsum("k,kj->j", weights.astype(y.dtype), rows)
        return
    if y.dtype.kind == "c" or y.size <= PART:  # The sum below would take three times as long.
        add = _blas("axpy", y.dtype.char)
        for k in range(0, y.size, PART):
            for weight, row in zip(weights, rows, strict=True):
                add(row[k : k + PART], y[k : k + PART], a=weight)
        return
    weights = weights.astype(y.dtype)

    def work(part: slice) -> None:
        # This is done without BLAS, and so without its threads.
        y[part] += np.einsum("k,kj->j", weights, rows[:, part])

    share_slices(work, y.size, PART, rows.size)


def _require_contiguous(y: Array) -> None:
    if not y.flags.c_contiguous:
        raise ValueError("y is not C-contiguous, but is to be changed in place")


@cache
def _blas(name: str, dtype: str) -> Any:
    return get_blas_funcs(name, dtype=dtype)


def _reduce(of_part: Callable[[Array], Any], combine: Callable[[list[Any]], Any]) -> Any:
    """Return the function that combines the numbers of the pieces of a field, in their order."""

    def reduce(x: Array) -> Any:
        if x.size < WORTH_THREADS:
            return of_part(x)
        numbers: dict[int, Any] = {}

        def work(part: slice) -> None:
            numbers[part.start] = of_part(x[part])

        # There is nothing between that should stay in the cache.
        share_slices(work, len(x), max(1, REDUCED * len(x) // x.size), x.size)
        return combine([numbers[start] for start in sorted(numbers)])

    return reduce


def least(numbers: Sequence[float]) -> float:
    """Return the least of some numbers, NaN where one is, which Python's `min` may overlook."""
    return next(filter(isnan, numbers), min(numbers))


def largest(numbers: Sequence[float]) -> float:
    """Return the largest of some numbers, NaN where one is."""
    return next(filter(isnan, numbers), max(numbers))


_sum = _reduce(lambda x: float(x.sum()), sum)
_min = _reduce(lambda x: float(x.min(initial=inf)), least)
_max = _reduce(lambda x: float(x.max(initial=-inf)), largest)
_count = _reduce(lambda x: int(np.count_nonzero(x)), sum)


def _peak(x: Array) -> float:
    parts = (x.real, x.imag) if x.dtype.kind == "c" else (x,)
    return largest([float(np.abs(part).max(initial=0.0)) for part in parts])


class Vectors:
    """Operations with vectors of which each process has a part; alone, it has all of it.

    All numbers that are returned are those of the whole vectors, and the same bits in each process,
    so that no process leaves a loop alone. Updates are of the parts.

    Parameters
    ----------
    gather : callable, optional
        Takes a number, or an array, and returns those of all processes, in the same order in each.
    rows : int or ndarray of int, optional
        Of real vectors of fields whose rows no two processes share: `rows_of` these.

    Attributes
    ----------
    gather : callable
    dot, dots, gram, norm : callable
        As the functions of this module.
    dot_near : callable
        As `dot`, but of vectors whose product is about a third number, as the last one of an
        iteration. Processes exchange one number then, where rows have told them two.
    sum, min, max : callable
        From a real field to its sum, its least and its largest number; infinity, or minus
        infinity, where it has none.
    peak : callable
        From a vector to the largest size of its numbers, or of their real and imaginary parts.
    count : callable
        From a field to how many of its numbers are not zero.
    axpy, aypx, combine, add_combination : callable
        The functions of this module.
    elementwise : callable
        From a function of each element, and fields, to the field of its values (see `threads`).
    xp : module
        The library of the vectors, for what is done with each number by itself.
    cuts_fields : bool
        Whether it is worth it to pick the few numbers of a field that are not zero.

    Examples
    --------
    >>> Vectors().dot(np.array([1.0, 2.0]), np.array([3.0, 4.0]))
    11.0
    >>> with_another = Vectors(lambda number: [number, 9.0])  # That is what the other one has.
    >>> with_another.dot(np.array([1.0, 2.0]), np.array([3.0, 4.0]))
    20.0
    """

    xp: Any = np
    cuts_fields = True

    def __init__(self, gather: Gather | None = None, rows: RowsOf = None) -> None:
        self.gather: Gather = gather or (lambda number: (number,))

        def of_parts(combine: Callable[[Sequence[Any]], Any], of_part: Any) -> Any:
            if gather is None:  # In a small system one call more is a part of the time.
                return of_part
            return lambda *vectors: combine(gather(of_part(*vectors)))

        def dot_by_rows(x: Array, y: Array, near: float = 0.0) -> float:
            numbers = row_dots(x, y, rows)
            if grain := grain_near(near):
                numbers = round_to(numbers, grain)
                if gather is not None:
                    counts = gather(count_grains(numbers, grain))
                    if TOO_MANY not in counts:
                        return sum(counts) * grain
            sums = numbers.tolist()
            total = add_exactly(sums)
            if gather is not None:
                # What rounding takes from it goes with it: together they are as good as exact.
                sums.append(-total)
                both = np.array([total, add_exactly(sums)])
                total = add_exactly(np.ravel(gather(both)).tolist())
            return total

        self.dot: Callable[[Array, Array], float] = (
            of_parts(sum, dot) if rows is None else dot_by_rows
        )
        self.dot_near: Callable[[Array, Array, float], float] = (
            (lambda x, y, near: self.dot(x, y)) if rows is None else dot_by_rows
        )
        self.dots: Callable[[Array, Array], Array] = of_parts(sum, dots)
        self.gram: Callable[[Array], Array] = of_parts(lambda grams: np.sum(grams, axis=0), gram)
        self.norm: Callable[[Array], float] = of_parts(lambda norms: hypot(*norms), norm)
        self.sum: Callable[[Array], float] = of_parts(sum, _sum)
        self.min: Callable[[Array], float] = of_parts(least, _min)
        self.max: Callable[[Array], float] = of_parts(largest, _max)
        self.peak: Callable[[Array], float] = of_parts(largest, _peak)
        self.count: Callable[[Array], int] = of_parts(lambda counts: int(sum(counts)), _count)

    def copy(self, x: Array, out: Array) -> Array:
        """Return `out`, with the numbers of x."""
        out[...] = x
        return out

    def empty(self, x: Array, out: Array | None = None) -> Array:
        """Return memory for a vector like x: `out`, where that is given."""
        return np.empty_like(x) if out is None else out

    def zeros(self, x: Array, dtype: DTypeLike | None = None) -> Array:
        """Return a vector of zeros as long as another, in its precision or another one."""
        return np.zeros(x.shape, x.dtype if dtype is None else dtype)

    def cast(self, x: Array, dtype: DTypeLike) -> Array:
        """Return a vector in another precision, itself where it has that one."""
        return x.astype(dtype, copy=False)

    # These return what they compute, in `out`, their last argument: vectors that cannot be changed
    # have no other way.
    divide, subtract = np.divide, np.subtract
    elementwise = staticmethod(elementwise)
    reshape: Any = staticmethod(np.ndarray.reshape)
    axpy = staticmethod(axpy)
    aypx = staticmethod(aypx)
    combine = staticmethod(combine)
    add_combination = staticmethod(add_combination)


ALONE = Vectors()  # Of vectors that this process has alone.
