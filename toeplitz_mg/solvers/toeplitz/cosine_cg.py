"""CG for symmetric positive definite Toeplitz matrices in the domain of the DCT-II.

There the preconditioner is a diagonal matrix plus a small matrix for the lowest frequencies, or a
matrix of low rank. An iteration takes four transforms, or six if the length is slow. A and the
preconditioner commute with the flip of a vector, which in that domain changes the sign of every
second entry. So the even and the odd part of a vector never mix, and each has its own CG scalars.
This saves a quarter of the iterations.
"""

from operator import le

import numpy as np
from scipy.linalg.blas import daxpy, ddot, dscal

from toeplitz_mg._typing import Array, Rows
from toeplitz_mg.columns.columns import EPS
from toeplitz_mg.engine.vectors import PART, norm
from toeplitz_mg.solvers.toeplitz.cosine_form import CosineForm, alternate
from toeplitz_mg.solvers.toeplitz.cosine_inverse import precondition

ROUNDING = EPS / 16  # Least error of a product, relative to ‖A‖ ‖x‖.
MOST_ITERATIONS = 24  # Most iterations; suitable symbols take up to 20 to reach 1e-12.


class CosineSolver:
    """A solver for systems with one matrix.

    Parameters
    ----------
    form : CosineForm
        The matrix A.
    size : float
        An upper bound of ‖A‖.

    Raises
    ------
    numpy.linalg.LinAlgError
        If the approximate inverse is not positive definite.
    """

    def __init__(self, form: CosineForm, size: float) -> None:
        # With alternating signs in x and b, a zero at θ = π becomes one at θ = 0.
        self._alternates = form.has_zero_at_end
        self._form = form.alternated() if self._alternates else form
        self._rounding = ROUNDING * size
        self._M = precondition(self._form)

    def solve(self, B: Rows, rtol: float) -> tuple[Rows, int]:
        """Return solutions for rows, and the number of iterations.

        The iteration ends when the residual of the recurrence is `rtol` times the right-hand side,
        or as small as rounding errors.

        Raises
        ------
        numpy.linalg.LinAlgError
            If A is not positive definite, or the iteration does not converge soon.
        """
        form = self._form
        R = form.transform(alternate(B) if self._alternates else B)
        Y, iterations = self._iterate(R, rtol)
        X = form.transform_back(Y)
        return alternate(X) if self._alternates else X, iterations

    def _iterate(self, R: Rows, rtol: float) -> tuple[Rows, int]:
        """Iterate from zero in the transformed domain; R becomes the residual.

        If A is shorter than m, entries of X, P and Z outside the middle are multiplied by zero, and
        change neither R nor inner products with R.
        """
        form, M = self._form, self._M
        X, P, Z, Q = np.zeros_like(R), np.zeros_like(R), np.empty_like(R), np.empty_like(R)
        # BLAS processes every second entry of a vector in fewer calls than NumPy.
        r, x, p, z = (V.reshape(-1) for V in (R, X, P, Z))
        rows, parts = R.size // form.m, _parts(R.size, form.m)
        sizes = squares = [norm(row) ** 2 for row in R.reshape(rows, -1)]
        for part, pieces in enumerate(parts):
            # A part that is only rounding errors would not converge: set it to zero.
            if _dot(r, r, pieces) <= (64.0 * EPS) ** 2 * sizes[part // 2]:
                for n, k in pieces:
                    dscal(0.0, r, n, k, 2)
        reached = goals = [rtol**2 * size for size in sizes]
        of_z = [1.0] * len(parts)
        iterations = 0
        while not all(map(le, squares, goals)):
            if iterations == MOST_ITERATIONS:
                raise np.linalg.LinAlgError(f"no convergence in {iterations} iterations")
            M.apply(R, out=Z)
            for part, pieces in enumerate(parts):
                last, of_z[part] = of_z[part], _dot(r, z, pieces)
                # A part that is zero in the right-hand side stays zero.
                factor = of_z[part] / last if last else 0.0
                for n, k in pieces:
                    dscal(factor, p, n, k, 2)
            P += Z
            Q = form.multiply_transformed(P, Q)
            q = Q.reshape(-1)
            squares, of_x = [0.0] * rows, [0.0] * rows
            for part, pieces in enumerate(parts):
                of_p = _dot(p, q, pieces)
                if of_p < 0.0:
                    raise np.linalg.LinAlgError("A is not positive definite")
                step = of_z[part] / of_p if of_p else 0.0
                for n, k in pieces:
                    daxpy(p, x, n, step, k, 2, k, 2)
                    daxpy(q, r, n, -step, k, 2, k, 2)
                squares[part // 2] += _dot(r, r, pieces)
                of_x[part // 2] += _dot(x, x, pieces)
            goals = [max(s, self._rounding**2 * t) for s, t in zip(reached, of_x, strict=True)]
            iterations += 1
        return X, iterations


def _parts(size: int, m: int) -> list[list[tuple[int, int]]]:
    """Return the even and the odd part of each row, in pieces short enough for one BLAS thread.

    A piece is given by its number of entries and the position of the first.
    """
    return [
        [(min(PART, (m + 1 - k) // 2), row + k) for k in range(parity, m, 2 * PART)]
        for row in range(0, size, m)
        for parity in (0, 1)
    ]


def _dot(x: Array, y: Array, pieces: list[tuple[int, int]]) -> float:
    """Return the inner product of one part of two vectors."""
    total = 0.0
    for n, k in pieces:
        total += ddot(x, y, n, k, 2, k, 2)
    return total
