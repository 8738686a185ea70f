"""The first column of the inverse of a positive definite Toeplitz matrix, to its last digits."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from toeplitz_mg._typing import Array, Rows
from toeplitz_mg.columns.columns import EPS, Columns
from toeplitz_mg.columns.gohberg_semencul import GohbergSemencul
from toeplitz_mg.engine.vectors import norm
from toeplitz_mg.operators import ToeplitzOperator
from toeplitz_mg.solvers.long_residual import LongResidual
from toeplitz_mg.solvers.szego_polynomial import SzegoPolynomial

WELL_CONDITIONED = 1e6  # Condition number up to which gradients have ten digits in float64.
FINE = 2e-14  # Relative error of log x₀ up to which a log-determinant has twelve digits.
SOLVED = 1e-10  # A correction of less than this relative size leaves only rounding errors.
MOST_STEPS = 4  # Most corrections; one is enough up to a condition number of some 10⁸.


@dataclass(frozen=True)
class RefinedColumn:
    """The column x = A⁻¹ e₁, and with it A⁻¹.

    Attributes
    ----------
    A : ToeplitzOperator
        One axis, Hermitian, double precision.
    x : ndarray of shape (n,)
    error : float
        An estimate of the relative error of x₀.
    near_inverse : GohbergSemencul
        An approximation of A⁻¹ from which one step of refinement reaches rounding.
    residual : LongResidual or None
        Computes the residuals that corrected x; None if double precision is enough.
    """

    A: ToeplitzOperator
    x: Array
    error: float
    near_inverse: GohbergSemencul
    residual: LongResidual | None = None

    @cached_property
    def polynomial(self) -> SzegoPolynomial:
        """The polynomial of x on the unit circle."""
        return SzegoPolynomial(self.x)

    @cached_property
    def inverse(self) -> GohbergSemencul:
        """A⁻¹ by the Gohberg-Semencul formula, without refinement."""
        return GohbergSemencul(self.x)

    def solve(self, Y: Rows) -> Rows:
        """Return A⁻¹ y for each row y, with one step of refinement."""
        X = self.near_inverse.apply(Y)
        self.refine(Y, X)
        return X

    def refine(self, Y: Rows, X: Rows) -> None:
        """Correct approximations x of A⁻¹ y, in place, by their residuals."""
        if self.residual is None:
            X += self.near_inverse.apply(Y - self.A.apply(X))
            return
        for y, x in zip(Y, X, strict=True):
            x += self.near_inverse.apply(self.residual(y, x))


def refine_column(columns: Columns) -> RefinedColumn:
    """Return the column of a Hermitian matrix, corrected if double precision is not enough.

    It is not if a log-determinant would have fewer than twelve digits, or a gradient fewer than
    ten.
    """
    A, x, n = columns.A, columns.x, len(columns.x)
    size = float(x[0].real)
    # A correction would change x₀ by xᴴ (e₁ - A x).
    change = abs(np.vdot(x, columns.errors[0])) + columns.rounding * norm(x) / np.sqrt(n)
    column = RefinedColumn(A, x, float(change) / size, columns.near_inverse)
    is_fine = column.error <= FINE * abs(np.log(size))
    if is_fine and column.polynomial.certificate.condition <= WELL_CONDITIONED:
        return column
    residual, unit = LongResidual(A.c), np.eye(1, n, dtype=x.dtype)[0]
    last, x = 1.0, x.copy()
    for _ in range(MOST_STEPS):
        correction = columns.near_inverse.apply(residual(unit, x))
        moved = norm(correction) / norm(x)
        if not moved < 0.5 * last:  # The approximate inverse is too inaccurate.
            break
        x += correction
        last = moved
        if moved <= SOLVED:
            last = 0.0
            break
    x[0] = x[0].real
    return RefinedColumn(A, x, last + 2.0 * EPS, columns.near_inverse, residual)
