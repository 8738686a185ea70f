"""Friction that depends on the slip: a bound and the slip that belong to each other.

The bound makes the tractions, these the slip, and the slip the bound: they are repeated until they
agree, from the tractions before. Where friction falls so steeply that an element that slides more
resists much less, they need not agree, as there may be several answers; each change is then made
smaller.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.result import TangentialResult
from toeplitz_mg.values import field

ROUNDS = 200  # Bounds that are tried: a dozen are usual.
LESS = 0.5  # Factor of the change of the bound where one has not brought it closer.


def fall(
    solve: Callable[[Array, TangentialResult | None], TangentialResult],
    g: Array,
    falling: Callable[[Array], ArrayLike],
    guess: TangentialResult | None,
    tolerance: float,
) -> TangentialResult:
    """Return the result whose bound is `g` times the factor that belongs to its slip.

    Parameters
    ----------
    solve : callable
        Takes a bound and a guess, and returns the result.
    g : ndarray
        The bound of bodies that do not slip.
    falling : callable
        Takes the size of the slip, and returns the factor.
    guess : TangentialResult or None
    tolerance : float
        Of the bound, relative to the largest.
    """
    if not callable(falling):
        raise TypeError(f"falling is {falling!r}, but must be a function of the slip, or None")
    largest = float(np.max(g, where=np.isfinite(g), initial=0.0))
    bound, result = g * _factor(falling, np.zeros(g.shape)), guess
    products, work, length, before = 0, 0.0, 1.0, np.inf
    for _ in range(ROUNDS):
        result = solve(bound, result)
        products, work = products + result.products, work + result.work
        slip = result.slip
        s = np.abs(slip) if slip.ndim == g.ndim else np.hypot(*slip)
        change = np.where(result.contact, _factor(falling, s), 1.0) * g - bound
        change[~np.isfinite(change)] = 0.0  # Where the bodies are bonded they do not slip.
        away = float(np.abs(change).max(initial=0.0)) / max(largest, np.finfo(np.float64).tiny)
        result = replace(result, residual=max(result.residual, away), products=products, work=work)
        if away <= tolerance or result.residual > max(away, tolerance):
            break
        if away > before:
            length *= LESS
        before = away
        bound = bound + length * change
    assert result is not None
    return result


def _factor(falling: Callable[[Array], ArrayLike], s: Array) -> Array:
    """Return the factor of the bound, or say what is wrong with it."""
    factor = field("the factor of falling friction", falling(s))
    if factor.shape not in ((), s.shape):
        raise ValueError(
            f"falling has returned the shape {factor.shape}, but must return one number for each "
            f"of {s.shape} elements"
        )
    if not np.isfinite(factor).all() or (factor < 0.0).any():
        raise ValueError(
            f"falling has returned {factor.min():g} to {factor.max():g}, but a factor of the bound "
            "is finite and at least zero"
        )
    return np.broadcast_to(factor, s.shape)
