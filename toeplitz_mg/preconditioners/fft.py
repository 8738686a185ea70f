"""The FFT preconditioner M, a Toeplitz matrix of an interior column of A⁻¹ (paper, §3.1)."""

import numpy as np
from scipy import fft
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg.operators import MaskedOperator, ToeplitzOperator
from toeplitz_mg.operators.masked import toeplitz_and_mask
from toeplitz_mg.operators.work import count_transforms
from toeplitz_mg.preconditioners.positivity import require_positive, robust


def fft_preconditioner(A: LinearOperator) -> LinearOperator:
    """Return M, the paper's FFT preconditioner of a symmetric positive definite Toeplitz matrix.

    Parameters
    ----------
    A : ToeplitzOperator or MaskedOperator of one
        Symmetric, of any number of levels.

    Returns
    -------
    ToeplitzOperator or MaskedOperator
        M ≈ A⁻¹, of the shape and dtype of `A`, symmetric positive definite, so that it may
        precondition `scipy.sparse.linalg.cg`. One product costs one work unit. On a mask it is
        the restriction M_r of the M of the whole grid (paper, §5.4).

    Raises
    ------
    numpy.linalg.LinAlgError
        Where an eigenvalue of the embedding in a circulant is not positive, as for a symbol with
        a zero. `spectral_preconditioner` in one level, and `chan_preconditioner` in any number,
        are positive definite for every positive definite `A`.
    TypeError, ValueError
        Where `A` is no Toeplitz operator, or not symmetric.

    Notes
    -----
    The circulant of length 2 n - 1 with first column (a₀ … a_{n-1}, a_{n-1} … a₁) is inverted;
    the coefficients of M are the first n of its inverse. M is a leading block of that inverse and
    hence positive definite where the circulant is. No zero is put between the two halves: it
    would be read as a coefficient, and makes M useless.

    As a smoother M fails: I - M A has two eigenvalues far below -1, whose eigenvectors live at
    the two ends (paper, §3.2). CG removes them in two steps, and then needs fewer iterations with
    M than with `fft_rsm_preconditioner`.

    References
    ----------
    J. Zhao, E. A. H. Vollebregt, C. W. Oosterlee, Multigrid with FFT smoother for a simplified 2D
    frictional contact problem, Numer. Linear Algebra Appl. 21 (2014), §3.1, Figure 4 with K = n/2.

    Examples
    --------
    >>> import numpy as np
    >>> from scipy.sparse.linalg import cg
    >>> import toeplitz_mg as tmg
    >>> A = tmg.ToeplitzOperator(0.9 ** np.arange(1000))
    >>> x, info = cg(A, np.ones(1000), M=tmg.fft_preconditioner(A), rtol=1e-10)
    >>> info, bool(np.linalg.norm(A @ x - 1.0) <= 1e-10 * np.linalg.norm(np.ones(1000)))
    (0, True)
    """
    full, mask = toeplitz_and_mask(A)
    count_transforms(2, *full.lags.shape)
    spectrum = fft.rfftn(full.circulant(full.lags.shape)).real
    require_positive(
        spectrum,
        full.dtype,
        "the embedding of A in a circulant, which M inverts, has the eigenvalue",
        robust(len(full.grid_shape)),
    )
    inverse = fft.irfftn(1.0 / spectrum, full.lags.shape).astype(full.dtype)
    if full.is_even:
        M = ToeplitzOperator(inverse[tuple(slice(n) for n in full.grid_shape)])
    else:
        lags = fft.fftshift(inverse)
        M = ToeplitzOperator.from_lags((lags + np.flip(lags)) / 2)  # symmetric to the last bit
    return M if mask is None else MaskedOperator(M, mask)
