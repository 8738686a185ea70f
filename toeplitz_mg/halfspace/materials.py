"""Elastic constants of one body, and of two bodies in contact."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from numbers import Real
from typing import Any, Self

import numpy as np

from toeplitz_mg.values import positive, real, refuse_masked

ALIKE = 1e-9  # Largest relative difference of equal constants, by rounding.
WANTED = "a contact.Material, or two of them, (first, second)"  # For error messages.


@dataclass(frozen=True, init=False)
class Material:
    """An elastic body: isotropic, homogeneous, and large compared to the contact.

    Parameters
    ----------
    E : float
        Young's modulus, N/mm².
    nu : float
        Poisson's ratio.

    Attributes
    ----------
    G : float
        Shear modulus, N/mm².
    nu : float
    E : float
    E_star : float
        E/(1-ν²), the modulus for contact with a rigid body. For two bodies 1/E* = 1/E₁* + 1/E₂*.

    Raises
    ------
    ValueError
        If a modulus is not positive, or Poisson's ratio is outside (-1, 0.5].
    TypeError
        If an argument is not a real number.

    See Also
    --------
    Material.from_shear : make a material from its shear modulus.
    Material.rigid : make a body that does not deform.

    Examples
    --------
    >>> from toeplitz_mg import contact
    >>> steel = contact.Material(E=210000.0, nu=0.28)
    >>> steel
    Material(E=210000, nu=0.28)
    >>> round(steel.G), round(steel.E_star)
    (82031, 227865)
    """

    G: float
    nu: float

    def __init__(self, *, E: float, nu: float) -> None:
        E, nu = positive("E", E, "N/mm**2"), check_ratio(nu)
        self._set(E / (2.0 * (1.0 + nu)), nu)

    @classmethod
    def from_shear(cls, G: float, nu: float) -> Self:
        """Return the material with a given shear modulus and Poisson's ratio.

        Parameters
        ----------
        G : float
            Shear modulus, N/mm².
        nu : float
            Poisson's ratio.

        Returns
        -------
        Material

        Raises
        ------
        ValueError, TypeError
            As for `Material`.

        Examples
        --------
        >>> from toeplitz_mg import contact
        >>> contact.Material.from_shear(82000.0, 0.28)
        Material(E=209920, nu=0.28)
        """
        return cls._of(positive("G", G, "N/mm**2"), check_ratio(nu))

    @classmethod
    def rigid(cls) -> Self:
        """Return a body that does not deform; only one of the two bodies may be rigid.

        Returns
        -------
        Material
            With infinite moduli.

        Examples
        --------
        >>> from toeplitz_mg import contact
        >>> contact.Material.rigid().E_star
        inf
        """
        return cls._of(np.inf, 0.0)

    @classmethod
    def _of(cls, G: float, nu: float) -> Self:
        body = object.__new__(cls)
        body._set(G, nu)
        return body

    def _set(self, G: float, nu: float) -> None:
        object.__setattr__(self, "G", G)
        object.__setattr__(self, "nu", nu)

    @property
    def E(self) -> float:
        """Young's modulus, N/mm²."""
        return 2.0 * self.G * (1.0 + self.nu)

    @property
    def E_star(self) -> float:
        """The modulus for contact with a rigid body, E/(1-ν²), N/mm²."""
        return 2.0 * self.G / (1.0 - self.nu)

    def __repr__(self) -> str:
        if np.isinf(self.G):
            return "Material.rigid()"
        return f"Material(E={self.E:.10g}, nu={self.nu:.10g})"


@dataclass(frozen=True)
class CombinedMaterial:
    """Elastic constants of two bodies in contact (see `combined_material`).

    Attributes
    ----------
    G, nu : float
        Shear modulus (N/mm²) and Poisson's ratio of two equal bodies with the same displacements.
    difference : float
        The `difference_parameter`, which couples the normal and the tangential problem.
    bodies : (Material, Material) or None
        The first and the second body, if they are known; needed for stresses.
    E_star : float
        Modulus of normal contact, G/(1-ν), N/mm²; 1/E* = 1/E₁* + 1/E₂*.

    See Also
    --------
    combined_material : combines two materials.
    """

    G: float
    nu: float
    difference: float = 0.0
    bodies: tuple[Material, Material] | None = field(default=None, repr=False, compare=False)

    def __post_init__(self) -> None:
        check_constants(self.G, self.nu)
        check_difference(self.difference, name="difference")
        match self.bodies:
            case None:
                return
            case (Material() as first, Material() as second):
                exact, own = _combine(first, second), (self.G, self.nu, self.difference)
                if not np.allclose(own, exact, rtol=ALIKE, atol=ALIKE):
                    raise ValueError(
                        f"G, nu and difference are {own}, but must be {exact}, as bodies are "
                        f"{self.bodies}"
                    )
                return
        raise TypeError(f"bodies is {self.bodies!r}, but must be two of contact.Material, or None")

    @property
    def E_star(self) -> float:
        """Modulus of the normal contact of both, N/mm²."""
        return self.G / (1.0 - self.nu)


# The ways to give the bodies: one material for both, one for each, or combined constants.
Bodies = Material | CombinedMaterial | Sequence[Material]


