"""Circulant preconditioners by Strang and by T. Chan."""

from typing import Any

import numpy as np
from numpy.typing import DTypeLike
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.arrays.library import library_of
from toeplitz_mg.engine.embedding import cut
from toeplitz_mg.engine.work import count_transforms
from toeplitz_mg.operators import CoupledOperator, DiagonalisedOperator, ToeplitzOperator
from toeplitz_mg.operators.lifting import lift, restrict, unwrap
from toeplitz_mg.operators.positivity import (
    INDEFINITE,
    LAST_RESORT,
    may_be_positive,
    name_robust,
    precision,
    require_nonzero,
    require_positive,
    rounding,
)
from toeplitz_mg.operators.sums import advise_of_negative
from toeplitz_mg.operators.symbol import NEGLIGIBLE

# Least |sample| divided by the distance to its neighbours. With 0.03 to 0.3 GMRES takes as many
# iterations for symbols that are zero at a sample; with 0.001 it loses some digits.
SHARE = 0.05


@lift(accepts="any")
def strang_preconditioner(A: LinearOperator, *, dtype: DTypeLike | None = None) -> LinearOperator:
    """Return the inverse of Strang's circulant, made of the central coefficients of `A`.

    Parameters
    ----------
    A : ToeplitzOperator, ToeplitzSum or CoupledOperator, or MaskedOperator of one
        Real or complex, symmetric or not, of any number of axes.
    dtype : float32 or float64, optional
        Precision in which the preconditioner is stored and applied; by default that of `A`. Use
        complex64 or complex128 if `A` is complex. Single precision halves the memory and takes less
        time, also inside an iteration in double precision.

    Returns
    -------
    DiagonalisedOperator or MaskedOperator
        Same shape as `A`. It is symmetric (Hermitian) positive definite if `A` is symmetric
        (Hermitian); otherwise use it with `gmres`. One product costs half a work unit on one axis
        (1/2^d on d axes).

    Raises
    ------
    numpy.linalg.LinAlgError
        If `A` is Hermitian and the circulant is not positive definite, which can happen although
        `A` is; for other matrices, if the symbol is zero at neighbouring samples.
    TypeError
        If `A` is not a Toeplitz operator.

    See Also
    --------
    chan_preconditioner : another circulant, positive definite whenever A is.
    default_preconditioner : selects a preconditioner for a matrix.

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
    column, xp = A.lags, A.library.xp
    for axis, n in enumerate(A.grid_shape):
        half, zero = n // 2, n - 1
        parts = [column[cut(axis, zero, zero + (n + 1) // 2)]]
        if n % 2 == 0:  # The lags n/2 and -n/2 share one entry: it is their mean.
            ends = (column[cut(axis, zero + k, zero + k + 1)] for k in (half, -half))
            parts.append((next(ends) + next(ends)) / 2)
        parts.append(column[cut(axis, zero - (n - 1) // 2, zero)])
        column = xp.concat(parts, axis=axis)
    return _definite_inverse(A, _transform(column), "Strang", dtype)


def chan_preconditioner(A: LinearOperator, *, dtype: DTypeLike | None = None) -> LinearOperator:
    """Return the inverse of T. Chan's circulant, the nearest to `A` in the Frobenius norm.

    Parameters
    ----------
    A : ToeplitzOperator, ToeplitzSum or CoupledOperator, or MaskedOperator of one
        Real or complex, symmetric or not, of any number of axes.
    dtype : float32 or float64, optional
        Precision in which the preconditioner is stored and applied; by default that of `A`. Use
        complex64 or complex128 if `A` is complex. Single precision halves the memory and takes less
        time, also inside an iteration in double precision.

    Returns
    -------
    DiagonalisedOperator or MaskedOperator
        Same shape as `A`. It is Hermitian positive definite whenever `A` on the whole grid is; for
        a `ToeplitzSum`, whenever the Toeplitz matrix that approximates the sum is. If `A` is not
        Hermitian, use it with `gmres`; isolated eigenvalues near zero are then moved away from it.
        One product costs half a work unit on one axis (1/2^d on d axes).

    Raises
    ------
    numpy.linalg.LinAlgError
        If `A` is Hermitian and the circulant is not positive definite, which shows that `A` is not
        either; for other matrices, if neighbouring eigenvalues of the circulant are zero.
    TypeError
        If `A` is not a Toeplitz operator.

    See Also
    --------
    strang_preconditioner : the circulant that keeps the central coefficients.
    default_preconditioner : selects a preconditioner for a matrix.

    Notes
    -----
    For a `CoupledOperator` it is a block circulant: a small matrix is inverted at each frequency.
    To ignore the coupling, use ``componentwise(chan_preconditioner)(A)``.

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
    full, mask = unwrap(A)
    if isinstance(full, CoupledOperator):
        return restrict(_invert_coupled(full, precision(full, dtype)), mask)
    return _chan_inverse(A, dtype)


