"""The count of work: products and transforms, in the paper's work units."""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from math import prod


class ProductCount:
    """Work done by the products of a block of code, in grid points.

    Attributes
    ----------
    points : float
        A product with a Toeplitz matrix counts as the unknowns of its grid. A product with a
        circulant on d axes counts as 1/2^d of them, because its transforms are not padded.
    products : int
        The number of products, of any size.

    See Also
    --------
    count_products : returns it.
    """

    def __init__(self) -> None:
        self.points = 0.0
        self.products = 0

    def __repr__(self) -> str:
        return f"<ProductCount {self.products} products, {self.points:g} points>"

    def units(self, n: int) -> float:
        """Return the work units: the work in products on a grid of `n` points (paper, §5.2)."""
        return self.points / n


_active_counts: ContextVar[tuple[ProductCount, ...]] = ContextVar("_active_counts", default=())


@contextmanager
def count_products() -> Iterator[ProductCount]:
    """Count the products inside a ``with`` block, with all operators of this package.

    Yields
    ------
    ProductCount
        Counts until the block ends. Blocks may be nested. Products on other threads are not
        counted.

    See Also
    --------
    ProductCount : defines the unit.

    Examples
    --------
    >>> import numpy as np
    >>> import toeplitz_mg as tmg
    >>> A = tmg.ToeplitzOperator([2.0, -1.0, 0.0, 0.0])
    >>> with tmg.count_products() as work:
    ...     y = A @ np.ones(4)
    ...     z = A @ y
    >>> work.units(4)
    2.0
    """
    count = ProductCount()
    token = _active_counts.set((*_active_counts.get(), count))
    try:
        yield count
    finally:
        _active_counts.reset(token)


def count_work(products: int, points: float) -> None:
    """Count a number of products, with `points` grid points each."""
    for count in _active_counts.get():
        count.points += products * points
        count.products += products


def axes_of(grid_shape: tuple[int, ...]) -> int:
    """Return the number of axes with more than one element, but at least 1."""
    return max(sum(n > 1 for n in grid_shape), 1)


def count_transforms(number: float, *shape: int) -> None:
    """Count real transforms outside products."""
    if _active_counts.get():
        count_work(1, number * points_of_transform(*shape))


def points_of_transform(*shape: int) -> float:
    """Return the work of a real transform; a product has two, twice as long on each axis."""
    return prod(shape) / 2 ** (axes_of(shape) + 1)
