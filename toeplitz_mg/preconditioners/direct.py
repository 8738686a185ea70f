"""The inverse of a small positive definite operator, by a Cholesky factorisation."""

import numpy as np
from numpy.typing import DTypeLike
from scipy.linalg import cho_factor, cho_solve, lapack
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array
from toeplitz_mg.operators.base import GridOperator, grid_of
from toeplitz_mg.operators.positivity import LAST_RESORT

DIRECT = 600  # Most unknowns of a matrix that a Cholesky factor, of 3 MB, solves for at once.


class NotPositiveDefinite(np.linalg.LinAlgError):
    """A matrix is not positive definite, for certain: no preconditioner is of use."""


class DenseInverse(GridOperator):
    """The inverse of a small positive definite operator, by a Cholesky factorisation.

    Parameters
    ----------
    A : LinearOperator
        Symmetric or Hermitian, with a method ``toarray()``.
    dtype : dtype, optional
        The precision in which the factor is kept and applied, that of `A` by default; complex
        where `A` is. It is computed in float64 or complex128.

    Attributes
    ----------
    rcond : float
        An estimate of the reciprocal condition number of `A`, in the 1-norm.

    Raises
    ------
    NotPositiveDefinite
        A LinAlgError, where the matrix is not positive definite.
    """

    def __init__(self, A: LinearOperator, dtype: DTypeLike | None = None) -> None:
        super().__init__(A.dtype if dtype is None else dtype, grid_of(A), 0.0, A.shape[0])
        dense = A.toarray().astype(np.result_type(A.dtype, np.float64), copy=False)
        try:
            factor, lower = cho_factor(dense, lower=True)
        except np.linalg.LinAlgError:
            raise NotPositiveDefinite(
                f"{A!r} is not positive definite, or nearly singular: use {LAST_RESORT}"
            ) from None
        norm = float(np.abs(dense).sum(axis=0).max())
        estimate = lapack.zpocon if factor.dtype.kind == "c" else lapack.dpocon
        self.rcond = float(estimate(factor, norm, uplo="L")[0])
        self._factor = factor.astype(self.dtype), lower

    @property
    def is_accurate(self) -> bool:
        """Whether its precision resolves the smallest eigenvalues, so that it is positive too."""
        return self.rcond > 4.0 * float(np.finfo(self.dtype).eps)

    def apply(self, X: Array, out: Array | None = None) -> Array:
        """Multiply each row of `X` (see `GridOperator.apply`)."""
        # LAPACK has four precisions, of which the nearest is taken.
        dtype = np.result_type(X, self.dtype)
        if dtype.char not in "fdFD":
            dtype = np.dtype(np.complex128 if dtype.kind == "c" else np.float64)
        columns = X.reshape(-1, self.shape[1]).T.astype(dtype)
        solution = cho_solve(self._factor, columns, overwrite_b=True, check_finite=False)
        rows = solution.T.reshape(X.shape)
        if out is None:
            return rows
        np.copyto(out, rows, casting="same_kind")
        return out

    def __repr__(self) -> str:
        return f"<DenseInverse {self.shape[0]}>"
