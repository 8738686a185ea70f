"""The user's surfaces: this file decides on signs, the zero of the gap, and units.

The gap is positive where the bodies are apart, and the approach counts from zero gap. Heights are
positive at summits (away from the material); those of two rough bodies are added. They are pressed
on a flat, and the gap is zero at the highest point:

    gap = max(heights) - heights.

The gap is infinite where there is no material, as for missing heights (NaN or masked), which are
never in contact. Heights from a file (`reading`), topographies of SurfaceTopography, labelled
arrays of xarray and quantities of pint provide their sizes, units or axes; contradicting arguments
are refused.
"""

import os
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from toeplitz_mg._typing import Array, Element, Unit
from toeplitz_mg.contact.grid import read_sizes
from toeplitz_mg.values import field, has_unit, in_unit, refuse_masked

# Units of length in mm, as SurfaceTopography writes them; the two signs for micro look alike.
UNITS = {
    "Gm": 1e12, "Mm": 1e9, "km": 1e6, "m": 1e3, "cm": 10.0, "mm": 1.0, "um": 1e-3, "µm": 1e-3,
    "μm": 1e-3, "nm": 1e-6, "Å": 1e-7, "A": 1e-7, "pm": 1e-9, "fm": 1e-12,
}  # fmt: skip
ALIKE = 1e-6  # Relative difference of equal sizes: coordinates may be in float32.


class Surface(NamedTuple):
    """A gap, the size of an element, mm, and along which axes the surface repeats."""

    gap: Array
    element: Any
    periodic: Any


@dataclass(frozen=True, eq=False)
class Heights:
    """Heights of a surface with the size of its elements, for ``heights=``.

    Attributes
    ----------
    heights : ndarray of shape (n1, n2) or (n,)
        mm, positive at summits, NaN where they are missing.
    element : tuple of float, or None
        Size of an element along each axis, mm; None if it is unknown.
    periodic : bool
        Whether the surface repeats.

    See Also
    --------
    toeplitz_mg.contact.surfaces.read : reads them from a file.
    """

    heights: Array
    element: tuple[float, ...] | None
    periodic: bool = False

    def __repr__(self) -> str:
        """Return the number of pixels and their size in one line."""
        shape, sizes = " x ".join(map(str, self.heights.shape)), self.element or ("unknown size",)
        pixel = " x ".join(f"{h:.5g}" if isinstance(h, float) else str(h) for h in sizes)
        return f"<Heights {shape}, pixels of {pixel} mm{', periodic' * self.periodic}>"


def read_surface(
    gap: ArrayLike | None,
    element: Element | None,
    heights: Any,
    unit: Unit | None,
    periodic: Any,
) -> Surface:
    """Return the given surface, or raise an error.

    Parameters
    ----------
    gap : array_like or None
    element : float or (float, float), or None
    heights : array_like, masked array, Heights, topography of SurfaceTopography, or None
        Instead of the gap.
    unit : str or (str, str), or None
        Unit of the gap or the heights and of the element, or one each; by default mm.
    periodic : bool, tuple of bool or None
        None means as the heights say, otherwise False.
    """
    if (gap is None) == (heights is None):
        raise ValueError(
            "either gap or heights must be given: " + ("neither is" if gap is None else "both are")
        )
    if isinstance(heights, str | os.PathLike):
        raise TypeError(
            f"heights is {str(heights)!r}, but must be an array: read a file with "
            "heights=contact.surfaces.read(path)"
        )
    if isinstance(gap, Heights) or _is_topography(gap):
        raise TypeError(f"gap is of type {type(gap).__name__}, but must be an array: use heights=")
    name = "gap" if heights is None else "heights"
    given: Any = gap if heights is None else heights
    if (several := getattr(given, "files", getattr(given, "data_vars", None))) is not None:
        raise TypeError(
            f"{name} is of type {type(given).__name__}, but must be one of its arrays: "
            f"{', '.join(map(str, several))}"
        )
    if isinstance(given, Heights):
        given, element, periodic = _ask_heights(given, element, unit, periodic)
        unit = None
    elif _is_topography(given):
        sizes = tuple(np.atleast_1d(given.pixel_size).tolist())
        if element is not None:
            raise ValueError(
                f"element is {element}, but a topography has its own: {sizes} {given.unit}"
            )
        unit = agree_on_unit("the topography", given.unit, unit)
        element = sizes
        periodic = bool(given.is_periodic) if periodic is None else periodic
        given = given.heights()
    elif has_axes(given):
        given, element, unit = _ask_axes(name, given, element, unit)
    factors = read_unit(unit)
    if unit is not None and (has_unit(given) or has_unit(element)):
        raise ValueError(f"unit is {unit!r}, but {name} or element has its own: leave unit out")
    given = in_unit(name, given, "mm")
    if element is None:
        raise TypeError("element is missing: the size (h1, h2) of an element must be given")
    z = _check_gap(given) if heights is None else _press_on_a_flat(given)
    if unit is not None:
        read_sizes(z.shape, element)  # Checked in the given unit, for the error message.
        z *= factors[0]
        element = tuple((factors[1] * np.atleast_1d(field("element", element))).tolist())
    return Surface(z, element, False if periodic is None else periodic)


