"""Inner products and updates of vectors, part by part, for all iterations.

For a long vector BLAS uses all its threads, which then spin on cores that the products need. So
BLAS is called with parts that are too short for threads. On several threads, as many as
`scipy.fft.set_workers` specifies, NumPy processes larger pieces: with calls as short as those of
BLAS, threads would wait for the interpreter's lock.

A vector may be a field of any shape, real or complex. Partial sums are added in double precision.

The functions are for vectors that this process has all of. `Vectors` has them as methods that also
handle vectors distributed over several processes; iterations use these methods.
"""

from collections.abc import Callable, Sequence
from functools import cache
from math import hypot, inf, isnan, sqrt
from typing import Any

import numpy as np
from numpy.typing import DTypeLike
from scipy.linalg import get_blas_funcs

from toeplitz_mg._typing import Array
from toeplitz_mg.engine import threads
from toeplitz_mg.engine.threads import PIECE, WORTH_THREADS, share, share_rows, share_slices
from toeplitz_mg.engine.workspace import workspace

PART = 2**13  # Most numbers in a call of BLAS: above 10,000 numbers OpenBLAS uses threads.

# Maps a number or array to those of all processes, in the same order on each process.
Gather = Callable[[Any], Sequence[Any]]


def dot(x: Array, y: Array) -> float:
    """Return the inner product of two vectors, or its real part if they are complex."""
    if x.ndim == 1 and len(x) <= PART:
        return float(np.vdot(x, y).real if x.dtype.kind == "c" else x @ y)
    return float(dots(x[None], y)[0].real)


def dots(X: Array, y: Array) -> Array:
    """Return the inner products of the vectors along the first axis of X with y.

    X is conjugated, and the results are in double precision.
    """
    if y.ndim == 1 and y.size <= PART and X.dtype.char in "dD":
        return np.vecdot(X, y)  # The overhead of calls matters in small systems.
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
    # Summing rows first has a smaller rounding error than one sum over the whole field.
    double = np.result_type(X, np.float64)
    return sums.reshape(len(X), -1).sum(axis=1, dtype=double) + rest


def gram(X: Array) -> Array:
    """Return the Gram matrix of the real vectors along the first axis of X."""
    if X[0].size <= PART:
        rows = X.reshape(len(X), -1)
        return np.vecdot(rows[:, None], rows).astype(np.float64)
    products = np.empty((len(X), len(X)))
    for k, x in enumerate(X):
        products[k, : k + 1] = products[: k + 1, k] = dots(X[: k + 1], x)
    return products


def norm(x: Array) -> float:
    """Return the 2-norm of a real or complex vector, without overflow or underflow of squares."""
    if x.ndim > 1:
        x = x.reshape(-1)
    nrm2 = _blas("nrm2", x.dtype.char)
    if x.size <= PART:
        return float(nrm2(x)) if x.size else 0.0
    limits = np.finfo(x.dtype)
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        square = dot(x, x)
    # In such a sum, squares that underflow are smaller than its rounding error.
    if x.size * float(limits.tiny) / float(limits.eps) < square < inf:
        return sqrt(square)
    return hypot(*(nrm2(x[k : k + PART]) for k in range(0, x.size, PART)))


def axpy(a: complex, x: Array, y: Array) -> Array:
    """Return y, after adding a x in place; y is C-contiguous and has the dtype of x."""
    a = y.dtype.type(a)

    def add(x: Array, y: Array) -> None:
        # On some CPUs BLAS rounds the last few numbers differently: results would depend on ranks.
        y += x * a if y.size <= PART else np.multiply(x, a, out=workspace(y.shape, y.dtype))

    return _update(add, x, y)


def aypx(a: complex, x: Array, y: Array) -> Array:
    """Return y, after replacing it by a y + x in place, as `axpy` does."""

    def scale_and_add(x: Array, y: Array) -> None:
        y *= a
        y += x

    return _update(scale_and_add, x, y)


def _update(change: Callable[[Array, Array], None], x: Array, y: Array) -> Array:
    """Return y, after changing it by x, piece by piece if it is long."""
    _require_contiguous(y)
    if y.size <= PIECE:
        change(x, y)
        return y
    x_line, y_line = x.reshape(-1), y.reshape(-1)
    share_slices(lambda piece: change(x_line[piece], y_line[piece]), y.size, PIECE, y.size)
    return y


def combine(weights: Array, X: Array) -> Array:
    """Return the weighted sum of the vectors along the first axis of X, in its dtype."""
    total = np.zeros(X.shape[1:], X.dtype)
    add_combination(weights, X, total)
    return total


def add_combination(weights: Array, X: Array, y: Array) -> None:
    """Add the weighted sum of the vectors along the first axis of X to y, in place."""
    _require_contiguous(y)
    rows, y = X.reshape(len(X), y.size), y.reshape(-1)
    if y.dtype.kind == "c" or (y.size <= PART and len(X) <= 2):  # BLAS is faster in these cases.
        add = _blas("axpy", y.dtype.char)
        for k in range(0, y.size, PART):
            for weight, row in zip(weights, rows, strict=True):
                add(row[k : k + PART], y[k : k + PART], a=weight)
        return
    weights = weights.astype(y.dtype)

    def work(part: slice) -> None:
        # `einsum` does not call BLAS here, so that no threads of BLAS start.
        y[part] += np.einsum("k,kj->j", weights, rows[:, part])

    share_slices(work, y.size, PART, rows.size)


def _require_contiguous(y: Array) -> None:
    if not y.flags.c_contiguous:
        raise ValueError("y is not C-contiguous, but must be for an update in place: use a copy")


