"""Rolling towards positive x: Carter, Kalker, Bufler; and numbers that others have printed.

Carter's cylinder drives, and sticks in a part of its contact; the slip behind it is known too,
so that there is a bound for which friction that falls with the slip leaves the same tractions.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from comparisons.harness.report import Row
from comparisons.theory.solved import MU, UNIT, A, Solved, rms, semi_ellipse
from toeplitz_mg import halfspace
from toeplitz_mg._typing import Array
from toeplitz_mg.contact import (
    ContactResult,
    FrictionalResult,
    Material,
    TangentialResult,
    friction,
    frictional_contact,
    frictional_rolling,
    kalker_coefficients,
    normal_contact,
    rolling,
    rolling_steps,
    surfaces,
)

PART = 0.6  # Of the contact of Carter's cylinder that sticks.
FORCE = (1.0 - PART**2) * MU * np.pi * A**2 / 4.0  # That it carries.
# Coefficients of a circle, ν = 1/4, by Kalker (1990).
KALKER = {"C11": 4.12, "C22": 3.67, "C23": 1.47, "C33": 1.19}
CREEPAGE = 1e-3  # Creepage of Kalker's problems; bonded rolling is linear in it.
STICKY = 10.0  # Coefficient of friction that leaves no slip, and bonds no edge without pressure.
ROLLERS = Material.from_shear(0.35, 0.3), Material.from_shear(1.4, 0.3)  # Unlike, E* of some 1.1.
KALKERS = "Kalker's C11, C22, C23, C33, "  # Rows of his tables start with this.
# C11, C22, C23 and C33 by the ratio a/b and Poisson's ratio, of Kalker (1990).
TABLES = {
    **{(0.1, 0.0): (2.51, 2.51, 0.334, 6.42), (0.1, 0.25): (3.31, 2.52, 0.473, 8.28)},
    **{(0.1, 0.5): (4.85, 2.53, 0.731, 11.7), (0.5, 0.0): (2.88, 2.88, 0.827, 1.74)},
    **{(0.5, 0.25): (3.62, 3.01, 0.929, 1.93), (0.5, 0.5): (4.83, 3.14, 1.07, 2.22)},
    **{(1.0, 0.0): (3.40, 3.40, 1.33, 1.21), (1.0, 0.25): (4.12, 3.67, 1.47, 1.19)},
    **{(1.0, 0.5): (5.20, 3.98, 1.63, 1.16), (2.0, 0.0): (4.37, 4.37, 2.35, 0.958)},
    **{(2.0, 0.25): (5.10, 4.90, 2.62, 0.819), (2.0, 0.5): (6.11, 5.56, 2.96, 0.650)},
    **{(10.0, 0.0): (10.7, 10.7, 12.2, 0.795), (10.0, 0.25): (11.7, 12.8, 14.6, 0.526)},
    **{(10.0, 0.5): (12.9, 16.0, 18.0, 0.228)},
}
# Of aluminium and steel, N/mm²; their radius, mm, and load, N/mm (Bentall and Johnson, 1967).
METALS = Material.from_shear(23000.0, 0.31), Material.from_shear(82000.0, 0.28)
RADIUS, LOAD = 25.0, 16.2019
# μ, the force over μ times the load, and the creepage that another program prints for it.
CREEPAGES = (
    *((10.0, 0.0, 3.591e-4), (0.05, 0.0, 4.294e-4)),
    *((0.05, 0.75, 5.392e-4), (0.05, -0.75, 2.108e-4)),
)
# A soft sphere that is pressed on a rigid plane in 35 steps (Spence; Kalker 1990, Figure 5.25).
SPHERE, SPHERE_MU = (Material.from_shear(0.5, 0.0), Material.from_shear(1e5, 0.0)), 0.2986
STEPS = 35
SPENCE = {"contact": 921, "stick": 225, "slip": 696, "peak": 0.02392, "approach": 0.09874}


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


def against_carter(result: TangentialResult, x: Array, bound: Array, given: str) -> Solved:
    """Return the errors of a result against Carter's theory, but for what is given."""
    theory = carter_traction(x)
    errors = {
        "a′": result.stick_area / (2.0 * PART * A) - 1.0,
        "ξ": -result.creepages / (MU * A * (1.0 - PART)) - 1.0,
        "F": result.force / FORCE - 1.0,
        "traction": rms(result, theory),
    }
    del errors[given]
    return Solved([result], errors, theory, bound=bound)


def carter(N: int) -> Solved:
    """A cylinder that drives, and sticks in 0.6 of its contact."""
    x, g, h = carter_bound(N)
    result = rolling(bound=g, element=h, material=UNIT, longitudinal=-MU * A * (1.0 - PART))
    return against_carter(result, x, g, "ξ")


