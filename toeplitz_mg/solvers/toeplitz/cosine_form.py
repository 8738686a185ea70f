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
from toeplitz_mg.engine.lengths import work_of_transform
from toeplitz_mg.engine.row_transforms import dct, dst, packed_irfft, packed_rfft, rfft
from toeplitz_mg.engine.work import count_transforms

STEEP = 0.5  # Slope of the last two coefficients, over the last, that is none of a smooth function.
ENDED = 1e-13  # The last two coefficients, over the first, below which those that follow are zero.
# Work of a transform over that of a longer, faster one, above which six of these were measured to
# be sooner there than four of the others. (Large factors cost somewhat more than their sum.)
SLOW = 1.4
ZERO = 1e-7  # Sample at θ = 0, over that at π, below which the symbol has a zero.


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
        Whether the lags that A has not are zero (see the function of that name).
    """

    def __init__(self, c: Array) -> None:
        n = len(c)
        m = fast_length(n)
        self.n = n
        self.m = m
        start = (m - n) // 2
        self.middle = slice(start, start + n)
        self._c = c
        self.has_ended = has_ended(c)
        # The lags of c and of what may follow it, each as often as the circulant has it. Their
        # cosines are the samples; their sines are for entries of C A Cᵀ, and for those on its
        # diagonal the cosines of the second row, which has Fejér's weights.
        lags = np.empty((2, m + 1))
        lags[0, :n] = c
        lags[0, n:] = _continue(c, m - n + 1)
        lags[0, 1:m] *= 2.0
        np.multiply(lags[0], 1.0 - np.arange(m + 1) / m, out=lags[1])
        count_transforms(2, 2 * m)
        sums, of_fejer = rfft(_extend(lags, 2 * m))
        self.samples = sums.real.copy()
        self._sines, self._of_fejer = sums.imag.copy(), of_fejer.real.copy()

    @cached_property
    def _halves(self) -> tuple[Array, Array]:
        """Half the samples in the order of the DCT, and in that of the DST, at θ = πk/m."""
        half = 0.5 * self.samples
        return half[:-1], half[1:]

    def alternated(self) -> "CosineForm":
        """Return the form of D A D, whose symbol is f(π - θ): every second lag has another sign."""
        return CosineForm(alternate(self._c))

    def multiply(self, X: Rows) -> Rows:
        """Multiply rows of length n by A, as a block of the circulant."""
        count_transforms(2 * (X.size // self.n), 2 * self.m)
        return self._multiply(X)

    def _multiply(self, X: Rows) -> Rows:
        Y = packed_rfft(_extend(X, 2 * self.m), overwrite_x=True)
        Y *= self._packed
        return packed_irfft(Y, overwrite_x=True)[..., : self.n]

    @cached_property
    def _packed(self) -> Array:
        """The samples, each for the real and the imaginary part of its frequency."""
        return np.repeat(self.samples, 2)[1:-1]

    def transform(self, X: Rows) -> Rows:
        """Return rows of length n in the domain of the transform, of length m."""
        extended = np.zeros((*X.shape[:-1], self.m))
        extended[..., self.middle] = X
        return dct(extended, 2)

    def transform_back(self, Y: Rows) -> Rows:
        """Return the rows of length n that rows in the domain of the transform stand for."""
        return dct(Y.copy(), 3)[..., self.middle]

    def multiply_transformed(self, P: Rows, memory: Rows) -> Rows:
        """Multiply rows in the domain of the transform by A: of longer ones, the middle.

        The product may be in `memory`, of the shape of P, whose numbers are lost.
        """
        if self.m > self.n:
            memory[...] = 0.0
            memory[..., self.middle] = self._multiply(self.transform_back(P))
            return dct(memory, 2)
        cosine, sine = self._halves
        memory[...] = P
        Y = dst(dct(memory, 3), 2)
        Y *= sine
        Y = dct(dst(Y, 3), 2)
        Y += cosine * P
        return Y

    def count_iterations(self, iterations: int, rows: int) -> None:
        """Count the transforms of so many iterations, and those of the vectors to and fro."""
        each = 4 if self.m == self.n else 6
        count_transforms((each * iterations + 2) * rows, self.m)

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

    @property
    def has_zero(self) -> bool:
        """Whether the symbol has a zero at θ = 0."""
        return bool(self.samples[0] <= ZERO * self.samples[-1])

    @property
    def has_zero_at_end(self) -> bool:
        """Whether the symbol has a zero at θ = π."""
        d, c, b, a = self.samples[-4:].tolist()
        return a + b < (b + 2.0 * c + d) / 4.0  # The means at the last one and two before it.


def _extend(X: Rows, length: int) -> Rows:
    """Return rows with zeros behind them."""
    extended = np.zeros((*X.shape[:-1], length))
    extended[..., : X.shape[-1]] = X
    return extended


def has_ended(c: Array) -> bool:
    """Whether the lags that follow those of a first column are zero, but for rounding."""
    before, last = c[-2:].tolist()
    return max(abs(before), abs(last)) <= ENDED * abs(float(c[0]))


def alternate(X: Rows) -> Rows:
    """Return rows of which every second number has another sign."""
    Y = X.copy()
    Y[..., 1::2] *= -1.0
    return Y


def _continue(c: Array, number: int) -> Array | float:
    """Return numbers for so many lags that A has not, for which any are right.

    They follow the parabola that is flat at the last of them. But where the last two of A tell of
    no slope, they are zero.
    """
    before, last = c[-2:].tolist()
    slope = last - before
    if abs(slope) > STEEP * abs(last):
        return 0.0
    t = np.arange(1.0, number + 1.0)
    return last + slope * t * (1.0 - t / (2.0 * number))


@lru_cache(maxsize=64)
def fast_length(n: int) -> int:
    """Return n, or where its transforms are slow, a length that is above it by an even number."""
    m = next(m for m in count(n, 2) if is_smooth(m))
    return n if work_of_transform(n) <= SLOW * work_of_transform(m) else m


def is_smooth(m: int) -> bool:
    """Whether a length has no prime factor above 7, and so the fastest transforms."""
    return 210**16 % m == 0
