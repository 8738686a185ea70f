"""A rectangle around the elements in contact: tangential problems need no others."""

from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.grid import Grid

MARGIN = 0.1  # Margin on each side over the length inside: it helps the cosines to approximate.


@dataclass(frozen=True)
class Window:
    """A rectangle of elements of a grid.

    Attributes
    ----------
    whole : Grid
        The grid.
    box : tuple of slice
        The elements along each axis.
    """

    whole: Grid
    box: tuple[slice, ...]

    @classmethod
    def around(cls, grid: Grid, elements: Array, margin: float = MARGIN) -> Self:
        """Return the window of the elements where a mask is true; the grid where none is."""
        box = []
        for axis, n in enumerate(elements.shape):
            others = tuple(k for k in range(elements.ndim) if k != axis)
            (index,) = np.nonzero(elements.any(axis=others))
            first, end = (int(index[0]), int(index[-1]) + 1) if len(index) else (0, n)
            if grid.periodic[axis]:  # The elements at the ends are neighbours.
                first, end = 0, n
            more = int(margin * (end - first))
            box.append(slice(max(0, first - more), min(n, end + more)))
        return cls(grid, tuple(box))

    @classmethod
    def tight(cls, grid: Grid, elements: Array) -> Self:
        """Return the least window: in steady rolling nothing is approximated by cosines."""
        return cls.around(grid, elements, margin=0.0)

    @property
    def grid(self) -> Grid:
        """The grid of the elements inside."""
        shape = tuple(
            len(range(n)[part]) for n, part in zip(self.whole.shape, self.box, strict=True)
        )
        return replace(self.whole, shape=shape)

    def cut(self, x: Array) -> Array:
        """Return the part of a field, of any components, that is inside."""
        part: tuple[Any, ...] = (..., *self.box)
        return np.ascontiguousarray(x[part])

    def extend(self, x: Array) -> Array:
        """Return a field on the whole grid that is zero outside."""
        components = x.shape[: x.ndim - len(self.box)]
        whole = np.zeros((*components, *self.whole.shape), x.dtype)
        part: tuple[Any, ...] = (..., *self.box)
        whole[part] = x
        return whole
