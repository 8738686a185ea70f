"""The set-up of a multigrid cycle: the function `multigrid`."""

from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Coarsening, Preconditioner
from toeplitz_mg.multigrid_cycle.cycle import Multigrid
from toeplitz_mg.multigrid_cycle.definite import require_definite
from toeplitz_mg.multigrid_cycle.hierarchy import build_levels
from toeplitz_mg.multigrid_cycle.interpolation import Interpolation, piecewise_constant
from toeplitz_mg.operators.lifting import lift, unwrap_toeplitz
from toeplitz_mg.preconditioners import fft_rsm_preconditioner
from toeplitz_mg.values import count


@lift(accepts="symmetric", parts=(), numpy_only=True)
def multigrid(
    A: LinearOperator,
    *,
    smoother: Preconditioner = fft_rsm_preconditioner,
    pre: int = 1,
    post: int = 1,
    gamma: int = 1,
    coarsest: int = 256,
    interpolation: Interpolation = piecewise_constant,
    coarsen: Coarsening | None = None,
) -> Multigrid:
    """Return one multigrid cycle as an approximate inverse of a Toeplitz operator (paper, §3.3).

    Parameters
    ----------
    A : ToeplitzOperator or ToeplitzSum, or MaskedOperator of one
        Symmetric positive definite, of any number of axes, of any size.
    smoother : callable
        Maps the matrix of a level to an approximate inverse S, a LinearOperator; a smoothing step
        is x ← x + S (b - A x). Any preconditioner of this package, or a function of one's own.
    pre, post : int
        Smoothing steps before and after the coarse-grid correction, not both 0.
    gamma : int
        Coarse cycles in a cycle: 1 for V(pre, post), 2 for W(pre, post).
    coarsest : int
        A grid with at most this number of unknowns is solved by a dense Cholesky factorisation;
        2 in the paper. So is a coarse grid of up to 2048 that the smoother refuses, and the last
        one of a mask in fragments.
    interpolation : Interpolation
        `piecewise_constant`, as in the paper, for a positive symbol; `linear_interpolation` for
        one with a zero of order 2 at θ = 0, `modulated_interpolation` for a zero at π. For a
        symbol with a zero take `jacobi_preconditioner` as the smoother.
    coarsen : callable, optional
        Maps the matrix of a level to that of the next coarser grid. By default it is `galerkin`;
        ``rediscretised(operator_of_grid_shape)`` in the paper.

    Returns
    -------
    Multigrid
        One cycle from a zero guess, of the shape and dtype of `A`; its ``repr`` shows the levels
        and the cost.

    Raises
    ------
    ValueError
        For a cycle with no smoothing at all, or a parameter below its least value; for a matrix
        that is not symmetric; for a mask of more than 2048 unknowns in fragments so small that it
        has no coarse grid.
    TypeError
        For a parameter of the wrong type.
    numpy.linalg.LinAlgError
        Where the smoother refuses the matrix of a level, or diverges and so makes the cycle
        indefinite, or the coarsest one is not positive definite.

    See Also
    --------
    richardson : cycles until it has converged.
    cg : with a cycle as M.
    fft_rsm_preconditioner : the smoother.
    galerkin : the coarse matrices.
    linear_interpolation : for symbols with a zero.

    Notes
    -----
    **V(1,1)**, and any cycle with ``pre == post``, is symmetric if its smoother is, and positive
    definite if the smoother also converges on every level, ρ(I - S A) < 1, as
    `fft_rsm_preconditioner` does on the matrices of the paper. It may precondition
    `scipy.sparse.linalg.cg`. `jacobi_preconditioner` converges where ω ‖A‖ is below 2 a₀. Of other
    smoothers that are symmetric, as ``S.H is S`` tells, it is found out by five steps of Lanczos's
    method on each level: ten work units on the finest, but none on a large whole grid where M̄ is
    certified. Where one may diverge, the cycle itself is examined, by twelve steps, and refused if
    it is not positive definite. To study one that diverges, as in the paper's Table I, make a
    `Multigrid` of levels.

    **V(1,0) and V(0,1)** are not symmetric, not even in the inner product of A. `cg` assumes a
    symmetric preconditioner; with these it may stagnate or, having converged by luck, need more
    iterations than it should. They are meant for `richardson`, where V(0,1) is the cheapest cycle
    of all: from a zero guess its first residual is `b` itself. With a symmetric smoother V(1,0)
    is the adjoint of V(0,1), and both converge equally fast in the end.

    By default restriction averages two elements along each axis (paper, Eq. 13), and interpolation
    copies (Eq. 14). The number of cycles does not depend on n being even: on an odd grid of one
    axis the last element, as up to 16 active elements that no coarse element covers, is corrected
    together with the coarse grid; on several axes the coarse elements of an odd n are (n + 1)/2,
    and fine ones that lie in two of them are weighed by area. A coarse element belongs to a mask
    where all its fine elements do, or those that lie in it by more than half. On a mask of many
    fragments little is left on the coarse grid, and the cycle is no better than its smoother.

    Examples
    --------
    >>> import numpy as np
    >>> from scipy.sparse.linalg import cg
    >>> import toeplitz_mg as tmg
    >>> problem = tmg.contact.problems.test1(4096)
    >>> M = tmg.multigrid(problem.A)
    >>> M
    <Multigrid V(1,1) RowSumModified  4096 > 2048 > 1024 > ... > 256 (dense)  7.5 work units>
    >>> x, info = cg(problem.A, problem.b, M=M, rtol=1e-8, maxiter=4)
    >>> info
    0
    """
    for name, value, least in (
        ("pre", pre, 0),
        ("post", post, 0),
        ("gamma", gamma, 1),
        ("coarsest", coarsest, 1),
    ):
        count(name, value, least)
    if pre + post == 0:
        raise ValueError("pre and post are both 0, but a cycle must smooth at least once")
    if not callable(smoother):
        raise TypeError(f"smoother is {smoother!r}, but must be a function of a matrix")
    if not isinstance(interpolation, Interpolation):
        raise TypeError(f"interpolation is {interpolation!r}, but must be an Interpolation")
    if not (coarsen is None or callable(coarsen)):
        raise TypeError(f"coarsen is {coarsen!r}, but must map a matrix to the next coarser one")
    unwrap_toeplitz(A)  # This refuses what is not a symmetric Toeplitz matrix.
    levels = build_levels(A, smoother, coarsest, interpolation, coarsen)
    M = Multigrid(levels, pre, post, gamma)
    require_definite(M, coarsen is None)
    return M
