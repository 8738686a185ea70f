"""Contact problems: the tractions obey the conditions of contact and Coulomb's law."""

import warnings
from typing import Any

import numpy as np
from numpy.random import Generator

from comparisons.harness.inside import Grid
from comparisons.reliability.trials import FAILED, RIGHT, TOLD, Outcome
from comparisons.systems.conditions import coulomb_residual
from comparisons.systems.random_matrices import log_uniform, random_grid
from toeplitz_mg import halfspace
from toeplitz_mg._typing import Array
from toeplitz_mg.contact import (
    ContactError,
    ContactWarning,
    Material,
    NormalResult,
    TangentialResult,
    friction,
    normal_contact,
    rolling,
    surfaces,
)

Sides = tuple[float, float]  # The sides of an element along x and y.

TOLERANCE = 1e-8
SLACK = 1.05  # Tolerances that a violation may have, for the rounding of another product.
MOST = 400  # Most elements: the products are dense.
MOST_REPEATED = 600  # Most elements: the products are dense.
EVERYWHERE = 0.999  # Share of the approach at which the bodies touch everywhere.


def contact_problem(rng: Generator) -> Outcome:
    """Try normal contact, then friction, or rolling, on one grid; check by dense products."""
    line = rng.random() < 0.3
    shape = random_grid(rng, int(log_uniform(rng, 1, MOST)), 1 if line else 2)
    h = log_uniform(rng, 1e-4, 10.0)
    element = (h, h * log_uniform(rng, 0.2, 5.0))
    material = Material.from_shear(log_uniform(rng, 1e-1, 1e6), float(rng.uniform(0.0, 0.5)))
    height = h * log_uniform(rng, 1e-4, 10.0)
    gap = _gap(rng, shape, element, height)
    load = _load(rng, gap, element, material)
    kind = "normal"
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        warnings.simplefilter("ignore", ContactWarning)  # Of random units and grids, as they are.
        try:
            result = normal_contact(gap, element, material=material, tolerance=TOLERANCE, **load)
            wrong = pressure_error(result, matrix("z", shape, element, material), gap)
            if not wrong and result.traction.any():
                kind = str(rng.choice(["friction", "rolling" if line else "friction", "normal"]))
            if kind != "normal":
                bound = log_uniform(rng, 1e-3, 3.0) * result.traction
                solve = _shift if kind == "friction" else _roll
                wrong = solve(rng, bound, result, element, material)
        except ContactError as error:
            wrong = str(error)
    return Outcome(kind, FAILED if wrong else TOLD if told else RIGHT, f"{shape}: {wrong}")


def repeated_problem(rng: Generator) -> Outcome:
    """Try a surface that repeats along some axes, with a hardness or without."""
    shape = random_grid(rng, int(log_uniform(rng, 2, MOST_REPEATED)), int(rng.integers(1, 3)))
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
    A, unit = Grid.of(shape, element, material, None, periodic).scaled_normal()
    wrong = pressure_error(result, unit * A.toarray(), gap, arguments.get("hardness", np.inf))
    force = arguments.get("force", result.force)
    if not wrong and abs(result.force - force) > 1e-8 * force:
        wrong = f"force {result.force / force:.9f}"
    return Outcome("repeated", FAILED if wrong else RIGHT, f"{shape}, {periodic}: {wrong}")


def _gap(rng: Generator, shape: tuple[int, ...], element: Sides, size: float) -> Array:
    kind = rng.integers(4)
    if kind == 0:
        return size * rng.random(shape)
    if kind == 1:
        return np.zeros(shape)
    line: Any = shape[0], element[0]
    points = surfaces.centres(*(line if len(shape) == 1 else (shape, element)))
    far = sum((x / (np.abs(x).max() or 1.0)) ** 2 for x in points)
    if kind == 2:
        return size * (far + np.zeros(shape))
    return size * (far + 0.3 * rng.random(shape))


def _load(rng: Generator, gap: Array, element: Sides, material: Material) -> dict[str, Any]:
    high = float(np.ptp(gap)) or element[0]
    depth = high * log_uniform(rng, 1e-3, 3.0)
    if rng.random() < 0.5:
        return {"approach": float(gap.min()) + depth}
    E_star = material.E_star / 2.0  # Of two equal bodies.
    width = element[0] * gap.shape[0]
    across = element[1] * gap.shape[1] if gap.ndim == 2 else 1.0
    return {"force": E_star * depth * (np.sqrt(width * across) if gap.ndim == 2 else 1.0)}


