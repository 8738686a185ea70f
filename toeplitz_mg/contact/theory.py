"""Hertz's theory, in closed form: a reference for what is computed on a grid."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import elliprd, elliprf

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.results.base import Described, Figure, Summary
from toeplitz_mg.contact.results.quantities import units_of
from toeplitz_mg.halfspace.materials import Bodies, combine
from toeplitz_mg.values import field, fields, finite, in_range, positive

FLATTEST = 1e4  # Ratio of two radii of curvature up to which the equation of the axes is solved.


@dataclass(frozen=True)
class HertzContact(Described):
    """The contact of an ellipsoid or a cylinder with a flat, by Hertz's theory.

    Attributes
    ----------
    half_axes : (float, float)
        Half axes of the contact along x and y, mm; infinite along a cylinder.
    force : float
        The force that presses, N; of a cylinder N per mm of length.
    max_pressure : float
        The largest pressure, in the middle, N/mm².
    approach : float or None
        The approach of the bodies, mm; None for a cylinder without a reference.
    stiffness : float or None
        The change of the force by that of the approach, N/mm; of a cylinder N/mm², or None.

    See Also
    --------
    hertz : finds it.
    """

    half_axes: tuple[float, float]
    force: float
    max_pressure: float
    approach: float | None
    stiffness: float | None

    @property
    def area(self) -> float:
        """The area of contact, mm²; of a cylinder its width, mm."""
        a, b = self.half_axes
        return 2.0 * min(a, b) if math.isinf(max(a, b)) else math.pi * a * b

    @property
    def mean_pressure(self) -> float:
        """The mean pressure in contact, N/mm²."""
        return self.force / self.area if self.area else 0.0

    def pressure_at(self, x: ArrayLike, y: ArrayLike = 0.0) -> Array:
        """Return the pressures at points: p₀ √(1 - x²/a² - y²/b²), zero outside, N/mm².

        Parameters
        ----------
        x, y : array_like
            Distances from the middle of the contact, mm, that broadcast with each other.

        Returns
        -------
        ndarray of float64, of the shape that `x` and `y` broadcast to

        Raises
        ------
        ValueError, TypeError
            For distances that are not numbers, or shapes that do not broadcast.

        Examples
        --------
        >>> from toeplitz_mg import contact
        >>> steel = contact.Material(E=210000.0, nu=0.3)
        >>> ball = contact.hertz(radii=10.0, material=steel, force=100.0)
        >>> ball.pressure_at([0.0, 0.1, 0.2]).round()
        array([1371., 1157.,    0.])
        """
        x, y = fields(x=x, y=y)
        if self.force == 0.0:
            return np.zeros(np.broadcast_shapes(x.shape, y.shape))
        a, b = self.half_axes
        inside = 1.0 - (x / a) ** 2 - (y / b) ** 2
        return self.max_pressure * np.sqrt(np.maximum(0.0, inside))

    def _summary(self) -> Summary:
        axes = [a for a in self.half_axes if math.isfinite(a)]
        units = units_of(axes)  # Line contact is in plane strain.
        kind, name = ("line", "half width") if len(axes) == 1 else ("point", "half axes")
        figures = [
            Figure("force", self.force, units["force"]),
            Figure("approach", self.approach, "mm"),
            Figure("stiffness", self.stiffness, units["stiffness"]),
            Figure(name, axes, "mm"),
            Figure("contact", self.area, units["area"]),
            Figure("mean pressure", self.mean_pressure, "N/mm²"),
            Figure("largest pressure", self.max_pressure, "N/mm²"),
        ]
        known = [figure for figure in figures if figure.value is not None]
        return Summary(f"Hertz's theory, {kind} contact", known)


def hertz(
    *,
    radii: ArrayLike,
    material: Bodies,
    force: float | None = None,
    approach: float | None = None,
    reference: float | None = None,
) -> HertzContact:
    """Return the contact of a sphere, an ellipsoid or a cylinder with a flat, by Hertz's theory.

    Parameters
    ----------
    radii : float or (float, float), or a pair of these
        The radius of a sphere, mm; or the radii of curvature (Rx, Ry) of one body in the planes of
        x and of y, of which one may be infinite: a cylinder, in line contact. Or those of both
        bodies, negative where one is concave: their curvatures 1/R add up. So two spheres are
        ``((R1, R1), (R2, R2))``.
    material : Material or (Material, Material)
        Of both bodies, or of the first and the second (see `contact.Material`).
    force : float
        The force that presses, N; of a cylinder N per mm of length. Without one nothing touches.
    approach : float
        The approach of the bodies, mm. Either this or the force is given; of a cylinder the force.
    reference : float, optional
        Of a cylinder, the distance at which a line load moves nothing, mm, as in `normal_contact`:
        without it the approach is open.

    Returns
    -------
    HertzContact

    Raises
    ------
    ValueError, TypeError
        For input that makes no sense; and for radii of which one is 10,000 times the other and
        not infinite, or whose curvatures add up to a hollow.

    See Also
    --------
    normal_contact : for any shape, on a grid.
    surfaces.ellipsoid, surfaces.cylinder : the gap that belongs to it.

    References
    ----------
    K. L. Johnson, Contact Mechanics (1985), §4.2. The elliptic integrals are Carlson's, which are
    exact for circles too.

    Examples
    --------
    A steel ball of 10 mm on a steel plate; a wheel of 460 mm, hollow across by 330 mm, on a rail
    of 300 mm; a roller.

    >>> from toeplitz_mg import contact
    >>> steel = contact.Material(E=210000.0, nu=0.3)
    >>> ball = contact.hertz(radii=10.0, material=steel, force=100.0)
    >>> f"{ball.half_axes[0]:.4f} mm, {ball.max_pressure:.0f} N/mm², {ball.approach:.5f} mm"
    '0.1866 mm, 1371 N/mm², 0.00348 mm'
    >>> bodies = (460.0, -330.0), (float("inf"), 300.0)
    >>> wheel = contact.hertz(radii=bodies, material=steel, force=80000.0)
    >>> f"{wheel.half_axes[0]:.2f} and {wheel.half_axes[1]:.2f} mm"
    '4.30 and 15.67 mm'
    >>> roller = contact.hertz(radii=(10.0, float("inf")), material=steel, force=100.0)
    >>> f"{roller.area:.4f} mm wide, {roller.max_pressure:.0f} N/mm²"
    '0.2101 mm wide, 606 N/mm²'
    """
    R = _check_radii(radii)
    modulus = combine(material).E_star
    in_range("E*", modulus)
    if (force is None) == (approach is None):
        raise ValueError(
            f"force is {force} and approach is {approach}, but just one of the two must be given"
        )
    if force is not None:
        force = finite("force", force, "N/mm" if math.isinf(max(R)) else "N")
        if force < 0.0:
            raise ValueError(
                f"force is {force:g}, but must be at least zero: without adhesion nothing can pull"
            )
        in_range("force", force)
    if approach is not None:
        approach = positive("approach", approach, "mm")
        in_range("approach", approach)
    if reference is not None:
        if math.isfinite(max(R)):
            raise ValueError(f"reference is {reference}, but is for a cylinder, in line contact")
        reference = positive("reference", reference, "mm")
    if math.isinf(max(R)):
        if force is None:
            raise ValueError(
                f"approach is {approach}, but in line contact it is only known up to a constant: "
                "give the force"
            )
        return _press_cylinder(R, modulus, force, reference)
    return _press_ellipsoid(R, modulus, force, approach)


def add_curvatures(radii: ArrayLike) -> tuple[float, float]:
    """Return the curvatures along x and y, of one body or the sum of both, 1/mm."""
    R = field("radii", radii, "mm")
    if R.shape not in ((2,), (2, 2)):
        raise ValueError(f"radii is {radii!r}, but must be (R1, R2), or a pair of them")
    if (R == 0.0).any():
        raise ValueError(f"radii is {radii!r}, but no radius of curvature is zero")
    kx, ky = (1.0 / R.reshape(-1, 2)).sum(axis=0).tolist()
    return kx, ky


def _check_radii(radii: ArrayLike) -> tuple[float, float]:
    one = field("radii", radii, "mm")
    if one.ndim == 0:  # It is that of a sphere.
        radii = [positive("radii", float(one))] * 2
    k = add_curvatures(radii)
    if not min(k) >= 0.0 < max(k):
        raise ValueError(
            f"radii is {radii!r}, but the curvatures 1/R of both bodies together must be positive "
            "along x and y, or along one of them zero"
        )
    R = 1.0 / k[0] if k[0] else math.inf, 1.0 / k[1] if k[1] else math.inf
    if math.isfinite(max(R)) and max(R) > FLATTEST * min(R):
        raise ValueError(
            f"radii is {radii!r}, but one may be at most {FLATTEST:g} times the other: use inf for "
            "a cylinder in line contact"
        )
    return R


def _press_cylinder(
    radii: tuple[float, float], modulus: float, force: float, reference: float | None
) -> HertzContact:
    if force == 0.0:
        axes = (0.0, math.inf) if radii[0] < radii[1] else (math.inf, 0.0)
        nothing = None if reference is None else 0.0
        return HertzContact(axes, 0.0, 0.0, nothing, nothing)
    a = math.sqrt(4.0 * force * min(radii) / (math.pi * modulus))
    approach = stiffness = None
    if reference is not None:
        if not reference > a:
            raise ValueError(
                f"reference is {reference}, but must be more than the half width of contact, {a:g}"
            )
        logarithm = math.log(2.0 * reference / a)
        approach = 2.0 * force / (math.pi * modulus) * (logarithm + 0.5)
        stiffness = math.pi * modulus / (2.0 * logarithm)
    axes = (a, math.inf) if radii[0] < radii[1] else (math.inf, a)
    return HertzContact(axes, force, 2.0 * force / (math.pi * a), approach, stiffness)


def _press_ellipsoid(
    radii: tuple[float, float], modulus: float, force: float | None, approach: float | None
) -> HertzContact:
    if force == 0.0:
        return HertzContact((0.0, 0.0), 0.0, 0.0, 0.0, 0.0)
    R1, R2 = max(radii), min(radii)
    ratio = 1.0
    if R1 > R2:
        from scipy.optimize import brentq  # It is slow to import.

        ratio = brentq(lambda k: _radii(k) - R1 / R2, 1.0 / FLATTEST, 1.0, xtol=1e-15)
    K, D = _integrals(ratio)
    if force is not None:
        a = (3.0 * force * R1 * D / (math.pi * modulus)) ** (1.0 / 3.0)
        largest = 3.0 * force / (2.0 * math.pi * ratio * a**2)
        approach = largest * ratio * a * K / modulus
    else:
        assert approach is not None
        a = math.sqrt(2.0 * approach * R1 * D / K)
        largest = approach * modulus / (ratio * a * K)
        force = 2.0 / 3.0 * math.pi * ratio * a**2 * largest
    axes = (a, ratio * a) if radii[0] >= radii[1] else (ratio * a, a)
    # The force is in proportion to the approach to the power of 3/2.
    return HertzContact(axes, force, largest, approach, 1.5 * force / approach)


def _integrals(ratio: float) -> tuple[float, float]:
    """Return the elliptic integrals K and D = (K - E)/e², by the ratio of the half axes."""
    return float(elliprf(0.0, ratio**2, 1.0)), float(elliprd(0.0, ratio**2, 1.0)) / 3.0


def _radii(ratio: float) -> float:
    """Return the ratio of the radii of curvature, by that of the half axes."""
    K, D = _integrals(ratio)
    return (K - D) / (ratio**2 * D)
