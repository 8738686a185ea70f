"""Which method solves a Toeplitz system, and why: a table, read from top to bottom.

The first row that fits a system, and whose set-up is not refused, solves it. The next one is tried
only if the residual of that solution is too large (see `refinement`).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache, partial
from math import inf
from typing import Any

import numpy as np
from scipy.linalg import get_lapack_funcs
from scipy.linalg.lapack import dpttrf, dpttrs
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array, Rows
from toeplitz_mg.columns.columns import EPS
from toeplitz_mg.columns.gohberg_semencul import GohbergSemencul
from toeplitz_mg.engine.vectors import norm
from toeplitz_mg.operators.positivity import is_positive
from toeplitz_mg.preconditioners.circulant import (
    away_from_zero,
    chan_eigenvalues,
    smooth_inverse,
)
from toeplitz_mg.preconditioners.spectral import spectral_preconditioner
from toeplitz_mg.solvers.cg import Descent
from toeplitz_mg.solvers.checks import by_recurrence
from toeplitz_mg.solvers.gmres import Space
from toeplitz_mg.solvers.inverse import first_columns
from toeplitz_mg.solvers.toeplitz.cosine_cg import CosineSolver
from toeplitz_mg.solvers.toeplitz.levinson import column_and_row_of_inverse, levinson
from toeplitz_mg.solvers.toeplitz.sizes import (
    CORRECTED,
    COSINE_LIMIT,
    FEW,
    FEW_DIAGONALS,
    GENERAL,
    ITERATION,
    LARGEST_BAND,
    LARGEST_DENSE,
    LARGEST_RECURSIVE,
    RECURSIVE,
    SHORT,
)
from toeplitz_mg.solvers.toeplitz.system import ToeplitzSystem

Solve = Callable[[Rows, float], tuple[Rows, int]]  # ``solve(B, rtol)``: solutions and iterations.

ACCEPTED = 1e4 * EPS  # Largest backward error of a solution if no other method is better: 2e-12.
# Shift of the diagonal relative to the 2-norm of all coefficients. For skew-symmetric matrices and
# for odd lags alone, GMRES takes 5 to 16 iterations with it, and 8 to 45 with ten times the shift.
# With a tenth of it, Trench's recursion loses more digits than some of them can spare.
SHIFT = 1e-4
# ‖b - A x‖/‖b‖ at which rounding may have stopped GMRES; a solution above it is always corrected.
ROUGH = 1e-6


@dataclass(frozen=True)
class Patience:
    """The number of iterations after which the next method is likely to be faster."""

    most: int
    expected: Mapping[int, float]  # ‖b - A x‖/‖b‖ to be reached after so many iterations.


OF_CG = Patience(60, {10: 1e-2, 20: 1e-5})
# GMRES converges faster and faster. These vectors take 240 MiB for 2^20 real unknowns.
OF_GMRES = Patience(30, {8: 0.5, 15: 1e-2, 20: 1e-5})
AT_LAST = Patience(100, {})  # The only alternative takes n³ steps, or there is none.


@dataclass(frozen=True, repr=False)
class Method:
    """A row of the table.

    Attributes
    ----------
    name : str
    why : str
        Why it is used for the systems that it fits.
    fits : callable
        ``fits(system)`` tells whether it is worth trying.
    make : callable
        ``make(system)`` returns a solver, or raises a LinAlgError if it is refused.
    is_substitution : bool
        Whether the rows of the system are solved one after the other. The residual of each row is
        then a rounding error of its own terms, however large x is.
    """

    name: str
    why: str
    fits: Callable[[ToeplitzSystem], bool] = field(compare=False)
    make: Callable[[ToeplitzSystem], Solve] = field(compare=False)
    is_substitution: bool = False

    def __repr__(self) -> str:
        return f"{self.name}: {self.why}"


# Which systems the rows fit ---------------------------------------------------------------------


def is_triangle(s: ToeplitzSystem) -> bool:
    """Whether all diagonals lie on one side of the main one."""
    return min(s.widths) == 0 and (1 + max(s.widths)) * s.n <= LARGEST_BAND


def has_many_columns(s: ToeplitzSystem) -> bool:
    """Whether LU is faster than a recursion: its set-up takes n³ steps, but a column only few."""
    return s.n < RECURSIVE and s.columns >= 4 + s.n // 32


def is_for_cosines(s: ToeplitzSystem) -> bool:
    """Whether CG in the DCT domain is faster than an inverse and than Levinson's recursion.

    That takes n² steps per column. CG takes the time of three columns of `SHORT` numbers for its
    calls, plus a time proportional to the numbers.
    """
    size = s.n / SHORT
    is_few = s.columns <= FEW or s.columns**2 * s.n <= COSINE_LIMIT
    is_long = s.columns * size**2 > (3.0 + s.columns * size) / 4.0
    return s.may_be_definite and is_few and is_long


def is_for_cg(s: ToeplitzSystem) -> bool:
    """Whether a complex matrix may be positive definite, and is not small."""
    return s.is_complex and s.n > SHORT and s.columns <= FEW and s.has_positive_means


def is_for_inverse(s: ToeplitzSystem) -> bool:
    """Whether many columns are worth the set-up of the inverse, or no other method is left."""
    if s.is_hermitian:
        return s.columns * s.n**2 > RECURSIVE**2 and s.has_positive_means
    return s.n >= GENERAL and s.columns > FEW and s.has_symbol


def is_for_gmres(s: ToeplitzSystem) -> bool:
    """Whether GMRES with circulants is faster than Trench's recursion."""
    if s.n < (RECURSIVE if s.is_symmetric else GENERAL):
        return False
    return s.wraps_around or (s.n >= ITERATION * s.columns and s.has_symbol)


