"""A rectangle around the elements in contact, to which tangential problems are restricted."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from toeplitz_mg._typing import Array, Mask

# Margin on each side relative to the length inside, which improves the cosine preconditioner.
# Steady rolling does not use it.
MARGIN = 0.1

Box = tuple[slice, ...]  # The elements along each axis.


def ends_of(elements: Mask, axis: int) -> tuple[int, int]:
    """Return the first and the last (exclusive) index at which a mask is true, along an axis.

    If it is true nowhere, the first is behind the last element, and the last is 0.
    """
    others = tuple(k for k in range(elements.ndim) if k != axis)
    (index,) = np.nonzero(elements.any(axis=others))
    return (int(index[0]), int(index[-1]) + 1) if len(index) else (elements.shape[axis], 0)


def box_around(grid: Any, ends: Iterable[tuple[int, int]], margin: float) -> Box:
    """Return the slices between the ends along each axis, plus a margin; everything if empty."""
    box = []
    for (first, end), n, repeats in zip(ends, grid.shape, grid.periodic, strict=True):
        if repeats or first >= end:  # The end elements are neighbours, or it is empty.
            first, end = 0, n
        more = int(margin * (end - first))
        box.append(slice(max(0, first - more), min(n, end + more)))
    return tuple(box)


@dataclass(frozen=True)
class Window:
    """A rectangle of elements of a grid."""

    whole: Any  # The grid.
    box: Box  # The elements along each axis.

    @property
    def grid(self) -> Any:
        """The grid of the elements inside."""
        return replace(self.whole, shape=tuple(part.stop - part.start for part in self.box))

    def cut(self, x: Array) -> Array:
        """Return the part of a field, with any components, that is inside."""
        part: tuple[Any, ...] = (..., *self.box)
        return np.ascontiguousarray(x[part])

    def same(self, found: Any) -> Any:
        """Return a value that is the same on all ranks: here unchanged."""
        return found

    def extend(self, x: Array) -> Array:
        """Return a field on the whole grid that is zero outside."""
        components = x.shape[: x.ndim - len(self.box)]
        whole = np.zeros((*components, *self.whole.shape), x.dtype)
        part: tuple[Any, ...] = (..., *self.box)
        whole[part] = x
        return whole
