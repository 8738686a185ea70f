"""Influence coefficients of the elastic half-space: pure functions, arrays out.

Displacement differences of two bodies at the points (x, y) of the surface, by a unit traction on
the rectangular element of size h₁ × h₂ that is centred on the origin, after Boussinesq (normal)
and Cerruti (tangential). With ρ the distance to the loaded point (paper, §2.3; Johnson, Contact
Mechanics, §3.2 and §3.6; Kalker, Three-Dimensional Elastic Bodies in Rolling Contact, §1.6):

    A_zz = 1/(πG) ∬ (1-ν)/ρ                    A_xx = 1/(πG) ∬ [(1-ν)/ρ + ν x²/ρ³]
    A_xy = 1/(πG) ∬ ν x y/ρ³                   A_yy = 1/(πG) ∬ [(1-ν)/ρ + ν y²/ρ³]

The normal and the tangential directions are coupled where the materials differ, by K of
`difference_parameter`; here the sign counts, and x and y go from the loaded point to the other:

    A_xz = -A_zx = -K/(πG) ∬ x/ρ²              A_yz = -A_zy = -K/(πG) ∬ y/ρ²

Differences are of the first body less the second, z points into the first.

Lengths are in mm and moduli in N/mm², or in any other consistent units.
"""

import numpy as np
from numpy.typing import ArrayLike

from toeplitz_mg._typing import Array
from toeplitz_mg.halfspace.expansion import Kernel
from toeplitz_mg.halfspace.integrals import ONE, XX, XY, X
from toeplitz_mg.halfspace.materials import check_constants, check_difference
from toeplitz_mg.halfspace.points import check_element
from toeplitz_mg.halfspace.rectangles import integrate
from toeplitz_mg.values import positive, refuse_masked, require_broadcast


def influence_zz(
    x: ArrayLike, y: ArrayLike, element: tuple[float, float], *, G: float, nu: float
) -> Array:
    """Return the normal displacement by a unit pressure on an element (Boussinesq).

    Parameters
    ----------
    x, y : array_like
        Points on the surface, relative to the element's centre, mm; broadcast.
    element : (float, float)
        Its size h₁ × h₂, mm; any ratio.
    G, nu : float
        Shear modulus (N/mm²) and Poisson's ratio, for two materials of `combined_material`.

    Returns
    -------
    ndarray of float64
        mm per N/mm², for both bodies together, to a relative error of some 1e-14.

    Raises
    ------
    ValueError
        For a modulus or an element that is not positive, a Poisson's ratio outside (-1, 0.5], or
        points that are not finite.
    TypeError
        For what is no real number.

    See Also
    --------
    influence_xz : for other directions.
    influence_xx : for other directions.
    influence_matrix : the matrix of any directions.
    offsets : where the coefficients are wanted.

    Examples
    --------
    >>> from toeplitz_mg import halfspace
    >>> float(halfspace.influence_zz(0.0, 0.0, (1.0, 1.0), G=1.0, nu=0.0).round(6))
    1.1222
    """
    G, nu = check_constants(G, nu)
    return _displacement({ONE: 1.0 - nu}, x, y, element, G)


def influence_xx(
    x: ArrayLike, y: ArrayLike, element: tuple[float, float], *, G: float, nu: float
) -> Array:
    """Return the displacement along x by a unit traction along x on an element (Cerruti).

    Parameters
    ----------
    x, y : array_like
        Points on the surface, relative to the element's centre, mm; broadcast.
    element : (float, float)
        Its size h₁ × h₂, mm; any ratio.
    G, nu : float
        Shear modulus (N/mm²) and Poisson's ratio, for two materials of `combined_material`.

    Returns
    -------
    ndarray of float64
        mm per N/mm², for both bodies together, to a relative error of some 1e-14.

    Raises
    ------
    ValueError, TypeError
        For arguments that `influence_zz` refuses.

    See Also
    --------
    influence_xy : for other directions.
    influence_yy : for other directions.
    influence_matrix : the matrix of any directions.
    offsets : where the coefficients are wanted.

    Notes
    -----
    This is the kernel of the paper, whose elements are 8/n × 100 mm.

    Examples
    --------
    >>> from toeplitz_mg import halfspace
    >>> float(halfspace.influence_xx(0.0, 0.0, (1.0, 1.0), G=1.0, nu=0.3).round(6))
    0.95387
    """
    G, nu = check_constants(G, nu)
    return _displacement({ONE: 1.0 - nu, XX: nu}, x, y, element, G)


def influence_yy(
    x: ArrayLike, y: ArrayLike, element: tuple[float, float], *, G: float, nu: float
) -> Array:
    """Return the displacement along y by a unit traction along y on an element (Cerruti).

    Parameters
    ----------
    x, y : array_like
        Points on the surface, relative to the element's centre, mm; broadcast.
    element : (float, float)
        Its size h₁ × h₂, mm; any ratio.
    G, nu : float
        Shear modulus (N/mm²) and Poisson's ratio, for two materials of `combined_material`.

    Returns
    -------
    ndarray of float64
        mm per N/mm², for both bodies together, to a relative error of some 1e-14.

    Raises
    ------
    ValueError, TypeError
        For arguments that `influence_zz` refuses.

    See Also
    --------
    influence_xx : for other directions.
    influence_xy : for other directions.
    influence_matrix : the matrix of any directions.
    offsets : where the coefficients are wanted.

    Examples
    --------
    >>> from toeplitz_mg import halfspace
    >>> float(halfspace.influence_yy(0.0, 0.0, (1.0, 1.0), G=1.0, nu=0.3).round(6))
    0.95387
    """
    G, nu = check_constants(G, nu)
    return _displacement({ONE: 1.0 - nu, XX: nu}, x, y, element, G, exchanged=True)


