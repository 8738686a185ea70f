"""Rolling by creepages, by forces, by some of each, by friction that falls: all conditions hold.

The influence of each element on each is evaluated by itself, where it is and one element further
along x: no matrix of the solver is part of the check.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.random import Generator

from comparisons.reliability.trials import Outcome, judge
from comparisons.systems.conditions import coulomb_residual
from comparisons.systems.random_matrices import log_uniform, random_grid
from toeplitz_mg import halfspace
from toeplitz_mg._typing import Array
from toeplitz_mg.contact import (
    Material,
    TangentialResult,
    rolling,
    rolling_steps,
    surfaces,
)

CREEPAGES = "longitudinal", "lateral", "spin"
TOLERANCE = 1e-8
EXACT = 0.1  # Of the tolerance: what the search lets displacements be off by.
SLACK = 1.05  # Tolerances that a violation may have, for the rounding of another product.
MOST = 200  # Most elements: the products are dense.
STEPS = 3  # Steps of rolling that are checked, each by itself.
GENTLE = 0.5  # Most that friction falls with the slip, over the stiffness of an element.


class Problem(NamedTuple):
    """Elements that roll, what each does to the others, and how they are asked to roll."""

    element: tuple[float, float]
    material: Material
    here: Array
    ahead: Array
    g: Array
    slip: Array
    pole: tuple[float, float]
    creepages: Array

    @property
    def arguments(self) -> dict[str, Any]:
        """Those of any function for rolling."""
        names = "element", "material", "slip", "pole"
        return {name: getattr(self, name) for name in names} | {"tolerance": TOLERANCE}

    @property
    def points(self) -> tuple[Array, Array]:
        """The middles of the elements, from the pole."""
        x, y = surfaces.centres(self.g.shape, self.element)
        return x - self.pole[0], y - self.pole[1]

    def rigid_slip(self, creepages: Array) -> Array:
        """Return the rigid slip over the distance rolled."""
        (x, y), (longitudinal, lateral, spin) = self.points, creepages
        turning = np.broadcast_arrays(longitudinal - spin * y, lateral + spin * x)
        return np.stack(turning) + self.slip

    def loads(self, q: Array) -> Array:
        """Return the forces and the moment of tractions: slip is half an element ahead of them."""
        x, y = self.points
        turning = (x - 0.5 * self.element[0]) * q[1] - y * q[0]
        return np.array([f.sum() for f in (*q, turning)]) * float(np.prod(self.element))


def rolling_problem(rng: Generator) -> Outcome:
    """Roll steadily or in steps, by any of creepages and loads; check by dense products."""
    # One element by itself, at the pole, has no moment.
    n1, n2 = (max(2, n) for n in random_grid(rng, int(log_uniform(rng, 4, MOST)), 2))
    shape = n1, n2
    h = log_uniform(rng, 1e-3, 10.0)
    element = h, h * log_uniform(rng, 0.3, 3.0)
    material = Material.from_shear(log_uniform(rng, 1e-1, 1e6), float(rng.uniform(0.0, 0.5)))
    g = _bound(rng, shape) * material.G * log_uniform(rng, 1e-4, 1e-1)
    size = float(g.max()) / material.G * log_uniform(rng, 1e-1, 10.0)
    slip = np.zeros((2, *shape))
    if rng.random() < 0.3:
        slip = 0.1 * size * rng.standard_normal(slip.shape)
    problem = Problem(
        element,
        material,
        influences(shape, element, material, 0.0),
        influences(shape, element, material, h),
        g,
        slip,
        (h, -2.0 * h) if rng.random() < 0.3 else (0.0, 0.0),
        size * rng.standard_normal(3) / [1.0, 1.0, h * max(shape)],
    )
    kind = str(rng.choice([*TRIALS]))
    return judge(kind, shape, lambda: TRIALS[kind](rng, problem))


def influences(
    shape: tuple[int, int], element: tuple[float, float], material: Material, ahead: float
) -> Array:
    """Return the displacements at x + ahead by unit tractions, of both components."""
    x, y = (np.ravel(c) for c in np.broadcast_arrays(*surfaces.centres(shape, element)))
    at = np.subtract.outer(x, x) + ahead, np.subtract.outer(y, y)
    xx, xy, yy = (
        f(*at, element, G=material.G, nu=material.nu)
        for f in (halfspace.influence_xx, halfspace.influence_xy, halfspace.influence_yy)
    )
    return np.block([[xx, xy], [xy, yy]])


def _bound(rng: Generator, shape: tuple[int, int]) -> Array:
    """Return a bound, at most 1: of an ellipse, or of spots."""
    if rng.random() < 0.5:
        x, y = (2.0 * (np.arange(n) + 0.5) / n - 1.0 for n in shape)
        return np.sqrt(np.maximum(0.0, 1.1 - x[:, None] ** 2 - y**2))
    return np.maximum(0.0, rng.random(shape) - rng.uniform(0.0, 0.5))


def by_creepage(rng: Generator, problem: Problem) -> str:
    """Roll steadily with all creepages given."""
    result = _roll(problem)
    return _error(problem, result, result.traction)


def by_loads(rng: Generator, problem: Problem) -> str:
    """Roll steadily with some loads in the place of creepages, that some creepages have."""
    carried = 0.9 * problem.loads(_roll(problem).traction)
    given = rng.random(3) < 0.6
    Fx, Fy, moment = (float(F) if by else None for F, by in zip(carried, given, strict=True))
    result = _roll(problem, given, force=(Fx, Fy), moment=moment)
    most = problem.g.sum() * float(np.prod(problem.element))
    arm = problem.element[0] + max(float(np.abs(r).max()) for r in problem.points)
    away = np.abs(problem.loads(result.traction) - carried)[given] / np.array([1, 1, arm])[given]
    if away.max(initial=0.0) > 1e-7 * most:
        return f"loads off by {away.max() / most:.1e} of the bound"
    return _error(problem, result, result.traction)


def by_falling_friction(rng: Generator, problem: Problem) -> str:
    """Roll steadily with friction that falls, gently beside the stiffness of an element."""
    stiffness = problem.element[0] / float((problem.here - problem.ahead)[0, 0])
    share = rng.uniform(0.1, 0.9)
    scale = share * float(problem.g.max()) / (GENTLE * stiffness * rng.random()) or 1.0

    def falling(slip: Array) -> Array:
        return 1.0 - share + share / (1.0 + slip / scale)

    result = _roll(problem, falling=falling)
    bound = problem.g * falling(np.hypot(*result.slip))
    away = np.abs(result.bound - bound).max() / (problem.g.max() or 1.0)
    return f"bound off by {away:.1e}" if away > 1e-7 else _error(problem, result, result.traction)


def in_steps(rng: Generator, problem: Problem) -> str:
    """Roll some steps, with some forces in the place of creepages."""
    most = 0.5 * problem.g.sum() * float(np.prod(problem.element))
    given = np.append(rng.random(2) < 0.5, False)
    direction = rng.standard_normal(2)
    force = most * direction / np.linalg.norm(direction)
    Fx, Fy = (float(F) if by else None for F, by in zip(force, given, strict=False))
    arguments = problem.arguments | _creepages(problem, given) | {"steps": STEPS}
    before = np.zeros((2, *problem.g.shape))
    for result in rolling_steps(bound=problem.g, force=(Fx, Fy), **arguments):
        away = np.abs(result.force - force)[given[:2]].max(initial=0.0)
        if away > 1e-7 * most:
            return f"force off by {away / most:.1e} of the bound"
        if wrong := _error(problem, result, before):
            return wrong
        before = result.traction
    return ""


def _roll(problem: Problem, by_load: Any = (False,) * 3, **more: Any) -> TangentialResult:
    return rolling(bound=problem.g, **problem.arguments, **_creepages(problem, by_load), **more)


def _creepages(problem: Problem, by_load: Any) -> dict[str, Any]:
    """Return the creepages that are given, as arguments."""
    return {
        name: 0.0 if by else float(value)
        for name, value, by in zip(CREEPAGES, problem.creepages, by_load, strict=True)
    }


def _error(problem: Problem, result: TangentialResult, before: Array) -> str:
    """Return what is wrong with Coulomb's law, after these tractions, or nothing."""
    q, h = result.traction, problem.element[0]
    if not np.isfinite(q).all() or (np.hypot(*q) > result.bound * (1.0 + 1e-12)).any():
        return "a traction above its bound"
    u, ahead = (
        (A @ x.ravel()).reshape(q.shape) for A, x in ((problem.here, q), (problem.ahead, before))
    )
    rigid = problem.rigid_slip(result.creepages) * result.contact
    slip = (rigid + (u - ahead) / h) * result.contact
    off = EXACT * TOLERANCE * np.abs(rigid).max() + 1e-10 * np.abs(u).max() / h + 1e-12
    if (away := np.abs(slip - result.slip).max()) > off:
        return f"slip off by {away:.1e}"
    scale = np.hypot(*rigid).max()
    if before is not q:  # A step is measured by what would be without slip.
        scale = max(scale, np.hypot(*((rigid - ahead / h) * result.contact)).max())
    a0 = float(problem.here[0, 0]) / h
    wrong, allowed = coulomb_residual(q, slip, result.bound, a0), SLACK * TOLERANCE * scale
    return f"slip wrong by {wrong:.1e}, {allowed:.1e} allowed" if wrong > allowed else ""


TRIALS: dict[str, Callable[[Generator, Problem], str]] = {
    "rolling by creepage": by_creepage,
    "rolling by loads": by_loads,
    "rolling, falling friction": by_falling_friction,
    "rolling in steps": in_steps,
}
