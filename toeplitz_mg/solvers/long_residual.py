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
from scipy import fft

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.vectors import norm
from toeplitz_mg.engine.work import count_transforms

EPS = float(np.finfo(np.float64).eps)
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
        n, (scale, column, column_rest) = len(x), self._column
        x_scale, leading, rest = self._split(x)
        count_transforms(4, self._length)
        vector, vector_rest = (self._transform(part) for part in (leading, rest))
        exact = self._transform_back(column * vector)[:n]
        np.rint(exact.view(np.float64), out=exact.view(np.float64))
        small = column_rest * (vector / x_scale + vector_rest) + column * (vector_rest / scale)
        return np.asarray(b - exact / (scale * x_scale) - self._transform_back(small)[:n])

    @cached_property
    def _length(self) -> int:
        return fft.next_fast_len(2 * len(self.c) - 1, real=not self._is_complex)

    @property
    def _is_complex(self) -> bool:
        return self.c.dtype.kind == "c"

    @cached_property
    def _column(self) -> tuple[float, Array, Array]:
        """The scale of c, and the eigenvalues of its leading digits and of the others."""
        scale, *parts = self._split(self.c)
        count_transforms(2, self._length)
        eigenvalues = []
        for part in parts:
            circulant = np.zeros(self._length, part.dtype)
            circulant[: len(part)] = part
            circulant[self._length - len(part) + 1 :] = part[:0:-1].conj()
            eigenvalues.append(self._transform(circulant).real)
        return scale, eigenvalues[0], eigenvalues[1]

    def _split(self, v: Array) -> tuple[float, Array, Array]:
        """Return a scale, integers, and what v is more than these over the scale.

        The transforms of a product of vectors have errors as large as the rounding of the product
        of their norms: that is what there is for both, and half of its digits for each.
        """
        most = log2(UNSURE / (EPS * log2(2 * self._length))) / 2
        scale = 2.0 ** floor(most - log2(norm(v)))
        integers = np.rint((scale * v).view(np.float64)).view(v.dtype)
        return scale, integers, v - integers / scale

    def _transform(self, x: Array) -> Array:
        return (fft.fft if self._is_complex else fft.rfft)(x, self._length)

    def _transform_back(self, hat: Array) -> Array:
        return fft.ifft(hat) if self._is_complex else fft.irfft(hat, self._length)
