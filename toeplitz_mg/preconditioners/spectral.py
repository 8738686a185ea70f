"""The spectral (Wiener-Hopf) factor of the symbol, as a preconditioner that sees both ends."""

import numpy as np
from numpy.typing import DTypeLike
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array
from toeplitz_mg.columns.columns import RESOLVED, Columns
from toeplitz_mg.columns.gohberg_semencul import GohbergSemencul
from toeplitz_mg.columns.schur import schur_column
from toeplitz_mg.engine.lengths import near_fast_length
from toeplitz_mg.engine.transforms import cosine_sums, sine_sums
from toeplitz_mg.operators import ToeplitzOperator
from toeplitz_mg.operators.base import require_numpy
from toeplitz_mg.operators.lifting import of_any_matrix
from toeplitz_mg.operators.positivity import is_positive, precision, require_condition
from toeplitz_mg.operators.structure import squeeze_line
from toeplitz_mg.operators.symbol import sample_symbol
from toeplitz_mg.preconditioners.wiener_hopf import (
    ADVICE,
    factor_positive_symbol,
    factor_symbol,
)


@of_any_matrix
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

    Another matrix has two factors, not one: see `toeplitz_mg.preconditioners.wiener_hopf`.
    These give the first column of the inverse and the first row, at some eight work units, and
    both are checked by their products with A. Where they miss by more than one quarter, one step
    of Newton's method is tried.

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
    return inverse_of_factor(A, approximate_columns(A), dtype=dtype)


def approximate_columns(A: ToeplitzOperator) -> Columns:
    """Return columns that make a preconditioner: those of the factors, or exact ones.

    A LinAlgError says why a matrix that is not Hermitian has none.
    """
    line = double_line(A)
    if not A.is_hermitian:
        return _of_general(line)
    if line.dtype.kind == "c":
        factor = factor_positive_symbol(line)
    else:
        factor = factor_column(line, sample_symbol(line, (near_fast_length(len(line.c)),)))
    if factor is None or not factor.is_inverse:
        return exact_columns(line)
    return factor


def double_line(A: ToeplitzOperator) -> ToeplitzOperator:
    """Return a matrix of one axis in double precision, without axes of one element."""
    return squeeze_line(A).astype(np.result_type(A.dtype, np.float64))


def exact_columns(A: ToeplitzOperator) -> Columns:
    """Return the column of a Hermitian positive definite matrix, by the Schur algorithm."""
    return Columns(A, schur_column(A.c)[0])


def _of_general(A: ToeplitzOperator) -> Columns:
    columns = factor_symbol(A)
    if not columns.is_inverse:
        columns = columns.improve()
    if not columns.is_inverse:
        raise np.linalg.LinAlgError(
            f"the Wiener-Hopf factors of A give a column of the inverse with the residual "
            f"{columns.residual:.2g}, but need {RESOLVED:g}: {ADVICE}"
        )
    return columns


def inverse_of_factor(
    A: ToeplitzOperator, factor: Columns, *, dtype: DTypeLike | None = None
) -> GohbergSemencul:
    """Return the inverse of A from columns, or refuse it where rounding may make it indefinite."""
    dtype = precision(A, dtype)
    if factor.w is not None:
        return GohbergSemencul(factor.x.astype(dtype), factor.w.conj().astype(dtype))
    condition = factor.certificate.condition
    require_condition(condition, dtype, "the inverse of A", "chan_preconditioner(A)")
    return GohbergSemencul(factor.x.astype(dtype))


def schur_inverse(A: ToeplitzOperator, *, dtype: DTypeLike | None = None) -> GohbergSemencul:
    """Return the inverse of a line from its exact column, by the Schur algorithm."""
    return inverse_of_factor(A, exact_columns(double_line(A)), dtype=dtype)


def factor_column(A: ToeplitzOperator, samples: Array) -> Columns | None:
    """Approximate A⁻¹ e₁ by the spectral factor, or return None where the symbol has none.

    The samples are those at θ = πk/m, k = 0 … m, the eigenvalues of a circulant of size 2m.
    """
    (n,) = A.grid_shape
    m = len(samples) - 1
    if not is_positive(samples, A.dtype):
        return None
    # With the causal half of the cepstrum log g has the real part ½ log f; -φ is its imaginary
    # part, and 1/g = f^(-1/2) (cos φ + i sin φ).
    phi = sine_sums(cosine_sums(np.log(samples)) / (4 * m))
    size = 1.0 / np.sqrt(samples)
    q = (cosine_sums(size * np.cos(phi)) - sine_sums(size * np.sin(phi)))[:n] / (2 * m)
    return Columns(A, q[0] * q)