def is_for_levinson(s: ToeplitzSystem) -> bool:
    """Whether Levinson's recursion is faster, or loses fewer digits than other methods.

    If A is definite it loses no more digits than they do.
    """
    if has_many_columns(s):
        return False
    is_last = s.n <= LARGEST_RECURSIVE and s.columns <= FEW
    return levinson_is_faster_than_trench(s) or (is_last and s.has_positive_means)


def levinson_is_faster_than_trench(s: ToeplitzSystem) -> bool:
    """Whether one recursion per column is faster than Trench's recursion for all."""
    return s.n < (RECURSIVE if s.is_complex or s.columns > 1 else GENERAL)


def is_for_trench(s: ToeplitzSystem) -> bool:
    """Whether Trench's recursion is faster, and n² steps are not too many."""
    is_slow = s.n > LARGEST_RECURSIVE and s.has_symbol
    return not levinson_is_faster_than_trench(s) and not is_slow


# What the rows make -----------------------------------------------------------------------------


def _substitute(s: ToeplitzSystem) -> Solve:
    below, above = s.widths
    column = (s.r if above else s.c)[: 1 + max(below, above)].copy()
    column[0] = s.c[0]  # r[0] may have any value.
    band = np.repeat(column[:, None], s.n, axis=1)
    (solve,) = get_lapack_funcs(("tbtrs",), dtype=s.c.dtype)
    turn = -1 if above else 1  # With reversed unknowns an upper triangle becomes a lower one.

    def substitute(B: Rows, rtol: float) -> tuple[Rows, int]:
        X, info = solve(band, B[..., ::turn].T, uplo="L")
        if info > 0:
            raise np.linalg.LinAlgError("the diagonal is zero")
        return X.T.reshape(B.shape)[..., ::turn], 1

    return substitute


def _factor_band(s: ToeplitzSystem) -> Solve:
    if s.is_hermitian and s.c[0].real > 0.0:
        band = s.c[: 1 + s.widths[0]]
        solve = _factor_definite_tridiagonal(s) if len(band) == 2 else None
        if solve is None:
            pbtrf, pbtrs = get_lapack_funcs(("pbtrf", "pbtrs"), dtype=band.dtype)
            factor, info = pbtrf(np.tile(band, (s.n, 1)).T, lower=True, overwrite_ab=True)
            solve = None if info else lambda B: pbtrs(factor, B, lower=True)[0]
        if solve is not None:
            return lambda B, rtol: (solve(B.T).T.reshape(B.shape), 1)
    below, above = s.widths
    gbtrf, gbtrs = get_lapack_funcs(("gbtrf", "gbtrs"), dtype=s.c.dtype)
    diagonals = np.zeros((s.n, 2 * below + above + 1), s.c.dtype)
    diagonals[:, below:] = s.band
    lu, pivots, info = gbtrf(diagonals.T, below, above, overwrite_ab=True)
    if info:
        raise np.linalg.LinAlgError("the band is singular")
    return lambda B, rtol: (gbtrs(lu, below, above, B.T, pivots)[0].T.reshape(B.shape), 1)


