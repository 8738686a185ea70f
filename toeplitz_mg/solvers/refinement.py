"""A solution by the method that is chosen, and the residual that corrects it or refuses it."""

from math import inf
from typing import NamedTuple

import numpy as np

from toeplitz_mg._typing import Rows
from toeplitz_mg.engine.vectors import norm
from toeplitz_mg.solvers.choice import Method, methods
from toeplitz_mg.solvers.system import EPS, ToeplitzSystem, largest, norms

RTOL = 1e-12  # Relative residual that is to be reached, if none is asked for.
ROUNDING = 16 * EPS  # Backward error at which no correction can be expected to help.
ACCEPTED = 1e4 * EPS  # Largest backward error of an answer without a warning.
GOOD = 64 * EPS  # Backward error at which no other method is tried.
SINGULAR = 0.1  # Relative residual above which there is no answer in float64.
ILL_CONDITIONED = 1e-8  # Relative residual above which the user is warned.
ROUGH = 1e-6  # Relative residual above which a solution is corrected, whatever it takes.
CORRECTION = 1e-2  # Relative residual to which a correction is solved for.


class SolveInfo(NamedTuple):
    """How `solve_toeplitz` has solved a system.

    Attributes
    ----------
    method : str
    iterations : int
        Iterations, the most of all columns; or solves by a direct method.
    residual : float
        The largest ‖b - A x‖/‖b‖ of all columns, as measured. Where ‖x‖ is so large that rounding
        of A x alone may be more than 1e-8 ‖b‖, it is at least ε ‖a‖₂ ‖x‖/‖b‖, with a the 2n - 1
        coefficients: that is the size of such rounding, and what is measured may be less by chance.
    backward_error : float
        The largest ‖b - A x‖/(‖a‖₁ ‖x‖ + ‖b‖) of all columns, in 2-norms. ‖a‖₁, the sum of the
        absolute values of all coefficients, is an upper bound of ‖A‖₂: x solves a system that
        differs from this one by so much in proportion to ‖a‖₁ and ‖b‖. In proportion to ‖A‖₂
        itself it may be more, by up to ‖a‖₁/‖A‖₂.

    See Also
    --------
    solve_toeplitz : returns it with ``full_output=True``.
    """

    method: str
    iterations: int
    residual: float
    backward_error: float


def solve_system(system: ToeplitzSystem, rtol: float | None) -> tuple[Rows, SolveInfo]:
    """Solve by the first method whose solutions, corrected, have small residuals."""
    best: tuple[Rows, SolveInfo] | None = None
    tried = ""
    for method in methods(system):
        try:
            X, info, is_good = _correct(method, system, rtol)
        except np.linalg.LinAlgError as error:
            tried += f"; {method.name} fails: {error}"
            continue
        if is_good:
            return X, info
        if best is None or info.backward_error < best[1].backward_error:
            best = X, info
        tried += (
            f"; by {method.name} ‖b - A x‖ is {info.residual:.1e} ‖b‖ and the backward error "
            f"{info.backward_error:.1e}"
        )
    if best and best[1].backward_error <= ACCEPTED and best[1].residual <= SINGULAR:
        return best
    raise np.linalg.LinAlgError("A is singular, exactly or numerically" + tried)


def _correct(
    method: Method, system: ToeplitzSystem, rtol: float | None
) -> tuple[Rows, SolveInfo, bool]:
    """Solve, and correct the solution by that of its residual while this helps.

    Returns
    -------
    X : ndarray
    info : SolveInfo
    is_good : bool
        Whether no other method need be tried.
    """
    sizes = system.sizes
    goal, accepted = (RTOL, method.accepted) if rtol is None else (rtol, 0.0)
    X, iterations = method.solve(system.B, 0.9 * goal)  # The recurrence of CG may drift.
    best, info, least = X, SolveInfo(method.name, iterations, inf, inf), inf
    while True:
        R = system.B - system.multiply(X)
        errors, scales = norms(R), system.size * norms(X)
        residual, backward_error = largest(errors / sizes), largest(errors / (scales + sizes))
        noise = largest(EPS * scales / sizes)  # Rounding of the residual itself, at most.
        if noise > 1.0:
            raise np.linalg.LinAlgError("x is so large that its residual is rounding")
        if noise > ILL_CONDITIONED:
            # The errors of the terms of a sum add up as their squares do.
            residual = max(residual, noise * norm(system.lags) / system.size)
        if not backward_error < least / 2:
            break
        best, least = X, backward_error
        info = SolveInfo(method.name, iterations, residual, backward_error)
        if residual <= goal or (backward_error <= accepted and residual <= ROUGH):
            return best, info, True
        # Each column is as good as can be, by one error or by the other.
        if np.all(errors <= np.maximum(goal * sizes, ROUNDING * scales)):
            break
        correction, steps = method.solve(R, CORRECTION)
        X = X + correction
        iterations += steps
    return best, info, info.backward_error <= GOOD and info.residual <= SINGULAR
