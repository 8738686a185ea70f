"""Tables of rolling: forces over creepages, for vehicle dynamics, and Kalker's coefficients."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from toeplitz_mg._typing import Array, Element, Numbers
from toeplitz_mg.contact import doubts, surfaces
from toeplitz_mg.contact.grid import DENSE, Grid
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
from toeplitz_mg.contact.tangential.rolling import Rolled, roll, rolling
from toeplitz_mg.halfspace.materials import Bodies, Material, check_ratio
from toeplitz_mg.values import count, field, positive

ELEMENTS = 64  # Across Kalker's contact: with those of half as many, errors are some 0.3 %.
EXACT = 1e-6  # Tolerance of his coefficients: far below the error of the grid.
LEAST, MOST = 0.01, 100.0  # Ratios of the half-axes: beyond, a contact is a line.


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

    def plot(self, ax: Any = None, *, friction: float | None = None) -> Any:
        """Draw the forces over the creepage that varies, or over the first that does.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw, as beside other curves; by default on a new figure.
        friction : float, optional
            The force μ P, N; in plane strain N/mm. Then -F/(μ P) is drawn, as in the literature:
            upwards where the creepage is positive, as forces are against it, and 1 at most.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        ImportError
            Where matplotlib is not installed: ``pip install 'toeplitz-mg[plot]'``.
        """
        factor, drawn = 1.0, f"force [{self.units['force']}]"
        if friction is not None:
            factor, drawn = -1.0 / positive("friction", friction, self.units["force"]), "-F/(μ P)"
        ax = pictures.find_axes(ax)
        points = self.creepages.reshape(len(self.force), -1).T
        over = next((k for k, x in enumerate(points) if np.ptp(x) > 0.0), 0)
        for name, values in zip("xy", np.atleast_2d(self.force.T), strict=False):
            ax.plot(points[over], factor * values, "o-", label=f"along {name}")
        label = ("longitudinal creepage", "lateral creepage", "spin [1/mm]")[over]
        ax.set(xlabel=label, ylabel=drawn)
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
    pressed: NormalResult | None = None,
    element: Element | None = None,
    *,
    mu: Numbers | None = None,
    bound: Numbers | None = None,
    material: Bodies | None = None,
    longitudinal: ArrayLike = 0.0,
    lateral: ArrayLike = 0.0,
    spin: ArrayLike = 0.0,
    **arguments: Any,
) -> CreepCurve:
    """Roll steadily with one creepage after the other: forces, moments, power.

    Parameters
    ----------
    pressed, element, mu, bound, material
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
    >>> g = 0.03 * np.sqrt(1 - x**2)
    >>> creepages = -np.array([0.005, 0.01, 0.02, 0.04])
    >>> steel = Material.from_shear(1.0, 0.3)
    >>> curve = creep_curve(bound=g, element=0.05, material=steel, longitudinal=creepages)
    >>> (curve.force / (g.sum() * 0.05)).round(2)
    array([0.23, 0.42, 0.73, 1.  ])
    """
    points = _read_points(longitudinal, lateral, spin)
    bodies: dict[str, Any] = {"mu": mu, "bound": bound, "material": material}

    def solve() -> Iterator[TangentialResult]:
        guess = arguments.pop("guess", None)
        for point in points.tolist():
            creepages = dict(zip(CREEPAGES, point, strict=True))
            result = rolling(pressed, element, guess=guess, **bodies, **creepages, **arguments)
            yield result
            is_fine_line = result.contact.ndim == 1 and np.count_nonzero(result.contact) > DENSE
            guess = None if is_fine_line else result

    with doubts.gather_doubts() as found:
        results = list(solve())
    doubts.warn(found())
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
