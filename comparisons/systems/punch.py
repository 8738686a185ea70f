"""The half-space below a contact area: normal, tangential, or both tangential directions."""

from scipy.sparse.linalg import LinearOperator

from comparisons.systems.masks import restrict
from toeplitz_mg import halfspace
from toeplitz_mg._typing import Array

G, NU = 1.0, 0.28


def influence(
    kind: str, mask: Array, element: tuple[float, float], nu: float = NU
) -> LinearOperator:
    """Return the influence of the tractions in a mask on its displacements, for one half-space."""
    material = halfspace.Material.from_shear(G, nu), halfspace.Material.rigid()
    directions = {"normal": "z", "tangential": "x", "coupled": "xy"}[kind]
    full = halfspace.influence_matrix(directions, mask.shape, element, material)
    return restrict(full, mask)
