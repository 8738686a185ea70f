"""The log-determinant of a positive definite Toeplitz matrix, in O(n log n)."""

from math import log

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg.columns.first_column import double_line
from toeplitz_mg.engine.powers import power_above
from toeplitz_mg.operators import ToeplitzOperator
from toeplitz_mg.solvers.inverse import SAFE_SIZES, first_columns
from toeplitz_mg.solvers.sharp_column import sharpen
from toeplitz_mg.solvers.szego import LogDeterminant, log_determinant, warn_of_error
from toeplitz_mg.values import refuse_masked


def toeplitz_logdet(c: ArrayLike) -> float:
    """Return the logarithm of the determinant of a positive definite Toeplitz matrix.

    Parameters
    ----------
    c : array_like of shape (n,)
        First column, real or complex, as in `scipy.linalg.toeplitz`: the matrix A is symmetric, or
        Hermitian where c is complex and c[0] real.

    Returns
    -------
    float
        log det A, with a relative error of up to some 1e-12 where the condition number is up to
        10⁷, and mostly beyond; but of more than 2048 unknowns with lines in their spectrum, as
        sinusoids in noise, of up to some 1e-10. For an estimate of it see
        `ToeplitzNormal.logdet_error`.

    Raises
    ------
    numpy.linalg.LinAlgError
        Where A is not positive definite, exactly or in the arithmetic of float64. The message says
        which leading block is not; a larger c[0], a nugget, makes any matrix positive definite.
    ValueError
        For `c` with several axes, for which no exact way is known that is as fast; or numbers that
        `ToeplitzOperator` refuses.

    Warns
    -----
    scipy.linalg.LinAlgWarning
        Where the estimated error is above 1e-10 n and 1e-10 of the result.

    See Also
    --------
    toeplitz_inverse : Its attributes `logdet` and `diagonal_sums` have this and the derivatives.

    Notes
    -----
    The first column x of A⁻¹ is that of the autoregressive process whose covariances start as c:
    ``e/|a|²`` with e = 1/x₀ and a = x/x₀ is its spectral density. Szegő's strong limit theorem,
    which is exact for it, gives ``log det A = n log e + Σ k |ℓₖ|²`` with log a(z) = Σ ℓₖ zᵏ. That
    series is computed from samples on the circle, from more where its last terms are not small.
    Covariances of long memory have one real zero next to the circle, whose part of the series is
    known. Where the series is too long, log det A is the sum of the logarithms of the prediction
    errors, by the superfast Schur algorithm, at some 30 work units, or up to 512 unknowns that of
    Cholesky's factors; or the longer series, or up to 2048 unknowns those factors, where the
    estimated error is smaller so. Where A is
    ill-conditioned x is corrected by residuals of more than double precision.

    References
    ----------
    B. Simon, Orthogonal Polynomials on the Unit Circle, Part 1, AMS 2005, ch. 6.

    Examples
    --------
    >>> import numpy as np
    >>> import toeplitz_mg as tmg
    >>> c = 0.9 ** np.arange(100_000)  # Its determinant is that of 99,999 errors 1 - 0.9².
    >>> round(tmg.toeplitz_logdet(c) / float(np.log(1 - 0.9**2)), 8)
    99999.0
    """
    if isinstance(c, LinearOperator) or hasattr(c, "slab"):
        raise TypeError(
            f"c is {c!r}, but must be the first column of a matrix: of a ToeplitzOperator A write "
            "toeplitz_logdet(A.c), or toeplitz_inverse(A).logdet"
        )
    column = refuse_masked("c", c)
    if column.ndim > 1:
        raise ValueError(
            f"c has shape {column.shape}, but must have one axis: no exact way to the determinant "
            "is known for several axes that is faster than a dense factorisation"
        )
    A = ToeplitzOperator(column)
    if not A.is_hermitian:
        raise ValueError(f"c[0] is {A.c[0]}, but must be real, as the matrix is to be Hermitian")
    if not A.c[0].real > 0.0:
        raise np.linalg.LinAlgError(
            f"the diagonal of A is {A.c[0].real:g}, but that of a positive definite one is positive"
        )
    line, power = double_line(A), 0
    if not SAFE_SIZES[0] <= line.norm_bound <= SAFE_SIZES[1]:
        power = int(power_above(line.norm_bound))
        line = ToeplitzOperator(line.c * 2.0**-power)
    value, error = log_determinant(sharpen(first_columns(line)))
    found = LogDeterminant(value + len(A.c) * power * log(2.0), error)
    warn_of_error(found, len(A.c), stacklevel=3)
    return found.value
