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

LOST = 1e-6  # Error of a product in single precision, relative to its largest value.
SMALL = 0.1  # Share of the allowed error that one product may cause, as several follow.

# Matrices of small grids are kept for the next problem, and so are their single precision copies.
_singles: WeakKeyDictionary[LinearOperator, LinearOperator] = WeakKeyDictionary()


class Products:
    """Products of an operator with fields of any shape, in the precision of the field.

    `toeplitz_mg.count_products` measures all work, including preconditioners and coarser grids.
    This class counts only the products with one matrix, which `max_products` limits.

    Parameters
    ----------
    A : LinearOperator
        A matrix with as many unknowns as a field has numbers.
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
        The last known violation; infinite while it is unknown.
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
            return self.A  # A cached value must not refer to its own key.
        single = _singles.get(self.A)
        return _singles.setdefault(self.A, self.A.astype(np.float32)) if single is None else single

    def units(self, work: ProductCount) -> float:
        """Return the work of all ranks in units of such products; each rank counts its own."""
        gather = self.vectors.gather
        return float(sum(gather(work.points)) / sum(gather(self.A.shape[0])))

    @property
    def exhausted(self) -> bool:
        """Whether no more products should be made."""
        return self.count >= self.limit

    def tell_more(self, products: int, _: float) -> None:
        """Report products that were made with another matrix on behalf of this one."""
        if self.progress is not None:
            self.progress(self.count + products, self.residual)

    def __call__(self, x: Array, out: Array | None = None) -> Array:
        """Multiply a field; the result is in `out`, if given, or in a new array."""
        self.count += 1
        reshape = self.vectors.reshape
        A = self._single if x.dtype == self.vectors.xp.float32 else self.A
        memory = None if out is None else reshape(out, (-1,))
        product = reshape(apply_to_rows(A, reshape(x, (-1,)), memory), x.shape)
        if self.progress is not None and self.residual < inf:
            with ranks_of(self.A).agree():  # If one process raises an error, all do.
                self.progress(self.count, self.residual)
        return product


class Displacements:
    """The displacements of tractions that change in smaller and smaller steps.

    Changes are multiplied in single precision, in half the time. Their rounding errors add up; a
    product with all tractions in double precision clears them, as soon as the changes are so small
    that later rounding errors are negligible.

    Parameters
    ----------
    K : Products
    q : ndarray
        The initial tractions.
    dtype : float32 or float64
        The precision of products with changes; if double, each product is with all tractions.

    Attributes
    ----------
    u : ndarray
        The displacements.
    lost : float
        Their estimated error.
    """

    def __init__(self, K: Products, q: Array, dtype: DTypeLike) -> None:
        self._K, self._q, self._is_single = K, q, np.dtype(dtype) == np.float32
        self.u = K(q) if K.vectors.count(q) else np.zeros_like(q)
        self.lost = 0.0

    def renew(self) -> None:
        """Compute the displacements from all tractions."""
        self.u, self.lost = self._K(self._q), 0.0

    def follow(
        self, q: Array, change: float, allowed: float, by: tuple[Array, Array] | None = None
    ) -> None:
        """Update the displacements for other tractions; `change` estimates how much they change.

        `allowed` is their allowed error in the end. For a part of the change of the tractions, the
        displacements may be known: `by` is this pair.
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
    """Return the callback for coarser grids, which reports 0 products."""
    return progress and (lambda _, residual: progress(0, residual))


@dataclass
class Report:
    """Progress reports over a sequence of solutions."""

    progress: Progress | None  # Called as ``progress(products, residual)`` after each product.
    products: int = 0  # Products of the previous solutions.
    # The violation after the last iteration; infinite before, when each solution reports its own.
    residual: float = inf
    # Whether a solution has used up its products, so that it has failed, and others would too.
    exhausted: bool = False

    def __call__(self, products: int, residual: float) -> None:
        """Report the products of the current solution."""
        if self.progress is not None:
            known = self.residual < inf
            self.progress(self.products + products, self.residual if known else residual)

    def add(self, products: int, most: int) -> None:
        """Add the products of a finished solution, with the limit of products it had."""
        self.products += products
        self.exhausted = self.exhausted or products >= most

    def look(self, residual: float) -> None:
        """Store the violation after an iteration."""
        self.residual = residual
        self(0, residual)
