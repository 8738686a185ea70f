"""The space that GMRES searches, one dimension more with each product."""

from collections.abc import Callable
from math import isfinite

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
    shape : tuple of int
        That of the vectors, which may be fields.
    dtype : float32, float64, complex64 or complex128
    most : int
        The largest dimension; one vector more is kept.

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
    >>> space = KrylovSpace(lambda v, out: A @ v, r.shape, r.dtype, 2)
    >>> space.begin(r)
    >>> while space.extend() > 1e-12:
    ...     pass
    >>> space.solution().round(12)
    array([1., 1.])
    """

    def __init__(
        self, multiply: Multiply, shape: tuple[int, ...], dtype: DTypeLike, most: int
    ) -> None:
        self._multiply: Callable[[Array, Array], Array] = multiply
        self._vectors = np.empty((most + 1, *shape), dtype)
        self._rows = self._vectors.reshape(most + 1, -1)
        double = np.result_type(dtype, np.float64)
        self._H = np.zeros((most + 1, most), double)
        self._g = np.zeros(most + 1, double)
        self._exhausted = ROUNDING * float(np.finfo(dtype).eps)
        self._size = self._least = 0.0
        self.dimension, self.most = 0, most

    @property
    def basis(self) -> Array:
        """The basis, shape (dimension, ...)."""
        return self._vectors[: self.dimension]

    def begin(self, r: Array) -> None:
        """Start from a residual, which is not zero and not changed."""
        self._size = self._least = norm(r)
        np.divide(r, self._size or 1.0, out=self._vectors[0])
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
        v, w = self._vectors[self.dimension : self.dimension + 2]
        product = self._multiply(v, w)
        if product is not w:
            w[...] = product
        whole = norm(w)
        if not isfinite(whole):
            return 0.0
        if self._least > 0.0:
            self._least = self._orthogonalise(w.reshape(-1), whole)
        if self._least == 0.0:
            w[...] = 0.0
        self.dimension += 1
        return self._least

    def _orthogonalise(self, w: Array, whole: float) -> float:
        """Make the last product, of this size, the next vector, and return the least residual."""
        k, H, g = self.dimension, self._H, self._g
        V = self._rows[: k + 1]
        size, before = whole, np.inf
        while size < CANCELLED * before:
            h = dots(V, w)
            add_combination(-h, V, w)
            H[: k + 1, k] += h
            size, before = norm(w), size
        if size <= self._exhausted * whole:
            return 0.0
        H[k + 1, k] = size
        w /= size
        g[k + 1] = -np.dot(g[: k + 1], H[: k + 1, k]) / size
        return self._size / norm(g[: k + 2])

    def solution(self) -> Array:
        """Return the x in the space that makes ‖r - A x‖ least."""
        k = self.dimension
        x = np.zeros(self._vectors.shape[1:], self._vectors.dtype)
        if k > 0:
            first = np.zeros(k + 1)
            first[0] = self._size
            y: Array = np.linalg.lstsq(self._H[: k + 1, :k], first)[0]
            add_combination(y, self._rows[:k], x.reshape(-1))
        return x
