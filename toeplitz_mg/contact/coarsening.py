"""Averages of fields on a grid with elements twice the size, and interpolation back."""

from typing import Any

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.embedding import cut


def coarsen(x: Array, halved: tuple[bool, ...] = (True, True), xp: Any = np) -> Array:
    """Average pairs of elements along the last axes that are halved.

    An unpaired last element counts twice. The array belongs to the library `xp`.
    """
    for axis, two in enumerate(halved, x.ndim - len(halved)):
        n = x.shape[axis]
        if n == 1 or not two:
            continue
        if n % 2:
            x = xp.concat([x, x[cut(axis, n - 1)]], axis=axis)
        x = 0.5 * (x[cut(axis, 0, None, 2)] + x[cut(axis, 1, None, 2)])
    return x


def refine(
    x: Array,
    shape: tuple[int, ...],
    halved: tuple[bool, ...] = (True, True),
    periodic: tuple[bool, ...] = (False, False),
    xp: Any = np,
) -> Array:
    """Interpolate a field from a coarser grid: 3/4 of the nearest element, 1/4 of the next.

    The finer grid has the given shape: twice the elements along halved axes. Along periodic axes
    the first element follows the last one. The array belongs to the library `xp`.
    """
    for k, n in enumerate(shape):
        axis = x.ndim - len(shape) + k
        if n == 1 or not halved[k]:
            continue
        near, far = 0.75 * x, 0.25 * x
        # Each lies between its own element of the coarser grid and the one before or after it.
        first, last = far[cut(axis, 0, 1)], far[cut(axis, x.shape[axis] - 1)]
        before_first, after_last = (last, first) if periodic[k] else (first, last)
        even = near + xp.concat([before_first, far[cut(axis, 0, x.shape[axis] - 1)]], axis=axis)
        odd = near + xp.concat([far[cut(axis, 1)], after_last], axis=axis)
        pairs = xp.stack([even, odd], axis=axis + 1)
        x = xp.reshape(pairs, (*x.shape[:axis], n + n % 2, *x.shape[axis + 1 :]))
        if n % 2:
            x = xp.asarray(x[cut(axis, 0, n)], copy=True)
    return x
