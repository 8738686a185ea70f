"""Panagiotopoulos' alternation: normal contact, and what is tangential, until both hold.

For pressures p the tangential problem has the bound μ p, and displacements by p; for its tractions
q the normal problem has a gap that is wider by their displacements. One after the other they are
a map p → p' whose fixed point solves both. It contracts: by K of the materials and by μ. Anderson's
acceleration finds the fixed point from the last three pairs: their combination presses on elements
of the last one only, as where others were in contact it would press on an open gap.
"""

from collections.abc import Callable
from typing import Protocol

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.acceleration import Pairs, accelerate, extend
from toeplitz_mg.contact.products import Report


class Normal(Protocol):
    """The normal problem, for a gap that tractions change."""

    def look(self, q: Array, p: Array) -> float:
        """Return how far the pressures p violate the conditions of contact with tractions q."""

    def solve(self, q: Array, p: Array) -> Array:
        """Return the pressures with tractions q, from those near by."""

    def balance(self, p: Array) -> Array:
        """Return pressures of the given sum, if one is given."""


def alternate(
    normal: Normal,
    shear: Callable[[Array], Array],
    p: Array,
    *,
    tolerance: float,
    most: int,
    report: Report,
) -> tuple[Array, Array, tuple[float, ...]]:
    """Find the pressures with which both problems hold.

    Parameters
    ----------
    normal : Normal
    shear : callable
        Returns the tangential tractions for pressures.
    p : ndarray
        Pressures to start from.
    tolerance : float
        The violation of the conditions of normal contact that is allowed.
    most : int
        Most iterations.
    report : Report

    Returns
    -------
    p, q : ndarray
        The pressures, and the tangential tractions for them.
    residuals : tuple of float
        The violation in each iteration.
    """
    pairs: Pairs = []
    residuals: list[float] = []
    while True:
        q = shear(p)
        residuals.append(normal.look(q, p))
        report.look(residuals[-1])
        if residuals[-1] <= tolerance or len(residuals) == most or report.exhausted:
            return p, q, tuple(residuals)
        pairs = extend(pairs, p, normal.solve(q, p))
        p = normal.balance(accelerate(pairs))
