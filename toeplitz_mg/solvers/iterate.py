"""What all iterations have in common: an iterate, its true residual, and their history."""

from math import inf

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.vectors import power_above
from toeplitz_mg.operators import apply_to_rows
from toeplitz_mg.solvers.checks import System

# Least part of the first residual that b may be, over the smallest number that has all digits.
FAINT = 1e8


class Iterate:
    """The first guess for x, and its residual, both to be changed by an iteration.

    The residual, and what is made of it, are divided by a power of two, so that no square of them
    over- or underflows: that changes no digit.

    Parameters
    ----------
    system : System
        Its list `residuals` is filled: norms ‖b - A x‖₂, of the first guess and of each iterate.

    Attributes
    ----------
    x : ndarray
    b, r : ndarray
        The right-hand side and the residual, divided by `scale`.
    scale : float
    size_of_b : float
        The norm of `b`.
    iterations : int
        How many there have been, for whoever iterates to count.
    vectors : Vectors
        The inner products and updates of A's vectors.
    """

    def __init__(self, system: System) -> None:
        A, b, guess, dtype = system.A, system.b, system.x0, system.dtype
        self._A, self._residuals = A, system.residuals
        self.iterations, self.vectors = 0, system.vectors
        vectors = self.vectors
        self.x, peak = vectors.zeros(b, dtype), vectors.peak(b)
        if guess is not None:
            self.x = vectors.copy(guess, self.x)
            b = vectors.copy(b, vectors.zeros(b, dtype))
            size = 1.0
            with np.errstate(over="ignore", invalid="ignore"):  # Overflow is told by `info`.
                r = b - apply_to_rows(A, self.x)
                if not vectors.peak(r) < inf:
                    size = 2.0 ** (int(power_above(max(peak, vectors.peak(self.x)))) - 1)
                    r = b / size - apply_to_rows(A, self.x / size)
                above = vectors.peak(r) * size
            if peak < FAINT * np.finfo(dtype).tiny * above < inf:
                # Beside it nothing is left of b, so that nothing of the guess is worth keeping.
                guess, self.x = None, vectors.zeros(b, dtype)
            else:
                peak = max(peak, above)
        # The largest entry is then from 1 to 2, so that the vectors are in the range of float32.
        self.scale = 2.0 ** (int(power_above(peak)) - 1)
        # It is a copy: the products of whoever made A or M may be in the memory of what they gave.
        with np.errstate(over="ignore", invalid="ignore"):
            self.b = vectors.cast(b, dtype) / self.scale
            if guess is None:
                self.r = vectors.copy(self.b, vectors.empty(self.b))
            else:
                self.r = vectors.cast(r, dtype) * (size / self.scale)
        self.size_of_b = vectors.norm(self.b)

    def goal(self, rtol: float, atol: float) -> float:
        """Return what the norm of `r` is to be."""
        return max(rtol * self.size_of_b, atol / self.scale)

    def zero(self) -> tuple[Array, int]:
        """Return what an iteration returns where b is zero."""
        self._residuals[:] = [0.0]
        return self.vectors.zeros(self.x), 0

    def compute_residual(self) -> float:
        """Compute `r` by a product with A, and return its norm."""
        with np.errstate(over="ignore", invalid="ignore"):
            r = self.vectors.divide(self.x, self.scale, self.r)
            r = apply_to_rows(self._A, r, r)
            self.r = self.vectors.subtract(self.b, r, r)
        return self.vectors.norm(self.r)

    def record(self, size: float) -> None:
        """Put down the norm of `r` for this iteration, in the place of what is there for it."""
        self._residuals[self.iterations :] = [size * self.scale]
