"""Elastic constants of one body, and what they may be."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from toeplitz_mg.values import positive, real


@dataclass(frozen=True, init=False)
class Material:
    """An elastic body: isotropic, homogeneous, thick beside the contact.

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
        E/(1-ν²), the modulus of the contact with a rigid body; of two bodies 1/E* is the sum.

    Raises
    ------
    ValueError
        For a modulus that is not positive or a Poisson's ratio outside (-1, 0.5].
    TypeError
        For what is no real number.

    See Also
    --------
    Material.from_shear : from the shear modulus.
    Material.rigid : a body that does not deform.

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
        E, nu = positive("E", E), check_ratio(nu)
        self._set(E / (2.0 * (1.0 + nu)), nu)

    @classmethod
    def from_shear(cls, G: float, nu: float) -> Self:
        """Return the body of this shear modulus and this Poisson's ratio.

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
            As by `Material`.

        Examples
        --------
        >>> from toeplitz_mg import contact
        >>> contact.Material.from_shear(82000.0, 0.28)
        Material(E=209920, nu=0.28)
        """
        return cls._of(positive("G", G), check_ratio(nu))

    @classmethod
    def rigid(cls) -> Self:
        """Return the body that does not deform; only one of two may be it.

        Returns
        -------
        Material
            Its moduli are infinite.

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
        """The modulus of the contact with a rigid body, E/(1-ν²), N/mm²."""
        return 2.0 * self.G / (1.0 - self.nu)

    def __repr__(self) -> str:
        if np.isinf(self.G):
            return "Material.rigid()"
        return f"Material(E={self.E:.10g}, nu={self.nu:.10g})"


def check_ratio(nu: float) -> float:
    """Return a Poisson's ratio, or say that no elastic body has it."""
    nu = real("nu", nu)
    if not -1.0 < nu <= 0.5:
        raise ValueError(f"nu is {nu}, but Poisson's ratio lies in (-1, 0.5]")
    return nu


def check_constants(G: float, nu: float) -> tuple[float, float]:
    """Return the two constants of a kernel, or say which of them no elastic body has."""
    return positive("G", G), check_ratio(nu)


def check_difference(K: float, *, name: str = "K") -> float:
    """Return a difference parameter, or say that no two bodies have it."""
    K = real(name, K)
    # The largest, ½ (1-2ν), is that of a body on a rigid one.
    if not -1.5 < K < 1.5:
        raise ValueError(f"{name} is {K}, but a difference parameter lies in (-1.5, 1.5)")
    return K
