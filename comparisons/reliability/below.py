"""Stresses below the surface, against point loads (Boussinesq, Cerruti) that are integrated.

The tractions of an element are replaced by forces at Gauss's points, so that nothing is shared with
the closed forms of the package.
"""

import warnings
from typing import Any

import numpy as np
from numpy.random import Generator

from comparisons.reliability.trials import FAILED, RIGHT, Outcome
from comparisons.systems.random_matrices import log_uniform, random_grid
from toeplitz_mg._typing import Array
from toeplitz_mg.contact import (
    ContactWarning,
    Material,
    friction,
    normal_contact,
    subsurface_stresses,
)

MOST = 100  # Most elements.
POINTS = 10  # Gauss's points along each side of an element: exact to 1e-9 from a side's depth on.
ALLOWED = 1e-7  # Error that is allowed, over the largest stress.


def stresses_problem(rng: Generator) -> Outcome:
    """Press and shift two bodies, and compare the stresses below a few elements of one of them."""
    shape = random_grid(rng, int(log_uniform(rng, 1, MOST)), 2)
    h = log_uniform(rng, 1e-3, 10.0)
    element = h, h * log_uniform(rng, 0.3, 3.0)
    bodies = tuple(
        Material.from_shear(log_uniform(rng, 1e-1, 1e5), float(rng.uniform(0.0, 0.5)))
        for _ in range(2)
    )
    gap = h * log_uniform(rng, 1e-4, 1e-1) * rng.random(shape)
    force = bodies[0].G * float(np.ptp(gap) or h) * h * log_uniform(rng, 1e-1, 1e1)
    depths = max(element) * rng.uniform(1.0, 5.0, 2)
    body = str(rng.choice(["first", "second"]))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ContactWarning)
        pressed = normal_contact(gap, element, material=bodies, force=force)
        angle = rng.uniform(0.0, 2.0 * np.pi)
        along = 0.2 * force * np.array([np.cos(angle), np.sin(angle)])
        shifted = friction(pressed, mu=0.3, force=along)
    stresses = subsurface_stresses(pressed, shifted, depths=depths, body=body)
    is_second = body == "second"
    q = shifted.traction * (-1.0 if is_second else 1.0)
    places = rng.integers(0, shape, (3, 2))
    away, largest = 0.0, float(np.abs(stresses.components).max())
    for i, j in places.tolist():
        at = pressed.centres[0][i], pressed.centres[1][j]
        for k, depth in enumerate(depths.tolist()):
            expected = integrate(pressed, q, at, depth, bodies[is_second].nu)
            away = max(away, float(np.abs(stresses.components[:, k, i, j] - expected).max()))
    if away > ALLOWED * largest:
        return Outcome("stresses", FAILED, f"{shape}, {body}: {away / largest:.1e} of the largest")
    return Outcome("stresses", RIGHT)


def integrate(pressed: Any, q: Array, at: tuple[float, float], depth: float, nu: float) -> Array:
    """Return the six stresses at a point by the tractions on all elements."""
    nodes, weights = np.polynomial.legendre.leggauss(POINTS)
    (x, y), (h1, h2) = pressed.centres, pressed.element
    dx = at[0] - (x[:, None] + 0.5 * h1 * nodes)[:, None, :, None]
    dy = at[1] - (y[:, None] + 0.5 * h2 * nodes)[None, :, None, :]
    forces = np.stack([pressed.pressure, *q])[..., None, None] * (
        0.25 * h1 * h2 * np.outer(weights, weights)
    )
    by_x = by_tangential_force(dx, dy, depth, nu)
    # A force along y is one along x where the axes are exchanged.
    by_y = by_tangential_force(dy, dx, depth, nu)[[1, 0, 2, 4, 3, 5]]
    kernels = by_normal_force(dx, dy, depth, nu), by_x, by_y
    axes = (1, 2, 3, 4)
    total: Array = sum((k * f).sum(axis=axes) for k, f in zip(kernels, forces, strict=True))
    return total


def by_normal_force(x: Array, y: Array, z: float, nu: float) -> Array:
    """Return the stresses by a unit force into the body (Johnson, Eq. 3.18)."""
    x, y = np.broadcast_arrays(x, y)
    r2 = x**2 + y**2
    R = np.sqrt(r2 + z**2)
    c, near = 1.0 - 2.0 * nu, 1.0 / (R * (R + z))
    xx = c / r2 * (near * (x**2 - y**2) + z * y**2 / R**3) - 3.0 * z * x**2 / R**5
    yy = c / r2 * (near * (y**2 - x**2) + z * x**2 / R**3) - 3.0 * z * y**2 / R**5
    xy = c / r2 * (2.0 * near * x * y - x * y * z / R**3) - 3.0 * x * y * z / R**5
    zz, yz, xz = (-3.0 * z**2 * d / R**5 for d in (z, y, x))
    return np.stack([xx, yy, zz, yz, xz, xy]) / (2.0 * np.pi)


def by_tangential_force(x: Array, y: Array, z: float, nu: float) -> Array:
    """Return the stresses by a unit force along x (Johnson, Eq. 3.76)."""
    x, y = np.broadcast_arrays(x, y)
    R = np.sqrt(x**2 + y**2 + z**2)
    c, near = 1.0 - 2.0 * nu, 1.0 / (R * (R + z) ** 2)
    more = 1.0 / (R**3 * (R + z) ** 2) + 2.0 / (R**2 * (R + z) ** 3)
    xx = c * (x / R**3 - 3.0 * x * near + x**3 * more) - 3.0 * x**3 / R**5
    yy = c * (x / R**3 - x * near + x * y**2 * more) - 3.0 * x * y**2 / R**5
    xy = c * (-y * near + x**2 * y * more) - 3.0 * x**2 * y / R**5
    zz, yz, xz = (-3.0 * x * z * d / R**5 for d in (z, y, x))
    return np.stack([xx, yy, zz, yz, xz, xy]) / (2.0 * np.pi)
