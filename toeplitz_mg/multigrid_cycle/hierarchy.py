"""The list of levels, each with a matrix, a smoother and the transfer to the next coarser grid."""

import warnings
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from scipy.sparse.linalg import LinearOperator, aslinearoperator

from toeplitz_mg._typing import Coarsening, Preconditioner
from toeplitz_mg.multigrid_cycle.border import MOST_LEFTOVER, Border
from toeplitz_mg.multigrid_cycle.interpolation import Interpolation
from toeplitz_mg.multigrid_cycle.transfer import Transfer
from toeplitz_mg.operators import GridOperator
from toeplitz_mg.operators.composed import DiagonallyScaled
from toeplitz_mg.operators.positivity import INDEFINITE, ritz_values
from toeplitz_mg.preconditioners import default_preconditioner
from toeplitz_mg.preconditioners.choice import COMPACT
from toeplitz_mg.preconditioners.direct import DenseInverse
from toeplitz_mg.preconditioners.row_sum import modify_row_sums
from toeplitz_mg.preconditioners.traits import fragmentation

# Largest matrix that is factorised if there is no coarser grid: it takes 32 MB, and a tenth of a
# second.
LARGEST_DENSE = 2048
STEPS = 10  # Lanczos steps for a smoother and its matrix; a step costs two work units.
CONVERGENT = 1.9  # Largest Ritz value of S A for which a smoother is assumed to converge.


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
        Whether the smoother converges, 0 < λ(S A) < 2; True if it is not known to be symmetric.
    is_galerkin : bool
        Whether the matrix of the next coarser grid is that of `galerkin`.
    border : Border or None
        The fine unknowns that are solved together with the coarse grid; set by `Multigrid`.
    """

    A: LinearOperator
    smoother: LinearOperator
    transfer: Transfer | None
    converges: bool = True
    is_galerkin: bool = True
    border: Border | None = None

    @property
    def is_exact(self) -> bool:
        """Whether the smoother is the exact inverse, so that one step is enough."""
        return isinstance(self.smoother, DenseInverse)


def build_levels(
    A: LinearOperator,
    smoother: Preconditioner | None,
    coarsest: int,
    interpolation: Interpolation,
    coarsen: Coarsening | None,
) -> tuple[Level, ...]:
    """Return levels from `A` down to at most `coarsest` unknowns, which are solved directly.

    Up to 2048 unknowns are also solved directly if no coarse element of a mask is fully active, or
    if a given smoother refuses a coarse grid: with few elements the embedding of a Galerkin matrix
    says little about its inverse. More unknowns without a coarse grid are only smoothed.

    Raises
    ------
    ValueError
        If a smoother or a coarse matrix has the wrong shape.
    TypeError
        If a smoother is not a linear operator, or complex, or if a coarse matrix is not a Toeplitz
        operator.
    """
    levels: list[Level] = []
    while A.shape[0] > coarsest:
        transfer = Transfer.of(A, interpolation)
        if not transfer.has_coarse_grid and A.shape[0] <= LARGEST_DENSE:
            break
        try:
            S, converges = _make_smoother(smoother, A, transfer)
        except np.linalg.LinAlgError as error:
            if levels and A.shape[0] <= LARGEST_DENSE:
                if smoother is not None:
                    warnings.warn(
                        f"the smoother refuses level {len(levels)} of multigrid, which is solved "
                        f"directly instead of {coarsest} unknowns: {error}",
                        stacklevel=4,
                    )
                break
            error.add_note(f"This was the matrix of level {len(levels)} of multigrid, {A!r}.")
            raise
        if not transfer.has_coarse_grid or (smoother is None and isinstance(S, DenseInverse)):
            return (*levels, Level(A, S, None, converges))
        levels.append(Level(A, S, transfer, converges, coarsen is None))
        if coarsen is None:
            A = transfer.coarse_matrix(A)
        else:
            A = transfer.check_coarse_matrix(coarsen(A))
        interpolation = interpolation.coarser or interpolation
    try:
        return (*levels, Level(A, DenseInverse(A), None))
    except np.linalg.LinAlgError as error:
        raise np.linalg.LinAlgError(f"the matrix of the coarsest grid, {error}") from None


def _make_smoother(
    smoother: Preconditioner | None, A: LinearOperator, transfer: Transfer
) -> tuple[LinearOperator, bool]:
    """Return the smoother of a level, and whether it converges (True if that is not known)."""
    if smoother is None:
        return _default_smoother(A, transfer), True
    S = aslinearoperator(smoother(A))
    if S.shape != A.shape:
        raise ValueError(f"the smoother has shape {S.shape}, but its matrix has {A.shape}")
    if np.dtype(S.dtype).kind == "c":
        raise TypeError(f"the smoother has dtype {S.dtype}, but its matrix has {A.dtype}")
    if S.H is not S:
        return S, True
    known = S.converges(A) if isinstance(S, GridOperator) else None
    return S, bool(ritz_values(A, S, STEPS)[-1] <= CONVERGENT) if known is None else known


def _default_smoother(A: LinearOperator, transfer: Transfer) -> LinearOperator:
    """Return M̄ if it converges and the coarse grid, or its border, covers nearly all unknowns.

    Otherwise return the default preconditioner, which is positive definite, divided by the largest
    eigenvalue of its product with `A`, so that it converges.
    """
    mask = transfer.fine_mask
    is_blob = mask is not None and fragmentation(mask) <= COMPACT
    if is_blob or len(transfer.leftover) <= MOST_LEFTOVER:
        with suppress(np.linalg.LinAlgError):
            M_bar = modify_row_sums(A)
            if M_bar.converges(A):
                return M_bar
    # For one solve on a blob a sine transform would be selected, which smooths its edge badly.
    S = default_preconditioner(A, solves=2 if is_blob else 1)
    if isinstance(S, DenseInverse):
        return S  # A coarser grid would only add rounding.
    largest = float(ritz_values(A, S, STEPS)[-1])
    if not 0.0 < largest < np.inf:
        raise np.linalg.LinAlgError(f"A is {A!r}, but must be positive definite: use {INDEFINITE}")
    return DiagonallyScaled(S, np.array(largest**-0.5))
