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

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import toeplitz

from toeplitz_mg import rectangle
from toeplitz_mg.values import count, positive, real, unmasked

Array = NDArray[Any]
Pair = tuple[Array, Array]

FEW = 200  # strips of a line contact, whose eigenvalues are computed where in doubt


class Material(NamedTuple):
    """Elastic constants: of a body, or combined of two.

    Attributes
    ----------
    G : float
        Shear modulus, N/mm².
    nu : float
        Poisson's ratio.
    """

    G: float
    nu: float


class CombinedMaterial(Material):
    """Elastic constants combined of two unlike bodies: a pair (G, nu), and how unlike they are.

    Attributes
    ----------
    difference : float
        Their `difference_parameter`. It couples the normal and the tangential problem.
    """

    difference: float = 0.0


def combined_material(first: Material, second: Material) -> Material:
    """Combine the constants of two bodies in contact: 1/G and ν/G are averaged.

    Parameters
    ----------
    first, second : Material or (G, nu)

    Returns
    -------
    Material
        1/G = ½ (1/G₁ + 1/G₂), ν/G = ½ (ν₁/G₁ + ν₂/G₂). Where the materials are equal, theirs.
        Where normal and tangential problems are coupled, a `CombinedMaterial`, that says how much.

    Raises
    ------
    ValueError
        For a shear modulus that is not positive or a Poisson's ratio outside (-1, 0.5].
    TypeError
        For what is not two real numbers.

    Notes
    -----
    Normal and tangential problems of different materials are coupled besides, in proportion to
    their `difference_parameter`, by `influence_xz` and `influence_yz`.

    Examples
    --------
    >>> from toeplitz_mg import halfspace
    >>> halfspace.combined_material((82000.0, 0.28), (82000.0, 0.28))
    Material(G=82000.0, nu=0.28)
    """
    (G1, nu1), (G2, nu2) = _body(first), _body(second)
    G = 2.0 / (1.0 / G1 + 1.0 / G2)
    nu = G / 2.0 * (nu1 / G1 + nu2 / G2)
    if (K := difference_parameter(first, second)) == 0.0:
        return Material(G, nu)
    combined = CombinedMaterial(G, nu)
    combined.difference = K
    return combined


def difference_parameter(first: Material, second: Material) -> float:
    """Return the parameter of the coupling between normal and tangential problems.

    Parameters
    ----------
    first, second : Material or (G, nu)

    Returns
    -------
    float
        K = ¼ G ((1-2ν₁)/G₁ - (1-2ν₂)/G₂), with the G of `combined_material`. Zero where the
        materials are equal, or both incompressible; of the other sign where they change places.

    Raises
    ------
    ValueError
        For a shear modulus that is not positive or a Poisson's ratio outside (-1, 0.5].
    TypeError
        For what is not two real numbers.

    Examples
    --------
    >>> from toeplitz_mg import halfspace
    >>> halfspace.difference_parameter((82000.0, 0.28), (82000.0, 0.28))
    0.0
    >>> round(halfspace.difference_parameter((1.0, 0.25), (82000.0, 0.28)), 6)
    0.249994
    """
    (G1, nu1), (G2, nu2) = _body(first), _body(second)
    G = 2.0 / (1.0 / G1 + 1.0 / G2)
    return G / 4.0 * ((1.0 - 2.0 * nu1) / G1 - (1.0 - 2.0 * nu2) / G2)


def lags(grid_shape: tuple[int, int], element: tuple[float, float]) -> Pair:
    """Return the points of the first column of a matrix that is symmetric in both levels.

    They go with ``ToeplitzOperator(c)``, for coefficients that are even in x and in y; those of
    `all_lags` go with ``ToeplitzOperator.from_lags(lags)``, for any.

    Parameters
    ----------
    grid_shape : (int, int)
        n₁ × n₂ elements.
    element : (float, float)
        Size h₁ × h₂ of an element.

    Returns
    -------
    x, y : ndarray of shape (n₁, 1) and (1, n₂)
        The centres i h₁ and j h₂, i = 0 … n₁ - 1, j = 0 … n₂ - 1.

    Raises
    ------
    ValueError
        For a grid without elements, or an element whose size is not positive.
    TypeError
        For numbers of elements that are not integers, or sizes that are not real numbers.

    Examples
    --------
    >>> import toeplitz_mg as tmg
    >>> x, y = tmg.halfspace.lags((32, 16), (0.25, 0.5))
    >>> A = tmg.ToeplitzOperator(
    ...     tmg.halfspace.influence_zz(x, y, (0.25, 0.5), G=82000.0, nu=0.28)
    ... )
    >>> A.grid_shape
    (32, 16)

    A_xy is odd, and needs the negative lags too:

    >>> x, y = tmg.halfspace.all_lags((32, 16), (0.25, 0.5))
    >>> A_xy = tmg.ToeplitzOperator.from_lags(
    ...     tmg.halfspace.influence_xy(x, y, (0.25, 0.5), G=82000.0, nu=0.28)
    ... )
    >>> A_xy.grid_shape
    (32, 16)
    """
    h1, h2 = _element(element)
    n1, n2 = _grid(grid_shape)
    return h1 * np.arange(n1)[:, None], h2 * np.arange(n2)[None, :]


