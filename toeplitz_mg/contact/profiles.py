"""Wheel and rail: measured profiles, and the gap between them at their contact.

Profiles are points (y, z) in the plane across the track, mm. y points towards the field side, so
the flange of a wheel is at negative y; z points upwards.
"""

import re
from itertools import pairwise
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.gaps import UNITS
from toeplitz_mg.contact.grid import Grid
from toeplitz_mg.halfspace import Material
from toeplitz_mg.tables import decode
from toeplitz_mg.values import count, field, finite, positive, real, refuse_masked

MOST_YAW = 0.1  # Largest yaw, radians: three times that of wheels in the tightest curves.
SAMPLES = 4000  # Number of positions across the track at which profiles are first compared.
NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"


class WheelRail(NamedTuple):
    """A wheel on a rail in the frame of the contact: x along the rail, y across in its plane.

    Attributes
    ----------
    gap : ndarray of shape (n1, n2)
        Gap before loading, mm; zero in the middle, where the bodies first touch, and infinite
        beyond the ends of a profile.
    angle : float
        Angle of the contact plane, radians; positive if the rail falls towards the flange.
    point : (float, float)
        Contact point (y, z) in the frame of the rail, mm.
    radius : float
        Rolling radius of the wheel at this point, mm.

    See Also
    --------
    wheel_rail : returns it.
    """

    gap: Array
    angle: float
    point: tuple[float, float]
    radius: float


