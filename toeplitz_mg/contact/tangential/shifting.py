"""Rigid shifts: the one by which all slides, and what those of a history add up to."""

from typing import Any

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.checks import check_shift
from toeplitz_mg.contact.products import Products
from toeplitz_mg.contact.results import TangentialResult
from toeplitz_mg.contact.tangential.coulomb import (
    Areas,
    along,
    direction,
    scale_to_bound,
    sum_components,
)
from toeplitz_mg.contact.tangential.problem import Problem, State


def slide_off(problem: Problem, total: Array, A: Products) -> tuple[State, Array]:
    """Return the state in which all slides along a force, the sum of the tractions, and the slip.

    The shift is the one at which the last element begins to slide along the force.
    """
    contact, vectors = problem.g > 0.0, problem.vectors
    n = np.broadcast_to(direction(problem.uniform(total)), problem.b.shape)
    q = scale_to_bound(n, problem.g, contact)
    u = A(q)
    ahead = np.where(contact, u - problem.b, 0.0)
    forwards = along(ahead, n)
    shift = np.zeros(len(q))
    if elements := vectors.count(contact):
        farthest = vectors.max(np.where(contact, forwards, -np.inf))
        # Across the force the shift is the mean of what the elements do.
        across = sum_components(ahead - forwards * n, vectors) / elements
        shift = across + farthest * direction(total)
        forwards = np.where(contact, forwards - farthest, 0.0)
    areas = Areas(np.zeros_like(contact), contact)
    return State(q, u, areas, shift, residual=0.0), forwards * n


def add_shifts(moved: Any, previous: TangentialResult | None, grid: Any) -> Any:
    """Return a shift, and those that led to the tractions before it."""
    if previous is None or (before := previous.total_shift) is None:
        return moved
    # One may be of the whole bodies, and the other a field.
    shape = grid.components, *previous.contact.shape  # On ranks that of their rows.
    given, earlier = (check_shift(x, shape) for x in (moved, before))
    fields = (is_field(x, grid.components) for x in (moved, before))
    return as_given(given + earlier, is_field=any(fields))


def is_field(shift: Any, components: int) -> bool:
    """Whether a shift is given of each element, and not of the whole bodies.

    The elements do not tell: a rank may have a single one.
    """
    return np.shape(shift) not in ((), (components,))


def as_given(shift: Array, *, is_field: bool = False) -> Any:
    """Return a shift, (components, ...), as users give it: of each element, or of the bodies."""
    if is_field:
        return shift[0] if len(shift) == 1 else shift
    return float(shift.ravel()[0]) if len(shift) == 1 else shift.ravel()