def all_lags(grid_shape: tuple[int, int], element: tuple[float, float]) -> Pair:
    """Return the points of all coefficients, negative lags too.

    They go with ``ToeplitzOperator.from_lags(lags)``, for any coefficients, such as A_xy; those of
    `lags` go with ``ToeplitzOperator(c)``, for coefficients that are even in x and in y.

    Parameters
    ----------
    grid_shape : (int, int)
        n₁ × n₂ elements.
    element : (float, float)
        Size h₁ × h₂ of an element.

    Returns
    -------
    x, y : ndarray of shape (2 n₁ - 1, 1) and (1, 2 n₂ - 1)
        i h₁ and j h₂, i = -(n₁ - 1) … n₁ - 1, j = -(n₂ - 1) … n₂ - 1.

    Raises
    ------
    ValueError
        For a grid without elements, or an element whose size is not positive.
    TypeError
        For numbers of elements that are not integers, or sizes that are not real numbers.

    Examples
    --------
    >>> import toeplitz_mg as tmg
    >>> x, y = tmg.halfspace.all_lags((3, 2), (1.0, 1.0))
    >>> a_xy = tmg.halfspace.influence_xy(x, y, (1.0, 1.0), G=1.0, nu=0.3)
    >>> tmg.ToeplitzOperator.from_lags(a_xy).grid_shape
    (3, 2)
    """
    h1, h2 = _element(element)
    n1, n2 = _grid(grid_shape)
    return h1 * np.arange(1 - n1, n1)[:, None], h2 * np.arange(1 - n2, n2)[None, :]


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

    Examples
    --------
    >>> from toeplitz_mg import halfspace
    >>> float(halfspace.influence_zz(0.0, 0.0, (1.0, 1.0), G=1.0, nu=0.0).round(6))
    1.1222
    """
    G, nu = _material(G, nu)
    one, _, _ = rectangle.integrals(*_at(x, y, element))
    return np.asarray((1.0 - nu) * one / (np.pi * G))


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
        As `influence_zz`.

    Notes
    -----
    This is the kernel of the paper, whose elements are 8/n × 100 mm.

    Examples
    --------
    >>> from toeplitz_mg import halfspace
    >>> float(halfspace.influence_xx(0.0, 0.0, (1.0, 1.0), G=1.0, nu=0.3).round(6))
    0.95387
    """
    G, nu = _material(G, nu)
    one, xx, _ = rectangle.integrals(*_at(x, y, element))
    return np.asarray(((1.0 - nu) * one + nu * xx) / (np.pi * G))


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
        As `influence_zz`.

    Examples
    --------
    >>> from toeplitz_mg import halfspace
    >>> float(halfspace.influence_yy(0.0, 0.0, (1.0, 1.0), G=1.0, nu=0.3).round(6))
    0.95387
    """
    G, nu = _material(G, nu)
    one, _, yy = rectangle.integrals(*_at(x, y, element))
    return np.asarray(((1.0 - nu) * one + nu * yy) / (np.pi * G))


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
        As `influence_zz`.

    Notes
    -----
    It is odd in x and in y: build the operator from `all_lags`, by `ToeplitzOperator.from_lags`.

    Examples
    --------
    >>> from toeplitz_mg import halfspace
    >>> float(halfspace.influence_xy(1.0, 1.0, (1.0, 1.0), G=1.0, nu=0.3).round(6))
    0.03188
    """
    G, nu = _material(G, nu)
    return np.asarray(nu * rectangle.integral_xy(*_at(x, y, element)) / (np.pi * G))


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

    Notes
    -----
    The surface of a compressible body moves towards the load, so a coefficient has the sign of
    -K x. It is odd in x and even in y: build the operator from `all_lags`, by
    `ToeplitzOperator.from_lags`. By reciprocity a unit traction along x displaces in the normal
    direction by A_zx = -A_xz, which is the operator's transpose: the matrix of all three
    directions is symmetric.

    Examples
    --------
    >>> from toeplitz_mg import halfspace
    >>> float(halfspace.influence_xz(1.0, 0.0, (1.0, 1.0), G=1.0, K=0.1).round(6))
    -0.03134
    """
    G, K = positive("G", G), _difference(K)
    return np.asarray(-K * rectangle.integral_x(*_at(x, y, element)) / (np.pi * G))


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

    Notes
    -----
    As `influence_xz`, with x and y exchanged: odd in y, even in x, and A_zy = -A_yz.

    Examples
    --------
    >>> from toeplitz_mg import halfspace
    >>> float(halfspace.influence_yz(0.0, 1.0, (1.0, 1.0), G=1.0, K=0.1).round(6))
    -0.03134
    """
    G, K = positive("G", G), _difference(K)
    x, y, h1, h2 = _at(x, y, element)
    return np.asarray(-K * rectangle.integral_x(y, x, h2, h1) / (np.pi * G))


