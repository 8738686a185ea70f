"""The recurrence of conjugate gradients, one step at a time; the caller updates x and stops."""

from math import inf

import numpy as np

from toeplitz_mg._typing import Array, Multiply
from toeplitz_mg.engine.vectors import VECTORS, Vectors, power_above

SAFE_SIZES = 1e-100, 1e100  # If rᴴ M r is outside, M is scaled to avoid overflow and underflow.


class ConjugateGradients:
    """The search directions of conjugate gradients for A x = b, preconditioned with M.

    A and M are symmetric positive definite, or Hermitian positive definite if they are complex.

    The caller owns the iterate x and its residual r = b - A x. After each step the caller updates
    them by ``x += length * direction`` and ``r -= length * product``, and decides when to stop.
    Between steps r may be replaced, for example by the true residual.

    Parameters
    ----------
    multiply, precondition : callable
        Products with A and with M. The arguments are a vector and an array of its shape, in which
        the result may be returned; `precondition` may also return the vector itself.
    vectors : Vectors, optional
        The inner products and updates.

    Attributes
    ----------
    direction : ndarray
        The direction d of the last step. The next step overwrites it, and `product` too.
    product : ndarray
        The product A d.
    rho : float
        rᴴ M r of the last step. If it is not positive, M is not positive definite or r is zero.
    curvature : float
        dᴴ A d of the last step. If it is not positive, A is not positive definite.

    Examples
    --------
    >>> A, x, r = np.diag([1.0, 2.0]), np.zeros(2), np.array([1.0, 1.0])
    >>> iteration = ConjugateGradients(lambda d, out: A @ d, lambda r, out: r)
    >>> while length := iteration.step(r):
    ...     x += length * iteration.direction
    ...     r -= length * iteration.product
    ...     if np.linalg.norm(r) < 1e-12:
    ...         break
    >>> x
    array([1. , 0.5])
    """

    def __init__(
        self, multiply: Multiply, precondition: Multiply, vectors: Vectors = VECTORS
    ) -> None:
        self._multiply, self._precondition = multiply, precondition
        self._vectors = vectors
        self.direction: Array = np.empty(0)
        self.product: Array = self.direction
        self.rho = self.curvature = 0.0
        self._scale = 1.0  # Factor by which M is multiplied.

    def step(self, r: Array) -> float:
        """Return the length of the next step, after computing its direction.

        Parameters
        ----------
        r : ndarray
            The residual. It is not changed.

        Returns
        -------
        float
            The step length, or 0 if `rho` or `curvature` is not positive or not finite; the
            iteration then cannot go on.
        """
        is_first = self.rho == 0.0
        self.product = self._vectors.empty(r, None if is_first else self.product)
        z = self._precondition(r, self.product)
        if self._scale != 1.0:
            z = z * self._scale
        self.rho, previous = self._vectors.dot(r, z), self.rho
        if is_first and not SAFE_SIZES[0] < abs(self.rho) < SAFE_SIZES[1]:
            # ‖M‖ is far from 1. Scaling M changes no direction, but keeps squares within range.
            peak = self._vectors.peak(z)
            if 0.0 < peak < inf:
                self._scale = 2.0 ** -int(power_above(peak))
                z = z * self._scale
                self.rho = self._vectors.dot(r, z)
        if not 0.0 < self.rho < inf:
            return 0.0
        if is_first:
            self.direction = self._vectors.copy(z, self._vectors.empty(r))
        else:
            self.direction = self._vectors.aypx(self.rho / previous, z, self.direction)
        del z  # Immutable arrays need its memory for the product.
        self.product = self._multiply(self.direction, self.product)
        self.curvature = self._vectors.dot(self.direction, self.product)
        return self.rho / self.curvature if 0.0 < self.curvature < inf else 0.0
