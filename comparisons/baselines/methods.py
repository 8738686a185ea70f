"""What solves a Toeplitz system: each method sets itself up for a problem and returns its solve.

Where pyamg preconditions CG, the matrix of CG is the full one, with the fast product; its hierarchy
is built from the dense matrix or from a copy with 16 off-diagonals on each side. pyamg starts some
estimates at random: its iterations vary a little from run to run.
"""

from functools import partial
from typing import Any

import numpy as np
import pyamg
from scipy.linalg import cho_factor, cho_solve, solve_toeplitz, toeplitz
from scipy.sparse import csr_array, diags_array
from scipy.sparse.linalg import LinearOperator, cg

import toeplitz_mg as tmg
from comparisons.harness.measuring import (
    TOLERANCE,
    Contender,
    Solve,
    System,
    by_iteration,
    column_and_mask,
    nothing,
)
from toeplitz_mg._typing import Array

MAXCYCLES = 300  # Cycles of algebraic multigrid alone, where one costs several dense products.
DENSE_BYTES = 4e9  # Bytes of the largest dense matrix that is tried.
BANDWIDTH = 16  # Off-diagonals on each side that the banded copy keeps.


def dense(A: LinearOperator) -> Array:
    """Return the dense matrix, unless it is too large."""
    column, mask = column_and_mask(A)
    refuse_above_limit(8.0 * len(column) ** 2)
    matrix = toeplitz(column)
    return matrix if mask.all() else matrix[np.ix_(mask, mask)]


def dense_csr(A: LinearOperator) -> csr_array:
    """Return the dense matrix in sparse format, unless it is too large."""
    refuse_above_limit(12.0 * A.shape[0] ** 2)
    return csr_array(dense(A))


def banded_csr(A: LinearOperator) -> csr_array:
    """Return the matrix without the coefficients beyond the lag `BANDWIDTH`."""
    column, mask = column_and_mask(A)
    lags = np.arange(-BANDWIDTH, BANDWIDTH + 1)
    band = diags_array(column[abs(lags)], offsets=lags, shape=(len(column), len(column)))
    matrix = band.tocsr()
    return matrix if mask.all() else matrix[mask][:, mask]


def refuse_above_limit(size: float) -> None:
    """Raise where a matrix of `size` bytes is more than `DENSE_BYTES`."""
    if size > DENSE_BYTES:
        raise MemoryError(f"the matrix takes {size / 1e9:.3g} GB, the limit is {DENSE_BYTES / 1e9}")


def cholesky(problem: System) -> Solve:
    """Factorise the dense matrix."""
    # The transpose is in Fortran order, in which LAPACK overwrites it instead of a copy.
    factor = cho_factor(dense(problem.A).T, overwrite_a=True, check_finite=False)
    return lambda: (cho_solve(factor, problem.b, check_finite=False), None)


def levinson(problem: System) -> Solve:
    """Solve by SciPy's Levinson recursion, which has nothing to set up."""
    column, mask = column_and_mask(problem.A)
    if not mask.all():
        raise TypeError("a Toeplitz matrix on a mask is not a Toeplitz matrix")
    return lambda: (solve_toeplitz(column, problem.b, check_finite=False), None)


def algebraic(build: Any, problem: System) -> Solve:
    """Solve by algebraic multigrid alone, on the dense matrix in sparse format."""
    hierarchy = build(dense_csr(problem.A))

    def solve() -> tuple[Array, int]:
        residuals: list[float] = []
        x = hierarchy.solve(problem.b, tol=TOLERANCE, maxiter=MAXCYCLES, residuals=residuals)
        return x, len(residuals) - 1

    return solve


def algebraic_cycle(build: Any, sparse_copy: Any, A: LinearOperator) -> LinearOperator:
    """Precondition by a cycle of algebraic multigrid for a sparse copy of the matrix."""
    return build(sparse_copy(A)).aspreconditioner()


def by_default(problem: System) -> Solve:
    """Solve by `solve_toeplitz` on a line, and on a mask by CG with the default preconditioner."""
    column, mask = column_and_mask(problem.A)
    if not mask.all():
        return by_iteration(tmg.cg, tmg.default_preconditioner, problem)

    def solve() -> tuple[Array, int]:
        x, info = tmg.solve_toeplitz(column, problem.b, rtol=TOLERANCE, full_output=True)
        return x, info.iterations

    return solve


aggregation, classical = pyamg.smoothed_aggregation_solver, pyamg.ruge_stuben_solver
v01 = partial(tmg.multigrid, pre=0, post=1)
v11 = partial(tmg.multigrid, pre=1, post=1)


def cg_algebraic(name: str, build: Any, sparse_copy: Any) -> Contender:
    """Return CG on the full matrix with algebraic multigrid for a sparse copy of it."""
    method = partial(by_iteration, cg, partial(algebraic_cycle, build, sparse_copy))
    return Contender(name, method, counted=False)


METHODS = (
    Contender("dense Cholesky", cholesky, counted=False),
    Contender("SciPy's solve_toeplitz", levinson, counted=False),
    Contender("CG", partial(by_iteration, cg, nothing)),
    Contender("CG + Strang", partial(by_iteration, cg, tmg.strang_preconditioner)),
    Contender("CG + T. Chan", partial(by_iteration, cg, tmg.chan_preconditioner)),
    Contender("pyamg SA", partial(algebraic, aggregation), counted=False),
    Contender("pyamg RS", partial(algebraic, classical), counted=False),
    cg_algebraic("CG + pyamg SA", aggregation, dense_csr),
    cg_algebraic("CG + pyamg RS", classical, dense_csr),
    cg_algebraic("CG + pyamg SA, banded", aggregation, banded_csr),
    cg_algebraic("CG + pyamg RS, banded", classical, banded_csr),
    Contender("CG + M", partial(by_iteration, cg, tmg.fft_preconditioner), ours=True),
    Contender("CG + M̄", partial(by_iteration, cg, tmg.fft_rsm_preconditioner), ours=True),
    Contender("CG + cosine", partial(by_iteration, cg, tmg.cosine_preconditioner), ours=True),
    Contender("V(0,1)", partial(by_iteration, tmg.richardson, v01), ours=True),
    Contender("CG + V(1,1)", partial(by_iteration, cg, v11), ours=True),
    Contender("the default", by_default, ours=True, counted=False),
)
