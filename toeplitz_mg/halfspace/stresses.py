"""Stresses in an elastic half-space by uniform tractions on an element, in closed form.

They follow Love (1929) for a pressure and Cerruti's potentials for a tangential traction (Johnson,
Contact Mechanics, §3.2). Let V = ∬ 1/r and χ = ∬ ln(r + z) over the rectangle, with indices for
their derivatives and r the distance to the loaded point. A unit pressure gives

    2π σ_xx = 2ν V_z - (1-2ν) χ_xx - z V_xx         2π σ_xy = -(1-2ν) χ_xy - z V_xy
    2π σ_zz = V_z - z V_zz                          2π σ_xz = -z V_xz

and a unit traction along x, with Ω = ∬ (z ln(r + z) - r),

    2π σ_xx = 2(1+ν) V_x + 2ν Ω_xxx - z χ_xxx       2π σ_xy = V_y + 2ν Ω_xxy - z χ_xxy
    2π σ_yy = 2ν V_x + 2ν Ω_xyy - z χ_xyy           2π σ_yz = -z V_xy
    2π σ_zz = -z V_xz                               2π σ_xz = V_z - z V_xx.

Each is a difference over the four corners. Except for logarithms its terms are functions of the
cosines (a, b, c) of the direction from a corner to the point. So nothing overflows or becomes 0/0,
at any depth and on any edge, and errors are some 1e-16 of the traction. In plane strain the corners
are the two edges of a strip.

z is the depth in the body; the traction acts on the body. Tension is positive. The components are
in the order xx, yy, zz, yz, xz, xy.
"""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from toeplitz_mg._typing import Array
from toeplitz_mg.halfspace.influence import check_element
from toeplitz_mg.halfspace.materials import check_ratio
from toeplitz_mg.halfspace.matrices import operator_of
from toeplitz_mg.operators import ToeplitzOperator
from toeplitz_mg.values import fields, positive

SIDES = np.array([-0.5, 0.5])  # Positions of the sides of an element, divided by its size.
# Whether the components xx, yy, zz, yz, xz, xy by a pressure are even (1) or odd (-1) in x and y.
PARITIES = ((1, 1), (1, 1), (1, 1), (1, -1), (-1, 1), (-1, -1))


def stresses_z(
    x: ArrayLike, y: ArrayLike, z: ArrayLike, element: tuple[float, float], *, nu: float
) -> Array:
    """Return the stresses by a unit pressure on an element (Love).

    Parameters
    ----------
    x, y, z : array_like
        Points relative to the centre of the element, mm, with the depth z ≥ 0; they broadcast.
    element : (float, float)
        Element size h₁ × h₂, mm, of any ratio.
    nu : float
        Poisson's ratio of the body. The stresses do not depend on its modulus.

    Returns
    -------
    ndarray of float64, of shape (6, ...)
        The components xx, yy, zz, yz, xz and xy divided by the pressure; tension is positive. The
        error is some 1e-16. Where a stress jumps (at the edges on the surface), the mean of both
        sides is returned. The component xy is infinite at the corners.

    Raises
    ------
    ValueError
        If an element size is not positive, Poisson's ratio is outside (-1, 0.5], or points are not
        finite, lie above the surface, or have shapes that do not broadcast.
    TypeError
        If an argument is not a real number.

    See Also
    --------
    stresses_x, stresses_y : stresses by tangential tractions.
    toeplitz_mg.contact.subsurface_stresses : stresses below a computed contact.

    Examples
    --------
    In the middle of the surface, (1+2ν)/2 of the pressure along the surface.

    >>> from toeplitz_mg import halfspace
    >>> print(halfspace.stresses_z(0.0, 0.0, 0.0, (1.0, 1.0), nu=0.3)[:3])
    [-0.8 -0.8 -1. ]
    """
    return _at("z", element, nu, x=x, y=y, z=z)


def stresses_x(
    x: ArrayLike, y: ArrayLike, z: ArrayLike, element: tuple[float, float], *, nu: float
) -> Array:
    """Return the stresses by a unit traction along x on an element (Cerruti).

    Arguments and result are those of `stresses_z`. On the edges at the surface some components are
    infinite: xx, and yy unless ν is zero, on the edges across x; xy on the edges along x.

    See Also
    --------
    stresses_y : stresses by a traction along y.
    stresses_z : stresses by a pressure.

    Examples
    --------
    The body is compressed ahead of the traction, and stretched behind it.

    >>> from toeplitz_mg import halfspace
    >>> print(halfspace.stresses_x([-1.0, 1.0], 0.0, 0.1, (1.0, 1.0), nu=0.3)[0].round(4))
    [ 0.4182 -0.4182]
    """
    return _at("x", element, nu, x=x, y=y, z=z)


