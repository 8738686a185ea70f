"""Elements as the user says them: their size, the axes along which they repeat, the reference."""

from typing import Any

import numpy as np

from toeplitz_mg._typing import Element
from toeplitz_mg.values import field, in_range, positive


def read_sizes(shape: tuple[int, ...], element: Element) -> tuple[float, ...]:
    """Return the sizes of an element of a grid, or say what is wrong with them, or with the grid.

    There are two, along x and y, or of strips of infinite length one.
    """
    if len(shape) not in (1, 2) or min(shape) < 1:
        raise ValueError(
            f"the grid has shape {shape}, but must be (n1, n2), or (n,) for line contact"
        )
    given = np.atleast_1d(field("element", element))
    sizes = tuple(given.ravel().tolist())
    if given.ndim > 1 or len(sizes) not in (1, 2) or len(sizes) < len(shape):
        raise ValueError(
            f"element is {element}, but the grid {shape} needs two sizes (h1, h2); line "
            "contact also takes one, the width of strips of infinite length"
        )
    if not all(0.0 < h < np.inf for h in sizes):
        raise ValueError(f"element is {element}, but its sizes must be positive and finite")
    for value in (min(sizes), max(sizes)):
        in_range("element", value)
    return sizes


def read_periodic(periodic: Any, axes: int) -> tuple[bool, ...]:
    """Return along which axes a surface repeats, or say what is wrong with what was given."""
    given = tuple(periodic) if np.iterable(periodic) else (periodic,) * axes
    if len(given) != axes or not all(isinstance(value, bool | np.bool_) for value in given):
        raise ValueError(
            f"periodic is {periodic!r}, but must be True or False, or one of these for each axis, "
            "as (True, False)"
        )
    return tuple(map(bool, given))


def read_reference(
    reference: float | None,
    shape: tuple[int, ...],
    sizes: tuple[float, ...],
    periodic: tuple[bool, ...],
) -> float:
    """Return the distance at which a line load moves nothing: by default the length across it."""
    ends = [axis for axis in range(len(sizes)) if not (*periodic, False)[axis]]
    # One axis that ends, of a body that goes on for ever along the other, is a line contact.
    is_line = len(ends) == 1 and (len(sizes) == 1 or any(periodic))
    if reference is None:
        axis = ends[0] if is_line else 0
        return sizes[axis] * (*shape, 1)[axis]
    if not is_line:
        raise ValueError(
            f"reference is {reference}, but only plane strain (an element of one size) and "
            "a surface that repeats along one of two axes have a constant displacement that "
            "it decides"
        )
    return positive("reference", reference)
