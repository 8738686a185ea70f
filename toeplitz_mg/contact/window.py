"""A rectangle around the elements in contact: tangential problems need no others."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from toeplitz_mg._typing import Array, Mask

# Margin on each side over the length inside: it helps the cosines to approximate. In steady rolling
# nothing is approximated by cosines.
MARGIN = 0.1

Box = tuple[slice, ...]  # The elements along each axis.


def ends_of(elements: Mask, axis: int) -> tuple[int, int]:
    """Return where those elements begin along an axis for which a mask is true, and end.

    Where none is, this is behind the last element, and before the first one.
    """
    others = tuple(k for k in range(elements.ndim) if k != axis)
    (index,) = np.nonzero(elements.any(axis=others))
    return (int(index[0]), int(index[-1]) + 1) if len(index) else (elements.shape[axis], 0)


def box_around(grid: Any, ends: Iterable[tuple[int, int]], margin: float) -> Box:
    """Return the elements between some ends along each axis, and a margin; all where none are."""
    box = []
    for (first, end), n, repeats in zip(ends, grid.shape, grid.periodic, strict=True):
        if repeats or first >= end:  # The elements at the ends are neighbours, or there are none.
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
        """Return the part of a field, of any components, that is inside."""
        part: tuple[Any, ...] = (..., *self.box)
        return np.ascontiguousarray(x[part])

    def same(self, found: Any) -> Any:
        """Return what was found inside: on several ranks what it is on all of them."""
        return found

    def extend(self, x: Array) -> Array:
        """Return a field on the whole grid that is zero outside."""
        components = x.shape[: x.ndim - len(self.box)]
        whole = np.zeros((*components, *self.whole.shape), x.dtype)
        part: tuple[Any, ...] = (..., *self.box)
        whole[part] = x
        return whole
