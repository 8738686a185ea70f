"""The FFT preconditioner M, the Toeplitz matrix of an interior column of A⁻¹ (paper, §3.1)."""

from collections.abc import Callable, Sequence
from math import prod
from typing import Any

import numpy as np
from numpy.typing import DTypeLike
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.arrays.library import library_of
from toeplitz_mg.engine.embedding import around, split
from toeplitz_mg.engine.lengths import near_fast_length
from toeplitz_mg.engine.products import Transforms
from toeplitz_mg.engine.transforms import LONG
from toeplitz_mg.engine.work import count_transforms
from toeplitz_mg.operators import CoupledOperator, ToeplitzOperator
from toeplitz_mg.operators.lifting import check_hermitian, lift, restrict, unwrap
from toeplitz_mg.operators.positivity import name_robust, precision, require_positive
from toeplitz_mg.operators.symbol import continue_axis

SUBJECT = "the embedding of A in a circulant, which M inverts, has the eigenvalue"
BLOCK_SUBJECT = "the embedding of A in a block circulant, which M inverts, has the pivot"


@lift(accepts="Hermitian", parts=())
def fft_preconditioner(A: LinearOperator, *, dtype: DTypeLike | None = None) -> LinearOperator:
    """Return M, the paper's FFT preconditioner of a positive definite Toeplitz matrix.

    Parameters
    ----------
    A : ToeplitzOperator, ToeplitzSum or CoupledOperator, or MaskedOperator of one
        Symmetric or complex Hermitian, of any number of axes.
    dtype : float32 or float64, optional
        Precision in which the preconditioner is stored and applied; by default that of `A`. Use
        complex64 or complex128 if `A` is complex. Single precision halves the memory and takes less
        time, also inside an iteration in double precision.

    Returns
    -------
    ToeplitzOperator, CoupledOperator or MaskedOperator
        M ≈ A⁻¹, same shape as `A`, Hermitian positive definite: a preconditioner for
        `scipy.sparse.linalg.cg`. One product costs one work unit. On a mask it is M_r, the
        restriction of the M of the whole grid (paper, §5.4).

    Raises
    ------
    numpy.linalg.LinAlgError
        If an eigenvalue of the circulant that embeds `A` is not positive, as for a symbol with a
        zero. Use `spectral_preconditioner` (one axis) or `chan_preconditioner` (any number), which
        are positive definite for every positive definite `A`.
    TypeError, ValueError
        If `A` is not a Toeplitz operator, or not Hermitian.

    See Also
    --------
    fft_rsm_preconditioner : M with constant row sums, a smoother.
    fft_sd_preconditioner : M with subdomain deflation, a smoother.

    Notes
    -----
    The circulant of length 2 n - 1 with first column (a₀ … a_{n-1}, a_{n-1} … a₁) is inverted;
    the coefficients of M are the first n of its inverse. M is a leading block of that inverse and
    hence positive definite where the circulant is. The two halves are not separated by a zero,
    which would count as a coefficient and make M useless.

    If `A` is large and 2 n - 1 has a prime factor above 61, transforms of this length are slow. The
    circulant then has a slightly larger length 2 L, and a parabola with zero slope at the lag L
    supplies the coefficients of the lags n … L.

    For coupled components a small matrix is inverted at each frequency. Ignoring the coupling,
    ``componentwise(fft_preconditioner)(A)``, takes some more iterations.

    M fails as a smoother: I - M A has two eigenvalues far below -1, with eigenvectors concentrated
    at the two ends (paper, §3.2). CG removes them in two steps, and then needs fewer iterations
    with M than with `fft_rsm_preconditioner`.

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
        return restrict(_invert_coupled(full, precision(full, dtype)), mask)
    return _invert_toeplitz(A, dtype)


@lift(accepts="Hermitian", parts=("mask",))
def _invert_toeplitz(A: ToeplitzOperator, dtype: DTypeLike | None) -> ToeplitzOperator:
    """Return M for one component on the whole grid: the inverse of a circulant, cut to the grid."""
    dtype = precision(A, dtype)
    lengths = tuple(2 * n - 1 for n in A.grid_shape)
    is_even = A.is_even and A.dtype.kind != "c"
    is_exact = not (is_even and is_continued(A.grid_shape))
    transforms, library = _transforms_for(A), A.library
    if is_exact:
        count_transforms(2, *lengths)
        spectrum = library.real(transforms.forward(A.circulant(lengths)))
    else:
        column = library.cast(A.c, np.float64)
        for axis, n in enumerate(A.grid_shape):
            column = continue_axis(column, axis, near_fast_length(n))
        spectrum = library.cosine_sums(column)
    require_positive(spectrum, dtype, SUBJECT, name_robust(A.grid_shape))
    spectrum = library.invert(spectrum)
    if is_exact:
        inverse = transforms.backward(spectrum, s=lengths, axes=tuple(range(len(lengths))))
    else:
        inverse = library.cosine_sums(spectrum)
        inverse /= prod(2 * (m - 1) for m in spectrum.shape)
    inverse = library.cast(inverse, dtype)
    if is_even:
        return ToeplitzOperator(inverse[tuple(slice(n) for n in A.grid_shape)])
    lags = library.xp.fft.fftshift(inverse)
    return ToeplitzOperator.from_lags(_make_hermitian(lags))


def is_continued(grid: tuple[int, ...]) -> bool:
    """Whether a circulant longer than 2 n - 1 is used: for large grids with slow transforms."""
    is_fast = all(near_fast_length(2 * n - 1) == 2 * n - 1 for n in grid)
    return not is_fast and prod(grid) >= LONG


def _transforms_for(A: ToeplitzOperator | CoupledOperator) -> Transforms:
    """Return the transforms that diagonalise circulants of the dtype of A."""
    return A.library.complex_fourier if A.dtype.kind == "c" else A.library.fourier


def _make_hermitian(lags: Array) -> Array:
    """Remove the rounding errors from coefficients that should be Hermitian."""
    library = library_of(lags)
    return (lags + library.conj(library.xp.flip(lags))) / 2


def _invert_coupled(A: CoupledOperator, dtype: DTypeLike) -> CoupledOperator:
    """Return the leading block of the inverse of the block circulant that embeds `A`.

    Raises
    ------
    numpy.linalg.LinAlgError
        If the block circulant is not positive definite.
    ValueError
        If A is not Hermitian, or a diagonal block is zero.
    """
    check_hermitian(A)
    components, *grid = A.grid_shape
    for i in range(components):
        A.component(i)  # Raises an error if the block is zero.
    lengths = tuple(near_fast_length(2 * n - 1) for n in grid)
    transforms = _transforms_for(A)
    precise = np.result_type(A.dtype, dtype)
    advice = "componentwise(chan_preconditioner)(A), which needs the components only"

    def find_lags(symbol: Any, i: int, j: int) -> Array:
        axes = tuple(range(len(grid)))
        lags = transforms.backward(symbol, s=lengths, axes=axes)
        lags = A.library.xp.roll(lags, tuple(n - 1 for n in grid), axis=axes)
        lags = lags[tuple(slice(2 * n - 1) for n in grid)]
        return A.library.cast(_make_hermitian(lags) if i == j else lags, dtype)

    def make(lags: Array, i: int, j: int) -> tuple[ToeplitzOperator, ToeplitzOperator]:
        block = ToeplitzOperator.from_lags(lags)
        return block, block.H

    blocks = invert_blocks(
        A.blocks,
        lambda block: _sample_symbol(block, lengths, transforms),
        lambda pivot: require_positive(pivot, precise, BLOCK_SUBJECT, advice),
        find_lags,
        make,
        lengths,
    )
    return CoupledOperator(blocks)


def _sample_symbol(
    block: ToeplitzOperator, lengths: tuple[int, ...], transforms: Transforms
) -> Any:
    """Return the eigenvalues of the circulant that embeds a block."""
    library = block.library
    column = library.cast(block.lags, np.result_type(block.dtype, np.float64))
    for axis, length in enumerate(lengths):
        ahead, behind = split(library, column, axis, 0)
        column = around(library, ahead, behind, axis, length, is_straight=True)
    symbol = transforms.forward(column)
    return library.real(symbol) if block.is_hermitian else symbol


def invert_blocks(
    blocks: Any,
    sample: Callable[[Any], Any],
    check: Callable[[Any], None],
    find_lags: Callable[[Any, int, int], Array],
    make: Callable[[Array, int, int], tuple[Any, Any]],
    lengths: Sequence[int],
) -> list[list[Any]]:
    """Return the blocks of the inverse of the block circulant that embeds a Hermitian matrix.

    Parameters
    ----------
    blocks : sequence of sequences of (ToeplitzOperator or None)
    sample : callable
        Returns the symbol of a block.
    check : callable
        Raises an error if a pivot is not positive.
    find_lags, make : callable
        ``find_lags(symbol, i, j)`` returns the coefficients of block (i, j) of the inverse, and
        ``make(lags, i, j)`` its blocks (i, j) and (j, i).
    lengths : sequence of int
        The lengths of the transforms of a block.
    """
    components = range(len(blocks))
    S: list[list[Any]] = [[0.0 for _ in components] for _ in components]
    for i in components:
        for j in range(i + 1):
            if (block := blocks[i][j]) is not None:
                count_transforms(1, *lengths)
                S[i][j] = sample(block)
                if i != j:
                    S[j][i] = library_of(S[i][j]).conj(S[i][j])
    invert_matrices(S, check)
    inverse: list[list[Any]] = [[None for _ in components] for _ in components]
    for i in components:
        for j in range(i + 1):
            if np.ndim(S[i][j]) == 0:
                continue  # The block is zero.
            count_transforms(1, *lengths)
            lags = find_lags(S[i][j], i, j)
            S[i][j] = S[j][i] = 0.0  # Free the memory.
            inverse[i][j], inverse[j][i] = make(lags, i, j)
    return inverse


def invert_matrices(S: list[list[Any]], check: Callable[[Any], None]) -> None:
    """Invert a Hermitian matrix at each frequency, in place, by Gauss-Jordan elimination.

    It is positive definite if all pivots are positive; `check` is called with each of them.
    """
    for k in range(len(S)):
        pivot = library_of(S[k][k]).real(S[k][k])
        check(pivot)
        # A number instead of an array stands for a zero block.
        others = [j for j in range(len(S)) if j != k and np.ndim(S[k][j]) > 0]
        row = {j: S[k][j] / pivot for j in others}
        for i in others:
            factor = S[i][k]
            for j in others:
                S[i][j] = S[i][j] - factor * row[j]
            S[i][k] = -factor / pivot
        for j in others:
            S[k][j] = row[j]
        S[k][k] = 1.0 / pivot