def stresses_y(
    x: ArrayLike, y: ArrayLike, z: ArrayLike, element: tuple[float, float], *, nu: float
) -> Array:
    """Return the stresses by a unit traction along y on an element (Cerruti).

    Arguments and result are those of `stresses_x`, with x and y exchanged.

    See Also
    --------
    stresses_x : stresses by a traction along x.
    stresses_z : stresses by a pressure.

    Examples
    --------
    >>> from toeplitz_mg import halfspace
    >>> print(halfspace.stresses_y(0.0, [-1.0, 1.0], 0.1, (1.0, 1.0), nu=0.3)[1].round(4))
    [ 0.4182 -0.4182]
    """
    return _at("y", element, nu, x=x, y=y, z=z)


def line_stresses_z(x: ArrayLike, z: ArrayLike, h: float, *, nu: float) -> Array:
    """Return the plane-strain stresses by a unit pressure on an infinitely long strip.

    Parameters
    ----------
    x, z : array_like
        Points relative to the middle of the strip, mm, with the depth z ≥ 0; they broadcast.
    h : float
        Width of the strip, mm.
    nu : float
        Poisson's ratio of the body, which affects yy only.

    Returns
    -------
    ndarray of float64, of shape (6, ...)
        As for `stresses_z`; yz and xy are zero.

    See Also
    --------
    line_stresses_x : stresses by a traction along x.
    stresses_z : stresses by a rectangle.

    Examples
    --------
    >>> from toeplitz_mg import halfspace
    >>> print(halfspace.line_stresses_z(0.0, 0.0, 1.0, nu=0.3)[:3])
    [-1.  -0.6 -1. ]
    """
    return _at("z", h, nu, x=x, z=z)


def line_stresses_x(x: ArrayLike, z: ArrayLike, h: float, *, nu: float) -> Array:
    """Return the plane-strain stresses by a unit traction across an infinitely long strip.

    Arguments and result are those of `line_stresses_z`; xx and yy are infinite on the edges.

    See Also
    --------
    line_stresses_y : stresses by a traction along the strip.
    line_stresses_z : stresses by a pressure.
    stresses_x : stresses by a rectangle.

    Examples
    --------
    >>> from toeplitz_mg import halfspace
    >>> print(halfspace.line_stresses_x([-1.0, 1.0], 0.0, 1.0, nu=0.3)[0].round(4))
    [ 0.6994 -0.6994]
    """
    return _at("x", h, nu, x=x, z=z)


def line_stresses_y(x: ArrayLike, z: ArrayLike, h: float, *, nu: float) -> Array:
    """Return the antiplane stresses by a unit traction along an infinitely long strip.

    Arguments and result are those of `line_stresses_z`. Only yz and xy are not zero, and xy is
    infinite on the edges; no stress depends on Poisson's ratio.

    See Also
    --------
    line_stresses_x : stresses by a traction across the strip.
    stresses_y : stresses by a rectangle.

    Examples
    --------
    At the surface the stress is the traction; on an edge it is the mean of both sides.

    >>> from toeplitz_mg import halfspace
    >>> print(halfspace.line_stresses_y([0.0, 0.5], 0.0, 1.0, nu=0.3)[3])
    [-1.  -0.5]
    """
    return _at("y", h, nu, x=x, z=z)


def _at(direction: str, element: Any, nu: float, **points: ArrayLike) -> Array:
    """Return the stresses at points by a unit traction on an element, or on a strip of width h."""
    nu = check_ratio(nu)
    sizes = check_element(element) if len(points) == 3 else (positive("h", element),)
    *arrays, z = fields(**points)
    for name, array in zip(points, (*arrays, z), strict=True):
        if not np.isfinite(array).all():
            raise ValueError(f"{name} has values that are not finite, but all must be")
    if (z < 0.0).any():
        raise ValueError(f"z has the value {z.min():g}, but a depth must be at least zero")
    # Coordinates relative to the lines that bound the element, on additional axes.
    more: tuple[Any, ...] = (..., *(None,) * len(sizes))
    lines = [
        x[more] + h * SIDES.reshape(-1, *(1,) * (len(sizes) - 1 - k))
        for k, (x, h) in enumerate(zip(arrays, sizes, strict=True))
    ]
    first: tuple[Any, ...] = (..., *(0,) * len(sizes))
    return between(direction, lines, z[more], nu)[first]


