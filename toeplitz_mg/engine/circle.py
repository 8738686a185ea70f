"""Polynomials on the unit circle: their values at many points, and back.

Of a real series of length up to m the values at z = exp(-iθ), θ = 2π(k + 1/4)/m, k = 0 … m - 1, and
their conjugates are those at 2 m points at equal distances, with z²ᵐ = -1. They are one complex
transform of length m, of nothing but the series, where a real one of length 2 m has it half filled
with zeros; and long ones are faster, in `panels`. Of a complex series they are those at the roots
of unity.

All values are in the order of the plan, which elementwise operations need not know.
"""

from typing import Any, Protocol

import numpy as np
from scipy import fft

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.transforms import plan_of
from toeplitz_mg.engine.work import count_transforms

SHIFT = 0.25  # Of the frequencies, with which the conjugates of the points are between them.


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
        self.points = fft.next_fast_len(points)

    def values(self, x: Array) -> Array:
        """See `Circle`."""
        count_transforms(1, self.points)
        return np.asarray(fft.fft(x, self.points))

    def coefficients(self, values: Array, n: int) -> Array:
        """See `Circle`."""
        count_transforms(1, self.points)
        return np.asarray(fft.ifft(values)[:n])

    def path(self, x: Array, values: Array) -> Array:
        """See `Circle`; the last point is the first one."""
        return np.append(values, values[:1])


def circle_of(points: int, dtype: np.dtype[Any]) -> Circle:
    """Return a circle of so many points at least, for series of this kind of numbers."""
    return FullCircle(points) if dtype.kind == "c" else HalfCircle(points)
