"""Contact problems with a known answer, and how far a solution is from it (see `rolling_theory`).

All are those of a sphere or cylinder of radius 1 and of E* = 1, of half width 0.6, on [-1, 1].
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from comparisons.contact import violation
from toeplitz_mg._typing import Array
from toeplitz_mg.contact import (
    ContactResult,
    HertzContact,
    Material,
    NormalResult,
    friction,
    hertz,
    normal_contact,
    surfaces,
)

A, C = 0.6, 0.4  # Half widths of the contact and of the area of stick.
MU = 0.3  # Coefficient of friction.
UNIT = Material.from_shear(0.7, 0.3)  # Of both bodies: E* = G/(1-ν) = 1.


@dataclass
class Solved:
    """A problem that was solved.

    Attributes
    ----------
    results : sequence of ContactResult
        One result, or for Kalker's coefficients three.
    errors : dict
        The relative errors against theory, by quantity.
    theory : ndarray or None
        The traction, along x where it is tangential.
    gap : ndarray or None
        The gap before the bodies touch, of a normal result.
    bound : ndarray or None
        The traction bound that tangential results are to have.
    """

    results: Sequence[ContactResult]
    errors: dict[str, float]
    theory: Array | None = None
    gap: Array | None = None
    bound: Array | None = None

    @property
    def violation(self) -> float:
        """The largest violation of the conditions of contact, recomputed."""
        return violation.measure(self.results, self.gap, self.bound)


def semi_ellipse(r: Array, a: float) -> Array:
    """Return √(1 - r²/a²), zero outside."""
    return np.sqrt(np.maximum(0.0, 1.0 - (r / a) ** 2))


def rms(result: ContactResult, theory: Array) -> float:
    """Return the root mean square of the error of the traction, over that of the traction."""
    q = result.traction[0] if result.traction.ndim > result.contact.ndim else result.traction
    return float(np.linalg.norm(q - theory) / np.linalg.norm(theory))


def hertz_line(N: int) -> Solved:
    """A cylinder in plane strain, by its force."""
    h, force, reference = 2.0 / N, np.pi * A**2 / 4.0, 4.0
    gap = surfaces.cylinder(N, h, radius=1.0)
    result = normal_contact(gap, h, material=UNIT, force=force, reference=reference)
    exact = hertz(radii=(1.0, np.inf), material=UNIT, force=force, reference=reference)
    return against_hertz(result, exact, gap)


def hertz_sphere(N: int) -> Solved:
    """A sphere, by its force."""
    h = 2.0 / N
    gap = surfaces.sphere((N, N), (h, h), radius=1.0)
    result = normal_contact(gap, (h, h), material=UNIT, force=4.0 / 3.0 * A**3)
    return against_hertz(result, hertz(radii=1.0, material=UNIT, force=result.force), gap)


def hertz_ellipse(N: int) -> Solved:
    """An ellipsoid, by its approach, whose contact is half as wide as it is long."""
    h, radii = 2.0 / N, (2.38, 0.837)
    gap = surfaces.ellipsoid((N, N // 2), (h, h), radii=radii)
    exact = hertz(radii=radii, material=UNIT, approach=0.1294)
    result = normal_contact(gap, (h, h), material=UNIT, approach=exact.approach)
    return against_hertz(result, exact, gap)


def against_hertz(result: NormalResult, exact: HertzContact, gap: Array) -> Solved:
    """Return the errors of a result against Hertz's theory."""
    theory = exact.pressure_at(*np.meshgrid(*result.centres, indexing="ij"))
    assert exact.approach is not None
    errors = {
        "area": result.area / exact.area - 1.0,
        "p₀": result.max_pressure / exact.max_pressure - 1.0,
        "δ": result.approach / exact.approach - 1.0,
        "F": result.force / exact.force - 1.0,
        "traction": rms(result, theory),
    }
    return Solved([result], errors, theory, gap)