# Matrices -----------------------------------------------------------------------------------------


def stress_matrices(
    direction: str, shape: tuple[int, ...], element: tuple[float, ...], depth: float, *, nu: float
) -> Iterator[ToeplitzOperator | None]:
    """Yield the matrices of the six stress components by tractions in one direction.

    Parameters
    ----------
    direction : str
        Direction of the tractions: x, y, or z for pressures.
    shape : (int, int) or (int,)
    element : (float, float) or (float,)
        One size stands for strips of infinite length.
    depth : float
        The depth below the surface.
    nu : float
        Poisson's ratio of the body.

    Yields
    ------
    ToeplitzOperator or None
        For xx, yy, zz, yz, xz and xy at the depth below the centres; None for zero components.
    """
    lines = [h * (np.arange(n + 1) - 0.5) for n, h in zip((*shape, 1), element, strict=False)]
    if len(lines) == 2:
        lines[0] = lines[0][:, None]
    quadrants = between(direction, lines, np.array(depth), nu)
    for c, parity in zip(quadrants, PARITIES, strict=True):
        sign = [-p if d == direction else p for p, d in zip(parity, "xy", strict=True)]
        yield operator_of(c.reshape(shape), tuple(sign), 0) if c.any() else None


# Closed forms -------------------------------------------------------------------------------------


def between(direction: str, lines: Sequence[Array], z: Array, nu: float) -> Array:
    """Return the stresses by a unit traction on the rectangles, or strips, between lines.

    Parameters
    ----------
    direction : str
        x, y, or z for a pressure.
    lines : list of ndarray, of shape (..., m + 1, 1) and (..., 1, n + 1), or (..., m + 1)
        Coordinates of the point relative to the lines that bound the rectangles, across x and y.
    z : ndarray of shape (..., 1, 1) or (..., 1), or a number
        The depth.
    nu : float

    Returns
    -------
    ndarray of shape (6, ..., m, n) or (6, ..., m)
    """
    if len(lines) == 1:
        return {"x": _line_x, "y": _line_y, "z": _line_z}[direction](lines[0], z, nu)
    X, Y = lines
    if direction == "y":  # With x and y exchanged.
        return _by_traction(Y, X, z, nu)[[1, 0, 2, 4, 3, 5]]
    return (_by_pressure if direction == "z" else _by_traction)(X, Y, z, nu)


def _by_pressure(X: Array, Y: Array, z: Array, nu: float) -> Array:
    """Return the stresses by a unit pressure on the rectangles between lines."""
    r, a, b, c = _directions(X, Y, z)
    Axx, Ayy = _angles(a, b, c)
    (sx, cx), (sy, cy) = _turn(a, c), _turn(b, c)
    P, Q = b * sx * cx, a * sy * cy  # -z V_xx and -z V_yy
    with np.errstate(divide="ignore"):
        xy = (1.0 - 2.0 * nu) * np.log(r + z) + c if nu != 0.5 else c
    terms = (
        P - Axx - 2.0 * nu * Ayy,
        Q - Ayy - 2.0 * nu * Axx,
        -(Axx + Ayy + P + Q),
        a * cy * cy,
        b * cx * cx,
        -xy,
    )
    return np.stack([_over_corners(F) for F in terms]) / (2.0 * np.pi)


def _by_traction(X: Array, Y: Array, z: Array, nu: float) -> Array:
    """Return the stresses by a unit traction along x on the rectangles between lines."""
    r, a, b, c = _directions(X, Y, z)
    Axx, Ayy = _angles(a, b, c)
    sx, cx = _turn(a, c)
    V_x, V_y = _log_over_corners(X, Y, z, r), _log_over_corners(Y, X, z, r)
    zz, e = cx * cx * b, (2.0 * nu + c) / (1.0 + c)
    terms = (e * b - zz, -e * b, zz, -c, b * sx * cx - Axx - Ayy, -e * a)
    stresses = np.stack([_over_corners(F) for F in terms])
    stresses[0] += 2.0 * V_x
    if nu != 0.0:
        stresses[1] += 2.0 * nu * V_x
    stresses[5] += V_y
    stresses /= 2.0 * np.pi
    return stresses


