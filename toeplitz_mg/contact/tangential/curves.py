"""Forces over creepages: the curve that vehicle dynamics asks for."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike

from toeplitz_mg._typing import Array, Element
from toeplitz_mg.contact.grid import DENSE
from toeplitz_mg.contact.results import NormalResult, TangentialResult, files, pictures
from toeplitz_mg.contact.results.base import (
    Figure,
    Result,
    Summary,
    describe_cost,
    list_figures,
    span,
)
from toeplitz_mg.contact.results.quantities import Quantity, name_units
from toeplitz_mg.contact.tangential.motion import CREEPAGES
from toeplitz_mg.contact.tangential.rolling import rolling
from toeplitz_mg.values import field


@files.loadable
@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class CreepCurve(Result):
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
    element : tuple of float
        The size of an element, which says whether forces are those of plane strain.

    See Also
    --------
    creep_curve : makes it.
    """

    creepages: Annotated[Array, Quantity("creepages", "points | points, 3", beyond="nan")]
    force: Annotated[Array, Quantity("force", "points | points, 2")]
    moment: Annotated[Array | None, Quantity("N mm", "points")]
    power: Annotated[Array, Quantity("loss", "points", label="power over speed")]
    stick_share: Annotated[Array, Quantity("1", "points")]
    products: Annotated[Array, Quantity("", "points", "i")]
    element: tuple[float, ...]

    def __repr__(self) -> str:
        """Return the creepages and the forces in one line."""
        few = ", ".join(f"{figure.name} {figure.text}" for figure in self._figures()[:2])
        return f"<CreepCurve {len(self.force)} points: {few}; {self._cost}>"

    @property
    def units(self) -> dict[str, str]:
        """The units of the attributes, by their names."""
        return name_units(self)

    def plot(self, ax: Any = None) -> Any:
        """Draw the forces over the creepage that varies, or over the first that does.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw, as beside other curves; by default on a new figure.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        ImportError
            Where matplotlib is not installed: ``pip install 'toeplitz-mg[plot]'``.
        """
        ax = pictures.find_axes(ax)
        points = self.creepages.reshape(len(self.force), -1).T
        over = next((k for k, x in enumerate(points) if np.ptp(x) > 0.0), 0)
        for name, values in zip("xy", np.atleast_2d(self.force.T), strict=False):
            ax.plot(points[over], values, "o-", label=f"along {name}")
        label = ("longitudinal creepage", "lateral creepage", "spin [1/mm]")[over]
        ax.set(xlabel=label, ylabel=f"force [{self.units['force']}]")
        ax.ticklabel_format(axis="x", scilimits=(-2, 3))
        ax.axhline(0.0, color="0.7", linewidth=0.8, zorder=0)
        ax.legend()
        return ax

    def _summary(self) -> Summary:
        title = f"Creep curve of {len(self.force)} points, from the first to the last"
        return Summary(title, self._figures(), self._cost)

    def _figures(self) -> list[Figure]:
        creepages, spin = self.creepages, None
        if creepages.ndim > 1:
            creepages, spin = creepages[:, :2], creepages[:, 2]
        figures = list_figures(
            self, Figure("creepages", creepages), "force",
            Figure("spin", spin if np.any(spin) else None, "1/mm"), "moment", "power",
            Figure("share that sticks", 100.0 * self.stick_share, "%"),
        )  # fmt: skip
        return [span(figure) for figure in figures]

    @property
    def _cost(self) -> str:
        return describe_cost(int(self.products.sum()))


def creep_curve(
    bound: ArrayLike | NormalResult,
    element: Element | None = None,
    *,
    mu: ArrayLike | None = None,
    material: Any = None,
    longitudinal: ArrayLike = 0.0,
    lateral: ArrayLike = 0.0,
    spin: ArrayLike = 0.0,
    **arguments: Any,
) -> CreepCurve:
    """Roll steadily with one creepage after the other: forces, moments, power.

    Parameters
    ----------
    bound, element, mu, material
        The arguments of `rolling`.
    longitudinal, lateral, spin : array_like
        The creepages of each point, or one number for all points.
    **arguments
        More arguments of `rolling`: `slip`, `pole`, `falling`, `tolerance`, `max_products`,
        `nested`, `options`, `progress`, a `force` or a `moment` that is the same for all points, in
        the place of a creepage, and a `guess` for the first point.

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
    Each point starts from the tractions and the areas of the one before; in line contact of many
    elements from coarser grids, which say better where it slides.

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
        guess = arguments.pop("guess", None)
        for point in points.tolist():
            creepages = dict(zip(CREEPAGES, point, strict=True))
            result = rolling(
                bound, element, mu=mu, material=material, guess=guess, **creepages, **arguments
            )
            yield result
            is_fine_line = result.contact.ndim == 1 and np.count_nonzero(result.contact) > DENSE
            guess = None if is_fine_line else result

    results = list(solve())
    moments = [result.moment for result in results]
    return CreepCurve(
        creepages=_stack([result.creepages for result in results]),
        force=_stack([result.force for result in results]),
        moment=None if moments[0] is None else np.array(moments),
        power=np.array([result.power for result in results]),
        stick_share=np.array([r.stick_area / r.area if r.area else 1.0 for r in results]),
        products=np.array([result.products for result in results]),
        element=results[0].element,
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
            "number for each point of the curve: of one point use rolling, and of several forces "
            "or moments rolling for each"
        )
    if lengths == {0}:
        raise ValueError("the arrays of creepages are empty, but a curve has one point at least")
    if any(values.ndim > 1 for values in given) or len(lengths) != 1:
        shapes = ", ".join(
            f"{name} has shape {values.shape}"
            for name, values in zip(CREEPAGES, given, strict=True)
        )
        raise ValueError(f"{shapes}, but they must be numbers, and arrays (points,) of one length")
    return np.stack(np.broadcast_arrays(*given), axis=1)