def power_above(size: Any) -> Any:
    """Return the exponent p for which size · 2^-p is between 1/2 and 1, for one size or several.

    Scaling by a power of two is exact.
    """
    # Beyond these limits the scale or its inverse would overflow or underflow.
    return np.clip(np.frexp(size)[1], -1000, 1000)


@cache
def _blas(name: str, dtype: str) -> Any:
    return get_blas_funcs(name, dtype=dtype)


def _reduce(of_part: Callable[[Array], Any], combine: Callable[[list[Any]], Any]) -> Any:
    """Return a function that reduces a field: `of_part` for each piece, combined in their order."""

    def reduce(x: Array) -> Any:
        if x.size < WORTH_THREADS:
            return of_part(x)
        numbers: dict[int, Any] = {}

        def work(part: slice) -> None:
            numbers[part.start] = of_part(x[part])

        share_rows(work, x)
        return combine([numbers[start] for start in sorted(numbers)])

    return reduce


def least(numbers: Sequence[float]) -> float:
    """Return the least number, or NaN if one is NaN, which Python's `min` may ignore."""
    return next(filter(isnan, numbers), min(numbers))


def largest(numbers: Sequence[float]) -> float:
    """Return the largest number, or NaN if one is NaN."""
    return next(filter(isnan, numbers), max(numbers))


_sum = _reduce(lambda x: float(x.sum()), sum)
_min = _reduce(lambda x: float(x.min(initial=inf)), least)
_max = _reduce(lambda x: float(x.max(initial=-inf)), largest)
_count = _reduce(lambda x: int(np.count_nonzero(x)), sum)


def _peak(x: Array) -> float:
    parts = (x.real, x.imag) if x.dtype.kind == "c" else (x,)
    return largest([float(np.abs(part).max(initial=0.0)) for part in parts])


class Vectors:
    """Operations with vectors of which each process has a part; by default one process has all.

    Returned numbers are for the whole vectors and have the same bits on each process, so that all
    processes leave a loop together. Updates apply to the part of this process.

    Parameters
    ----------
    gather : callable, optional
        Maps a number or array to those of all processes, in the same order on each process.

    Attributes
    ----------
    gather : callable
    dot, dots, gram, norm : callable
        As the functions of this module.
    sum, min, max : callable
        The sum, the minimum and the maximum of a real field. For an empty field the minimum is
        infinity and the maximum minus infinity.
    peak : callable
        The largest absolute value of a vector's entries, or of their real and imaginary parts.
    count : callable
        The number of nonzero entries of a field.
    axpy, aypx, combine, add_combination : callable
        The functions of this module.
    elementwise : callable
        Applies an elementwise function to fields (see `threads`).
    xp : module
        The array library of the vectors, for elementwise operations.
    cuts_fields : bool
        Whether it is worthwhile to extract the nonzero entries of a sparse field.

    Examples
    --------
    >>> Vectors().dot(np.array([1.0, 2.0]), np.array([3.0, 4.0]))
    11.0
    >>> with_another = Vectors(lambda number: [number, 9.0])  # Another process contributes 9.
    >>> with_another.dot(np.array([1.0, 2.0]), np.array([3.0, 4.0]))
    20.0
    """

    xp: Any = np
    cuts_fields = True

    def __init__(self, gather: Gather | None = None) -> None:
        self.gather: Gather = gather or (lambda number: (number,))

        def of_parts(combine: Callable[[Sequence[Any]], Any], of_part: Any) -> Any:
            if gather is None:  # The overhead of another call matters in small systems.
                return of_part
            return lambda *vectors: combine(gather(of_part(*vectors)))

        self.dot: Callable[[Array, Array], float] = of_parts(sum, dot)
        self.dots: Callable[[Array, Array], Array] = of_parts(sum, dots)
        self.gram: Callable[[Array], Array] = of_parts(lambda grams: np.sum(grams, axis=0), gram)
        self.norm: Callable[[Array], float] = of_parts(lambda norms: hypot(*norms), norm)
        self.sum: Callable[[Array], float] = of_parts(sum, _sum)
        self.min: Callable[[Array], float] = of_parts(least, _min)
        self.max: Callable[[Array], float] = of_parts(largest, _max)
        self.peak: Callable[[Array], float] = of_parts(largest, _peak)
        self.count: Callable[[Array], int] = of_parts(lambda counts: int(sum(counts)), _count)

    def copy(self, x: Array, out: Array) -> Array:
        """Return `out`, after copying x to it."""
        out[...] = x
        return out

    def empty(self, x: Array, out: Array | None = None) -> Array:
        """Return memory for a vector like x: `out` if it is given."""
        return np.empty_like(x) if out is None else out

    def zeros(self, x: Array, dtype: DTypeLike | None = None) -> Array:
        """Return zeros in the shape of x and, by default, in its dtype."""
        return np.zeros(x.shape, x.dtype if dtype is None else dtype)

    def cast(self, x: Array, dtype: DTypeLike) -> Array:
        """Return a vector in another precision, without a copy if it has that precision."""
        return x.astype(dtype, copy=False)

    # These return their result, in the last argument `out` if possible: callers use the returned
    # array, because arrays of some libraries are immutable.
    divide, subtract = np.divide, np.subtract
    elementwise = staticmethod(threads.elementwise)
    reshape: Any = staticmethod(np.ndarray.reshape)
    axpy = staticmethod(axpy)
    aypx = staticmethod(aypx)
    combine = staticmethod(combine)
    add_combination = staticmethod(add_combination)


VECTORS = Vectors()  # For vectors that this process has all of.
