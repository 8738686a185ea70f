"""Influence coefficients of the elastic half-space.

They are the displacement differences of two bodies at the points (x, y) of the surface by a unit
traction on the rectangular element of size h₁ × h₂ centred on the origin, after Boussinesq (normal)
and Cerruti (tangential). With ρ the distance to the loaded point (paper, §2.3; Johnson, Contact
Mechanics, §3.2 and §3.6; Kalker, Three-Dimensional Elastic Bodies in Rolling Contact, §1.6):

    A_zz = 1/(πG) ∬ (1-ν)/ρ                    A_xx = 1/(πG) ∬ [(1-ν)/ρ + ν x²/ρ³]
    A_xy = 1/(πG) ∬ ν x y/ρ³                   A_yy = 1/(πG) ∬ [(1-ν)/ρ + ν y²/ρ³]

If the materials differ, K of `difference_parameter` couples the normal and the tangential
directions. The sign matters here: x and y go from the loaded point to the other point.

    A_xz = -A_zx = -K/(πG) ∬ x/ρ²              A_yz = -A_zy = -K/(πG) ∬ y/ρ²

Differences are those of the first body minus the second; z points into the first. Lengths are in mm
and moduli in N/mm², or in any other consistent units.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import toeplitz

from toeplitz_mg._typing import Array
from toeplitz_mg.halfspace.integrals import ONE, XX, XY, Kernel, X, integral_log
from toeplitz_mg.halfspace.materials import check_constants, check_difference
from toeplitz_mg.halfspace.rectangles import integrate
from toeplitz_mg.values import count, positive, refuse_masked, require_broadcast

FEW = 200  # Most strips for which eigenvalues are computed if their sign is in doubt.


class Component(NamedTuple):
    """The kernel that is integrated over an element for a pair of directions.

    Attributes
    ----------
    kernel : function
        Returns the weights of the monomials, in units of 1/(πG), for a value of the constant.
    constant : str
        "nu", or "K" for the coupling of unequal materials.
    parity : (int, int)
        Whether it is even (1) or odd (-1) in x and in y.
    is_exchanged : bool
        Whether x and y are exchanged in the monomials.
    """

    kernel: Callable[[float], Kernel]
    constant: str
    parity: tuple[int, int]
    is_exchanged: bool = False


def _along(nu: float) -> Kernel:
    return {ONE: 1.0 - nu, XX: nu}


def _coupling(K: float) -> Kernel:
    return {X: -K}


# The blocks on and above the diagonal.
KERNELS = {
    "xx": Component(_along, "nu", (1, 1)),
    "xy": Component(lambda nu: {XY: nu}, "nu", (-1, -1)),
    "xz": Component(_coupling, "K", (-1, 1)),
    "yy": Component(_along, "nu", (1, 1), is_exchanged=True),
    "yz": Component(_coupling, "K", (1, -1), is_exchanged=True),
    "zz": Component(lambda nu: {ONE: 1.0 - nu}, "nu", (1, 1)),
}


def influence(
    name: str,
    x: ArrayLike,
    y: ArrayLike,
    element: tuple[float, float],
    *,
    G: float,
    nu: float = 0.0,
    K: float = 0.0,
) -> Array:
    """Return the displacement in one direction by a unit traction in another, for example "zz"."""
    component = KERNELS[name]
    G, nu = check_constants(G, nu)
    constant = check_difference(K) if component.constant == "K" else nu
    h1, h2 = check_element(element)
    x, y = require_broadcast(x=_points("x", x), y=_points("y", y))
    weights = {part: weight / (np.pi * G) for part, weight in component.kernel(constant).items()}
    if component.is_exchanged:
        return integrate(weights, y, x, h2, h1)
    return integrate(weights, x, y, h1, h2)


def influence_zz(
    x: ArrayLike, y: ArrayLike, element: tuple[float, float], *, G: float, nu: float
) -> Array:
    """Return the normal displacement by a unit pressure on an element (Boussinesq).

    Parameters
    ----------
    x, y : array_like
        Points on the surface relative to the centre of the element, mm; they broadcast.
    element : (float, float)
        Element size h₁ × h₂, mm, of any ratio.
    G, nu : float
        Shear modulus (N/mm²) and Poisson's ratio; for two materials those of `combined_material`.

    Returns
    -------
    ndarray of float64
        Displacement difference of the two bodies, mm per N/mm², with a relative error of some
        1e-14.

    Raises
    ------
    ValueError
        If a modulus or an element size is not positive, Poisson's ratio is outside (-1, 0.5], or a
        point is not finite.
    TypeError
        If an argument is not a real number.

    See Also
    --------
    influence_xx, influence_yy, influence_xy : tangential displacements by tangential tractions.
    influence_xz, influence_yz : tangential displacements by a pressure, for unequal materials.
    influence_matrix : the matrix for any directions.
    offsets : the points of the coefficients of a matrix.

    Examples
    --------
    >>> from toeplitz_mg import halfspace
    >>> float(halfspace.influence_zz(0.0, 0.0, (1.0, 1.0), G=1.0, nu=0.0).round(6))
    1.1222
    """
    return influence("zz", x, y, element, G=G, nu=nu)


def influence_xx(
    x: ArrayLike, y: ArrayLike, element: tuple[float, float], *, G: float, nu: float
) -> Array:
    """Return the displacement along x by a unit traction along x on an element (Cerruti).

    This is the kernel of the paper, with elements of 8/n × 100 mm.

    See Also
    --------
    influence_zz : describes the arguments, the result and the errors.
    influence_matrix : the matrix for any directions.

    Examples
    --------
    >>> from toeplitz_mg import halfspace
    >>> float(halfspace.influence_xx(0.0, 0.0, (1.0, 1.0), G=1.0, nu=0.3).round(6))
    0.95387
    """
    return influence("xx", x, y, element, G=G, nu=nu)


def influence_yy(
    x: ArrayLike, y: ArrayLike, element: tuple[float, float], *, G: float, nu: float
) -> Array:
    """Return the displacement along y by a unit traction along y on an element (Cerruti).

    It is `influence_xx` with x and y exchanged.

    See Also
    --------
    influence_zz : describes the arguments, the result and the errors.
    influence_matrix : the matrix for any directions.

    Examples
    --------
    >>> from toeplitz_mg import halfspace
    >>> float(halfspace.influence_yy(0.0, 0.0, (1.0, 1.0), G=1.0, nu=0.3).round(6))
    0.95387
    """
    return influence("yy", x, y, element, G=G, nu=nu)


def influence_xy(
    x: ArrayLike, y: ArrayLike, element: tuple[float, float], *, G: float, nu: float
) -> Array:
    """Return the displacement along x by a unit traction along y, or along y by one along x.

    It is odd in x and in y: use `all_offsets` and `ToeplitzOperator.from_lags` for the operator.

    See Also
    --------
    influence_zz : describes the arguments, the result and the errors.
    influence_matrix : the matrix for any directions.

    Examples
    --------
    >>> from toeplitz_mg import halfspace
    >>> float(halfspace.influence_xy(1.0, 1.0, (1.0, 1.0), G=1.0, nu=0.3).round(6))
    0.03188
    """
    return influence("xy", x, y, element, G=G, nu=nu)


def influence_xz(
    x: ArrayLike, y: ArrayLike, element: tuple[float, float], *, G: float, K: float
) -> Array:
    """Return the displacement along x by a unit pressure on an element, for unequal materials.

    The displacement is that of the first body minus that of the second; K is their
    `difference_parameter`, in (-1.5, 1.5).

    The surface of a compressible body moves towards the load, so a coefficient has the sign of
    -K x. It is odd in x and even in y: use `all_offsets` and `ToeplitzOperator.from_lags` for the
    operator. By reciprocity the normal displacement by a unit traction along x is A_zx = -A_xz, the
    transpose of the operator: the matrix of all three directions is symmetric.

    See Also
    --------
    influence_zz : describes the arguments, the result and the errors.
    influence_matrix : the matrix for any directions.

    Examples
    --------
    >>> from toeplitz_mg import halfspace
    >>> float(halfspace.influence_xz(1.0, 0.0, (1.0, 1.0), G=1.0, K=0.1).round(6))
    -0.03134
    """
    return influence("xz", x, y, element, G=G, K=K)


def influence_yz(
    x: ArrayLike, y: ArrayLike, element: tuple[float, float], *, G: float, K: float
) -> Array:
    """Return the displacement along y by a unit pressure on an element, for unequal materials.

    It is `influence_xz` with x and y exchanged: odd in y, even in x, and A_zy = -A_yz.

    See Also
    --------
    influence_zz : describes the arguments, the result and the errors.
    influence_matrix : the matrix for any directions.

    Examples
    --------
    >>> from toeplitz_mg import halfspace
    >>> float(halfspace.influence_yz(0.0, 1.0, (1.0, 1.0), G=1.0, K=0.1).round(6))
    -0.03134
    """
    return influence("yz", x, y, element, G=G, K=K)


def line_contact_coefficients(n: int, h: float, *, G: float, nu: float, reference: float) -> Array:
    """Return the plane-strain coefficients of n infinitely long strips of width h.

    They hold for normal and for tangential contact of two bodies:
    ``u(x) = 2(1-ν)/(πG) ∫ p(ξ) ln(d/|x-ξ|) dξ``.

    Parameters
    ----------
    n : int
        Number of strips.
    h : float
        Width of a strip, mm.
    G, nu : float
        Shear modulus (N/mm²) and Poisson's ratio; for two materials those of `combined_material`.
    reference : float
        The distance d at which a line load causes no displacement, mm. Plane strain determines
        displacements up to a constant only.

    Returns
    -------
    ndarray of shape (n,)
        First column of the matrix, mm per N/mm².

    Raises
    ------
    ValueError
        If `reference` is so small that the matrix is indefinite. The limit is the logarithmic
        capacity n h/4 of the contact area, or for up to 200 strips the slightly smaller value at
        which an eigenvalue is zero. Also if n, h, G or the reference is not positive, or nu is
        outside (-1, 0.5].
    TypeError
        If n is not an integer, or another argument is not a real number.

    See Also
    --------
    influence_xx : for rectangular elements.

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
    G, nu = check_constants(G, nu)
    n, h = count("n", n), positive("h", h)
    d = positive("reference", reference)
    integral = integral_log(n)
    logarithm = np.subtract(np.log(d / h), integral, out=integral)
    # Below the capacity the matrix can be positive definite for a few strips only.
    if d <= n * h / 4.0 and (n > FEW or np.linalg.eigvalsh(toeplitz(logarithm))[0] <= 0.0):
        raise ValueError(
            f"reference is {d:g}, but must exceed the logarithmic capacity n h/4 = {n * h / 4:g} "
            "of the contact area for the matrix to be positive definite"
        )
    logarithm *= 2.0 * (1.0 - nu) / (np.pi * G) * h
    return logarithm


