"""A Toeplitz system of any size, with the quickest product of its matrix."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from math import sqrt

import numpy as np
import scipy.linalg

from toeplitz_mg._typing import Array, Rows
from toeplitz_mg.operators import ToeplitzOperator
from toeplitz_mg.solvers.cosine_form import CosineForm

SHORT = 640  # Most unknowns of which a product by its definition is as fast as one by FFT.
LARGEST_COSINE = 2**16  # Most unknowns of which a product is by transforms at once, not in panels.
SMALL = 256  # Most unknowns where a filled matrix is as fast, for several vectors.
TINY = 1e-300  # Size in the place of zero, so that the relative error of zero is zero.
USUAL = 1e-60, 1e60  # Sizes whose products, quotients and squares neither over- nor underflow.


@dataclass
class ToeplitzSystem:
    """The system A X = B of a Toeplitz matrix A.

    Attributes
    ----------
    c, r : ndarray of shape (n,), float64 or complex128
        First column and first row of A.
    B : ndarray of shape (n,) or (columns, n)
        One right-hand side, or some, as rows.
    """

    c: Array
    r: Array
    B: Rows

    @property
    def columns(self) -> int:
        """The number of right-hand sides."""
        return 1 if self.B.ndim == 1 else len(self.B)

    @cached_property
    def lags(self) -> Array:
        """The coefficients a[i - j], lag zero in the centre."""
        return np.concatenate([self.r[:0:-1], self.c])

    @cached_property
    def size(self) -> float:
        """A bound of ‖A‖₁: the sum of all coefficients without their signs."""
        return float(np.add.reduce(np.abs(self.lags)))

    @cached_property
    def sizes(self) -> Array | float:
        """The norms of the right-hand sides; that of zero is tiny, as it is to be divided by."""
        return norms(self.B) + TINY

    @property
    def is_of_usual_size(self) -> bool:
        """Whether all numbers are finite, and it can be solved as it is, without scaling."""
        low, high = USUAL
        if not low < self.size < high:
            return False
        if isinstance(self.sizes, float):
            return low < self.sizes < high
        return bool(low < self.sizes.min() and self.sizes.max() < high)

    @cached_property
    def is_symmetric(self) -> bool:
        """Whether A is real and symmetric."""
        if self.c.dtype != np.float64:
            return False
        return self.r is self.c or np.array_equal(self.c[1:], self.r[1:])

    @cached_property
    def A(self) -> ToeplitzOperator:
        """The operator of A, where A is real."""
        return ToeplitzOperator(self.c) if self.is_symmetric else ToeplitzOperator(self.c, self.r)

    @cached_property
    def cosine_form(self) -> CosineForm:
        """A by cosine transforms, where A is symmetric."""
        return CosineForm(self.c)

    @cached_property
    def multiply(self) -> Callable[[Rows], Rows]:
        """The product of A with rows, as cheap as can be for its size."""
        n = len(self.c)
        if self.B.ndim == 1 and n <= SHORT:
            return partial(np.convolve, self.lags, mode="valid")
        if n <= SMALL:
            (step,) = self.lags.strides
            # A[i, j] is the lag i - j.
            A = np.ndarray((n, n), self.c.dtype, self.lags, (n - 1) * step, (step, -step)).copy()
            return lambda X: X @ A.T
        if self.is_symmetric and n <= LARGEST_COSINE:
            return self.cosine_form.multiply
        if self.c.dtype == np.float64:
            return self.A.apply
        return lambda X: scipy.linalg.matmul_toeplitz((self.c, self.r), X.T).T


def norms(X: Rows) -> Array | float:
    """Return the 2-norms of rows, or that of one vector, sooner than what prevents overflow."""
    # Python's own numbers are quicker than NumPy's, which matters where n is small.
    return sqrt(np.vdot(X, X).real) if X.ndim == 1 else np.sqrt(np.vecdot(X, X).real)


def largest(values: Array | float) -> float:
    """Return the largest of these numbers, NaN where one is."""
    return values if isinstance(values, float) else float(values.max())
