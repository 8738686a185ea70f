"""Kalker's coefficients: the forces of small creepages, without slip."""

from typing import Any, NamedTuple

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.contact import surfaces
from toeplitz_mg.contact.grid import Grid
from toeplitz_mg.contact.results.base import Figure, Summary
from toeplitz_mg.contact.tangential.rolling import Rolled, roll
from toeplitz_mg.halfspace.materials import Material, check_ratio
from toeplitz_mg.values import count, positive

ELEMENTS = 64  # Across the contact: with those of half as many, errors are some 0.3 %.
EXACT = 1e-6  # Tolerance: far below the error of the grid.
LEAST, MOST = 0.01, 100.0  # Ratios of the half-axes: beyond, a contact is a line.


class KalkerCoefficients(NamedTuple):
    """Coefficients of the linear theory of rolling, with c = √(a b) (see `kalker_coefficients`).

    Fx = -G c² C11 ξ,  Fy = -G c² (C22 η + c C23 φ),  M = G c³ (C23 η - c C33 φ).

    Attributes
    ----------
    C11, C22, C23, C33 : float

    See Also
    --------
    kalker_coefficients : finds them.
    """

    C11: float
    C22: float
    C23: float
    C33: float

    def _repr_html_(self) -> str:
        figures = [Figure(name, value) for name, value in self._asdict().items()]
        return Summary("Kalker's coefficients", figures).tabulate()


def kalker_coefficients(ratio: float, nu: float, *, n: int = ELEMENTS) -> KalkerCoefficients:
    """Return Kalker's coefficients of an elliptic contact, from the tractions without slip.

    Parameters
    ----------
    ratio : float
        a/b, the half-axis along the direction of rolling over the one across: 0.01 to 100.
    nu : float
        Poisson's ratio of both bodies.
    n : int
        Elements along each axis of the contact: even, at least 8.

    Returns
    -------
    KalkerCoefficients
        With 64 elements they are within 1.5 % of Kalker's tables for a/b = 0.1 to 10, which have
        three digits.

    Raises
    ------
    ValueError, TypeError
        For a ratio, a Poisson's ratio or a number of elements that there is none of.

    See Also
    --------
    rolling : at any creepage.

    Notes
    -----
    Bodies that nowhere slide on each other have forces in proportion to the creepages. They are
    computed for n/2 and n elements, in units of the c of the elements in contact, and extrapolated,
    as the error is in proportion to 1/n.

    References
    ----------
    J. J. Kalker, Three-Dimensional Elastic Bodies in Rolling Contact (1990).

    Examples
    --------
    >>> from toeplitz_mg.contact import kalker_coefficients
    >>> [round(C, 2) for C in kalker_coefficients(1.0, 0.25)]  # Kalker: 4.12, 3.67, 1.47, 1.19
    [4.11, 3.67, 1.47, 1.18]
    """
    if not LEAST <= positive("ratio", ratio) <= MOST:
        raise ValueError(f"ratio is {ratio}, but must be {LEAST:g} to {MOST:g}")
    material = Material.from_shear(1.0, check_ratio(nu))
    if count("n", n, 8) % 2:
        raise ValueError(f"n is {n}, but must be even")
    coarse, fine = (_compute(ratio, material, k) for k in (n // 2, n))
    return KalkerCoefficients(*(2.0 * fine - coarse).tolist())


def _compute(ratio: float, material: Material, n: int) -> Array:
    """Return the coefficients on n × n elements, of G = 1."""
    a, b = ratio**0.5, ratio**-0.5
    element = 2.0 * a / n, 2.0 * b / n
    x, y = surfaces.centres((n, n), element)
    g = np.where((x / a) ** 2 + (y / b) ** 2 < 1.0, np.inf, 0.0)
    grid = Grid.of((n, n), element, material, None)

    def bonded(creepages: tuple[float, float, float]) -> Any:
        asked = Rolled.of(grid.shape, (creepages,), EXACT, True, 2000, None, None)
        return roll(grid, g, asked, None)

    along, across, spinning = (bonded((k == 0, k == 1, k == 2)) for k in range(3))
    c = np.sqrt(along.area / np.pi)
    return np.array(
        [
            -along.force[0] / c**2,
            -across.force[1] / c**2,
            -spinning.force[1] / c**3,
            -spinning.moment / c**4,
        ]
    )
