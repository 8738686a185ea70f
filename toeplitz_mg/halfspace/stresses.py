"""Stresses in an elastic half-space by uniform tractions on an element: pure functions.

Tension is positive, z is the depth, and a traction is what acts on the body, a pressure against
it. The closed forms are in `stress_integrals`.
"""

import numpy as np
from numpy.typing import ArrayLike

from toeplitz_mg._typing import Array
from toeplitz_mg.halfspace.materials import check_ratio
from toeplitz_mg.halfspace.points import check_element
from toeplitz_mg.halfspace.stress_integrals import (
    by_pressure,
    by_traction,
    exchange,
    line_by_lateral_traction,
    line_by_pressure,
    line_by_traction,
)
from toeplitz_mg.values import fields, positive

SIDES = np.array([-0.5, 0.5])  # Where the sides of an element are, over its size.


def stresses_z(
    x: ArrayLike, y: ArrayLike, z: ArrayLike, element: tuple[float, float], *, nu: float
) -> Array:
    """Return the stresses by a unit pressure on an element (Love).

    Parameters
    ----------
    x, y, z : array_like
        Points relative to the element's centre, mm, z ≥ 0 the depth; broadcast.
    element : (float, float)
        Its size h₁ × h₂, mm; any ratio.
    nu : float
        Poisson's ratio of the body. Its modulus is of no importance.

    Returns
    -------
    ndarray of float64, of shape (6, ...)
        The components xx, yy, zz, yz, xz and xy over the pressure; tension is positive. The error
        is some 1e-16, relative to the pressure. Where a stress jumps, on the edges at the surface,
        it is the mean of both sides. The component xy is infinite in the corners.

    Raises
    ------
    ValueError
        For an element that is not positive, a Poisson's ratio outside (-1, 0.5], points that are
        not finite, or above the surface, or whose shapes do not broadcast.
    TypeError
        For what is no real number.

    See Also
    --------
    stresses_x, stresses_y : by tangential tractions.
    toeplitz_mg.contact.subsurface_stresses : of two bodies in contact.

    Examples
    --------
    In the middle of the surface, (1+2ν)/2 of the pressure along the surface.

    >>> from toeplitz_mg import halfspace
    >>> print(halfspace.stresses_z(0.0, 0.0, 0.0, (1.0, 1.0), nu=0.3)[:3])
    [-0.8 -0.8 -1. ]
    """
    nu = check_ratio(nu)
    X, Y, Z = _corners(x, y, z, element)
    return by_pressure(X, Y, Z, nu)[..., 0, 0]


def stresses_x(
    x: ArrayLike, y: ArrayLike, z: ArrayLike, element: tuple[float, float], *, nu: float
) -> Array:
    """Return the stresses by a unit traction along x on an element (Cerruti).

    Parameters
    ----------
    x, y, z, element, nu
        The arguments of `stresses_z`.

    Returns
    -------
    ndarray of float64, of shape (6, ...)
        As `stresses_z` returns it. On the edges at the surface the components along it are
        infinite: xx on those across x, yy there too unless ν is zero, xy on those along x.

    Raises
    ------
    ValueError, TypeError
        For arguments that `stresses_z` refuses.

    See Also
    --------
    stresses_y : by a traction along y.
    stresses_z : by a pressure.

    Examples
    --------
    The body is compressed ahead of the traction, and stretched behind it.

    >>> from toeplitz_mg import halfspace
    >>> print(halfspace.stresses_x([-1.0, 1.0], 0.0, 0.1, (1.0, 1.0), nu=0.3)[0].round(4))
    [ 0.4182 -0.4182]
    """
    nu = check_ratio(nu)
    X, Y, Z = _corners(x, y, z, element)
    return by_traction(X, Y, Z, nu)[..., 0, 0]


def stresses_y(
    x: ArrayLike, y: ArrayLike, z: ArrayLike, element: tuple[float, float], *, nu: float
) -> Array:
    """Return the stresses by a unit traction along y on an element (Cerruti).

    Parameters
    ----------
    x, y, z, element, nu
        The arguments of `stresses_z`.

    Returns
    -------
    ndarray of float64, of shape (6, ...)
        As `stresses_x` returns it, with x and y exchanged.

    Raises
    ------
    ValueError, TypeError
        For arguments that `stresses_z` refuses.

    See Also
    --------
    stresses_x : by a traction along x.
    stresses_z : by a pressure.

    Examples
    --------
    >>> from toeplitz_mg import halfspace
    >>> print(halfspace.stresses_y(0.0, [-1.0, 1.0], 0.1, (1.0, 1.0), nu=0.3)[1].round(4))
    [ 0.4182 -0.4182]
    """
    nu = check_ratio(nu)
    X, Y, Z = _corners(x, y, z, element)
    return exchange(by_traction(Y, X, Z, nu))[..., 0, 0]