def offsets(grid_shape: tuple[int, int], element: tuple[float, float]) -> tuple[Array, Array]:
    """Return the points at which to evaluate coefficients that are even in x and in y.

    Pass such coefficients to ``ToeplitzOperator(c)``. For others use `all_offsets` and
    ``ToeplitzOperator.from_lags(lags)``.

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
        If the grid has no elements, or an element size is not positive.
    TypeError
        If numbers of elements are not integers, or sizes are not real numbers.

    See Also
    --------
    all_offsets : the points in all quadrants.
    influence_matrix : the matrix itself.

    Examples
    --------
    >>> import toeplitz_mg as tmg
    >>> x, y = tmg.halfspace.offsets((32, 16), (0.25, 0.5))
    >>> A = tmg.ToeplitzOperator(
    ...     tmg.halfspace.influence_zz(x, y, (0.25, 0.5), G=82000.0, nu=0.28)
    ... )
    >>> A.grid_shape
    (32, 16)
    """
    h1, h2 = check_element(element)
    n1, n2 = _grid(grid_shape)
    return h1 * np.arange(n1)[:, None], h2 * np.arange(n2)[None, :]


def all_offsets(grid_shape: tuple[int, int], element: tuple[float, float]) -> tuple[Array, Array]:
    """Return the points at which to evaluate all coefficients, including negative lags.

    Pass the coefficients to ``ToeplitzOperator.from_lags(lags)``. The arguments and errors are
    those of `offsets`.

    Returns
    -------
    x, y : ndarray of shape (2 n₁ - 1, 1) and (1, 2 n₂ - 1)
        i h₁ and j h₂, i = -(n₁ - 1) … n₁ - 1, j = -(n₂ - 1) … n₂ - 1.

    See Also
    --------
    offsets : the points in one quadrant, for even coefficients.
    influence_matrix : the matrix itself.

    Examples
    --------
    >>> import toeplitz_mg as tmg
    >>> x, y = tmg.halfspace.all_offsets((3, 2), (1.0, 1.0))
    >>> a_xy = tmg.halfspace.influence_xy(x, y, (1.0, 1.0), G=1.0, nu=0.3)
    >>> tmg.ToeplitzOperator.from_lags(a_xy).grid_shape
    (3, 2)
    """
    h1, h2 = check_element(element)
    n1, n2 = _grid(grid_shape)
    return h1 * np.arange(1 - n1, n1)[:, None], h2 * np.arange(1 - n2, n2)[None, :]


def check_element(element: tuple[float, float]) -> tuple[float, float]:
    """Return the two sizes of an element; raise an error if they are not valid."""
    if refuse_masked("element", element).shape != (2,):
        raise ValueError(f"element is {element}, but must have the two sizes h1 and h2")
    return positive("element[0]", element[0]), positive("element[1]", element[1])


def _grid(grid_shape: tuple[int, int]) -> tuple[int, int]:
    if refuse_masked("grid_shape", grid_shape).shape != (2,):
        raise ValueError(f"grid_shape is {grid_shape}, but must have the two axes x and y")
    return count("grid_shape[0]", grid_shape[0]), count("grid_shape[1]", grid_shape[1])


def _points(name: str, values: ArrayLike) -> Array:
    array = refuse_masked(name, values)
    if array.dtype.kind not in "buif":
        raise TypeError(f"{name} has dtype {array.dtype}, but must have real numbers")
    array = array.astype(np.float64, copy=False)
    if not np.isfinite(array).all():
        raise ValueError(f"{name} has coordinates that are not finite, but all must be")
    return array
