"""Transforms of rows, in one step if they are short or in four if long, and products by these."""

from collections import defaultdict
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import DTypeLike
from scipy.fft import next_fast_len

from toeplitz_mg._typing import Array
from toeplitz_mg.engine import fourier
from toeplitz_mg.engine.fourstep import Factors, FourStep
from toeplitz_mg.engine.lengths import near_square
from toeplitz_mg.engine.mkl import MKL
from toeplitz_mg.engine.threads import TRANSFORM, WORTH_THREADS, share_slices
from toeplitz_mg.engine.work import count_transforms
from toeplitz_mg.engine.workspace import workspace

LONG = 2**15  # Shortest length for which four steps are faster than one transform.
LONG_OF_MKL = 2**16  # Longest length for which MKL is used in one step; powers of 2 always are.
BATCH = 2**15  # Most numbers in a batch of short vectors: as many as stay in the cache.


class OneStep:
    """Transforms of one length in one step: short vectors, or lengths without suitable factors."""

    def __init__(self, length: int, dtype: DTypeLike) -> None:
        self.length = length
        self.dtype = np.dtype(dtype)
        self._kept: dict[tuple[float, ...], tuple[list[Any], list[Any], str]] = {}
        # Functions that multiply one vector, each with its own memory; a thread removes one to use.
        self._spare: defaultdict[Any, list[Callable[[Array, Array], Array]]] = defaultdict(list)

    def __reduce__(self) -> Any:
        return OneStep, (self.length, self.dtype)

    def astype(self, dtype: DTypeLike) -> "OneStep":
        """Return the plan for another precision."""
        return self if self.dtype == dtype else OneStep(self.length, dtype)

    def weights(self, shift: float) -> Array:
        """Return the factors exp(-2πi j s/L) of a nonzero shift, shape (L,)."""
        return self._turns((shift,))[0][0]

    def _turns(self, shifts: tuple[float, ...]) -> tuple[list[Any], list[Any], str]:
        """Return the factors of shifts, those for the inverse, and the norm of the inverse.

        Factors are None for a shift of 0. If no shift is 0, the inverse transform has a factor 1/L,
        as in `multiply_vector`, and the factors for the inverse contain L to compensate.
        """
        if shifts not in self._kept:
            w = {shift: phase_factors(self.length, shift, self.dtype) for shift in shifts if shift}
            scale = self.dtype.type(self.length if all(shifts) else 1)
            back = {shift: factors.conj() * scale for shift, factors in w.items()}
            norm = "backward" if all(shifts) else "forward"
            self._kept[shifts] = [*map(w.get, shifts)], [*map(back.get, shifts)], norm
        return self._kept[shifts]

    def spectrum(self, real: Array, imag: Array | None, shift: float) -> Array:
        """Return the transform of a vector at the frequencies k + s.

        Parameters
        ----------
        real, imag : ndarray of shape (L,)
            The real and imaginary part of the vector; `imag` may be None for zero.
        shift : float
            The shift s.
        """
        column = real if imag is None else real + 1j * imag
        return fourier.fft(
            column * self.weights(shift) if shift else column, overwrite_x=bool(shift)
        )

    def parts(self, spectrum: Array, shift: float) -> tuple[Array, Array]:
        """Return the real and the imaginary part of the inverse transform of a spectrum."""
        vector = fourier.ifft(spectrum) * self.weights(shift).conj()
        return vector.real, vector.imag

    def in_order(self, spectrum: Array) -> Array:
        """Return a spectrum in the order of the frequencies."""
        return spectrum

    def eigenvalues(self, spectrum: Array) -> Array:
        """Return a spectrum in the form that `multiply` needs."""
        spectrum = spectrum / self.length
        if np.iscomplexobj(spectrum):
            return spectrum.astype(self.dtype)
        # Each is repeated, for the real and the imaginary part of the number it multiplies.
        return np.repeat(spectrum, 2).astype(self.dtype.char.lower())

    def multiply(self, X: Array, factors: Factors, out: Array) -> None:
        """Write the products of rows with a sum of matrix products to `out`.

        Parameters
        ----------
        X, out : ndarray of shape (rows, n), n ≤ L
            Rows are extended by zeros to length L, and the results are cropped to n. If `out` is
            real, it receives the real part.
        factors : sequence of (tuple of float, sequence of ndarray)
            The first factors of all terms of the sum, then the second ones, and so on: the shifts
            of the frequencies that diagonalise them, and their `eigenvalues`.
        """
        n, L, count, times = X.shape[1], self.length, len(factors[0][0]), np.multiply
        stages = [(*self._turns(shifts), spectra) for shifts, spectra in factors]

        def work(part: slice) -> None:
            x = X[part]
            Z = workspace((count * len(x), L), self.dtype)
            cuts = terms = [Z] if count == 1 else list(Z.reshape(count, -1, L))
            if n < L:
                cuts = [z[:, :n] for z in terms]
                Z[:, n:] = 0.0
            for z, w in zip(cuts, stages[0][0], strict=True):
                if w is None:
                    z[...] = x
                else:
                    times(x, w[:n], z)
            for k, (turns, turns_back, norm, spectra) in enumerate(stages):
                if k:
                    _turn(terms, turns)
                fourier.forward(Z)
                for z, eigenvalues in zip(terms, spectra, strict=True):
                    numbers = z.view(eigenvalues.dtype)  # Real pairs if eigenvalues are real.
                    numbers *= eigenvalues
                fourier.backward(Z, norm=norm)
                _turn(terms, turns_back)
            total, *others = cuts
            for other in others:
                total += other
            out[part] = total if out.dtype.kind == "c" else total.real

        share_slices(work, len(X), max(1, BATCH // (count * L)), len(X) * count * L)

    def multiply_vector(self, x: Array, eigenvalues: Array) -> Array:
        """Return the result of `multiply` for one real vector and a shift of 1/4, faster."""
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
        """Return `multiply_vector` for length n, bound to its own memory and transforms."""
        Z = np.zeros(self.length, self.dtype)
        pairs = Z.view(self.dtype.char.lower())
        cut, rest, real = Z[:n], Z[n:], Z.real[:n]
        w, w_conj = (turns[0][:n] for turns in self._turns((0.25,))[:2])
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


def _turn(terms: list[Array], turns: list[Any]) -> None:
    for z, w in zip(terms, turns, strict=True):
        if w is not None:
            np.multiply(z, w, z)


def phase_factors(length: int, shift: float, dtype: np.dtype[Any]) -> Array:
    """Return the factors exp(-2πi j s/L) for j = 0 … L - 1, in a complex dtype."""
    return np.asarray(np.exp(-2j * np.pi * shift / length * np.arange(length)), dtype)


def plan_of(n: int, dtype: DTypeLike, *, exact: bool = False) -> OneStep | FourStep:
    """Return a plan for vectors of length n: of the next fast length, or of length n if `exact`."""
    precision, by_mkl = np.result_type(dtype, np.complex64).char, isinstance(fourier.library(), MKL)
    plan = _plan(n, precision, by_mkl)
    return OneStep(n, precision) if exact and plan.length != n else plan


@lru_cache(maxsize=64)
def _plan(n: int, precision: str, by_mkl: bool) -> OneStep | FourStep:
    if n < LONG or (by_mkl and n <= LONG_OF_MKL):
        return OneStep(next_fast_len(n), precision)
    rows, columns = near_square(n)
    at_once = by_mkl and (rows * columns).bit_count() == 1  # MKL is fast for powers of 2.
    return OneStep(rows * columns, precision) if at_once else FourStep(rows, columns, precision)


def in_batches(multiply: Callable[[Array, Array], None], X: Array, out: Array, size: int) -> None:
    """Multiply rows, whose transforms have `size` numbers each, into `out`.

    Threads share batches of short rows. Long rows are multiplied one at a time, because `multiply`
    itself uses threads for each.
    """

    def work(rows: slice) -> None:
        multiply(X[rows], out[rows])

    if TRANSFORM * size < WORTH_THREADS:
        share_slices(work, len(X), max(1, BATCH // size), TRANSFORM * len(X) * size)
        return
    for k in range(len(X)):
        work(slice(k, k + 1))


def cosine_sums(column: Array) -> Array:
    """Return f_k = Σ a_j cos(πjk/n) over one period 2 n of the even a, for k = 0 … n.

    This is a DCT-I along each axis. It is its own inverse up to a factor 2 n for each axis.

    Parameters
    ----------
    column : ndarray of shape (n + 1, ...), float64
    """
    count_transforms(1, *(m - 1 for m in column.shape))  # Half as long as those in a product.
    # The last axis is transformed first, as in `slabs`, so that the bits are the same.
    return fourier.dctn(column, type=1, axes=range(column.ndim)[::-1])
