"""Rolling with a known answer, and how far a solution is from it.

Contacts are those of `theory`, of half width 0.6 on [-1, 1] with E* = 1, that roll towards positive
x. Carter's cylinder drives, and sticks in a part of its contact; the slip behind it is known too,
so that there is a bound for which friction that falls with the slip leaves the same tractions.
"""

from typing import Any

import numpy as np

from comparisons.contact.theory import MU, UNIT, A, Solved, rms, semi_ellipse
from toeplitz_mg import halfspace
from toeplitz_mg._typing import Array
from toeplitz_mg.contact import (
    ContactResult,
    Material,
    TangentialResult,
    frictional_rolling,
    rolling,
    surfaces,
)

PART = 0.6  # Of the contact of Carter's cylinder that sticks.
# Coefficients of a circle, ν = 1/4, by Kalker (1990).
KALKER = {"C11": 4.12, "C22": 3.67, "C23": 1.47, "C33": 1.19}
CREEPAGE = 1e-3  # Creepage of Kalker's problems; bonded rolling is linear in it.
STICKY = 10.0  # Coefficient of friction that leaves no slip, and bonds no edge without pressure.
ROLLERS = Material.from_shear(0.35, 0.3), Material.from_shear(1.4, 0.3)  # Unlike, E* of some 1.1.


def carter_bound(N: int) -> tuple[Array, Array, float]:
    """Return the centres of N strips, Carter's bound, and the width of a strip."""
    h = 2.0 / N
    (x,) = surfaces.centres(N, h)
    return x, MU * A / 2.0 * semi_ellipse(x, A), h


def carter_traction(x: Array) -> Array:
    """Return the tractions of the cylinder that drives."""
    stick = PART * semi_ellipse(x - (1.0 - PART) * A, PART * A)
    return MU * A / 2.0 * (semi_ellipse(x, A) - stick)


def carter_slip(x: Array) -> Array:
    """Return the size of the slip over the distance rolled, in contact."""
    return MU * np.sqrt(np.maximum(0.0, (x - (1.0 - PART) * A) ** 2 - (PART * A) ** 2))


def falling_friction(slip: Array) -> Array:
    """Return the factor of the bound where the slip is that, at most 0.23 of Carter's."""
    return 0.5 + 0.5 / (1.0 + slip / 0.1)


def against_carter(result: TangentialResult, x: Array, bound: Array) -> Solved:
    """Return the errors of a result against Carter's theory."""
    theory = carter_traction(x)
    errors = {
        "a′": result.stick_area / (2.0 * PART * A) - 1.0,
        "ξ": -result.creepages / (MU * A * (1.0 - PART)) - 1.0,
        "F": result.force / ((1.0 - PART**2) * MU * np.pi * A**2 / 4.0) - 1.0,
        "traction": rms(result, theory),
    }
    return Solved([result], errors, theory, bound=bound)


def carter(N: int) -> Solved:
    """A cylinder that drives, and sticks in 0.6 of its contact."""
    x, g, h = carter_bound(N)
    result = rolling(g, h, material=UNIT, longitudinal=-MU * A * (1.0 - PART))
    solved = against_carter(result, x, g)
    del solved.errors["ξ"]  # It is given.
    return solved


def carter_by_force(N: int) -> Solved:
    """The same, by the force that it carries: its creepage is found."""
    x, g, h = carter_bound(N)
    force = (1.0 - PART**2) * MU * np.pi * A**2 / 4.0
    solved = against_carter(rolling(g, h, material=UNIT, force=force), x, g)
    del solved.errors["F"]
    return solved


def carter_falling(N: int) -> Solved:
    """The same tractions, by friction that falls, within a bound that is higher where it slips."""
    x, g, h = carter_bound(N)
    before = g / falling_friction(np.where(x < (1.0 - 2.0 * PART) * A, carter_slip(x), 0.0))
    given: dict[str, Any] = {"material": UNIT, "longitudinal": -MU * A * (1.0 - PART)}
    result = rolling(before, h, falling=falling_friction, **given)
    solved = against_carter(result, x, before * falling_friction(np.abs(result.slip)))
    del solved.errors["ξ"]
    return solved


def kalker(N: int) -> Solved:
    """The linear creepage coefficients of a circle, ν = 1/4, from bonded rolling."""
    h = 2.0 / N
    r = np.hypot(*surfaces.centres((N, N), (h, h)))
    g = np.where(r < A, np.inf, 0.0)
    names = ("longitudinal", "lateral", "spin")
    creepages: list[dict[str, Any]] = [{name: CREEPAGE} for name in names]
    results = [
        rolling(g, (h, h), material=Material.from_shear(1.0, 0.25), **creepage)
        for creepage in creepages
    ]
    # F_x = -G a² C11 ξ, F_y = -G a² (C22 η + a C23 φ), M = -G a⁴ C33 φ
    longitudinal, lateral, spin = results
    assert spin.moment is not None
    forces = longitudinal.force[0], lateral.force[1], spin.force[1] / A, spin.moment / A**2
    errors = {
        name: -force / (CREEPAGE * A**2) / exact - 1.0
        for (name, exact), force in zip(KALKER.items(), forces, strict=True)
    }
    return Solved(results, errors, bound=g)


def bufler(N: int) -> Solved:
    """Unlike rollers in plane strain that do not slip, free of a tangential force: they creep."""
    h, radius = 2.0 / N, 1.0
    both = halfspace.combined_material(*ROLLERS)
    beta = both.difference / (1.0 - both.nu)  # Dundurs' parameter.
    gamma = np.log((1.0 + beta) / (1.0 - beta)) / (2.0 * np.pi)
    force = np.pi * both.E_star / (4.0 * radius) * A**2 * (1.0 + 4.0 * gamma**2)
    gap = surfaces.cylinder(N, h, radius=radius)
    result = frictional_rolling(
        gap, h, material=ROLLERS, mu=STICKY, force=force, tangential_force=0.0, tolerance=1e-8
    )
    errors = {
        "a": result.normal.area / (2.0 * A) - 1.0,
        "ξ": -result.tangential.creepages / (2.0 * gamma * A / radius) - 1.0,
    }
    results: list[ContactResult] = [result.tangential, result.normal]
    return Solved(results, errors, gap=gap, bound=STICKY * result.normal.pressure)
