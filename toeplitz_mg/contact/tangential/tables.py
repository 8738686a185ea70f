"""Tables for vehicle dynamics: forces over creepages, and Kalker's coefficients."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from toeplitz_mg._typing import Array, Element, Numbers
from toeplitz_mg.contact import doubts, surfaces
from toeplitz_mg.contact.curves import Curve
from toeplitz_mg.contact.grid import DENSE, Grid
from toeplitz_mg.contact.results import NormalResult, TangentialResult, files
from toeplitz_mg.contact.results.base import Figure, Summary
from toeplitz_mg.contact.results.consistency import Rule
from toeplitz_mg.contact.results.quantities import CREEPAGES, Quantity, require_whole
from toeplitz_mg.contact.tangential.rolling import Rolled, roll, rolling
from toeplitz_mg.halfspace.materials import Bodies, Material, check_ratio
from toeplitz_mg.values import count, field, positive

ELEMENTS = 64  # Across Kalker's contact: extrapolated from 32 and 64, errors are some 0.3 %.
EXACT = 1e-6  # Tolerance for the coefficients: far below the error of the grid.
# Least share of its ellipse that an elliptic contact fills: an ellipse along x or y fills 1 and a
# rectangle 0.95, but a triangle 0.83, and an oblique ellipse with half-axes 2 to 1 fills 0.8.
FULL = 0.9
LEAST, MOST = 0.01, 100.0  # Limits for the ratio of the half-axes; beyond, it is a line contact.


@files.loadable
@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class CreepCurve(Curve):
    """Forces for a sequence of creepages, one row per point (see `creep_curve`).

    Attributes
    ----------
    creepages : ndarray of shape (points, 3) or (points,)
        Longitudinal, lateral, spin; in line contact rolled along x only, the longitudinal one.
    force : ndarray of shape (points, 2) or (points,)
        N; in plane strain N per mm.
    moment : ndarray of shape (points,) or None
        About the pole, N mm; None in line contact.
    power : ndarray of shape (points,)
        Dissipated power divided by the rolling speed, N.
    stick_share : ndarray of shape (points,)
        Share of the contact that sticks.
    products : ndarray of int, of shape (points,)
    element : tuple of float
        Size of an element; one number means plane strain.

    See Also
    --------
    creep_curve : returns it.
    """

    creepages: Annotated[Array, Quantity("creepages", "points | points, 3", beyond="nan")]
    force: Annotated[Array, Quantity("force", "points | points, 2")]
    moment: Annotated[Array | None, Quantity("N mm", "points")]
    power: Annotated[Array, Quantity("loss", "points", beyond="nan", label="power over speed")]
    stick_share: Annotated[Array, Quantity("1", "points")]
    products: Annotated[Array, Quantity("", "points", "i")]
    element: tuple[float, ...]

    _title: ClassVar[str] = "Creep curve"

    @property
    def _sizes(self) -> dict[str, tuple[int, ...]]:
        return {"points": self.power.shape[:1]}

    def _rules(self) -> Iterator[Rule]:
        sizes = self.element
        yield Rule("element", len(sizes) in (1, 2) and min(sizes) > 0.0, "one or two, positive")
        along = self.creepages.ndim == 1
        is_line = along or len(sizes) == 1
        yield Rule("moment", self.moment is None or not is_line, "that of an area")
        yield Rule("force", (self.force.ndim == 1) == along, "of as many components as creepages")
        unknown = np.isnan(self.creepages.reshape(len(self.power), -1)).any(axis=1)
        known = np.array_equal(np.isnan(self.power), unknown)
        yield Rule("power", known, "nan where a creepage is, and finite elsewhere")
        share = self.stick_share
        yield Rule("stick_share", bool(((share >= 0.0) & (share <= 1.0)).all()), "0 to 1")


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
    """Roll steadily with a sequence of creepages: find forces, moments and power.

    Parameters
    ----------
    pressed, element, mu, bound, material
        As for `rolling`.
    longitudinal, lateral, spin : array_like
        The creepages of the points; a single number applies to all points.
    **arguments
        More arguments of `rolling`: `slip`, `pole`, `falling`, `tolerance`, `max_products`,
        `nested`, `options`, `progress`; a `force` or `moment` for all points, instead of a
        creepage; and a `guess` for the first point.

    Returns
    -------
    CreepCurve

    Warns
    -----
    ContactWarning
        As for `rolling`.

    Raises
    ------
    ValueError, TypeError, ContactError
        If `rolling` raises it, or if the creepages do not form a curve.

    See Also
    --------
    rolling : a single point, with its tractions.

    Notes
    -----
    Each point starts from the tractions and the areas of the previous one. In line contact with
    many elements it starts from coarser grids, which predict the area of slip better.

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
    """Return vectors as rows; numbers come from line contact without lateral forces."""
    rows = np.zeros((len(vectors), max(np.size(vector) for vector in vectors)))
    for row, vector in zip(rows, vectors, strict=True):
        row[: np.size(vector)] = vector
    return rows[:, 0] if rows.shape[1] == 1 else rows


