"""The τ preconditioner: the DST-I matrix that differs from A by a Hankel matrix."""

import numpy as np
from numpy.typing import DTypeLike
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg.engine.lengths import near_fast_length
from toeplitz_mg.engine.products import TAU, DiagonalisedProduct
from toeplitz_mg.engine.transforms import cosine_sums
from toeplitz_mg.operators import DiagonalisedOperator, ToeplitzOperator, ToeplitzSum
from toeplitz_mg.operators.base import require_numpy
from toeplitz_mg.operators.coefficients import require_range
from toeplitz_mg.operators.lifting import lift, unwrap
from toeplitz_mg.operators.positivity import name_robust, precision, require_positive
from toeplitz_mg.operators.symbol import average_flips
from toeplitz_mg.values import finite


def tau_preconditioner(
    A: LinearOperator, *, shift: float = 0.0, dtype: DTypeLike | None = None
) -> LinearOperator:
    """Return the inverse of τ(A) + shift I, a preconditioner for fractional diffusion.

    Parameters
    ----------
    A : ToeplitzOperator, ToeplitzSum or CoupledOperator, or MaskedOperator of one
        Of any number of axes. If it is not symmetric, as a Riemann–Liouville derivative, its
        symmetric part is used, which must be positive definite.
    shift : float
        Precondition A + shift I instead of A, as in an implicit time step.
    dtype : float32 or float64, optional
        Precision in which the preconditioner is stored and applied; by default that of `A`.

    Returns
    -------
    DiagonalisedOperator or MaskedOperator
        Symmetric positive definite, same shape as `A`. One product costs half a work unit on one
        axis (1/2^d on d axes), and is fastest if each n + 1 is a power of two.

    Raises
    ------
    numpy.linalg.LinAlgError
        If an eigenvalue of τ(A) + shift I is not positive.
    TypeError, ValueError
        If `A` is not a Toeplitz operator, or `shift` not a finite number.

    See Also
    --------
    sine_preconditioner : samples the symbol, with a DST-II.

    Notes
    -----
    On one axis τ(A) has the entries a[i-j] - a[i+j] - a[2n+2-i-j], i, j = 1 … n, with a[k] = 0
    beyond the last lag. Its eigenvalues are Σ a[k] cos kθ, summed over all lags, at θ = πj/(n+1),
    j = 1 … n. For the Riesz derivatives of orders 1 to 2 the eigenvalues of τ(A)⁻¹A lie between ½
    and 3/2, for any n. If a length n + 1 has a prime factor above 61, the inverse of a slightly
    larger matrix is cut. With variable coefficients, as in ``D1 @ A + D2 @ A.T + s * I``, τ(A) is
    scaled by diagonal matrices from both sides (see `toeplitz_mg.operators.sums.average`).

    References
    ----------
    D. Bini, F. Di Benedetto, A new preconditioner for the parallel solution of positive definite
    Toeplitz systems, SPAA (1990). X. Huang, X.-L. Lin, M. K. Ng, H.-W. Sun, Spectral analysis for
    preconditioning of multi-dimensional Riesz fractional diffusion equations, Numer. Math. Theor.
    Meth. Appl. 15 (2022). X.-L. Lin, X. Huang, M. K. Ng, H.-W. Sun, A τ-preconditioner for a
    non-symmetric linear system arising from multi-dimensional Riemann-Liouville fractional
    diffusion equation, Numer. Algorithms 92 (2023).

    Examples
    --------
    >>> import numpy as np
    >>> import toeplitz_mg as tmg
    >>> k = np.arange(1.0, 1023.0)
    >>> c = np.cumprod(np.r_[1.0, (k - 1.75) / (k + 0.75)])  # |2 sin θ/2|^1.5, but for a factor
    >>> A = tmg.ToeplitzOperator(c)
    >>> x, info = tmg.cg(A, np.ones(1023), M=tmg.tau_preconditioner(A), rtol=1e-8, maxiter=9)
    >>> info
    0
    """
    shift = finite("shift", shift)
    require_numpy(A, "tau_preconditioner")
    if isinstance(unwrap(A)[0], ToeplitzSum):  # It would scale the shift too.
        dtype = A.dtype if dtype is None else dtype
        A, shift = A.plus(np.full(A.shape[0], shift)), 0.0
    return _tau(A, shift, dtype)


@lift(accepts="symmetric part")
def _tau(A: ToeplitzOperator, shift: float, dtype: DTypeLike | None) -> DiagonalisedOperator:
    """Return the preconditioner for one component on the whole grid."""
    dtype = precision(A, dtype)
    require_range(abs(complex(A.diagonal_entry) + shift), dtype, "A + shift I")
    column = average_flips(A)
    shape = tuple(near_fast_length(n + 1) - 1 for n in A.grid_shape)
    padded = np.pad(column, [(0, m + 2 - n) for m, n in zip(shape, column.shape, strict=True)])
    eigenvalues = cosine_sums(padded)[(slice(1, -1),) * padded.ndim] + shift
    of_shifted = ", with A + shift * eye_array(n) instead of A" if shift else ""
    require_positive(
        eigenvalues,
        dtype,
        "τ(A) + shift I, which the τ preconditioner inverts, has the eigenvalue",
        name_robust(A.grid_shape) + of_shifted,
    )
    product = DiagonalisedProduct(1.0 / eigenvalues, shape, A.grid_shape, dtype, TAU)
    return DiagonalisedOperator(product, "τ")
