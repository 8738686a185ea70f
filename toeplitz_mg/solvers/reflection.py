"""Reflection coefficients: upwards from the coefficients of a matrix, downwards from its inverse.

Upwards is Levinson's recursion; downwards are the same steps backwards from A⁻¹ e₁. Upwards the
rounding errors grow with the condition number of A. Downwards they hardly do, if the column is
exact, but each of the n steps is a NumPy call.
"""

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array
from toeplitz_mg.columns.schur import require_reflections, schur_column
from toeplitz_mg.engine.conjugate_gradients import SAFE_SIZES
from toeplitz_mg.engine.ranks import is_serial
from toeplitz_mg.engine.vectors import power_above
from toeplitz_mg.operators import ToeplitzOperator
from toeplitz_mg.operators.positivity import require_positive_diagonal
from toeplitz_mg.solvers.toeplitz.levinson import recursion
from toeplitz_mg.solvers.toeplitz.sizes import GENERAL
from toeplitz_mg.values import refuse_masked


def reflection_coefficients(c: ArrayLike) -> Array:
    """Return the reflection coefficients of a positive definite Toeplitz matrix.

    If c are the autocovariances of a stationary process, these are its partial autocorrelations.

    Parameters
    ----------
    c : array_like of shape (n,)
        First column, real or complex, as in `scipy.linalg.toeplitz`: A is symmetric, or Hermitian
        if c is complex with a real c[0].

    Returns
    -------
    ndarray of shape (n - 1,)
        Entry k - 1 is the last coefficient of the best linear prediction from k values, that is the
        last entry of φ in ``toeplitz(c[:k]) @ φ = c[1:k+1]``. All are below 1 in absolute value.

    Raises
    ------
    numpy.linalg.LinAlgError
        If A is not positive definite, exactly or in float64. The message tells which leading block
        is not.
    ValueError
        If `c` has several axes, or numbers that `ToeplitzOperator` refuses.

    See Also
    --------
    toeplitz_logdet : ``n log c[0] + Σ (n - k) log(1 - |γₖ|²)``, if γₖ are these.
    ToeplitzNormal : the normal distribution with this covariance matrix.

    Notes
    -----
    Up to 2048 unknowns they are computed by Levinson's recursion, in n² operations; beyond by the
    superfast Schur algorithm, in O(n log² n). For an autoregressive process of order p they vanish
    beyond the first p.

    References
    ----------
    J. Durbin, The fitting of time-series models, Rev. Inst. Int. Stat. 28 (1960).

    Examples
    --------
    >>> import numpy as np
    >>> import toeplitz_mg as tmg
    >>> c = 0.5 ** np.arange(5)  # An autoregressive process of order 1.
    >>> tmg.reflection_coefficients(c).round(12) + 0.0
    array([0.5, 0. , 0. , 0. ])
    """
    line, _ = read_column(c, "reflection_coefficients(A.c)")
    upwards = levinson_column if len(line.c) <= GENERAL else schur_column
    gamma = -upwards(line.c)[1]
    return gamma.astype(refuse_masked("c", c).dtype) if np.asarray(c).dtype.char in "fF" else gamma


def read_column(c: ArrayLike, advice: str) -> tuple[ToeplitzOperator, int]:
    """Return the matrix 2^-power A with the first column `c` of A, in float64, and the power.

    Squares of its numbers neither overflow nor underflow.

    Raises
    ------
    numpy.linalg.LinAlgError
        If the diagonal is not positive.
    ValueError
        If there are several axes, or the diagonal is not real.
    TypeError
        If `c` is a matrix.
    """
    if isinstance(c, LinearOperator) or not is_serial(c):
        raise TypeError(
            f"c is {c!r}, but must be the first column of a matrix: for a ToeplitzOperator A use "
            f"{advice}"
        )
    column = refuse_masked("c", c)
    if column.ndim > 1 and isinstance(c, tuple):
        raise ValueError("c is a pair, but must be the first column alone, of a Hermitian matrix")
    if column.ndim > 1:
        raise ValueError(
            f"c has shape {column.shape}, but must have one axis: no exact method for several axes "
            "is known that is faster than a dense factorisation"
        )
    A = ToeplitzOperator(column)
    if not A.is_hermitian:
        raise ValueError(f"c[0] is {A.c[0]}, but must be real for a Hermitian matrix")
    require_positive_diagonal(float(A.c[0].real))
    A = A.astype(np.result_type(A.dtype, np.float64))
    power = 0
    if not SAFE_SIZES[0] <= A.norm_bound <= SAFE_SIZES[1]:
        power = int(power_above(A.norm_bound))
        A = ToeplitzOperator(A.c * 2.0**-power)
    return A, power


def levinson_column(c: Array) -> tuple[Array, Array]:
    """Return the same as `schur_column`, by Levinson's recursion in n² operations.

    Raises
    ------
    numpy.linalg.LinAlgError
        If a parameter is not smaller than 1.
    """
    if len(c) == 1:
        return schur_column(c)
    lags = np.concatenate([c[-2:0:-1].conj(), c[:-1]])
    try:
        predictor, reflections = recursion()(lags, np.ascontiguousarray(c[1:]))
    except np.linalg.LinAlgError:  # A leading block is singular; the other algorithm names it.
        return schur_column(c)
    if reflections is None:  # SciPy's public function does not return them.
        return schur_column(c)
    gamma = -reflections[1:]
    require_reflections(gamma)
    variance = c[0].real * np.exp(np.log1p(-(np.abs(gamma) ** 2)).sum())
    return np.append(1.0, -predictor) / variance, gamma


def step_down(x: Array) -> Array:
    """Return the Schur parameters of the matrix with A⁻¹ e₁ = x, by Levinson's steps backwards.

    Raises
    ------
    numpy.linalg.LinAlgError
        If a parameter is not smaller than 1: no positive definite matrix has this column.
    """
    a = x / x[0].real
    gamma = np.empty(len(a) - 1, a.dtype)
    for m in range(len(a) - 1, 0, -1):
        gamma[m - 1] = last = a[m]
        if not abs(last) < 1.0:
            require_reflections(gamma[m - 1 :], m - 1)
        a = (a[:m] - last * a[m:0:-1].conj()) * (1.0 / (1.0 - abs(last) ** 2))
    return gamma
