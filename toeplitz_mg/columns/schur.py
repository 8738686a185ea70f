"""The first column of the inverse, by the superfast generalised Schur algorithm."""

from collections.abc import Callable
from math import isqrt

import numpy as np
from scipy.fft import next_fast_len
from scipy.linalg import solve_toeplitz, solve_triangular, toeplitz

from toeplitz_mg._typing import Array, Rows
from toeplitz_mg.engine import fourier
from toeplitz_mg.engine.work import count_transforms
from toeplitz_mg.operators.positivity import LAST_RESORT, require_positive_diagonal

LARGEST_BLOCK = 256  # Most steps that Levinson's recursion takes at once; larger blocks are slower.


def schur_column(c: Array) -> tuple[Array, Array]:
    """Return A⁻¹ e₁ and the Schur parameters of the Toeplitz matrix A with the first column `c`.

    This takes O(n log² n) operations, like about 30 products with A. The only condition on A is
    that it is positive definite: there is no symbol, no embedding and no iteration.

    Parameters
    ----------
    c : ndarray of float64 or complex128, of shape (n,)
        A is symmetric or Hermitian, and c₀ real.

    Returns
    -------
    x : ndarray of shape (n,)
        A⁻¹ e₁.
    gamma : ndarray of shape (n - 1,)
        The Schur parameters (reflection coefficients), all smaller than 1 in absolute value:
        det A = c₀ⁿ Π (1 - |γₖ|²)ⁿ⁻ᵏ, k = 1 … n - 1.

    Raises
    ------
    numpy.linalg.LinAlgError
        If a Schur parameter is not smaller than 1 in float64: A is not positive definite, or too
        ill-conditioned.

    Notes
    -----
    Levinson's recursion for the prediction-error polynomial a and its conjugate reversal a*,

        a ← a + γ z a*,      z a* ← z (γ̄ a + z a*),      γ = -e₀/g₀,

    takes γ from their residuals, the series e and g, which it updates in the same way. The first
    half of the steps depends only on half of the coefficients. So the polynomials of these steps
    are multiplied into e and g by FFT, and then the second half starts. Short intervals are solved
    as small Toeplitz systems.

    References
    ----------
    G. Ammar, W. Gragg, Superfast solution of real positive definite Toeplitz systems, SIAM J.
    Matrix Anal. Appl. 9 (1988).

    Examples
    --------
    >>> x, gamma = schur_column(np.array([4.0, 2.0, 2.0]))
    >>> x
    array([ 0.375, -0.125, -0.125])
    >>> gamma
    array([-0.5       , -0.33333333])
    """
    x, gamma, _ = _run(c, np.empty((0, len(c)), c.dtype))
    return x, gamma


def whiten_rows(c: Array, Y: Rows) -> Rows:
    """Return L⁻¹ y for each row y of `Y`, where A = L Lᴴ has the first column `c`.

    Entry k is the error of predicting y_k from the entries before it, Σ_j a_j y_(k-j), divided by
    its standard deviation. The a are the polynomials of all steps of `schur_column`, and the
    recursion updates y like the residuals e and g. This takes as long as `schur_column`, plus about
    half as long for each row.

    Raises
    ------
    numpy.linalg.LinAlgError
        As `schur_column`.
    """
    _, gamma, errors = _run(c, Y)
    variances = c[0].real * np.cumprod(np.append(1.0, 1.0 - np.abs(gamma) ** 2))
    return np.concatenate([Y[:, :1], errors], axis=1) / np.sqrt(variances)


def _run(c: Array, Y: Rows) -> tuple[Array, Array, Rows]:
    """Return A⁻¹ e₁, the Schur parameters, and the prediction errors without their first column."""
    diagonal = float(c[0].real)
    require_positive_diagonal(diagonal)
    if len(c) == 1:
        return np.ones(1, c.dtype) / diagonal, np.zeros(0, c.dtype), Y[:, 1:]
    # Part of the time is proportional to the number of blocks, another part to their length.
    block = min(4 * isqrt(len(c)), LARGEST_BLOCK)
    blocks: list[Array] = []
    rows = np.concatenate([c[np.newaxis] / diagonal, Y])
    try:
        # If the matrix is not positive definite, numbers may overflow before that is detected.
        with np.errstate(over="ignore", invalid="ignore"):
            P = _steps(np.stack([rows[:, 1:], rows[:, :-1]], axis=1), block, blocks)
    except np.linalg.LinAlgError:
        _recur(blocks)  # Its error names the leading block that is not positive definite.
        raise
    a = np.append(P[0], 0.0)
    a[1:] += P[1]
    a[0] = 1.0  # Exact value; the computed one may have a complex rounding error.
    gamma, errors = _recur(blocks)
    return a / np.vdot(c, a).real, gamma, errors