def line_stresses_z(x: ArrayLike, z: ArrayLike, h: float, *, nu: float) -> Array:
    """Return the stresses of plane strain by a unit pressure on a strip of infinite length.

    Parameters
    ----------
    x, z : array_like
        Points relative to the middle of the strip, mm, z ≥ 0 the depth; broadcast.
    h : float
        Width of the strip, mm.
    nu : float
        Poisson's ratio of the body: it decides about yy alone.

    Returns
    -------
    ndarray of float64, of shape (6, ...)
        As `stresses_z` returns it; yz and xy are zero.

    Raises
    ------
    ValueError, TypeError
        For arguments that `stresses_z` refuses.

    See Also
    --------
    line_stresses_x : by a traction along x.
    stresses_z : by a rectangle.

    Examples
    --------
    >>> from toeplitz_mg import halfspace
    >>> print(halfspace.line_stresses_z(0.0, 0.0, 1.0, nu=0.3)[:3])
    [-1.  -0.6 -1. ]
    """
    nu = check_ratio(nu)
    X, Z = _edges(x, z, h)
    return line_by_pressure(X, Z, nu)[..., 0]


def line_stresses_x(x: ArrayLike, z: ArrayLike, h: float, *, nu: float) -> Array:
    """Return the stresses of plane strain by a unit traction across a strip of infinite length.

    Parameters
    ----------
    x, z, h, nu
        The arguments of `line_stresses_z`.

    Returns
    -------
    ndarray of float64, of shape (6, ...)
        As `line_stresses_z` returns it; xx and yy are infinite on the edges.

    Raises
    ------
    ValueError, TypeError
        For arguments that `stresses_z` refuses.

    See Also
    --------
    line_stresses_y : by a traction along the strip.
    line_stresses_z : by a pressure.
    stresses_x : by a rectangle.

    Examples
    --------
    >>> from toeplitz_mg import halfspace
    >>> print(halfspace.line_stresses_x([-1.0, 1.0], 0.0, 1.0, nu=0.3)[0].round(4))
    [ 0.6994 -0.6994]
    """
    nu = check_ratio(nu)
    X, Z = _edges(x, z, h)
    return line_by_traction(X, Z, nu)[..., 0]


def line_stresses_y(x: ArrayLike, z: ArrayLike, h: float, *, nu: float) -> Array:
    """Return the antiplane stresses by a unit traction along a strip of infinite length.

    Parameters
    ----------
    x, z, h, nu
        The arguments of `line_stresses_z`; no stress depends on Poisson's ratio.

    Returns
    -------
    ndarray of float64, of shape (6, ...)
        As `line_stresses_z` returns it, with yz and xy alone; xy is infinite on the edges.

    Raises
    ------
    ValueError, TypeError
        For arguments that `stresses_z` refuses.

    See Also
    --------
    line_stresses_x : by a traction across the strip.
    stresses_y : by a rectangle.

    Examples
    --------
    At the surface what acts on it: on an edge the mean of both sides.

    >>> from toeplitz_mg import halfspace
    >>> print(halfspace.line_stresses_y([0.0, 0.5], 0.0, 1.0, nu=0.3)[3])
    [-1.  -0.5]
    """
    check_ratio(nu)
    X, Z = _edges(x, z, h)
    return line_by_lateral_traction(X, Z)[..., 0]


def _corners(
    x: ArrayLike, y: ArrayLike, z: ArrayLike, element: tuple[float, float]
) -> tuple[Array, Array, Array]:
    """Return the points relative to the lines that bound an element, on two more axes."""
    h1, h2 = check_element(element)
    x, y, z = (array[..., None, None] for array in _check(x=x, y=y, z=z))
    return x + h1 * SIDES[:, None], y + h2 * SIDES, z


def _edges(x: ArrayLike, z: ArrayLike, h: float) -> tuple[Array, Array]:
    """Return the points relative to the edges of a strip, on one more axis."""
    x, z = (array[..., None] for array in _check(x=x, z=z))
    return x + positive("h", h) * SIDES, z


def _check(**points: ArrayLike) -> list[Array]:
    """Return coordinates of points in the body, or say which are none."""
    arrays = fields(**points)
    for name, array in zip(points, arrays, strict=True):
        if not np.isfinite(array).all():
            raise ValueError(f"{name} has values that are not finite")
    depths = arrays[-1]
    if (depths < 0.0).any():
        raise ValueError(f"z has the value {depths.min():g}, but a depth is at least zero")
    return arrays
