"""The Krylov space of GMRES, which each product extends by one dimension."""

from collections.abc import Callable
from math import inf, isfinite
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from toeplitz_mg._typing import Array, Multiply
from toeplitz_mg.engine.vectors import add_combination, dots, norm

CANCELLED = 0.5  # Orthogonalisation is repeated if it leaves less than this part of the norm.
ROUNDING = 10.0  # Machine epsilons of relative norm below which a new vector is only rounding.


class KrylovSpace:
    """An orthonormal basis of r, A r, A² r, ..., and the x in this space with least ‖r - A x‖.

    Parameters
    ----------
    multiply : callable
        Products with A. The arguments are a vector and an array of its shape, in which the result
        may be returned.
    basis : Basis
        Memory for the vectors (or fields): one more than the largest dimension.

    Attributes
    ----------
    dimension, most : int

    Notes
    -----
    The products are ``A basis[:k] = H basis[:k + 1]``. The least residual is the part of r that is
    orthogonal to them. It is parallel to the vector g that is orthogonal to the columns of H, whose
    entries follow recursively from g₀ = 1. Hence ‖r - A x‖ = ‖r‖/‖g‖.

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
        """Start from a residual, which is nonzero and is not changed."""
        self._size = self._least = self.basis.norm(r)
        self.basis.put(0, r, self._size or 1.0)
        self._H[...] = 0.0
        self._g[0] = 1.0
        self.dimension = 0

    def extend(self) -> float:
        """Return the least ‖r - A x‖ in the space, after adding a dimension by one product.

        Returns
        -------
        float
            The least norm ‖r - A x‖ over all x in the space, or 0 if the space cannot grow. Then it
            contains the solution, if A is not singular, or a product is not finite.
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
        """Return the least residual, after orthonormalising the last product, of norm `whole`."""
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
        """Return the x in the space that minimises ‖r - A x‖."""
        k, x = self.dimension, self.basis.zeros()
        if k > 0:
            first = np.zeros(k + 1)
            first[0] = self._size
            y: Array = np.linalg.lstsq(self._H[: k + 1, :k], first)[0]
            x = self.basis.add(y, x)
        return x


class Basis:
    """Memory for the vectors of a basis, and operations with them.

    Parameters
    ----------
    shape : tuple of int
        The shape of the vectors.
    dtype : float32, float64, complex64 or complex128
    most : int
        The largest dimension; one more vector is stored.
    """

    norm = staticmethod(norm)

    def __init__(self, shape: tuple[int, ...], dtype: DTypeLike, most: int) -> None:
        self.vectors = np.empty((most + 1, *shape), dtype)
        self._rows = self.vectors.reshape(most + 1, -1)
        self.dtype, self.most = np.dtype(dtype), most

    def memory(self, k: int) -> Array:
        """Return the memory of vector k."""
        return self.vectors[k]

    def take(self, k: int, w: Array) -> Array:
        """Return vector k, after copying w to it."""
        self.vectors[k] = w
        return self.vectors[k]

    def put(self, k: int, w: Array, size: float) -> None:
        """Store w / size as vector k; zeros if the size is infinite, even if w is not finite."""
        if size == inf:
            self.vectors[k] = 0.0
        else:
            np.divide(w, size, out=self.vectors[k])

    def dots(self, k: int, w: Array) -> Array:
        """Return the inner products of the first k vectors with w."""
        return dots(self._rows[:k], w.reshape(-1))

    def add(self, weights: Array, w: Array) -> Array:
        """Return w, after adding the combination of the first vectors with these weights."""
        add_combination(weights, self._rows[: len(weights)], w.reshape(-1))
        return w

    def zeros(self) -> Array:
        """Return a vector of zeros."""
        return np.zeros(self.vectors.shape[1:], self.dtype)
