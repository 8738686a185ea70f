"""Multilevel sparse approximate inverse, for contact areas however fragmented.

P = Gᵀ (I - W Wᵀ + W E⁻¹ Wᵀ) G approximates A⁻¹, without any transform, in four steps.

**Local factor.** G is lower triangular, a row for each cell, on the 12 cells before it where the
kernel is largest (in two levels with square cells half of a 5 x 5 neighbourhood, in one a band),
as far as they are in contact. With S the matrix A - τ 11ᵀ of these cells and e the cell itself the
row is S⁻¹e/√(eᵀS⁻¹e): the factorised sparse approximate inverse (Kolotilina and Yeremin; in
statistics Vecchia's approximation), G S Gᵀ having the diagonal 1. A constant that the whole
neighbourhood feels cannot be resolved in it, and where the kernel is nearly constant (the logarithm
of a line contact) would make each row nearly a difference, whose load is none. So τ, the
coefficient twice as far as the neighbours are, is taken off; the coarse part sees it. A smoother
kernel needs more neighbours, 24 or 40; how many is judged on a window (`fsai_window`).

**Why the slow vectors of G A Gᵀ are G times smooth ones.** GᵀG inverts A for what changes from
cell to cell, and is too large for what changes slowly, for which A is much larger than S: there
lie the large eigenvalues of G A Gᵀ. If G A Gᵀ z = λ z, then z = G s with s = A (Gᵀz)/λ, the
displacement by the load Gᵀz; far from its load a displacement is smooth, across gaps too. So on
each aggregate J of 16 cells w_J = (G 1)_J/‖(G 1)_J‖ stands for them, and W = [w_J] is
orthonormal, the aggregates being disjoint.

**Why the coarse part replaces.** In the span of W the inverse is E⁻¹, E = Wᵀ G A Gᵀ W. There GᵀG
is too large already, and adding E⁻¹ to it could only make it larger: so W Wᵀ is first taken
out. P is then A⁻¹ exactly if G A Gᵀ is the identity on the complement of W, and does not couple.

**E without products of A.** It is the matrix of the loads Gᵀ w_J: c_J T(J-K) c_K, c_J their
totals in units of that of an aggregate in full contact, T(J-K) the mean of A over two blocks;
exact, for full contact, for near blocks. The diagonal must not be taken so: the load of an
aggregate of few cells is more concentrated than that of a full one, and acts most on itself. It
is w_Jᵀ G A Gᵀ w_J in fact, and that is computed for each: for half-space kernels near 1.15, as
G S Gᵀ has the diagonal 1 and τ adds to it.

**Recursion.** E is a Toeplitz matrix of smooth kernel again, but for the weights c and the
diagonal, so that P of E takes the place of E⁻¹, down to some hundreds of unknowns.

P is positive definite if the pivots eᵀS⁻¹e, and with them the diagonal of G, and the last matrix
are: by induction E⁻¹ is, and I - W Wᵀ + W E⁻¹ Wᵀ with it.
"""

from math import log2, prod
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.products import multiply_rows
from toeplitz_mg.engine.work import axes_of
from toeplitz_mg.engine.workspace import workspace
from toeplitz_mg.operators import CoupledOperator, GridOperator
from toeplitz_mg.operators.masked import check_mask
from toeplitz_mg.operators.structure import componentwise, unwrap, unwrap_toeplitz
from toeplitz_mg.preconditioners.fsai.build import build, few
from toeplitz_mg.preconditioners.fsai.coupled import strongly_coupled
from toeplitz_mg.preconditioners.fsai.levels import AnyLevel, Cells, Level, Patched
from toeplitz_mg.preconditioners.fsai.line import Dense, Line, WholeLine, line
from toeplitz_mg.preconditioners.fsai.neighbours import Stencils
from toeplitz_mg.preconditioners.fsai.stencil import NEIGHBOURS, Stencil
from toeplitz_mg.preconditioners.fsai.update import update
from toeplitz_mg.preconditioners.positivity import precision
from toeplitz_mg.values import count

MOST_NEIGHBOURS = 100  # of a row of G, 1.6 ms each; 40 are enough where any are
Levels = AnyLevel | Line | Dense
AnyStencils = Stencils | Stencil


