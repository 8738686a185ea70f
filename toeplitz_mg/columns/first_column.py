"""The one place that finds the first column of the inverse of a Toeplitz matrix, and its row.

Those who ask for it say how exactly: `spectral_preconditioner` and the choice of preconditioners
roughly, the inverse and the log-determinant as exactly as double precision allows.
"""

from collections.abc import Callable
from functools import partial

import numpy as np

from toeplitz_mg.columns.columns import NEAR, Columns
from toeplitz_mg.columns.schur import schur_column
from toeplitz_mg.columns.spectral_factor import ADVICE, factor_symbol
from toeplitz_mg.operators import ToeplitzOperator
from toeplitz_mg.operators.lifting import squeeze_line

RESOLVED = 0.25  # Largest ‖A x - e₁‖ at which a better x would not make a better preconditioner.
MOSTLY_ROUNDING = 1e-12  # ‖A x - e₁‖ below which a step may add as much rounding as it removes.


def find_columns(
    A: ToeplitzOperator,
    residual: float = MOSTLY_ROUNDING,
    *,
    factor: Columns | None = None,
    solve: Callable[[ToeplitzOperator], Columns | None] | None = None,
) -> Columns:
    """Find A⁻¹ e₁, and A⁻ᴴ e₁ unless A is Hermitian.

    They are those of the factors of the symbol, improved by Newton's method; of a Hermitian matrix,
    where that does not converge, or the factor is too rough for a preconditioner, the column of the
    Schur algorithm.

    Parameters
    ----------
    A : ToeplitzOperator
        Of one axis, in double precision.
    residual : float, optional
        ‖A x - e₁‖ at which the steps end, or at rounding. At `RESOLVED` the columns make a
        preconditioner, and of a Hermitian matrix one that is positive definite.
    factor : Columns, optional
        Those of `factor_symbol`, where they are known.
    solve : callable, optional
        Another way to columns that are nearly exact, or to None. Of a Hermitian matrix it is tried
        first, of another one last.

    Raises
    ------
    numpy.linalg.LinAlgError
        If a Hermitian matrix is not positive definite, or the symbol of another one has no
        factors, or these are no use with so few unknowns.
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
            # An exact column is a better preconditioner than a poor one that is corrected.
            best = start if is_rough and A.is_hermitian else _correct(start, residual)
        except np.linalg.LinAlgError as error:
            refusal = error
        else:
            if best.residual <= max(residual, NEAR) and (not is_rough or best.is_definite):
                return best
            refusal = np.linalg.LinAlgError(
                f"the Wiener-Hopf factors of A give a column of the inverse with the residual "
                f"{best.residual:.2g}, but need {RESOLVED:g}: {ADVICE}"
            )
    if A.is_hermitian:
        return _correct(Columns(A, schur_column(A.c)[0]), residual)
    if best is None or not best.residual <= RESOLVED:
        raise refusal
    return best


def _correct(columns: Columns, residual: float) -> Columns:
    """Take steps of Newton's method while they help; from a residual of 1 on it diverges."""
    while 1.0 > columns.residual > max(residual, 2.0 * columns.rounding):
        better = columns.improve()
        if not better.residual < 0.5 * columns.residual:
            break
        columns = better
    return columns


def double_line(A: ToeplitzOperator) -> ToeplitzOperator:
    """Return a matrix of one axis in double precision, without axes of one element."""
    return squeeze_line(A).astype(np.result_type(A.dtype, np.float64))
