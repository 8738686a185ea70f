"""The list of levels: on each a matrix, a smoother and the way to the next coarser one."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.sparse.linalg import LinearOperator, aslinearoperator

from toeplitz_mg.multigrid.interpolation import Interpolation
from toeplitz_mg.multigrid.transfer import Coarsening, Transfer, galerkin
from toeplitz_mg.operators import as_rows
from toeplitz_mg.operators.masked import toeplitz_and_mask
from toeplitz_mg.preconditioners.jacobi import ScaledIdentity
from toeplitz_mg.preconditioners.positivity import ritz_values
from toeplitz_mg.preconditioners.row_sum import RowSumModified

Array = NDArray[Any]
Smoother = Callable[[LinearOperator], LinearOperator]

# The largest matrix factorised where no coarser grid can be had: 32 MB, a tenth of a second.
LARGEST_DENSE = 2048
STEPS = 5  # of Lanczos's method with a smoother and its matrix, two work units each
CONVERGENT = 1.7  # eigenvalue of S A up to which none is expected above 2, where S diverges


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
    smooths : bool
        False where the smoother is M̄ or Jacobi's and may diverge, λ(S A) ≥ 2.
    """

    A: LinearOperator
    smoother: LinearOperator
    transfer: Transfer | None
    smooths: bool = True


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
        rows = as_rows(x, self.shape[1])
        # In the nearest precision that LAPACK has.
        dtype = np.result_type(x, self.dtype)
        if dtype.char not in "fdFD":
            dtype = np.dtype(np.complex128 if dtype.kind == "c" else np.float64)
        columns = rows.reshape(-1, self.shape[1]).T.astype(dtype)
        solution = cho_solve(self._factor, columns, overwrite_b=True, check_finite=False)
        return np.asarray(solution).T.reshape(rows.shape)

    def _matmat(self, X: Array) -> Array:
        return self._matvec(X.mT).mT

    def _adjoint(self) -> "DenseInverse":
        return self

    def _transpose(self) -> "DenseInverse":
        return self

    def __repr__(self) -> str:
        return f"<DenseInverse {self.shape[0]}>"


def build_levels(
    A: LinearOperator,
    smoother: Smoother,
    coarsest: int,
    interpolation: Interpolation,
    coarsen: Coarsening | None,
) -> tuple[Level, ...]:
    """Coarsen `A` until at most `coarsest` unknowns are left, which are solved directly.

    A small coarse grid that the smoother refuses, or diverges on, is solved directly too: on a
    handful of elements the embedding of a Galerkin matrix says little of its inverse. So is the
    last grid of a mask on which no coarse element is in contact as a whole.

    Raises
    ------
    ValueError
        Where that last grid is too large to be solved directly, and where a smoother or a coarse
        matrix has not the shape that it must have.
    TypeError
        Where a smoother is no linear operator, or a coarse matrix no Toeplitz operator.
    """
    levels: list[Level] = []
    while A.shape[0] > coarsest and (between := Transfer.of(A, interpolation)) is not None:
        try:
            S = aslinearoperator(smoother(A))
        except np.linalg.LinAlgError as error:
            if levels and A.shape[0] <= LARGEST_DENSE:
                break
            error.add_note(f"This was the matrix of level {len(levels)} of multigrid, {A!r}.")
            raise
        if S.shape != A.shape:
            raise ValueError(f"the smoother has shape {S.shape}, but its matrix has {A.shape}")
        smooths = _converges(A, S)
        if not smooths and levels and A.shape[0] <= LARGEST_DENSE:
            break
        levels.append(Level(A, S, between, smooths))
        A = galerkin(A, interpolation) if coarsen is None else coarsen(A)
        between.check_coarse(A)
        interpolation = interpolation.coarser or interpolation
    if A.shape[0] > max(coarsest, LARGEST_DENSE):
        raise ValueError(
            f"the mask of {A!r} is in such fragments that no coarse element is in contact as a "
            f"whole, and too large to be solved directly (at most {LARGEST_DENSE} unknowns, or "
            "coarsest): use fft_preconditioner or fft_rsm_preconditioner with cg"
        )
    levels.append(Level(A, DenseInverse(A), None))
    return tuple(levels)


def _converges(A: LinearOperator, S: LinearOperator) -> bool:
    """Whether no eigenvalue of I - S A is expected below -1, of M̄ and of Jacobi's smoother.

    Of a multiple of the unit matrix that is certain by the norm of A; of M̄ by some steps of
    Lanczos's method, as nearly all eigenvalues of M̄ A are near 1. Of others it is not asked: that
    the paper's M diverges is what its Table I shows.
    """
    if isinstance(S, ScaledIdentity):
        return float(S.factor) * toeplitz_and_mask(A)[0].norm_bound < 2.0
    if isinstance(S, RowSumModified) and S.shape == A.shape:
        return bool(ritz_values(A, S, STEPS)[-1] <= CONVERGENT)
    return True
