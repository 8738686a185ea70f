"""The FFT preconditioner M, a Toeplitz matrix of an interior column of A⁻¹ (paper, §3.1)."""

from math import prod

import numpy as np
from numpy.typing import DTypeLike
from scipy import fft
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg.engine.transforms import LONG, cosine_sums, near_fast_length
from toeplitz_mg.engine.work import count_transforms
from toeplitz_mg.operators import CoupledOperator, ToeplitzOperator
from toeplitz_mg.operators.structure import restrict, restricted, unwrap
from toeplitz_mg.preconditioners.coupled import coupled_inverse
from toeplitz_mg.preconditioners.positivity import precision, require_positive, robust
from toeplitz_mg.preconditioners.symbol import continue_axis


def fft_preconditioner(A: LinearOperator, *, dtype: DTypeLike | None = None) -> LinearOperator:
    """Return M, the paper's FFT preconditioner of a symmetric positive definite Toeplitz matrix.

    Parameters
    ----------
    A : ToeplitzOperator, or CoupledOperator, or MaskedOperator of one
        Symmetric, of any number of axes.
    dtype : float32 or float64, optional
        The precision in which it is kept and applied, that of `A` by default. In float32 it takes
        half the memory and less time, inside an iteration in float64 too.

    Returns
    -------
    ToeplitzOperator, CoupledOperator or MaskedOperator
        M ≈ A⁻¹, of the shape of `A`, symmetric positive definite, so that it may
        precondition `scipy.sparse.linalg.cg`. One product costs one work unit. On a mask it is
        the restriction M_r of the M of the whole grid (paper, §5.4).

    Raises
    ------
    numpy.linalg.LinAlgError
        Where an eigenvalue of the embedding in a circulant is not positive, as for a symbol with
        a zero. `spectral_preconditioner` of one axis, and `chan_preconditioner` in any number,
        are positive definite for every positive definite `A`.
    TypeError, ValueError
        Where `A` is no Toeplitz operator, or not symmetric.

    Notes
    -----
    The circulant of length 2 n - 1 with first column (a₀ … a_{n-1}, a_{n-1} … a₁) is inverted;
    the coefficients of M are the first n of its inverse. M is a leading block of that inverse and
    hence positive definite where the circulant is. No zero is put between the two halves: it
    would be read as a coefficient, and makes M useless.

    Where 2 n - 1 has a prime factor above 61, so that its transforms are slow, and the matrix is
    large, the circulant is a little longer, of length 2 L, and the coefficients of the lags
    n … L, which `A` has not, continue those that it has: a parabola that is flat at the lag L.

    The circulant of coupled components is inverted as a small matrix at each frequency; what one
    inverse a component gives, `componentwise(fft_preconditioner)(A)`, takes some more iterations.

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
    full, mask = unwrap(A)
    if isinstance(full, CoupledOperator):
        return restrict(coupled_inverse(full, precision(full, dtype)), mask)
    return _toeplitz_inverse(A, dtype)


@restricted
def _toeplitz_inverse(A: ToeplitzOperator, dtype: DTypeLike | None) -> ToeplitzOperator:
    """Return M of one component, on the whole grid."""
    dtype = precision(A, dtype)
    lengths = tuple(2 * n - 1 for n in A.grid_shape)
    is_fast = all(near_fast_length(m) == m for m in lengths)
    is_exact = is_fast or not A.is_even or A.shape[0] < LONG
    if is_exact:
        count_transforms(2, *lengths)
        spectrum = fft.rfftn(A.circulant(lengths)).real
    else:
        column = A.c.astype(np.float64, copy=False)
        for axis, n in enumerate(A.grid_shape):
            column = continue_axis(column, axis, near_fast_length(n))
        spectrum = cosine_sums(column)
    require_positive(
        spectrum,
        dtype,
        "the embedding of A in a circulant, which M inverts, has the eigenvalue",
        robust(A.grid_shape),
    )
    spectrum = np.reciprocal(spectrum, out=spectrum)
    if is_exact:
        inverse = fft.irfftn(spectrum, lengths)
    else:
        inverse = cosine_sums(spectrum)
        inverse /= prod(2 * (m - 1) for m in spectrum.shape)
    inverse = inverse.astype(dtype, copy=False)
    if A.is_even:
        return ToeplitzOperator(inverse[tuple(slice(n) for n in A.grid_shape)])
    lags = fft.fftshift(inverse)
    return ToeplitzOperator.from_lags((lags + np.flip(lags)) / 2)  # symmetric to the last bit
