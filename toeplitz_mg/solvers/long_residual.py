"""Residuals of Toeplitz systems with more digits than double precision has, by exact products.

The leading digits of a column c and of a vector x, some 20 bits of each, are integers but for a
scale, and so is their product: the transforms have it to less than one half, and rounded it is
exact. The products with the digits that are left are so much smaller, and their rounding with them.
A solution that is corrected by such a residual is right to its last digits, where one that is
corrected by a residual in double precision has an error that grows with the condition number.
"""

from dataclasses import dataclass
from functools import cached_property
from math import floor, log2

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.columns.circle import Circle, circle_of
from toeplitz_mg.columns.columns import EPS
from toeplitz_mg.engine.vectors import norm

UNSURE = 0.1  # Error of a product of integers, by transforms, that rounding removes for certain.


@dataclass(frozen=True)
class LongResidual:
    """The residuals of a symmetric or Hermitian Toeplitz matrix.

    Attributes
    ----------
    c : ndarray of float64 or complex128, of shape (n,)
        The first column of A, c₀ real.
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
        """The scale of c, and the eigenvalues of its leading digits and of the others."""
        scale, *parts = self._split(self.c)
        # Those of c and its conjugate mirror image.
        leading, rest = (2.0 * self._circle.values(part).real - part[0].real for part in parts)
        return scale, leading, rest

    def _split(self, v: Array) -> tuple[float, Array, Array]:
        """Return a scale, integers, and what v is more than these over the scale.

        The transforms of a product of vectors have errors as large as the rounding of the product
        of their norms: that is what there is for both, and half of its digits for each.
        """
        most = log2(UNSURE / (EPS * log2(2 * self._circle.points))) / 2
        scale = 2.0 ** floor(most - log2(norm(v)))
        integers = np.rint((scale * v).view(np.float64)).view(v.dtype)
        return scale, integers, v - integers / scale
