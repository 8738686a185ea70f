"""The spectral (Wiener-Hopf) factor of the symbol, as a preconditioner that sees both ends."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import fft
from scipy.linalg import norm
from scipy.sparse.linalg import LinearOperator, cg

from toeplitz_mg.operators import MaskedOperator, ToeplitzOperator
from toeplitz_mg.operators.gohberg_semencul import GohbergSemencul
from toeplitz_mg.operators.masked import toeplitz_and_mask
from toeplitz_mg.preconditioners.fft import fft_preconditioner
from toeplitz_mg.preconditioners.positivity import require_positive

Array = NDArray[Any]

RESOLVED = 0.5  # ‖A x - e₁‖ up to which the inverse from x is as good as it can be


def first_column_of_inverse(A: ToeplitzOperator) -> Array:
    """Approximate A⁻¹ e₁ by the spectral factor of the symbol: see `spectral_preconditioner`."""
    (n,) = A.grid_shape
    spectrum = fft.rfft(A.circulant((2 * n - 1,))).real
    require_positive(
        spectrum,
        A.dtype,
        "the embedding of A in a circulant, whose logarithm is taken, has the eigenvalue",
        "sine_preconditioner(A) or chan_preconditioner(A)",
    )
    cepstrum = fft.irfft(np.log(spectrum), 2 * n - 1)
    cepstrum[0] /= 2.0  # the causal half of log f, and so of f = |g|²
    cepstrum[n:] = 0.0
    q = fft.irfft(np.exp(-fft.rfft(cepstrum)), 2 * n - 1)[:n]  # of 1/g
    return np.asarray(q[0] * q)


def spectral_preconditioner(A: LinearOperator) -> LinearOperator:
    """Return the inverse of a Toeplitz matrix from the spectral factor of the symbol of A.

    Parameters
    ----------
    A : ToeplitzOperator of one level, or MaskedOperator of one
        Symmetric positive definite.

    Returns
    -------
    GohbergSemencul, or as `fft_preconditioner`, or MaskedOperator
        Of the shape and dtype of `A`, symmetric. One product costs two work units.

    Raises
    ------
    numpy.linalg.LinAlgError
        Where an eigenvalue of the embedding in a circulant is not positive.
    ValueError
        Where `A` has several levels, or is not symmetric.
    TypeError
        Where `A` is no Toeplitz operator.

    Notes
    -----
    The symbol is f = |g|² with g causal: the causal half of the cepstrum, the Fourier
    coefficients of log f, is that of log g. With the coefficients q of 1/g, q₀ q is the first
    column of the inverse of the half-infinite matrix; the Gohberg-Semencul formula makes of its
    first n entries an approximate inverse with two ends. It needs no product to be made, and one
    to be checked: where the column misses A x = e₁ by more than one half, as for a covariance
    whose correlation length is not small against n, the column is computed by CG with M instead,
    and where that fails too, M is returned.

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
    full, mask = toeplitz_and_mask(A)
    if len(full.grid_shape) != 1:
        raise ValueError(f"A lives on the grid {full.grid_shape}, but must have one level")
    M = _resolved(full)
    return M if mask is None else MaskedOperator(M, mask)


def _resolved(A: ToeplitzOperator) -> LinearOperator:
    """The inverse from the spectral factor, or from a better column where that is not resolved."""
    double = A.astype(np.float64)
    unit = np.zeros(A.shape[0])
    unit[0] = 1.0
    x = first_column_of_inverse(double)
    if not norm(double @ x - unit) <= RESOLVED:
        # The symbol is not resolved by so few lags, but M still makes CG converge to the column.
        x, _ = cg(double, unit, M=fft_preconditioner(double), rtol=1e-4, maxiter=200)
        if not norm(double @ x - unit) <= 1e-3:
            return fft_preconditioner(A)
    return GohbergSemencul(x.astype(A.dtype))
