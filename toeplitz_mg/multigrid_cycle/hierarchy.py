"""The list of levels: on each a matrix, a smoother and the way to the next coarser one."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse.linalg import LinearOperator, aslinearoperator

from toeplitz_mg._typing import Coarsening, Preconditioner
from toeplitz_mg.multigrid_cycle.border import Border
from toeplitz_mg.multigrid_cycle.interpolation import Interpolation
from toeplitz_mg.multigrid_cycle.transfer import Transfer
from toeplitz_mg.operators import GridOperator, ToeplitzOperator
from toeplitz_mg.operators.positivity import ritz_values
from toeplitz_mg.preconditioners.direct import DenseInverse

# Unknowns of the largest matrix that is factorised where no coarser grid can be had: it takes
# 32 MB, and its factorisation a tenth of a second.
LARGEST_DENSE = 2048
STEPS = 5  # Steps of Lanczos's method with a smoother and its matrix: two work units each.
# Largest Ritz value of S A with which a smoother is taken to converge. So few steps find a value
# that is a little too small: up to this one no eigenvalue above 2 is expected.
CONVERGENT = 1.7


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
    converges : bool
        Whether the smoother is taken to converge, 0 < λ(S A) < 2, or is not known to be symmetric.
    border : Border or None
        The fine unknowns that are solved for together with the coarse grid, once the level is part
        of a `Multigrid`.
    """

    A: LinearOperator
    smoother: LinearOperator
    transfer: Transfer | None
    converges: bool = True
    border: Border | None = None


def build_levels(
    A: LinearOperator,
    smoother: Preconditioner,
    coarsest: int,
    interpolation: Interpolation,
    coarsen: Coarsening | None,
) -> tuple[Level, ...]:
    """Coarsen `A` until at most `coarsest` unknowns are left, which are solved directly.

    A small coarse grid that the smoother refuses, or diverges on, is solved directly too: on a
    handful of elements the embedding of a Galerkin matrix says little of its inverse. So is the
    last grid of a mask on which no coarse element is active as a whole.

    Raises
    ------
    ValueError
        Where that last grid is too large to be solved directly, and where a smoother or a coarse
        matrix has not the shape that it must have.
    TypeError
        Where a smoother is no linear operator, or complex, or a coarse matrix no Toeplitz operator.
    """
    levels: list[Level] = []
    while A.shape[0] > coarsest and (transfer := Transfer.of(A, interpolation)).has_coarse_grid:
        is_small_and_coarse = levels and A.shape[0] <= LARGEST_DENSE
        try:
            S = aslinearoperator(smoother(A))
        except np.linalg.LinAlgError as error:
            if is_small_and_coarse:
                break
            error.add_note(f"This was the matrix of level {len(levels)} of multigrid, {A!r}.")
            raise
        if S.shape != A.shape:
            raise ValueError(f"the smoother has shape {S.shape}, but its matrix has {A.shape}")
        if np.dtype(S.dtype).kind == "c":
            raise TypeError(f"the smoother has dtype {S.dtype}, but its matrix has {A.dtype}")
        converges = _converges(A, S)
        if not converges and is_small_and_coarse:
            break
        levels.append(Level(A, S, transfer, converges))
        if coarsen is None:
            A = transfer.coarse_matrix(A)
        else:
            A = transfer.check_coarse_matrix(coarsen(A))
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

    The smoother says so, where it knows. Else some steps of Lanczos's method tell, as nearly all
    eigenvalues of S A are near 1.
    """
    if S.H is not S:
        return True
    known = S.converges(A) if isinstance(S, GridOperator) else None
    return bool(ritz_values(A, S, STEPS)[-1] <= CONVERGENT) if known is None else known
