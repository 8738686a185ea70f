"""Surfaces that repeat along one axis or all: the displacements by waves of traction.

A wave of tractions t cos(q·x) on two half-spaces displaces them by waves too,

    u = 2/(G|q|) (t - ν q (q·t)/|q|²) cos(q·x) along the surface,    2(1-ν)/(G|q|) t cos(q·x) normal

to it. Along an axis that repeats the tractions are sums of the waves that the grid has, and their
displacements are taken from this continuous symbol; along an axis that ends they are constant in
each element, as on a surface that repeats nowhere.
"""

import numpy as np
from scipy import fft

from toeplitz_mg._typing import Array
from toeplitz_mg.halfspace.bessel import integrate_bessel
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
    shape: tuple[int, ...],
    element: tuple[float, ...],
    directions: str = "zz",
    *,
    G: float,
    nu: float,
) -> Array:
    """Return the displacements by waves on a surface that repeats along all axes.

    Parameters
    ----------
    shape : (int,) or (int, int)
        Elements in a period. One axis is plane strain.
    element : tuple of float
        Their size, mm.
    directions : str
        Of the displacement and of the traction: "zz" is normal; on two axes also "xx", "xy", "yy".
    G, nu : float
        Shear modulus (N/mm²) and Poisson's ratio, for two materials of `combined_material`.

    Returns
    -------
    ndarray of shape (n // 2 + 1,) or (n1, n2 // 2 + 1)
        2/(E*|q|) = 2(1-ν)/(G|q|) of "zz", else 2/(G|q|) (δ_ij - ν q_i q_j/|q|²), mm per N/mm², at
        the wavenumbers of `scipy.fft.rfftn`. It is zero at q = 0: a mean traction moves an infinite
        half-space by any distance, so that displacements are those from their mean.

    Notes
    -----
    The continuous symbol at the wavenumbers of the grid, as `tamaas` and `aspher` have it. The
    highest wave of an even number of elements has no sign, and so does not couple x and y.

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
    waves = wavenumbers(shape, element)
    q = np.sqrt(sum(k**2 for k in waves))
    q.flat[0] = np.inf
    factor = np.array(1.0 - nu)
    if directions != "zz":
        i, j = ("xy".index(direction) for direction in directions)
        factor = float(i == j) - nu * waves[i] * waves[j] / q**2
        if i != j:
            for axis, n in enumerate(shape):
                if n % 2 == 0:
                    factor[(slice(None),) * axis + (n // 2,)] = 0.0
    eigenvalues: Array = 2.0 / (G * q) * factor
    return eigenvalues


def strip_length(n: int) -> int:
    """Return the elements of the circulant that n of them, from end to end, are embedded in."""
    return 2 * fft.next_fast_len(n, real=True) if n > 1 else 1


def strip_eigenvalues(
    shape: tuple[int, int],
    element: tuple[float, float],
    axis: int,
    directions: str = "zz",
    *,
    G: float,
    nu: float,
    reference: float,
) -> Array:
    """Return the eigenvalues of the displacements on a surface that repeats along one axis.

    Parameters
    ----------
    shape : (int, int)
        Elements in a period, and from end to end.
    element : (float, float)
        Their size, mm.
    axis : int
        The one that repeats, 0 or 1.
    directions : str
        Of the displacement and of the traction: "zz", "xx", "xy" or "yy".
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
    A wave of wavenumber q along the axis moves what lies at the distance t across it by 2/(πG)
    times K₀ - ν q|t| K₁ along the axis, (1-ν) K₀ + ν q|t| K₁ across, (1-ν) K₀ normal to the
    surface, and -iν q t K₀ from along to across (K₀, K₁ are the modified Bessel functions of q|t|):
    the Fourier integrals across the axis of the symbol. They are integrated over the width of an
    element, to rounding. The mean is that of plane strain, along the axis of antiplane shear.

    Examples
    --------
    >>> from toeplitz_mg.halfspace.periodic import strip_eigenvalues
    >>> strip_eigenvalues((4, 3), (0.25, 0.5), 0, G=1.0, nu=0.3, reference=6.0).shape
    (4, 4)
    """
    G, nu = check_constants(G, nu)
    other = 1 - axis
    n, h = shape[other], element[other]
    # The waves of both signs are alike.
    waves = 2.0 * np.pi * fft.rfftfreq(shape[axis], element[axis])
    is_along = directions == 2 * "xy"[axis]
    is_odd = directions == "xy"
    if is_odd:
        weights = {"s_k0": -nu}
    elif directions == "zz":
        weights = {"k0": 1.0 - nu}
    else:
        weights = {"k0": 1.0, "s_k1": -nu} if is_along else {"k0": 1.0 - nu, "s_k1": nu}
    embedded = np.zeros((len(waves), strip_length(n)))
    embedded[1:, :n] = integrate_bessel(waves[1:] * h, n, **weights)
    embedded[1:, :n] *= 2.0 / (np.pi * G) / waves[1:, None]
    if is_odd and shape[axis] % 2 == 0:
        embedded[-1] = 0.0
    if not is_odd:
        embedded[0, :n] = line_contact_coefficients(
            n, h, G=G, nu=0.0 if is_along else nu, reference=reference
        )
    if n > 1:
        embedded[:, 1 - n :] = (-1.0 if is_odd else 1.0) * embedded[:, n - 1 : 0 : -1]
    hat = fft.rfft(embedded)
    # Of what is odd the transform is imaginary, and the wave along the axis a factor i away.
    quarter = -hat.imag if is_odd else hat.real
    quarter = quarter if axis == 0 else quarter.T
    length = shape[0] if axis == 0 else embedded.shape[1]
    eigenvalues = np.empty((length, quarter.shape[1]))
    eigenvalues[: len(quarter)] = quarter
    behind = length - len(quarter)
    eigenvalues[len(quarter) :] = (-1.0 if is_odd else 1.0) * quarter[behind:0:-1]
    return eigenvalues
