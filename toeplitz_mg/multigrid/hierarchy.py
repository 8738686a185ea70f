"""The list of levels: on each a matrix, a smoother and the way to the next coarser one."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import LinearOperator, aslinearoperator

from toeplitz_mg.multigrid.interpolation import Interpolation
from toeplitz_mg.multigrid.transfer import Coarsening, Transfer, galerkin
from toeplitz_mg.operators.masked import toeplitz_and_mask
from toeplitz_mg.preconditioners.direct import DenseInverse
from toeplitz_mg.preconditioners.positivity import DENSE
from toeplitz_mg.preconditioners.row_sum import RowSumModified

Array = NDArray[Any]
Smoother = Callable[[LinearOperator], LinearOperator]

# The largest matrix factorised where no coarser grid can be had: 32 MB, a tenth of a second.
LARGEST_DENSE = 2048
POWERS = 12  # of the product of a smoother and its matrix, to find an eigenvalue above 2


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


def build_levels(
    A: LinearOperator,
    smoother: Smoother,
    coarsest: int,
    interpolation: Interpolation,
    coarsen: Coarsening | None,
) -> tuple[Level, ...]:
    """Coarsen `A` until at most `coarsest` unknowns are left, which are solved directly.

    A small coarse grid that the smoother refuses is solved directly too: on a handful of elements
    the embedding of a Galerkin matrix says little of its inverse. So is the last grid of a mask
    on which no coarse element is in contact as a whole.

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
            if isinstance(S, RowSumModified):
                _require_convergence(A, S)
        except np.linalg.LinAlgError as error:
            if levels and A.shape[0] <= LARGEST_DENSE:
                break
            error.add_note(f"This was the matrix of level {len(levels)} of multigrid, {A!r}.")
            raise
        if S.shape != A.shape:
            raise ValueError(f"the smoother has shape {S.shape}, but its matrix has {A.shape}")
        levels.append(Level(A, S, between))
        A = galerkin(A, interpolation) if coarsen is None else coarsen(A)
        between.check_coarse(A)
        interpolation = interpolation.coarser or interpolation
    if A.shape[0] > max(coarsest, LARGEST_DENSE):
        raise ValueError(
            f"the mask of {A!r} is in such fragments that no coarse element is in contact as a "
            f"whole, and too large to be solved directly (at most {LARGEST_DENSE} unknowns, or "
            "coarsest): use fft_preconditioner or fft_rsm_preconditioner with cg"
        )
    try:
        levels.append(Level(A, DenseInverse(A), None))
    except np.linalg.LinAlgError as error:
        raise np.linalg.LinAlgError(f"the matrix of the coarsest grid, {error}") from None
    return tuple(levels)


def _require_convergence(A: LinearOperator, S: RowSumModified) -> None:
    """Raise LinAlgError where I - M̄ A is found to have an eigenvalue below -1.

    By power iteration in the inner product of A, in which M̄ A is self-adjoint: its largest
    eigenvalue is at least the quotient. Not where the signs of M's coefficients certify M̄, as they
    do in one level, or on a large grid.
    """
    levels = len(toeplitz_and_mask(A)[0].squeezed.grid_shape)
    if S.shape != A.shape or (S.certified and (levels == 1 or A.shape[0] > DENSE)):
        return
    x = np.random.default_rng(0).standard_normal(A.shape[0]).astype(A.dtype)
    for _ in range(POWERS):
        u = A @ x
        x, before = S @ u, x
        quotient = float(u @ x) / float(before @ u)
        x /= np.linalg.norm(x)
        if not quotient < 2.0:
            raise np.linalg.LinAlgError(
                f"as a smoother {S!r} diverges: its product with the matrix has the eigenvalue "
                f"{quotient:.3g}, but needs all below 2: use cosine_preconditioner(A) with cg"
            )
