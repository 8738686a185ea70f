"""The log-determinant of a positive definite Toeplitz matrix, in O(n log n)."""

from math import log

from numpy.typing import ArrayLike

from toeplitz_mg.solvers.inverse import first_columns
from toeplitz_mg.solvers.reflection import read_column
from toeplitz_mg.solvers.sharp_column import sharpen
from toeplitz_mg.solvers.szego import LogDeterminant, log_determinant, warn_of_error


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
        10⁷, and mostly beyond; but of a few sinusoids in noise, with more than 2048
        unknowns, of up to some 1e-10. For an estimate of it see
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
    reflection_coefficients : the partial autocorrelations of a process.
    toeplitz_inverse : Its attributes `logdet` and `diagonal_sums` have this and the derivatives.

    Notes
    -----
    log det A is the sum of the logarithms of the prediction errors, which follow from the
    reflection coefficients. Up to 512 unknowns these come from Levinson's recursion, if A is well
    conditioned.

    The first column x of A⁻¹ is that of the autoregressive process whose covariances start as c:
    ``e/|a|²`` with e = 1/x₀ and a = x/x₀ is its spectral density. Szegő's strong limit theorem,
    which is exact for it, gives ``log det A = n log e + Σ k |ℓₖ|²`` with log a(z) = Σ ℓₖ zᵏ. That
    series is computed from samples on the circle, from more where its last terms are not small.
    Covariances of long memory have one real zero next to the circle, whose part of the series is
    known. Where A is ill-conditioned x is corrected by residuals of more than double precision.

    Where the series is too long the reflection coefficients are those of x, by Levinson's steps
    backwards, in n² operations; of more than 2048 unknowns those of the superfast Schur
    algorithm, at some 30 work units, or else a longer series is summed. Up to 2048 unknowns
    Cholesky's factors are made where all of these leave an error above 1e-11.

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
    A, power = read_column(c, "toeplitz_logdet(A.c), or toeplitz_inverse(A).logdet")
    n = len(A.c)
    value, error = log_determinant(A, lambda start: sharpen(first_columns(A, start)))
    found = LogDeterminant(value + n * power * log(2.0), error)
    warn_of_error(found, n, stacklevel=3)
    return found.value
