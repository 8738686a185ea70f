"""The τ preconditioner: the matrix of the DST-I that is A but for a Hankel matrix."""

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
    """Return the inverse of τ(A) + shift I, for matrices as those of fractional diffusion.

    Parameters
    ----------
    A : ToeplitzOperator, ToeplitzSum or CoupledOperator, or MaskedOperator of one
        Of any number of axes. Where it is not symmetric, as the derivatives of Riemann and
        Liouville are not, τ is that of its symmetric part, which has to be positive definite.
    shift : float
        A multiple of the unit matrix that A itself lacks, as that of an implicit step in time:
        the preconditioner is then one of A + shift I.
    dtype : float32 or float64, optional
        The precision in which it is kept and applied, that of `A` by default.

    Returns
    -------
    DiagonalisedOperator or MaskedOperator
        Of the shape of `A`, symmetric positive definite. One product costs half a work unit on
        one axis (1/2^d on d axes), and is fastest where each n + 1 is a power of two.

    Raises
    ------
    numpy.linalg.LinAlgError
        Where an eigenvalue of τ(A) + shift I is not positive.
    TypeError, ValueError
        Where `A` is no Toeplitz operator; where `shift` is no finite number.

    See Also
    --------
    sine_preconditioner : samples the symbol itself, for a DST-II.

    Notes
    -----
    On one axis τ(A) has the entries a[i-j] - a[i+j] - a[2n+2-i-j], i, j = 1 … n, with a[k] = 0
    beyond the last lag, and as eigenvalues the sum of a[k] cos kθ over all lags, at θ = πk/(n+1),
    k = 1 … n. For the Riesz derivatives of orders 1 to 2 those of τ(A)⁻¹A lie between ½ and 3/2,
    for any n. Where a length n + 1 has a prime factor above 61, a slightly longer matrix is
    inverted, and cut. With variable coefficients, as of ``D1 @ A + D2 @ A.T + s * I``, it is the
    matrix between two diagonal ones (see `toeplitz_mg.operators.sums.average`).

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
    if isinstance(unwrap(A)[0], ToeplitzSum):  # It is scaled, and so would the shift be.
        dtype = A.dtype if dtype is None else dtype
        A, shift = A.plus(np.full(A.shape[0], shift)), 0.0
    return _tau(A, shift, dtype)


@lift(accepts="symmetric part")
def _tau(A: ToeplitzOperator, shift: float, dtype: DTypeLike | None) -> DiagonalisedOperator:
    """Return the preconditioner of one component, on the whole grid."""
    dtype = precision(A, dtype)
    require_range(abs(complex(A.diagonal_entry) + shift), dtype, "A + shift I")
    column = average_flips(A)
    shape = tuple(near_fast_length(n + 1) - 1 for n in A.grid_shape)
    padded = np.pad(column, [(0, m + 2 - n) for m, n in zip(shape, column.shape, strict=True)])
    eigenvalues = cosine_sums(padded)[(slice(1, -1),) * padded.ndim] + shift
    of_shifted = ", with A + shift * eye_array(n) in the place of A" if shift else ""
    require_positive(
        eigenvalues,
        dtype,
        "τ(A) + shift I, which the τ preconditioner inverts, has the eigenvalue",
        name_robust(A.grid_shape) + of_shifted,
    )
    product = DiagonalisedProduct(1.0 / eigenvalues, shape, A.grid_shape, dtype, TAU)
    return DiagonalisedOperator(product, "τ")
