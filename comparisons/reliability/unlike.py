"""Unlike materials: all conditions hold, with the displacements of the three directions."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.random import Generator

from comparisons.reliability.bodies import MOST
from comparisons.reliability.trials import Outcome, judge
from comparisons.systems.conditions import coulomb_residual
from comparisons.systems.random_matrices import log_uniform, random_grid
from toeplitz_mg import halfspace
from toeplitz_mg._typing import Array
from toeplitz_mg.contact import FrictionalResult, Material, frictional_contact

TOLERANCE = 1e-6
SLACK = 1.05  # Tolerances that a violation may have, for the rounding of another product.
STEPS = (0.6, 1.0, 0.8)  # Loads of the steps, over the largest.


@dataclass(frozen=True)
class Case:
    """Two bodies, what presses and shifts them, and the displacements by all tractions."""

    gap: Array
    element: tuple[float, float]
    bodies: tuple[Material, Material]
    mu: float
    force: float
    shift: Array
    A: Array  # Of shape (3 n1 n2, 3 n1 n2), by tractions along x and y, and pressures.

    @classmethod
    def of(cls, rng: Generator) -> "Case":
        """Draw a case."""
        shape = random_grid(rng, int(log_uniform(rng, 1, MOST)), 2)
        h = log_uniform(rng, 1e-3, 10.0)
        element = (h, h * log_uniform(rng, 0.2, 5.0))
        first, second = (
            Material.from_shear(log_uniform(rng, 1e-1, 1e6), float(rng.uniform(0.0, 0.5)))
            for _ in range(2)
        )
        bodies, mu = (first, second), log_uniform(rng, 1e-2, 1.0)
        i, j = np.indices(shape)
        height = h * log_uniform(rng, 1e-3, 1e-1)
        gap = height * ((i / shape[0] - 0.5) ** 2 + (j / shape[1] - 0.5) ** 2)
        gap += height * float(rng.choice([0.0, 0.1])) * rng.random(shape)
        area = float(np.prod(element)) * gap.size
        modulus = halfspace.combined_material(*bodies).E_star
        force = modulus * height * np.sqrt(area) * log_uniform(rng, 1e-2, 1.0)
        shift = height * log_uniform(rng, 1e-3, 1.0) * rng.standard_normal(2)
        A = halfspace.influence_matrix("xyz", shape, element, bodies).toarray()
        return cls(gap, element, bodies, mu, force, shift, A)

    def violations(self, result: FrictionalResult, last: Array) -> tuple[float, float]:
        """Return by how much the conditions across and along are violated, after some tractions."""
        t = tractions_of(result)
        a0, c0 = self.A[0, 0], self.A[-1, -1]
        u, before = ((self.A @ x.ravel()).reshape(x.shape) for x in (t, last))
        w = self.gap + u[2] - result.normal.approach
        interference = result.normal.approach - float(self.gap.min())
        gaps = np.abs(np.minimum(w, c0 * t[2])).max() / interference
        slip = u[:2] - before[:2] - self.shift[:, None, None]
        slips = coulomb_residual(t[:2], slip, self.mu * t[2], a0)
        return float(gaps), slips / max(float(np.abs(slip).max()), float(np.abs(u[:2]).max()))


def tractions_of(result: FrictionalResult) -> Array:
    """Return the tractions along x and y, and the pressures."""
    return np.stack([*result.tangential.traction, result.normal.pressure])


def unlike_problem(rng: Generator) -> Outcome:
    """Press two bodies, on and off, with a shift in each step; check by dense products."""
    case = Case.of(rng)
    return judge("unlike", case.gap.shape, lambda: in_steps(case))


def in_steps(case: Case) -> str:
    """Return what is wrong with a step, or nothing."""
    last, result = np.zeros((3, *case.gap.shape)), None
    options: Any = {"material": case.bodies, "mu": case.mu, "shift": case.shift}
    for load in STEPS:
        options |= {"force": load * case.force, "previous": result, "tolerance": TOLERANCE}
        result = frictional_contact(case.gap, case.element, **options)
        gaps, slips = case.violations(result, last)
        if not (result.normal.pressure >= 0.0).all() or max(gaps, slips) > SLACK * TOLERANCE:
            return f"gap {gaps:.1e}, slip {slips:.1e}"
        last = tractions_of(result)
    return ""
