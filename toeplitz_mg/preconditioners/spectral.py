"""The spectral (Wiener-Hopf) factor of the symbol, as a preconditioner that sees both ends."""

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
    """Return the inverse of a Toeplitz matrix from the factors of the symbol of A.

    Parameters
    ----------
    A : ToeplitzOperator, ToeplitzSum or CoupledOperator, or MaskedOperator of one
        Of one axis with more than one element. If it is symmetric, or Hermitian, it is positive
        definite, and there is no other condition. Else its symbol has no zero and the winding
        number 0, as where the diagonal dominates, or the symbol has a positive real part.
    dtype : float32 or float64, optional
        The precision in which it is kept and applied, that of `A` by default; complex64 or
        complex128 where `A` is complex. In float32 it takes half the memory and less time, inside
        an iteration in float64 too.

    Returns
    -------
    GohbergSemencul or MaskedOperator
        Of the shape of `A`, symmetric or Hermitian positive definite where that is, and else one
        for `gmres`. One product costs two work units.

    Raises
    ------
    numpy.linalg.LinAlgError
        Where A is symmetric or Hermitian and not positive definite, or so ill-conditioned that
        float64 cannot tell, or that rounding in `dtype` may make its inverse indefinite. Of
        another matrix where the symbol winds around zero, or where its factors are no use with so
        few unknowns: `chan_preconditioner` may be.
    ValueError
        Where `A` has several axes.
    TypeError
        Where `A` is no Toeplitz operator.

    See Also
    --------
    toeplitz_inverse : the inverse itself.
    cosine_preconditioner : on several axes.
    solve_toeplitz : chooses.

    Notes
    -----
    Of a symmetric or Hermitian matrix the symbol is ``f = |g|²`` with g causal: the causal half of
    the cepstrum, the Fourier coefficients of log f, is that of log g. With the coefficients q of
    1/g, q₀ q is the first column of the inverse of the half-infinite matrix; the Gohberg-Semencul
    formula makes of its first n entries an approximate inverse with two ends. It costs one work
    unit to be made, and two to be checked: by its product with A, and for being positive definite,
    which it is exactly if the polynomial with these coefficients has no zero in the closed unit
    disc.

    The symbol is sampled by embedding A in a circulant. That has eigenvalues that are not
    positive where the symbol has a zero, or is not resolved by n lags, as for a covariance whose
    correlation length is not small against n. There, where the column misses A x = e₁ by more than
    one quarter, and where such a zero is not ruled out, the column is computed exactly, by
    `toeplitz_mg.columns.schur`, at some 30 work units in 2^20 unknowns and fewer in less.

    Another matrix has two factors, not one: see `toeplitz_mg.columns.spectral_factor`.
    These give the first column of the inverse and the first row, at some eight work units, and
    both are checked by their products with A. Where they miss by more than one quarter, steps of
    Newton's method are tried.

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
    """Return `spectral_preconditioner`, of the columns of the spectral factor if they are known."""
    dtype = precision(A, dtype)
    columns = find_columns(double_line(A), RESOLVED, factor=factor)
    if columns.w is not None:
        return GohbergSemencul(columns.x.astype(dtype), columns.w.conj().astype(dtype))
    condition = columns.certificate.condition
    require_condition(condition, dtype, "the inverse of A", "chan_preconditioner(A)")
    return GohbergSemencul(columns.x.astype(dtype))
