"""The matrices of surfaces that repeat, by the eigenvalues of their waves."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import DTypeLike
from scipy import fft
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.products import DiagonalisedProduct
from toeplitz_mg.halfspace import CombinedMaterial
from toeplitz_mg.halfspace.periodic import (
    periodic_eigenvalues,
    strip_eigenvalues,
    strip_length,
    tangential_eigenvalues,
)
from toeplitz_mg.operators import CoupledOperator, DiagonalisedOperator, ToeplitzOperator
from toeplitz_mg.operators.block_diagonal import BlockDiagonal
from toeplitz_mg.preconditioners.positivity import require_positive


@dataclass(frozen=True)
class Waves:
    """The waves of a grid that repeats along some of its axes (see `Grid`)."""

    shape: tuple[int, ...]
    element: tuple[float, ...]
    material: CombinedMaterial
    periodic: tuple[bool, ...]
    reference: float

    @property
    def are_all(self) -> bool:
        """Whether all that moves is a wave: the surface repeats, and nothing of it ends."""
        return all(self.periodic) and len(self.element) == len(self.shape)

    def normal(self, *, is_scaled: bool = False) -> tuple[ToeplitzOperator, float]:
        """Return the matrix of normal contact, over its diagonal if so wanted, and that."""
        eigenvalues, lengths = self._normal_eigenvalues()
        column = fft.irfftn(eigenvalues, s=lengths)
        c = np.ascontiguousarray(column[tuple(map(slice, self.shape))])
        unit = float(c.flat[0])
        if is_scaled:
            c /= unit
            eigenvalues /= unit
        product = DiagonalisedProduct(eigenvalues, lengths, self.shape)
        return ToeplitzOperator(c, product=product), unit

    def tangential(self) -> ToeplitzOperator | CoupledOperator:
        """Return the matrix of tangential contact, where all that moves is a wave."""
        if not self.are_all:
            raise ValueError(
                f"periodic is {self.periodic}, but friction is for a surface that repeats along "
                "all axes, or along none"
            )
        if len(self.shape) == 1:
            return self.normal()[0]  # In plane strain both have the same coefficients.
        blocks = {}
        for name, eigenvalues in self._tangential_eigenvalues().items():
            column = fft.irfftn(eigenvalues, s=self.shape)
            lags = np.ix_(*((np.arange(2 * n - 1) - (n - 1)) % n for n in self.shape))
            # Without coupling, as where ν is zero, the block is zero.
            blocks[name] = ToeplitzOperator.from_lags(column[lags]) if column.any() else None
        return CoupledOperator([[blocks["xx"], blocks["xy"]], [blocks["xy"], blocks["yy"]]])

    def invert(self, A: Any, dtype: DTypeLike | None) -> LinearOperator:
        """Return the inverse of a matrix, but for its mean, and where the surface ends.

        An axis that ends is taken for one that repeats. The mean, which has no eigenvalue then, is
        given that of a wave of twice the longest. Components are inverted each by itself.
        """
        precision = np.dtype(dtype or A.dtype)
        if isinstance(A, CoupledOperator):
            blocks = self._tangential_eigenvalues()
            inverses = [self._invert(blocks[name], precision) for name in ("xx", "yy")]
            return BlockDiagonal(inverses, A.grid_shape)
        eigenvalues, lengths = self._normal_eigenvalues()
        if lengths != self.shape:
            eigenvalues = self._eigenvalues_of_all()
        eigenvalues *= A.norm_bound / eigenvalues.max()
        return self._invert(eigenvalues, precision)

    def _invert(self, eigenvalues: Array, dtype: np.dtype[Any]) -> DiagonalisedOperator:
        if eigenvalues.flat[0] == 0.0:
            eigenvalues.flat[0] = 2.0 * eigenvalues.max()
        subject = "the matrix of waves has the eigenvalue"
        require_positive(eigenvalues, dtype, subject, "dtype=np.float64")
        product = DiagonalisedProduct(1.0 / eigenvalues, self.shape, self.shape, dtype)
        return DiagonalisedOperator(product, "inverse of waves")

    def _normal_eigenvalues(self) -> tuple[Array, tuple[int, ...]]:
        """Return the eigenvalues of a circulant that has the matrix in it, and its lengths."""
        if self.are_all:
            return self._eigenvalues_of_all(), self.shape
        n1, n2 = (*self.shape, 1)[:2]
        h1, h2 = self.element
        axis, G, nu = self.periodic.index(True), self.material.G, self.material.nu
        eigenvalues = strip_eigenvalues(
            (n1, n2), (h1, h2), axis, G=G, nu=nu, reference=self.reference
        )
        if len(self.shape) == 1:  # Strips of finite length, one element long.
            return eigenvalues[: n1 // 2 + 1, 0], self.shape
        return eigenvalues, (n1, strip_length(n2)) if axis == 0 else (strip_length(n1), n2)

    def _eigenvalues_of_all(self) -> Array:
        """Return the eigenvalues as where the surface repeats along all axes."""
        G, nu = self.material.G, self.material.nu
        return periodic_eigenvalues(self.shape, self.element, G=G, nu=nu)

    def _tangential_eigenvalues(self) -> dict[str, Array]:
        (n1, n2), (h1, h2) = self.shape, self.element
        G, nu = self.material.G, self.material.nu
        return tangential_eigenvalues((n1, n2), (h1, h2), G=G, nu=nu)
