"""Gaps between a surface and a flat on a grid, before loading."""

import numpy as np
from numpy.typing import ArrayLike

from toeplitz_mg._typing import Array, Element
from toeplitz_mg.contact.gaps import Heights
from toeplitz_mg.contact.grid import Grid
from toeplitz_mg.contact.profiles import WheelRail, wheel_rail
from toeplitz_mg.contact.reading import read
from toeplitz_mg.contact.theory import add_curvatures
from toeplitz_mg.engine import fourier
from toeplitz_mg.halfspace import Material
from toeplitz_mg.values import count, generator, in_range, positive, real, refuse_masked

__all__ = [
    "Heights",
    "WheelRail",
    "centres",
    "cylinder",
    "ellipsoid",
    "read",
    "rough",
    "sphere",
    "wavy",
    "wheel_rail",
]


def __dir__() -> list[str]:
    return __all__


def centres(shape: int | tuple[int, ...], element: Element) -> tuple[Array, ...]:
    """Return the coordinates of the element centres; zero is the middle of the grid.

    Parameters
    ----------
    shape : int or (int,) or (int, int)
        Number of elements along x, or along x and y.
    element : float or (float, float)
        Element size, mm.

    Returns
    -------
    tuple of ndarray
        x of shape (n,); or x and y of shape (n1, n2).

    Raises
    ------
    ValueError, TypeError
        If numbers of elements are not integers of at least 1, or sizes are not positive.

    See Also
    --------
    sphere, ellipsoid, cylinder, wavy, rough : gaps at these points.

    Examples
    --------
    >>> from toeplitz_mg.contact import surfaces
    >>> (x,) = surfaces.centres(4, 0.5)
    >>> x
    array([-0.75, -0.25,  0.25,  0.75])
    """
    return tuple(np.meshgrid(*_grid(shape, element).centres(), indexing="ij"))


def sphere(shape: tuple[int, int], element: tuple[float, float], *, radius: float) -> Array:
    """Return the gap between a sphere and a flat: a paraboloid, as in Hertz's theory.

    Parameters
    ----------
    shape, element
        The grid, as in `centres`, with two axes.
    radius : float
        mm. For two spheres 1/(1/R₁ + 1/R₂).

    Returns
    -------
    ndarray of the shape given
        mm, r²/(2R).

    Raises
    ------
    ValueError, TypeError
        If the grid is invalid, or the radius is not positive and finite.

    See Also
    --------
    ellipsoid : for two radii of curvature, or two bodies.
    toeplitz_mg.contact.normal_contact : presses it.

    Examples
    --------
    >>> from toeplitz_mg.contact import surfaces
    >>> surfaces.sphere((2, 1), (2.0, 2.0), radius=50.0)
    array([[0.01],
           [0.01]])
    """
    return ellipsoid(shape, element, radii=(_length("radius", radius), radius))


def ellipsoid(shape: tuple[int, int], element: tuple[float, float], *, radii: ArrayLike) -> Array:
    """Return the gap between an ellipsoid and a flat, or two bodies, to second order.

    Parameters
    ----------
    shape, element
        The grid, as in `centres`, with two axes.
    radii : (float, float), or a pair of them
        Radii of curvature in the planes of x and y, mm; or a pair for each body, whose curvatures
        1/R add up. A radius is infinite where a body is straight, and negative where it is concave.

    Returns
    -------
    ndarray of the shape given
        mm, x²/(2R₁) + y²/(2R₂).

    Raises
    ------
    ValueError, TypeError
        If the grid is invalid, or radii are zero, or not one or two pairs.

    See Also
    --------
    sphere : for a single radius.
    toeplitz_mg.contact.normal_contact : presses it.

    Examples
    --------
    >>> from toeplitz_mg.contact import surfaces
    >>> surfaces.ellipsoid((2, 1), (2.0, 2.0), radii=(50.0, 500.0)).ravel()
    array([0.01, 0.01])

    A wheel of radius 460 mm with a hollow profile on a rail with a round one: 1/300 - 1/330.

    >>> surfaces.ellipsoid((1, 2), (2.0, 2.0), radii=((460.0, -330.0), (np.inf, 300.0))).ravel()
    array([0.00015152, 0.00015152])
    """
    if refuse_masked("shape", shape).size != 2:
        raise ValueError(f"shape is {shape}, but must be (n1, n2)")
    kx, ky = add_curvatures(radii)
    x, y = centres(shape, element)
    return 0.5 * (kx * x**2 + ky * y**2)


def cylinder(shape: int | tuple[int, ...], element: Element, *, radius: float) -> Array:
    """Return the gap between a cylinder along y and a flat.

    Parameters
    ----------
    shape, element
        The grid, as in `centres`.
    radius : float
        mm. For two cylinders 1/(1/R₁ + 1/R₂).

    Returns
    -------
    ndarray of the shape given
        mm, x²/(2R).

    Raises
    ------
    ValueError, TypeError
        If the grid is invalid, or the radius is not positive and finite.

    See Also
    --------
    sphere : curved along y too.
    toeplitz_mg.contact.normal_contact : presses it.

    Examples
    --------
    >>> from toeplitz_mg.contact import surfaces
    >>> surfaces.cylinder(2, 2.0, radius=50.0)
    array([0.01, 0.01])
    """
    return centres(shape, element)[0] ** 2 / (2.0 * _length("radius", radius))