def _read_points(*creepages: ArrayLike) -> Array:
    """Return the creepages of the points, of shape (points, 3)."""
    given = [field(name, values) for name, values in zip(CREEPAGES, creepages, strict=True)]
    lengths = {len(values) for values in given if values.ndim == 1}
    if all(values.ndim == 0 for values in given):
        raise ValueError(
            "longitudinal, lateral and spin are numbers, but at least one must be an array with a "
            "number for each point of the curve: for one point, or one force after the other, "
            "call rolling"
        )
    if lengths == {0}:
        raise ValueError("the arrays of creepages are empty, but a curve needs a point")
    if any(values.ndim > 1 for values in given) or len(lengths) != 1:
        shapes = ", ".join(
            f"{name} has shape {values.shape}"
            for name, values in zip(CREEPAGES, given, strict=True)
        )
        raise ValueError(f"{shapes}, but must be numbers, or arrays (points,) of the same length")
    return np.stack(np.broadcast_arrays(*given), axis=1)


class KalkerCoefficients(NamedTuple):
    """Coefficients of the linear theory of rolling, with c = √(a b) (see `kalker_coefficients`).

    Fx = -G c² C11 ξ,  Fy = -G c² (C22 η + c C23 φ),  M = G c³ (C23 η - c C33 φ).

    Attributes
    ----------
    C11, C22, C23, C33 : float

    See Also
    --------
    kalker_coefficients : returns them.
    """

    C11: float
    C22: float
    C23: float
    C33: float

    def _repr_html_(self) -> str:
        figures = [Figure(name, value) for name, value in self._asdict().items()]
        return Summary("Kalker's coefficients", figures).tabulate()


def kalker_coefficients(
    ratio: float | NormalResult, nu: float | None = None, *, n: int = ELEMENTS
) -> KalkerCoefficients:
    """Return Kalker's creepage coefficients of an elliptic contact, from tractions without slip.

    Parameters
    ----------
    ratio : float or NormalResult
        Half-axis in the direction of rolling over the one across, a/b: 0.01 to 100. For a result of
        `normal_contact`, the ellipse is the one whose second moments of area along x and y are
        those of the elements in contact, ∫ x² dA = a²/4 ∫ dA, and c = √(area/π).
    nu : float, optional
        Poisson's ratio of both bodies; for a result, that of its material.
    n : int
        Number of elements along each axis of the contact: even, at least 8.

    Returns
    -------
    KalkerCoefficients
        With 64 elements they agree within 1.5 % with Kalker's tables for a/b = 0.1 to 10, which
        have three digits.

    Raises
    ------
    ValueError, TypeError
        If the ratio, Poisson's ratio or number of elements is out of range. For a result, if the
        contact is a line, empty, more than one patch, or fills less than 0.9 of its ellipse, for
        example because the ellipse is oblique.

    See Also
    --------
    rolling : for any creepage.

    Notes
    -----
    In bodies that stick everywhere, the forces are proportional to the creepages. They are computed
    on grids with n/2 and n elements, in units of c of the elements in contact, and extrapolated,
    since the error is proportional to 1/n.

    References
    ----------
    J. J. Kalker, Three-Dimensional Elastic Bodies in Rolling Contact (1990).

    Examples
    --------
    >>> from toeplitz_mg.contact import kalker_coefficients
    >>> [round(C, 2) for C in kalker_coefficients(1.0, 0.25)]  # Kalker: 4.12, 3.67, 1.47, 1.19
    [4.11, 3.67, 1.47, 1.18]
    """
    if isinstance(ratio, NormalResult):
        if nu is not None:
            raise ValueError(f"nu is {nu}, but the normal result has it: leave it out")
        nu, ratio = ratio.material.nu, _measure_ratio(ratio)
    elif nu is None:
        raise TypeError("nu is not given, but must be, unless a normal result is")
    if not LEAST <= positive("ratio", ratio) <= MOST:
        raise ValueError(f"ratio is {ratio}, but must be {LEAST:g} to {MOST:g}")
    material = Material.from_shear(1.0, check_ratio(nu))
    if count("n", n, 8) % 2:
        raise ValueError(f"n is {n}, but must be even")
    coarse, fine = (_compute(ratio, material, k) for k in (n // 2, n))
    return KalkerCoefficients(*(2.0 * fine - coarse).tolist())


def _measure_ratio(pressed: NormalResult) -> float:
    """Return a/b of the ellipse with the second moments of the one patch in contact."""
    from scipy.ndimage import label  # Slow to import.

    require_whole(pressed, "the normal result")
    if pressed.contact.ndim == 1:
        raise ValueError(f"the contact has shape {pressed.shape}, a line, but must be an ellipse")
    _, patches = label(pressed.contact, np.ones((3, 3)))
    if patches != 1:
        raise ValueError(f"the contact has {patches} patches, but must have one")
    places = zip(np.nonzero(pressed.contact), pressed.element, strict=True)
    # An element adds its own moment, h²/12.
    a, b = (2.0 * float(h * np.sqrt(np.var(k) + 1.0 / 12.0)) for k, h in places)
    if (share := pressed.area / (np.pi * a * b)) < FULL:
        raise ValueError(
            f"the contact fills only {share:.2g} of the ellipse that has its second moments, so "
            f"that it is no ellipse (at least {FULL}): give the ratio a/b of a similar one"
        )
    return a / b


def _compute(ratio: float, material: Material, n: int) -> Array:
    """Return the coefficients on n × n elements, for G = 1."""
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
