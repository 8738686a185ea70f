"""Solve by the chosen method; the residual corrects the solution or refuses it."""

from math import inf, sqrt
from typing import NamedTuple

import numpy as np

from toeplitz_mg._typing import Array, Rows
from toeplitz_mg.columns.columns import EPS
from toeplitz_mg.engine.vectors import norm
from toeplitz_mg.solvers.toeplitz.methods import ACCEPTED, METHODS, RECURSION, ROUGH, Method, Solve
from toeplitz_mg.solvers.toeplitz.sizes import CORRECTED, GENERAL, LARGEST_DENSE, SHORT
from toeplitz_mg.solvers.toeplitz.system import ToeplitzSystem

RTOL = 1e-12  # Default tolerance for the relative residual.
ROUNDING = 16 * EPS  # Backward error below which corrections do not help.
GOOD = 64 * EPS  # Backward error below which no other method is tried.
# Largest relative residual of a solution, and largest ε √n ‖a‖₁ ‖x‖/‖b‖ if that is not small.
SINGULAR = 0.1
ILL_CONDITIONED = 1e-8  # Relative residual above which the user is warned.
UNEVEN = 0.01  # Terms below this share of ‖a‖₁ ‖x‖ bound the rounding more closely.
CORRECTION = 1e-2  # Relative residual to which a correction is solved.
MOST = 4  # Most corrections before another method is tried; each takes as long as the solution.


class SolveInfo(NamedTuple):
    """Method and accuracy of a solution by `solve_toeplitz`; for a batch, fields are arrays.

    Attributes
    ----------
    method : str
    iterations : int
        Number of iterations, or of solves by a direct method; the maximum over all columns.
    residual : float
        ‖b - A x‖/‖b‖ as measured, the maximum over all columns. It is at least ε ‖a‖₂ ‖x‖/‖b‖
        (twice that for more than 512 unknowns), where a are the 2n - 1 coefficients: this is the
        rounding error of A x, below which a measured residual may fall by chance.
    backward_error : float
        ‖b - A x‖/(‖a‖₁ ‖x‖ + ‖b‖) in 2-norms, the maximum over all columns. ‖a‖₁, the sum of the
        absolute values of all coefficients, is an upper bound of ‖A‖₂: x is the exact solution of a
        system with changes of this size relative to ‖a‖₁ and ‖b‖.

    See Also
    --------
    solve_toeplitz : returns it with ``full_output=True``.
    """

    method: str
    iterations: int
    residual: float
    backward_error: float


class Found(NamedTuple):
    """The `SolveInfo` of a system, and whether a warning is needed that x may have few digits."""

    info: SolveInfo
    is_doubtful: bool = False


class Attempt(NamedTuple):
    """The result of one method.

    Attributes
    ----------
    X : ndarray
    found : Found
    is_good : bool
        Whether no other method need be tried, because the errors are as small as rounding allows.
    is_answer : bool
        Whether it may be returned if no method is better: it solves a system that differs little
        from this one, and ‖x‖ does not show a singular matrix.
    """

    X: Rows
    found: Found
    is_good: bool
    is_answer: bool


def solve_system(system: ToeplitzSystem, rtol: float | None) -> tuple[Rows, Found]:
    """Return the first good solution (after corrections) of the methods, or the best of all."""
    best: Attempt | None = None
    tried, names, is_solved = "", set[str](), False
    for method in METHODS:
        if method.name in names or (is_solved and method.name != "lu") or not method.fits(system):
            continue
        names.add(method.name)
        try:
            attempt = solve_and_correct(method, system, rtol)
        except np.linalg.LinAlgError as refused:
            tried += f"; {method.name} fails: {refused}"
            continue
        info, is_doubtful = attempt.found
        if attempt.is_answer and (best is None or info.residual < best.found.info.residual):
            best = attempt
        is_solved |= attempt.is_good
        # LU may reduce the residual: try it for a small matrix, or for a large residual.
        is_for_lu = system.n <= SHORT or (system.n < GENERAL and info.residual > ROUGH)
        if attempt.is_good and not (is_doubtful and is_for_lu):
            break
        tried += (
            f"; by {method.name} ‖b - A x‖ is {info.residual:.1e} ‖b‖ and the backward error "
            f"{info.backward_error:.1e}"
        )
    if best is not None:
        return best.X, best.found
    reason = "A is singular, exactly or numerically, or x is beyond the largest number"
    if system.n > LARGEST_DENSE:
        reason += f", or none of the methods for more than {LARGEST_DENSE} unknowns solves it"
    remedy = ": use toeplitz_lstsq((c, r), b, damp) for a least-squares solution"
    raise np.linalg.LinAlgError(reason + remedy + tried)


