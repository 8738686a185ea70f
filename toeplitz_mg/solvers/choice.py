"""Which method solves a Toeplitz system, and why: the choice that `solve_toeplitz` makes."""

from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cache, partial
from itertools import chain
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import get_lapack_funcs, lu_solve, toeplitz

from toeplitz_mg._typing import Array, Rows
from toeplitz_mg.engine.vectors import norm
from toeplitz_mg.operators import ToeplitzOperator
from toeplitz_mg.operators.gohberg_semencul import GohbergSemencul
from toeplitz_mg.preconditioners.choice import candidates_of_complex_line, candidates_of_line
from toeplitz_mg.preconditioners.circulant import away_from_zero, smooth_inverse
from toeplitz_mg.preconditioners.positivity import is_positive, rounding
from toeplitz_mg.preconditioners.selection import Candidate
from toeplitz_mg.preconditioners.spectral import spectral_preconditioner
from toeplitz_mg.preconditioners.traits import (
    decays_slowly,
    has_symbol,
    is_nearly_circulant,
    is_nearly_white,
)
from toeplitz_mg.solvers.attempts import (
    PATIENT,
    USUAL,
    solve_by_cg,
    solve_by_gmres,
    solve_in_cycles,
)
from toeplitz_mg.solvers.cosine_cg import CosineSolver
from toeplitz_mg.solvers.crossovers import (
    FEW,
    GENERAL,
    RECURSIVE,
    SHORT,
    cosine_is_faster_than_inverse,
    levinson_is_faster_than_inverse,
    levinson_is_fastest,
    lu_is_faster_than_levinson,
    recursion_is_faster_than_gmres,
    trench_is_faster_than_levinson,
)
from toeplitz_mg.solvers.inverse import first_columns
from toeplitz_mg.solvers.levinson import levinson
from toeplitz_mg.solvers.system import EPS, ToeplitzSystem
from toeplitz_mg.solvers.trench import column_and_row_of_inverse

UNSTABLE = 32_000 * EPS  # Backward error of the recursion that another one need not correct: 7e-12.
ALIKE = 100.0  # Largest ratio of eigenvalues where a product in single precision has 5 digits.
# Shift of the diagonal over the 2-norm of all coefficients. Of random ones without a diagonal the
# first solution has a backward error of 1e-10 to 1e-11 with it, with 10 times more or less 1e-9.
SHIFT = 1e-9
LARGEST_DENSE = 4096  # Unknowns of a matrix that LU factorises: of 128 MiB, in n³/3 operations.
LEVINSON = "scipy.linalg.solve_toeplitz"  # The name of the method that is its recursion.


class Method(NamedTuple):
    """What may solve a system.

    Attributes
    ----------
    name : str
    solve : callable
        ``solve(B, rtol)`` returns solutions and iterations.
    accepted : float
        Backward error at which a solution is left as it is, if no residual is asked for.
    """

    name: str
    solve: Callable[[Rows, float], tuple[Rows, int]]
    accepted: float = 0.0


def methods(system: ToeplitzSystem) -> Iterator[Method]:
    """Return what may solve a system, the best choice first.

    The next one is asked for only where one has failed.
    """
    n, columns = len(system.c), system.columns
    if system.is_symmetric:
        if not levinson_is_fastest(n, columns):
            return _methods_of_symmetric(system)
        if n >= RECURSIVE:
            return chain(_levinson_method(system), _dense_methods(system))
    elif n >= GENERAL:
        return _methods_of_general(system)
    return _dense_methods(system)


def _methods_of_symmetric(system: ToeplitzSystem) -> Iterator[Method]:
    n, columns = len(system.c), system.columns
    is_short = levinson_is_faster_than_inverse(n, columns)
    if cosine_is_faster_than_inverse(n, columns):
        yield from _cosine_method(system)
    if is_short and n < RECURSIVE:
        yield from _dense_methods(system)
        return
    if not may_be_definite(means := system.means):
        yield from _methods_of_indefinite(system)
        return
    if is_short:
        # Where A is definite Levinson's recursion loses no digits that another one would have.
        yield from _levinson_method(system)
        yield from _dense_methods(system)
        return
    if columns <= FEW:
        if is_nearly_circulant(system.c, means) and not decays_slowly(system.c):
            # 4 to 7 iterations, where the set-up of the spectral factor costs as much as 8.
            yield from _circulant_method(system, means, solve_by_cg, "cg, circulant")
        yield from _cg_methods(system.A, candidates_of_line(system.A))
    # The inverse needs no more of the symbol than that A is positive definite.
    yield from _inverse_method(system.A)
    yield from _methods_of_indefinite(system)


