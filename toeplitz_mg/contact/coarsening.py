"""Fields on a grid of elements twice the size: averages, and what is between them."""

from typing import Any

import numpy as np

from toeplitz_mg._typing import Array


def coarsen(x: Array, halved: tuple[bool, ...] = (True, True)) -> Array:
    """Average 2 elements along each of the last axes; a last one alone counts twice.

    Parameters
    ----------
    x : ndarray
    halved : tuple of bool
        Whether elements are averaged, for each axis of the grid; before these axes are components.
    """
    for axis, two in zip(range(-len(halved), 0), halved, strict=True):
        n = x.shape[axis]
        if n == 1 or not two:
            continue
        if n % 2:
            x = np.concatenate([x, np.take(x, [-1], axis)], axis=axis)
        behind = (slice(None),) * (-1 - axis)
        even: Any = (..., slice(0, None, 2), *behind)
        odd: Any = (..., slice(1, None, 2), *behind)
        x = 0.5 * (x[even] + x[odd])
    return x


def refine(
    x: Array,
    shape: tuple[int, ...],
    halved: tuple[bool, ...] = (True, True),
    periodic: tuple[bool, ...] = (False, False),
) -> Array:
    """Interpolate a field of a coarser grid: 3/4 of the nearest element, 1/4 of the next.

    Parameters
    ----------
    x : ndarray
    shape : tuple of int
        The shape of the finer grid, whose axes are the last ones of `x`.
    halved : tuple of bool
        The axes along which the coarser grid has half of the elements.
    periodic : tuple of bool
        The axes along which the first element is the next of the last one.
    """
    for k, n in enumerate(shape):
        axis = k - len(shape)
        if n == 1 or not halved[k]:
            continue
        m, behind = x.shape[axis], (slice(None),) * (-1 - axis)

        def at(start: int, stop: int | None, step: int = 1, behind: Any = behind) -> Any:
            return (..., slice(start, stop, step), *behind)

        near, far = 0.75 * x, 0.25 * x
        fine = np.empty((*x.shape[:axis], n, *x.shape[x.ndim + axis + 1 :]), near.dtype)
        even, odd = fine[at(0, None, 2)], fine[at(1, None, 2)]
        even[...], odd[...] = near, near[at(0, n // 2)]
        # Each is between its own element of the coarser grid, and that before or after it.
        ends = (far[at(m - 1, m)], far[at(0, 1)])
        before_first, after_last = ends if periodic[k] else ends[::-1]
        even[at(0, 1)] += before_first
        even[at(1, m)] += far[at(0, m - 1)]
        odd[at(0, m - 1)] += far[at(1, m)]
        if n == 2 * m:
            odd[at(m - 1, m)] += after_last
        x = fine
    return x
