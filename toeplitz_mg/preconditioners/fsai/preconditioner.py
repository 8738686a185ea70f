"""The multilevel sparse approximate inverse of a Toeplitz matrix on a mask."""

from dataclasses import replace
from math import log2, prod
from typing import Any

import numpy as np
from numpy.typing import DTypeLike
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.arrays.library import NUMPY
from toeplitz_mg.engine.products import multiply_rows
from toeplitz_mg.engine.work import axes_of
from toeplitz_mg.engine.workspace import workspace
from toeplitz_mg.operators import CoupledOperator, GridOperator
from toeplitz_mg.operators.base import library_for
from toeplitz_mg.operators.lifting import (
    coefficients_on_numpy,
    componentwise,
    lift,
    unwrap,
    unwrap_toeplitz,
)
from toeplitz_mg.operators.positivity import name_for_smooth, precision
from toeplitz_mg.preconditioners.fsai.build import DEFAULT, Options, build
from toeplitz_mg.preconditioners.fsai.coupled import find_coupled_stencil
from toeplitz_mg.preconditioners.fsai.levels import Direct, Level, LevelMatrix
from toeplitz_mg.preconditioners.fsai.line import LineLevel, LineMatrix, build_line
from toeplitz_mg.preconditioners.fsai.neighbours import choose_stencil
from toeplitz_mg.preconditioners.fsai.rows import advise
from toeplitz_mg.values import count

MOST_NEIGHBOURS = 100  # Most neighbours of a row of G: it takes 1.6 ms, and 40 usually suffice.


class MultilevelSparseInverse(GridOperator):
    """P = Gᵀ (I - W Wᵀ + W E⁻¹ Wᵀ) G ≈ A⁻¹, returned by `fsai_preconditioner`.

    Attributes
    ----------
    grid_shape : tuple of int
        The shape of the whole grid.
    mask : ndarray of bool, of shape `grid_shape`
        The cells that are unknowns.
    sizes : tuple of int
        The number of unknowns on each level.
    """

    def __init__(
        self, level: Level | Direct | LineLevel, mask: Array, lengths: tuple[int, ...], dtype: Any
    ) -> None:
        self.mask = mask
        self.mask.flags.writeable = False
        self.sizes = level.sizes
        self.level = level
        # The work by operations: a product with a Toeplitz matrix along d axes longer than one has
        # two real transforms of m = 2^d n points, each with 5/2 m log₂ m operations.
        m = 2 ** axes_of(lengths) * prod(lengths)
        self.points = 2 * level.multiplications * prod(lengths) / (5 * m * log2(m))
        super().__init__(dtype, mask.shape, self.points / mask.size, level.sizes[0])

    def multiply(self, X: Array, out: Array) -> None:
        """Multiply the rows of `X`, real, of shape (rows, N), into `out`, which may be `X`."""
        if len(X) == 1:
            # A sparse product with a vector is faster than one with a column.
            X, out = X[0], out[0]
        direct = out.dtype == self.dtype and out.flags.c_contiguous
        Y = out if direct else workspace(X.shape, self.dtype)
        self.level.multiply(X.astype(self.dtype, copy=False), Y)
        if not direct:
            out[...] = Y

    apply = multiply_rows

    def __repr__(self) -> str:
        grid = " x ".join(map(str, self.grid_shape))
        sizes = " > ".join(map(str, self.sizes))
        return (
            f"<MultilevelSparseInverse {sizes} (direct) of a grid of {grid}, "
            f"{self.work:.2g} work units, {self.dtype}>"
        )


