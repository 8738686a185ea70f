"""Which method solves a Toeplitz system, and why: the choice that `solve_toeplitz` makes."""

from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from typing import NamedTuple

import numpy as np
import scipy.linalg
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Rows
from toeplitz_mg.operators import ToeplitzOperator
from toeplitz_mg.preconditioners.choice import candidates_of_line
from toeplitz_mg.solvers.cg import cg_by_recurrence
from toeplitz_mg.solvers.inverse import first_columns
from toeplitz_mg.solvers.system import ToeplitzSystem

MOST_ITERATIONS = 16  # Most iterations of CG: the inverse costs at most twice as much.
FEW = 2  # Most columns for which the inverse is not worth its set-up.
LARGEST_DENSE = 4096  # Unknowns of a matrix that LU factorises: of 128 MiB, in n³/3 operations.

# Work is counted in steps of the inner loops of Levinson's recursion, n² for a column: one
# multiplication and one addition in each of two vectors. The ratios to them are rough, and the same
# on every machine, so that the choice is, too. `python -m comparisons.speed.drop_in` measures both
# sides.
MOST_STEPS = 2**32  # Most steps of Levinson's recursion: a column of 65,536 unknowns.
LEVINSON_CALL = 2_900  # Steps that a column costs beside its own, for the calls.
CG_SETUP = 570_000  # Steps that the set-up of A and M costs, and the calls of all iterations.
CG_UNKNOWN = 700  # Steps an unknown of a column: some ten transforms, each a few log n long.
INVERSE_SETUP = 1_400_000  # Steps of all calls of the Schur algorithm, where it has to be that.
INVERSE_UNKNOWN = 2_100  # Steps an unknown of the Schur algorithm: some thirty products.
INVERSE_COLUMN = 20  # Steps an unknown of a product with the inverse.


class Method(NamedTuple):
    """What may solve a system: ``solve(B, rtol)`` returns solutions and iterations."""

    name: str
    solve: Callable[[Rows, float], tuple[Rows, int]]


def methods(system: ToeplitzSystem) -> Iterator[Method]:
    """Yield what may solve a system, the best choice first.

    The next one is asked for only where one has failed.
    """
    n, columns = len(system.c), system.columns
    if not levinson_is_faster(n, columns) and system.is_symmetric:
        if columns <= FEW:
            yield from _cg_method(system.A)
        # The inverse needs no more of the symbol than that A is positive definite.
        yield from _inverse_method(system.A)
        if _steps_of_levinson(n, columns) <= MOST_STEPS:
            yield _levinson_method(system)  # A is indefinite, or singular.
    else:
        yield _levinson_method(system)
    if n <= LARGEST_DENSE:
        # Levinson's recursion fails where a leading block is singular, or nearly so.
        yield Method("scipy.linalg.lu_solve", partial(_lu, system))


def levinson_is_faster(n: int, columns: int) -> bool:
    """Whether Levinson's recursion is less work than any method of this package."""
    by_cg = CG_SETUP + CG_UNKNOWN * n * columns
    by_the_inverse = INVERSE_SETUP + n * (INVERSE_UNKNOWN + INVERSE_COLUMN * columns)
    return _steps_of_levinson(n, columns) <= (by_cg if columns <= FEW else by_the_inverse)


def _steps_of_levinson(n: int, columns: int) -> int:
    return columns * (n**2 + LEVINSON_CALL)


def _cg_method(A: ToeplitzOperator) -> Iterator[Method]:
    """Yield CG with the preconditioners that `default_preconditioner` takes first of a whole line.

    Its last resorts are left out: the first is as good as the inverse, and costs as much.
    """
    for candidate in candidates_of_line(A):
        with suppress(np.linalg.LinAlgError):  # Its eigenvalues may not be positive.
            yield Method(f"cg, {candidate.name}", partial(_cg, A, candidate.make(A)))


def _inverse_method(A: ToeplitzOperator) -> Iterator[Method]:
    try:
        G = first_columns(A).inverse
    except np.linalg.LinAlgError:  # A is not positive definite.
        return
    yield Method("toeplitz_inverse", lambda B, rtol: (G.apply(B), 1))


def _cg(A: LinearOperator, M: LinearOperator, B: Rows, rtol: float) -> tuple[Rows, int]:
    X = np.empty_like(B)
    most = 0
    for x, b in zip(np.atleast_2d(X), np.atleast_2d(B), strict=True):
        x[:], iterations, converged = cg_by_recurrence(
            A, b, M=M, rtol=rtol, maxiter=MOST_ITERATIONS
        )
        if not converged:
            raise np.linalg.LinAlgError(f"cg has not converged in {MOST_ITERATIONS} iterations")
        most = max(most, iterations)
    return X, most


def _levinson_method(system: ToeplitzSystem) -> Method:
    return Method("scipy.linalg.solve_toeplitz", partial(_levinson, system))


def _levinson(system: ToeplitzSystem, B: Rows, rtol: float) -> tuple[Rows, int]:
    return scipy.linalg.solve_toeplitz((system.c, system.r), B.T, check_finite=False).T, 1


def _lu(system: ToeplitzSystem, B: Rows, rtol: float) -> tuple[Rows, int]:
    return np.linalg.solve(scipy.linalg.toeplitz(system.c, system.r), B.T).T, 1