def _steps(series: Array, block: int, blocks: list[Array]) -> Array:
    """Take as many steps as the residuals have entries, and return their polynomials P₁, P₂.

    The s steps map a to P₁ a + P₂ z a*, and z a* to zˢ (P₂(1/z) a + P₁(1/z) z a*) with conjugate
    coefficients. The residuals at the start of each block are appended to `blocks`.

    Parameters
    ----------
    series : ndarray of shape (rows, 2, s)
        The residuals e and g, followed by those of other series.
    """
    s = series.shape[-1]
    if s <= block:
        blocks.append(series)
        return _block(series[0])
    forward, backward = _transforms(series)
    length = 2 * next_fast_len(-(-s // 2), real=forward is fourier.rfft)
    half = length // 2  # zʰ is ±1 at these roots of unity.
    count_transforms(6 + 4 * len(series), length)
    P = _both_rows(forward(_steps(series[..., :half], block, blocks), length))
    # The product wraps around into the first half, which is not needed any more.
    series = backward(_product(P, forward(series, length)), length)[..., half:s]
    Q = _both_rows(forward(_steps(series, block, blocks), length))
    return backward(_product(P.swapaxes(0, 1), Q[0]), length)[:, :s]


def _transforms(a: Array) -> tuple[Callable[..., Array], Callable[..., Array]]:
    """Return the forward and inverse transform for this dtype."""
    return (fourier.fft, fourier.ifft) if a.dtype.kind == "c" else (fourier.rfft, fourier.irfft)


def _both_rows(P: Array) -> Array:
    """Return the transform of [[P₁, P₂], [zʰ P̄₂(1/z), zʰ P̄₁(1/z)]] from that of P₁, P₂."""
    reverse = P[::-1].conj()
    reverse[:, 1::2] *= -1.0
    return np.stack([P, reverse])


def _product(P: Array, v: Array) -> Array:
    """Multiply pairs, of shape (..., 2, length), by matrices of shape (2, 2, length)."""
    return P[:, 0] * v[..., :1, :] + P[:, 1] * v[..., 1:, :]


def _block(EG: Array) -> Array:
    """Take the steps by Levinson's recursion for the Toeplitz matrix with these residuals."""
    s = EG.shape[1]
    e, g = EG
    # The initial residuals e = (c₁ …) and g = (c₀ …) satisfy g = c₀ + z e. So e and g are
    # proportional to those of c = g/(g - z e), up to the s coefficients that matter.
    g = np.append(g, 0.0)
    divisor = g - np.append(0.0, e)
    if not divisor[0].real > 0.0:
        # The prediction error is not positive.
        raise np.linalg.LinAlgError(_NOT_POSITIVE)
    lower = toeplitz(divisor, np.zeros(s + 1))
    c = solve_triangular(lower, g, lower=True, check_finite=False)
    unit = np.zeros(s + 1)
    unit[0] = 1.0
    try:
        x = solve_toeplitz(c, unit, check_finite=False)
    except np.linalg.LinAlgError:
        # A leading block of the matrix is singular.
        raise np.linalg.LinAlgError(_NOT_POSITIVE) from None
    if not x[0].real > 0.0:
        raise np.linalg.LinAlgError(_NOT_POSITIVE)
    a = x / x[0]
    # P₁ is the mean of a and the polynomial of the second kind, a (2 c - 1), cut to degree s.
    forward, backward = _transforms(EG)
    length = next_fast_len(2 * s + 1, real=forward is fourier.rfft)
    P1 = backward(forward(a, length) * forward(c, length), length)[:s]
    return np.stack([P1, a[1:] - np.append(P1[1:], 0.0)])


# The first advice suits a covariance; the second one suits any matrix.
ADVICE = (
    f"add to c[0] (a nugget, like noise in the data); to solve with A as it is, use {LAST_RESORT}"
)
_NOT_POSITIVE = (
    f"A is not positive definite, or so ill-conditioned that float64 cannot tell: {ADVICE}"
)


def _recur(blocks: list[Array]) -> tuple[Array, Rows]:
    """Return the Schur parameters and the prediction errors of the series after the first.

    Schur's recursion runs on all blocks at once.
    """
    steps = np.array([series.shape[-1] for series in blocks])
    shape, dtype = (steps.max(), len(blocks[0]), len(blocks)), blocks[0].dtype
    E, G = np.zeros((2, *shape), dtype)
    for k, series in enumerate(blocks):
        E[: steps[k], :, k], G[: steps[k], :, k] = series.transpose(1, 2, 0)
    gamma, errors = np.zeros((shape[0], shape[2]), dtype), np.zeros(shape, dtype)
    with np.errstate(all="ignore"):  # Values after a parameter ≥ 1 have no meaning.
        for m in range(len(gamma)):
            gamma[m] = -E[0, 0] / G[0, 0]
            gamma[m, steps <= m] = 0.0
            change = gamma[m].conj() * E
            E += gamma[m] * G
            G += change
            errors[m] = E[0]
            # The first e is zero now; z a* is shifted by one.
            E, G = E[1:], G[:-1]
    is_step = (np.arange(shape[0])[:, np.newaxis] < steps).T
    gamma = gamma.T[is_step]
    require_reflections(gamma)
    return gamma, errors.transpose(1, 2, 0)[1:, is_step]


def require_reflections(gamma: Array, first: int = 0) -> None:
    """Raise a LinAlgError if a Schur parameter, numbered from `first`, is not smaller than 1."""
    is_below = np.append(np.abs(gamma) < 1.0, False)
    if (k := int(np.argmin(is_below))) < len(gamma):
        n = first + k + 2
        raise np.linalg.LinAlgError(
            f"the leading {n} x {n} block of A is not positive definite, or so "
            f"ill-conditioned that float64 cannot tell: {ADVICE}"
        )