def solve_and_correct(method: Method, system: ToeplitzSystem, rtol: float | None) -> Attempt:
    """Solve by a method, and correct the solution by its residual while that helps.

    Raises
    ------
    numpy.linalg.LinAlgError
        If the method is refused, or x is so large that its residual is meaningless.
    """
    solve, sizes = method.make(system), system.sizes
    goal = RTOL if rtol is None else rtol
    X, iterations = solve(system.B, 0.9 * goal)  # The recurrence of CG may drift.
    best, info, least = X, SolveInfo(method.name, iterations, inf, inf), inf
    is_done = False
    least_noise = reached = inf
    for left in reversed(range(1 + MOST)):
        R = system.B - system.multiply(X)
        errors, terms = system.measure(R), system.size * system.measure(X)
        residual, error = _largest(errors / sizes), _largest(errors / (terms + sizes))
        backward_error = error
        noise = _largest(EPS * terms / sizes)  # A bound of the rounding of the residual itself.
        if residual > goal or 2.0 * noise > ILL_CONDITIONED:
            R, errors, smaller = _measure_directly(system, X, R, errors, terms)
            if smaller is not terms:
                residual, error = _largest(errors / sizes), _largest(errors / (smaller + sizes))
                backward_error, terms = _largest(errors / (terms + sizes)), smaller
                noise = _largest(EPS * terms / sizes)
            if noise > 1.0 and not method.is_substitution:
                if info.residual < inf:
                    break
                raise np.linalg.LinAlgError("x is so large that its residual is only rounding")
        rounding = _largest(system.rounding_of(terms) / sizes)
        if noise > ILL_CONDITIONED:
            residual = max(residual, rounding)
        if not residual < inf:
            error = inf  # After an overflow nothing is known about x.
        if not (error < least / 2 and residual <= reached):
            break  # Discard a correction that has increased the residual.
        best, least, least_noise, reached = X, error, noise, residual
        info = SolveInfo(method.name, iterations, max(residual, rounding), backward_error)
        if is_done := _is_enough(method, system, residual, error, rtol):
            break
        # Stop if each column is as good as possible, by one error or by the other.
        if not (left and _largest((errors > goal * sizes) & (errors > ROUNDING * terms))):
            break
        correction, steps = solve(R, CORRECTION)
        X = X + correction
        iterations += steps
    is_doubtful = info.residual > max(ILL_CONDITIONED, goal)
    if is_doubtful and method.is_substitution:
        # Rounding in each row may change x little, however large x is.
        is_doubtful = _changes(system, solve, best) > ILL_CONDITIONED
    found = Found(info, is_doubtful)
    if is_done or method.is_substitution:
        return Attempt(best, found, is_done or least <= GOOD, is_done or least <= ACCEPTED)
    is_large = info.residual > ILL_CONDITIONED
    is_singular = is_large and sqrt(system.n) * least_noise > SINGULAR
    may_be_answer = info.residual <= SINGULAR and not is_singular
    is_near = least <= ACCEPTED or not is_large
    return Attempt(best, found, may_be_answer and least <= GOOD, may_be_answer and is_near)


def _changes(system: ToeplitzSystem, solve: Solve, X: Rows) -> float:
    """Return how much rounding in each row of a triangular system changes x, relative to ‖x‖.

    The rounding error of row i in a substitution is relative to the size of its terms, (|A| |x|)ᵢ.
    The signs are chosen such that all errors add up in the last unknown, as in Skeel's condition
    number ‖|A⁻¹| |A| |x|‖/‖x‖.
    """
    n, above = system.n, system.widths[1]
    unit = np.zeros(n, system.c.dtype)
    unit[n - 1 if above else 0] = 1.0
    signs = np.sign(solve(unit, RTOL)[0][::-1].conj())
    changes = []
    for x in np.atleast_2d(X):
        terms = np.convolve(np.abs(x), np.abs(system.band))[above : above + n]
        change, _ = solve(EPS * signs * terms, RTOL)
        changes.append(norm(change) / norm(x) if x.any() else 0.0)
    return _largest(np.array(changes))


def _is_enough(
    method: Method, system: ToeplitzSystem, residual: float, error: float, rtol: float | None
) -> bool:
    """Whether a solution with this residual and backward error needs no correction.

    Without `rtol` the result of Levinson's recursion is not corrected if its backward error is
    small, because a correction takes another recursion; that is cheaper for a small system.
    """
    if residual <= (RTOL if rtol is None else rtol):
        return True
    is_small = system.n <= CORRECTED
    if rtol is not None or method is not RECURSION or (is_small and system.may_be_definite):
        return False
    return error <= ACCEPTED and residual <= (ILL_CONDITIONED if is_small else ROUGH)


def _largest(values: Array | float) -> float:
    """Return the largest number, NaN if one is; for booleans, whether one is True."""
    return float(values.max()) if isinstance(values, np.ndarray) else values


def _measure_directly(
    system: ToeplitzSystem, X: Rows, R: Rows, errors: Array | float, terms: Array | float
) -> tuple[Rows, Array | float, Array | float]:
    """Return residuals, their norms, and the sizes of the terms that rounding is relative to.

    If the largest coefficients meet only the smallest unknowns, the residuals R by transforms are
    too inaccurate, and the given bound of the terms is too large.
    """
    if system.n > LARGEST_DENSE:
        return R, errors, terms
    with np.errstate(all="ignore"):  # The residual shows overflow and underflow.
        smaller = system.sizes_of_terms(X)
        if not _largest(smaller < UNEVEN * terms):
            return R, errors, terms
        R = system.B - system.multiply_directly(X)
        return R, system.measure(R), np.fmin(terms, smaller)
