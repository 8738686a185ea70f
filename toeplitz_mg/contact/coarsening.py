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
        if periodic[k]:
            before, after = np.roll(x, 1, axis), np.roll(x, -1, axis)
        else:
            before = np.concatenate([np.take(x, [0], axis), np.delete(x, -1, axis)], axis=axis)
            after = np.concatenate([np.delete(x, 0, axis), np.take(x, [-1], axis)], axis=axis)
        pair = np.stack([0.75 * x + 0.25 * before, 0.75 * x + 0.25 * after], axis=axis % x.ndim + 1)
        fine = [*x.shape]
        fine[axis] *= 2
        x = np.take(pair.reshape(fine), np.arange(n), axis=axis)
    return x
