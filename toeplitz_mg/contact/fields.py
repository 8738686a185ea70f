"""What both kinds of results have: fields that cannot be written to, and where they are."""

from math import prod
from typing import Any

import numpy as np

from toeplitz_mg._typing import Array

# These are methods and properties of results, of both classes.


def protect(result: Any) -> None:
    """Put views that cannot be written to in the place of the arrays."""
    own = vars(result)  # What is computed on demand is not asked for here.
    for name, value in own.items():
        if isinstance(value, np.ndarray):
            own[name] = _read_only(value)
        elif isinstance(value, tuple):
            own[name] = tuple(_read_only(x) if isinstance(x, np.ndarray) else x for x in value)


def restore(result: Any, state: dict[str, Any]) -> None:
    """Read what was pickled, or copied: arrays can be written to then, until they are protected."""
    vars(result).update(state)
    protect(result)


def is_whole(result: Any) -> bool:
    """Whether the fields are of the whole grid: on several ranks they have the rows of one."""
    whole: bool = result.contact.size == prod(result.shape)
    return whole


def require_whole(result: Any, name: str = "the result") -> None:
    """Refuse a result that has the rows of one rank, where the whole grid is needed."""
    if not is_whole(result):
        raise ValueError(
            f"{name} has the rows of one rank, {result.contact.shape} of the {result.shape} "
            "elements, but must have all: all ranks together write a field to a file by "
            "slab.save(path, field), and numpy.load reads it"
        )


def require_finite(result: Any, name: str) -> None:
    """Refuse a result with tractions that are no numbers, as one that was made by hand may have."""
    wrong = result.traction[~np.isfinite(result.traction)]
    if wrong.size:
        raise ValueError(f"{name} has the traction {wrong[0]}, but tractions must be finite")


def _x(result: Any) -> Array:
    """The centres of the elements along the first axis, mm."""
    centres: Array = result.centres[0]
    return centres


def _y(result: Any) -> Array | None:
    """The centres of the elements along the second axis, mm; None in line contact."""
    return result.centres[1] if len(result.centres) > 1 else None


def _contact_fraction(result: Any) -> float:
    """The area of contact over that of the grid."""
    share: float = result.area / (prod(result.shape) * prod(result.element))
    return share


x, y, contact_fraction = property(_x), property(_y), property(_contact_fraction)


def _read_only(x: Array) -> Array:
    view = x.view()
    view.flags.writeable = False
    return view
