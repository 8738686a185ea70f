"""The matrices of surfaces that repeat, by the eigenvalues of their waves."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import DTypeLike
from scipy import fft

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.products import DiagonalisedProduct
from toeplitz_mg.halfspace import CombinedMaterial
from toeplitz_mg.halfspace.periodic import periodic_eigenvalues, strip_eigenvalues, strip_length
from toeplitz_mg.operators import CoupledOperator, DiagonalisedOperator, ToeplitzOperator
from toeplitz_mg.operators.coefficients import Coefficients
from toeplitz_mg.operators.positivity import require_positive


@dataclass(frozen=True)
class Waves:
    """The waves of a grid that repeats along some of its axes (see `Grid`).

    The matrices are circulants along an axis that repeats, and embedded in circulants along one
    that ends. Directions of displacements and tractions are named as in `halfspace.periodic`.
    """

    shape: tuple[int, ...]
    element: tuple[float, ...]
    material: CombinedMaterial
    periodic: tuple[bool, ...]
    reference: float

    @property
    def are_all(self) -> bool:
        """Whether all that moves is a wave: the surface repeats, and nothing of it ends."""
        return all(self.periodic) and len(self.element) == len(self.shape)

    def normal(self) -> tuple[ToeplitzOperator, float]:
        """Return the matrix of normal contact over its diagonal, and that."""
        return self._matrix("zz", is_scaled=True)

    def inverse_of_normal(self) -> tuple[ToeplitzOperator, float]:
        """Return the pressures by the displacements over their diagonal, and that.

        All axes repeat. A mean displacement takes no pressure.
        """
        eigenvalues = self._eigenvalues("zz")
        eigenvalues.flat[0] = np.inf
        return self._operator(1.0 / eigenvalues, is_scaled=True)

    def tangential(self) -> ToeplitzOperator | CoupledOperator:
        """Return the matrix of tangential contact."""
        if len(self.shape) == 1:
            # In plane strain both have the same coefficients.
            return self._matrix("zz" if len(self.element) == 1 else "xx")[0]
        xx, xy, yy = (self._eigenvalues(directions) for directions in ("xx", "xy", "yy"))
        product = DiagonalisedProduct(
            np.array([[xx, xy], [xy, yy]]), self._lengths, (2, *self.shape)
        )
        first, second = self._matrix("xx")[0], self._matrix("yy")[0]
        # Without coupling, as where ν is zero, the block is zero.
        coupling = self._matrix("xy")[0] if xy.any() else None
        return CoupledOperator([[first, coupling], [coupling, second]], product=product)

    def invert(self, A: Any, dtype: DTypeLike | None) -> DiagonalisedOperator:
        """Return the inverse of a matrix, but for its mean, and where the surface ends.

        An axis that ends is taken for one that repeats. The mean, which has no eigenvalue then, is
        given that of a wave of twice the longest.
        """
        precision = np.dtype(dtype or A.dtype)
        if isinstance(A, CoupledOperator):
            xx, xy, yy = (self._eigenvalues_of_all(name) for name in ("xx", "xy", "yy"))
            xx.flat[0] = yy.flat[0] = 2.0 * max(xx.max(), yy.max())
            determinant = xx * yy - xy**2
            least = determinant / (xx + yy)
            inverse = np.array([[yy, -xy], [-xy, xx]]) / determinant
        else:
            least = self._eigenvalues_of_all("zz")
            least *= A.norm_bound / least.max()
            least.flat[0] = 2.0 * least.max()
            inverse = 1.0 / least
        subject = "the matrix of waves has the eigenvalue"
        require_positive(least, precision, subject, "dtype=np.float64")
        product = DiagonalisedProduct(inverse, self.shape, A.grid_shape, precision)
        return DiagonalisedOperator(product, "inverse of waves")

    def _matrix(
        self, directions: str, *, is_scaled: bool = False
    ) -> tuple[ToeplitzOperator, float]:
        """Return a matrix, over its diagonal if so wanted, and that."""
        is_even = directions[0] == directions[1]
        return self._operator(self._eigenvalues(directions), is_scaled=is_scaled, is_even=is_even)

    def _operator(
        self, eigenvalues: Array, *, is_scaled: bool, is_even: bool = True
    ) -> tuple[ToeplitzOperator, float]:
        """Return the matrix of a circulant's eigenvalues, over its diagonal if wanted, and that."""
        column = fft.irfftn(eigenvalues, s=self._lengths)
        unit = float(column.flat[0])
        if is_scaled:
            column /= unit
            eigenvalues /= unit
        product = DiagonalisedProduct(eigenvalues, self._lengths, self.shape)
        if is_even:
            coefficients = Coefficients(column[tuple(map(slice, self.shape))].copy(), is_even=True)
        else:  # It is odd in x and in y. The transform has rounded what is to be symmetric.
            lags = column[np.ix_(*(np.arange(1 - n, n) for n in self.shape))]
            coefficients = Coefficients(0.5 * (lags + np.flip(lags)), is_even=False)
        return ToeplitzOperator(coefficients, product=product), unit

    @property
    def _lengths(self) -> tuple[int, ...]:
        """The elements of the circulants along each axis."""
        if len(self.shape) == 1 or self.are_all:
            return self.shape
        return tuple(
            n if repeats else strip_length(n)
            for n, repeats in zip(self.shape, self.periodic, strict=True)
        )

    def _eigenvalues(self, directions: str) -> Array:
        """Return the eigenvalues of a circulant that has the matrix in it."""
        if self.are_all:
            return self._eigenvalues_of_all(directions)
        (n1, n2), (h1, h2) = (*self.shape, 1)[:2], self.element
        eigenvalues = strip_eigenvalues(
            (n1, n2),
            (h1, h2),
            self.periodic.index(True),
            directions,
            G=self.material.G,
            nu=self.material.nu,
            reference=self.reference,
        )
        # Strips of finite length are one element long.
        return eigenvalues if len(self.shape) == 2 else eigenvalues[: n1 // 2 + 1, 0]

    def _eigenvalues_of_all(self, directions: str) -> Array:
        """Return the eigenvalues as where the surface repeats along all axes."""
        G, nu = self.material.G, self.material.nu
        return periodic_eigenvalues(self.shape, self.element, directions, G=G, nu=nu)
