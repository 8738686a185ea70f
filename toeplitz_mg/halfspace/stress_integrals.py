"""Stresses in an elastic half-space below a rectangle that is loaded uniformly, in closed form.

By a pressure after Love (1929), by a tangential traction from Cerruti's potentials (Johnson,
Contact Mechanics, §3.2). With V = ∬ 1/r and χ = ∬ ln(r + z) over the rectangle, indices for their
derivatives, and r the distance to the loaded point, a unit pressure gives

    2π σ_xx = 2ν V_z - (1-2ν) χ_xx - z V_xx         2π σ_xy = -(1-2ν) χ_xy - z V_xy
    2π σ_zz = V_z - z V_zz                          2π σ_xz = -z V_xz

and a unit traction along x, with Ω = ∬ (z ln(r + z) - r),

    2π σ_xx = 2(1+ν) V_x + 2ν Ω_xxx - z χ_xxx       2π σ_xy = V_y + 2ν Ω_xxy - z χ_xxy
    2π σ_yy = 2ν V_x + 2ν Ω_xyy - z χ_xyy           2π σ_yz = -z V_xy
    2π σ_zz = -z V_xz                               2π σ_xz = V_z - z V_xx.

Each is a difference over the four corners. But for logarithms its terms are functions of the
cosines (a, b, c) of the direction from a corner to the point: nothing overflows or is 0/0, at any
depth and on any edge, and errors are some 1e-16 of the traction. In plane strain the corners are
the two edges of a strip.

z is the depth in the body, and the traction what acts on it. Tension is positive, and the
components are in the order xx, yy, zz, yz, xz, xy.
"""

import numpy as np

from toeplitz_mg._typing import Array


def by_pressure(X: Array, Y: Array, z: Array, nu: float) -> Array:
    """Return the stresses by a unit pressure on the rectangles between lines.

    Parameters
    ----------
    X, Y : ndarray of shape (..., m + 1, 1) and (..., 1, n + 1), or the other way round
        From the lines that bound the rectangles across x, and across y, to the point.
    z : ndarray of shape (..., 1, 1), or a number
        The depth.
    nu : float

    Returns
    -------
    ndarray of shape (6, ..., m, n)
    """
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


def by_traction(X: Array, Y: Array, z: Array, nu: float) -> Array:
    """Return the stresses by a unit traction along x on the rectangles between lines.

    The arguments are those of `by_pressure`.
    """
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


def exchange(stresses: Array) -> Array:
    """Return stresses with x and y exchanged."""
    return stresses[[1, 0, 2, 4, 3, 5]]


def line_by_pressure(X: Array, z: Array, nu: float) -> Array:
    """Return the stresses of plane strain by a unit pressure on strips between edges.

    Parameters
    ----------
    X : ndarray of shape (..., m + 1)
        From the edges to the point.
    z : ndarray of shape (..., 1), or a number
    nu : float

    Returns
    -------
    ndarray of shape (6, ..., m)
    """
    _, s, c = _directions_in_plane(X, z)
    angle, sc = np.arctan2(s, c), s * c
    terms = [np.diff(F, axis=-1) for F in (sc - angle, -2.0 * nu * angle, -(angle + sc), c * c)]
    return _in_plane(*terms)


def line_by_traction(X: Array, z: Array, nu: float) -> Array:
    """Return the stresses of plane strain by a unit traction along x on strips between edges.

    The arguments are those of `line_by_pressure`.
    """
    d, s, c = _directions_in_plane(X, z)
    with np.errstate(divide="ignore"):
        log = np.diff(np.log(d), axis=-1)
    zz, xz = (np.diff(F, axis=-1) for F in (c * c, s * c - np.arctan2(s, c)))
    yy = -2.0 * nu * log if nu != 0.0 else np.zeros_like(log)
    return _in_plane(-2.0 * log - zz, yy, zz, xz)


def line_by_lateral_traction(X: Array, z: Array) -> Array:
    """Return the antiplane stresses by a unit traction along y on strips between edges.

    The arguments are those of `line_by_pressure`; no stress depends on Poisson's ratio.
    """
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
    """Return a and c over their hypotenuse; zero where both are."""
    _, s, c = _directions_in_plane(a, c)
    return s, c


def _angles(a: Array, b: Array, c: Array) -> tuple[Array, Array]:
    """Return the terms of χ_xx and χ_yy; their sum is that of -V_z.

    The first is atan(Y/X) - atan(z Y/(X r)), here without the jump where X is zero.
    """
    product = a * b * ((a * a + b * b) / (1.0 + c))
    return np.arctan2(product, a * a + c * b * b), np.arctan2(product, b * b + c * a * a)


def _log_over_corners(X: Array, Y: Array, z: Array, r: Array) -> Array:
    """Return the difference over the corners of ln(r + Y), which is asinh(Y/√(X² + z²)).

    In that form one logarithm depends on X alone, and is left out where Y has one sign, so that it
    is not subtracted from itself, which may be infinite: there the stress is finite.
    """
    sign = np.sign(Y)
    with np.errstate(divide="ignore", invalid="ignore"):
        # In a corner at the surface the sign is zero, and so is the term.
        log = sign * np.log(np.where(sign == 0.0, 1.0, r + np.abs(Y)))
        across = _step(np.log(np.hypot(X, z))) * _step(sign)
    return _over_corners(log) - np.where(_step(sign) == 0.0, 0.0, across)


def _over_corners(F: Array) -> Array:
    """Return the difference of the differences along the last two axes."""
    return np.diff(np.diff(F, axis=-1), axis=-2)


def _step(F: Array) -> Array:
    """Return the difference along that of the last two axes that has more than one number."""
    return np.diff(F, axis=-1 if F.shape[-1] > 1 else -2)
