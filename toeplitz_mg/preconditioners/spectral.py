"""The preconditioner from the spectral (Wiener-Hopf) factor of the symbol."""

from numpy.typing import DTypeLike
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg.columns.columns import Columns
from toeplitz_mg.columns.first_column import RESOLVED, double_line, find_columns
from toeplitz_mg.columns.gohberg_semencul import GohbergSemencul
from toeplitz_mg.operators import ToeplitzOperator
from toeplitz_mg.operators.base import require_numpy
from toeplitz_mg.operators.lifting import lift
from toeplitz_mg.operators.positivity import precision, require_condition


@lift(accepts="any")
def spectral_preconditioner(A: LinearOperator, *, dtype: DTypeLike | None = None) -> LinearOperator:
    """Return an approximate inverse of A from a factorisation of its symbol.

    Parameters
    ----------
    A : ToeplitzOperator, ToeplitzSum or CoupledOperator, or MaskedOperator of one
        Of one axis (other axes may have one element). Any Hermitian positive definite matrix; or
        a general one whose symbol has no zero and the winding number 0, as if the diagonal
        dominates, or if the real part of the symbol is positive.
    dtype : float32 or float64, optional
        Precision in which the preconditioner is stored and applied; by default that of `A`. Use
        complex64 or complex128 if `A` is complex. Single precision halves the memory and takes less
        time, also inside an iteration in double precision.

    Returns
    -------
    GohbergSemencul or MaskedOperator
        Same shape as `A`; Hermitian positive definite if `A` is, otherwise for use with `gmres`.
        One product costs two work units.

    Raises
    ------
    numpy.linalg.LinAlgError
        If A is Hermitian and not positive definite, or so ill-conditioned that float64 cannot tell,
        or that rounding in `dtype` may make its inverse indefinite. For other matrices, if the
        symbol winds around zero, or n is too small for its factors to be useful: try
        `chan_preconditioner`.
    ValueError
        If `A` has several axes.
    TypeError
        If `A` is not a Toeplitz operator.

    See Also
    --------
    toeplitz_inverse : the inverse, to full precision.
    cosine_preconditioner : for several axes.
    solve_toeplitz : selects a method for a system.

    Notes
    -----
    The symbol of a Hermitian matrix is factorised as ``f = |g|²`` with g causal: the causal half of
    the cepstrum (the Fourier coefficients of log f) is that of log g. With the coefficients q of
    1/g, q₀ q is the first column of the inverse of the half-infinite matrix. The Gohberg-Semencul
    formula turns its first n entries into an approximate inverse of A. The set-up takes one work
    unit, and two more to check the product with A and that the inverse is positive definite: that
    is so exactly if the polynomial with these coefficients has no zero in the closed unit disc.

    The symbol is sampled by embedding A in a circulant. Some eigenvalues of this circulant are not
    positive if the symbol has a zero, or if n lags do not resolve it, as for a covariance whose
    correlation length is not small compared to n. In these cases, and if the column misses
    A x = e₁ by more than one quarter, `toeplitz_mg.columns.schur` computes the column exactly, at
    some 30 work units for 2^20 unknowns and fewer for smaller systems.

    A matrix that is not Hermitian has two factors (see `toeplitz_mg.columns.spectral_factor`). They
    give the first column and the first row of the inverse, at some eight work units. Both are
    checked by their products with A, and improved by Newton's method if they miss by more than one
    quarter.

    References
    ----------
    A. Böttcher, B. Silbermann, Introduction to Large Truncated Toeplitz Matrices, Springer 1999,
    §1.5 (Wiener-Hopf factorisation).

    Examples
    --------
    >>> import numpy as np
    >>> from scipy.sparse.linalg import cg
    >>> import toeplitz_mg as tmg
    >>> A = tmg.ToeplitzOperator((1.0 + np.arange(1000.0)) ** -1.1)
    >>> x, info = cg(A, np.ones(1000), M=tmg.spectral_preconditioner(A), rtol=1e-8, maxiter=4)
    >>> info
    0
    """
    require_numpy(A, "spectral_preconditioner")
    return spectral_inverse(A, dtype=dtype)


def spectral_inverse(
    A: ToeplitzOperator, *, factor: Columns | None = None, dtype: DTypeLike | None = None
) -> GohbergSemencul:
    """Return `spectral_preconditioner`, given the columns of the spectral factor if known."""
    dtype = precision(A, dtype)
    columns = find_columns(double_line(A), RESOLVED, factor=factor)
    if columns.w is not None:
        return GohbergSemencul(columns.x.astype(dtype), columns.w.conj().astype(dtype))
    condition = columns.certificate.condition
    require_condition(condition, dtype, "the inverse of A", "chan_preconditioner(A)")
    return GohbergSemencul(columns.x.astype(dtype))