class MultilevelSparseInverse(GridOperator):
    """P = Gᵀ (I - W Wᵀ + W E⁻¹ Wᵀ) G ≈ A⁻¹, of `fsai_preconditioner`.

    Attributes
    ----------
    grid_shape : tuple of int
        Of the whole grid.
    mask : ndarray of bool, of shape `grid_shape`
        The cells that are unknowns.
    sizes : tuple of int
        The number of unknowns on each level.
    """

    def __init__(self, stencils: AnyStencils, level: Levels, mask: Array, dtype: Any) -> None:
        N = level.sizes[0]
        self.mask = mask
        self.mask.flags.writeable = False
        self.sizes = level.sizes
        self._stencil = stencils
        self._level = level
        # By operations: two real transforms of m = 2^d points, each 5/2 m log₂ m, are a product
        # with a Toeplitz matrix in d levels.
        grid = stencils.T.shape[-2:]
        m = 2 ** axes_of(grid) * prod(grid)
        self.points = 2 * level.multiplications * prod(grid) / (5 * m * log2(m))
        super().__init__(dtype, mask.shape, self.points / mask.size, N)

    def updated(self, mask: ArrayLike) -> "MultilevelSparseInverse":
        """Return the preconditioner for another mask on the same grid, from this one.

        Parameters
        ----------
        mask : array_like of bool, of shape `grid_shape`, or that of one component

        Returns
        -------
        MultilevelSparseInverse
            Nearly as a new one: the loads of aggregates differ by at most 10 % from those it has.
            This one stays as it is.

        Raises
        ------
        TypeError, ValueError
            As `MaskedOperator`.
        numpy.linalg.LinAlgError
            As `fsai_preconditioner`.

        Notes
        -----
        What the kernel alone determines is shared, and so is what has not changed: the rows of
        this one are kept, and those that see a change are computed and applied beside them, until
        they are many. At 512 x 512 cells, 1 % of the unknowns changed, it takes 0.05 to 0.3 of a
        first set-up where they are in one place, 0.1 to 0.3 along the edges of the area, and 0.1
        to 0.33 scattered. An application takes 1.1 to 1.6 times as long as that of a new one, and
        iterations are the same.

        So it is of a chain of updates, each 0.15 to 0.7 where changes are scattered, while an
        application takes up to twice as long as that of a new one. Where some 40 % of the rows of a
        level would stand beside those that it was built with, or be of no use any more, it is built
        anew.

        Examples
        --------
        >>> import numpy as np
        >>> import toeplitz_mg as tmg
        >>> A = tmg.ToeplitzOperator(1.0 / (1.0 + np.arange(2000)))
        >>> P = tmg.fsai_preconditioner(A).updated(np.arange(2000) % 100 > 10)
        >>> P.sizes
        (1780, 125)
        """
        is_coupled = isinstance(self._stencil, Stencil)
        mask = check_mask(mask, self.grid_shape, is_coupled)
        level = _levels(self._stencil, mask, self.dtype, self._level)
        return MultilevelSparseInverse(self._stencil, level, mask, self.dtype)

    def multiply(self, X: Array, out: Array) -> None:
        """Multiply the rows of `X`, real, of shape (rows, N), into `out`, which may be `X`."""
        if len(X) == 1:  # a sparse product with a vector is faster than with a column
            X, out = X[0], out[0]
        direct = out.dtype == self.dtype and out.flags.c_contiguous
        Y = out if direct else workspace(X.shape, self.dtype)
        self._level.multiply(X.astype(self.dtype, copy=False), Y)
        if not direct:
            out[...] = Y

    def apply(self, X: Array, out: Array | None = None) -> Array:
        """As `GridOperator.apply`."""
        return multiply_rows(self, X, out)

    def __repr__(self) -> str:
        grid = " x ".join(map(str, self.grid_shape))
        sizes = " > ".join(map(str, self.sizes))
        return (
            f"<MultilevelSparseInverse {sizes} (direct) of a grid of {grid}, "
            f"{self.work:.2g} work units, {self.dtype}>"
        )