def carter_by_force(N: int) -> Solved:
    """The same, by the force that it carries: its creepage is found."""
    x, g, h = carter_bound(N)
    return against_carter(rolling(bound=g, element=h, material=UNIT, force=FORCE), x, g, "F")


def carter_falling(N: int) -> Solved:
    """The same tractions, by friction that falls, within a bound that is higher where it slips."""
    x, g, h = carter_bound(N)
    before = g / falling_friction(np.where(x < (1.0 - 2.0 * PART) * A, carter_slip(x), 0.0))
    given: dict[str, Any] = {"material": UNIT, "longitudinal": -MU * A * (1.0 - PART)}
    result = rolling(bound=before, element=h, falling=falling_friction, **given)
    return against_carter(result, x, before * falling_friction(np.abs(result.slip)), "ξ")


def carter_from_rest(N: int) -> Solved:
    """A cylinder that is held by a force and begins to roll: after two contacts it is Carter's."""
    x, g, h = carter_bound(N)
    case: dict[str, Any] = {"element": h, "material": UNIT, "force": FORCE}
    steps = rolling_steps(
        bound=g, steps=round(4.0 * A / h), previous=friction(bound=g, **case), **case
    )
    *_, last = steps
    solved = against_carter(last, x, g, "F")
    steady = Solved([rolling(bound=g, **case)], solved.errors, solved.theory, bound=g)
    steady.errors["from steady"] = rms(last, steady.results[0].traction)
    return steady


def kalker(N: int) -> Solved:
    """The linear creepage coefficients of a circle, ν = 1/4, from bonded rolling."""
    h = 2.0 / N
    r = np.hypot(*surfaces.centres((N, N), (h, h)))
    g = np.where(r < A, np.inf, 0.0)
    names = ("longitudinal", "lateral", "spin")
    case: dict[str, Any] = {"bound": g, "element": (h, h)}
    case["material"] = Material.from_shear(1.0, 0.25)
    results = [rolling(**(case | {name: CREEPAGE})) for name in names]
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


def printed_tables() -> Iterator[Row]:
    """Compare with the tables that Kalker printed, of three digits."""
    for (ratio, nu), known in TABLES.items():
        found = kalker_coefficients(ratio, nu)
        yield row_of(f"{KALKERS}a/b = {ratio:g}, ν = {nu:g}", found, known, 3)


def printed_creepages() -> Iterator[Row]:
    """Compare the creepages of aluminium on steel with those of another program."""
    h = 0.216 / 216
    gap = surfaces.cylinder(216, h, radius=RADIUS)
    for mu, part, known in CREEPAGES:
        force = part * mu * LOAD
        rolled = frictional_rolling(
            gap, h, material=METALS, mu=mu, force=LOAD, tangential_force=force
        )
        name = f"creepage of aluminium on steel, μ = {mu:g}, F = {part:g} μP"
        yield row_of(name, [-float(rolled.tangential.creepages)], [known], 4)


def printed_sphere(steps: int = STEPS) -> Iterator[Row]:
    """Press the soft sphere in steps, or in the first of them, for which nothing is printed."""
    x = -4.3999 + 0.2 * np.arange(45)
    gap, element = 0.004116 * (x[:, None] ** 2 + x**2), (0.2, 0.2)
    state: FrictionalResult | None = None
    for k in range(1, steps + 1):
        force = (k / 45) ** 3
        state = frictional_contact(
            gap, element, material=SPHERE, mu=SPHERE_MU, force=force, previous=state
        )
    assert state is not None
    normal, tangential = state.normal, state.tangential
    counts = [int(mask.sum()) for mask in (normal.contact, tangential.stick, tangential.sliding)]
    found = [*counts, normal.max_pressure, normal.approach]
    known = list(SPENCE.values()) if steps == STEPS else []
    yield row_of(f"sphere in {steps} steps: {', '.join(SPENCE)}", found, known, 4)
    smooth = normal_contact(gap, element, material=SPHERE, force=force)
    found = [int(smooth.contact.sum()), smooth.max_pressure]
    known = [973, 0.01834] if steps == STEPS else []
    yield row_of("the same without the coupling: contact, peak", found, known, 4)


def row_of(case: str, found: Any, known: Any, digits: int) -> Row:
    """Return a row: what is found, what is known, and the largest relative error."""
    here, there = (", ".join(f"{x:.{digits}g}" for x in values) for values in (found, known))
    errors = [abs(x / y - 1.0) for x, y in zip(found, known, strict=False)]
    off = f"{max(errors):.2%}" if errors else ""
    return {"case": case, "here": here, "known": there, "off": off}