def _methods_of_general(system: ToeplitzSystem) -> Iterator[Method]:
    """Yield what may solve a system that is complex, or not symmetric."""
    n, columns = len(system.c), system.columns
    if system.is_hermitian:
        if may_be_definite(means := system.means):
            if columns <= FEW:
                yield from _methods_of_hermitian(system, means)
            yield from _inverse_method(system.A)
        if not recursion_is_faster_than_gmres(n, columns):
            yield from _gmres_circulant(system, "gmres, circulant of both signs")
    elif has_symbol(system.samples):
        if columns <= FEW:
            yield from _gmres_circulant(system, "gmres, circulant")
            yield from _gmres_spectral(system.A)
        yield from _inverse_method(system.A)
        if columns > FEW and not recursion_is_faster_than_gmres(n, columns):
            yield from _gmres_circulant(system, "gmres, circulant")
    yield from _dense_methods(system)


def _methods_of_hermitian(system: ToeplitzSystem, means: Array) -> Iterator[Method]:
    """Yield what may solve a complex system of few columns, if it is positive definite.

    Of those symbols that n coefficients resolve the circulant takes more iterations than the
    factor does, but next to no set-up.
    """
    samples = system.samples
    if is_nearly_white(means):
        yield from _method_of_nearly_white(system, means)
    by_cg = partial(solve_by_cg, patience=USUAL)
    eigenvalues = samples if is_positive(samples, system.c.dtype) else means
    yield from _circulant_method(system, eigenvalues, by_cg, "cg, circulant")
    yield from _cg_methods(system.A, candidates_of_complex_line(system.A))


def _method_of_nearly_white(system: ToeplitzSystem, means: Array) -> Iterator[Method]:
    """Yield CG for eigenvalues that are alike, but for a few.

    Without those few single precision is enough for a third of all digits, and its transforms take
    half the time; then the circulant saves some iterations too.
    """
    form = system.fourier_form
    by_cg = partial(solve_by_cg, patience=PATIENT)
    if form is None or float(means.max()) > ALIKE * float(means.min()):
        yield Method("cg", partial(by_cg, system.A, None))
    else:
        single = form.in_single_precision()
        M = form.inverse(means).in_single_precision()
        solve = partial(solve_in_cycles, form.A, partial(by_cg, single.A, M))
        yield Method("cg in single precision, circulant", form.within(solve))


def _methods_of_indefinite(system: ToeplitzSystem) -> Iterator[Method]:
    """Yield what may solve a symmetric system that is not positive definite."""
    is_fast = len(system.c) >= GENERAL or system.fourier_form is not None
    if is_fast and not recursion_is_faster_than_gmres(len(system.c), system.columns):
        yield from _gmres_circulant(system, "gmres, circulant of both signs")
    yield from _dense_methods(system)


def _dense_methods(system: ToeplitzSystem) -> Iterator[Method]:
    """Yield what needs no more of A than that it is a Toeplitz matrix."""
    n, columns = len(system.c), system.columns
    is_corrected = n <= SHORT or system.c.dtype.kind == "c" or system.is_symmetric
    if trench_is_faster_than_levinson(n, columns, is_corrected):
        yield Method("trench", _recur(system, system.c))
    elif not lu_is_faster_than_levinson(n, columns):
        # A correction takes a second recursion.
        yield from _levinson_method(system, 0.0 if is_corrected else UNSTABLE)
    # A recursion fails where a leading block is singular, or nearly so.
    if n <= LARGEST_DENSE:
        yield Method("scipy.linalg.lu_solve", _factorise(system))
    else:
        # No leading block of A + ε I is as singular as one of A may be; and ε is small beside the
        # singular values of A itself, so that corrections of the residual converge.
        c = system.c.copy()
        c[0] += SHIFT * norm(system.lags)
        yield Method("trench of A + ε I", _recur(system, c))