@lift(accepts="symmetric", parts=())
def fsai_preconditioner(
    A: LinearOperator, *, neighbours: int | None = None, dtype: DTypeLike | None = None
) -> LinearOperator:
    """Return a multilevel sparse approximate inverse of A, efficient on fragmented masks.

    Parameters
    ----------
    A : ToeplitzOperator, ToeplitzSum or CoupledOperator, or MaskedOperator of one
        Symmetric positive definite, of one or two axes (not counting axes of one element), and
        symmetric along each of them.
    neighbours : int, optional
        Number of preceding cells that a row of the factor G uses, 1 to 100. By default the smallest
        of 12, 24 and 40 that suffices on a trial problem; if 40 do not suffice, the matrix is
        refused. A number given here is taken as it is, and components are then preconditioned
        separately. On one axis without a mask it is always 15.
    dtype : float32 or float64, optional
        Precision in which the preconditioner is stored and applied; by default that of `A`. The
        set-up is in float64.

    Returns
    -------
    MultilevelSparseInverse
        Symmetric positive definite, same shape as `A`. For a `CoupledOperator` it treats both
        components together if they are coupled as tangential tractions are for 1/3 < ν ≤ 1/2;
        otherwise it is a BlockDiagonal.

    Raises
    ------
    numpy.linalg.LinAlgError
        If a pivot is not positive: `A` is not positive definite, or its kernel is too smooth. Also
        if a kernel would need more than some 16 iterations, such as a covariance with a
        correlation length of many cells; this is not checked on one axis without a mask, nor for
        systems that are small enough to be solved directly.
    TypeError
        If `A` is not a Toeplitz operator, or `neighbours` not an integer.
    ValueError
        If `A` has three axes or more, or is not symmetric along each of them, or if `neighbours` is
        not in 1 … 100.

    See Also
    --------
    default_preconditioner : selects a preconditioner for a matrix.
    cosine_preconditioner : for grids without a mask.

    Notes
    -----
    For half-space kernels conjugate gradients take 5 to 11 iterations to a relative residual of
    1e-8 (coupled components 7 to 12). This holds for any mask and any number of cells, on elements
    stretched up to 1:20. Elements up to 1:150 take at most 18 iterations; for much longer ones
    tangential tractions are refused. The preconditioners by FFT take 20 to 50 iterations on a
    fragmented mask, but need less time on a full grid or on a single compact area.

    Smoother kernels need more neighbours. The table has the iterations for Matérn covariances with
    smoothness ν and the correlation length in cells (the worst of nine masks of 128 x 128 cells),
    and the set-up time if half of 512 x 512 cells are unknowns, by the number of neighbours:

    ============= ===== ===== ===== ========
    ν, length     12    24    40    default
    ============= ===== ===== ===== ========
    1/2, 1        7     5     4     12
    1/2, 3        16    13    11    24
    1/2, 5        22    18    15    40
    1/2, 8        30    25    20    refused
    3/2, 2        16    10    8     24
    3/2, 3        29    18    13    40
    3/2, 4        46    27    19    refused
    5/2, 2        23    12    9     24
    5/2, 3        49    25    16    refused
    half-space    9     8     8     12
    µs an unknown 0.4   5     16
    ============= ===== ===== ===== ========

    A kernel with coefficients at isolated lags is accepted, but may take 30 iterations: the trial
    problem does not detect it.

    One application costs some 30 multiplications an unknown, a few hundredths of a work unit.
    Sparse products are limited by memory, so in time it is a tenth to a half of a work unit. On one
    axis without a mask all rows of G are equal, and a set-up takes a tenth of a product's time.

    The package `toeplitz_mg.preconditioners.fsai` explains the construction; its modules `line`,
    `coupled` and `neighbours` explain the case of one axis, coupled components and the trial
    problem.

    References
    ----------
    L. Yu. Kolotilina, A. Yu. Yeremin, Factorized sparse approximate inverse preconditionings I.
    Theory, SIAM J. Matrix Anal. Appl. 14 (1993). The coarse part is of this package.

    Examples
    --------
    >>> import numpy as np
    >>> import toeplitz_mg as tmg
    >>> x, y = tmg.halfspace.offsets((64, 64), (1.0, 1.0))
    >>> full = tmg.ToeplitzOperator(tmg.halfspace.influence_zz(x, y, (1.0, 1.0), G=1.0, nu=0.28))
    >>> A = tmg.MaskedOperator(full, np.random.default_rng(0).random((64, 64)) < 0.5)
    >>> b = np.ones(A.shape[0])
    >>> p, info = tmg.cg(A, b, M=tmg.fsai_preconditioner(A), rtol=1e-8, maxiter=9)
    >>> info
    0
    """
    options, library = Options(check_neighbours(neighbours)), library_for(A)
    if library is NUMPY:
        return fsai_with_options(A, options, dtype)
    from toeplitz_mg.preconditioners.fsai.portable import on_library

    alike = replace(options, is_line_alike=False)
    return on_library(library, fsai_with_options(coefficients_on_numpy(A), alike, dtype))


