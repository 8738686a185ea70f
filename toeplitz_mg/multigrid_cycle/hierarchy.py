"""The list of levels: on each a matrix, a smoother and the way to the next coarser one."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.sparse.linalg import LinearOperator, aslinearoperator

from toeplitz_mg.multigrid_cycle.interpolation import Interpolation
from toeplitz_mg.multigrid_cycle.transfer import Coarsening, Transfer, galerkin
from toeplitz_mg.operators import ToeplitzOperator
from toeplitz_mg.operators.structure import unwrap_toeplitz
from toeplitz_mg.preconditioners.direct import DenseInverse
from toeplitz_mg.preconditioners.jacobi import ScaledIdentity
from toeplitz_mg.preconditioners.positivity import ritz_values
from toeplitz_mg.preconditioners.row_sum import RowSumModified

Smoother = Callable[[LinearOperator], LinearOperator]

# The largest matrix factorised where no coarser grid can be had: 32 MB, a tenth of a second.
LARGEST_DENSE = 2048
STEPS = 5  # of Lanczos's method with a smoother and its matrix, two work units each
EXAMINED = 2**10  # unknowns of a whole grid, above which M̄ is judged by the coarser grids
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
        Whether the smoother is known to converge, 0 < λ(S A) < 2, or not known to be symmetric.
    """

    A: LinearOperator
    smoother: LinearOperator
    transfer: Transfer | None
    smooths: bool = True


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
        why = (
            f"the neighbours on the grid of {A!r} are not coupled, so that no coarse grid helps"
            if isinstance(A, ToeplitzOperator)
            else f"the mask of {A!r} is in such fragments that no coarse element is whole in it"
        )
        raise ValueError(
            f"{why}, and it is too large to be solved directly (at most {LARGEST_DENSE} unknowns, "
            "or coarsest): use default_preconditioner with cg"
        )
    try:
        levels.append(Level(A, DenseInverse(A), None))
    except np.linalg.LinAlgError as error:
        raise np.linalg.LinAlgError(f"the matrix of the coarsest grid, {error}") from None
    return tuple(levels)


def _converges(A: LinearOperator, S: LinearOperator) -> bool:
    """Whether no eigenvalue of I - S A is expected below -1, if S is symmetric.

    Of a multiple of the unit matrix that is certain by the norm of A; of others by some steps of
    Lanczos's method, as nearly all eigenvalues of S A are near 1. A large whole grid with a
    certified M̄ is judged by its coarser ones, whose kernels are alike: the steps would take as
    long as two cycles.
    """
    if S.H is not S:
        return True
    if isinstance(S, ScaledIdentity):
        return float(S.factor) * unwrap_toeplitz(A)[0].norm_bound < 2.0
    is_large_and_whole = isinstance(A, ToeplitzOperator) and A.shape[0] > EXAMINED
    if is_large_and_whole and isinstance(S, RowSumModified) and S.certified:
        return True
    return bool(ritz_values(A, S, STEPS)[-1] <= CONVERGENT)
