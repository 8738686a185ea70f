"""The candidates of the choice that are the same for every matrix, and what makes them."""

from functools import partial

import numpy as np
from numpy.typing import DTypeLike
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg.operators.lifting import unwrap
from toeplitz_mg.operators.positivity import precision
from toeplitz_mg.preconditioners.circulant import chan_preconditioner
from toeplitz_mg.preconditioners.direct import DenseInverse
from toeplitz_mg.preconditioners.fsai.neighbours import NUMBERS, ON_LINE
from toeplitz_mg.preconditioners.fsai.preconditioner import coupled_fsai, fsai_preconditioner
from toeplitz_mg.preconditioners.fsai.stencil import NEIGHBOURS
from toeplitz_mg.preconditioners.selection import Candidate
from toeplitz_mg.preconditioners.spectral import spectral_preconditioner
from toeplitz_mg.preconditioners.trigonometric import cosine_preconditioner, sine_preconditioner


def factorise(A: LinearOperator, *, dtype: DTypeLike | None = None) -> DenseInverse:
    """Return the inverse by a Cholesky factor, or refuse it where its precision is not enough."""
    inverse = DenseInverse(A, precision(unwrap(A)[0], dtype))
    if not inverse.is_accurate:
        raise np.linalg.LinAlgError(f"A is too ill-conditioned for a factor in {inverse.dtype}")
    return inverse


def couple(A: LinearOperator, *, dtype: DTypeLike | None = None) -> LinearOperator:
    """Return FSAI of all components together, or refuse it where their coupling is weak."""
    joint = coupled_fsai(A, dtype)
    if joint is None:
        raise np.linalg.LinAlgError("the coupling is weak, or not that of a half-space")
    return joint


def quick_fsai(A: LinearOperator, *, dtype: DTypeLike | None = None) -> LinearOperator:
    """Return `fsai_preconditioner` with the fewest neighbours, whose set-up is the shortest."""
    return fsai_preconditioner(A, neighbours=NEIGHBOURS, dtype=dtype)


SMOOTH = NUMBERS[1]  # Neighbours in a row of FSAI for covariances that are smooth.
OF_SMOOTH = Candidate.of(
    fsai_preconditioner,
    f"{SMOOTH} neighbours, for a smooth kernel",
    partial(fsai_preconditioner, neighbours=SMOOTH),
)
OF_LINE_WITH_GAPS = Candidate.of(
    fsai_preconditioner,
    f"a mask of a line; {ON_LINE} neighbours",
    partial(fsai_preconditioner, neighbours=ON_LINE),
)
OF_ANY_LINE = Candidate.of(spectral_preconditioner, "as good as the inverse, whatever the symbol")
OF_ANY_MATRIX = Candidate.of(chan_preconditioner, "whatever the kernel")
OTHERS = (
    Candidate.of(sine_preconditioner, "whatever the kernel"),
    Candidate.of(cosine_preconditioner, "whatever the kernel"),
    OF_ANY_MATRIX,
)