def check_neighbours(neighbours: int | None) -> int | None:
    """Return `neighbours` if it is valid; raise an error otherwise."""
    if neighbours is None:
        return None
    neighbours = count("neighbours", neighbours)
    if neighbours > MOST_NEIGHBOURS:
        raise ValueError(
            f"neighbours is {neighbours}, but must be at most {MOST_NEIGHBOURS}: a row of G "
            "takes their number cubed in operations"
        )
    return neighbours


def fsai_with_options(
    A: LinearOperator, options: Options, dtype: DTypeLike | None = None
) -> LinearOperator:
    """Return `fsai_preconditioner` with these options."""
    joint = coupled_fsai(A, dtype, options)
    return _uncoupled_fsai(A, dtype, options) if joint is None else joint


def coupled_fsai(
    A: LinearOperator, dtype: DTypeLike | None = None, options: Options = DEFAULT
) -> MultilevelSparseInverse | None:
    """Return `fsai_preconditioner` for all components together if they are strongly coupled."""
    full, mask = unwrap(A)
    if options.neighbours or not isinstance(full, CoupledOperator):
        return None
    if (stencil := find_coupled_stencil(full)) is None:
        return None
    mask = np.ones(full.grid_shape, dtype=bool) if mask is None else mask
    dtype = precision(full, dtype)
    with advise(name_for_smooth(full.grid_shape[1:])):
        level = build(stencil, LevelMatrix.of_mask(stencil, mask), dtype, options)
    return MultilevelSparseInverse(level, mask, full.grid_shape[1:], dtype)


@componentwise
def _uncoupled_fsai(
    A: LinearOperator, dtype: DTypeLike | None, options: Options
) -> MultilevelSparseInverse:
    """Return `fsai_preconditioner` for each component separately."""
    full, mask = unwrap_toeplitz(A)
    squeezed = full.squeezed
    if len(squeezed.grid_shape) > 2:
        raise ValueError(
            f"A is {full!r}, but must have one axis or two: use default_preconditioner(A)"
        )
    if not full.is_even:
        raise ValueError(
            f"A is {full!r}, but must be symmetric along each axis: use chan_preconditioner(A)"
        )
    if mask is None:
        mask = np.ones(full.grid_shape, dtype=bool)
    dtype = precision(full, dtype)
    kernel = np.atleast_2d(squeezed.c.astype(np.float64, copy=False))
    level: Level | Direct | LineLevel
    is_line, unknowns = len(squeezed.grid_shape) == 1, int(np.count_nonzero(mask))
    with advise(name_for_smooth(squeezed.grid_shape)):
        if options.is_line_alike and is_line and unknowns == mask.size:
            level = build_line(LineMatrix.of_kernel(kernel.ravel()), dtype, options)
        else:
            stencil, own = choose_stencil(kernel, is_line, unknowns, unknowns == mask.size, options)
            level = build(stencil, LevelMatrix.of_mask(stencil, mask), dtype, own)
    return MultilevelSparseInverse(level, mask, kernel.shape, dtype)
