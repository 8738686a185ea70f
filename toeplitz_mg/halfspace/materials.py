"""Elastic constants: of one body, and combined of two in contact."""

from typing import Any, NamedTuple

from toeplitz_mg.values import positive, real, refuse_masked


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
    (G1, nu1), (G2, nu2) = _check_body(first), _check_body(second)
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
    (G1, nu1), (G2, nu2) = _check_body(first), _check_body(second)
    G = 2.0 / (1.0 / G1 + 1.0 / G2)
    return G / 4.0 * ((1.0 - 2.0 * nu1) / G1 - (1.0 - 2.0 * nu2) / G2)


def _check_body(material: Any) -> Material:
    """Return the constants of a body, as the user gave them."""
    try:
        G, nu = material
    except (TypeError, ValueError):
        raise TypeError(f"material is {material!r}, but must be (G, nu)") from None
    checked = check_material(G, nu)
    refuse_masked("material", material)
    return checked


def check_material(G: float, nu: float) -> Material:
    """Return the two constants, or say which of them no elastic body has."""
    G, nu = positive("G", G), real("nu", nu)
    if not -1.0 < nu <= 0.5:
        raise ValueError(f"nu is {nu}, but Poisson's ratio lies in (-1, 0.5]")
    return Material(G, nu)


def check_difference(K: float) -> float:
    """Return a difference parameter, or say that no two bodies have it."""
    K = real("K", K)
    # The largest, ½ (1-2ν), is that of a body on a rigid one.
    if not -1.5 < K < 1.5:
        raise ValueError(f"K is {K}, but a difference parameter lies in (-1.5, 1.5)")
    return K
