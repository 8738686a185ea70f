"""The matrices of a grid of elements for the stresses at a depth below it."""

from collections.abc import Iterator

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.halfspace.matrices import operator_of
from toeplitz_mg.halfspace.stress_integrals import (
    by_pressure,
    by_traction,
    exchange,
    line_by_lateral_traction,
    line_by_pressure,
    line_by_traction,
)
from toeplitz_mg.operators import ToeplitzOperator

# Whether the components xx, yy, zz, yz, xz, xy by a pressure are even (1) or odd (-1) in x and y.
PARITIES = ((1, 1), (1, 1), (1, 1), (1, -1), (-1, 1), (-1, -1))


def stress_matrices(
    direction: str, shape: tuple[int, ...], element: tuple[float, ...], depth: float, *, nu: float
) -> Iterator[ToeplitzOperator | None]:
    """Yield the matrices of the six components of stress, by tractions in one direction.

    Parameters
    ----------
    direction : str
        Of the tractions: x, y, or z for pressures.
    shape : (int, int) or (int,)
    element : (float, float) or (float,)
        One size is that of strips of infinite length.
    depth : float
        Below the surface.
    nu : float
        Poisson's ratio of the body.

    Yields
    ------
    ToeplitzOperator or None
        For xx, yy, zz, yz, xz and xy at the depth below the centres; None for what is zero.
    """
    quadrants = _quadrants(direction, shape, element, depth, nu)
    for c, parity in zip(quadrants, PARITIES, strict=True):
        sign = [-p if d == direction else p for p, d in zip(parity, "xy", strict=True)]
        yield operator_of(c.reshape(shape), tuple(sign), 0) if c.any() else None


def _quadrants(
    direction: str, shape: tuple[int, ...], element: tuple[float, ...], depth: float, nu: float
) -> Array:
    """Return the stresses at offsets that are not negative, of shape (6, n1, n2) or (6, n)."""
    z = np.array(depth)
    lines = [h * (np.arange(n + 1) - 0.5) for n, h in zip((*shape, 1), element, strict=False)]
    if len(element) == 1:
        if direction == "y":
            return line_by_lateral_traction(lines[0], z)
        return (line_by_pressure if direction == "z" else line_by_traction)(lines[0], z, nu)
    X, Y = lines[0][:, None], lines[1]
    Y = Y[None, :]
    if direction == "z":
        return by_pressure(X, Y, z, nu)
    return by_traction(X, Y, z, nu) if direction == "x" else exchange(by_traction(Y, X, z, nu))
