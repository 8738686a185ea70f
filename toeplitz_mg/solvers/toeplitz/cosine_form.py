"""A symmetric Toeplitz matrix and its approximate inverse, in the domain of the DCT-II.

With the DCT-II C and the DST-II S, A = ½ (Cᵀ Λ C + Sᵀ Λ' S). Λ and Λ' are samples of one function:
the eigenvalues of any circulant of twice the size with the lags of A. So C A Cᵀ = ½ (Λ + C Sᵀ Λ' S
Cᵀ). Its product takes four transforms of real vectors, or six if the vector is padded to a fast
length.

References
----------
G. Heinig, A. Bojanczyk, Transformation techniques for Toeplitz and Toeplitz-plus-Hankel matrices,
Linear Algebra Appl. 254 (1997), for C A Cᵀ as a Cauchy-like matrix; A. L. Andrew, Eigenvectors of
certain matrices, Linear Algebra Appl. 7 (1973), for the even and the odd part of a vector.
"""

from functools import cached_property, lru_cache
from itertools import count
from typing import NamedTuple

import numpy as np

from toeplitz_mg._typing import Array, Rows
from toeplitz_mg.engine.fourier import dct, dst, packed_irfft, packed_rfft, rfft
from toeplitz_mg.engine.lengths import work_of_transform
from toeplitz_mg.engine.work import count_transforms
from toeplitz_mg.operators.symbol import SPIKE

ENDED = 1e-13  # Lags beyond the last are zero if the last two, over the first, are below this.
# A longer fast length is used if the work of a transform exceeds that of the fast one by this
# factor: six fast transforms then take less time, as measured, than four slow ones.
SLOW = 1.4
# The symbol has a zero if a sample, relative to the largest, is below this. The lowest samples of
# (2 - 2 cos θ)² are so small from some 6000 unknowns on.
ZERO = 1e-7


class Points(NamedTuple):
    """Frequencies πk/m, and factors for the entries of C A Cᵀ there (see `choose_points`).

    Attributes
    ----------
    frequencies : ndarray of shape (2, k), int
        Even and odd numbers.
    kernel : ndarray of shape (2, k, k)
        Its columns times the sums of sines, plus the transpose, are the entries.
    of_diagonal : ndarray of shape (2, k)
        Its products with the sums of sines are subtracted from Fejér's sums on the diagonal.
    """

    frequencies: Array
    kernel: Array
    of_diagonal: Array


def choose_points(m: int, frequencies: Array) -> Points:
    """Return the factors for these frequencies and the length m, with S_i = -2 Σ c_j sin jθ_i.

    For even i - j ≠ 0 the entries of C A Cᵀ are (e_i v_j - v_i e_j)/(cos θ_i - cos θ_j), with
    e_i = w_i cos θ_i/2 and v_i = w_i S_i sin θ_i/2.
    """
    rows, columns = np.s_[:, :, np.newaxis], np.s_[:, np.newaxis]
    e, v, sine = _factors(m, frequencies)
    difference = _differences(sine[rows], sine[columns])
    difference.reshape(2, -1)[:, :: difference.shape[-1] + 1] = np.inf
    kernel = -0.5 * e[rows] * v[columns] / difference
    of_diagonal = np.zeros(frequencies.shape)
    theta = np.pi / m * frequencies
    np.divide(-1.0 / m, np.sin(theta), out=of_diagonal, where=frequencies > 0)
    return Points(frequencies, kernel, of_diagonal)


def _factors(m: int, frequencies: Array) -> tuple[Array, Array, Array]:
    """Return the factors of entries of C A Cᵀ: e, v without the sums of sines, and sin θ/2."""
    weights = np.sqrt(np.where(frequencies, 2.0, 1.0) / m)
    half_angles = np.pi / (2 * m) * frequencies
    sine = np.sin(half_angles)
    return weights * np.cos(half_angles), weights * sine, sine


def _differences(sine: Array, sine_at: Array) -> Array:
    """Return (cos θ' - cos θ)/2 from sin θ/2 and sin θ'/2, without cancellation."""
    difference: Array = sine - sine_at
    difference *= sine + sine_at
    return difference


@lru_cache(maxsize=8)
def all_frequencies(m: int) -> Array:
    """Return the factors of entries at all frequencies, even and odd ones, shape (3, 2, half)."""
    return np.stack([by_parity(factor) for factor in _factors(m, np.arange(m))])


