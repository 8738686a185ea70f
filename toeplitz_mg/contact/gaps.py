"""What a user gives for the surfaces: the sign, the zero and the units are decided here.

The gap is positive where the bodies are apart, and the approach counts from where the gap is zero.
Heights are those of one body above its own inside, so that a summit is positive; of two rough
bodies they add up. They are pressed on a flat, and the gap is zero at the highest of them:

    gap = max(heights) - heights.

Where there is no material the gap is infinite: missing heights (NaN, or masked) are such, and they
are never in contact. Heights of the library SurfaceTopography bring sizes, units and periodicity.
"""

import os
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from toeplitz_mg._typing import Array, Element
from toeplitz_mg.values import field, refuse_masked

# Units of length in mm. SurfaceTopography writes them so; the two signs for micro look alike.
UNITS = {
    "Gm": 1e12, "Mm": 1e9, "km": 1e6, "m": 1e3, "cm": 10.0, "mm": 1.0, "um": 1e-3, "µm": 1e-3,
    "μm": 1e-3, "nm": 1e-6, "Å": 1e-7, "A": 1e-7, "pm": 1e-9, "fm": 1e-12,
}  # fmt: skip


class Surface(NamedTuple):
    """A gap and the size of an element, mm, and along which axes they repeat."""

    gap: Array
    element: Any
    periodic: Any


def read_surface(
    gap: ArrayLike | None,
    element: Element | None,
    heights: Any,
    unit: str | None,
    periodic: Any,
) -> Surface:
    """Return the surface that was given, or say what is wrong with it.

    Parameters
    ----------
    gap : array_like or None
    element : float or (float, float), or None
    heights : array_like, masked array, topography of SurfaceTopography, or None
        In the place of the gap.
    unit : str or None
        That of the gap or the heights, and of the element: mm, where there is no other.
    periodic : bool, tuple of bool or None
        None is what a topography says, and False otherwise.
    """
    if (gap is None) == (heights is None):
        raise ValueError(
            "either gap or heights must be given: "
            + ("neither is" if gap is None else "both are, but one decides the other")
        )
    if isinstance(heights, str | os.PathLike):
        raise TypeError(
            f"heights is {str(heights)!r}, but must be heights: those of a file are read by "
            "SurfaceTopography.read_topography, of numbers alone by np.load or np.loadtxt"
        )
    if _is_topography(gap):
        raise TypeError("gap is a topography, which has heights: give it as heights")
    if _is_topography(heights):
        if element is not None:
            raise ValueError(
                f"element is {element}, but a topography has its own: "
                f"{tuple(np.atleast_1d(heights.pixel_size).tolist())} {heights.unit}"
            )
        unit = _agree_on_unit(heights.unit, unit)
        element = tuple(np.atleast_1d(heights.pixel_size).tolist())
        periodic = bool(heights.is_periodic) if periodic is None else periodic
        heights = heights.heights()
    if element is None:
        raise TypeError("element is missing: the size (h1, h2) of an element must be given")
    z = _check_gap(gap) if gap is not None else _press_on_a_flat(heights)
    if (factor := _factor(unit)) != 1.0:
        z *= factor
        element = (factor * field("element", element)).tolist()
    return Surface(z, element, False if periodic is None else periodic)


def _is_topography(surface: Any) -> bool:
    """Whether this is of SurfaceTopography, which need not be imported for that."""
    is_of_library = type(surface).__module__.partition(".")[0] == "SurfaceTopography"
    if not (is_of_library or hasattr(surface, "physical_sizes")):
        return False
    if not hasattr(surface, "heights") or not getattr(surface, "is_uniform", True):
        kind = type(surface).__name__
        raise TypeError(
            f"heights is of type {kind}, but must be one topography on a uniform grid: see its "
            "methods to_uniform() and topography()"
        )
    return True


def _agree_on_unit(own: str | None, given: str | None) -> str:
    """Return the unit of a topography."""
    if own is None and given is None:
        raise ValueError("the topography has no unit: say which it is, as unit='um'")
    if own is not None and given is not None and _factor(own) != _factor(given):
        raise ValueError(f"unit is {given!r}, but the topography is in {own!r}")
    return own or given or "mm"


def _factor(unit: str | None) -> float:
    """Return a unit in mm."""
    if unit is None:
        return 1.0
    if unit not in UNITS:
        raise ValueError(f"unit is {unit!r}, but must be one of {', '.join(UNITS)}")
    return UNITS[unit]


def _check_gap(gap: ArrayLike) -> Array:
    """Return a gap as an array, or say where there is no material."""
    array = refuse_masked("gap", gap)
    if array.dtype.kind == "f" and np.isnan(array).any():
        raise ValueError(
            "gap is not a number somewhere: where there is no material it is inf; of measured "
            "heights, heights=, those that are not numbers are missing"
        )
    return field("gap", array)


def _press_on_a_flat(heights: Any) -> Array:
    """Return the gap between heights and a flat that touches the highest of them."""
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
