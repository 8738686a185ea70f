"""Hertz's theory: what a cylinder or an ellipsoid does to a flat."""

import math
from dataclasses import dataclass

from scipy.optimize import brentq
from scipy.special import elliprd, elliprf

FLATTEST = 1e4  # Ratio of two radii of curvature, beyond which the body is a cylinder.


@dataclass(frozen=True)
class Hertz:
    """The contact of an ellipsoid or a cylinder with a flat.

    Attributes
    ----------
    half_axes : (float, float)
        Half axes of the contact along x and y, mm; in line contact the second is 0.
    force : float
        The force that presses, N; in line contact N/mm.
    largest : float
        The largest pressure, N/mm².
    approach : float or None
        The approach of the bodies, mm; in line contact it is open by a constant.
    """

    half_axes: tuple[float, float]
    force: float
    largest: float
    approach: float | None

    @property
    def area(self) -> float:
        """The area of contact, mm²; in line contact its width, mm."""
        a, b = self.half_axes
        return math.pi * a * b if b else 2.0 * a

    @classmethod
    def line(cls, radius: float, modulus: float, force: float) -> "Hertz":
        """Return the contact of a cylinder, by its modulus E* (N/mm²) and its force."""
        a = math.sqrt(4.0 * force * radius / (math.pi * modulus))
        return cls((a, 0.0), force, 2.0 * force / (math.pi * a), None)

    @classmethod
    def ellipse(
        cls,
        radii: tuple[float, float],
        modulus: float,
        force: float | None,
        approach: float | None,
    ) -> "Hertz":
        """Return the contact of an ellipsoid, by its modulus E* (N/mm²) and force or approach."""
        R1, R2 = max(radii), min(radii)
        if R1 > FLATTEST * R2:
            raise ValueError(
                f"the radii are {radii[0]:g} and {radii[1]:g}, but one may be {FLATTEST:g} times "
                "the other at most: beyond, it is a cylinder in line contact"
            )
        # Johnson, Contact Mechanics, §4.2, in Carlson's integrals, that are exact for circles too.
        ratio = 1.0
        if R1 > R2:
            ratio = brentq(lambda k: _radii(k) - R1 / R2, 1.0 / FLATTEST, 1.0, xtol=1e-15)
        K, D = _integrals(ratio)
        if force is not None:
            a = (3.0 * force * R1 * D / (math.pi * modulus)) ** (1.0 / 3.0)
            largest = 3.0 * force / (2.0 * math.pi * ratio * a**2)
            approach = largest * ratio * a * K / modulus
        else:
            assert approach is not None
            a = math.sqrt(2.0 * approach * R1 * D / K)
            largest = approach * modulus / (ratio * a * K)
            force = 2.0 / 3.0 * math.pi * ratio * a**2 * largest
        axes = (a, ratio * a) if radii[0] >= radii[1] else (ratio * a, a)
        return cls(axes, force, largest, approach)


def _integrals(ratio: float) -> tuple[float, float]:
    """Return the elliptic integrals K and D = (K - E)/e², by the ratio of the half axes."""
    return float(elliprf(0.0, ratio**2, 1.0)), float(elliprd(0.0, ratio**2, 1.0)) / 3.0


def _radii(ratio: float) -> float:
    """Return the ratio of the radii of curvature, by that of the half axes."""
    K, D = _integrals(ratio)
    return (K - D) / (ratio**2 * D)
