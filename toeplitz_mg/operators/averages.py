"""A Toeplitz matrix near a sum with diagonal ones, between two diagonal ones."""

from collections.abc import Callable
from typing import Any

import numpy as np

from toeplitz_mg._typing import Array, Mask
from toeplitz_mg.operators.toeplitz import ToeplitzOperator
from toeplitz_mg.operators.toeplitz_sum import ToeplitzSum


def hermitian_part(A: Any) -> Any:
    """Return (A + Aᴴ)/2, A itself where it is Hermitian."""
    return A if A.H is A else (A + A.H) / 2


def advise_of_negative(largest: float) -> str:
    """Return the end of the message that refuses a matrix with this largest diagonal entry."""
    if not largest < 0.0:
        return ""
    return "; the diagonal of -A is positive: where -A is positive definite solve -A x = -b"


def advise_of_indefinite(A: Any) -> str:
    """Return the end of the message that refuses a matrix whose 2 x 2 blocks are indefinite.

    It stands in place of preconditioners for positive definite matrices. Of others it is empty.
    """
    if not (isinstance(A, ToeplitzOperator) and A.is_hermitian):
        return ""
    lags = np.abs(A.library.to_numpy(A.lags)).ravel()
    middle = len(lags) // 2
    diagonal, others = lags[middle], np.delete(lags, middle)
    if others.max(initial=0.0) < diagonal:
        return ""
    solver = "gmres without M"
    if len(A.grid_shape) == 1:
        solver = f"solve_toeplitz(A.c, b), or {solver}"
    return (
        "; A is not positive definite, as a coefficient beside the diagonal is as large: use "
        f"{solver}"
    )


def average(
    A: ToeplitzSum, mask: Mask | None = None, part: Callable[[Any], Any] = hermitian_part
) -> tuple[ToeplitzOperator, Array]:
    """Return a Toeplitz matrix T and the entries of a diagonal one, with D T⁻¹ D ≈ A⁻¹.

    D² is the inverse of the diagonal of A. In D A D, whose diagonal is all ones, each diagonal
    matrix is replaced by its mean; T is the Hermitian part of that. For A + D with a D that is
    small against the diagonal of A this is A and the mean of D, for D A that of A between two
    diagonal matrices, and it goes from one to the other as the diagonal of the sum does.

    Parameters
    ----------
    A : ToeplitzSum
    mask : ndarray of bool, optional
        The unknowns, over which the means are taken.
    part : callable, optional
        What to take of a Toeplitz matrix in the place of its Hermitian part.

    Raises
    ------
    numpy.linalg.LinAlgError
        Where the diagonal is not positive.

    References
    ----------
    X. Huang, X.-L. Lin, M. K. Ng, H.-W. Sun, Spectral analysis for preconditioning of
    multi-dimensional Riesz fractional diffusion equations, Numer. Math. Theor. Meth. Appl. 15
    (2022). X.-L. Lin, X. Huang, M. K. Ng, H.-W. Sun, A τ-preconditioner for a non-symmetric linear
    system arising from multi-dimensional Riemann-Liouville fractional diffusion equation, Numer.
    Algorithms 92 (2023), for the symmetric part.
    """
    unknowns = slice(None) if mask is None else mask.ravel()
    diagonal = A.diagonal()[unknowns].real.astype(np.float64)
    if not diagonal.min() > 0.0:
        raise np.linalg.LinAlgError(
            f"the diagonal of A has the entry {diagonal.min():.3g}, but a preconditioner needs "
            f"all positive: use GMRES without one{advise_of_negative(float(diagonal.max()))}"
        )
    mean: Any = 0
    for left, T, right in A.terms:
        weights = 1.0 / diagonal
        for factor in (left, right):
            weights = weights if factor is None else weights * factor[unknowns]
        mean = mean + weights.mean() * T
    if A.offset is not None:
        mean = mean.plus_unit(np.mean(A.offset[unknowns] / diagonal))
    # Of a sum that is Hermitian the mean is too, but for rounding of weights that are complex.
    mean = hermitian_part(mean) if A.is_hermitian else part(mean)
    return mean.astype(A.dtype), 1.0 / np.sqrt(diagonal)