def fsai_preconditioner(
    A: LinearOperator, *, neighbours: int | None = None, dtype: DTypeLike | None = None
) -> LinearOperator:
    """Return a multilevel sparse approximate inverse of A, which does not mind fragmented areas.

    Parameters
    ----------
    A : ToeplitzOperator, or CoupledOperator, or MaskedOperator of one
        Symmetric positive definite, of one level or two (with more than one element), and
        symmetric in each of them.
    neighbours : int, optional
        How many cells before its own a row of G may see, 1 to 100. By default as many as the
        kernel needs, 12, 24 or 40, and where these are not enough it is refused; of a number that
        is given it is not judged whether it is enough, and components are treated each by itself.
        On the whole of a line it is 15 always.
    dtype : float32 or float64, optional
        The precision in which it is kept and applied, that of `A` by default. It is computed in
        float64.

    Returns
    -------
    MultilevelSparseInverse
        Of the shape of `A`, symmetric positive definite; of a CoupledOperator one of all unknowns
        where two components are coupled as tangential tractions are for ν > 1/3 (oddly, neither
        weakly nor more than for ν = 1/2), and else a BlockDiagonal. Its method ``updated(mask)``
        returns that of another mask, in less time than a new one takes.

    Raises
    ------
    numpy.linalg.LinAlgError
        Where a pivot, or the last matrix, is not positive definite: `A` is not then, or its kernel
        is so smooth that the loads Gᵀ w are differences. And where a kernel would take many more
        iterations than that of a half-space: a covariance of a correlation length of many cells,
        elements longer than 1:100. The whole of a line, and what is solved for directly, are not
        refused for this.
    TypeError
        Where `A` is no Toeplitz operator, or `neighbours` no integer.
    ValueError
        Where it has three levels or more, or is not symmetric in every level; where `neighbours`
        is below 1 or above 100.

    Notes
    -----
    For half-space kernels conjugate gradients take 5 to 11 iterations to a relative residual of
    1e-8 (coupled components 7 to 12), whatever the mask, from one line of cells to all of them,
    on square elements and on those stretched up to 1:20, and independently of the number of cells;
    up to 16 on those of 1:50, and some longer ones are refused: of normal tractions those beyond
    1:100, of tangential ones those beyond 1:50 (ν = 1/2). The preconditioners by FFT take 20 to
    50 on a fragmented area; on one smooth blob, or a full grid, they need less time.

    A Matérn covariance takes at most 15, on any mask, up to a correlation length of 5 cells with
    ν = 1/2, 3 with 3/2, 2 with 5/2, where transforms take 40 to 300; longer ones are refused, but
    for a large nugget. From 3, 2 and 1.5 cells on rows of 24 neighbours are needed, and at the
    longest of 40, whose set-up takes some 5 or 20 microseconds an unknown, in the place of 1 to 3.
    Other kernels that decay take at most 16, or are refused. One with coefficients at isolated lags
    is accepted and may take 30: how many it needs is not seen.

    One application costs some 30 multiplications an unknown, a few hundredths of a work unit by
    operations. Sparse products wait for memory: by time it is a tenth to a half of one.

    On a line that is all in contact its rows are all alike: there the set-up takes a tenth of a
    product, and an application a quarter of one, at 2²⁰ unknowns.

    How it is built, and why, says the module `toeplitz_mg.preconditioners.fsai`, of a whole line
    `toeplitz_mg.preconditioners.fsai.line`, and of coupled components
    `toeplitz_mg.preconditioners.fsai.coupled`.

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
    if neighbours is not None:
        neighbours = count("neighbours", neighbours)
        if neighbours > MOST_NEIGHBOURS:
            raise ValueError(
                f"neighbours is {neighbours}, but must be at most {MOST_NEIGHBOURS}: a row of G "
                "takes their number cubed in operations"
            )
        return _by_component(A, neighbours, dtype)
    joint = coupled_fsai(A, dtype)
    return _by_component(A, None, dtype) if joint is None else joint


def coupled_fsai(
    A: LinearOperator, dtype: DTypeLike | None = None
) -> MultilevelSparseInverse | None:
    """Return `fsai_preconditioner` of components together, if they are strongly coupled."""
    full, mask = unwrap(A)
    stencil = strongly_coupled(full) if isinstance(full, CoupledOperator) else None
    if stencil is None:
        return None
    mask = np.ones(full.grid_shape, dtype=bool) if mask is None else mask
    dtype = precision(full, dtype)
    return MultilevelSparseInverse(stencil, _levels(stencil, mask, dtype), mask, dtype)


@componentwise
def _by_component(
    A: LinearOperator, neighbours: int | None, dtype: DTypeLike | None
) -> LinearOperator:
    """Return the same of one component."""
    full, mask = unwrap_toeplitz(A)
    kernel = full.squeezed
    if len(kernel.grid_shape) > 2:
        raise ValueError(f"A is {full!r}, but must have one level or two")
    if not full.is_even:
        raise ValueError(f"A is {full!r}, but must be symmetric in every level")
    if mask is None:
        mask = np.ones(full.grid_shape, dtype=bool)
    stencils = Stencils(np.atleast_2d(kernel.c.astype(np.float64, copy=False)), neighbours)
    dtype = precision(full, dtype)
    return MultilevelSparseInverse(stencils, _levels(stencils, mask, dtype), mask, dtype)


def _levels(
    stencils: AnyStencils, mask: Array, dtype: np.dtype[Any], old: Levels | None = None
) -> Levels:
    """Build all levels, from those of another mask if there are any."""
    if isinstance(stencils, Stencils):
        if mask.all() and mask.size == max(mask.shape):
            return line(WholeLine.of(stencils.T.ravel()), dtype)
        smallest = stencils.smallest
        if few(cells := Cells.of_mask(smallest, mask)):
            return build(smallest, cells, dtype)
        stencil = stencils.sufficient
    else:
        stencil = stencils
    has_table = stencil.neighbours <= NEIGHBOURS
    cells = (Cells.of_mask if has_table else _without_table)(stencil, mask)
    if isinstance(old, Level | Patched):
        return update(stencil, cells, dtype, old)
    return build(stencil, cells, dtype)


def _without_table(stencil: Stencil, mask: Array) -> Cells:
    """Return the cells as those of a coarser level, whose rows are not taken from a table."""
    cells = Cells.of_mask(stencil, mask)
    c = cells.contact.astype(np.float64)
    return Cells(c, np.where(cells.contact, cells.d, 1.0))
