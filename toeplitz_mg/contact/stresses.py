"""The stresses in a body, at some depths below a contact: fields, figures and a picture."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.contact import fields, plotting, saving, vtk
from toeplitz_mg.contact.summary import Figure, Summary, list_figures, span, tabulate_figures
from toeplitz_mg.contact.units import Quantity, name_units
from toeplitz_mg.engine.threads import elementwise

COMPONENTS = ("xx", "yy", "zz", "yz", "xz", "xy")
# What `plot` draws, and what it calls it.
SHOWN = {"von_mises": "von Mises", "max_shear": "largest shear"} | {c: c for c in COMPONENTS}


@dataclass(frozen=True, eq=False, repr=False)
class Stresses:
    """The stresses in one body at some depths below the elements of a grid.

    z is the depth in this body, x and y are those of the surface; tension is positive. Fields have
    the depths first, and then the shape of the grid.

    Attributes
    ----------
    body : str
        "first" or "second".
    depths : ndarray of shape (d,)
        Below the surface, mm.
    centres : tuple of ndarray
        The centres of the elements along each axis, mm.
    components : ndarray of shape (6, d, n1, n2) or (6, d, n)
        The stresses xx, yy, zz, yz, xz and xy, N/mm².

    See Also
    --------
    subsurface_stresses : finds them.
    """

    body: str
    depths: Annotated[Array, Quantity("mm", "depths")]
    centres: tuple[Array, ...]
    components: Annotated[Array, Quantity("N/mm²", "6, depths, grid")]

    def __post_init__(self) -> None:
        fields.protect(self)

    __setstate__ = fields.restore

    @property
    def xx(self) -> Array:
        """The normal stress along x, N/mm²."""
        return self._component(0)

    @property
    def yy(self) -> Array:
        """The normal stress along y, N/mm²."""
        return self._component(1)

    @property
    def zz(self) -> Array:
        """The normal stress along the depth, N/mm²: at the surface minus the pressure."""
        return self._component(2)

    @property
    def yz(self) -> Array:
        """The shear stress across y and z, N/mm²."""
        return self._component(3)

    @property
    def xz(self) -> Array:
        """The shear stress across x and z, N/mm²."""
        return self._component(4)

    @property
    def xy(self) -> Array:
        """The shear stress across x and y, N/mm²."""
        return self._component(5)

    @property
    def von_mises(self) -> Array:
        """The stress of von Mises, N/mm²: it yields where that is the yield stress."""
        return np.sqrt(3.0 * _by_depth(_second_invariant, self.components))

    @property
    def max_shear(self) -> Array:
        """The largest shear stress, N/mm²: half the difference of the principal stresses.

        It yields by Tresca where that is half the yield stress. The relative error is up to 1e-8
        where two principal stresses are the same.
        """
        return _by_depth(_largest_shear, self.components)

    @property
    def units(self) -> dict[str, str]:
        """The units of the attributes, by their names."""
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

        Raises
        ------
        ImportError
            Where xarray is not installed: ``pip install 'toeplitz-mg[xarray]'``.
        """
        places = dict(zip(("depth", *"xy"), (self.depths, *self.centres), strict=False))
        return saving.import_xarray().Dataset(
            {name: ((*places,), values, {"units": "N/mm²"}) for name, values in self.fields()},
            {name: (name, values, {"units": "mm"}) for name, values in places.items()},
            {"kind": "Stresses", "body": self.body},
        )

    save, to_vtk = saving.save, vtk.stresses_to_vtk

    def plot(self, field: str = "von_mises", ax: Any = None) -> Any:
        """Draw a stress along x and over the depth: of a surface, under the y of its largest value.

        Parameters
        ----------
        field : str
            "von_mises", "max_shear", or a component as "xz".
        ax : matplotlib.axes.Axes, optional
            Where to draw, as beside other results; by default on a new figure.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        ValueError
            Where there is no such stress, or depths are fewer than two or not in order.
        ImportError
            Where matplotlib is not installed: ``pip install 'toeplitz-mg[plot]'``.
        """
        if field not in [*SHOWN]:  # A list has no hash, but is refused as any other.
            raise ValueError(f"field is {field!r}, but must be one of {', '.join(SHOWN)}")
        if len(self.depths) < 2 or not (np.diff(self.depths) > 0.0).all():
            raise ValueError(f"depths is {self.depths}, but must rise, and be two at least")
        return plotting.draw_section(self, field, SHOWN[field], ax)

    summary, _repr_html_ = list_figures, tabulate_figures

    def __repr__(self) -> str:
        """Return what these are in one line."""
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
        deep = span("", self.depths, "mm").text
        return f"{self.body} body, below {grid} elements, {len(self.depths)} depths, {deep}"

    def _component(self, k: int) -> Array:
        component: Array = self.components[k]
        return component


def _by_depth(function: Callable[..., Array], components: Array) -> Array:
    """Return a function of the stresses, by pieces of each depth."""
    out = np.empty(components.shape[1:])
    for k in range(len(out)):
        elementwise(function, *components[:, k], out=out[k])
    return out


def _second_invariant(xx: Array, yy: Array, zz: Array, yz: Array, xz: Array, xy: Array) -> Array:
    """Return half the square of the deviator."""
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