@lift(accepts="any", parts=("mask",))
def _chan_inverse(A: LinearOperator, dtype: DTypeLike | None) -> LinearOperator:
    """Return the inverse of T. Chan's circulant for one component."""
    return _definite_inverse(A, chan_eigenvalues(A), "T. Chan", dtype)


def _invert_coupled(A: CoupledOperator, dtype: np.dtype[Any]) -> DiagonalisedOperator:
    """Return the inverse of the block circulant with T. Chan's circulant of each block."""
    library = A.library
    xp, components, grid = library.xp, len(A.blocks), A.grid_shape[1:]
    blocks = [block for row in A.blocks for block in row if block is not None]
    kind = np.result_type(A.dtype, np.complex128)
    transforms = library.complex_fourier if A.dtype.kind == "c" else library.fourier
    precise = np.result_type(A.dtype, np.float64)  # A complex A may have real blocks.
    columns = {id(block): library.cast(_mean_lags(block), precise) for block in blocks}
    symbol = {key: library.cast(transforms.forward(c), kind) for key, c in columns.items()}
    count_transforms(len(columns), *grid)
    zero = xp.zeros_like(symbol[id(blocks[0])])
    rows = [[zero if B is None else symbol[id(B)] for B in row] for row in A.blocks]
    matrices = xp.stack([xp.stack(row, axis=-1) for row in rows], axis=-2)
    if A.is_hermitian:
        eigenvalues = xp.linalg.eigvalsh(matrices)
        subject = "T. Chan's block circulant has the eigenvalue"
        other = LAST_RESORT + advise_of_negative(float(A.diagonal().real.max()))
        require_positive(eigenvalues, dtype, subject, other)
    else:
        sizes = xp.linalg.svdvals(matrices)
        subject = "T. Chan's block circulant has the singular value"
        require_nonzero(sizes, dtype, subject, "gmres without M")
    inverse = xp.linalg.inv(matrices)
    inverse = (inverse + library.conj(inverse.mT)) / 2 if A.is_hermitian else inverse
    inverse = xp.moveaxis(inverse, (-2, -1), (0, 1))
    product = library.diagonalise(inverse, grid, (components, *grid), dtype, transforms)
    return DiagonalisedOperator(product, "inverse of T. Chan's block circulant")


def smooth_inverse(A: ToeplitzOperator, eigenvalues: Array) -> DiagonalisedOperator:
    """Return the inverse of a circulant with these eigenvalues (see `chan_eigenvalues`), for GMRES.

    The matrix may be of any kind, also indefinite.

    Raises
    ------
    numpy.linalg.LinAlgError
        If an eigenvalue is zero.
    """
    return _inverse(A, eigenvalues, "the smooth", A.dtype)


def chan_eigenvalues(A: ToeplitzOperator) -> Array:
    """Return the eigenvalues of T. Chan's circulant: means of the symbol around θ = 2πk/n.

    They are real if A is Hermitian. For a real matrix only those with k ≤ n/2 along the last axis
    are returned.
    """
    eigenvalues = _transform(_mean_lags(A))
    return A.library.real(eigenvalues) if A.is_hermitian else eigenvalues


def _mean_lags(A: ToeplitzOperator) -> Array:
    """Return the first column of T. Chan's circulant: means of the entries on its diagonals."""
    column, library = A.lags, A.library
    for axis, n in enumerate(A.grid_shape):
        w = 1.0 - np.arange(n).reshape((n,) + (1,) * (column.ndim - 1 - axis)) / n
        w = library.from_numpy(w)
        positive = column[cut(axis, n - 1)]
        # The entry k = 0 would have the lag -n, which A does not have; its weight is zero.
        parts = [column[cut(axis, 2 * n - 2)], column[cut(axis, 0, n - 1)]]
        negative = library.xp.concat(parts, axis=axis)
        column = w * positive + (1.0 - w) * negative
    return column


