"""Friction that depends on the slip: a bound and the slip that belong to each other.

The bound makes the tractions, these the slip, and the slip the bound: a fixed point, which there
always is where friction has no jumps. Anderson's acceleration finds it. Repeating the three alone
does not, from a fall on that is a fraction of the stiffness of an element: what slides disturbs
what is behind it, and overshoots. Where friction rises with the slip, a larger bound leaves less
slip: there a part of the way is gone, as if each element were alone.

Where friction falls by more than that stiffness, an element may slide slowly with much friction, or
fast with little, under the same tractions of the others: then there may be several answers, of
which one is found.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.acceleration import Pairs, accelerate, extend
from toeplitz_mg.contact.products import Report
from toeplitz_mg.contact.results import ContactError, TangentialResult
from toeplitz_mg.values import in_range, numbers

ROUNDS = 400  # Bounds that are tried: a dozen are usual.
PATIENCE = 8  # Rounds without progress, after which they are no longer accelerated.
# Rounds without progress thereafter, after which the bound goes a part of the way only, and which.
STILL_PATIENT, PART = 40, 0.3
PROGRESS = 0.5  # Factor of the least error so far, below which a new one is progress.
LEAST = 1e-10  # Least factor of the bound: with none at all an element would be no contact.
SLIPS = 32  # Slips between which the steepest fall is looked for.
SMALLEST = 1e-4  # The least of them, over the largest.


@dataclass
class Rounds:
    """Solutions one after the other, all of which together may take so many products.

    Attributes
    ----------
    roll : callable
        Takes what is asked of the motion, a bound, a guess, the most products, and what is told
        of them, and returns the result.
    most : int
        Products of all rounds together, beyond which they are taken for a failure.
    report : Report
    work : float
        That of the rounds so far.
    """

    roll: Callable[..., TangentialResult]
    most: int
    report: Report
    work: float = 0.0

    def __call__(self, asked: Any, g: Array, guess: TangentialResult | None) -> TangentialResult:
        """Return the result of one more bound, with the products and the work of all rounds."""
        left = self.most - self.report.products
        result = self.roll(asked, g, guess, left, self.report)
        self.report.add(result.products, left)
        self.work += result.work
        return replace(result, products=self.report.products, work=self.work)


def fall(
    rounds: Rounds,
    asked: Any,
    g: Array,
    falling: Callable[[Array], ArrayLike],
    stiffness: float,
    guess: TangentialResult | None,
    tolerance: float,
    slip: Array | None = None,
) -> TangentialResult:
    """Return the result whose bound is `g` times the factor that belongs to its slip.

    Parameters
    ----------
    rounds : Rounds
        They solve for one bound after the other.
    asked : tuple
        What is asked of the motion.
    g : ndarray
        The bound of bodies that do not slip.
    falling : callable
        Takes the size of the slip, and returns the factor.
    stiffness : float
        The change of the traction of an element by which its slip changes by 1, N/mm².
    guess : TangentialResult or None
    tolerance : float
        Of the bound, relative to the largest.
    slip : ndarray, optional
        The size of the slip that the first bound belongs to, instead of none.
    """
    if not callable(falling):
        raise TypeError(f"falling is {falling!r}, but must be a function of the slip, or None")
    falls = (g > 0.0) & np.isfinite(g)  # Where the bodies are bonded they do not slip.
    largest = float(np.max(g, where=falls, initial=0.0)) or 1.0
    pairs: Pairs = []
    bound = g.copy()
    bound[falls] *= factor_of(falling, np.zeros(g.shape) if slip is None else slip)[falls]
    least, left, part = np.inf, PATIENCE, 1.0
    for _ in range(ROUNDS):
        result = guess = rounds(asked, bound, guess)
        s = size_of_slip(result)
        x, y = bound[falls], g[falls] * factor_of(falling, s)[falls]
        away = float(np.abs(y - x).max(initial=0.0)) / largest
        if away <= tolerance or result.residual > tolerance or rounds.report.exhausted:
            break
        if away < PROGRESS * least:
            least, left = away, PATIENCE if left > 0 else 0
        else:
            left -= 1
        if left <= -STILL_PATIENT:
            part = PART
        elif left <= 0:  # Where friction falls steeply, pairs may lead astray.
            pairs = []
        # Where friction rises, a larger bound leaves less slip, which would overshoot.
        pairs = extend(
            pairs, x, x + part * (y - x) / (1.0 + _rise(falling, g, s)[falls] / stiffness)
        )
        bound = bound.copy()
        bound[falls] = accelerate(pairs)
    else:
        raise ContactError(
            f"after {ROUNDS} rounds of slip and friction the traction bound is off by {away:.1e} "
            f"of the largest from that of the slip, but the tolerance is {tolerance:g}: where the "
            f"slip grows by 1, friction falls by up to {_steepest(falling, g, falls, s):.3g} N/mm² "
            f"and rises by up to {float(_rise(falling, g, s)[falls].max()):.3g}, and an element "
            f"resists by {stiffness:.3g}, beyond which there may be several answers, or none is "
            "found",
            replace(result, residual=away),
        )
    steepest_fall = _steepest(falling, g, falls, s)
    if steepest_fall > stiffness:
        doubt = (
            f"friction falls by up to {steepest_fall:.3g} N/mm² where the slip grows by 1, but an "
            f"element resists by {stiffness:.3g} only: there may be other answers than this one"
        )
        result = replace(result, warnings=(*result.warnings, doubt))
    return replace(result, residual=max(result.residual, away))


def size_of_slip(result: TangentialResult) -> Array:
    """Return the size of the slip in each element."""
    assert result.slip is not None
    is_one = result.slip.ndim == result.contact.ndim
    return np.abs(result.slip) if is_one else np.hypot(*result.slip)


def _rise(falling: Callable[..., Any], g: Array, s: Array) -> Array:
    """Return by how much friction rises where the slip `s` grows by 1; zero where it falls."""
    step = SMALLEST * float(s.max(initial=0.0)) or 1.0
    rise: Array = g * (factor_of(falling, s + step) - factor_of(falling, s))
    return np.maximum(rise / step, 0.0)


def _steepest(falling: Callable[..., Any], g: Array, falls: Array, s: Array) -> float:
    """Return by how much friction falls at most where the slip grows by 1, up to the slip `s`."""
    largest = float(s.max(initial=0.0))
    if not falls.any() or largest == 0.0:
        return 0.0
    slips = np.array([0.0, *np.geomspace(SMALLEST, 1.0, SLIPS) * largest])
    before, steepest = factor_of(falling, np.zeros(g.shape)), 0.0
    for slip, step in zip(slips[1:].tolist(), np.diff(slips).tolist(), strict=True):
        factor = factor_of(falling, np.full(g.shape, slip))
        steepest = max(steepest, float(((before - factor)[falls] * g[falls]).max()) / step)
        before = factor
    return steepest


def factor_of(falling: Callable[[Array], ArrayLike], s: Array) -> Array:
    """Return the factor of the bound, or say what is wrong with it."""
    factor = numbers("the factor of falling friction", falling(s))
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
    factor = np.maximum(factor, LEAST)  # It may underflow.
    in_range("the factor of falling friction", float(factor.max(initial=0.0)))
    return np.broadcast_to(factor, s.shape)
