"""Stresses below the surface of two bodies in contact, computed from the tractions."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike

from toeplitz_mg._typing import Array
from toeplitz_mg.contact import doubts
from toeplitz_mg.contact.results import (
    ContactResult,
    FrictionalResult,
    NormalResult,
    TangentialResult,
    files,
    pictures,
)
from toeplitz_mg.contact.results.base import Figure, Result, Summary, span
from toeplitz_mg.contact.results.consistency import Rule, check_centres
from toeplitz_mg.contact.results.quantities import (
    Quantity,
    name_units,
    require_whole,
)
from toeplitz_mg.engine.threads import elementwise
from toeplitz_mg.halfspace import CombinedMaterial
from toeplitz_mg.halfspace.stresses import stress_matrices
from toeplitz_mg.operators import apply_to_rows
from toeplitz_mg.values import field

BODIES = ("first", "second")
COMPONENTS = ("xx", "yy", "zz", "yz", "xz", "xy")
# The stresses that `plot` draws, and their labels.
SHOWN = {"von_mises": "von Mises", "max_shear": "largest shear"} | {c: c for c in COMPONENTS}


def _component(k: int, doc: str) -> property:
    """Return a property for one of the components."""
    return property(lambda stresses: stresses.components[k], doc=doc)


@files.loadable
@dataclass(frozen=True, eq=False, repr=False)
class Stresses(Result):
    """Stresses in one body, at given depths below the elements of a grid.

    z is the depth in this body; x and y are along the surface. Tension is positive. Fields have the
    depths on the first axis, followed by the shape of the grid.

    Attributes
    ----------
    body : str
        "first" or "second".
    depths : ndarray of shape (d,)
        Depths below the surface, mm.
    centres : tuple of ndarray
        Coordinates of the element centres along each axis, mm.
    components : ndarray of shape (6, d, n1, n2) or (6, d, n)
        The stresses xx, yy, zz, yz, xz and xy, N/mm².
    contact : ndarray of bool, or None
        Elements in contact; None if unknown.

    See Also
    --------
    subsurface_stresses : returns it.
    """

    body: str
    depths: Annotated[Array, Quantity("mm", "depths")]
    centres: tuple[Array, ...]
    components: Annotated[Array, Quantity("N/mm²", "6, depths, grid")]
    contact: Annotated[Array | None, Quantity("1", "grid", "b")] = None

    xx = _component(0, "The normal stress along x, N/mm².")
    yy = _component(1, "The normal stress along y, N/mm².")
    zz = _component(2, "The normal stress along z, N/mm²: at the surface minus the pressure.")
    yz = _component(3, "The shear stress across y and z, N/mm².")
    xz = _component(4, "The shear stress across x and z, N/mm².")
    xy = _component(5, "The shear stress across x and y, N/mm².")

    @property
    def _sizes(self) -> dict[str, tuple[int, ...]]:
        return {"depths": self.depths.shape[:1], "grid": tuple(map(len, self.centres))}

    def _rules(self) -> Iterator[Rule]:
        yield Rule("body", self.body in BODIES, f"one of {', '.join(BODIES)}")
        yield Rule("depths", not (self.depths < 0.0).any(), "at least zero")
        element = [float(np.ptp(x)) / max(1, len(x) - 1) or 1.0 for x in self.centres]
        yield from check_centres(self.centres, element)

    @property
    def von_mises(self) -> Array:
        """The von Mises stress, N/mm²; the body yields where it reaches the yield stress."""
        return np.sqrt(3.0 * _by_depth(_second_invariant, self.components))

    @property
    def max_shear(self) -> Array:
        """The largest shear stress, N/mm²: half the difference of the principal stresses.

        By Tresca's criterion the body yields where it reaches half the yield stress. The relative
        error is up to 1e-8 where two principal stresses coincide.
        """
        return _by_depth(_largest_shear, self.components)

    @property
    def units(self) -> dict[str, str]:
        """The units of the attributes by name."""
        return name_units(self)

    def fields(self) -> Iterator[tuple[str, Array]]:
        """Yield the names of the stresses that `plot` draws, and their values, N/mm²."""
        for name in SHOWN:
            yield name, getattr(self, name)

    def to_xarray(self) -> Any:
        """Return the stresses as an `xarray.Dataset`, with coordinates and units.

        Returns
        -------
        xarray.Dataset
        """
        places = dict(zip(("depth", *"xy"), (self.depths, *self.centres), strict=False))
        return files.import_extra("xarray", "to_xarray").Dataset(
            {name: ((*places,), values, {"units": "N/mm²"}) for name, values in self.fields()},
            {name: (name, values, {"units": "mm"}) for name, values in places.items()},
            {"kind": "Stresses", "body": self.body},
        )

    to_vtk = files.stresses_to_vtk

    def plot(self, field: str = "von_mises", ax: Any = None) -> Any:
        """Plot a stress over x and depth, for a surface in the plane of its largest value.

        The contact and the position of the largest value are marked.

        Parameters
        ----------
        field : str
            "von_mises", "max_shear", or a component such as "xz".
        ax : matplotlib.axes.Axes, optional
            Axes to draw in; by default those of a new figure.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        ValueError
            If there is no such stress, or there are fewer than two depths, or they are not
            increasing.
        """
        if field not in [*SHOWN]:  # A list, as unhashable values are refused too.
            raise ValueError(f"field is {field!r}, but must be one of {', '.join(SHOWN)}")
        if len(self.depths) < 2 or not (np.diff(self.depths) > 0.0).all():
            raise ValueError(f"depths is {self.depths}, but must be two or more that increase")
        return pictures.draw_section(self, field, SHOWN[field], ax)

    def __repr__(self) -> str:
        """Return the title in one line."""
        return f"<Stresses: {self._title}>"

    def _summary(self) -> Summary:
        largest = self.von_mises
        k, *place = np.unravel_index(largest.argmax(), largest.shape)
        found = [float(x[i]) for x, i in zip(self.centres, place, strict=True)]
        figures = [
            Figure("largest von Mises", largest.max(), "N/mm²"),
            Figure("at x, y" if len(found) > 1 else "at x", found, "mm"),
            Figure("at a depth of", self.depths[k], "mm"),
            Figure("largest shear", self.max_shear.max(), "N/mm²"),
        ]
        return Summary(f"Stresses: {self._title}", figures)

    @property
    def _title(self) -> str:
        grid = " x ".join(str(len(x)) for x in self.centres)
        deep = span(Figure("", self.depths, "mm")).text
        return f"{self.body} body, below {grid} elements, {len(self.depths)} depths, {deep}"


def subsurface_stresses(
    *results: ContactResult | FrictionalResult, depths: ArrayLike, body: str = "first"
) -> Stresses:
    """Return the stresses in a body below the contact, from pressures and tangential tractions.

    Parameters
    ----------
    results : NormalResult, TangentialResult or FrictionalResult
        One result of the first two kinds, or one of each for the same bodies on the same grid:
        their stresses add up. A `FrictionalResult` has both.
    depths : array_like of shape (d,), or float
        Depths below the surface, at least zero, mm.
    body : str
        "first", the body that a positive shift or force drags along x and y, or "second", on which
        the tangential tractions act in the opposite direction. Each has its own Poisson's ratio.
        The stresses in a rigid body are undetermined.

    Returns
    -------
    Stresses
        The six components below the centre of each element at each depth, with `von_mises` and
        `max_shear`.

    Warns
    -----
    ContactWarning
        If there are tangential tractions where the pressure is zero, so that the results do not
        belong together.

    Raises
    ------
    ValueError
        If the results are on different grids or for different materials, are of the same kind, or
        have materials whose bodies are unknown; if the surface is periodic; if depths are negative
        or not finite; if the body is rigid.
    TypeError
        If an argument is not a result.

    See Also
    --------
    toeplitz_mg.halfspace.stresses_z, toeplitz_mg.halfspace.stresses_x : for one element.

    Notes
    -----
    The tractions are constant in each element, and the bodies are half-spaces. Each depth needs one
    Toeplitz product for each component of the stresses and of the tractions. Depths are computed
    one after the other: in addition to the result of 6 d n1 n2 numbers, memory for some 40 n1 n2
    numbers is needed. To save memory for the result, call the function for one depth at a time.

    References
    ----------
    A. E. H. Love, The stress produced in a semi-infinite solid by pressure on part of the boundary,
    Phil. Trans. R. Soc. A 228 (1929); K. L. Johnson, Contact Mechanics, chapters 3, 4 and 7.

    Examples
    --------
    Below a sphere with ν = 0.3 the largest shear stress is 0.31 p₀, at a depth of 0.48 a.

    >>> import numpy as np
    >>> from toeplitz_mg import contact
    >>> steel, element = contact.Material(E=210000.0, nu=0.3), (0.01, 0.01)
    >>> gap = contact.surfaces.sphere((65, 65), element, radius=10.0)
    >>> pressed = contact.normal_contact(gap, element, material=steel, force=100.0)
    >>> a, p0 = np.sqrt(pressed.approach * 10.0), pressed.pressure.max()
    >>> stresses = contact.subsurface_stresses(pressed, depths=np.linspace(0.3, 0.7, 41) * a)
    >>> below = stresses.max_shear[:, 32, 32]
    >>> f"{below.max() / p0:.2f} p0 at {stresses.depths[below.argmax()] / a:.2f} a"
    '0.31 p0 at 0.48 a'
    """
    parts = tuple(part for result in results for part in _parts(result))
    grid = _check_results(parts)
    z = np.atleast_1d(field("depths", depths, "mm"))
    if z.ndim != 1 or z.size == 0 or not np.isfinite(z).all():
        raise ValueError(f"depths is {depths!r}, but must be a number, or a list of finite ones")
    if (z < 0.0).any():
        raise ValueError(f"depths has the value {z.min():g}, but a depth is at least zero")
    nu = _find_ratio(grid.material, body)
    _doubt(parts)
    tractions = list(_tractions(parts, -1.0 if body == BODIES[1] else 1.0))
    components = np.zeros((6, len(z), *grid.shape))
    for k, depth in enumerate(z.tolist()):
        for direction, traction in tractions:
            matrices = stress_matrices(direction, grid.shape, grid.element, depth, nu=nu)
            for total, A in zip(components[:, k], matrices, strict=True):
                if A is not None:
                    total += apply_to_rows(A, traction.reshape(-1)).reshape(grid.shape)
    contact = np.logical_or.reduce([part.contact for part in parts])
    return Stresses(body, z, grid.centres, components, contact)


def _parts(result: Any) -> tuple[Any, ...]:
    """Return the normal and tangential results of a `FrictionalResult`, or the result itself."""
    if isinstance(result, FrictionalResult):
        return result.normal, result.tangential
    return (result,)


def _check_results(results: tuple[ContactResult, ...]) -> ContactResult:
    """Return one of the results after checking that they share the grid and the material."""
    for result in results:
        if not isinstance(result, NormalResult | TangentialResult):
            raise TypeError(
                f"a result is {result!r}, but must be a NormalResult, a TangentialResult, or a "
                "FrictionalResult, which has both"
            )
        require_whole(result, "a result")
        if any(result.periodic):
            raise ValueError(
                f"a result has periodic={result.periodic}, but stresses are only known below "
                "bodies that do not repeat: press them with periodic=False"
            )
    kinds = [type(result) for result in results]
    if len(kinds) not in (1, 2) or len(set(kinds)) < len(kinds):
        raise ValueError(
            f"there are {len(kinds)} results, but there must be a normal one, a tangential one, or "
            "one of each"
        )
    first, last = results[0], results[-1]
    for name in ("shape", "element", "material"):
        values = getattr(first, name), getattr(last, name)
        if values[0] != values[1]:
            raise ValueError(
                f"{name} is {values[0]} in one result and {values[1]} in the other, but both must "
                "be of the same bodies on the same grid"
            )
    return first


def _doubt(results: tuple[ContactResult, ...]) -> None:
    """Warn of tangential tractions where the pressure is zero."""
    pressed = [r.pressure > 0.0 for r in results if isinstance(r, NormalResult)]
    shifted = [r.traction for r in results if isinstance(r, TangentialResult)]
    for contact, traction in zip(pressed, shifted, strict=False):
        count = np.count_nonzero(traction.reshape(-1, *contact.shape).any(axis=0) & ~contact)
        if count:
            doubts.warn(
                (
                    f"{count} elements have tangential tractions, but no pressure: the two results "
                    "may belong to different contacts",
                ),
                within=1,
            )


def _find_ratio(material: CombinedMaterial, body: str) -> float:
    """Return Poisson's ratio of one of the bodies."""
    if body not in BODIES:
        raise ValueError(f"body is {body!r}, but must be 'first' or 'second'")
    if material.bodies is None:
        raise ValueError(
            f"material is {material}, which does not tell the two bodies apart: use "
            "contact.Material, or two of them"
        )
    of_body = material.bodies[BODIES.index(body)]
    if np.isinf(of_body.G):
        raise ValueError(f"the {body} body is rigid, so that its stresses are not determined")
    return of_body.nu


