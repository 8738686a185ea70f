"""Hertz's theory in closed form, as a reference for results on a grid."""

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

FLATTEST = 1e4  # Largest ratio of the radii of curvature for which the half axes are found.


@dataclass(frozen=True)
class HertzContact(Described):
    """Contact of an ellipsoid or a cylinder with a flat by Hertz's theory.

    Attributes
    ----------
    half_axes : (float, float)
        Half axes of the contact along x and y, mm; infinite along the axis of a cylinder.
    force : float
        Normal force, N; for a cylinder N per mm of length.
    max_pressure : float
        The largest pressure, which is in the middle, N/mm².
    approach : float or None
        The approach of the bodies, mm; None for a cylinder without a reference.
    stiffness : float or None
        dF/dδ, N/mm; for a cylinder N/mm², or None without a reference.

    See Also
    --------
    hertz : returns it.
    """

    half_axes: tuple[float, float]
    force: float
    max_pressure: float
    approach: float | None
    stiffness: float | None

    @property
    def area(self) -> float:
        """The area of contact, mm²; for a cylinder its width, mm."""
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
            Distances from the middle of the contact, mm; they are broadcast against each other.

        Returns
        -------
        ndarray of float64, of the broadcast shape of `x` and `y`

        Raises
        ------
        ValueError, TypeError
            If distances are not numbers, or the shapes do not broadcast.

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
        units = units_of(axes)  # A cylinder is in plane strain.
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
        Radius of a sphere, mm; or the radii of curvature (Rx, Ry) in the planes of x and y. One may
        be infinite, for a cylinder in line contact. For two curved bodies give a pair for each, as
        in ``((R1, R1), (R2, R2))`` for spheres. Radii are negative where a body is concave.
    material : Material or (Material, Material)
        One material for both bodies, or the first and the second (see `contact.Material`).
    force : float
        Normal force, N; for a cylinder N per mm of length. With zero force nothing touches.
    approach : float
        Approach of the bodies, mm. Give either this or the force; for a cylinder the force.
    reference : float, optional
        For a cylinder, the distance at which a line load causes no displacement, mm, as in
        `normal_contact`. Without it the approach is None.

    Returns
    -------
    HertzContact

    Raises
    ------
    ValueError, TypeError
        If the input is invalid; if one radius is more than 10,000 times the other, but finite; or
        if the curvatures do not add up to a convex shape.

    See Also
    --------
    normal_contact : for any shape, on a grid.
    surfaces.ellipsoid, surfaces.cylinder : the gap for these radii.

    References
    ----------
    K. L. Johnson, Contact Mechanics (1985), §4.2. The elliptic integrals are computed in Carlson's
    form, which is exact for circles too.

    Examples
    --------
    A steel ball of 10 mm on a steel plate; a wheel of 460 mm with a hollow profile of 330 mm on a
    rail of 300 mm; a roller.

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
    """Return the curvatures along x and y, 1/mm; those of two bodies are added."""
    R = field("radii", radii, "mm")
    if R.shape not in ((2,), (2, 2)):
        raise ValueError(f"radii is {radii!r}, but must be (R1, R2), or a pair of them")
    if (R == 0.0).any():
        raise ValueError(f"radii is {radii!r}, but no radius of curvature is zero")
    kx, ky = (1.0 / R.reshape(-1, 2)).sum(axis=0).tolist()
    return kx, ky


def _check_radii(radii: ArrayLike) -> tuple[float, float]:
    one = field("radii", radii, "mm")
    if one.ndim == 0:  # The radius of a sphere.
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
        from scipy.optimize import brentq  # Slow to import.

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
    # The force is proportional to the approach to the power 3/2.
    return HertzContact(axes, force, largest, approach, 1.5 * force / approach)


def _integrals(ratio: float) -> tuple[float, float]:
    """Return the elliptic integrals K and D = (K - E)/e² for a ratio of the half axes."""
    return float(elliprf(0.0, ratio**2, 1.0)), float(elliprd(0.0, ratio**2, 1.0)) / 3.0


def _radii(ratio: float) -> float:
    """Return the ratio of the radii of curvature for a ratio of the half axes."""
    K, D = _integrals(ratio)
    return (K - D) / (ratio**2 * D)
