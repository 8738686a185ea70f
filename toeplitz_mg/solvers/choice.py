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
from toeplitz_mg.solvers.cosine_cg import CosineSolver
from toeplitz_mg.solvers.inverse import first_columns
from toeplitz_mg.solvers.levinson import levinson
from toeplitz_mg.solvers.machine import WINDOW, cosine_over_levinson
from toeplitz_mg.solvers.system import LARGEST_COSINE, ToeplitzSystem

MOST_ITERATIONS = 16  # Most iterations of CG: the inverse costs at most twice as much.
FEW = 2  # Most columns for which the inverse is not worth its set-up.
LARGEST_DENSE = 4096  # Unknowns of a matrix that LU factorises: of 128 MiB, in n³/3 operations.
MOST_STEPS = 2**32  # Most steps of Levinson's recursion: a column of 65,536 unknowns.

# `python -m comparisons.speed.drop_in` measures both sides of these.
SHORT = 256  # Most unknowns where Levinson's recursion is the fastest for a column, on any machine.
LONG = 1024  # Fewest unknowns where CG in the DCT domain is, on any machine.
CALLS = 9.0  # Columns of `WINDOW` numbers that cost as much as the calls of CG in the DCT domain.
COSINE_NUMBERS = 20_000  # Most numbers in all columns where that is faster than the inverse.
STEPS_OF_CG = 1_400_000  # Steps of Levinson's recursion, n² a column, for other set-ups of CG.
STEPS_OF_INVERSE = 3_000_000  # The same for the inverse.


class Method(NamedTuple):
    """What may solve a system: ``solve(B, rtol)`` returns solutions and iterations."""

    name: str
    solve: Callable[[Rows, float], tuple[Rows, int]]


def methods(system: ToeplitzSystem) -> Iterator[Method]:
    """Yield what may solve a system, the best choice first.

    The next one is asked for only where one has failed.
    """
    n, columns = len(system.c), system.columns
    if lu_is_fastest(n, columns):
        yield _lu_method(system)
        return
    if system.is_symmetric and not levinson_is_fastest(n, columns):
        yield from _methods_of_symmetric(system)
    else:
        yield _levinson_method(system)
    if n <= LARGEST_DENSE:
        # Levinson's recursion fails where a leading block is singular, or nearly so.
        yield _lu_method(system)


def _methods_of_symmetric(system: ToeplitzSystem) -> Iterator[Method]:
    n, columns = len(system.c), system.columns
    steps = columns * n**2
    if cosine_is_faster_than_inverse(n, columns):
        yield from _cosine_method(system)
    if steps <= (STEPS_OF_CG if columns <= FEW else STEPS_OF_INVERSE):
        yield _levinson_method(system)
        return
    if columns <= FEW:
        yield from _cg_method(system.A)
    # The inverse needs no more of the symbol than that A is positive definite.
    yield from _inverse_method(system.A)
    if steps <= MOST_STEPS:
        yield _levinson_method(system)  # A is indefinite, or singular.


def lu_is_fastest(n: int, columns: int) -> bool:
    """Whether a dense factor is the fastest: its set-up is of n³ steps, but each column is free."""
    return columns >= 4 + n // 32 and n <= SHORT


def levinson_is_fastest(n: int, columns: int) -> bool:
    """Whether Levinson's recursion is faster than any other method for a symmetric matrix.

    It takes n² steps for a column. CG in the DCT domain takes calls, which cost as much as `CALLS`
    columns of `WINDOW` numbers do, and a time in proportion to the numbers.
    """
    if n <= SHORT or n >= LONG:
        return n <= SHORT
    steps = columns * (n / WINDOW) ** 2
    of_cosine = (CALLS + columns * n / WINDOW) / (CALLS + 1.0)
    return steps <= of_cosine * cosine_over_levinson()


def cosine_is_faster_than_inverse(n: int, columns: int) -> bool:
    """Whether CG in the DCT domain is faster than anything that may follow it."""
    return n <= LARGEST_COSINE and (columns <= FEW or columns * n <= COSINE_NUMBERS)


def _cosine_method(system: ToeplitzSystem) -> Iterator[Method]:
    """Yield CG in the DCT domain, where its preconditioner is positive definite."""
    with suppress(np.linalg.LinAlgError):
        solver = CosineSolver(system.cosine_form, system.size)
        yield Method("cg in the DCT domain", solver.solve)


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
    return Method("scipy.linalg.solve_toeplitz", lambda B, rtol: (levinson(system.lags, B), 1))


def _lu_method(system: ToeplitzSystem) -> Method:
    return Method("scipy.linalg.lu_solve", partial(_lu, system))


def _lu(system: ToeplitzSystem, B: Rows, rtol: float) -> tuple[Rows, int]:
    return np.linalg.solve(scipy.linalg.toeplitz(system.c, system.r), B.T).T, 1
