"""The space that GMRES searches, one dimension more with each product."""

from collections.abc import Callable
from math import inf, isfinite
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from toeplitz_mg._typing import Array, Multiply
from toeplitz_mg.engine.vectors import add_combination, dots, norm

CANCELLED = 0.5  # Part of a vector's size that may be left before it is made orthogonal again.
ROUNDING = 10.0  # Machine epsilons that are left of a product which the space holds already.


class KrylovSpace:
    """An orthonormal basis of r, A r, A² r, ..., and what in this space makes ‖r - A x‖ least.

    Parameters
    ----------
    multiply : callable
        Products with A. It is called with a vector and with memory of its shape in which it may
        return the result.
    basis : Basis
        Where the vectors are, which may be fields; one more than the largest dimension.

    Attributes
    ----------
    dimension, most : int

    Notes
    -----
    The products are ``A basis[:k] = H basis[:k + 1]``. The residual is r's part that is orthogonal
    to them: along the vector g that is orthogonal to the columns of H, and whose entries follow one
    from the other. So ‖r - A x‖ = ‖r‖/‖g‖, where g₀ = 1.

    References
    ----------
    Y. Saad, M. H. Schultz, GMRES: a generalized minimal residual algorithm for solving
    nonsymmetric linear systems, SIAM J. Sci. Stat. Comput. 7 (1986); E. H. Ayachour, A fast
    implementation for GMRES method, J. Comput. Appl. Math. 159 (2003), for the residual.

    Examples
    --------
    >>> A, r = np.array([[2.0, 1.0], [0.0, 1.0]]), np.array([3.0, 1.0])
    >>> space = KrylovSpace(lambda v, out: A @ v, Basis(r.shape, r.dtype, 2))
    >>> space.begin(r)
    >>> while space.extend() > 1e-12:
    ...     pass
    >>> space.solution().round(12)
    array([1., 1.])
    """

    def __init__(self, multiply: Multiply, basis: Any) -> None:
        self._multiply: Callable[[Array, Array], Array] = multiply
        self.basis, most = basis, basis.most
        double = np.result_type(basis.dtype, np.float64)
        self._H = np.zeros((most + 1, most), double)
        self._g = np.zeros(most + 1, double)
        self._exhausted = ROUNDING * float(np.finfo(basis.dtype).eps)
        self._size = self._least = 0.0
        self.dimension, self.most = 0, most

    def begin(self, r: Array) -> None:
        """Start from a residual, which is not zero and not changed."""
        self._size = self._least = self.basis.norm(r)
        self.basis.put(0, r, self._size or 1.0)
        self._H[...] = 0.0
        self._g[0] = 1.0
        self.dimension = 0

    def extend(self) -> float:
        """Add a dimension by one product.

        Returns
        -------
        float
            The least norm ‖r - A x‖ of all x in the space. It is 0 where the space can grow no
            more: where it holds the solution, if A is not singular, or where a product is not
            finite.
        """
        k, basis = self.dimension, self.basis
        w = basis.take(k + 1, self._multiply(basis.vectors[k], basis.memory(k + 1)))
        whole = basis.norm(w)
        if not isfinite(whole):
            return 0.0
        if self._least > 0.0:
            self._least = self._orthogonalise(w, whole)
        if self._least == 0.0:
            basis.put(k + 1, w, inf)
        self.dimension += 1
        return self._least

    def _orthogonalise(self, w: Array, whole: float) -> float:
        """Make the last product, of this size, the next vector, and return the least residual."""
        k, H, g, basis = self.dimension, self._H, self._g, self.basis
        size, before = whole, inf
        while size < CANCELLED * before:
            h = basis.dots(k + 1, w)
            w = basis.add(-h, w)
            H[: k + 1, k] += h
            size, before = basis.norm(w), size
        if size <= self._exhausted * whole:
            return 0.0
        H[k + 1, k] = size
        basis.put(k + 1, w, size)
        g[k + 1] = -np.dot(g[: k + 1], H[: k + 1, k]) / size
        return self._size / norm(g[: k + 2])

    def solution(self) -> Array:
        """Return the x in the space that makes ‖r - A x‖ least."""
        k, x = self.dimension, self.basis.zeros()
        if k > 0:
            first = np.zeros(k + 1)
            first[0] = self._size
            y: Array = np.linalg.lstsq(self._H[: k + 1, :k], first)[0]
            x = self.basis.add(y, x)
        return x


class Basis:
    """Memory for the vectors of a basis, and what is done with them.

    Parameters
    ----------
    shape : tuple of int
        That of the vectors.
    dtype : float32, float64, complex64 or complex128
    most : int
        The largest dimension; one vector more is kept.
    """

    norm = staticmethod(norm)

    def __init__(self, shape: tuple[int, ...], dtype: DTypeLike, most: int) -> None:
        self.vectors = np.empty((most + 1, *shape), dtype)
        self._rows = self.vectors.reshape(most + 1, -1)
        self.dtype, self.most = np.dtype(dtype), most

    def memory(self, k: int) -> Array:
        """Return where the vector k may be written."""
        return self.vectors[k]

    def take(self, k: int, w: Array) -> Array:
        """Return the vector k, which is w."""
        if w is not self.vectors[k]:
            self.vectors[k][...] = w
        return self.vectors[k]

    def put(self, k: int, w: Array, size: float) -> None:
        """Keep w divided by a number as the vector k; by infinity as zeros, whatever w has."""
        if size == inf:
            self.vectors[k] = 0.0
        else:
            np.divide(w, size, out=self.vectors[k])

    def dots(self, k: int, w: Array) -> Array:
        """Return the inner products of the first k vectors with another."""
        return dots(self._rows[:k], w.reshape(-1))

    def add(self, weights: Array, w: Array) -> Array:
        """Add the combination of the first vectors with these weights to w, and return it."""
        add_combination(weights, self._rows[: len(weights)], w.reshape(-1))
        return w

    def zeros(self) -> Array:
        """Return a vector of zeros."""
        return np.zeros(self.vectors.shape[1:], self.dtype)
