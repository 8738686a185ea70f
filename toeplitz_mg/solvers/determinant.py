"""The log-determinant of a positive definite Toeplitz matrix, in O(n log n)."""

from math import log

from numpy.typing import ArrayLike

from toeplitz_mg.solvers.inverse import first_columns
from toeplitz_mg.solvers.refined_column import refine_column
from toeplitz_mg.solvers.reflection import read_column
from toeplitz_mg.solvers.szego import LogDeterminant, log_determinant, warn_of_error


def toeplitz_logdet(c: ArrayLike) -> float:
    """Return the logarithm of the determinant of a positive definite Toeplitz matrix.

    Parameters
    ----------
    c : array_like of shape (n,)
        First column, real or complex, as in `scipy.linalg.toeplitz`: A is symmetric, or Hermitian
        if c is complex with a real c[0].

    Returns
    -------
    float
        log det A, with a relative error of up to some 1e-12 for condition numbers up to 10⁷, and
        mostly beyond (up to some 1e-10 for a few sinusoids in noise with more than 2048 unknowns).
        `ToeplitzNormal.logdet_error` estimates the error.

    Raises
    ------
    numpy.linalg.LinAlgError
        If A is not positive definite, exactly or in float64. The message tells which leading block
        is not. A larger c[0] (a nugget) makes any matrix positive definite.
    ValueError
        If `c` has several axes, for which no equally fast exact method is known, or has numbers
        that `ToeplitzOperator` refuses.

    Warns
    -----
    scipy.linalg.LinAlgWarning
        If the estimated error is above 1e-10 n and above 1e-10 of the result.

    See Also
    --------
    reflection_coefficients : the partial autocorrelations of a process.
    toeplitz_inverse : has the attributes `logdet` and `diagonal_sums`, the derivatives.

    Notes
    -----
    log det A is the sum of the logarithms of the prediction errors, which follow from the
    reflection coefficients. For up to 512 unknowns and a well-conditioned A these come from
    Levinson's recursion.

    The first column x of A⁻¹ belongs to the autoregressive process whose covariances start with c:
    its spectral density is ``e/|a|²`` with e = 1/x₀ and a = x/x₀. For this process Szegő's strong
    limit theorem is exact: ``log det A = n log e + Σ k |ℓₖ|²`` with log a(z) = Σ ℓₖ zᵏ. The series
    is computed from samples on the unit circle, as many as its last terms require. Covariances of
    long memory have one real zero next to the circle, whose part of the series is known in closed
    form. If A is ill-conditioned, x is corrected by residuals of more than double precision.

    If the series is too long, the reflection coefficients are computed from x by Levinson's
    recursion backwards, in n² operations. With more than 2048 unknowns they come from the superfast
    Schur algorithm, at some 30 work units, or a longer series is summed. Up to 2048 unknowns a
    Cholesky factorisation is used if all of these leave an error above 1e-11.

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
    value, error = log_determinant(A, lambda start: refine_column(first_columns(A, start)))
    found = LogDeterminant(value + n * power * log(2.0), error)
    warn_of_error(found, n, stacklevel=3)
    return found.value