def influence_xy(
    x: ArrayLike, y: ArrayLike, element: tuple[float, float], *, G: float, nu: float
) -> Array:
    """Return the displacement along x by a unit traction along y, or the other way round.

    Parameters
    ----------
    x, y : array_like
        Points on the surface, relative to the element's centre, mm; broadcast.
    element : (float, float)
        Its size h₁ × h₂, mm; any ratio.
    G, nu : float
        Shear modulus (N/mm²) and Poisson's ratio, for two materials of `combined_material`.

    Returns
    -------
    ndarray of float64
        mm per N/mm², for both bodies together, to a relative error of some 1e-14.

    Raises
    ------
    ValueError, TypeError
        For arguments that `influence_zz` refuses.

    See Also
    --------
    influence_xx : for other directions.
    influence_yy : for other directions.
    influence_matrix : the matrix of any directions.
    offsets : where the coefficients are wanted.

    Notes
    -----
    It is odd in x and in y: build the operator from `all_offsets`, by `ToeplitzOperator.from_lags`.

    Examples
    --------
    >>> from toeplitz_mg import halfspace
    >>> float(halfspace.influence_xy(1.0, 1.0, (1.0, 1.0), G=1.0, nu=0.3).round(6))
    0.03188
    """
    G, nu = check_constants(G, nu)
    return _displacement({XY: nu}, x, y, element, G)


def influence_xz(
    x: ArrayLike, y: ArrayLike, element: tuple[float, float], *, G: float, K: float
) -> Array:
    """Return the displacement along x by a unit pressure on an element, of unequal materials.

    Parameters
    ----------
    x, y : array_like
        Points on the surface, relative to the element's centre, mm; broadcast.
    element : (float, float)
        Its size h₁ × h₂, mm; any ratio.
    G : float
        Shear modulus of `combined_material`, N/mm².
    K : float
        The `difference_parameter` of the two materials.

    Returns
    -------
    ndarray of float64
        mm per N/mm², of the first body less that of the second, to a relative error of some 1e-14.

    Raises
    ------
    ValueError
        For a modulus or an element that is not positive, a difference parameter outside
        (-1.5, 1.5), or points that are not finite.
    TypeError
        For what is no real number.

    See Also
    --------
    influence_yz : for other directions.
    influence_zz : for other directions.
    influence_matrix : the matrix of any directions.
    offsets : where the coefficients are wanted.

    Notes
    -----
    The surface of a compressible body moves towards the load, so a coefficient has the sign of
    -K x. It is odd in x and even in y: build the operator from `all_offsets`, by
    `ToeplitzOperator.from_lags`. By reciprocity a unit traction along x displaces in the normal
    direction by A_zx = -A_xz, which is the operator's transpose: the matrix of all three
    directions is symmetric.

    Examples
    --------
    >>> from toeplitz_mg import halfspace
    >>> float(halfspace.influence_xz(1.0, 0.0, (1.0, 1.0), G=1.0, K=0.1).round(6))
    -0.03134
    """
    G, K = positive("G", G), check_difference(K)
    return _displacement({X: -K}, x, y, element, G)


def influence_yz(
    x: ArrayLike, y: ArrayLike, element: tuple[float, float], *, G: float, K: float
) -> Array:
    """Return the displacement along y by a unit pressure on an element, of unequal materials.

    Parameters
    ----------
    x, y : array_like
        Points on the surface, relative to the element's centre, mm; broadcast.
    element : (float, float)
        Its size h₁ × h₂, mm; any ratio.
    G : float
        Shear modulus of `combined_material`, N/mm².
    K : float
        The `difference_parameter` of the two materials.

    Returns
    -------
    ndarray of float64
        mm per N/mm², of the first body less that of the second, to a relative error of some 1e-14.

    Raises
    ------
    ValueError
        For a modulus or an element that is not positive, a difference parameter outside
        (-1.5, 1.5), or points that are not finite.
    TypeError
        For what is no real number.

    See Also
    --------
    influence_xz : for other directions.
    influence_zz : for other directions.
    influence_matrix : the matrix of any directions.
    offsets : where the coefficients are wanted.

    Notes
    -----
    This is `influence_xz` with x and y exchanged: odd in y, even in x, and A_zy = -A_yz.

    Examples
    --------
    >>> from toeplitz_mg import halfspace
    >>> float(halfspace.influence_yz(0.0, 1.0, (1.0, 1.0), G=1.0, K=0.1).round(6))
    -0.03134
    """
    G, K = positive("G", G), check_difference(K)
    return _displacement({X: -K}, x, y, element, G, exchanged=True)


def _displacement(
    kernel: Kernel,
    x: ArrayLike,
    y: ArrayLike,
    element: tuple[float, float],
    G: float,
    *,
    exchanged: bool = False,
) -> Array:
    """Return 1/(πG) times the integral of a kernel, in which x and y may be exchanged."""
    h1, h2 = check_element(element)
    x, y = require_broadcast(x=_points("x", x), y=_points("y", y))
    weights = {monomial: weight / (np.pi * G) for monomial, weight in kernel.items()}
    return integrate(weights, y, x, h2, h1) if exchanged else integrate(weights, x, y, h1, h2)


def _points(name: str, values: ArrayLike) -> Array:
    array = refuse_masked(name, values)
    if array.dtype.kind not in "buif":
        raise TypeError(f"{name} has dtype {array.dtype}, but coordinates are real numbers")
    array = array.astype(np.float64, copy=False)
    if not np.isfinite(array).all():
        raise ValueError(f"{name} has coordinates that are not finite")
    return array
