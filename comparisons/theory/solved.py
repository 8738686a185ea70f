"""What a problem with a known answer gives: errors, products, violations; and how errors fall.

Unless they say so bodies have the radius 1, E* = 1, and a contact of half width 0.6, on [-1, 1].
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import nan

import numpy as np

from comparisons.systems import conditions
from toeplitz_mg._typing import Array
from toeplitz_mg.contact import ContactResult, Material

A, C = 0.6, 0.4  # Half widths of the contact and of the area of stick.
MU = 0.3  # Coefficient of friction.
UNIT = Material.from_shear(0.7, 0.3)  # Of both bodies: E* = G/(1-ν) = 1.


@dataclass
class Solved:
    """A problem that was solved."""

    results: Sequence[ContactResult]  # One result, or for Kalker's coefficients three.
    errors: dict[str, float] = field(default_factory=dict)  # Relative, against theory.
    theory: Array | None = None  # The traction, along x where it is tangential.
    gap: Array | None = None  # Before the bodies touch, of a normal result.
    bound: Array | None = None  # The traction bound that tangential results are to have.

    @property
    def violation(self) -> float:
        """The largest violation of the conditions of contact, recomputed."""
        return conditions.measure(self.results, self.gap, self.bound)


def semi_ellipse(r: Array, a: float) -> Array:
    """Return √(1 - r²/a²), zero outside."""
    return np.sqrt(np.maximum(0.0, 1.0 - (r / a) ** 2))


def rms(result: ContactResult, theory: Array) -> float:
    """Return the root mean square of the error of the traction, over that of the traction."""
    q = result.traction[0] if result.traction.ndim > result.contact.ndim else result.traction
    return float(np.linalg.norm(q - theory) / np.linalg.norm(theory))


def grids(N: int) -> list[int]:
    """Return some even sizes from N to less than 1.2 N."""
    return [N + 2 * (k * N // 32) for k in range(4)]


def order(errors: Sequence[float], sizes: Sequence[int]) -> float:
    """Return the power of 1/N by which errors fall, by least squares."""
    known = [k for k, e in enumerate(errors) if e > 0.0]
    if len(known) < 2:
        return nan
    x, y = np.log(np.array(sizes)[known]), np.log(np.array(errors)[known])
    return -float(np.polyfit(x, y, 1)[0])
