"""Surfaces that repeat, and hardness: the pressures obey the conditions of contact."""

from typing import Any

import numpy as np
from numpy.random import Generator

from comparisons.reliability.trials import FAILED, RIGHT, Outcome
from comparisons.systems.random_matrices import log_uniform, random_grid
from toeplitz_mg._typing import Array
from toeplitz_mg.contact import ContactError, Material, NormalResult, normal_contact
from toeplitz_mg.contact.grid import Grid

TOLERANCE = 1e-8
SLACK = 1.05  # Tolerances that a violation may have, for the rounding of another product.
MOST = 600  # Most elements: the products are dense.
EVERYWHERE = 0.999  # Share of the approach at which the bodies touch everywhere.


def repeated_problem(rng: Generator) -> Outcome:
    """Try a surface that repeats along some axes, with a hardness or without."""
    shape = random_grid(rng, int(log_uniform(rng, 2, MOST)), int(rng.integers(1, 3)))
    h = log_uniform(rng, 1e-3, 10.0)
    element: Any = (h, h * log_uniform(rng, 0.2, 5.0))[: len(shape)]
    material = Material.from_shear(log_uniform(rng, 1e-1, 1e6), float(rng.uniform(0.0, 0.5)))
    gap = h * log_uniform(rng, 1e-4, 0.1) * rng.random(shape) ** rng.uniform(0.5, 3.0)
    periodic: Any = tuple(bool(x) for x in rng.random(len(shape)) < 0.7)
    if max(shape) == 1:
        periodic = (False,) * len(shape)
    # The pressure that is about that of full contact.
    typical = material.E_star * float(np.ptp(gap) or h) / (h * max(shape) ** 0.5)
    arguments: dict[str, Any] = {}
    if rng.random() < 0.6:
        arguments["hardness"] = typical * log_uniform(rng, 1e-2, 1e1)
    if rng.random() < 0.5 or not np.ptp(gap):
        mean = min(typical * log_uniform(rng, 1e-3, 3.0), arguments.get("hardness", np.inf))
        # Exactly what all elements carry is a force too.
        arguments["force"] = mean * float(np.prod(element)) * float(np.prod(shape))
    else:
        arguments["approach"] = float(
            gap.min() + (gap.mean() - gap.min()) * min(log_uniform(rng, 1e-2, 2.0), EVERYWHERE)
        )
    try:
        result = normal_contact(
            gap, element, material=material, periodic=periodic, tolerance=TOLERANCE, **arguments
        )
    except ContactError as error:
        return Outcome("repeated", FAILED, f"{shape}, {periodic}: {error}")
    grid = Grid.of(shape, element, material, None, periodic)
    wrong = _error(result, grid, gap, arguments)
    return Outcome("repeated", FAILED if wrong else RIGHT, f"{shape}, {periodic}: {wrong}")


def _error(result: NormalResult, grid: Grid, gap: Array, arguments: dict[str, Any]) -> str:
    """Return what is wrong with 0 ≤ p ≤ H, w ≥ 0 below H, w ≤ 0 above zero, or nothing."""
    p, hardness = result.pressure, arguments.get("hardness", np.inf)
    u = (grid.normal().toarray() @ p.ravel()).reshape(p.shape)
    w, scale = u + gap - result.approach, result.approach - float(gap.min())
    slack = SLACK * TOLERANCE * scale + 1e-13 * np.abs(gap).max() + 1e-12 * np.abs(u).max()
    if not np.isfinite(p).all() or p.min() < 0.0 or p.max() > hardness:
        return f"pressures from {p.min():.1e} to {p.max():.1e}"
    penetration = -w[p < hardness].min(initial=0.0)
    if penetration > slack:
        return f"penetration {penetration / scale:.1e}"
    opening = w[p > 0.0].max(initial=0.0)
    if opening > slack:
        return f"gap in contact {opening / scale:.1e}"
    force = arguments.get("force", result.force)
    return "" if abs(result.force - force) <= 1e-8 * force else f"force {result.force / force:.9f}"
