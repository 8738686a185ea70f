"""Stresses below contacts with a known answer, pressed or sliding, and how far a solution is off.

Johnson, Contact Mechanics, §4.2, §4.3 and §7.1: the half width is A and the largest pressure p₀,
as in `solved`; x, z are over A, and stresses over p₀. Tension is positive.
"""

from typing import Any

import numpy as np
from scipy.integrate import quad

from comparisons.theory.solved import MU, UNIT, A, Solved
from toeplitz_mg._typing import Array
from toeplitz_mg.contact import Stresses, friction, normal_contact, subsurface_stresses, surfaces

DEPTHS = np.array([0.1, 0.25, 0.48, 0.786, 1.5])  # At which stresses are compared, over A.


def line_stresses(x: Array, z: Array, mu: float) -> tuple[Array, Array, Array]:
    """Return σxx, σzz and σxz below a cylinder that slides towards positive x (McEwen)."""
    d = 1.0 - x**2 + z**2
    root = np.sqrt(d**2 + 4.0 * x**2 * z**2)
    m, n = np.sqrt((root + d) / 2.0), np.sign(x) * np.sqrt(np.maximum(0.0, root - d) / 2.0)
    part = (z**2 + n**2) / (m**2 + n**2)
    xx, zz = 2.0 * z - m * (1.0 + part), -m * (1.0 - part)
    xz = -n * (m**2 - z**2) / (m**2 + n**2)
    by_traction = n * (2.0 - (z**2 - m**2) / (m**2 + n**2)) - 2.0 * x
    return xx + mu * by_traction, zz + mu * xz, xz + mu * xx


def sphere_stresses(z: Array, mu: float, nu: float) -> tuple[Array, Array, Array]:
    """Return σxx, σzz and σxz on the axis below a sphere that slides towards positive x."""
    zz = -1.0 / (1.0 + z**2)
    xx = -(1.0 + nu) * (1.0 - z * np.arctan(1.0 / z)) - 0.5 * zz

    def xz(z: float) -> float:
        def of_ring(r: float) -> float:
            return float(np.sqrt(1.0 - r**2) * r**3 / (r**2 + z**2) ** 2.5)

        return -1.5 * z * float(quad(of_ring, 0.0, 1.0, epsabs=1e-12, limit=200)[0])

    return xx, zz, mu * np.array([xz(depth) for depth in z.tolist()])


def sliding_line(N: int) -> Solved:
    """A cylinder in plane strain that slides, μ = 0.3."""
    h, p0 = 2.0 / N, A / 2.0
    gap = surfaces.cylinder(N, h, radius=1.0)
    pressed = normal_contact(gap, h, material=UNIT, force=np.pi * A**2 / 4.0)
    slid = friction(pressed, mu=MU, force=MU * pressed.force)
    stresses = subsurface_stresses(pressed, slid, depths=DEPTHS * A)
    xx, zz, xz = line_stresses(pressed.x[None] / A, DEPTHS[:, None], MU)
    shear = np.hypot((xx - zz) / 2.0, xz)
    # Across the plane is a mean principal stress: the largest difference is in it.
    errors = _errors(stresses, (xx, zz, xz), p0)
    errors["τ"] = float(np.abs(stresses.max_shear.max() / p0 / shear.max() - 1.0))
    return Solved([pressed, slid], errors, gap=gap, bound=MU * pressed.pressure)


def sliding_sphere(N: int) -> Solved:
    """A sphere that slides, μ = 0.3: on its axis, below an element in the middle."""
    n = N + 1 - N % 2
    h, p0 = 2.0 / n, 2.0 * A / np.pi
    gap = surfaces.sphere((n, n), (h, h), radius=1.0)
    pressed = normal_contact(gap, (h, h), material=UNIT, force=4.0 / 3.0 * A**3)
    slid = friction(pressed, mu=MU, force=(MU * pressed.force, 0.0))
    stresses = subsurface_stresses(pressed, slid, depths=DEPTHS * A)
    middle = (slice(None), n // 2, n // 2)
    xx, zz, xz = sphere_stresses(DEPTHS, MU, UNIT.nu)
    errors = _errors(stresses, (xx, zz, xz), p0, middle)
    # By the sphere alone σyy is σxx, and by the traction it is zero on the axis, as σxx is.
    shear = np.hypot((xx - zz) / 2.0, xz)
    own = stresses.max_shear[middle] / p0
    errors["τ"] = float(np.abs(own[2] / shear[2] - 1.0))
    return Solved([pressed, slid], errors, gap=gap, bound=MU * pressed.pressure)


def _errors(
    stresses: Stresses, theory: tuple[Array, ...], p0: float, where: Any = ...
) -> dict[str, float]:
    """Return the root mean squares of the errors of σxx, σzz and σxz, over p₀."""
    own = stresses.xx, stresses.zz, stresses.xz
    return {
        name: float(np.sqrt(np.mean((component[where] / p0 - expected) ** 2)))
        for name, component, expected in zip(("σxx", "σzz", "σxz"), own, theory, strict=True)
    }