def matrix(directions: str, shape: tuple[int, ...], element: Any, material: Material) -> Array:
    """Return the influence of tractions on displacements, dense."""
    return halfspace.influence_matrix(directions, shape, element, material).toarray()


def pressure_error(result: NormalResult, A: Any, gap: Array, hardness: float = np.inf) -> str:
    """Return what is wrong with 0 ≤ p ≤ H, w ≥ 0 below H, w ≤ 0 above zero, or nothing."""
    p = result.pressure
    u = (A @ p.ravel()).reshape(p.shape)
    w, scale = u + gap - result.approach, result.approach - float(gap.min())
    if scale <= 0.0:
        return "pressed apart" if p.any() else ""
    # The rounding of heights that are large beside the interference.
    slack = SLACK * TOLERANCE * scale + 1e-13 * np.abs(gap).max() + 1e-12 * np.abs(u).max()
    if not np.isfinite(p).all() or p.min() < 0.0 or p.max() > hardness:
        return f"pressures from {p.min():.1e} to {p.max():.1e}"
    penetration = -w[p < hardness].min(initial=0.0)
    if penetration > slack:
        return f"penetration {penetration / scale:.1e}"
    opening = w[p > 0.0].max(initial=0.0)
    return f"gap in contact {opening / scale:.1e}" if opening > slack else ""


def _shift(
    rng: Generator, bound: Array, pressed: NormalResult, element: Sides, material: Material
) -> str:
    m = bound.ndim
    direction = rng.standard_normal(m)
    direction /= np.linalg.norm(direction)
    total = float(bound.sum() * np.prod(element))
    if rng.random() < 0.5:
        load: dict[str, Any] = {"force": direction * total * (1.0 - log_uniform(rng, 1e-6, 1.0))}
    else:
        largest = float(np.abs(pressed.displacement).max())
        load = {"shift": direction * largest * log_uniform(rng, 1e-4, 10.0)}
    if m == 1:
        load = {name: value[0] for name, value in load.items()}
    result = friction(bound=bound, element=element, material=material, tolerance=TOLERANCE, **load)
    A = matrix("xy"[:m], bound.shape, element, material)
    q = result.traction.reshape(m, *bound.shape)
    u = (A @ q.ravel()).reshape(q.shape)
    rigid = np.reshape(result.shift, (m, *(1,) * m))
    scale = max(float(np.abs(rigid).max()), float(np.abs(u).max()))
    if "force" in load:
        error = np.abs(q.reshape(m, -1).sum(axis=1) * np.prod(element) - load["force"]).max()
        if error > 1e-7 * total:
            return f"force off by {error / total:.1e} of the bound"
    return _coulomb_error(result, q, u - rigid, A[0, 0], np.sqrt(m) * SLACK * TOLERANCE * scale)


def _roll(
    rng: Generator, bound: Array, pressed: NormalResult, element: Sides, material: Material
) -> str:
    """Roll on a line: surfaces are in `rolling`."""
    size = float(pressed.traction.max()) / material.G * log_uniform(rng, 1e-3, 10.0)
    creepage = size * rng.standard_normal()
    options: Any = {"material": material, "tolerance": TOLERANCE, "longitudinal": creepage}
    result = rolling(bound=bound, element=element, **options)
    # The slip is the result's own: what it is made of is the subject of the tests.
    q, slip = result.traction[None], result.slip[None]
    a0 = matrix("x", (1,), element, material)[0, 0] / element[0]
    return _coulomb_error(result, q, slip, a0, SLACK * TOLERANCE * abs(creepage))


def _coulomb_error(result: TangentialResult, q: Array, slip: Array, a0: float, slack: float) -> str:
    """Return what is wrong with Coulomb's law, or nothing."""
    size = np.sqrt((q**2).sum(axis=0))
    if not np.isfinite(q).all() or (size > result.bound * (1.0 + 1e-12)).any():
        return "a traction above its bound"
    wrong = coulomb_residual(q, slip * result.contact, result.bound, a0)
    return f"slip wrong by {wrong:.1e}, {slack:.1e} allowed" if wrong > slack else ""
