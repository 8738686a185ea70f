"""A symmetric Toeplitz matrix, and what approximates its inverse, in the domain of the DCT-II.

With C the DCT-II and S the DST-II A is ½ (Cᵀ Λ C + Sᵀ Λ' S), where Λ and Λ' are samples of one
function: the eigenvalues of any circulant of twice the size that has the lags of A. So C A Cᵀ is
½ (Λ + C Sᵀ Λ' S Cᵀ), whose product takes four transforms of real vectors, and six where the vector
is in the middle of a fast length.

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

ENDED = 1e-13  # The last two coefficients, over the first, below which those that follow are zero.
# Work of a transform over that of a longer, faster one, above which six of these were measured to
# be sooner there than four of the others. (Large factors cost somewhat more than their sum.)
SLOW = 1.4
# Sample of the symbol over the largest, below which it has a zero: those of (2 - 2 cos θ)² next to
# the lowest frequencies are so small from some 6000 unknowns on.
ZERO = 1e-7


class Points(NamedTuple):
    """Frequencies πk/m, and what the entries of C A Cᵀ there are made of (see `choose_points`).

    Attributes
    ----------
    frequencies : ndarray of shape (2, k), int
        Even numbers, and odd ones.
    kernel : ndarray of shape (2, k, k)
        Its columns times the sums of sines, plus the transpose, are the entries.
    of_diagonal : ndarray of shape (2, k)
        Times the sums of sines it is taken from Fejér's for the diagonal.
    """

    frequencies: Array
    kernel: Array
    of_diagonal: Array


def choose_points(m: int, frequencies: Array) -> Points:
    """Return what belongs to these frequencies for a length m, for sums S_i = -2 Σ c_j sin jθ_i.

    C A Cᵀ has the entries (e_i v_j - v_i e_j)/(cos θ_i - cos θ_j) where i - j is even and not zero,
    with e_i = w_i cos θ_i/2 and v_i = w_i S_i sin θ_i/2.
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
    """Return what entries of C A Cᵀ are made of: e, v without the sums of sines, and sin θ/2."""
    weights = np.sqrt(np.where(frequencies, 2.0, 1.0) / m)
    half_angles = np.pi / (2 * m) * frequencies
    sine = np.sin(half_angles)
    return weights * np.cos(half_angles), weights * sine, sine


def _differences(sine: Array, sine_at: Array) -> Array:
    """Return half of cos θ' - cos θ from sin θ/2 and sin θ'/2, without cancellation."""
    difference: Array = sine - sine_at
    difference *= sine + sine_at
    return difference


@lru_cache(maxsize=8)
def all_frequencies(m: int) -> Array:
    """Return the factors of entries at all frequencies, even ones and odd ones: (3, 2, half)."""
    return np.stack([by_parity(factor) for factor in _factors(m, np.arange(m))])