def _ask_heights(given: Heights, element: Any, unit: Any, periodic: Any) -> tuple[Any, Any, Any]:
    """Combine what a file says about its heights with the given arguments."""
    for name, value in (("element", element), ("unit", unit)):
        if value is not None and (name == "unit" or given.element is not None):
            own = f"{given.element} mm" if name == "element" else "mm"
            raise ValueError(f"{name} is {value!r}, but heights has its own, {own}: leave it out")
    element = given.element if element is None else element
    return given.heights, element, given.periodic if periodic is None else periodic


def has_axes(values: Any) -> bool:
    """Whether the axes of an array have names, as in xarray."""
    return hasattr(values, "dims") and hasattr(values, "coords") and hasattr(values, "transpose")


def in_order(name: str, values: Any) -> Any:
    """Return an array whose last axes are x and y, ordered by their names if they have any."""
    if not has_axes(values):
        return values
    dims = list(values.dims)
    if len(dims) > 1 and not {"x", "y"} <= set(dims):
        raise ValueError(
            f"{name} has the axes {tuple(dims)}, but must have x and y: rename them, or give its "
            "values, in this order"
        )
    own = [dim for dim in dims if dim not in ("x", "y")]
    return values.transpose(*own, *(dim for dim in ("x", "y") if dim in dims))


def measure_axes(name: str, values: Any, element: Any) -> tuple[Any, tuple[float, ...] | None]:
    """Return an array with named axes in order, and the element that its coordinates imply."""
    values = in_order(name, values)
    found: list[float | None] = []
    for dim in values.dims:
        at = np.asarray(values.coords[dim].values, float) if dim in values.coords else np.zeros(1)
        steps = np.diff(at)
        if steps.size and not np.allclose(steps, steps.mean(), rtol=1e-3, atol=0.0):
            raise ValueError(
                f"the coordinates {dim} of {name} are not evenly spaced: resample it, as by interp"
            )
        if steps.size and steps[0] < 0.0:
            values = values.isel({dim: slice(None, None, -1)})
        found.append(abs(float(steps.mean())) if steps.size else None)
    given = None if element is None else np.atleast_1d(field("element", element, "mm")).tolist()
    if given is None:
        return values, None if None in found else tuple(h for h in found if h is not None)
    for dim, own, h in zip(values.dims, found, given, strict=False):
        if own is not None and abs(own - h) > ALIKE * own:
            raise ValueError(
                f"element is {element}, but the coordinates {dim} of {name} are {own:g} apart: "
                "leave it out, or drop the coordinates"
            )
    return values, tuple(given)


def unit_of_axes(name: str, values: Any) -> str | None:
    """Return the unit of the coordinates of an array with named axes, or None."""
    units = {values.coords[dim].attrs.get("units") for dim in values.dims if dim in values.coords}
    if len(units := units - {None}) > 1:
        raise ValueError(f"the coordinates of {name} are in {sorted(units)}, but must be in one")
    return next(iter(units), None)