def line_contact_coefficients(n: int, h: float, *, G: float, nu: float, reference: float) -> Array:
    """Return the plane-strain coefficients of n strips of width h, of infinite length.

    Normal or tangential: u(x) = 2(1-ν)/(πG) ∫ p(ξ) ln(d/|x-ξ|) dξ, for two bodies.

    Parameters
    ----------
    n : int
        Number of strips.
    h : float
        Width of a strip, mm.
    G, nu : float
        As for `influence_zz`.
    reference : float
        The distance d at which a line load moves nothing, mm; the constant that plane strain
        leaves open.

    Returns
    -------
    ndarray of shape (n,)
        First column of the matrix, mm per N/mm².

    Raises
    ------
    ValueError
        Where `reference` is so small that the matrix is indefinite: at most the logarithmic
        capacity n h/4 of the contact area, or, for up to 200 strips, at most the value a little
        below it at which an eigenvalue is zero. Where n, h, G or the reference is not positive,
        or nu outside (-1, 0.5].
    TypeError
        Where n is not an integer, or another argument no real number.

    Notes
    -----
    A constant displacement u has the traction Q/(π√(a²-x²)), a = n h/2, with the force per length
    Q = u πG/(2(1-ν) ln(2d/a)) (Johnson, §2.8).

    Examples
    --------
    >>> from toeplitz_mg import halfspace
    >>> halfspace.line_contact_coefficients(2, 1.0, G=1.0, nu=0.5, reference=1.0).round(6)
    array([0.538945, 0.014397])
    """
    G, nu = _material(G, nu)
    n, h = count("n", n), positive("h", h)
    d = positive("reference", reference)
    logarithm = np.log(d / h) - rectangle.integral_log(np.arange(n, dtype=np.float64))
    # Below the capacity only a few strips may still be positive definite.
    if d <= n * h / 4.0 and (n > FEW or np.linalg.eigvalsh(toeplitz(logarithm))[0] <= 0.0):
        raise ValueError(
            f"reference is {d:g}, but must exceed the logarithmic capacity n h/4 = {n * h / 4:g} "
            "of the contact area for the matrix to be positive definite"
        )
    return np.asarray(2.0 * (1.0 - nu) / (np.pi * G) * h * logarithm)


def _at(
    x: ArrayLike, y: ArrayLike, element: tuple[float, float]
) -> tuple[Array, Array, float, float]:
    """The arguments of the integrals: points, broadcast, and the sizes of the element."""
    x, y = np.broadcast_arrays(_points("x", x), _points("y", y))
    return x, y, *_element(element)


def _points(name: str, values: ArrayLike) -> Array:
    array = unmasked(name, values)
    if array.dtype.kind not in "buif":
        raise TypeError(f"{name} has dtype {array.dtype}, but coordinates are real numbers")
    array = array.astype(np.float64)
    if not np.isfinite(array).all():
        raise ValueError(f"{name} has coordinates that are not finite")
    return array


def _element(element: tuple[float, float]) -> tuple[float, float]:
    if np.shape(element) != (2,):
        raise ValueError(f"element is {element}, but an element has the two sizes h1 and h2")
    return positive("element[0]", element[0]), positive("element[1]", element[1])


def _grid(grid_shape: tuple[int, int]) -> tuple[int, int]:
    if np.shape(grid_shape) != (2,):
        raise ValueError(f"grid_shape is {grid_shape}, but the surface has the two axes x and y")
    return count("grid_shape[0]", grid_shape[0]), count("grid_shape[1]", grid_shape[1])


def _body(material: Any) -> Material:
    """The constants of a body, as the user gave them."""
    try:
        G, nu = material
    except (TypeError, ValueError):
        raise TypeError(f"material is {material!r}, but must be (G, nu)") from None
    return _material(G, nu)


def _material(G: float, nu: float) -> Material:
    G, nu = positive("G", G), real("nu", nu)
    if not -1.0 < nu <= 0.5:
        raise ValueError(f"nu is {nu}, but Poisson's ratio lies in (-1, 0.5]")
    return Material(G, nu)


def _difference(K: float) -> float:
    K = real("K", K)
    # The most, ½ (1-2ν), is that of a body on a rigid one.
    if not -1.5 < K < 1.5:
        raise ValueError(f"K is {K}, but a difference parameter lies in (-1.5, 1.5)")
    return K
