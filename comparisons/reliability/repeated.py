"""Surfaces that repeat, and hardness: the pressures obey the conditions of contact."""

from typing import Any

import numpy as np
from numpy.random import Generator

from comparisons.harness.inside import Grid
from comparisons.reliability.bodies import TOLERANCE, pressure_error
from comparisons.reliability.trials import FAILED, RIGHT, Outcome
from comparisons.systems.random_matrices import log_uniform, random_grid
from toeplitz_mg.contact import ContactError, Material, normal_contact

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
    # Along one axis of two the matrix is no public function: by Fourier integrals.
    A = Grid.of(shape, element, material, None, periodic).normal().toarray()
    wrong = pressure_error(result, A, gap, arguments.get("hardness", np.inf))
    force = arguments.get("force", result.force)
    if not wrong and abs(result.force - force) > 1e-8 * force:
        wrong = f"force {result.force / force:.9f}"
    return Outcome("repeated", FAILED if wrong else RIGHT, f"{shape}, {periodic}: {wrong}")
