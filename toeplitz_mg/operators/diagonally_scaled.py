"""An operator between two equal diagonal matrices."""

import numpy as np
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.workspace import workspace
from toeplitz_mg.operators.base import GridOperator, apply_to_rows, grid_of, work_of


class DiagonallyScaled(GridOperator):
    """The product D M D with a real diagonal matrix D, symmetric positive definite where M is.

    Parameters
    ----------
    M : LinearOperator of shape (N, N)
    scale : ndarray of shape (N,)
        The entries of D, not zero.
    """

    def __init__(self, M: LinearOperator, scale: Array) -> None:
        super().__init__(M.dtype, grid_of(M), work_of(M), M.shape[0])
        self.M = M
        self.scale = scale.astype(self.dtype.char.lower())  # Real where M is complex, too.

    def apply(self, X: Array, out: Array | None = None) -> Array:
        """Multiply each row of `X` (see `GridOperator.apply`)."""
        if out is None:
            out = np.empty(X.shape, np.result_type(X, self.dtype))
        scaled = workspace(X.shape, out.dtype)
        np.multiply(X, self.scale, out=scaled)
        return np.multiply(apply_to_rows(self.M, scaled, scaled), self.scale, out=out)

    def _adjoint(self) -> "DiagonallyScaled":
        M = self.M.H
        return self if M is self.M else DiagonallyScaled(M, self.scale)

    def _transpose(self) -> "DiagonallyScaled":
        M = self.M.T
        return self if M is self.M else DiagonallyScaled(M, self.scale)

    def __repr__(self) -> str:
        return f"<DiagonallyScaled {self.M!r}>"
