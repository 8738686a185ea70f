"""Which method solves a Toeplitz system, and why: the choice that `solve_toeplitz` makes."""

from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cache, partial
from itertools import chain
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import get_lapack_funcs

from toeplitz_mg._typing import Array, Rows
from toeplitz_mg.engine.vectors import norm
from toeplitz_mg.operators import ToeplitzOperator
from toeplitz_mg.operators.gohberg_semencul import GohbergSemencul
from toeplitz_mg.preconditioners.choice import candidates_of_complex_line, candidates_of_line
from toeplitz_mg.preconditioners.circulant import (
    away_from_zero,
    chan_eigenvalues,
    smooth_inverse,
)
from toeplitz_mg.preconditioners.positivity import is_positive, may_be_positive
from toeplitz_mg.preconditioners.selection import Candidate
from toeplitz_mg.preconditioners.spectral import spectral_preconditioner
from toeplitz_mg.preconditioners.traits import (
    decays_slowly,
    has_symbol,
    is_flat,
    wraps_around,
)
from toeplitz_mg.solvers.inverse import first_columns
from toeplitz_mg.solvers.toeplitz.attempts import (
    AT_LAST,
    OF_GMRES,
    PATIENT,
    Patience,
    solve_by_cg,
    solve_by_gmres,
    within,
)
from toeplitz_mg.solvers.toeplitz.cosine_cg import CosineSolver
from toeplitz_mg.solvers.toeplitz.crossovers import (
    FEW,
    GENERAL,
    RECURSIVE,
    SHORT,
    cosine_is_faster_than_inverse,
    fsai_is_faster_than_cosine,
    iterations_before_recursion,
    levinson_is_faster_than_inverse,
    levinson_is_fastest,
    lu_is_faster_than_levinson,
    recursion_is_faster_than_gmres,
    trench_is_faster_than_levinson,
)
from toeplitz_mg.solvers.toeplitz.fourier_form import has_fourier_form
from toeplitz_mg.solvers.toeplitz.levinson import column_and_row_of_inverse, levinson
from toeplitz_mg.solvers.toeplitz.system import EPS, ToeplitzSystem

ACCEPTED = 1e4 * EPS  # Backward error of an answer where no other method has a better one: 2e-12.
UNSTABLE = 2e4 * EPS  # Backward error of the recursion that another one need not correct: 4e-12.
# Shift of the diagonal over the 2-norm of all coefficients. Of skew-symmetric matrices, and of odd
# lags alone, GMRES takes 5 to 16 iterations with it, and 8 to 45 with one ten times as large; with
# one ten times less Trench's recursion loses more digits than some of them can spare.
SHIFT = 1e-4
NARROW = 64  # Most diagonals of a triangular matrix that is solved by substitution at once.
LARGEST_BAND = 2**25  # Most numbers of the diagonals of one, of 256 MiB.
LARGEST_DENSE = 4096  # Unknowns of a matrix that LU factorises: of 128 MiB, in n³/3 operations.
CHAN = "gmres, T. Chan's circulant"
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
    is_substitution : bool
        Whether each row of the system is solved in its turn, so that each holds but for rounding of
        its own terms, however large x is.
    """

    name: str
    solve: Callable[[Rows, float], tuple[Rows, int]]
    accepted: float = 0.0
    is_substitution: bool = False


def methods(system: ToeplitzSystem) -> Iterator[Method]:
    """Return what may solve a system, the best choice first.

    The next one is asked for only where one has failed.
    """
    n, columns = len(system.c), system.columns
    if system.is_symmetric:
        if not levinson_is_fastest(n, columns):
            return _methods_of_symmetric(system)
        if n >= RECURSIVE:
            return chain((_levinson_method(system),), _dense_methods(system))
        return _dense_methods(system)
    usual = _methods_of_general(system) if n >= GENERAL else _dense_methods(system)
    if not system.band:
        return usual
    ways = (
        (_substitution(system), usual) if system.band <= NARROW else (usual, _substitution(system))
    )
    return chain(*ways)


def _methods_of_symmetric(system: ToeplitzSystem) -> Iterator[Method]:
    n, columns = len(system.c), system.columns
    is_short = levinson_is_faster_than_inverse(n, columns)
    is_for_cosines = system.may_be_definite and cosine_is_faster_than_inverse(n, columns)
    if is_for_cosines and not (fsai_is_faster_than_cosine(n) and decays_slowly(system.c)):
        yield from _cosine_method(system)
    if is_short and n < RECURSIVE:
        yield from _dense_methods(system)
        return
    # T. Chan's eigenvalues are Rayleigh quotients of A.
    if not (system.may_be_definite and may_be_positive(means := system.means, means.dtype)):
        yield from _methods_of_indefinite(system)
        return
    if is_short:
        # Where A is definite Levinson's recursion loses no digits that another one would have.
        yield _levinson_method(system)
        yield from _dense_methods(system)
        return
    if columns <= FEW:
        yield from _cg_methods(system.A, candidates_of_line(system.A, lambda: system.symbol))
    # The inverse needs no more of the symbol than that A is positive definite.
    yield from _inverse_method(system.A)
    yield from _methods_of_indefinite(system)


def _methods_of_general(system: ToeplitzSystem) -> Iterator[Method]:
    """Yield what may solve a system that is complex, or not symmetric."""
    n, columns = len(system.c), system.columns
    yield from _gmres_circulant_itself(system)
    if system.is_hermitian:
        if may_be_positive(means := system.means, means.dtype):
            if columns <= FEW:
                yield from _methods_of_hermitian(system, means)
            yield from _inverse_method(system.A)
        if not recursion_is_faster_than_gmres(n, columns) and has_symbol(system.samples):
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

    A circulant may take more iterations than the factor does, but next to no set-up.
    """
    by_cg = partial(solve_by_cg, patience=PATIENT)
    if is_flat(means):
        yield Method("cg", partial(by_cg, system.A, None))
    samples = system.samples
    eigenvalues = samples if is_positive(samples, system.c.dtype) else means
    yield from _circulant_method(system, eigenvalues, by_cg, "cg, circulant")
    yield from _cg_methods(system.A, candidates_of_complex_line(system.A))


