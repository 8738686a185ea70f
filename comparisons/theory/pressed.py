"""Bodies that are pressed, and shifted: Hertz, Westergaard, Cattaneo and Mindlin, flat punches."""

from typing import Any

import numpy as np

from comparisons.theory.solved import MU, UNIT, A, C, Solved, rms, semi_ellipse
from toeplitz_mg._typing import Array
from toeplitz_mg.contact import (
    HertzContact,
    Material,
    NormalResult,
    friction,
    frictional_contact,
    hertz,
    normal_contact,
    surfaces,
)


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
    result = friction(bound=g, element=h, material=UNIT, force=force)
    theory = g - MU * C / 2.0 * semi_ellipse(x, C)
    errors = {"c": result.stick.sum() * h / (2.0 * C) - 1.0, "traction": rms(result, theory)}
    return Solved([result], errors, theory, bound=g)


def cattaneo_sphere(N: int, nu: float = 0.0) -> Solved:
    """A shift of a sphere, by its displacement (Mindlin's traction is exact for ν = 0 alone)."""
    h = 2.0 / N
    r = np.hypot(*surfaces.centres((N, N), (h, h)))
    g = MU * 2.0 * A / np.pi * semi_ellipse(r, A)
    shift = MU * (A**2 - C**2) * (2.0 - nu) / (2.0 * (1.0 - nu))
    result = friction(
        bound=g, element=(h, h), material=Material.from_shear(1.0 - nu, nu), shift=(shift, 0.0)
    )
    theory = g - MU * 2.0 * C / np.pi * semi_ellipse(r, C)
    errors = {
        "c": np.sqrt(result.stick.sum() * h**2 / np.pi) / C - 1.0,
        "F": result.force[0] / (MU * 4.0 / 3.0 * (A**3 - C**3)) - 1.0,
        "traction": rms(result, theory),
    }
    return Solved([result], errors, theory, bound=g)


def repeated_friction(N: int) -> Solved:
    """Rough surfaces that repeat, ν = 0, under half of the force that friction can carry.

    The tractions are μ times the difference of two pressures (Ciavarella; Jäger).
    """
    h, nu = 2.0 / N, 0.0
    options: Any = {"material": Material.from_shear(1.0 - nu, nu), "periodic": True}
    gap = surfaces.rough((N, N), (h, h), rms=0.01, longest=0.5, shortest=4.0 * h, seed=1)
    pressed = normal_contact(gap, (h, h), force=0.2, **options)
    half = 0.5 * MU * pressed.force
    result = friction(pressed, mu=MU, force=(half, 0.0))
    before = normal_contact(gap, (h, h), force=pressed.force - half / MU, **options)
    theory = MU * (pressed.pressure - before.pressure)
    return Solved(
        [result, pressed], {"traction": rms(result, theory)}, theory, gap, MU * pressed.pressure
    )


def flat_punch(N: int) -> Solved:
    """A rigid circular punch that is pressed: F = 2 E* a δ (Johnson, §3.4)."""
    h = 2.0 / N
    gap = np.where(np.hypot(*surfaces.centres((N, N), (h, h))) < 0.8, 0.0, 1.0)
    # The elements are a staircase: a is the radius of the circle that has their area.
    a = float(np.sqrt((gap == 0.0).sum() * h**2 / np.pi))
    result = normal_contact(gap, (h, h), material=UNIT, approach=1e-3)
    return Solved([result], {"F": result.force / (2.0 * a * 1e-3) - 1.0}, gap=gap)


def bonded_punch(N: int, nu: float) -> Solved:
    """A rigid circular punch that is bonded, over a smooth one (Mossakovskii and Spence)."""
    exact = np.log(3.0 - 4.0 * nu) * (1.0 - nu) / (1.0 - 2.0 * nu)
    h, bodies = 2.0 / N, (Material.from_shear(1.0, nu), Material.rigid())
    gap = np.where(np.hypot(*surfaces.centres((N, N), (h, h))) < 0.8, 0.0, 1.0)
    smooth = normal_contact(gap, (h, h), material=bodies, approach=1e-3)
    bonded = frictional_contact(gap, (h, h), material=bodies, approach=1e-3, mu=np.inf)
    errors = {"F": bonded.normal.force / smooth.force / exact - 1.0}
    bound = np.where(bonded.normal.pressure > 0.0, np.inf, 0.0)
    return Solved([bonded.tangential, bonded.normal], errors, gap=gap, bound=bound)


def rough_gap(N: int) -> Array:
    """Return a rough surface on [-1, 1]², of wavelengths from 0.5 to 1/32, or to four elements."""
    h = 2.0 / N
    shortest = max(2.0 / 64, 4.0 * h)
    return surfaces.rough((N, N), (h, h), rms=0.01, longest=0.5, shortest=shortest, seed=1)


def rough(N: int, force: float, periodic: bool) -> Solved:
    """A rough surface, that ends or repeats: what it costs, and whether all conditions hold."""
    h, gap = 2.0 / N, rough_gap(N)
    result = normal_contact(gap, (h, h), material=UNIT, force=force, periodic=periodic)
    return Solved([result], gap=gap)
