"""Products with fields on a grid, counted and limited."""

from dataclasses import dataclass
from functools import cached_property
from math import inf
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import DTypeLike
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array, Progress
from toeplitz_mg.engine.ranks import ranks_of
from toeplitz_mg.engine.vectors import Vectors
from toeplitz_mg.engine.work import ProductCount
from toeplitz_mg.operators import apply_to_rows
from toeplitz_mg.operators.base import vectors_of

LOST = 1e-6  # Error of a product in single precision, over the largest of its result.
SMALL = 0.1  # Part of what may be lost that one product may lose, as several follow.

# Matrices of small grids are kept for the next problem, and those in single precision with them.
_singles: WeakKeyDictionary[LinearOperator, LinearOperator] = WeakKeyDictionary()


class Products:
    """Products of an operator with fields of any shape, in the precision of the field.

    `toeplitz_mg.count_products` measures all work, that of preconditioners and of coarser grids
    too; here only the products with one matrix count, which `max_products` limits.

    Parameters
    ----------
    A : LinearOperator
        A matrix of as many unknowns as a field has numbers.
    limit : int
        The number of products after which it is `exhausted`.

    Attributes
    ----------
    vectors : Vectors
        The inner products, sums and extremes of the fields.
    count : int
        Products made so far.
    progress : callable or None
        Called as ``progress(count, residual)`` after each product.
    residual : float
        What is left, where it was last looked at: infinite before, when there is nothing to tell.
    """

    def __init__(self, A: LinearOperator, limit: int) -> None:
        self.A = A
        self.vectors: Vectors = vectors_of(A)
        self.count = 0
        self.limit = limit
        self.progress: Progress | None = None
        self.residual = inf

    @cached_property
    def _single(self) -> LinearOperator:
        if self.A.dtype == np.float32:
            return self.A  # No value is to refer to its own key.
        single = _singles.get(self.A)
        return _singles.setdefault(self.A, self.A.astype(np.float32)) if single is None else single

    def units(self, work: ProductCount) -> float:
        """Return the work of all ranks in such products, where each has counted its own."""
        gather = self.vectors.gather
        return float(sum(gather(work.points)) / sum(gather(self.A.shape[0])))

    @property
    def exhausted(self) -> bool:
        """Whether no more products should be made."""
        return self.count >= self.limit

    def tell_more(self, products: int, _: float) -> None:
        """Tell of products that are made for this one, with another matrix."""
        if self.progress is not None:
            self.progress(self.count + products, self.residual)

    def __call__(self, x: Array, out: Array | None = None) -> Array:
        """Multiply a field; the result is `out`, if that is given, or a new array."""
        self.count += 1
        reshape = self.vectors.reshape
        A = self._single if x.dtype == self.vectors.xp.float32 else self.A
        memory = None if out is None else reshape(out, (-1,))
        product = reshape(apply_to_rows(A, reshape(x, (-1,)), memory), x.shape)
        if self.progress is not None and self.residual < inf:
            with ranks_of(self.A).agree():  # Where it raises in one process, all raise an error.
                self.progress(self.count, self.residual)
        return product


class Displacements:
    """The displacements of tractions that change step by step, less and less.

    A change is multiplied in single precision, in half the time. What rounding takes adds up: a
    product with all of the tractions clears it, in double precision, as soon as changes are so
    small that from there on nothing is lost which matters.

    Parameters
    ----------
    K : Products
    q : ndarray
        The tractions to begin with.
    dtype : float32 or float64
        The precision of a product with a change: where it is double, each is with all tractions.

    Attributes
    ----------
    u : ndarray
        The displacements.
    lost : float
        What they may be off by.
    """

    def __init__(self, K: Products, q: Array, dtype: DTypeLike) -> None:
        self._K, self._q, self._is_single = K, q, np.dtype(dtype) == np.float32
        self.u = K(q) if K.vectors.count(q) else np.zeros_like(q)
        self.lost = 0.0

    def renew(self) -> None:
        """Compute the displacements from all of the tractions."""
        self.u, self.lost = self._K(self._q), 0.0

    def follow(
        self, q: Array, change: float, allowed: float, by: tuple[Array, Array] | None = None
    ) -> None:
        """Go on to other tractions, of which the displacements change by about so much.

        In the end they may be off by what is allowed. Of a part of the change of the tractions the
        displacements may be known: these two are `by`.
        """
        before, self._q = self._q, q
        if by is not None:
            before = before + by[0]
            self.u = self.u + by[1]
            self.lost += LOST * self._K.vectors.max(np.abs(by[1]))
        dq = q - before
        largest = self._K.vectors.max(np.abs(dq))
        if by is not None and largest == 0.0:
            return
        if not self._is_single or (self.lost > allowed and LOST * change <= SMALL * allowed):
            self.renew()
            return
        largest = largest or 1.0
        du = largest * self._K((dq / largest).astype(np.float32))
        self.u = self.u + du
        self.lost += LOST * self._K.vectors.max(np.abs(du))


def for_coarser_grids(progress: Progress | None) -> Progress | None:
    """Return what is called on coarser grids, whose products do not count: with none of them."""
    return progress and (lambda _, residual: progress(0, residual))


@dataclass
class Report:
    """What is told of the products of one solution after the other."""

    progress: Progress | None  # Called as ``progress(products, residual)`` after each product.
    products: int = 0  # Those of the solutions before.
    # The violation after the last iteration: infinite before, when a solution tells its own.
    residual: float = inf
    # Whether a solution has taken all products that it may: then it is none, nor are others.
    exhausted: bool = False

    def __call__(self, products: int, residual: float) -> None:
        """Tell of products of the solution that is under way."""
        if self.progress is not None:
            known = self.residual < inf
            self.progress(self.products + products, self.residual if known else residual)

    def add(self, products: int, most: int) -> None:
        """Add the products of a solution that is at its end, of which so many were allowed."""
        self.products += products
        self.exhausted = self.exhausted or products >= most

    def look(self, residual: float) -> None:
        """Tell of the violation after an iteration."""
        self.residual = residual
        self(0, residual)
