"""The inverse of a small positive definite operator, by a Cholesky factorisation."""

import numpy as np
from numpy.typing import DTypeLike
from scipy.linalg import cho_factor, cho_solve, lapack
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array
from toeplitz_mg.operators.base import GridOperator, grid_of
from toeplitz_mg.operators.positivity import LAST_RESORT

DIRECT = 600  # Most unknowns that are solved for directly: the Cholesky factor takes 3 MB.


class NotPositiveDefinite(np.linalg.LinAlgError):
    """A matrix is certainly not positive definite, so that no preconditioner helps."""


class DenseInverse(GridOperator):
    """The inverse of a small positive definite operator, by a Cholesky factorisation.

    Parameters
    ----------
    A : LinearOperator
        Symmetric or Hermitian, with a method ``toarray()``.
    dtype : dtype, optional
        The precision in which the factor is stored and applied, by default that of `A`; complex
        if `A` is. The factor is computed in float64 or complex128.

    Attributes
    ----------
    rcond : float
        An estimate of the reciprocal condition number of `A`, in the 1-norm.

    Raises
    ------
    NotPositiveDefinite
        If the matrix is not positive definite; it is a LinAlgError.
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
        """Whether the precision resolves the smallest eigenvalues, so that they stay positive."""
        return self.rcond > 4.0 * float(np.finfo(self.dtype).eps)

    def apply(self, X: Array, out: Array | None = None) -> Array:
        """Multiply each row of `X` (see `GridOperator.apply`)."""
        # LAPACK has four precisions; use the nearest.
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