def wheel_rail(
    shape: tuple[int, int],
    element: tuple[float, float],
    *,
    wheel: str | PathLike[str] | ArrayLike,
    rail: str | PathLike[str] | ArrayLike,
    radius: float,
    lateral: float = 0.0,
    roll: float = 0.0,
    yaw: float = 0.0,
    smoothing: float = 0.0,
) -> WheelRail:
    """Return the gap between a wheel and a rail, in the frame of the contact.

    Parameters
    ----------
    shape, element
        The grid, as in `centres`, with two axes: along the rail, and across it.
    wheel, rail : path, or array_like of shape (k, 2)
        Profiles: files of MiniProf (``.whl``, ``.ban``) or SIMPACK (``.prw``, ``.prr``), tables
        with two columns, or points (y, z), mm, with z upwards and y towards the field side. The
        signs of z, and of y for a wheel, are chosen so that the flange is at negative y and points
        down, and the rail falls off at its sides. For a rail, y is that of the file.
    radius : float
        Rolling radius of the wheel at y = 0 of its profile (the tape circle), mm.
    lateral : float
        Displacement of the wheel towards the field side, mm.
    roll : float
        Angle of the wheel about x minus the cant of the rail, radians; positive if its field side
        rises.
    yaw : float
        Angle of attack, radians, at most 0.1; positive if the wheel is turned from x towards the
        field side.
    smoothing : float
        Weight λ of the curvature in the smoothing splines through the points, mm³: they minimise
        the sum of squared distances plus λ ∫f″². Measured points need smoothing, since the contact
        depends on curvatures.

    Returns
    -------
    WheelRail
        The gap, the angle and position of the contact, and the rolling radius.

    Raises
    ------
    OSError
        If there is no such file.
    ValueError, TypeError
        If profiles are invalid or do not meet, or the grid is invalid.

    See Also
    --------
    ellipsoid : the gap for given radii of curvature.
    toeplitz_mg.contact.rolling : rolls the wheel.

    Notes
    -----
    The wheel is a body of revolution; the rail is straight. They first touch where the distance of
    the profiles is smallest. A yaw ψ is taken to first order: the gap is twisted about its middle,
    which then lies ψ r sin(angle)/cos(angle - roll) ahead of the axle. The neglected terms move the
    wheel by about ½ ψ² r tan²(angle): for 460 mm and 0.04 by 4 µm on a tread of 1:10, by 1 mm on a
    flange of 60°.

    Examples
    --------
    A tread with a cone of 1:40 on a head of radius 300 mm touches 7.5 mm from the middle.

    >>> import numpy as np
    >>> from toeplitz_mg.contact import surfaces
    >>> y = np.linspace(-30.0, 30.0, 61)
    >>> tread, head = np.c_[y, y / 40], np.c_[y, -(y**2) / 600]
    >>> found = surfaces.wheel_rail((40, 40), (0.5, 0.5), wheel=tread, rail=head, radius=460.0)
    >>> round(found.point[0], 2), round(found.angle, 4)
    (-7.5, 0.025)
    >>> flat = surfaces.ellipsoid((40, 40), (0.5, 0.5), radii=(460.0, 300.0))
    >>> bool(np.abs(found.gap - flat).max() < 2e-3)
    True
    """
    if refuse_masked("shape", shape).shape != (2,):
        raise ValueError(f"shape is {shape}, but must be (n1, n2)")
    counts = tuple(count("shape", n) for n in shape)
    grid = Grid.of(counts, element, Material.from_shear(1.0, 0.0), None)
    R, moved = positive("radius", radius, "mm"), finite("lateral", lateral, "mm")
    turn, weight = finite("roll", roll, "rad"), real("smoothing", smoothing)
    attack = finite("yaw", yaw, "rad")
    if abs(attack) > MOST_YAW:
        raise ValueError(f"yaw is {yaw}, but must be within {MOST_YAW}, as it is of first order")
    if not 0.0 <= weight < np.inf:
        raise ValueError(f"smoothing is {smoothing}, but must be at least zero, and finite")
    own, top = _read("wheel", wheel), _read("rail", rail)
    tread = _curve("wheel", own, weight)
    if not tread.low <= 0.0 <= tread.high:
        raise ValueError(
            f"the profile wheel has y from {tread.low:g} to {tread.high:g} mm, but must have "
            "y = 0, where radius= is given"
        )
    tape = float(tread.z(0.0))
    turned = _turn(turn)
    low = own @ turned + (moved, 0.0)
    f, g = _curve("wheel", low, weight), _curve("rail", top, weight)
    y = _touch(f, g)
    z, angle = float(f.z(y)), float(np.arctan(g.z(y, 1)))
    # In the frame of the contact both profiles are level and zero at the contact point.
    level, across, local, slopes = _turn(-angle), grid.centres()[1], [], []
    point = y, float(g.z(y))
    for name, points, at in (("wheel", low, z), ("rail", top, point[1])):
        curve = _curve(name, (points - (y, at)) @ level, weight)
        inside = (across >= curve.low) & (across <= curve.high)
        local.append(np.where(inside, curve.z(across), np.nan))
        slopes.append(curve.z(across, 1))
    # The rolling radius is smaller where the wheel's profile is higher.
    places = np.stack([np.append(across, 0.0), np.append(local[0], 0.0)], axis=1) @ level.T
    own_places = (np.array([y - moved, z]) + places) @ turned.T
    r = R + tape - own_places[:, 1]
    r, rolling = np.where(np.isfinite(r[:-1]), r[:-1], R), float(r[-1])
    x = grid.centres()[0][:, None]
    if np.abs(x).max() >= r.min():
        raise ValueError(f"the grid reaches {np.abs(x).max():g} mm along x, beyond the wheel")
    tilt, high = np.cos(angle - turn), np.sqrt(r**2 - x**2)
    gap = local[0] - local[1] + tilt * (r - high)
    # A yaw rotates the wheel by this angle about the normal, and otherwise about its own axle.
    twist, thinner = attack * np.cos(turn) / tilt, -np.sin(angle - turn) - tilt * slopes[0]
    rise = slopes[0] + tilt * (1.0 - r / high) * thinner  # Slope of the wheel across.
    gap += twist * x * (tilt * across / high - rise)
    gap = np.where(np.isfinite(gap), gap, np.inf)
    return WheelRail(gap, angle, point, rolling)