def away_from_zero(eigenvalues: Array, dtype: DTypeLike) -> Array:
    """Move isolated eigenvalues near zero away from it.

    The eigenvalues are samples of a symbol. Where the symbol changes its sign, or winds around
    zero, one sample may vanish by chance although the matrix is well-conditioned. Its absolute
    value is then raised to a small fraction of the distance between the samples beside it; its sign
    or phase stays. Zeros next to each other stay too: such a symbol is zero on an interval.

    Parameters
    ----------
    eigenvalues : array
        In the format of `chan_eigenvalues`, of any number of axes.
    dtype : float32 or float64, complex64 or complex128
        The precision of the matrix, whose rounding decides what is zero.

    Examples
    --------
    >>> import numpy as np
    >>> away_from_zero(np.array([-2.0, -1.0, 0.0, 1.0, 2.0]), float)
    array([-2.  , -1.  ,  0.05,  1.  ,  2.  ])
    """
    xp = library_of(eigenvalues).xp
    sizes = xp.abs(eigenvalues)
    distances = xp.zeros_like(sizes)
    for axis, n in enumerate(eigenvalues.shape):
        to_next = xp.abs(eigenvalues[cut(axis, 1)] - eigenvalues[cut(axis, 0, n - 1)])
        end = xp.zeros_like(sizes[cut(axis, 0, 1)])
        for both in ([to_next, end], [end, to_next]):
            distances = xp.maximum(distances, xp.concat(both, axis=axis))
    least = SHARE * distances
    if not xp.any(sizes < least):
        return eigenvalues
    is_zero = sizes <= rounding(eigenvalues, dtype)
    signs = xp.where(is_zero, xp.ones_like(eigenvalues), eigenvalues)
    signs = signs / xp.where(is_zero, xp.ones_like(sizes), sizes)
    return xp.where(sizes < least, least * signs, eigenvalues)


def smooth_column(c: Array, r: Array) -> Array:
    """Return the first column of a circulant whose eigenvalues follow the symbol closely.

    The eigenvalues are the sums over the lags of A at θ = 2πk/n. If the lags end before they are
    negligible, such sums oscillate, and a weighted mean is taken instead: half of the sum at θ plus
    a quarter of each at θ ± π/n. T. Chan's means extend over a wider part of the symbol: they are
    never below its minimum, but do not resolve a zero.

    Parameters
    ----------
    c, r : ndarray of shape (n,)
        First column and first row of A.
    """
    n = len(c)
    ends = np.abs(c[n // 2 :]).sum() + np.abs(r[n // 2 :]).sum()
    if ends <= NEGLIGIBLE * abs(c[0]):
        return c + np.append(0.0, r[:0:-1])
    return _weigh(c, r, 0.5 + 0.5 * np.cos(np.pi / n * np.arange(n)))


def chan_column(c: Array, r: Array) -> Array:
    """Return the first column of T. Chan's circulant, for a matrix of one axis."""
    return _weigh(c, r, 1.0 - np.arange(len(c)) / len(c))


def _weigh(c: Array, r: Array, weights: Array) -> Array:
    """Return the weighted means of the entries at the lags k and k - n."""
    behind = np.append(0.0, r[:0:-1])
    return behind + weights * (c - behind)


def _definite_inverse(
    A: ToeplitzOperator, eigenvalues: Array, name: str, dtype: DTypeLike | None
) -> DiagonalisedOperator:
    """Invert a circulant, which must be positive definite if A is Hermitian.

    For other matrices it is used with GMRES, which needs nonzero eigenvalues only.
    """
    dtype = precision(A, dtype)
    if A.is_hermitian:
        eigenvalues = A.library.real(eigenvalues)
        if name == "Strang":
            other = name_robust(A.grid_shape)
        else:  # T. Chan's eigenvalues are Rayleigh quotients of A.
            other = LAST_RESORT if may_be_positive(eigenvalues, dtype) else INDEFINITE
        require_positive(eigenvalues, dtype, f"{name}'s circulant has the eigenvalue", other)
    else:
        eigenvalues = away_from_zero(eigenvalues, dtype)
    return _inverse(A, eigenvalues, name, dtype)


def _inverse(
    A: ToeplitzOperator, eigenvalues: Array, name: str, dtype: np.dtype[Any]
) -> DiagonalisedOperator:
    """Invert the circulant with these eigenvalues, which approximates A."""
    subject = f"{name}'s circulant has the eigenvalue"
    require_nonzero(eigenvalues, dtype, subject, "gmres without M")
    shape, library = A.grid_shape, A.library
    transforms = library.complex_fourier if dtype.kind == "c" else library.fourier
    product = library.diagonalise(1.0 / eigenvalues, shape, shape, dtype, transforms)
    return DiagonalisedOperator(product, f"inverse of {name}'s circulant")


def _transform(column: Array) -> Array:
    """Return the eigenvalues of the circulant with this first column."""
    count_transforms(1, *column.shape)
    dtype = (library := library_of(column)).dtype(column)
    transforms = library.complex_fourier if dtype.kind == "c" else library.fourier
    return transforms.forward(library.cast(column, np.result_type(dtype, np.float64)))
