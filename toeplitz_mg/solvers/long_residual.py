"""Residuals of Toeplitz systems with more digits than double precision, by exact products.

The leading digits, about 20 bits, of a column c and of a vector x are integers up to a scale, and
so is their product. The transforms compute it with an error below one half, so rounding makes it
exact. The products with the remaining digits are much smaller, and so are their rounding errors. A
solution corrected by such a residual is right to its last digits. With a residual in double
precision the error of the solution would grow with the condition number.
"""

from dataclasses import dataclass
from functools import cached_property
from math import floor, log2

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.columns.circle import Circle, circle_of
from toeplitz_mg.columns.columns import EPS
from toeplitz_mg.engine.vectors import norm

UNSURE = 0.1  # Largest error of a product of integers by transforms for which rounding is safe.


@dataclass(frozen=True)
class LongResidual:
    """The residuals of a symmetric or Hermitian Toeplitz system.

    Attributes
    ----------
    c : ndarray of float64 or complex128, of shape (n,)
        The first column of A, with c₀ real.
    """

    c: Array

    def __call__(self, b: Array, x: Array) -> Array:
        """Return b - A x."""
        if not x.any():
            return b.copy()
        circle, n, (scale, column, column_rest) = self._circle, len(x), self._column
        x_scale, leading, rest = self._split(x)
        vector, vector_rest = circle.values(leading), circle.values(rest)
        exact = circle.coefficients(column * vector, n)
        np.rint(exact.view(np.float64), out=exact.view(np.float64))
        small = column_rest * (vector / x_scale + vector_rest) + column * (vector_rest / scale)
        return np.asarray(b - exact / (scale * x_scale) - circle.coefficients(small, n))

    @cached_property
    def _circle(self) -> Circle:
        return circle_of(2 * len(self.c) - 1, self.c.dtype)

    @cached_property
    def _column(self) -> tuple[float, Array, Array]:
        """The scale of c, and the eigenvalues of its leading and of its remaining digits."""
        scale, *parts = self._split(self.c)
        # For a Hermitian matrix: the values of c and of its conjugate mirror image.
        leading, rest = (2.0 * self._circle.values(part).real - part[0].real for part in parts)
        return scale, leading, rest

    def _split(self, v: Array) -> tuple[float, Array, Array]:
        """Return a scale, integers, and the difference between v and the integers/scale.

        The rounding errors of the transforms are proportional to the product of the norms. That
        limits the digits of both vectors together; each gets half of them.
        """
        most = log2(UNSURE / (EPS * log2(2 * self._circle.points))) / 2
        scale = 2.0 ** floor(most - log2(norm(v)))
        integers = np.rint((scale * v).view(np.float64)).view(v.dtype)
        return scale, integers, v - integers / scale