def westergaard(N: int) -> Solved:
    """A wave that repeats, under a third of the pressure at which it touches everywhere."""
    h, share, amplitude = 2.0 / N, 1.0 / 3.0, 0.05
    full = np.pi * amplitude / 2.0  # With E* = 1 and a wave of length 2 (Johnson, §13.2).
    (x,) = surfaces.centres(N, h)
    gap = amplitude * (1.0 - np.cos(np.pi * x))
    result = normal_contact(gap, h, material=UNIT, force=2.0 * share * full, periodic=True)
    inside = np.maximum(share - np.sin(np.pi * x / 2.0) ** 2, 0.0)
    theory = 2.0 * full * np.cos(np.pi * x / 2.0) * np.sqrt(inside)
    errors = {
        "a": result.area / (4.0 / np.pi * np.arcsin(np.sqrt(share))) - 1.0,
        "p₀": result.max_pressure / (2.0 * full * np.sqrt(share)) - 1.0,
        "traction": rms(result, theory),
    }
    return Solved([result], errors, theory, gap)


def cattaneo_line(N: int) -> Solved:
    """A shift of a line contact, by its force."""
    h = 2.0 / N
    (x,) = surfaces.centres(N, h)
    g = MU * A / 2.0 * semi_ellipse(x, A)
    force = (1.0 - (C / A) ** 2) * MU * np.pi * A**2 / 4.0
    result = friction(g, h, material=UNIT, force=force)
    theory = g - MU * C / 2.0 * semi_ellipse(x, C)
    errors = {
        "c": result.stick.sum() * h / (2.0 * C) - 1.0,
        "traction": rms(result, theory),
    }
    return Solved([result], errors, theory, bound=g)


def cattaneo_sphere(N: int, nu: float = 0.0) -> Solved:
    """A shift of a sphere, by its displacement (Mindlin's traction is exact for ν = 0 alone)."""
    h = 2.0 / N
    r = np.hypot(*surfaces.centres((N, N), (h, h)))
    g = MU * 2.0 * A / np.pi * semi_ellipse(r, A)
    shift = MU * (A**2 - C**2) * (2.0 - nu) / (2.0 * (1.0 - nu))
    result = friction(g, (h, h), material=Material.from_shear(1.0 - nu, nu), shift=(shift, 0.0))
    theory = g - MU * 2.0 * C / np.pi * semi_ellipse(r, C)
    errors = {
        "c": np.sqrt(result.stick.sum() * h**2 / np.pi) / C - 1.0,
        "F": result.force[0] / (MU * 4.0 / 3.0 * (A**3 - C**3)) - 1.0,
        "traction": rms(result, theory),
    }
    return Solved([result], errors, theory, bound=g)


def mindlin_sphere(N: int) -> Solved:
    """A shift of a sphere, by its displacement, for ν = 0.28: the directions are coupled."""
    return cattaneo_sphere(N, 0.28)


def pressed_sphere(N: int) -> Solved:
    """A sphere that is pressed, and then shifted by a force, of the coefficient of friction."""
    h, nu = 2.0 / N, 0.0
    gap, material = surfaces.sphere((N, N), (h, h), radius=1.0), Material.from_shear(1.0 - nu, nu)
    pressed = normal_contact(gap, (h, h), material=material, force=4.0 / 3.0 * A**3)
    force = MU * 4.0 / 3.0 * (A**3 - C**3)
    result = friction(pressed, mu=MU, force=(force, 0.0))
    r = np.hypot(*surfaces.centres((N, N), (h, h)))
    theory = MU * 2.0 / np.pi * (A * semi_ellipse(r, A) - C * semi_ellipse(r, C))
    shift = MU * (A**2 - C**2) * (2.0 - nu) / (2.0 * (1.0 - nu))
    errors = {
        "c": np.sqrt(result.stick_area / np.pi) / C - 1.0,
        "δ": result.shift[0] / shift - 1.0,
        "traction": rms(result, theory),
    }
    return Solved([result, pressed], errors, theory, gap, MU * pressed.pressure)
