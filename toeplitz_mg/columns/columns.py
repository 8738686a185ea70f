"""Columns of an approximate inverse, and Newton's iteration on them."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.columns.circle import Certificate
from toeplitz_mg.columns.gohberg_semencul import GohbergSemencul
from toeplitz_mg.engine.vectors import norm
from toeplitz_mg.operators import ToeplitzOperator

EPS = float(np.finfo(np.float64).eps)
NEAR = 1e-6  # Largest ‖A x - e₁‖ of an inverse that one step of refinement brings to rounding.


@dataclass(frozen=True)
class Columns:
    """Approximations x of A⁻¹ e₁ and w of A⁻ᴴ e₁, in double precision.

    Attributes
    ----------
    A : ToeplitzOperator
        Of one axis.
    x : ndarray of shape (n,)
    w : ndarray of shape (n,), or None
        None where A is Hermitian, and w is x.
    previous : GohbergSemencul, optional
        The inverse by which these columns were improved, where it is near.
    """

    A: ToeplitzOperator
    x: Array
    w: Array | None = None
    previous: GohbergSemencul | None = None

    @cached_property
    def errors(self) -> list[Array]:
        """The residuals e₁ - A x, and e₁ - Aᴴ w where there is a w."""
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
        """What a residual ‖A x - e₁‖ has of rounding, if that is random."""
        return float(EPS * np.sqrt(2.0) * norm(self.A.c) * norm(self.x))

    @cached_property
    def inverse(self) -> GohbergSemencul:
        """The inverse that has these columns; a LinAlgError where none has."""
        return GohbergSemencul(self.x, None if self.w is None else self.w.conj())

    @property
    def near_inverse(self) -> GohbergSemencul:
        """An inverse that one step of refinement brings to rounding: one that was made before."""
        return self.previous or self.inverse

    @cached_property
    def certificate(self) -> Certificate:
        """What is known of the inverse of a Hermitian matrix."""
        return Certificate.of(self.x)

    @property
    def is_definite(self) -> bool:
        """Whether of a Hermitian matrix the inverse is positive definite for certain."""
        return self.w is not None or self.certificate.positive

    def improve(self) -> "Columns":
        """Take a step of Newton's method, which squares the error of an inverse that is near.

        It is x + G (e₁ - A x), the first column of 2 G - G A G, where G is the inverse that has
        these columns; so the next step has a better G.
        """
        G = self.inverse
        previous = G if self.residual <= NEAR else None
        x = self.x + G @ self.errors[0]
        if self.w is None:
            x[0] = x[0].real
            return Columns(self.A, x, None, previous)
        w = self.w + G.H @ self.errors[1]
        # The first entries of a column and a row are the same.
        return Columns(self.A, x, w * (x[0] / w[0].conj()).conj() if w[0] else w, previous)
