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
        Symmetric positive definite, of any number of axes and any size. For a sum the cycle is that
        of an approximating Toeplitz matrix: use it with `cg`, as `richardson` may diverge.
    smoother : callable, optional
        Function that maps the matrix of a level to an approximate inverse S, a LinearOperator; a
        smoothing step is x ← x + S (b - A x). Any preconditioner function of this package, or your
        own. The default is the paper's M̄ (`fft_rsm_preconditioner`) on levels where it converges,
        and elsewhere `default_preconditioner`, scaled so that it converges.
    pre, post : int
        Numbers of smoothing steps before and after the coarse-grid correction, not both 0.
    gamma : int
        Number of coarse cycles in a cycle: 1 for V(pre, post), 2 for W(pre, post).
    coarsest : int
        A level with at most this number of unknowns is solved by a dense Cholesky factorisation (2
        in the paper). Two other cases are solved directly: up to 600 unknowns where the default
        smoother M̄ may diverge, and up to 2048 unknowns of a mask without a complete coarse element.
    interpolation : Interpolation
        `piecewise_constant`, as in the paper, for a positive symbol; `linear_interpolation` for a
        symbol with a zero of order 2 at θ = 0, `modulated_interpolation` for a zero at π. For a
        symbol with a zero use `jacobi_preconditioner` as the smoother.
    coarsen : callable, optional
        Function that maps the matrix of a level to that of the next coarser grid. The default is
        `galerkin`; the paper has ``rediscretised(operator_of_grid_shape)``.

    Returns
    -------
    Multigrid
        One cycle from a zero guess, same shape and dtype as `A`. Its ``repr`` shows the levels and
        the cost; its attributes `is_hermitian` and `is_definite` tell whether it is symmetric and
        positive definite by construction.

    Raises
    ------
    ValueError
        If there is no smoothing step, a parameter is below its smallest value, or the matrix is not
        symmetric.
    TypeError
        If a parameter has the wrong type.
    numpy.linalg.LinAlgError
        If A or the coarsest matrix is not positive definite, or if a given smoother refuses the
        matrix of the finest level, or of a level with more than 2048 unknowns.

    Warns
    -----
    UserWarning
        If a given smoother diverges on a level, so that the cycle may diverge and be indefinite;
        if a given smoother refuses a coarse level, which is then solved directly; if gamma is even
        and you give the coarse matrices, so that the cycle may be indefinite.

    See Also
    --------
    richardson : iterate with the cycle as a solver.
    cg : use the cycle as a preconditioner.
    fft_rsm_preconditioner, default_preconditioner : the default smoothers.
    galerkin : the default coarse matrices.
    linear_interpolation : interpolation for symbols with a zero.

    Notes
    -----
    **V(1,1)**, and any cycle with ``pre == post``, is symmetric if its smoother is, and positive
    definite if the smoother also converges on every level, 0 < λ(S A) < 2. It may then precondition
    `scipy.sparse.linalg.cg`. With the default smoother this holds for every symmetric positive
    definite matrix. For a given symmetric smoother (``S.H is S``) the largest eigenvalue of S A is
    estimated by ten steps of Lanczos's method on each level, unless it is known, as for M̄ and
    `jacobi_preconditioner`. A cycle whose smoother diverges is built all the same, with a warning:
    Table I of the paper has such cycles.

    **V(1,0) and V(0,1)** are not symmetric, not even in the inner product of A. As a preconditioner
    of `cg`, which assumes symmetry, they may stagnate or take more iterations. They are meant for
    `richardson`, where V(0,1) is the cheapest cycle: with a zero guess its first residual is `b`.
    With a symmetric smoother V(1,0) is the adjoint of V(0,1), and both converge equally fast
    asymptotically.

    By default restriction averages two elements along each axis (paper, Eq. 13), and interpolation
    copies (Eq. 14). Convergence does not depend on whether n is even. On an odd grid of one axis
    the last element is corrected together with the coarse grid, and so are up to 16 active elements
    that no coarse element covers; on several axes an odd n has (n + 1)/2 coarse elements, and fine
    elements that lie in two of them are weighted by area. A coarse element belongs to a mask if all
    fine elements do that lie in it by more than half. A mask with many fragments leaves few coarse
    elements, and the cycle is hardly better than its smoother: prefer `default_preconditioner`,
    which takes about twice the iterations at a fifth of the work each.

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
    # Operators are callable too: calling one multiplies.
    if not (smoother is None or callable(smoother)) or isinstance(smoother, LinearOperator):
        raise TypeError(
            f"smoother is {smoother!r}, but must be a function of the matrix of a level, such as "
            "fft_rsm_preconditioner"
        )
    if not isinstance(interpolation, Interpolation):
        raise TypeError(f"interpolation is {interpolation!r}, but must be an Interpolation")
    if not (coarsen is None or callable(coarsen)):
        raise TypeError(f"coarsen is {coarsen!r}, but must map a matrix to the next coarser one")
    unwrap_toeplitz(A)  # Raises an error unless A is a symmetric Toeplitz matrix.
    levels = build_levels(A, smoother, coarsest, interpolation, coarsen)
    M = Multigrid(levels, pre, post, gamma)
    for k, level in enumerate(levels):
        if not level.converges:
            warnings.warn(
                f"the smoother {level.smoother!r} diverges on level {k} of multigrid, because its "
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
