"""Circulant preconditioners by Strang and by T. Chan: the baselines to beat."""

from typing import Any

import numpy as np
from numpy.typing import DTypeLike
from scipy import fft
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.products import DiagonalisedProduct
from toeplitz_mg.engine.work import count_transforms
from toeplitz_mg.operators import DiagonalisedOperator
from toeplitz_mg.operators.structure import componentwise, restricted
from toeplitz_mg.preconditioners.positivity import name_robust, precision, require_positive


@componentwise
@restricted
def strang_preconditioner(A: LinearOperator, *, dtype: DTypeLike | None = None) -> LinearOperator:
    """Return the inverse of Strang's circulant, which copies the central coefficients of `A`.

    Parameters
    ----------
    A : ToeplitzOperator, or CoupledOperator, or MaskedOperator of one
        Symmetric, of any number of axes.
    dtype : float32 or float64, optional
        The precision in which it is kept and applied, that of `A` by default. In float32 it takes
        half the memory and less time, inside an iteration in float64 too.

    Returns
    -------
    DiagonalisedOperator or MaskedOperator
        Of the shape of `A`, symmetric positive definite. One product costs half a work
        unit on one axis (1/2^d on d axes).

    Raises
    ------
    numpy.linalg.LinAlgError
        Where the circulant is not positive definite, as happens for a positive definite `A`.
    TypeError, ValueError
        Where `A` is no Toeplitz operator, or not symmetric.

    References
    ----------
    G. Strang, A proposal for Toeplitz matrix calculations, Stud. Appl. Math. 74 (1986).

    Examples
    --------
    >>> import numpy as np
    >>> import toeplitz_mg as tmg
    >>> C = tmg.strang_preconditioner(tmg.ToeplitzOperator([2.0, 0.5, 0.1]))
    >>> (C @ np.array([3.0, 3.0, 3.0])).round(12)
    array([1., 1., 1.])
    """
    column = A.lags
    for axis, n in enumerate(A.grid_shape):
        # These are the lags 0 ... n // 2, then -(n - 1) // 2 ... -1.
        index = np.concatenate([np.arange(n // 2 + 1), np.arange(-((n - 1) // 2), 0)])
        column = np.take(column, index + n - 1, axis=axis)
    return _inverse(column, "Strang", precision(A, dtype))


@componentwise
@restricted
def chan_preconditioner(A: LinearOperator, *, dtype: DTypeLike | None = None) -> LinearOperator:
    """Return the inverse of T. Chan's circulant, the nearest to `A` in the Frobenius norm.

    Parameters
    ----------
    A : ToeplitzOperator, or CoupledOperator, or MaskedOperator of one
        Symmetric, of any number of axes.
    dtype : float32 or float64, optional
        The precision in which it is kept and applied, that of `A` by default. In float32 it takes
        half the memory and less time, inside an iteration in float64 too.

    Returns
    -------
    DiagonalisedOperator or MaskedOperator
        Of the shape of `A`, symmetric positive definite whenever `A` on the whole grid
        is. One product costs half a work unit on one axis (1/2^d on d axes).

    Raises
    ------
    numpy.linalg.LinAlgError
        Where the circulant is not positive definite, and so `A` is not either.
    TypeError, ValueError
        Where `A` is no Toeplitz operator, or not symmetric.

    References
    ----------
    T. F. Chan, An optimal circulant preconditioner for Toeplitz systems, SIAM J. Sci. Stat.
    Comput. 9 (1988); on several axes T. F. Chan, J. A. Olkin, Numer. Algorithms 6 (1994).

    Examples
    --------
    >>> import numpy as np
    >>> import toeplitz_mg as tmg
    >>> C = tmg.chan_preconditioner(tmg.ToeplitzOperator([2.0, 0.5, 0.5]))
    >>> (C @ np.array([3.0, 3.0, 3.0])).round(12)
    array([1., 1., 1.])
    """
    column = A.lags
    for axis, n in enumerate(A.grid_shape):
        k = np.arange(n).reshape((n,) + (1,) * (column.ndim - 1 - axis))
        # These are the lags k = 0 ... n - 1, and k - n, of which that of k = 0 has no weight.
        positive = np.take(column, np.arange(n - 1, 2 * n - 1), axis=axis)
        negative = np.take(column, np.arange(n) - 1, axis=axis)
        column = ((n - k) * positive + k * negative) / n
    return _inverse(column, "T. Chan", precision(A, dtype))


def _inverse(column: Array, name: str, dtype: np.dtype[Any]) -> DiagonalisedOperator:
    """Invert the circulant with the first column `column`."""
    count_transforms(1, *column.shape)
    spectrum = fft.rfftn(column.astype(np.float64, copy=False)).real
    other = name_robust(column.shape) if name == "Strang" else "cg without M"
    require_positive(spectrum, dtype, f"{name}'s circulant has the eigenvalue", other)
    product = DiagonalisedProduct(1.0 / spectrum, column.shape, column.shape, dtype)
    return DiagonalisedOperator(product, f"inverse of {name}'s circulant")
