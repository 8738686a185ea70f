"""Approximate columns of the inverse, and Newton's iteration that improves them."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.columns.circle import Certificate
from toeplitz_mg.columns.gohberg_semencul import GohbergSemencul
from toeplitz_mg.engine.vectors import norm
from toeplitz_mg.operators import ToeplitzOperator

EPS = float(np.finfo(np.float64).eps)
NEAR = 1e-6  # Largest ‖A x - e₁‖ from which one step of refinement reaches rounding.


@dataclass(frozen=True)
class Columns:
    """Approximations x of A⁻¹ e₁ and w of A⁻ᴴ e₁, in double precision.

    Attributes
    ----------
    A : ToeplitzOperator
        Has one axis.
    x : ndarray of shape (n,)
    w : ndarray of shape (n,), or None
        None if A is Hermitian; then w = x.
    previous : GohbergSemencul, optional
        The inverse that improved these columns, if its residual was below `NEAR`.
    """

    A: ToeplitzOperator
    x: Array
    w: Array | None = None
    previous: GohbergSemencul | None = None

    @cached_property
    def errors(self) -> list[Array]:
        """The residuals e₁ - A x, and e₁ - Aᴴ w if there is a w."""
        errors = [-(self.A @ self.x)]
        if self.w is not None:
            errors.append(-(self.A.H @ self.w))
        for error in errors:
            error[0] += 1.0
        return errors

    @cached_property
    def residual(self) -> float:
        """The larger of ‖A x - e₁‖ and ‖Aᴴ w - e₁‖."""
        return max(map(norm, self.errors))

    @property
    def rounding(self) -> float:
        """The expected rounding error of ‖A x - e₁‖, if the errors are random."""
        return float(EPS * np.sqrt(2.0) * norm(self.A.c) * norm(self.x))

    @cached_property
    def inverse(self) -> GohbergSemencul:
        """The inverse with these columns; raises a LinAlgError if there is none."""
        return GohbergSemencul(self.x, None if self.w is None else self.w.conj())

    @property
    def near_inverse(self) -> GohbergSemencul:
        """An inverse accurate enough for one refinement step; an earlier one if there is one."""
        return self.previous or self.inverse

    @cached_property
    def certificate(self) -> Certificate:
        """The certificate of definiteness, for a Hermitian matrix."""
        return Certificate.of(self.x)

    @property
    def is_definite(self) -> bool:
        """Whether the inverse is certainly positive definite; True if A is not Hermitian."""
        return self.w is not None or self.certificate.positive

    def improve(self) -> "Columns":
        """Take a step of Newton's method, which squares the error if the inverse is close.

        The step x + G (e₁ - A x) gives the first column of 2 G - G A G, where G is the inverse with
        the current columns.
        """
        G = self.inverse
        previous = G if self.residual <= NEAR else None
        x = self.x + G @ self.errors[0]
        if self.w is None:
            x[0] = x[0].real
            return Columns(self.A, x, None, previous)
        w = self.w + G.H @ self.errors[1]
        # The column and the row share their first entry.
        return Columns(self.A, x, w * (x[0] / w[0].conj()).conj() if w[0] else w, previous)
