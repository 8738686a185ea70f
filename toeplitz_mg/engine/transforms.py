"""Transforms of rows: short ones at once, long ones in `panels`, and what is done with them."""

from collections import defaultdict
from collections.abc import Callable
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import DTypeLike
from scipy.fft import next_fast_len

from toeplitz_mg._typing import Array
from toeplitz_mg.engine import fourier
from toeplitz_mg.engine.fourstep import four_step
from toeplitz_mg.engine.mkl import MKL
from toeplitz_mg.engine.panels import Panels
from toeplitz_mg.engine.threads import TRANSFORM, WORTH_THREADS, share_slices
from toeplitz_mg.engine.work import count_transforms
from toeplitz_mg.engine.workspace import workspace

LONG = 2**15  # Length from which on a transform in four steps is faster than one at once.
LONG_OF_MKL = 2**16  # With MKL up to this length, and for any power of two, it is not.
LONGEST_KEPT = 2**22  # Longest phase factors that are kept in memory: 64 MiB.
BATCH = 2**15  # Numbers of a batch of short vectors: so many stay in the cache.


class OneStep:
    """Transforms of a length at once: many short vectors, or those of no near, fast factors."""

    def __init__(self, length: int, dtype: DTypeLike) -> None:
        self.length = length
        self.dtype = np.dtype(dtype)
        # What multiplies one vector, with the memory for it: who uses it has taken it from here.
        self._spare: defaultdict[Any, list[Callable[[Array, Array], Array]]] = defaultdict(list)

    def __reduce__(self) -> Any:
        return OneStep, (self.length, self.dtype)

    def astype(self, dtype: DTypeLike) -> "OneStep":
        """Return the plan for numbers of another precision."""
        return self if self.dtype == dtype else OneStep(self.length, dtype)

    @cached_property
    def _quarter(self) -> tuple[Array, Array]:
        """The weights of a transform, and those of its inverse, which has a factor 1/L itself."""
        return self.weights(0.25), self.weights(-0.25) * self.dtype.type(self.length)

    @cached_property
    def _half(self) -> tuple[Array, Array]:
        return self.weights(0.5), self.weights(-0.5)

    def weights(self, shift: float) -> Array:
        """Return the factors exp(-2πi j s/L) of a shift, shape (L,)."""
        return phase_factors(self.length, shift, self.dtype)

    def spectrum(self, real: Array, imag: Array | None, shift: float) -> Array:
        """Transform a vector at the frequencies k + s.

        Parameters
        ----------
        real, imag : ndarray of shape (L,)
            The parts of the vector; None in the place of the imaginary one where it is zero.
        shift : float
            The shift s.
        """
        column = real if imag is None else real + 1j * imag
        return fourier.fft(column * self.weights(shift), overwrite_x=True)

    def parts(self, spectrum: Array, shift: float) -> tuple[Array, Array]:
        """Return the real and the imaginary part of the vector that has a spectrum."""
        vector = fourier.ifft(spectrum) * self.weights(-shift)
        return vector.real, vector.imag

    def in_order(self, spectrum: Array) -> Array:
        """Return a spectrum in the order of the frequencies."""
        return spectrum

    def eigenvalues(self, spectrum: Array) -> Array:
        """Prepare a spectrum for the products."""
        spectrum = spectrum / self.length
        if np.iscomplexobj(spectrum):
            return spectrum.astype(self.dtype)
        # Each stands twice, for the real and the imaginary part of what it multiplies.
        return np.repeat(spectrum, 2).astype(self.dtype.char.lower())

    def multiply_real(self, X: Array, eigenvalues: Array, out: Array) -> None:
        """Write the real parts of the products of rows with the matrix of the shift 1/4."""
        n = X.shape[1]
        w, w_conj = self._quarter
        if n < self.length:
            w, w_conj = w[:n], w_conj[:n]

        def work(part: slice) -> None:
            x = X[part]
            Z = workspace((len(x), self.length), self.dtype)
            cut = Z if n == self.length else Z[:, :n]
            if x.dtype == out.dtype:
                np.multiply(x, w, out=cut)
            else:
                np.multiply(x, w, out=cut, casting="same_kind")
            if n < self.length:
                Z[:, n:] = 0.0
            fourier.forward(Z)
            pairs = Z.view(eigenvalues.dtype)
            pairs *= eigenvalues
            fourier.backward(Z, norm="backward")
            cut = Z if n == self.length else Z[:, :n]
            cut *= w_conj
            out[part] = cut.real

        self._share(work, len(X))

    def multiply_vector(self, x: Array, eigenvalues: Array) -> Array:
        """Return what `multiply_real` makes of one vector of its precision, with fewer calls."""
        of = fourier.library()
        spare = self._spare[of, len(x)]
        try:
            multiply = spare.pop()
        except IndexError:
            multiply = self._bind(len(x), of)
        y = multiply(x, eigenvalues)
        spare.append(multiply)
        return y

    def _bind(self, n: int, of: Any) -> Callable[[Array, Array], Array]:
        """Return `multiply_vector` for vectors of length n, with memory and transforms of it."""
        Z = np.zeros(self.length, self.dtype)
        pairs = Z.view(self.dtype.char.lower())
        cut, rest, real = Z[:n], Z[n:], Z.real[:n]
        w, w_conj = (weights[:n] for weights in self._quarter)
        forward, backward = fourier.bind(Z, of)
        times = np.multiply

        def multiply(x: Array, eigenvalues: Array) -> Array:
            times(x, w, cut)
            rest.fill(0.0)
            forward()
            numbers = Z if eigenvalues.dtype.kind == "c" else pairs
            times(numbers, eigenvalues, numbers)
            backward()
            times(cut, w_conj, cut)
            return real.copy()

        return multiply

    def multiply_complex(self, X: Array, eigenvalues: tuple[Array, ...], out: Array) -> None:
        """Write the sums of the products of rows with the matrices of the shifts 0 and 1/2."""
        n, L = X.shape[1], self.length
        w, w_conj = (weights[:n] for weights in self._half)

        def work(part: slice) -> None:
            x = X[part]
            Z = workspace((2, len(x), L), self.dtype)
            Z[0, :, :n] = x
            np.multiply(x, w, out=Z[1, :, :n], casting="same_kind")
            Z[:, :, n:] = 0.0
            fourier.forward(Z)
            for half, factors in zip(Z, eigenvalues, strict=True):
                half.view(factors.dtype)[...] *= factors
            fourier.backward(Z)
            Z = Z[:, :, :n]
            Z[1] *= w_conj
            np.add(Z[0], Z[1], out=out[part], casting="same_kind")

        self._share(work, len(X), 2)

    def multiply_in_turn(self, X: Array, factors: list[tuple[float, Array]], out: Array) -> None:
        """Write the products of rows with the matrices of these shifts, the first one first.

        Where `out` is real, these are their real parts.
        """

        def work(part: slice) -> None:
            Z = workspace((len(X[part]), self.length), self.dtype)
            np.multiply(X[part], self.weights(factors[0][0]), out=Z, casting="same_kind")
            for k, (shift, eigenvalues) in enumerate(factors):
                if k and shift:
                    Z *= self.weights(shift)
                fourier.forward(Z)
                numbers = Z.view(eigenvalues.dtype)  # Pairs of real ones, where eigenvalues are.
                numbers *= eigenvalues
                fourier.backward(Z)
                if shift:
                    Z *= self.weights(-shift)
            out[part] = Z if out.dtype.kind == "c" else Z.real

        self._share(work, len(X))

    def _share(self, work: Callable[[slice], None], count: int, transforms: int = 1) -> None:
        """Do the work for batches of so many vectors, of which each has so many transforms."""
        length = transforms * self.length
        share_slices(work, count, max(1, BATCH // length), count * length)


def phase_factors(length: int, shift: float, dtype: np.dtype[Any]) -> Array:
    """Return the factors exp(-2πi j s/L) of a shift, shape (L,), of a complex dtype."""
    if shift < 0.0:
        return phase_factors(length, -shift, dtype).conj()
    if length > LONGEST_KEPT:
        return _compute_phase_factors(length, shift, dtype)
    return (_keep_short if length <= LONG else _keep_long)(length, shift, dtype)


def _compute_phase_factors(length: int, shift: float, dtype: np.dtype[Any]) -> Array:
    return np.asarray(np.exp(-2j * np.pi * shift / length * np.arange(length)), dtype)


# At most 32 and 64 MiB.
_keep_short = lru_cache(maxsize=64)(_compute_phase_factors)
_keep_long = lru_cache(maxsize=1)(_compute_phase_factors)


@lru_cache(maxsize=64)
def _plan(n: int, precision: str, exact: bool, by_mkl: bool) -> OneStep | Panels:
    if n < LONG or (by_mkl and n <= LONG_OF_MKL):
        return OneStep(n if exact else next_fast_len(n), precision)
    plan = four_step(n, precision)
    at_once = by_mkl and plan.length.bit_count() == 1  # MKL has steps of its own for these.
    if exact and plan.length != n:
        return OneStep(n, precision)
    return OneStep(plan.length, precision) if at_once else Panels(plan)


def plan_of(n: int, dtype: DTypeLike, *, exact: bool = False) -> OneStep | Panels:
    """Return the transforms for vectors of length n: of that length, or of a fast one above it."""
    by_mkl = isinstance(fourier.library(), MKL)
    return _plan(n, np.result_type(dtype, np.complex64).char, exact, by_mkl)


def in_batches(multiply: Callable[[Array, Array], None], X: Array, out: Array, size: int) -> None:
    """Multiply rows into `out`, short ones in batches that threads share.

    A long row is multiplied by itself, by what is shared itself.

    Parameters
    ----------
    multiply : callable
        Takes some rows, and where their products go.
    X, out : ndarray of shape (rows, N)
    size : int
        The numbers of the transform of a row.
    """

    def work(rows: slice) -> None:
        multiply(X[rows], out[rows])

    if TRANSFORM * size < WORTH_THREADS:
        share_slices(work, len(X), max(1, BATCH // size), TRANSFORM * len(X) * size)
        return
    for k in range(len(X)):
        work(slice(k, k + 1))


def cosine_sums(column: Array) -> Array:
    """Return f_k = Σ a_j cos(πjk/n) over all lags |j| ≤ n, for k = 0 … n, a of period 2 n.

    A DCT-I, along each axis. It is its own inverse but for the factor 2 n of each axis.

    Parameters
    ----------
    column : ndarray of shape (n + 1, ...), float64
    """
    shape = tuple(m - 1 for m in column.shape)
    count_transforms(1, *shape)  # They are half as long as those of a product.
    if (panels := _panels_for_sums(column)) is not None:
        return panels.cosine_sums(column)
    # Slabs of rows transform the last axis first, too: their bits are the same.
    return fourier.dctn(column, type=1, axes=range(column.ndim)[::-1])


def sine_sums(column: Array) -> Array:
    """Return f_k = 2 Σ a_j sin(πjk/n) over 0 < j < n, for k = 0 … n; a DST-I.

    Parameters
    ----------
    column : ndarray of shape (n + 1,), float64
        Its first and its last entry do not matter.
    """
    count_transforms(1, len(column) - 1)
    a = np.zeros_like(column)
    a[1:-1] = column[1:-1]
    if (panels := _panels_for_sums(a)) is not None:
        return panels.sine_sums(a)
    if len(a) > 2:
        a[1:-1] = fourier.dstn(a[1:-1], type=1)
    return a


def _panels_for_sums(column: Array) -> Panels | None:
    if column.ndim > 1 or len(column) % 2 == 0:
        return None
    plan = plan_of(len(column) - 1, np.float64, exact=True)
    return plan if isinstance(plan, Panels) else None
