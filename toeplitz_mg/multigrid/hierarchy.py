"""The list of levels: on each a matrix, a smoother and the way to the next coarser one."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg.multigrid.transfer import Coarsening, Transfer
from toeplitz_mg.operators import as_rows

Array = NDArray[Any]
Smoother = Callable[[LinearOperator], LinearOperator]


@dataclass(frozen=True)
class Level:
    """One grid of the hierarchy.

    Attributes
    ----------
    A : LinearOperator
        The matrix of this grid.
    smoother : LinearOperator
        An approximate inverse of `A`; on the coarsest grid the inverse.
    transfer : Transfer or None
        To and from the next coarser grid; None on the coarsest.
    """

    A: LinearOperator
    smoother: LinearOperator
    transfer: Transfer | None


class DenseInverse(LinearOperator):
    """The inverse of a small symmetric positive definite operator, by a Cholesky factorisation.

    Raises
    ------
    numpy.linalg.LinAlgError
        Where the matrix is not positive definite.
    """

    def __init__(self, A: LinearOperator) -> None:
        super().__init__(A.dtype, A.shape)
        try:
            self._factor = cho_factor(A.toarray(), lower=True)
        except np.linalg.LinAlgError as error:
            raise np.linalg.LinAlgError(
                f"the matrix of the coarsest grid, {A!r}, is not positive definite: {error}"
            ) from None

    def _matvec(self, x: Array) -> Array:
        x = as_rows(x, self.shape[1])
        return np.asarray(cho_solve(self._factor, x.T, check_finite=False)).T

    def _matmat(self, X: Array) -> Array:
        return self._matvec(X.T).T

    def _adjoint(self) -> "DenseInverse":
        return self

    def _transpose(self) -> "DenseInverse":
        return self

    def __repr__(self) -> str:
        return f"<DenseInverse {self.shape[0]}>"


def build_levels(
    A: LinearOperator, smoother: Smoother, coarsest: int, coarsen: Coarsening
) -> tuple[Level, ...]:
    """Coarsen `A` until at most `coarsest` unknowns are left, which are solved directly."""
    levels = []
    while A.shape[0] > coarsest and (transfer := Transfer.of(A)) is not None:
        levels.append(Level(A, smoother(A), transfer))
        A = coarsen(A)
    levels.append(Level(A, DenseInverse(A), None))
    return tuple(levels)
