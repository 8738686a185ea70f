"""Row-sum modification of the FFT preconditioner: M̄ and M̄_imp (paper, §4.2 and §5.4)."""

import numpy as np
from numpy.typing import DTypeLike
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.workspace import workspace
from toeplitz_mg.operators import GridOperator, ToeplitzOperator, apply_to_rows
from toeplitz_mg.operators.base import grid_of, work_of
from toeplitz_mg.operators.lifting import averaged, componentwise
from toeplitz_mg.operators.positivity import rounding
from toeplitz_mg.operators.structure import restrict, unwrap_toeplitz
from toeplitz_mg.preconditioners.fft import fft_preconditioner
from toeplitz_mg.preconditioners.row_sum_certificate import (
    DENSE,
    find_smallest_eigenvalue,
    is_certainly_positive,
)
from toeplitz_mg.values import real


class RowSumModified(GridOperator):
    """M minus a diagonal, such that every row sum is γ (paper, Eq. 19 and 22).

    Attributes
    ----------
    M : ToeplitzOperator or MaskedOperator
    diagonal : ndarray of shape (N,)
        The row sums of M less γ.
    gamma : float
        Every row sum of this operator.
    certified : bool
        Whether it is proved to be positive definite.
    """

    def __init__(self, M: LinearOperator, diagonal: Array, gamma: float, certified: bool) -> None:
        super().__init__(M.dtype, grid_of(M), work_of(M), M.shape[0])
        self.M = M
        self.diagonal = diagonal
        self.diagonal.flags.writeable = False
        self.gamma = gamma
        self.certified = certified

    def toarray(self) -> Array:
        """Return the dense matrix, shape (N, N)."""
        return self.M.toarray() - np.diag(self.diagonal)

    def apply(self, X: Array, out: Array | None = None) -> Array:
        """Multiply each row of `X` (see `GridOperator.apply`)."""
        change = workspace(X.shape, np.result_type(X, self.dtype))
        np.multiply(X, self.diagonal, out=change)  # Now, as `out`, which is written next, may be X.
        out = apply_to_rows(self.M, X, out)
        out -= change
        return out

    def converges(self, A: LinearOperator) -> bool | None:
        """Whether the iteration x ← x + S (b - A x) converges, as a certified one is expected to.

        On a large whole grid nothing is computed for it, which would take as long as two cycles:
        the coarser grids of multigrid, whose kernels are alike, tell it too.
        """
        is_large_and_whole = isinstance(A, ToeplitzOperator) and A.shape[0] > DENSE
        return True if is_large_and_whole and self.certified else None

    def __repr__(self) -> str:
        return f"<RowSumModified, row sums {self.gamma:.4g}, of {self.M!r}>"


@componentwise
@averaged
def fft_rsm_preconditioner(
    A: LinearOperator, gamma: float | None = None, *, dtype: DTypeLike | None = None
) -> LinearOperator:
    """Return M̄, the FFT preconditioner with constant row sums; on a mask M̄_imp.

    Parameters
    ----------
    A : ToeplitzOperator, ToeplitzSum or CoupledOperator, or MaskedOperator of one
        Symmetric positive definite, of any number of axes.
    gamma : float, optional
        The row sum γ, positive. By default the smallest row sum of M on the whole grid (paper,
        Eq. 20).
    dtype : float32 or float64, optional
        The precision in which it is kept and applied, that of `A` by default. In float32 it takes
        half the memory and less time, inside an iteration in float64 too.

    Returns
    -------
    RowSumModified
        M̄ = M - diag(sum(M) - γ) ≈ A⁻¹ (paper, Eq. 19), of the shape of `A`, symmetric,
        and positive definite for certain where its attribute `certified` is true. One product
        costs one work unit. On a mask M_r takes the place of M (Eq. 22).

    Raises
    ------
    numpy.linalg.LinAlgError
        Where γ is not positive, or not beyond the rounding of the row sums of M; where M̄ is found
        not to be positive definite, and where `fft_preconditioner` refuses.
    TypeError, ValueError
        Where `A` is no Toeplitz operator, or not symmetric.

    See Also
    --------
    fft_preconditioner : without the modification.
    multigrid : whose smoother it is.
    richardson : whose steps it makes a solver.

    Notes
    -----
    M assumes unknowns beyond the grid or the mask, which are not there, so that its row sums are
    too large at the ends. Lowering the diagonal to make them constant brings all eigenvalues of
    I - M̄ A into (-1, 1): a smoother for multigrid and, by `richardson`, a solver.

    M̄ is γ I plus a graph Laplacian whose weights are the negated off-diagonal coefficients of M,
    hence positive definite where those coefficients are at most 0, and where the others are
    outweighed, as in the paper's problems on every grid of multigrid. Elsewhere its eigenvalues
    are computed, up to 1024 unknowns. Beyond, 40 steps of Lanczos's method look for a negative
    eigenvalue of M̄ A, at 80 work units: what they do not find is accepted, but not `certified`.

    Examples
    --------
    >>> import numpy as np
    >>> import toeplitz_mg as tmg
    >>> A = tmg.ToeplitzOperator(1.0 / np.arange(1.0, 7.0))
    >>> M_bar = tmg.fft_rsm_preconditioner(A)
    >>> bool(np.allclose(M_bar @ np.ones(6), M_bar.gamma))
    True
    """
    full, mask = unwrap_toeplitz(A)
    M = fft_preconditioner(full, dtype=dtype)
    # One product with ones gives the row sums. By Eq. 20 γ is taken on the whole grid, also for a
    # mask.
    row_sums = M @ np.ones(full.shape[0], dtype=M.dtype)
    gamma = float(row_sums.min()) if gamma is None else real("gamma", gamma)
    if not 0.0 < gamma < np.inf:
        raise np.linalg.LinAlgError(
            f"the row sum gamma is {gamma:.3g}, but must be positive and finite: use "
            "fft_preconditioner(A), or give a positive gamma"
        )
    certain = is_certainly_positive(M, mask, gamma)
    if mask is not None:
        M = restrict(M, mask)
        row_sums = M @ np.ones(M.shape[0], dtype=M.dtype)
    if not gamma > (least := rounding(row_sums, M.dtype)):
        raise np.linalg.LinAlgError(
            f"the row sum gamma is {gamma:.3g}, but must be above the rounding of those of M, "
            f"{least:.2g}, so that M̄ is not singular: use fft_preconditioner(A), or "
            + ("a larger gamma" if M.dtype == np.float64 else "a larger gamma, or dtype=np.float64")
        )
    certified = certain or M.shape[0] <= DENSE
    M_bar = RowSumModified(M, row_sums - M.dtype.type(gamma), gamma, certified)
    if not certain and (smallest := find_smallest_eigenvalue(A, M_bar)) <= 0.0:
        raise np.linalg.LinAlgError(
            f"M with the row sums gamma = {gamma:.3g} is not positive definite (an eigenvalue of "
            f"it, or of its product with A, is {smallest:.3g} or less): use fft_preconditioner(A)"
        )
    return M_bar