def _methods_of_indefinite(system: ToeplitzSystem) -> Iterator[Method]:
    """Yield what may solve a symmetric system that is not positive definite."""
    yield from _gmres_circulant_itself(system)
    n = len(system.c)
    is_fast = n >= GENERAL or has_fourier_form(n)
    is_fast = is_fast and not recursion_is_faster_than_gmres(n, system.columns)
    if is_fast and has_symbol(system.samples):
        yield from _gmres_circulant(system, "gmres, circulant of both signs")
    yield from _dense_methods(system)


def _dense_methods(system: ToeplitzSystem) -> Iterator[Method]:
    """Yield what needs no more of A than that it is a Toeplitz matrix.

    A recursion fails where a leading block is singular, or nearly so.
    """
    n, columns = len(system.c), system.columns
    factors_first = n <= LARGEST_DENSE and lu_is_faster_than_levinson(n, columns)
    if trench_is_faster_than_levinson(n, columns, system.c.dtype.kind == "c"):
        yield Method("trench", _recur(system))
    elif not factors_first:
        yield _levinson_method(system, accepted_error(system))
    if n >= RECURSIVE and not factors_first:
        yield Method("gmres, trench of A + ε I", _iterate_shifted(system))
        yield from _gmres_chan(system)
    if n <= LARGEST_DENSE:
        yield Method("lu", _factorise(system))


def accepted_error(system: ToeplitzSystem) -> float:
    """Return the backward error of Levinson's recursion that a second one need not correct.

    A small system is sooner worth a correction.
    """
    if len(system.c) > SHORT:
        return UNSTABLE
    return 0.0 if system.may_be_definite else ACCEPTED


def _substitution(system: ToeplitzSystem) -> Iterator[Method]:
    """Yield the substitution of one unknown after the other, where the matrix is triangular."""
    if not 0 < system.band * len(system.c) <= LARGEST_BAND:
        return
    is_lower = not system.r[1:].any()
    column = (system.c if is_lower else system.r)[: system.band].copy()
    column[0] = system.c[0]  # The first number of r may be anything.
    band = np.repeat(column[:, None], len(system.c), axis=1)
    (solve,) = get_lapack_funcs(("tbtrs",), dtype=system.c.dtype)

    def substitute(B: Rows, rtol: float) -> tuple[Rows, int]:
        B = B if is_lower else B[..., ::-1]  # Of the reversed unknowns it is lower.
        X, info = solve(band, B.T, uplo="L")
        if info > 0:
            raise np.linalg.LinAlgError("the diagonal is zero")
        X = X.T.reshape(B.shape)
        return (X if is_lower else X[..., ::-1]), 1

    yield Method("substitution", substitute, is_substitution=True)


