"""Circulant preconditioners by Strang and by T. Chan: the baselines to beat."""

from typing import Any

import numpy as np
from numpy.typing import DTypeLike
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.products import COMPLEX_FOURIER, FOURIER, DiagonalisedProduct, Transforms
from toeplitz_mg.engine.work import count_transforms
from toeplitz_mg.operators import DiagonalisedOperator, ToeplitzOperator
from toeplitz_mg.operators.structure import of_any_matrix
from toeplitz_mg.preconditioners.positivity import (
    LAST_RESORT,
    name_robust,
    precision,
    require_nonzero,
    require_positive,
)


@of_any_matrix
def strang_preconditioner(A: LinearOperator, *, dtype: DTypeLike | None = None) -> LinearOperator:
    """Return the inverse of Strang's circulant, which copies the central coefficients of `A`.

    Parameters
    ----------
    A : ToeplitzOperator, ToeplitzSum or CoupledOperator, or MaskedOperator of one
        Real or complex, symmetric or not, of any number of axes.
    dtype : float32 or float64, optional
        The precision in which it is kept and applied, that of `A` by default; complex64 or
        complex128 where `A` is complex. In float32 it takes half the memory and less time, inside
        an iteration in float64 too.

    Returns
    -------
    DiagonalisedOperator or MaskedOperator
        Of the shape of `A`. Where `A` is real and symmetric, or complex Hermitian, it is symmetric
        or Hermitian positive definite; else it is as general as `A`, and one for `gmres`. One
        product costs half a work unit on one axis (1/2^d on d axes).

    Raises
    ------
    numpy.linalg.LinAlgError
        Where the circulant is not positive definite, as happens for a positive definite `A`; of a
        general matrix where it has an eigenvalue of zero.
    TypeError
        Where `A` is no Toeplitz operator.

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
        central = np.take(column, index + n - 1, axis=axis)
        if n % 2 == 0:  # The lags n/2 and -n/2 have one place: it has their mean.
            middle = (slice(None),) * axis + (n // 2,)
            other = np.take(column, n - 1 - n // 2, axis=axis)
            central[middle] = (central[middle] + other) / 2
        column = central
    return _inverse(A, column, "Strang", precision(A, dtype))


@of_any_matrix
def chan_preconditioner(A: LinearOperator, *, dtype: DTypeLike | None = None) -> LinearOperator:
    """Return the inverse of T. Chan's circulant, the nearest to `A` in the Frobenius norm.

    Parameters
    ----------
    A : ToeplitzOperator, ToeplitzSum or CoupledOperator, or MaskedOperator of one
        Real or complex, symmetric or not, of any number of axes.
    dtype : float32 or float64, optional
        The precision in which it is kept and applied, that of `A` by default; complex64 or
        complex128 where `A` is complex. In float32 it takes half the memory and less time, inside
        an iteration in float64 too.

    Returns
    -------
    DiagonalisedOperator or MaskedOperator
        Of the shape of `A`, symmetric or Hermitian positive definite whenever `A` on the whole
        grid is. Of a matrix that is not Hermitian it is as general as that, and one for `gmres`.
        One product costs half a work unit on one axis (1/2^d on d axes).

    Raises
    ------
    numpy.linalg.LinAlgError
        Where `A` is symmetric or Hermitian and the circulant is not positive definite, so that `A`
        is not either; of a general matrix where the circulant has an eigenvalue of zero, which it
        may have of a regular one.
    TypeError
        Where `A` is no Toeplitz operator.

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
    return _inverse(A, _average_column(A), "T. Chan", precision(A, dtype))


def signed_chan_inverse(A: ToeplitzOperator) -> DiagonalisedOperator:
    """Return what `chan_preconditioner` does, of an indefinite matrix too, for GMRES."""
    return _inverse(A, _average_column(A), "T. Chan", precision(A, None), is_definite=False)


def chan_eigenvalues(A: ToeplitzOperator) -> Array:
    """Return the eigenvalues of T. Chan's circulant: means of the symbol around θ = 2πk/n.

    Of a real matrix they are those of k ≤ n/2 along the last axis.
    """
    return _transform(_average_column(A))


def _average_column(A: ToeplitzOperator) -> Array:
    """Return the first column of T. Chan's circulant: the means of the diagonals that it joins."""
    column = A.lags
    for axis, n in enumerate(A.grid_shape):
        k = np.arange(n).reshape((n,) + (1,) * (column.ndim - 1 - axis))
        # These are the lags k = 0 ... n - 1, and k - n, of which that of k = 0 has no weight.
        positive = np.take(column, np.arange(n - 1, 2 * n - 1), axis=axis)
        negative = np.take(column, np.arange(n) - 1, axis=axis)
        column = ((n - k) * positive + k * negative) / n
    return column


def _inverse(
    A: ToeplitzOperator,
    column: Array,
    name: str,
    dtype: np.dtype[Any],
    *,
    is_definite: bool = True,
) -> DiagonalisedOperator:
    """Invert the circulant with the first column `column`, which stands for A."""
    spectrum = _transform(column)
    subject = f"{name}'s circulant has the eigenvalue"
    if A.is_hermitian:
        spectrum = spectrum.real
    if A.is_hermitian and is_definite:
        other = name_robust(column.shape) if name == "Strang" else LAST_RESORT
        require_positive(spectrum, dtype, subject, other)
    else:
        require_nonzero(spectrum, dtype, subject, "gmres without M")
    transforms = _transforms(column)
    product = DiagonalisedProduct(1.0 / spectrum, column.shape, column.shape, dtype, transforms)
    return DiagonalisedOperator(product, f"inverse of {name}'s circulant")


def _transform(column: Array) -> Array:
    """Return the eigenvalues of the circulant with this first column."""
    count_transforms(1, *column.shape)
    column = column.astype(np.result_type(column, np.float64), copy=False)
    return _transforms(column).forward(column)


def _transforms(column: Array) -> Transforms:
    return COMPLEX_FOURIER if column.dtype.kind == "c" else FOURIER
