"""Find the first column and row of the inverse of a Toeplitz matrix, as exactly as asked.

`spectral_preconditioner` and the choice of a preconditioner need them roughly; the inverse and the
log-determinant need them to double precision.
"""

from collections.abc import Callable
from functools import partial

import numpy as np

from toeplitz_mg.columns.columns import NEAR, Columns
from toeplitz_mg.columns.schur import schur_column
from toeplitz_mg.columns.spectral_factor import ADVICE, factor_symbol
from toeplitz_mg.operators import ToeplitzOperator
from toeplitz_mg.operators.lifting import squeeze_line

RESOLVED = 0.25  # A residual ‖A x - e₁‖ below this does not make the preconditioner better.
MOSTLY_ROUNDING = 1e-12  # Below this ‖A x - e₁‖ a step may add as much rounding as it removes.


def find_columns(
    A: ToeplitzOperator,
    residual: float = MOSTLY_ROUNDING,
    *,
    factor: Columns | None = None,
    solve: Callable[[ToeplitzOperator], Columns | None] | None = None,
) -> Columns:
    """Return A⁻¹ e₁, and A⁻ᴴ e₁ unless A is Hermitian.

    They come from the factors of the symbol and are improved by Newton's method. For a Hermitian
    matrix the Schur algorithm is used if that does not converge, or if the factors are too
    inaccurate for a preconditioner.

    Parameters
    ----------
    A : ToeplitzOperator
        One axis, double precision.
    residual : float, optional
        The iteration ends at this ‖A x - e₁‖, or at rounding. With `RESOLVED` the columns make a
        preconditioner, which is positive definite if A is Hermitian.
    factor : Columns, optional
        The result of `factor_symbol`, if it is known.
    solve : callable, optional
        Another method, which returns nearly exact columns or None. It is tried first if A is
        Hermitian, last otherwise.

    Raises
    ------
    numpy.linalg.LinAlgError
        If a Hermitian A is not positive definite. For other matrices, if the symbol has no
        factors, or if they are too inaccurate for so few unknowns.
    """
    ways: list[Callable[[], Columns | None]] = [lambda: factor or factor_symbol(A)]
    if solve is not None:
        ways.insert(0 if A.is_hermitian else 1, partial(solve, A))
    is_rough = residual > NEAR
    best, refusal = None, np.linalg.LinAlgError(ADVICE)
    for way in ways:
        try:
            if (start := way()) is None:
                continue
            # An exact column makes a better preconditioner than a corrected poor one.
            best = start if is_rough and A.is_hermitian else _correct(start, residual)
        except np.linalg.LinAlgError as error:
            refusal = error
        else:
            if best.residual <= max(residual, NEAR) and (not is_rough or best.is_definite):
                return best
            refusal = np.linalg.LinAlgError(
                f"the Wiener-Hopf factors of A give a column of the inverse with the residual "
                f"{best.residual:.2g}, but it must be at most {RESOLVED:g}: {ADVICE}"
            )
    if A.is_hermitian:
        return _correct(Columns(A, schur_column(A.c)[0]), residual)
    if best is None or not best.residual <= RESOLVED:
        raise refusal
    return best


def _correct(columns: Columns, residual: float) -> Columns:
    """Take Newton steps while they help; at a residual of 1 or more they would diverge."""
    while 1.0 > columns.residual > max(residual, 2.0 * columns.rounding):
        better = columns.improve()
        if not better.residual < 0.5 * columns.residual:
            break
        columns = better
    return columns


def double_line(A: ToeplitzOperator) -> ToeplitzOperator:
    """Return A with one axis in double precision: axes of length one are removed."""
    return squeeze_line(A).astype(np.result_type(A.dtype, np.float64))