def _turn(angle: float) -> Array:
    """Return the matrix that rotates points (as rows, on its left) by an angle."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, s], [-s, c]])


class _Curve(NamedTuple):
    """A profile as z over y, from the lowest y to the highest."""

    low: float
    high: float
    z: Any


def _curve(name: str, points: Array, weight: float) -> _Curve:
    """Return the spline through the longest part of a profile in which y increases."""
    from scipy.interpolate import CubicSpline, make_smoothing_spline  # Slow to import.

    turns = np.flatnonzero(np.diff(np.sign(np.diff(points[:, 0])))) + 1
    ends = [0, *turns.tolist(), len(points) - 1]
    parts = [points[a : b + 1] for a, b in pairwise(ends)]
    part = max(parts, key=lambda part: float(np.ptp(part[:, 0])))
    y, z = (part if part[0, 0] < part[-1, 0] else part[::-1]).T
    if len(y) < (least := 4 + (weight > 0.0)):
        raise ValueError(
            f"the profile {name} has only {len(y)} points in a row along which y increases, but "
            f"needs {least}"
        )
    spline = make_smoothing_spline(y, z, lam=weight) if weight > 0.0 else CubicSpline(y, z)
    return _Curve(float(y[0]), float(y[-1]), spline)


def _touch(f: _Curve, g: _Curve) -> float:
    """Return the position across the track at which two profiles are closest."""
    from scipy.optimize import minimize_scalar  # Slow to import.

    low, high = max(f.low, g.low), min(f.high, g.high)
    if not low < high:
        raise ValueError("the profiles of wheel and rail have no y in common: check lateral=")

    def apart(y: Any) -> Any:
        return f.z(y) - g.z(y)

    y = np.linspace(low, high, SAMPLES)
    k = int(np.argmin(apart(y)))
    if k in (0, SAMPLES - 1):
        raise ValueError(
            f"wheel and rail touch where a profile ends, at y = {y[k]:.4g} mm: check lateral=, "
            "roll= and the profiles"
        )
    near = y[k - 1], y[k + 1]
    return float(minimize_scalar(apart, bounds=near, method="bounded", options={"xatol": 1e-10}).x)


def _read(name: str, profile: Any) -> Array:
    """Return the points (y, z) of a profile, z upwards, y towards the field side."""
    if not isinstance(profile, str | PathLike):
        points = field(name, profile, "mm")
        if points.ndim != 2 or points.shape[1] != 2 or not np.isfinite(points).all():
            raise ValueError(f"{name} has shape {points.shape}, but must be finite points (k, 2)")
        return points
    points = read_points(Path(profile))
    z = points[:, 1] - np.median(points[:, 1])
    if z.max() > -z.min():  # Heads and flanges point down, so the given z pointed down.
        points = points * (1.0, -1.0)
    low = points[:, 1] < np.median(points[:, 1]) - 0.5 * np.ptp(points[:, 1])
    if name == "wheel" and low.any() and points[low, 0].mean() > np.median(points[:, 0]):
        points = points * (-1.0, 1.0)
    return points


def read_points(path: Path) -> Array:
    """Return the points of a profile in a file of SIMPACK or MiniProf, or with two columns, mm."""
    try:
        text, scale, at = decode(path.read_bytes()), 1.0, (0, 1)
    except UnicodeDecodeError:
        raise ValueError(f"{path} is not a text, but must be a profile of two columns") from None
    if "point.begin" in text:
        head, _, body = text.partition("point.begin")
        body = body.partition("point.end")[0]
        unit = re.search(r"units\.len\s*=\s*'?([a-zA-Z]+)'?", head)
        per_metre = re.search(rf"units\.len\.f\s*=\s*({NUMBER})", head)
        if unit is not None and unit[1] not in UNITS:
            raise ValueError(f"{path} is in {unit[1]!r}, but must be in {', '.join(UNITS)}")
        scale = UNITS[unit[1]] if unit else 1e3 / float(per_metre[1]) if per_metre else 1.0
    else:
        head = "\n".join(line for line in text.splitlines() if "=" in line)
        body = "\n".join(line for line in text.splitlines() if "=" not in line)
        if columns := re.search(r"ColumnDef\s*=\s*\"?([^\"\n]*)", head, re.IGNORECASE):
            names = [name.strip().upper() for name in columns[1].split(",")]
            if not {"X", "Y"} <= set(names):
                raise ValueError(f"{path} has the columns {names}, but must have X and Y")
            at = names.index("X"), names.index("Y")
    rows = [re.findall(NUMBER, re.split(r"[!#%]", line)[0]) for line in body.splitlines()]
    rows = [row for row in rows if row]
    if len(rows) < 4 or min(map(len, rows)) <= max(at):
        raise ValueError(f"{path} has no profile: it needs at least 4 lines with numbers y and z")
    points = scale * np.array([[float(row[k]) for k in at] for row in rows])
    apart = np.append(True, np.abs(np.diff(points, axis=0)).max(axis=1) > 0.0)
    return np.asarray(points[apart])
