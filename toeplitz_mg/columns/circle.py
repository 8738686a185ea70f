"""Values of polynomials on the unit circle, their coefficients, and their zeros in the disc.

A real series of length up to m is evaluated at z = exp(-iθ), θ = 2π(k + 1/4)/m, k = 0 … m - 1. With
their conjugates these are 2 m equidistant points with z²ᵐ = -1. They need one complex transform of
length m, without the zero padding of a real transform of length 2 m, and long ones are faster in
four steps. A complex series is evaluated at the roots of unity.

The values are in the order of the plan, which does not matter for elementwise operations.
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

SHIFT = 0.25  # Shift of the frequencies: the conjugate points then lie halfway between the points.
OVERSAMPLING = 4  # Samples per coefficient: the phase may then turn by 3π/4 between two samples.


class Circle(Protocol):
    """Equidistant points on the unit circle.

    Attributes
    ----------
    points : int
        The number of points, N.
    """

    points: int

    def values(self, x: Array) -> Array:
        """Return Σ xⱼ zʲ at the points, for a series x of length up to N/2."""

    def coefficients(self, values: Array, n: int) -> Array:
        """Return the mean of the values times z⁻ʲ over all points, j = 0 … n - 1, n ≤ N.

        This is coefficient j of the function with these values, plus its aliases: coefficient j + N
        times zᴺ = ±1, and so on. For real values the coefficients at j and -j are conjugate.
        """

    def path(self, x: Array, values: Array) -> Array:
        """Return the values of x in the order of θ; for a real series only those from 1 to -1."""


class HalfCircle:
    """The circle for real series, which stores the values at half of the points."""

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
    """Return a circle with at least this number of points, for series of this dtype."""
    return FullCircle(points) if dtype.kind == "c" else HalfCircle(points)


@dataclass(frozen=True)
class Certificate:
    """Bounds on the inverse with the first column x, from x(z) = Σ xₖ zᵏ on the unit circle.

    The Gohberg-Semencul formula is the Schur-Cohn form of that polynomial: it is positive definite
    if and only if x(z) has no zero in the closed unit disc. Then it is a leading block of the
    inverse of a matrix with the symbol x₀/|x|², whose condition number bounds that of the formula.

    Attributes
    ----------
    positive : bool
        Whether the formula is certainly positive definite. If False, it may still be.
    condition : float
        max|x|²/min|x|² of the samples.
    resolved : bool
        Whether the samples decide: the formula is positive definite, or it is not.

    Notes
    -----
    From N samples it is certain that x has no such zero if the phase turns by less than π (1 - n/N)
    from each sample to the next, and by 0 in total. Proof: suppose that the disc has Z > 0 zeros,
    so the true total turn is 2πZ. The true turn over one arc is below π n/N plus π times the arc's
    share of the harmonic measures of these zeros, which sum to Z. If the observed turn is above -π
    (1 - n/N) and the true one larger by 2πk, that share is above 2k - 1 ≥ k. The sum of k over all
    arcs is Z, so the arcs with k > 0 have shares above Z in total, a contradiction.
    """

    positive: bool
    condition: float
    resolved: bool

    @classmethod
    def of(cls, x: Array, oversampling: int = OVERSAMPLING) -> "Certificate":
        """Sample the polynomial; with the default `oversampling` this costs one work unit."""
        x = x.astype(np.result_type(x, np.float64))
        circle = circle_of(oversampling * len(x), x.dtype)
        x = x / (np.abs(x).max() or 1.0)  # The squares cannot overflow then.
        return cls.of_values(x, circle, circle.values(x))

    @classmethod
    def of_values(cls, x: Array, circle: Circle, values: Array) -> "Certificate":
        """Derive the bounds from the values of the polynomial on a circle."""
        z = circle.path(x, values)
        squares = z.real**2 + z.imag**2
        smallest, largest = float(squares.min()), float(squares.max())
        if not smallest > 0.0:
            return cls(False, np.inf, True)
        if len(x) == 1:  # A constant does not turn.
            return cls(bool(x[0].real > 0.0), 1.0, True)
        # For a real x these turns are those on the upper half circle; the lower half mirrors them.
        turn = z[1:] * z[:-1].conj()
        # The cotangent decreases with the angle.
        farthest = 1.0 / tan(pi * (1.0 - len(x) / circle.points))
        resolved = bool((turn.real > farthest * np.abs(turn.imag)).all())
        positive = x[0].real > 0.0 and resolved and _count_turns(z, turn.imag > 0.0) == 0
        return cls(bool(positive), largest / smallest, resolved)


def _count_turns(z: Array, is_left: Array) -> int:
    """Return how often a path goes around zero; half turns if it ends opposite its start.

    Each turn is less than half a revolution. So the path crosses the negative real axis where its
    imaginary part changes sign during a left turn from above or a right turn from below.
    """
    above = z.imag >= 0.0
    leaves = above[:-1] & ~above[1:] & is_left
    enters = ~above[:-1] & above[1:] & ~is_left
    crossings = int(np.count_nonzero(leaves)) - int(np.count_nonzero(enters))
    return round((np.angle(z[-1]) - np.angle(z[0])) / np.pi) + 2 * crossings
