"""Preconditioners that cosine or sine transforms diagonalise, with samples of the symbol of A."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import DTypeLike
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.arrays.library import library_of
from toeplitz_mg.engine.lengths import near_fast_length
from toeplitz_mg.operators import DiagonalisedOperator, ToeplitzOperator
from toeplitz_mg.operators.lifting import lift
from toeplitz_mg.operators.positivity import (
    is_positive,
    name_robust,
    precision,
    require_positive,
    rounding,
)
from toeplitz_mg.operators.symbol import sample_symbol

NAMES = "cosine", "sine"  # The transforms whose first sample has the number 0 and 1.


@lift(accepts="symmetric")
def cosine_preconditioner(A: LinearOperator, *, dtype: DTypeLike | None = None) -> LinearOperator:
    """Return the inverse of the DCT-II matrix whose eigenvalues are samples of the symbol of A.

    Parameters
    ----------
    A : ToeplitzOperator, ToeplitzSum or CoupledOperator, or MaskedOperator of one
        Symmetric positive definite, of any number of axes.
    dtype : float32 or float64, optional
        Precision in which the preconditioner is stored and applied; by default that of `A`. float32
        halves the memory and takes less time, also inside an iteration in float64.

    Returns
    -------
    DiagonalisedOperator or MaskedOperator
        Symmetric positive definite, same shape as `A`. One product costs half a work unit on one
        axis (1/2^d on d axes).

    Raises
    ------
    numpy.linalg.LinAlgError
        If a sample is not positive, as at θ = 0 for a symbol that is zero there (use
        `sine_preconditioner`, which does not sample θ = 0).
    TypeError, ValueError
        If `A` is not a Toeplitz operator, or not symmetric.

    See Also
    --------
    sine_preconditioner : the same with a DST-II, for symbols that are zero at θ = 0.
    default_preconditioner : selects a preconditioner for a matrix.

    Notes
    -----
    The symbol f(θ) = Σ a_k cos kθ is sampled at θ = πk/n, k = 0 … n - 1. If n is a slow transform
    length, the inverse of a slightly larger matrix is cut to n rows and columns.

    References
    ----------
    T. Kailath, V. Olshevsky, Displacement structure approach to discrete-trigonometric-transform
    based preconditioners of G. Strang type and of T. Chan type, SIAM J. Matrix Anal. Appl. 26
    (2005).

    Examples
    --------
    >>> import numpy as np
    >>> from scipy.sparse.linalg import cg
    >>> import toeplitz_mg as tmg
    >>> A = tmg.ToeplitzOperator(1.0 / (1.0 + np.arange(1000)))
    >>> x, info = cg(A, np.ones(1000), M=tmg.cosine_preconditioner(A), rtol=1e-8, maxiter=12)
    >>> info
    0
    """
    return cosine_inverse(A, _sample_symbol(A), dtype)


@lift(accepts="symmetric")
def sine_preconditioner(A: LinearOperator, *, dtype: DTypeLike | None = None) -> LinearOperator:
    """Return the inverse of the DST-II matrix whose eigenvalues are samples of the symbol of A.

    Parameters
    ----------
    A, dtype
        As for `cosine_preconditioner`.

    Returns
    -------
    DiagonalisedOperator or MaskedOperator
        As for `cosine_preconditioner`.

    Raises
    ------
    numpy.linalg.LinAlgError, TypeError, ValueError
        As for `cosine_preconditioner`; here a symbol that is zero at θ = π is refused.

    See Also
    --------
    cosine_preconditioner : the same with a DCT-II, for symbols that are zero at θ = π.
    default_preconditioner : selects a preconditioner for a matrix.

    Notes
    -----
    The symbol is sampled at θ = πk/n, k = 1 … n, and not at θ = 0, where the symbols of Laplacians
    and of fractional derivatives are zero. See `cosine_preconditioner` for the source.

    Examples
    --------
    >>> import numpy as np
    >>> from scipy.sparse.linalg import cg
    >>> import toeplitz_mg as tmg
    >>> A = tmg.ToeplitzOperator(np.r_[2.0, -1.0, np.zeros(998)])
    >>> x, info = cg(A, np.ones(1000), M=tmg.sine_preconditioner(A), rtol=1e-8, maxiter=5)
    >>> info
    0
    """
    return sine_inverse(A, _sample_symbol(A), dtype)


def cosine_inverse(
    A: ToeplitzOperator, samples: Array, dtype: DTypeLike | None = None
) -> DiagonalisedOperator:
    """Return `cosine_preconditioner` for samples of the symbol at θ = πk/n, k = 0 … n."""
    return _invert_samples(A, samples, 0, dtype)


def sine_inverse(
    A: ToeplitzOperator, samples: Array, dtype: DTypeLike | None = None
) -> DiagonalisedOperator:
    """Return `sine_preconditioner` for samples of the symbol at θ = πk/n, k = 0 … n."""
    return _invert_samples(A, samples, 1, dtype)


def _sample_symbol(A: ToeplitzOperator) -> Array:
    return sample_symbol(A, tuple(near_fast_length(n) for n in A.grid_shape))


def _invert_samples(
    A: ToeplitzOperator, samples: Array, first: int, dtype: DTypeLike | None
) -> DiagonalisedOperator:
    dtype, library, shape = precision(A, dtype), A.library, tuple(m - 1 for m in samples.shape)

    def take(first: int) -> Array:
        return samples[tuple(slice(first, first + n) for n in shape)]

    advice = name_robust(A.grid_shape)
    eigenvalues = take_eigenvalues(take, first, dtype, A.vectors, advice)
    transforms = (library.cosine, library.sine)[first]
    product = library.diagonalise(1.0 / eigenvalues, shape, A.grid_shape, dtype, transforms)
    return DiagonalisedOperator(product, f"{NAMES[first]} transform")


def take_eigenvalues(
    take: Callable[[int], Array], first: int, dtype: np.dtype[Any], vectors: Any, advice: str
) -> Array:
    """Return samples of a symbol, raised above rounding if needed; refuse negative ones.

    Parameters
    ----------
    take : callable
        Returns the samples (on this rank), given the number of the first one along each axis.
    first : {0, 1}
        0 for the cosine and 1 for the sine transform.
    vectors : Vectors
        Finds the extremes of samples on all ranks.
    advice : str
        An alternative for the error message.
    """

    def lifted(first: int) -> tuple[Array, Array]:
        samples = lift_lowest(take(first), dtype, vectors)
        return samples, np.array([vectors.min(samples), vectors.max(samples)], np.float64)

    eigenvalues, extent = lifted(first)
    if not is_positive(extent, dtype):
        name, other = NAMES[first], NAMES[1 - first]
        if is_positive(lifted(1 - first)[1], dtype):
            advice = f"{other}_preconditioner(A), or {advice}"
        subject = f"the symbol of A, which the {name} preconditioner samples, has the value"
        require_positive(extent, dtype, subject, advice)
    return eigenvalues


def lift_lowest(samples: Array, dtype: np.dtype[Any], vectors: Any) -> Array:
    """Raise samples below the rounding error to it, unless one of them is negative.

    A symbol that goes to zero like (π/n)⁴ is lost in rounding near there, in many samples; the
    rounding error is as good an estimate of them as any.
    """
    low, high = vectors.min(samples), vectors.max(samples)
    error = rounding(np.array([low, high]), dtype)
    if low > -error and vectors.count(samples < 25.0 * error) > 1:
        samples = library_of(samples).xp.maximum(samples, 1.01 * error)
    return samples
