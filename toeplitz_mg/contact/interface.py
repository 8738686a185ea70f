"""Stiffness of the interface between rough surfaces, per nominal area."""

from typing import Any

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.contact import doubts
from toeplitz_mg.contact.checks import require_pressed
from toeplitz_mg.contact.grid import Grid
from toeplitz_mg.contact.normal.problem import find_stiffness
from toeplitz_mg.contact.results import NormalResult
from toeplitz_mg.contact.results.quantities import require_whole
from toeplitz_mg.contact.tangential.friction import friction


def interfacial_stiffness(pressed: NormalResult) -> tuple[float, float, float]:
    """Return the normal and tangential stiffness of an interface, per nominal area.

    Parameters
    ----------
    pressed : NormalResult
        A result of `normal_contact`. The nominal area is that of all elements with material.

    Returns
    -------
    (float, float, float)
        Normal stiffness k under increasing load (so that yielding elements carry no more), and
        tangential stiffnesses along x and y for bodies that stick, N/mm³. Zero without contact,
        infinite if the bodies touch everywhere.

    See Also
    --------
    NormalResult : its `stiffness` dF/dδ includes that of the bodies.

    Notes
    -----
    The interface is in series with the bodies: 1/k is the nominal area times 1/K - 1/K₁, where K is
    the stiffness of the elements in contact, and K₁ that of bodies that touch everywhere. If the
    surface repeats along all axes, 1/K₁ is zero, and k = dp̄/dδ.

    For isotropic surfaces, both tangential stiffnesses are 2 (1-ν)/(2-ν) times the normal one,
    Mindlin's ratio for a circle (C. Campañá, B. N. J. Persson, M. H. Müser, J. Phys.: Condens.
    Matter 23, 085001, 2011). As in `friction`, the coupling of unlike materials is neglected.

    Examples
    --------
    >>> from toeplitz_mg import contact
    >>> steel, element = contact.Material(E=210000.0, nu=0.3), (0.001, 0.001)  # N/mm², mm
    >>> gap = contact.surfaces.rough((128, 128), element, rms=1e-4, longest=0.03, shortest=0.01)
    >>> pressed = contact.normal_contact(gap, element, material=steel, pressure=60.0, periodic=True)
    >>> k, kx, ky = contact.interfacial_stiffness(pressed)
    >>> f"{(kx + ky) / 2 / k:.2f}, and by Mindlin {2 * 0.7 / 1.7:.2f}"
    '0.83, and by Mindlin 0.82'
    """
    require_pressed(pressed)
    require_whole(pressed, "the normal result")
    repeats = pressed.periodic or False
    grid = Grid.of(pressed.shape, pressed.element, pressed.material, None, repeats)

    def hold(C: Array, axis: int) -> float:
        """Return the force per unit shift along an axis, for elements that stick."""
        if grid.has_free_mean and C.all():
            return np.inf
        case: Any = {"element": grid.element, "material": grid.material, "periodic": repeats}
        with doubts.gather_doubts():
            held = friction(bound=np.where(C, np.inf, 0.0), shift=np.eye(2)[axis], **case)
        return float(held.force[axis])

    C, nominal = pressed.contact, np.isfinite(pressed.gap)
    bears = C if pressed.plastic is None else C & (pressed.plastic == 0.0)
    pairs = [(find_stiffness(grid, bears), find_stiffness(grid, nominal))]
    pairs += [(hold(C, axis), hold(nominal, axis)) for axis in range(2)]
    # Compliances of the interface per area, 1/k; rounding may make the differences negative.
    area = grid.area * np.count_nonzero(nominal)
    softness = [area * max(1.0 / K - 1.0 / whole, 0.0) if K else np.inf for K, whole in pairs]
    k, kx, ky = (float(1.0 / x) if x else np.inf for x in softness)
    return k, kx, ky