def _ask_axes(name: str, given: Any, element: Any, unit: Any) -> tuple[Any, Any, Any]:
    """Combine the axes and units of a labelled array with the given arguments."""
    is_measured = element is None
    given, element = measure_axes(name, given, element)
    stated = given.attrs.get("units"), unit_of_axes(name, given)
    if unit is None and is_measured and None in stated and set(stated) - {None, "mm"}:
        own, other = (name, "its coordinates") if stated[0] else ("its coordinates", name)
        raise ValueError(
            f"{own} has units {stated[0] or stated[1]!r}, but {other} has none: give both as unit="
            "(heights, pixels)"
        )
    for k, (of, own) in enumerate(zip((name, "its axes"), stated, strict=True)):
        if own is not None:
            pair = unit if isinstance(unit, tuple | list) else (unit, unit)
            agreed = agree_on_unit(of, own, pair[k])
            unit = (agreed, pair[1]) if k == 0 else (pair[0], agreed)
    data = given.data if has_unit(given.data) else given.values
    return data, element, unit


def _is_topography(surface: Any) -> bool:
    """Whether this is a SurfaceTopography object, without importing that library."""
    is_of_library = type(surface).__module__.partition(".")[0] == "SurfaceTopography"
    if not (is_of_library or hasattr(surface, "physical_sizes")):
        return False
    if not hasattr(surface, "heights") or not getattr(surface, "is_uniform", True):
        kind = type(surface).__name__
        raise TypeError(
            f"heights is of type {kind}, but must be one topography on a uniform grid: use its "
            "method to_uniform() or topography()"
        )
    return True


def agree_on_unit(of: str, own: str | None, given: Unit | None) -> Any:
    """Return the unit of heights that may have their own."""
    if own is None and given is None:
        raise ValueError(f"{of} has no unit: give unit=, for example 'um'")
    if own is not None and given is not None and set(read_unit(given)) != set(read_unit(own)):
        raise ValueError(f"unit is {given!r}, but {of} is in {own!r}: leave unit= out")
    return given if own is None else own


def read_unit(unit: Unit | None) -> tuple[float, float]:
    """Return the units of heights and of elements in mm, from one name or two."""
    names = (unit, unit) if unit is None or isinstance(unit, str) else tuple(unit)
    if len(names) != 2:
        raise ValueError(
            f"unit is {unit!r}, but must be one name, or one each of heights and pixels"
        )
    for name in names:
        if name is not None and name not in UNITS:
            raise ValueError(f"unit is {name!r}, but must be one of {', '.join(UNITS)}")
    heights, pixels = (1.0 if name is None else UNITS[name] for name in names)
    return heights, pixels


def _check_gap(gap: ArrayLike) -> Array:
    """Return a gap as an array, or raise an error that says where it is invalid."""
    array = refuse_masked("gap", gap)
    if array.dtype.kind == "f" and np.isnan(array).any():
        raise ValueError(
            "gap is nan somewhere: use inf where there is no material, or give heights=, of which "
            "nan are missing"
        )
    return field("gap", array)


def _press_on_a_flat(heights: Any) -> Array:
    """Return the gap between heights and a flat that touches the highest point."""
    if np.ma.isMaskedArray(heights):
        missing = np.ma.getmaskarray(heights)
        heights = np.ma.getdata(heights)
    else:
        heights = np.asarray(heights)
        missing = np.zeros(heights.shape, bool)
    if heights.dtype.kind == "f":
        missing = missing | np.isnan(heights) | np.isneginf(heights)
    if missing.size and missing.all():
        raise ValueError("heights has no value in any element")
    h = field("heights", np.where(missing, np.zeros_like(heights), heights))
    if np.isinf(h).any():
        raise ValueError("heights has the value inf, but a summit is finite")
    highest = np.max(h, where=~missing, initial=-np.inf)
    return np.where(missing, np.inf, highest - h)
