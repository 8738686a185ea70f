"""Influence coefficients of plane strain: strips of infinite length."""

import numpy as np
from scipy.linalg import toeplitz

from toeplitz_mg._typing import Array
from toeplitz_mg.halfspace.integrals import integral_log
from toeplitz_mg.halfspace.materials import check_constants
from toeplitz_mg.values import count, positive

FEW = 200  # Most strips whose eigenvalues are computed where their sign is in doubt.


def line_contact_coefficients(n: int, h: float, *, G: float, nu: float, reference: float) -> Array:
    """Return the plane-strain coefficients of n strips of width h, of infinite length.

    Normal or tangential: ``u(x) = 2(1-ν)/(πG) ∫ p(ξ) ln(d/|x-ξ|) dξ``, for two bodies.

    Parameters
    ----------
    n : int
        Number of strips.
    h : float
        Width of a strip, mm.
    G, nu : float
        Shear modulus (N/mm²) and Poisson's ratio, for two materials of `combined_material`.
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

    See Also
    --------
    influence_xx : of rectangles that are not long.

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
    # Below the capacity only a few strips may still be positive definite.
    if d <= n * h / 4.0 and (n > FEW or np.linalg.eigvalsh(toeplitz(logarithm))[0] <= 0.0):
        raise ValueError(
            f"reference is {d:g}, but must exceed the logarithmic capacity n h/4 = {n * h / 4:g} "
            "of the contact area for the matrix to be positive definite"
        )
    logarithm *= 2.0 * (1.0 - nu) / (np.pi * G) * h
    return logarithm
