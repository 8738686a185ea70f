"""A trial of preconditioners: a few steps of conjugate gradients with each, and with none."""

from collections.abc import Sequence
from functools import partial
from math import inf

import numpy as np
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.conjugate_gradients import ConjugateGradients
from toeplitz_mg.engine.vectors import axpy, norm
from toeplitz_mg.operators import apply_to_rows
from toeplitz_mg.operators.positivity import INDEFINITE
from toeplitz_mg.preconditioners.choice import ADVANTAGE, NEARLY, STEPS, STEPS_OF_EACH
from toeplitz_mg.preconditioners.fsai.neighbours import REDUCTION


def better_than_none(
    A: LinearOperator, none: LinearOperator, others: Sequence[LinearOperator]
) -> LinearOperator:
    """Return the preconditioner that lowers the energy the most, or `none` if it is as good.

    All solve for the same random right-hand side. The decrease of the energy ½ xᴴA x - bᴴx equals
    that of the squared error in the norm of A, so two steps rank the preconditioners. The remaining
    steps go to the best one and to `none`. If A has some large eigenvalues and all others are alike
    (plane waves, coefficients at isolated lags), CG without a preconditioner finds these one by
    one. So `none` is returned if its energy is nearly as low and its residual not much larger.

    Parameters
    ----------
    A : LinearOperator
        Symmetric or Hermitian positive definite.
    none : LinearOperator
        A multiple of the unit matrix.
    others : sequence of LinearOperator

    Raises
    ------
    numpy.linalg.LinAlgError
        If A is found not to be positive definite.
    """
    if not others:
        return none
    noise = np.random.default_rng(0).standard_normal((2, A.shape[0]))
    is_complex = np.dtype(A.dtype).kind == "c"
    b = (noise[0] + 1j * noise[1] if is_complex else noise[0]).astype(A.dtype)
    without, *descents = (_Descent(A, M, b) for M in (none, *others))
    if len(others) > 1:
        for descent in descents:
            descent.go_to(STEPS_OF_EACH)
    taken = sum(descent.steps for descent in descents)
    best, M = max(zip(descents, others, strict=True), key=lambda pair: pair[0].fall)
    steps = (STEPS - taken + best.steps) // 2
    best.go_to(steps)
    without.go_to(steps)
    is_as_low = without.fall >= NEARLY * best.fall
    return none if is_as_low and without.residual <= ADVANTAGE * best.residual else M


class _Descent:
    """Conjugate gradients from zero.

    Attributes
    ----------
    steps : int
        Steps taken so far.
    fall : float
        Twice the decrease of the energy; -inf if M is found not to be positive definite.
    residual : float
        ‖b - A x‖.
    """

    def __init__(self, A: LinearOperator, M: LinearOperator, b: Array) -> None:
        self._cg = ConjugateGradients(partial(apply_to_rows, A), partial(apply_to_rows, M))
        self._r, self.residual = b.copy(), norm(b)
        self._solved = REDUCTION * self.residual  # Further decreases may be rounding errors.
        self.steps, self.fall = 0, 0.0

    def go_to(self, steps: int) -> None:
        """Continue to this number of steps, or until the system is solved."""
        while self.steps < steps and self._solved < self.residual < inf:
            self.steps += 1
            length = self._cg.step(self._r)
            if not self._cg.rho > 0.0:
                self.fall, self.residual = -inf, inf
                return
            if length == 0.0:
                raise np.linalg.LinAlgError(
                    f"A is not positive definite: for some vector xᴴ A x is "
                    f"{self._cg.curvature:.3g}: use {INDEFINITE}"
                )
            self.fall += length * self._cg.rho
            axpy(-length, self._cg.product, self._r)
            self.residual = max(norm(self._r), self._solved)
