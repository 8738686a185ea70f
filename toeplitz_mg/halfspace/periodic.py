"""Surfaces that repeat along one axis or all: the displacements by waves of pressure.

A wave of pressure p cos(q·x) displaces two half-spaces by 2/(E*|q|) times itself. Along an axis
that repeats the pressures are sums of the waves that the grid has, and their displacements are
taken from this continuous symbol; along an axis that ends they are constant in each element, as on
a surface that repeats nowhere.
"""

import numpy as np
from scipy import fft
from scipy.special import iti0k0

from toeplitz_mg._typing import Array
from toeplitz_mg.halfspace.line_contact import line_contact_coefficients
from toeplitz_mg.halfspace.materials import check_constants


def wavenumbers(shape: tuple[int, ...], element: tuple[float, ...]) -> list[Array]:
    """Return the wavenumbers of the grid along each axis, 1/mm, as `scipy.fft.rfftn` has them.

    Each has the shape of an axis, to broadcast with the others; along the last axis there are those
    that are not negative.
    """
    last = len(shape) - 1
    waves = [
        2.0 * np.pi * (fft.rfftfreq if axis == last else fft.fftfreq)(n, h)
        for axis, (n, h) in enumerate(zip(shape, element, strict=False))
    ]
    return list(np.meshgrid(*waves, indexing="ij", sparse=True))


def periodic_eigenvalues(
    shape: tuple[int, ...], element: tuple[float, ...], *, G: float, nu: float
) -> Array:
    """Return the normal displacements by waves on a surface that repeats along all axes.

    Parameters
    ----------
    shape : (int,) or (int, int)
        Elements in a period. One axis is plane strain.
    element : tuple of float
        Their size, mm.
    G, nu : float
        Shear modulus (N/mm²) and Poisson's ratio, for two materials of `combined_material`.

    Returns
    -------
    ndarray of shape (n // 2 + 1,) or (n1, n2 // 2 + 1)
        2/(E*|q|) = 2(1-ν)/(G|q|), mm per N/mm², at the wavenumbers of `scipy.fft.rfftn`. It is zero
        at q = 0: a mean pressure moves an infinite half-space by any distance, so that
        displacements are those from their mean.

    Notes
    -----
    The continuous symbol at the wavenumbers of the grid, as `tamaas` and `aspher` have it.

    References
    ----------
    K. L. Johnson, Contact Mechanics, §13.2.

    Examples
    --------
    >>> from toeplitz_mg.halfspace.periodic import periodic_eigenvalues
    >>> periodic_eigenvalues((4,), (0.25,), G=1.0, nu=0.5).round(6)
    array([0.      , 0.159155, 0.079577])
    """
    G, nu = check_constants(G, nu)
    q = np.sqrt(sum(k**2 for k in wavenumbers(shape, element)))
    q.flat[0] = np.inf
    eigenvalues: Array = 2.0 * (1.0 - nu) / (G * q)
    return eigenvalues


def tangential_eigenvalues(
    shape: tuple[int, int], element: tuple[float, float], *, G: float, nu: float
) -> dict[str, Array]:
    """Return the tangential displacements by waves of tractions, where both axes repeat.

    Parameters
    ----------
    shape, element, G, nu
        As for `periodic_eigenvalues`.

    Returns
    -------
    dict of ndarray
        Of "xx", "xy" and "yy": 2/(G|q|) (δ_ij - ν q_i q_j/|q|²), in its order.

    Examples
    --------
    >>> from toeplitz_mg.halfspace.periodic import tangential_eigenvalues
    >>> found = tangential_eigenvalues((4, 1), (0.25, 1.0), G=1.0, nu=0.5)
    >>> (found["xx"][1:] / found["yy"][1:]).ravel()
    array([0.5, 0.5, 0.5])
    """
    G, nu = check_constants(G, nu)
    qx, qy = wavenumbers(shape, element)
    q = np.hypot(qx, qy)
    q.flat[0] = np.inf
    coupling = -nu * qx * qy / q**2
    # The highest waves of an even number of elements have no sign, and so no odd part.
    if shape[0] % 2 == 0:
        coupling[shape[0] // 2] = 0.0
    if shape[1] % 2 == 0:
        coupling[:, -1] = 0.0
    factors = {"xx": 1.0 - nu * (qx / q) ** 2, "xy": coupling, "yy": 1.0 - nu * (qy / q) ** 2}
    return {name: 2.0 / (G * q) * factor for name, factor in factors.items()}


def strip_length(n: int) -> int:
    """Return the elements of the circulant that n of them, from end to end, are embedded in."""
    return 2 * fft.next_fast_len(n, real=True) if n > 1 else 1


def strip_eigenvalues(
    shape: tuple[int, int],
    element: tuple[float, float],
    axis: int,
    *,
    G: float,
    nu: float,
    reference: float,
) -> Array:
    """Return the eigenvalues of the normal displacements on a surface that repeats along one axis.

    Parameters
    ----------
    shape : (int, int)
        Elements in a period, and from end to end.
    element : (float, float)
        Their size, mm.
    axis : int
        The one that repeats, 0 or 1.
    G, nu : float
        Shear modulus (N/mm²) and Poisson's ratio, for two materials of `combined_material`.
    reference : float
        The distance at which a line load along the axis moves nothing, mm. The displacements by
        all images of an element have no finite sum, as those of plane strain have none: this
        decides on the constant.

    Returns
    -------
    ndarray
        Those of a circulant whose leading block is the matrix, mm per N/mm²: the axis that ends is
        embedded in one of `strip_length`. In the order of `scipy.fft.rfftn`.

    Notes
    -----
    A wave of wavenumber q along the axis, on a strip of width h across it, moves a point at the
    distance y from its middle by 2(1-ν)/(πG) ∫ K₀(q|t|) dt, from y - h/2 to y + h/2 (K₀ is the
    modified Bessel function), its mean by that of plane strain. The integrals of SciPy are good to
    1e-11 of the largest.

    Examples
    --------
    >>> from toeplitz_mg.halfspace.periodic import strip_eigenvalues
    >>> strip_eigenvalues((4, 3), (0.25, 0.5), 0, G=1.0, nu=0.3, reference=6.0).shape
    (4, 4)
    """
    G, nu = check_constants(G, nu)
    other = 1 - axis
    n, h = shape[other], element[other]
    waves = wavenumbers(shape, element)[axis].ravel()
    if axis == 0:
        waves = np.abs(waves)
    # The integral from zero is odd: that over the element in the middle is twice one half.
    edges = (np.arange(n + 1) - 0.5) * h
    integrals = np.sign(edges) * iti0k0(np.abs(np.multiply.outer(waves, edges)))[1]
    columns = np.diff(integrals)
    columns[1:] *= 2.0 * (1.0 - nu) / (np.pi * G) / waves[1:, None]
    columns[0] = line_contact_coefficients(n, h, G=G, nu=nu, reference=reference)
    embedded = np.zeros((len(waves), strip_length(n)))
    embedded[:, :n] = columns
    if n > 1:
        embedded[:, 1 - n :] = columns[:, :0:-1]
    if axis == 0:
        return fft.rfft(embedded).real
    return np.ascontiguousarray(fft.fft(embedded).real.T)
