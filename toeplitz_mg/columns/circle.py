"""Polynomials on the unit circle: their values at many points, and back, and their zeros.

Of a real series of length up to m the values at z = exp(-iθ), θ = 2π(k + 1/4)/m, k = 0 … m - 1, and
their conjugates are those at 2 m points at equal distances, with z²ᵐ = -1. They are one complex
transform of length m, of nothing but the series, where a real one of length 2 m has it half filled
with zeros; and long ones are faster, in `panels`. Of a complex series they are those at the roots
of unity.

All values are in the order of the plan, which elementwise operations need not know.
"""

from dataclasses import dataclass
from math import pi, tan
from typing import Any, Protocol

import numpy as np
from scipy.fft import next_fast_len

from toeplitz_mg._typing import Array
from toeplitz_mg.engine import fourier
from toeplitz_mg.engine.transforms import plan_of
from toeplitz_mg.engine.work import count_transforms

SHIFT = 0.25  # Of the frequencies, with which the conjugates of the points are between them.
OVERSAMPLING = 4  # Samples for each coefficient: the phase may turn 3π/4 between two.


class Circle(Protocol):
    """Points at equal distances on the unit circle.

    Attributes
    ----------
    points : int
        How many: N.
    """

    points: int

    def values(self, x: Array) -> Array:
        """Return Σ xⱼ zʲ at the points, of a series of length up to N/2."""

    def coefficients(self, values: Array, n: int) -> Array:
        """Return the mean of the values times z⁻ʲ over all points, j = 0 … n - 1, n ≤ N.

        That is coefficient j of what has these values, and what wraps around: coefficient j + N
        with the sign of zᴺ, and so on. Real values have the same coefficients at j and -j,
        conjugate where they are complex.
        """

    def path(self, x: Array, values: Array) -> Array:
        """Return the values of x in the order of θ: of a real series those from 1 to -1."""


class HalfCircle:
    """The circle for real series, of which the values at half of the points are kept."""

    def __init__(self, points: int) -> None:
        self._plan = plan_of(-(-points // 2), np.float64)
        self.points = 2 * self._plan.length

    def values(self, x: Array) -> Array:
        """See `Circle`."""
        count_transforms(1, self.points)
        if len(x) < self._plan.length:
            extended = np.zeros(self._plan.length)
            extended[: len(x)] = x
            x = extended
        return self._plan.spectrum(x, None, SHIFT)

    def coefficients(self, values: Array, n: int) -> Array:
        """See `Circle`."""
        count_transforms(1, self.points)
        # At j + m the factors exp(iθj) are those at j times i.
        real, imag = self._plan.parts(values, SHIFT)
        return real[:n] if n <= len(real) else np.append(real, -imag[: n - len(real)])

    def path(self, x: Array, values: Array) -> Array:
        """See `Circle`."""
        z = self._plan.in_order(values)
        path = np.empty(len(z) + 2, z.dtype)
        path[0], path[-1] = x.sum(), x[::2].sum() - x[1::2].sum()
        path[1:-1:2] = z[: -(-len(z) // 2)]
        np.conjugate(z[: -(-len(z) // 2) - 1 : -1], out=path[2:-1:2])
        return path


class FullCircle:
    """The circle for complex series."""

    def __init__(self, points: int) -> None:
        self.points = next_fast_len(points)

    def values(self, x: Array) -> Array:
        """See `Circle`."""
        count_transforms(1, self.points)
        return np.asarray(fourier.fft(x, self.points))

    def coefficients(self, values: Array, n: int) -> Array:
        """See `Circle`."""
        count_transforms(1, self.points)
        return np.asarray(fourier.ifft(values)[:n])

    def path(self, x: Array, values: Array) -> Array:
        """See `Circle`; the last point is the first one."""
        return np.append(values, values[:1])


def circle_of(points: int, dtype: np.dtype[Any]) -> Circle:
    """Return a circle of so many points at least, for series of this kind of numbers."""
    return FullCircle(points) if dtype.kind == "c" else HalfCircle(points)


@dataclass(frozen=True)
class Certificate:
    """What the polynomial x(z) = Σ xₖ zᵏ on the unit circle says of the formula from the column x.

    The formula is the Schur-Cohn form of that polynomial: positive definite exactly if x(z) has
    no zero in the closed unit disc. Then it is a leading block of the inverse of a matrix whose
    symbol is x₀/|x|², and its condition is at most that of this symbol.

    Attributes
    ----------
    positive : bool
        Whether it is positive definite for certain. Where it is not, it still may be.
    condition : float
        max|x|²/min|x|² of the samples.
    resolved : bool
        Whether it is known: that it is positive, or that the formula is not.

    Notes
    -----
    Of N samples x is known to have no such zero where the phase turns by less than π (1 - n/N)
    from each sample to the next, and by 0 in all. For let Z > 0 zeros lie in the disc, so that in
    truth the phase turns by 2πZ. From a sample to the next it turns by less than π n/N, and more
    by π times the share of that arc in the harmonic measures of these zeros, which are Z in all.
    Where it is seen to turn by more than -π (1 - n/N), and in truth turns by 2πk more than seen,
    these shares are above 2k - 1 ≥ k. The sum of k over all arcs is Z, so that those of the
    positive k have shares above Z, which there are not.
    """

    positive: bool
    condition: float
    resolved: bool

    @classmethod
    def of(cls, x: Array, oversampling: int = OVERSAMPLING) -> "Certificate":
        """Sample the polynomial, at the cost of one work unit; with more samples more."""
        x = x.astype(np.result_type(x, np.float64))
        circle = circle_of(oversampling * len(x), x.dtype)
        x = x / (np.abs(x).max() or 1.0)  # Then no square overflows.
        return cls.of_values(x, circle, circle.values(x))

    @classmethod
    def of_values(cls, x: Array, circle: Circle, values: Array) -> "Certificate":
        """Look at the values of the polynomial on a circle."""
        z = circle.path(x, values)
        squares = z.real**2 + z.imag**2
        smallest, largest = float(squares.min()), float(squares.max())
        if not smallest > 0.0:
            return cls(False, np.inf, True)
        if len(x) == 1:  # A constant does not turn.
            return cls(bool(x[0].real > 0.0), 1.0, True)
        # Of a real x the turns are those on the upper half of the circle, which the lower half
        # mirrors.
        turn = z[1:] * z[:-1].conj()
        # The cotangent of a turn is above that of a larger one.
        farthest = 1.0 / tan(pi * (1.0 - len(x) / circle.points))
        resolved = bool((turn.real > farthest * np.abs(turn.imag)).all())
        positive = x[0].real > 0.0 and resolved and _count_turns(z, turn.imag > 0.0) == 0
        return cls(bool(positive), largest / smallest, resolved)


def _count_turns(z: Array, is_left: Array) -> int:
    """Return how often a path goes around zero, in half turns where it ends opposite its start.

    It crosses the negative real axis where the imaginary part changes its sign while it turns from
    above to the left, or from below to the right; each turn is less than half of one.
    """
    above = z.imag >= 0.0
    leaves = above[:-1] & ~above[1:] & is_left
    enters = ~above[:-1] & above[1:] & ~is_left
    crossings = int(np.count_nonzero(leaves)) - int(np.count_nonzero(enters))
    return round((np.angle(z[-1]) - np.angle(z[0])) / np.pi) + 2 * crossings