def by_parity(x: Array) -> Array:
    """Return the even and the odd entries of a vector as two rows, shape (2, half).

    A zero is appended if need be.
    """
    rows = np.zeros((2, (len(x) + 1) // 2))
    rows[0], rows[1, : len(x) // 2] = x[::2], x[1::2]
    return rows


class CosineForm:
    """A symmetric Toeplitz matrix by cosine transforms of a fast length.

    The length m is n if that is fast. Otherwise the vector is in the middle of a longer one, whose
    flip then is that of the vector.

    Parameters
    ----------
    c : ndarray of shape (n,), float64
        First column, with n ≥ 3.

    Attributes
    ----------
    samples : ndarray of shape (m + 1,)
        The eigenvalues at θ = πk/m of the circulant of size 2 m.
    has_ended : bool
        Whether the lags beyond those of A are zero up to rounding.
    has_zero, has_zero_at_end : bool
        Whether the symbol has a zero at θ = 0, or at θ = π.
    """

    def __init__(self, c: Array) -> None:
        n = len(c)
        m = fast_length(n)
        self.n = n
        self.m = m
        start = (m - n) // 2
        self.middle = slice(start, start + n)
        self._c = c
        before, last = c[-2:].tolist()
        slope = last - before
        self.has_ended = max(abs(before), abs(last)) <= ENDED * abs(float(c[0]))
        # The circulant has m - n + 1 lags more than A, which may have any values: use the parabola
        # that is flat at the last one, or zero if c defines no slope.
        lags = np.zeros((2, 2 * m))
        cosines, of_fejer = lags[:, : m + 1]
        cosines[:n] = c
        if abs(slope) <= SPIKE * abs(last):
            t = np.arange(1.0, m - n + 2)
            cosines[n:] = last + slope * t * (1.0 - t / (2.0 * (m - n + 1)))
        # Count each lag as often as the circulant has it. The sums of cosines are the samples.
        # Entries of C A Cᵀ need the sums of sines, diagonal ones those of cosines by Fejér.
        cosines[1:m] *= 2.0
        np.multiply(cosines, 1.0 - np.arange(m + 1) / m, out=of_fejer)
        count_transforms(2, 2 * m)
        sums, of_fejer = rfft(lags)
        self.samples = sums.real.copy()
        self._sines, self._of_fejer = sums.imag.copy(), of_fejer.real.copy()
        self._half = 0.5 * self.samples
        # Repeat each sample for the real and the imaginary part of its frequency.
        self._packed = np.repeat(self.samples, 2)[1:-1]
        self.has_zero = bool(self.samples[0] <= ZERO * self.samples[-1])
        z, y, x, w = self.samples[-4:].tolist()
        self.has_zero_at_end = w + x < (x + 2.0 * y + z) / 4.0  # The end lies below the mean there.

    def alternated(self) -> "CosineForm":
        """Return the form of D A D, D = diag(±1), with the symbol f(π - θ)."""
        return CosineForm(alternate(self._c))

    def multiply(self, X: Rows) -> Rows:
        """Multiply rows of length n by A, as a block of the circulant."""
        count_transforms(2 * (X.size // self.n), 2 * self.m)
        extended = np.zeros((*X.shape[:-1], 2 * self.m))
        extended[..., : self.n] = X
        Y = packed_rfft(extended, overwrite_x=True)
        Y *= self._packed
        return packed_irfft(Y, overwrite_x=True)[..., : self.n]

    def transform(self, X: Rows) -> Rows:
        """Return the transforms, of length m, of rows of length n."""
        count_transforms(X.size // self.n, self.m)
        extended = np.zeros((*X.shape[:-1], self.m))
        extended[..., self.middle] = X
        return dct(extended, 2)

    def transform_back(self, Y: Rows) -> Rows:
        """Return the rows of length n with these transforms."""
        count_transforms(Y.size // self.m, self.m)
        return dct(Y.copy(), 3)[..., self.middle]

    def multiply_transformed(self, P: Rows, memory: Rows) -> Rows:
        """Multiply transformed rows by A, which acts on the middle of longer vectors.

        The product may be returned in `memory`, of the shape of P, which is overwritten.
        """
        if self.m > self.n:
            memory[...] = 0.0
            memory[..., self.middle] = self.multiply(self.transform_back(P))
            count_transforms(P.size // self.m, self.m)
            return dct(memory, 2)
        count_transforms(4 * (P.size // self.m), self.m)
        memory[...] = P
        Y = dst(dct(memory, 3), 2)
        Y *= self._half[1:]
        Y = dct(dst(Y, 3), 2)
        Y += self._half[:-1] * P
        return Y

    def entries(self, points: Points) -> Array:
        """Return the entries of C A Cᵀ at some frequencies, even and odd ones, shape (2, k, k)."""
        S = self._sines[points.frequencies]
        N = points.kernel * S[:, np.newaxis]
        B = N + N.swapaxes(1, 2)
        diagonals = B.reshape(2, -1)[:, :: B.shape[-1] + 1]
        diagonals[...] = self._of_fejer[points.frequencies] - points.of_diagonal * S
        return B

    @cached_property
    def _parts(self) -> Array:
        """The factors e and v of the entries of C A Cᵀ, and sin θ/2."""
        parts = all_frequencies(self.m).copy()
        parts[1] *= by_parity(self._sines[:-1])
        return parts

    def rows(self, frequencies: Array) -> Array:
        """Return some rows of C A Cᵀ at all frequencies of the same parity.

        Parameters
        ----------
        frequencies : ndarray of shape (k,), int
            All even, or all odd.

        Returns
        -------
        ndarray of shape (k, half)
            The entries on the diagonal are zero; use `entries` for them.
        """
        parity, at = int(frequencies[0]) % 2, frequencies // 2
        here = np.arange(len(at)), at
        e, v, sine = self._parts[:, parity, : (self.m + 1 - parity) // 2]
        e_at, v_at, sine_at = (part[at, np.newaxis] for part in (e, v, sine))
        rows = (0.5 * e_at) * v
        rows -= (0.5 * v_at) * e
        difference = _differences(sine, sine_at)
        difference[here] = np.inf
        rows /= difference
        return rows


def alternate(X: Rows) -> Rows:
    """Return rows with the sign of every second entry changed."""
    Y = X.copy()
    Y[..., 1::2] *= -1.0
    return Y


@lru_cache(maxsize=64)
def fast_length(n: int) -> int:
    """Return n, or a longer length of the same parity if transforms of length n are slow."""
    m = next(m for m in count(n, 2) if is_smooth(m))
    return n if work_of_transform(n) <= SLOW * work_of_transform(m) else m


def is_smooth(m: int) -> bool:
    """Whether a length has no prime factor above 7, so that transforms are fastest."""
    return 210**16 % m == 0