def _tractions(results: tuple[ContactResult, ...], sign: float) -> Iterator[tuple[str, Array]]:
    """Yield the traction components on a body with their directions; pressure acts along z."""
    for result in results:
        if isinstance(result, NormalResult):
            yield "z", result.pressure
        else:
            components = result.traction.reshape(-1, *result.shape)
            for direction, traction in zip("xy", components, strict=False):
                if traction.any():
                    yield direction, sign * traction


def _by_depth(function: Callable[..., Array], components: Array) -> Array:
    """Return a function of the stresses, evaluated depth by depth."""
    out = np.empty(components.shape[1:])
    for k in range(len(out)):
        elementwise(function, *components[:, k], out=out[k])
    return out


def _second_invariant(xx: Array, yy: Array, zz: Array, yz: Array, xz: Array, xy: Array) -> Array:
    """Return the second invariant J₂ of the deviator."""
    normal: Array = ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) / 6.0
    return normal + yz**2 + xz**2 + xy**2


def _largest_shear(xx: Array, yy: Array, zz: Array, yz: Array, xz: Array, xy: Array) -> Array:
    """Return half the difference of the largest and the smallest principal stress.

    The principal stresses of the deviator are 2 √(J₂/3) cos(θ + 2πk/3).
    """
    mean = (xx + yy + zz) / 3.0
    J2 = _second_invariant(xx, yy, zz, yz, xz, xy)
    size = np.sqrt(J2)
    unit = np.where(size > 0.0, size, 1.0)
    x, y, z, a, b, c = ((s / unit) for s in (xx - mean, yy - mean, zz - mean, yz, xz, xy))
    J3 = x * y * z + 2.0 * a * b * c - x * a * a - y * b * b - z * c * c
    angle = np.arccos(np.clip(1.5 * np.sqrt(3.0) * J3, -1.0, 1.0)) / 3.0
    shear: Array = size * np.sin(angle + np.pi / 3.0)
    return shear
