"""A rigid punch with a flat face on a half-space: its matrix, displacement, force and residual."""

from dataclasses import dataclass

import numpy as np
from scipy.signal import fftconvolve
from scipy.sparse.linalg import LinearOperator

import toeplitz_mg as tmg
from comparisons.systems.masks import AREAS, restrict
from toeplitz_mg import halfspace
from toeplitz_mg._typing import Array
from toeplitz_mg.operators.structure import unwrap

G, NU = 1.0, 0.28
KINDS = ("normal", "tangential", "coupled")


def influence(
    kind: str, mask: Array, element: tuple[float, float], nu: float = NU
) -> LinearOperator:
    """Return the influence of the tractions in a mask on its displacements, for one half-space."""
    material = halfspace.Material.from_shear(G, nu), halfspace.Material.rigid()
    directions = {"normal": "z", "tangential": "x", "coupled": "xy"}[kind]
    full = halfspace.influence_matrix(directions, mask.shape, element, material)
    return restrict(full, mask)


@dataclass(frozen=True)
class Punch:
    """A rigid area on a half-space.

    Attributes
    ----------
    area : str
        One of `AREAS`.
    kind : str
        One of `KINDS`.
    N : int
        Elements across the longer side.
    nu : float
        Poisson's ratio.
    """

    area: str
    kind: str
    N: int
    nu: float = NU

    @property
    def mask(self) -> Array:
        """The elements under the punch, on the grid."""
        return AREAS[self.area](self.N)

    @property
    def h(self) -> float:
        """The side of an element; the shorter half side of the grid is 1."""
        return 2.0 / int(min(self.mask.shape))

    def operator(self) -> LinearOperator:
        """Return the influence of the tractions on the displacements, for one half-space."""
        return influence(self.kind, self.mask, (self.h, self.h), self.nu)

    def displacement(self) -> Array:
        """Return the rigid displacement, of the unknowns."""
        u = np.ones(int(self.mask.sum()))
        return np.concatenate([u, np.zeros_like(u)]) if self.kind == "coupled" else u

    def force(self, tractions: Array) -> float:
        """Return F/(E* b δ), or F/(G b δ) if it is tangential, b the shorter half side."""
        first = tractions[: int(self.mask.sum())]
        modulus = 2.0 * G / (1.0 - self.nu) if self.kind == "normal" else G
        return float(first.sum()) * self.h**2 / modulus

    def residual(self, tractions: Array, A: LinearOperator) -> float:
        """Return ‖u - A p‖/‖u‖, by a convolution that is not the one under test."""
        full, _ = unwrap(A)
        blocks = full.blocks if isinstance(full, tmg.CoupledOperator) else ((full,),)
        fields = np.zeros((len(blocks), *self.mask.shape))
        fields[:, self.mask] = tractions.reshape(len(blocks), -1)
        u = [
            sum(fftconvolve(a.lags, p, "valid") for a, p in zip(row, fields, strict=True))
            for row in blocks
        ]
        error = np.concatenate([v[self.mask] for v in u]) - self.displacement()
        return float(np.linalg.norm(error)) / float(np.linalg.norm(self.displacement()))