def wavy(
    shape: int | tuple[int, ...], element: Element, *, amplitude: float, wavelength: float
) -> Array:
    """Return the gap between a sinusoidal surface and a flat.

    Parameters
    ----------
    shape, element
        The grid, as in `centres`.
    amplitude : float
        From the mean to a crest, mm.
    wavelength : float
        mm, the same along each axis.

    Returns
    -------
    ndarray of the shape given
        mm. The crest, where the gap is zero, is in the middle of the grid.

    Raises
    ------
    ValueError, TypeError
        If the grid is invalid, or lengths are not positive and finite.

    See Also
    --------
    rough : a random surface with many wavelengths.
    centres : the coordinates of the elements.
    toeplitz_mg.contact.normal_contact : presses it.

    Examples
    --------
    >>> from toeplitz_mg.contact import surfaces
    >>> surfaces.wavy(3, 1.0, amplitude=0.5, wavelength=2.0)
    array([1., 0., 1.])
    """
    k = 2.0 * np.pi / _length("wavelength", wavelength)
    crests = np.prod([np.cos(k * x) for x in centres(shape, element)], axis=0)
    return _length("amplitude", amplitude) * (1.0 - crests)


def rough(
    shape: int | tuple[int, ...],
    element: Element,
    *,
    rms: float,
    hurst: float = 0.8,
    longest: float | None = None,
    roll_off: float | None = None,
    shortest: float | None = None,
    seed: int | np.random.Generator = 0,
) -> Array:
    """Return the gap between a random self-affine surface and a flat.

    Parameters
    ----------
    shape, element
        The grid, as in `centres`.
    rms : float
        Root mean square of the heights, mm.
    hurst : float
        Hurst's exponent, in (0, 1].
    longest, shortest : float, optional
        Limits of the wavelengths, mm. By default the shortest is four elements; the longest is a
        quarter of the longer side of the grid, or with a roll-off all of it.
    roll_off : float, optional
        Wavelength above which the spectral density is constant, mm; by default the longest. For
        shorter wavelengths it falls as k^(-2(1 + H)), in line contact as k^(-1 - 2H).
    seed : int or numpy.random.Generator

    Returns
    -------
    ndarray of the shape given
        mm, zero at the highest point. The heights are periodic.

    Raises
    ------
    ValueError, TypeError
        If the grid is invalid, the exponent is outside (0, 1], lengths are not positive and finite,
        the grid cannot represent the wavelengths, or the seed is invalid.

    See Also
    --------
    wavy : a single wavelength.
    centres : the coordinates of the elements.
    toeplitz_mg.contact.normal_contact : presses it.

    Examples
    --------
    >>> from toeplitz_mg.contact import surfaces
    >>> gap = surfaces.rough((64, 64), (0.1, 0.1), rms=0.002, seed=1)
    >>> gap.min(), gap.std().round(6)
    (np.float64(0.0), np.float64(0.002))
    """
    grid, rms, random = _grid(shape, element), _length("rms", rms), generator("seed", seed)
    if not 0.0 < real("hurst", hurst) <= 1.0:
        raise ValueError(f"hurst is {hurst}, but must be in (0, 1]")
    sizes = grid.element[: len(grid.shape)]
    sides = [n * h for n, h in zip(grid.shape, sizes, strict=True)]
    if longest is None:
        longest = max(sides) / (4.0 if roll_off is None else 1.0)
    longest = _length("longest", longest)
    roll_off = longest if roll_off is None else _length("roll_off", roll_off)
    shortest = 4.0 * max(sizes) if shortest is None else _length("shortest", shortest)
    frequencies = [np.fft.fftfreq(n, h) for n, h in zip(grid.shape, sizes, strict=True)]
    k = np.sqrt(sum(f**2 for f in np.meshgrid(*frequencies, indexing="ij")))
    inside = (k > 0.0) & (k * longest >= 1.0 - 1e-12) & (k * shortest <= 1.0 + 1e-12)
    if not inside.any():
        raise ValueError(
            f"the grid has no wavelength between shortest = {shortest:g} and longest = {longest:g}"
        )
    if not shortest <= roll_off <= longest * (1.0 + 1e-12):
        raise ValueError(
            f"roll_off is {roll_off:g}, but must be between shortest = {shortest:g} and "
            f"longest = {longest:g}"
        )
    falloff = np.zeros(grid.shape)
    falloff[inside] = np.maximum(k[inside], 1.0 / roll_off) ** (-hurst - len(grid.shape) / 2.0)
    noise = random.standard_normal(grid.shape)
    heights: Array = fourier.ifftn(fourier.fftn(noise) * falloff).real
    heights *= rms / heights.std()
    return heights.max() - heights


def _length(name: str, value: float) -> float:
    """Return a positive length, mm, whose powers do not over- or underflow."""
    length = positive(name, value, "mm")
    in_range(name, length)
    return length


def _grid(shape: int | tuple[int, ...], element: Element) -> Grid:
    refuse_masked("shape", shape)
    sizes = tuple(shape) if np.iterable(shape) else (shape,)
    counts = tuple(count("shape", n) for n in sizes)
    return Grid.of(counts, element, Material.from_shear(1.0, 0.0), None)
