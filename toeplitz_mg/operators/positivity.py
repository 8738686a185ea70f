"""Whether a matrix is positive definite beyond rounding, and the error if it is not.

The sign decides if all eigenvalues are known; for a product of operators some are estimated.
"""

from typing import Any

import numpy as np
from numpy.typing import DTypeLike
from scipy.linalg import eigvalsh_tridiagonal
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.arrays.library import library_of
from toeplitz_mg.engine.ranks import ranks_of
from toeplitz_mg.engine.work import axes_of
from toeplitz_mg.operators.coefficients import check_precision, require_range

# Error of an eigenvalue in units of eps times the largest one; 1 to 3.8 was observed for transforms
# of lengths up to 2^18.
ROUNDING = 4.0
# The last advice in every refusal of a preconditioner, if A is certainly not positive definite and
# if it may be.
INDEFINITE = "solve_toeplitz(A.c, b) for a whole line, or gmres, which takes any matrix"
LAST_RESORT = f"{INDEFINITE}, or cg without M if A is positive definite after all"


def precision(A: Any, dtype: DTypeLike | None) -> np.dtype[Any]:
    """Return the precision of a preconditioner of A: `dtype`, or that of A.

    Raises a ValueError if A or its inverse is nearly outside the range of float32, where overflow
    or underflow would remain undetected.
    """
    with ranks_of(A).agree() as same:
        same["dtype"] = result = check_precision(A.dtype if dtype is None else dtype, A.dtype)
        A.library.require("dtype", result)
    blocks = getattr(A, "blocks", ((A,),))
    for block in (row[i] for i, row in enumerate(blocks)):
        require_range(0.0 if block is None else abs(complex(block.diagonal_entry)), result)
    return result


def require_positive_diagonal(diagonal: float) -> None:
    """Raise a LinAlgError if the diagonal of A shows that A is not positive definite."""
    if not diagonal > 0.0:
        raise np.linalg.LinAlgError(
            f"the diagonal of A is {diagonal:.3g}, but must be positive for a positive definite "
            f"matrix: use {INDEFINITE}"
        )


def is_positive(spectrum: Array, dtype: Any) -> bool:
    """Whether all eigenvalues are positive beyond the rounding of the largest."""
    return float(library_of(spectrum).xp.min(spectrum)) > rounding(spectrum, dtype)


def may_be_positive(spectrum: Array, dtype: Any) -> bool:
    """Whether no eigenvalue is negative beyond the rounding of the largest."""
    return float(library_of(spectrum).xp.min(spectrum)) > -rounding(spectrum, dtype)


def rounding(spectrum: Array, dtype: Any) -> float:
    """Return the rounding error that the transform may leave in eigenvalues."""
    xp = library_of(spectrum).xp
    return ROUNDING * float(np.finfo(dtype).eps) * float(xp.max(xp.abs(spectrum)))


def require_condition(condition: float, dtype: Any, subject: str, advice: str) -> None:
    """Raise a LinAlgError if rounding in this precision may make a matrix indefinite.

    The message: "`subject` has a condition number of 1e9, with which …: use `advice`", or float64.
    """
    if why := name_condition(condition, dtype, subject):
        single = np.dtype(dtype).char in "fF"
        raise np.linalg.LinAlgError(f"{why}: use {'float64' if single else advice}")


def name_condition(condition: float, dtype: Any, subject: str) -> str:
    """Say why rounding in this precision may make a matrix indefinite; empty if it may not."""
    if ROUNDING * float(np.finfo(dtype).eps) * condition < 1.0:
        return ""
    return (
        f"{subject} has a condition number of up to {condition:.1e}, with which rounding in "
        f"{np.dtype(dtype)} may make it indefinite"
    )


def require_positive(spectrum: Array, dtype: Any, subject: str, advice: str) -> None:
    """Raise a LinAlgError unless all eigenvalues are positive beyond the rounding of the largest.

    The message: "`subject` -0.1, but all must be above 1e-15: use `advice`".
    """
    if not is_positive(spectrum, dtype):
        least = float(library_of(spectrum).xp.min(spectrum))
        raise np.linalg.LinAlgError(
            f"{subject} {least:.3g}, but all must be above {rounding(spectrum, dtype):.2g}: "
            f"use {advice}"
        )


def require_nonzero(spectrum: Array, dtype: Any, subject: str, advice: str) -> None:
    """Raise a LinAlgError if an eigenvalue is zero within the rounding of the largest.

    The message: "`subject` 1e-17, but all must have a size above 1e-15: use `advice`".
    """
    xp = (library := library_of(spectrum)).xp
    if not float(xp.min(xp.abs(spectrum))) > (error := rounding(spectrum, dtype)):
        spectrum = library.to_numpy(spectrum)
        sizes = np.abs(spectrum)
        raise np.linalg.LinAlgError(
            f"{subject} {spectrum.flat[sizes.argmin()]:.3g}, but all must have a size above "
            f"{error:.2g}: use {advice}"
        )


def name_robust(grid_shape: tuple[int, ...]) -> str:
    """Name a preconditioner that is positive definite whenever A is, for an error message."""
    if axes_of(grid_shape) == 1:
        return "spectral_preconditioner(A), which is positive definite whenever A is"
    return "chan_preconditioner(A), which is positive definite whenever A is"


def name_for_smooth(grid_shape: tuple[int, ...]) -> str:
    """Name the best preconditioners for smooth kernels, for an error message."""
    if axes_of(grid_shape) == 1:
        return (
            "use spectral_preconditioner(A), or on a mask sine_preconditioner(A) if that is not "
            "refused"
        )
    return (
        "try cosine_preconditioner(A), on a mask sine_preconditioner(A), and if these are "
        f"refused use {name_robust(grid_shape)}"
    )


def ritz_values(A: LinearOperator, M: LinearOperator, steps: int) -> Array:
    """Return estimates of eigenvalues of M A, ascending and within their range.

    They come from this number of Lanczos steps in the inner product of A, in which M A is
    self-adjoint if M is symmetric. A step takes a product with A and one with M. The first vector
    is the sum of a constant and a random one. If numbers overflow, the result is NaN.
    """
    rng = np.random.default_rng(0)
    q = (1.0 + rng.standard_normal(A.shape[0])).astype(A.dtype)
    with np.errstate(over="ignore", invalid="ignore"):
        diagonal, off_diagonal = lanczos(A, M, q, steps)
    if not np.isfinite(diagonal + off_diagonal).all():
        return np.array([np.nan])
    return eigvalsh_tridiagonal(np.array(diagonal), np.array(off_diagonal))


def lanczos(
    A: LinearOperator, M: LinearOperator, q: Array, steps: int
) -> tuple[list[float], list[float]]:
    """Return the tridiagonal matrix of M A in A's inner product, started with q, by diagonals."""
    q_old = np.zeros_like(q)
    diagonal: list[float] = []
    off_diagonal: list[float] = []
    for _ in range(min(steps, A.shape[0])):
        p = A @ q
        norm = float(np.sqrt(max(q @ p, 0.0)))
        if diagonal:
            if norm <= np.finfo(A.dtype).eps * abs(diagonal[0]):
                break  # The Krylov space is exhausted.
            off_diagonal.append(norm)
        q, p = q / norm, p / norm
        w = M @ p
        diagonal.append(float(w @ p))
        q, q_old = w - diagonal[-1] * q - (norm if off_diagonal else 0.0) * q_old, q
    return diagonal, off_diagonal
