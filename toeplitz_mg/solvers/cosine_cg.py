"""CG for symmetric positive definite Toeplitz matrices in the domain of the DCT-II.

There the preconditioner is a diagonal and a small block, and an iteration takes four transforms,
or six where the length is slow.
A and the preconditioner commute with the flip of a vector, which in that domain changes the sign of
every second number: the even and the odd part of a vector never mix, and each has scalars, and so
a CG, of its own. That saves a quarter of the iterations.
"""

import numpy as np

from toeplitz_mg._typing import Array, Rows
from toeplitz_mg.solvers.cosine_form import (
    ApproximateInverse,
    CosineForm,
    alternate,
    by_parity,
)

ROUNDING = float(np.finfo(np.float64).eps) / 16  # Least error of a product, over ‖A‖ ‖x‖.
MOST_ITERATIONS = 24  # Most iterations: symbols that the inverse suits take up to 20 to 1e-12.
TRIAL = 10  # Iterations after which a residual that is still above the first one is hopeless.


class CosineSolver:
    """Solves systems of one matrix.

    Parameters
    ----------
    form : CosineForm
        Of the matrix A.
    size : float
        A bound of ‖A‖.

    Raises
    ------
    numpy.linalg.LinAlgError
        Where the approximate inverse is not positive definite.
    """

    def __init__(self, form: CosineForm, size: float) -> None:
        # Where the signs of x and b alternate, a zero at θ = π is one at θ = 0.
        self._alternates = form.has_zero_at_end
        self._form = form.alternated() if self._alternates else form
        self._rounding = ROUNDING * size
        self._M = ApproximateInverse(self._form)

    def solve(self, B: Rows, rtol: float) -> tuple[Rows, int]:
        """Return solutions for rows by the recurrence for the residual, and the iterations.

        It ends where the residual is `rtol` times the right-hand side, or as small as rounding
        errors.

        Raises
        ------
        numpy.linalg.LinAlgError
            Where A is not positive definite, or the iteration does not converge soon.
        """
        form = self._form
        R = form.transform(self._signed(B))
        X, iterations = self._iterate(R, rtol)
        form.count_iterations(iterations, B.size // form.n)
        return self._signed(form.transform_back(X)), iterations

    def _signed(self, X: Rows) -> Rows:
        return alternate(X) if self._alternates else X

    def _iterate(self, R: Rows, rtol: float) -> tuple[Rows, int]:
        """Iterate from zero, in the domain of the transform; R becomes the residual.

        If A is shorter than that, what X, P and Z have outside of the middle is multiplied by zero:
        it changes neither R nor inner products with R.
        """
        form, M = self._form, self._M
        sizes = np.vecdot(R, R)
        reached = rtol**2 * sizes
        X, P, Z, W = np.zeros_like(R), np.zeros_like(R), np.empty_like(R), np.empty_like(R)
        R_even, R_odd, Z_even, Z_odd, P_even, P_odd, W_even, W_odd = (
            part for V in (R, Z, P, W) for part in (V[..., ::2], V[..., 1::2])
        )
        W_even, W_odd = W_even.T, W_odd.T  # They take a number for each row.
        R_lowest, Z_lowest = by_parity(R), by_parity(Z)
        even = odd = np.ones_like(sizes)
        squares, goals = sizes, reached
        iterations = 0
        while not (squares <= goals).all():
            if iterations == MOST_ITERATIONS or (iterations == TRIAL and (squares > sizes).any()):
                raise np.linalg.LinAlgError(f"no convergence in {iterations} iterations")
            np.multiply(R, M.diagonal, out=Z)
            np.matmul(R_lowest, M.lowest, out=Z_lowest)
            last_even, last_odd = even, odd
            even, odd = np.vecdot(R_even, Z_even), np.vecdot(R_odd, Z_odd)
            W_even[...], W_odd[...] = _divide(even, last_even), _divide(odd, last_odd)
            P *= W
            P += Z
            Q = form.multiply_transformed(P)
            W_even[...] = _divide(even, np.vecdot(P_even, Q[..., ::2]))
            W_odd[...] = _divide(odd, np.vecdot(P_odd, Q[..., 1::2]))
            Q *= W
            R -= Q
            W *= P
            X += W
            squares = np.vecdot(R, R)
            goals = np.maximum(reached, self._rounding**2 * np.vecdot(X, X))
            iterations += 1
        return X, iterations


def _divide(a: Array, b: Array) -> Array:
    """Return a/b; zero where both are zero, so that a part that a vector has not stays zero."""
    return a / (b + (b == 0.0))
