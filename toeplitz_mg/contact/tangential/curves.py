"""Forces over creepages: the curve that vehicle dynamics asks for."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from toeplitz_mg._typing import Array, Element
from toeplitz_mg.contact.result import TangentialResult
from toeplitz_mg.contact.tangential.motion import CREEPAGES
from toeplitz_mg.contact.tangential.rolling import rolling
from toeplitz_mg.values import field


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class CreepCurve:
    """Forces over creepages, a row for each point (see `creep_curve`).

    Attributes
    ----------
    creepages : ndarray of shape (points, 3) or (points,)
        Longitudinal, lateral, spin; in line contact that is rolled along x alone, longitudinal.
    force : ndarray of shape (points, 2) or (points,)
        N; in plane strain N per mm.
    moment : ndarray of shape (points,) or None
        About the pole, N mm; None in line contact.
    power : ndarray of shape (points,)
        What slip dissipates, over the speed of rolling, N.
    stick_share : ndarray of shape (points,)
        The part of the contact that sticks.
    products : ndarray of int, of shape (points,)

    See Also
    --------
    creep_curve : makes it.
    """

    creepages: Array
    force: Array
    moment: Array | None
    power: Array
    stick_share: Array
    products: Array

    def __repr__(self) -> str:
        """Return how many points there are, and the largest of their forces."""
        largest = np.linalg.norm(self.force.reshape(len(self.force), -1), axis=1).max()
        points, products = len(self.force), int(self.products.sum())
        return f"<CreepCurve of {points} points: forces up to {largest:.5g}; {products} products>"


def creep_curve(
    bound: ArrayLike,
    element: Element,
    *,
    material: Any,
    longitudinal: ArrayLike = 0.0,
    lateral: ArrayLike = 0.0,
    spin: ArrayLike = 0.0,
    **arguments: Any,
) -> CreepCurve:
    """Roll steadily with one creepage after the other: forces, moments, power.

    Parameters
    ----------
    bound, element, material
        The arguments of `rolling`.
    longitudinal, lateral, spin : array_like
        The creepages of each point, or one number for all points.
    **arguments
        More arguments of `rolling`: `slip`, `pole`, `falling`, `tolerance`, `max_products`.

    Returns
    -------
    CreepCurve

    Warns
    -----
    ContactWarning
        The warnings of `rolling`.

    Raises
    ------
    ValueError, TypeError, ContactError
        For what `rolling` refuses or does not solve, and for creepages that are no curve.

    See Also
    --------
    rolling : one point, with its tractions.

    Notes
    -----
    Each point starts from the tractions and the areas of the one before.

    Examples
    --------
    >>> import numpy as np
    >>> from toeplitz_mg.contact import Material, creep_curve
    >>> x = np.linspace(-0.975, 0.975, 40)
    >>> g = 0.3 * np.sqrt(1 - x**2)
    >>> creepages = -np.array([0.05, 0.1, 0.2, 0.4])
    >>> steel = Material.from_shear(1.0, 0.3)
    >>> curve = creep_curve(g, 0.05, material=steel, longitudinal=creepages)
    >>> (curve.force / (g.sum() * 0.05)).round(2)
    array([0.23, 0.42, 0.73, 1.  ])
    """
    points = _read_points(longitudinal, lateral, spin)

    def solve() -> Iterator[TangentialResult]:
        guess = None
        for point in points.tolist():
            creepages = dict(zip(CREEPAGES, point, strict=True))
            guess = rolling(
                bound, element, material=material, guess=guess, **creepages, **arguments
            )
            yield guess

    results = list(solve())
    moments = [result.moment for result in results]
    return CreepCurve(
        creepages=_stack([result.creepages for result in results]),
        force=_stack([result.force for result in results]),
        moment=None if moments[0] is None else np.array(moments),
        power=np.array([result.power for result in results]),
        stick_share=np.array([r.stick_area / r.area if r.area else 1.0 for r in results]),
        products=np.array([result.products for result in results]),
    )


def _stack(vectors: list[Any]) -> Array:
    """Return vectors as rows; in line contact those before anything is lateral are numbers."""
    rows = np.zeros((len(vectors), max(np.size(vector) for vector in vectors)))
    for row, vector in zip(rows, vectors, strict=True):
        row[: np.size(vector)] = vector
    return rows[:, 0] if rows.shape[1] == 1 else rows


def _read_points(*creepages: ArrayLike) -> Array:
    """Return the creepages of each point, shape (points, 3)."""
    given = [field(name, values) for name, values in zip(CREEPAGES, creepages, strict=True)]
    lengths = {len(values) for values in given if values.ndim == 1}
    if all(values.ndim == 0 for values in given):
        raise ValueError(
            "longitudinal, lateral and spin are numbers, but one at least must be an array, with a "
            "number for each point of the curve: of one point use rolling"
        )
    if any(values.ndim > 1 for values in given) or len(lengths) != 1 or lengths == {0}:
        shapes = ", ".join(
            f"{name} has shape {values.shape}"
            for name, values in zip(CREEPAGES, given, strict=True)
        )
        raise ValueError(f"{shapes}, but they must be numbers, and arrays (points,) of one length")
    return np.stack(np.broadcast_arrays(*given), axis=1)