def _factor_definite_tridiagonal(s: ToeplitzSystem) -> Callable[[Array], Array] | None:
    """Return a solver for columns, or None if the matrix is not real or not definite."""
    if s.is_complex:
        return None
    d, e, info = dpttrf(np.full(s.n, s.c[0]), np.full(s.n - 1, s.c[1]), True, True)
    return None if info else lambda B: dpttrs(d, e, B)[0]


def _factor_dense(s: ToeplitzSystem) -> Solve:
    getrf, getrs = _lapack(s.c.dtype.char)
    # Factorise the transpose, because LAPACK's columns are the rows of the filled matrix.
    lu, pivots, info = getrf(s.fill().T, overwrite_a=True)
    if info > 0:
        raise np.linalg.LinAlgError("A is singular")
    return lambda B, rtol: (getrs(lu, pivots, B.T, trans=1)[0].T, 1)


@cache
def _lapack(dtype: str) -> Any:
    return get_lapack_funcs(("getrf", "getrs"), dtype=dtype)


def _recur(s: ToeplitzSystem) -> Solve:
    return lambda B, rtol: (levinson(s.lags, B), 1)


def _invert(s: ToeplitzSystem) -> Solve:
    G = first_columns(s.A).inverse
    return lambda B, rtol: (G.apply(B), 1)


def _invert_by_recursion(s: ToeplitzSystem) -> Solve:
    G = _trench(s, s.c)
    return lambda B, rtol: (G.apply(B), 1)


def _iterate_shifted(s: ToeplitzSystem) -> Solve:
    """Return GMRES with the inverse of A plus a small shift.

    A leading block of A + ε I is less singular than one of A may be. GMRES has to resolve only the
    few eigenvalues of A that are not large compared to ε.
    """
    c = s.c.copy()
    c[0] += SHIFT * norm(s.lags)
    return partial(_gmres, s.A, _trench(s, c), AT_LAST)


def _trench(s: ToeplitzSystem, c: Array) -> GohbergSemencul:
    return GohbergSemencul(*column_and_row_of_inverse(c, c if s.is_symmetric else s.r))


def _cg_with_circulant(s: ToeplitzSystem) -> Solve:
    eigenvalues = s.samples if is_positive(s.samples, s.c.dtype) else s.means
    return _with_circulant(s, partial(_cg, patience=OF_CG), eigenvalues)