def combined_material(first: Material, second: Material) -> CombinedMaterial:
    """Combine the constants of two bodies in contact: 1/G and ν/G are averaged.

    Parameters
    ----------
    first, second : Material

    Returns
    -------
    CombinedMaterial
        1/G = ½ (1/G₁ + 1/G₂) and ν/G = ½ (ν₁/G₁ + ν₂/G₂), and the `difference_parameter`.

    Raises
    ------
    ValueError
        If both bodies are rigid.
    TypeError
        If an argument is not a `Material`.

    See Also
    --------
    CombinedMaterial : the result.
    difference_parameter : the coupling of unlike bodies.

    Notes
    -----
    If the materials differ, the normal and the tangential problem are also coupled, in proportion
    to their `difference_parameter`, by `influence_xz` and `influence_yz`.

    Examples
    --------
    >>> from toeplitz_mg import contact, halfspace
    >>> steel = contact.Material.from_shear(82000.0, 0.28)
    >>> halfspace.combined_material(steel, steel)
    CombinedMaterial(G=82000.0, nu=0.28, difference=0.0)
    >>> halfspace.combined_material(steel, contact.Material.rigid()).G
    164000.0
    """
    for body in (first, second):
        if not isinstance(body, Material):
            raise TypeError(f"material is {body!r}, but must be {WANTED}")
    if np.isinf(first.G) and np.isinf(second.G):
        raise ValueError("both bodies are rigid, but one must be elastic")
    return CombinedMaterial(*_combine(first, second), (first, second))


def _combine(first: Material, second: Material) -> tuple[float, float, float]:
    """Return the constants G and nu of both bodies together, and the difference."""
    if first == second:
        return first.G, first.nu, 0.0
    G = 2.0 / (1.0 / first.G + 1.0 / second.G)
    nu = min(0.5, G / 2.0 * (first.nu / first.G + second.nu / second.G))  # Despite rounding.
    K = G / 4.0 * ((1.0 - 2.0 * first.nu) / first.G - (1.0 - 2.0 * second.nu) / second.G)
    return G, nu, K


def difference_parameter(first: Material, second: Material) -> float:
    """Return the parameter of the coupling between normal and tangential problems.

    Parameters
    ----------
    first, second : Material

    Returns
    -------
    float
        K = ¼ G ((1-2ν₁)/G₁ - (1-2ν₂)/G₂), with the G of `combined_material`. It is zero if the
        materials are equal, or both incompressible; exchanging the bodies changes its sign.

    Raises
    ------
    ValueError, TypeError
        As for `combined_material`.

    See Also
    --------
    combined_material : the constants of two bodies.
    influence_matrix : the matrix of both problems.

    Examples
    --------
    >>> from toeplitz_mg import contact, halfspace
    >>> soft, rigid = contact.Material.from_shear(1.0, 0.25), contact.Material.rigid()
    >>> halfspace.difference_parameter(soft, rigid)
    0.25
    """
    return combined_material(first, second).difference


def combine(material: Any) -> CombinedMaterial:
    """Return the combined constants of a user's `material`; raise an error if it is not valid.

    Parameters
    ----------
    material : Material, (Material, Material) or CombinedMaterial
        One for both bodies, one for each, or combined constants.
    """
    if isinstance(material, CombinedMaterial):
        return material
    if isinstance(material, Material):
        return combined_material(material, material)
    _refuse_numbers(material)
    try:
        first, second = material
    except (TypeError, ValueError):
        raise TypeError(f"material is {material!r}, but must be {WANTED}") from None
    for body in (first, second):
        _refuse_numbers(body)
    return combined_material(first, second)


def _refuse_numbers(material: Any) -> None:
    """Raise an error for two numbers given instead of a material."""
    if isinstance(material, np.ndarray):
        material = refuse_masked("material", material).tolist()
    match material:
        case (Real(), Real()):
            modulus, nu = map(float, material)
            raise TypeError(
                f"material is {(modulus, nu)}, but a pair does not say which modulus it has: use "
                f"contact.Material(E={modulus}, nu={nu}) for Young's modulus or "
                f"contact.Material.from_shear({modulus}, {nu}) for the shear modulus"
            )


def check_ratio(nu: float) -> float:
    """Return a Poisson's ratio; raise an error if no elastic body has it."""
    nu = real("nu", nu)
    if not -1.0 < nu <= 0.5:
        raise ValueError(f"nu is {nu}, but Poisson's ratio must lie in (-1, 0.5]")
    return nu


def check_constants(G: float, nu: float) -> tuple[float, float]:
    """Return the two constants of a kernel; raise an error if no elastic body has them."""
    return positive("G", G, "N/mm**2"), check_ratio(nu)


def check_difference(K: float, *, name: str = "K") -> float:
    """Return a difference parameter; raise an error if no two bodies have it."""
    K = real(name, K)
    # The largest value, ½ (1-2ν), occurs for a body on a rigid one.
    if not -1.5 < K < 1.5:
        raise ValueError(f"{name} is {K}, but a difference parameter must lie in (-1.5, 1.5)")
    return K
