"""The half-space below a contact area: normal, tangential, or both tangential directions."""

from dataclasses import dataclass

from scipy.sparse.linalg import LinearOperator

from comparisons.systems.masks import AREAS, restrict
from toeplitz_mg import halfspace
from toeplitz_mg._typing import Array

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
    """A rigid area on a half-space: one of `AREAS`, of `KINDS`, N elements across."""

    area: str
    kind: str
    N: int
    nu: float = NU

    def operator(self) -> LinearOperator:
        """Return the influence of the tractions on the displacements; the shorter side is 2."""
        mask = AREAS[self.area](self.N)
        h = 2.0 / int(min(mask.shape))
        return influence(self.kind, mask, (h, h), self.nu)