def _line_z(X: Array, z: Array, nu: float) -> Array:
    """Return the stresses of plane strain by a unit pressure on strips between edges."""
    _, s, c = _directions_in_plane(X, z)
    angle, sc = np.arctan2(s, c), s * c
    terms = [np.diff(F, axis=-1) for F in (sc - angle, -2.0 * nu * angle, -(angle + sc), c * c)]
    return _in_plane(*terms)


def _line_x(X: Array, z: Array, nu: float) -> Array:
    """Return the stresses of plane strain by a unit traction along x on strips between edges."""
    d, s, c = _directions_in_plane(X, z)
    with np.errstate(divide="ignore"):
        log = np.diff(np.log(d), axis=-1)
    zz, xz = (np.diff(F, axis=-1) for F in (c * c, s * c - np.arctan2(s, c)))
    yy = -2.0 * nu * log if nu != 0.0 else np.zeros_like(log)
    return _in_plane(-2.0 * log - zz, yy, zz, xz)


def _line_y(X: Array, z: Array, nu: float) -> Array:
    """Return the antiplane stresses by a unit traction along y; none depends on Poisson's ratio."""
    d, s, c = _directions_in_plane(X, z)
    with np.errstate(divide="ignore"):
        log = np.diff(np.log(d), axis=-1)
    yz, nothing = -np.diff(np.arctan2(s, c), axis=-1), np.zeros_like(log)
    return np.stack([nothing, nothing, nothing, yz, nothing, -log]) / np.pi


def _in_plane(xx: Array, yy: Array, zz: Array, xz: Array) -> Array:
    nothing = np.zeros_like(xx)
    return np.stack([xx, yy, zz, nothing, xz, nothing]) / np.pi


def _directions(X: Array, Y: Array, z: Array) -> tuple[Array, Array, Array, Array]:
    """Return r, X/r, Y/r and z/r; the last three are zero in a corner."""
    r = np.hypot(np.hypot(X, Y), z)
    e = np.where(r > 0.0, r, 1.0)
    return r, X / e, Y / e, z / e


def _directions_in_plane(X: Array, z: Array) -> tuple[Array, Array, Array]:
    d = np.hypot(X, z)
    e = np.where(d > 0.0, d, 1.0)
    return d, X / e, z / e


def _turn(a: Array, c: Array) -> tuple[Array, Array]:
    """Return a and c divided by their hypotenuse; zero if both are zero."""
    _, s, c = _directions_in_plane(a, c)
    return s, c


def _angles(a: Array, b: Array, c: Array) -> tuple[Array, Array]:
    """Return the terms of χ_xx and χ_yy; their sum gives -V_z.

    The first is atan(Y/X) - atan(z Y/(X r)), written without its jump at X = 0.
    """
    product = a * b * ((a * a + b * b) / (1.0 + c))
    return np.arctan2(product, a * a + c * b * b), np.arctan2(product, b * b + c * a * a)


def _log_over_corners(X: Array, Y: Array, z: Array, r: Array) -> Array:
    """Return the difference over the corners of ln(r + Y), or asinh(Y/√(X² + z²)).

    One of the two logarithms of the asinh depends only on X. It cancels if Y does not change its
    sign, and is left out then, because it may be infinite while the stress is finite.
    """
    sign = np.sign(Y)
    with np.errstate(divide="ignore", invalid="ignore"):
        # In a corner at the surface the sign and the term are zero.
        log = sign * np.log(np.where(sign == 0.0, 1.0, r + np.abs(Y)))
        across = _step(np.log(np.hypot(X, z))) * _step(sign)
    return _over_corners(log) - np.where(_step(sign) == 0.0, 0.0, across)


def _over_corners(F: Array) -> Array:
    """Return the difference along the last axis of the difference along the axis before it."""
    return np.diff(np.diff(F, axis=-1), axis=-2)


def _step(F: Array) -> Array:
    """Return the difference along the one of the last two axes that is longer than one."""
    return np.diff(F, axis=-1 if F.shape[-1] > 1 else -2)