def _levinson_method(system: ToeplitzSystem, accepted: float = 0.0) -> Iterator[Method]:
    yield Method(LEVINSON, lambda B, rtol: (levinson(system.lags, B), 1), accepted)


def may_be_definite(eigenvalues: Array) -> bool:
    """Whether the eigenvalues of T. Chan's circulant do not tell that a matrix is indefinite.

    They are Rayleigh quotients of it.
    """
    return bool(eigenvalues.min() > -rounding(eigenvalues, eigenvalues.dtype))


def _cosine_method(system: ToeplitzSystem) -> Iterator[Method]:
    """Yield CG in the DCT domain, where its preconditioner is positive definite."""
    with suppress(np.linalg.LinAlgError):
        solver = CosineSolver(system.cosine_form, system.size)
        yield Method("cg in the DCT domain", solver.solve)


def _cg_methods(A: ToeplitzOperator, candidates: Iterator[Candidate]) -> Iterator[Method]:
    """Yield CG with these preconditioners."""
    for candidate in candidates:
        with suppress(np.linalg.LinAlgError):  # Its eigenvalues may not be positive.
            M = candidate.make(A)
            yield Method(f"cg, {candidate.name}", partial(solve_by_cg, A, M))


def _circulant_method(
    system: ToeplitzSystem, eigenvalues: Array, solve: Any, name: str
) -> Iterator[Method]:
    """Yield an iteration with a circulant, in the Fourier domain where products are fast there."""
    with suppress(np.linalg.LinAlgError):  # An eigenvalue may be zero.
        form = system.fourier_form
        if form is None:
            M = smooth_inverse(system.A, eigenvalues)
            yield Method(name, partial(solve, system.A, M))
        else:
            yield Method(name, form.within(partial(solve, form.A, form.inverse(eigenvalues))))


def _gmres_circulant(system: ToeplitzSystem, name: str) -> Iterator[Method]:
    """Yield GMRES with a circulant, which may be indefinite, but for samples that are zero."""
    eigenvalues = away_from_zero(system.samples, system.c.dtype)
    yield from _circulant_method(system, eigenvalues, solve_by_gmres, name)


def _gmres_spectral(A: ToeplitzOperator) -> Iterator[Method]:
    """Yield GMRES with the factors of the symbol, if it has such."""
    with suppress(np.linalg.LinAlgError):
        M = spectral_preconditioner(A)
        yield Method("gmres, spectral_preconditioner", partial(solve_by_gmres, A, M))


def _inverse_method(A: ToeplitzOperator) -> Iterator[Method]:
    try:
        G = first_columns(A).inverse
    except np.linalg.LinAlgError:  # A is not positive definite.
        return
    yield Method("toeplitz_inverse", lambda B, rtol: (G.apply(B), 1))


def _recur(system: ToeplitzSystem, c: Array) -> Callable[[Rows, float], tuple[Rows, int]]:
    """Return the solutions by Trench's recursion for this first column, made for the first."""

    @cache
    def inverse() -> GohbergSemencul:
        r = c if system.is_symmetric else system.r
        return GohbergSemencul(*column_and_row_of_inverse(c, r))

    return lambda B, rtol: (inverse().apply(B), 1)


def _factorise(system: ToeplitzSystem) -> Callable[[Rows, float], tuple[Rows, int]]:
    """Return the solutions by a dense factor, which is made for the first of them."""

    @cache
    def factor() -> tuple[Array, Array]:
        getrf = get_lapack_funcs("getrf", dtype=system.c.dtype)
        lu, pivots, info = getrf(toeplitz(system.c, system.r), overwrite_a=True)
        if info > 0:
            raise np.linalg.LinAlgError("A is singular")
        return lu, pivots

    def solve(B: Rows, rtol: float) -> tuple[Rows, int]:
        return lu_solve(factor(), B.T, check_finite=False).T, 1

    return solve
