"""The set-up of a multigrid cycle: the function `multigrid`."""

import warnings

from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Coarsening, Preconditioner
from toeplitz_mg.multigrid_cycle.cycle import Multigrid
from toeplitz_mg.multigrid_cycle.hierarchy import build_levels
from toeplitz_mg.multigrid_cycle.interpolation import Interpolation, piecewise_constant
from toeplitz_mg.operators.lifting import lift, unwrap_toeplitz
from toeplitz_mg.values import count


@lift(accepts="symmetric", parts=(), numpy_only=True)
def multigrid(
    A: LinearOperator,
    *,
    smoother: Preconditioner | None = None,
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
        Symmetric positive definite, of any number of axes, of any size. The cycle of a sum is that
        of a Toeplitz matrix that stands for it, scaled: use `cg` then, as `richardson` may diverge.
    smoother : callable, optional
        Maps the matrix of a level to an approximate inverse S, a LinearOperator; a smoothing step
        is x ← x + S (b - A x). Any preconditioner of this package, or a function of one's own. By
        default it is M̄ (`fft_rsm_preconditioner`), the paper's, on the grids where it converges,
        and elsewhere `default_preconditioner`, so scaled that it converges.
    pre, post : int
        Smoothing steps before and after the coarse-grid correction, not both 0.
    gamma : int
        Coarse cycles in a cycle: 1 for V(pre, post), 2 for W(pre, post).
    coarsest : int
        A grid with at most this number of unknowns is solved by a dense Cholesky factorisation;
        2 in the paper. So is one of up to 600 where M̄ may diverge and no smoother is given, and
        one of up to 2048 of a mask in such fragments that no coarse element is whole in it.
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
        and the cost, and its attributes `is_hermitian` and `is_definite` say whether it is so by
        construction.

    Raises
    ------
    ValueError
        For a cycle with no smoothing at all, or a parameter below its least value; for a matrix
        that is not symmetric.
    TypeError
        For a parameter of the wrong type.
    numpy.linalg.LinAlgError
        Where A, or the coarsest matrix, is not positive definite, or a given smoother refuses the
        matrix of a level of more than 2048 unknowns, or of the first.

    Warns
    -----
    UserWarning
        Where a given smoother diverges on a level, so that the cycle may diverge and be indefinite;
        where a given smoother refuses a coarse grid, which is solved directly then; where gamma is
        even and the coarse matrices are given, so that the cycle may be indefinite.

    See Also
    --------
    richardson : cycles until it has converged.
    cg : with a cycle as M.
    fft_rsm_preconditioner, default_preconditioner : the smoothers.
    galerkin : the coarse matrices.
    linear_interpolation : for symbols with a zero.

    Notes
    -----
    **V(1,1)**, and any cycle with ``pre == post``, is symmetric if its smoother is, and positive
    definite if the smoother also converges on every level, 0 < λ(S A) < 2. So it may precondition
    `scipy.sparse.linalg.cg`. With the default smoother that holds for every symmetric positive
    definite matrix. Of a given one that is symmetric, as ``S.H is S`` tells, the largest eigenvalue
    of S A is estimated by ten steps of Lanczos's method on each level, unless it is known as
    those of M̄ and `jacobi_preconditioner` are. A cycle whose smoother diverges is built, with a
    warning: Table I of the paper is about such ones.

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
    fragments little is left on the coarse grid, and the cycle is hardly better than its smoother:
    `default_preconditioner` alone takes about twice the iterations, each of a fifth of the work.

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
    # An operator can be called too: it multiplies.
    if not (smoother is None or callable(smoother)) or isinstance(smoother, LinearOperator):
        raise TypeError(
            f"smoother is {smoother!r}, but must be a function of the matrix of a level, as "
            "fft_rsm_preconditioner is"
        )
    if not isinstance(interpolation, Interpolation):
        raise TypeError(f"interpolation is {interpolation!r}, but must be an Interpolation")
    if not (coarsen is None or callable(coarsen)):
        raise TypeError(f"coarsen is {coarsen!r}, but must map a matrix to the next coarser one")
    unwrap_toeplitz(A)  # This refuses what is not a symmetric Toeplitz matrix.
    levels = build_levels(A, smoother, coarsest, interpolation, coarsen)
    M = Multigrid(levels, pre, post, gamma)
    for k, level in enumerate(levels):
        if not level.converges:
            warnings.warn(
                f"the smoother {level.smoother!r} diverges on level {k} of multigrid, as its "
                "product with the matrix has an eigenvalue of about 2 or more: the cycle may "
                "diverge, and be no preconditioner for cg. The default smoother converges",
                stacklevel=3,
            )
            break
    if M.is_hermitian and gamma % 2 == 0 and coarsen is not None:
        warnings.warn(
            f"with gamma = {gamma} and coarse matrices other than those of galerkin the cycle may "
            "not be positive definite: for cg use gamma=1",
            stacklevel=3,
        )
    return M