def _levinson_method(system: ToeplitzSystem, accepted: float = 0.0) -> Method:
    def solve(B: Rows, rtol: float) -> tuple[Rows, int]:
        return levinson(system.lags, B), 1

    return Method(LEVINSON, solve, accepted)


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
            yield Method(name, partial(solve, system.A, smooth_inverse(system.A, eigenvalues)))
        else:
            yield Method(name, within(form, partial(solve, form.A, form.inverse(eigenvalues))))


def _gmres_method(
    system: ToeplitzSystem, eigenvalues: Array, name: str, patience: Patience | None = None
) -> Iterator[Method]:
    """Yield GMRES with a circulant, for fewer iterations than a recursion is worth."""
    if patience is None:
        most = iterations_before_recursion(len(system.c), system.columns)
        patience = OF_GMRES._replace(most=min(OF_GMRES.most, most))
    solve = partial(solve_by_gmres, patience=patience)
    yield from _circulant_method(system, eigenvalues, solve, name)


def _gmres_circulant(system: ToeplitzSystem, name: str) -> Iterator[Method]:
    """Yield GMRES with a circulant, which may be indefinite, but for samples that are zero."""
    return _gmres_method(system, away_from_zero(system.samples, system.c.dtype), name)


def _gmres_circulant_itself(system: ToeplitzSystem) -> Iterator[Method]:
    """Yield GMRES with the circulant that A nearly is, whatever its numbers are."""
    if wraps_around(system.c, system.r):
        yield from _gmres_method(system, chan_eigenvalues(system.A), CHAN)


def _gmres_chan(system: ToeplitzSystem) -> Iterator[Method]:
    """Yield GMRES with T. Chan's circulant, where there is no other way for so many unknowns."""
    eigenvalues = away_from_zero(chan_eigenvalues(system.A), system.c.dtype)
    return _gmres_method(system, eigenvalues, CHAN, AT_LAST)


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


def _recur(system: ToeplitzSystem) -> Callable[[Rows, float], tuple[Rows, int]]:
    """Return the solutions by Trench's recursion, which is done for the first of them."""
    inverse = cache(partial(_inverse_by_recursion, system, system.c))
    return lambda B, rtol: (inverse().apply(B), 1)


def _inverse_by_recursion(system: ToeplitzSystem, c: Array) -> GohbergSemencul:
    """Invert the matrix of the system, with this first column."""
    r = c if system.is_symmetric else system.r
    return GohbergSemencul(*column_and_row_of_inverse(c, r))


def _iterate_shifted(system: ToeplitzSystem) -> Callable[[Rows, float], tuple[Rows, int]]:
    """Return the solutions by GMRES, with the inverse of A and a small shift, made for the first.

    No leading block of A + ε I is as singular as one of A may be. Only the few eigenvalues of A
    that are not large beside ε are left to the iteration.
    """

    @cache
    def inverse() -> GohbergSemencul:
        c = system.c.copy()
        c[0] += SHIFT * norm(system.lags)
        return _inverse_by_recursion(system, c)

    return lambda B, rtol: solve_by_gmres(system.A, inverse(), B, rtol, AT_LAST)


def _factorise(system: ToeplitzSystem) -> Callable[[Rows, float], tuple[Rows, int]]:
    """Return the solutions by a dense factor, which is made for the first of them."""
    getrf, getrs = _lapack(system.c.dtype.char)

    @cache
    def factor() -> tuple[Array, Array]:
        # It is that of the transpose, whose columns are the rows of the filled matrix.
        lu, pivots, info = getrf(system.fill().T, overwrite_a=True)
        if info > 0:
            raise np.linalg.LinAlgError("A is singular")
        return lu, pivots

    return lambda B, rtol: (getrs(*factor(), B.T, trans=1)[0].T, 1)


@cache
def _lapack(dtype: str) -> Any:
    return get_lapack_funcs(("getrf", "getrs"), dtype=dtype)
