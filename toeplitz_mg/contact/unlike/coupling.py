"""What couples the two problems: displacements along by pressures, across by tractions; a bound."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.grid import Grid
from toeplitz_mg.contact.results import TangentialResult
from toeplitz_mg.operators import apply_to_rows


@dataclass(frozen=True)
class Coupling:
    """The displacements along the surface by pressures, and across it by tractions.

    Attributes
    ----------
    matrices : tuple of ToeplitzOperator or None
        Those of the displacements along x, and y, by the pressures.
    """

    matrices: tuple[Any, ...]

    @property
    def is_there(self) -> bool:
        """Whether pressures displace the bodies along the surface."""
        return any(A is not None for A in self.matrices)

    def along(self, p: Array) -> Array:
        """Return the displacements along the surface by pressures, of shape (components, ...)."""
        return np.stack(
            [
                np.zeros(p.shape) if A is None else apply_to_rows(A, p.ravel()).reshape(p.shape)
                for A in self.matrices
            ]
        )

    def across(self, q: Array) -> Array:
        """Return the normal displacements by tractions: by reciprocity, the transpose."""
        u = np.zeros(q.shape[1:])
        for A, traction in zip(self.matrices, q, strict=True):
            if A is not None:  # What is odd has minus itself for its transpose.
                u -= apply_to_rows(A, traction.ravel()).reshape(u.shape)
        return u


def bound_of(mu: Array, p: Array) -> Array:
    """Return the traction bound of pressures: none where there are none, for any coefficient."""
    return np.multiply(mu, p, out=np.zeros_like(p), where=p > 0.0)


def add_displacements(result: TangentialResult, u: Array, grid: Grid) -> TangentialResult:
    """Return a result with the displacements along the surface by pressures, so that all are in it.

    Nothing is left out then, and the resolution is doubted where the bodies are pressed.
    """
    shape = result.traction.shape
    displacement = result.displacement + np.where(result.contact, u, 0.0).reshape(shape)
    energy = 0.5 * grid.area * float((result.traction * displacement).sum())
    return replace(result, displacement=displacement, energy=energy, warnings=())
