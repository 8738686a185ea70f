"""Inner products and updates of vectors, part by part, for all iterations.

For a long vector BLAS takes as many threads as it has, which wait for each other, and then for more
to do on the cores that the products need. So it is given parts that are too short for that. What
threads do for us, as many as `scipy.fft.set_workers` says, is done in larger pieces by NumPy: calls
as short as those of BLAS would leave them to wait for the interpreter.

A vector may be a field of any shape, real or complex. The sums of its parts are added in double
precision.

The functions are for vectors that this process has. `Vectors` has them as methods, for vectors of
which each of several processes has a part: iterations take their inner products from there.
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

PART = 2**13  # Most numbers of a piece: OpenBLAS shares a vector of more than 10,000 among threads.

# From a number, or an array of them, to those of all processes, in the same order in each of them.
Gather = Callable[[Any], Sequence[Any]]


def dot(x: Array, y: Array) -> float:
    """Return the inner product of two vectors; of complex ones its real part."""
    if x.ndim == 1 and len(x) <= PART:
        return float(np.vdot(x, y).real if x.dtype.kind == "c" else x @ y)
    return float(dots(x[None], y)[0].real)


def dots(X: Array, y: Array) -> Array:
    """Return the inner products of the vectors along the first axis of X with another.

    The complex conjugates of X are taken, and the results are in double precision.
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
    """Return the inner products of the real vectors along the first axis of X with each other."""
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
    limits = np.finfo(x.dtype)
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        square = dot(x, x)
    # Squares that underflow are lost in the rounding of such a sum.
    if x.size * float(limits.tiny) / float(limits.eps) < square < inf:
        return sqrt(square)
    return hypot(*(nrm2(x[k : k + PART]) for k in range(0, x.size, PART)))


def axpy(a: complex, x: Array, y: Array) -> Array:
    """Add a x to y, which is C-contiguous and of the dtype of x, in place, and return y."""
    a = y.dtype.type(a)

    def add(x: Array, y: Array) -> None:
        # BLAS rounds the last few numbers otherwise on some processors, and so those of some ranks.
        y += x * a if y.size <= PART else np.multiply(x, a, out=workspace(y.shape, y.dtype))

    return _update(add, x, y)


def aypx(a: complex, x: Array, y: Array) -> Array:
    """Multiply y by a and add x, in place, and return y, as `axpy` does."""

    def scale_and_add(x: Array, y: Array) -> None:
        y *= a
        y += x

    return _update(scale_and_add, x, y)


def _update(change: Callable[[Array, Array], None], x: Array, y: Array) -> Array:
    """Change y by x, of a long one piece by piece, and return it."""
    _require_contiguous(y)
    if y.size <= PIECE:
        change(x, y)
        return y
    x_line, y_line = x.reshape(-1), y.reshape(-1)
    share_slices(lambda piece: change(x_line[piece], y_line[piece]), y.size, PIECE, y.size)
    return y


def combine(weights: Array, X: Array) -> Array:
    """Return the sum of the vectors along the first axis of X with these weights, in its dtype."""
    total = np.zeros(X.shape[1:], X.dtype)
    add_combination(weights, X, total)
    return total


def add_combination(weights: Array, X: Array, y: Array) -> None:
    """Add the sum of the vectors along the first axis of X with these weights to y, as `axpy`."""
    _require_contiguous(y)
    rows, y = X.reshape(len(X), y.size), y.reshape(-1)
    if y.dtype.kind == "c" or (y.size <= PART and len(X) <= 2):  # The sum below is slower then.
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


def power_above(size: Any) -> Any:
    """Return the power of two that scales a size, or sizes, to numbers from 1/2 to 1.

    What is scaled by it loses no digit.
    """
    # Beyond these the scale itself, or its inverse, would over- or underflow.
    return np.clip(np.frexp(size)[1], -1000, 1000)


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

        share_rows(work, x)
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
    """Operations with vectors of which each process has a part; where there is one, all of it.

    All numbers that are returned are those of the whole vectors, and the same bits in each process,
    so that no process leaves a loop alone. Updates are of the parts.

    Parameters
    ----------
    gather : callable, optional
        Takes a number, or an array, and returns those of all processes, in the same order in each.

    Attributes
    ----------
    gather : callable
    dot, dots, gram, norm : callable
        As the functions of this module.
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

    def __init__(self, gather: Gather | None = None) -> None:
        self.gather: Gather = gather or (lambda number: (number,))

        def of_parts(combine: Callable[[Sequence[Any]], Any], of_part: Any) -> Any:
            if gather is None:  # In a small system one call more is a part of the time.
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
    elementwise = staticmethod(threads.elementwise)
    reshape: Any = staticmethod(np.ndarray.reshape)
    axpy = staticmethod(axpy)
    aypx = staticmethod(aypx)
    combine = staticmethod(combine)
    add_combination = staticmethod(add_combination)


VECTORS = Vectors()  # Of vectors that this process has all of.
