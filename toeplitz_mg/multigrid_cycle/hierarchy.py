"""The list of levels: on each a matrix, a smoother and the way to the next coarser one."""

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

# Unknowns of the largest matrix that is factorised where no coarser grid can be had: it takes
# 32 MB, and its factorisation a tenth of a second.
LARGEST_DENSE = 2048
STEPS = 10  # Steps of Lanczos's method with a smoother and its matrix: two work units each.
CONVERGENT = 1.9  # Largest Ritz value of S A with which a smoother is taken to converge.


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
        Whether the smoother converges, 0 < λ(S A) < 2, or is not known to be symmetric.
    is_galerkin : bool
        Whether the matrix of the next coarser grid is that of `galerkin`.
    border : Border or None
        The fine unknowns that are solved for together with the coarse grid, once the level is part
        of a `Multigrid`.
    """

    A: LinearOperator
    smoother: LinearOperator
    transfer: Transfer | None
    converges: bool = True
    is_galerkin: bool = True
    border: Border | None = None

    @property
    def is_exact(self) -> bool:
        """Whether the smoother is the inverse, so that once is enough."""
        return isinstance(self.smoother, DenseInverse)


def build_levels(
    A: LinearOperator,
    smoother: Preconditioner | None,
    coarsest: int,
    interpolation: Interpolation,
    coarsen: Coarsening | None,
) -> tuple[Level, ...]:
    """Coarsen `A` until at most `coarsest` unknowns are left, which are solved directly.

    So are up to 2048 unknowns of a mask on which no coarse element is active as a whole, or of a
    coarse grid that a given smoother refuses: on a handful of elements the embedding of a Galerkin
    matrix says little of its inverse. Of more unknowns without a coarse grid the smoother takes
    all steps of the cycle.

    Raises
    ------
    ValueError
        If a smoother or a coarse matrix has not the shape that it must have.
    TypeError
        If a smoother is not a linear operator, or complex, or a coarse matrix not a Toeplitz
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
                        f"directly in the place of {coarsest} unknowns: {error}",
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
    """Return the smoother of a level, and whether it converges or is not known to be symmetric."""
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
    """Return M̄ where it converges and the coarse grid, or its border, covers nearly all unknowns.

    Elsewhere it is the default preconditioner, which is positive definite, over the largest
    eigenvalue of its product with `A`, so that it converges too.
    """
    mask = transfer.fine_mask
    is_blob = mask is not None and fragmentation(mask) <= COMPACT
    if is_blob or len(transfer.leftover) <= MOST_LEFTOVER:
        with suppress(np.linalg.LinAlgError):
            M_bar = modify_row_sums(A)
            if M_bar.converges(A):
                return M_bar
    # On a blob the choice for one solve is a sine transform, which smooths its edge badly.
    S = default_preconditioner(A, solves=2 if is_blob else 1)
    if isinstance(S, DenseInverse):
        return S  # A coarser grid would only add rounding.
    largest = float(ritz_values(A, S, STEPS)[-1])
    if not 0.0 < largest < np.inf:
        raise np.linalg.LinAlgError(f"A is {A!r}, but must be positive definite: use {INDEFINITE}")
    return DiagonallyScaled(S, np.array(largest**-0.5))