def by_parity(x: Array) -> Array:
    """Return even numbers of a vector in one row, and odd ones in another, with a zero if need be.

    The shape is (2, half).
    """
    rows = np.zeros((2, (len(x) + 1) // 2))
    rows[0], rows[1, : len(x) // 2] = x[::2], x[1::2]
    return rows


class CosineForm:
    """A symmetric Toeplitz matrix by cosine transforms of a fast length.

    That length m is n, or where n is a slow one, a longer one with the vector in its middle: the
    flip of the long vector is then that of the short one.

    Parameters
    ----------
    c : ndarray of shape (n,), float64
        First column, with n of 3 at least.

    Attributes
    ----------
    samples : ndarray of shape (m + 1,)
        The eigenvalues at θ = πk/m of the circulant of size 2 m.
    has_ended : bool
        Whether the lags that A has not are zero, but for rounding.
    has_zero, has_zero_at_end : bool
        Whether the symbol has a zero at θ = 0, or one at θ = π.
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
        # The lags of c, and m - n + 1 that A has not, for which any numbers are right: they follow
        # the parabola that is flat at the last of them, or are zero where c tells of no slope.
        lags = np.zeros((2, 2 * m))
        cosines, of_fejer = lags[:, : m + 1]
        cosines[:n] = c
        if abs(slope) <= SPIKE * abs(last):
            t = np.arange(1.0, m - n + 2)
            cosines[n:] = last + slope * t * (1.0 - t / (2.0 * (m - n + 1)))
        # Each as often as the circulant has it. Their cosines are the samples; their sines are for
        # entries of C A Cᵀ, and for those on its diagonal the cosines with Fejér's weights.
        cosines[1:m] *= 2.0
        np.multiply(cosines, 1.0 - np.arange(m + 1) / m, out=of_fejer)
        count_transforms(2, 2 * m)
        sums, of_fejer = rfft(lags)
        self.samples = sums.real.copy()
        self._sines, self._of_fejer = sums.imag.copy(), of_fejer.real.copy()
        self._half = 0.5 * self.samples
        # Each sample for the real and for the imaginary part of its frequency.
        self._packed = np.repeat(self.samples, 2)[1:-1]
        self.has_zero = bool(self.samples[0] <= ZERO * self.samples[-1])
        z, y, x, w = self.samples[-4:].tolist()
        self.has_zero_at_end = w + x < (x + 2.0 * y + z) / 4.0  # Means there and two before it.

    def alternated(self) -> "CosineForm":
        """Return the form of D A D, whose symbol is f(π - θ): every second lag has another sign."""
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
        """Return rows of length n in the domain of the transform, of length m."""
        count_transforms(X.size // self.n, self.m)
        extended = np.zeros((*X.shape[:-1], self.m))
        extended[..., self.middle] = X
        return dct(extended, 2)

    def transform_back(self, Y: Rows) -> Rows:
        """Return the rows of length n that rows in the domain of the transform stand for."""
        count_transforms(Y.size // self.m, self.m)
        return dct(Y.copy(), 3)[..., self.middle]

    def multiply_transformed(self, P: Rows, memory: Rows) -> Rows:
        """Multiply rows in the domain of the transform by A: of longer ones, the middle.

        The product may be in `memory`, of the shape of P, whose numbers are lost.
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
        """Return the entries of C A Cᵀ at some frequencies, shape (2, k, k): even ones, and odd."""
        S = self._sines[points.frequencies]
        N = points.kernel * S[:, np.newaxis]
        B = N + N.swapaxes(1, 2)
        diagonals = B.reshape(2, -1)[:, :: B.shape[-1] + 1]
        diagonals[...] = self._of_fejer[points.frequencies] - points.of_diagonal * S
        return B

    @cached_property
    def _parts(self) -> Array:
        """The parts e and v of the entries of C A Cᵀ, and sin θ/2."""
        parts = all_frequencies(self.m).copy()
        parts[1] *= by_parity(self._sines[:-1])
        return parts

    def rows(self, frequencies: Array) -> Array:
        """Return some rows of C A Cᵀ, whose frequencies are of one parity, at all others of it.

        Parameters
        ----------
        frequencies : ndarray of shape (k,), int
            All of them even, or all odd.

        Returns
        -------
        ndarray of shape (k, half)
            On the diagonal there are zeros: its entries are for `entries` to give.
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
    """Return rows of which every second number has another sign."""
    Y = X.copy()
    Y[..., 1::2] *= -1.0
    return Y


@lru_cache(maxsize=64)
def fast_length(n: int) -> int:
    """Return n, or where its transforms are slow, a length that is above it by an even number."""
    m = next(m for m in count(n, 2) if is_smooth(m))
    return n if work_of_transform(n) <= SLOW * work_of_transform(m) else m


def is_smooth(m: int) -> bool:
    """Whether a length has no prime factor above 7, and so the fastest transforms."""
    return 210**16 % m == 0