def _gmres_with_circulant(s: ToeplitzSystem) -> Solve:
    # A near-circulant is inverted with its own samples.
    eigenvalues = s.samples if s.wraps_around else away_from_zero(s.samples, s.c.dtype)
    # For one column GMRES is not abandoned for Trench's recursion, which would waste its
    # iterations.
    most = s.n if s.columns == 1 else max(1, s.n // (ITERATION * s.columns))
    patience = Patience(min(OF_GMRES.most, most), OF_GMRES.expected)
    return _with_circulant(s, partial(_gmres, patience=patience), eigenvalues)


def _gmres_with_chan(s: ToeplitzSystem) -> Solve:
    eigenvalues = away_from_zero(chan_eigenvalues(s.A), s.c.dtype)
    return _with_circulant(s, partial(_gmres, patience=AT_LAST), eigenvalues)


def _with_circulant(s: ToeplitzSystem, solve: Any, eigenvalues: Array | None) -> Solve:
    """Return an iteration, in the Fourier domain if products are fast there.

    Its preconditioner is the inverse of the circulant with these eigenvalues, or none.
    """
    form = s.fourier_form
    M: LinearOperator | None = None
    if form is None:
        if eigenvalues is not None:
            M = smooth_inverse(s.A, eigenvalues)
        return lambda B, rtol: solve(s.A, M, B=B, rtol=rtol)
    if eigenvalues is not None:
        M = form.inverse(eigenvalues)

    def solve_within(B: Rows, rtol: float) -> tuple[Rows, int]:
        X, iterations = solve(form.A, M, B=form.transform(B), rtol=rtol)
        return form.transform_back(X), iterations

    return solve_within


def _iterate(
    name: str,
    iteration: Any,
    useful: float,
    A: LinearOperator,
    M: LinearOperator | None,
    patience: Patience,
    B: Rows,
    rtol: float,
) -> tuple[Rows, int]:
    """Solve for each row of B, and return the largest number of iterations.

    Raises
    ------
    LinAlgError
        If it converges too slowly, to a relative residual above `useful`.
    """
    X, most = np.empty_like(B), 0
    for x, b in zip(np.atleast_2d(X), np.atleast_2d(B), strict=True):
        norms: list[float] = []

        def is_slow(norms: list[float] = norms) -> bool:
            return norms[-1] > norms[0] * patience.expected.get(len(norms) - 1, inf)

        x[:], iterations, converged = by_recurrence(
            iteration, A, b, M=M, rtol=rtol, maxiter=patience.most, residuals=norms, watch=is_slow
        )
        if not (converged or norms[-1] <= useful * norms[0]):
            raise np.linalg.LinAlgError(
                f"{name} has reached {norms[-1] / norms[0]:.1e} ‖b‖ in {iterations} iterations"
            )
        most = max(most, iterations)
    return X, most


_cg = partial(_iterate, "cg", Descent, 0.0)
_gmres = partial(_iterate, "gmres", Space, ROUGH)


# The table --------------------------------------------------------------------------------------

RECURSION = Method(
    "scipy.linalg.solve_toeplitz",
    "few unknowns: n² compiled steps for each column",
    is_for_levinson,
    _recur,
)
METHODS = (
    Method(
        "substitution",
        "a triangle of few diagonals: one unknown after the other",
        lambda s: max(s.widths) < 2 * FEW_DIAGONALS and is_triangle(s),
        _substitute,
        is_substitution=True,
    ),
    Method(
        "banded",
        "few diagonals: LAPACK takes O(n) steps",
        lambda s: s.n > SHORT and sum(s.widths) <= min(FEW_DIAGONALS, LARGEST_BAND // s.n),
        _factor_band,
    ),
    Method(
        "lu",
        "many columns of few unknowns: n³/3 steps",
        lambda s: (s.n <= CORRECTED or not s.may_be_definite) and has_many_columns(s),
        _factor_dense,
    ),
    Method(
        "cg in the DCT domain",
        "symmetric, and the diagonal is largest: a definite matrix takes few iterations there",
        is_for_cosines,
        lambda s: CosineSolver(s.cosine_form, s.size).solve,
    ),
    Method(
        "cg",
        "Hermitian, with equal eigenvalues except a few, which CG resolves",
        lambda s: is_for_cg(s) and s.has_flat_means,
        lambda s: _with_circulant(s, partial(_cg, patience=OF_CG), None),
    ),
    Method(
        "cg, circulant",
        "Hermitian, and T. Chan's circulant is positive definite",
        is_for_cg,
        _cg_with_circulant,
    ),
    Method(
        "cg, spectral_preconditioner",
        "Hermitian, and may be definite: factors of the symbol, or the exact column of the inverse",
        lambda s: s.is_hermitian and s.columns <= FEW and is_for_inverse(s),
        lambda s: partial(_cg, s.A, spectral_preconditioner(s.A), OF_CG),
    ),
    Method(
        "toeplitz_inverse",
        "a set-up of O(n log² n), after which each column takes four transforms",
        is_for_inverse,
        _invert,
    ),
    Method(
        "gmres, circulant",
        "a symbol that n samples resolve, or nearly a circulant",
        is_for_gmres,
        _gmres_with_circulant,
    ),
    Method(
        "gmres, spectral_preconditioner",
        "a symbol that n samples resolve, and that has factors",
        lambda s: not s.is_hermitian and is_for_gmres(s),
        lambda s: partial(_gmres, s.A, spectral_preconditioner(s.A), OF_GMRES),
    ),
    RECURSION,
    Method(
        "trench",
        "no symbol: n² steps for all columns and corrections",
        is_for_trench,
        _invert_by_recursion,
    ),
    Method(
        "gmres, trench of A + ε I",
        "a leading block is singular, or nearly so",
        lambda s: RECURSIVE <= s.n <= LARGEST_RECURSIVE,
        _iterate_shifted,
    ),
    Method(
        "gmres, T. Chan's circulant",
        "at last, for many unknowns",
        lambda s: s.n >= RECURSIVE,
        _gmres_with_chan,
    ),
    Method("lu", "at last: n³/3 steps", lambda s: s.n <= LARGEST_DENSE, _factor_dense),
    Method(
        "substitution",
        "at last, a triangle of many diagonals",
        is_triangle,
        _substitute,
        is_substitution=True,
    ),
)
