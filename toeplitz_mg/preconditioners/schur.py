"""The first column of the inverse, by the superfast generalised Schur algorithm."""

from collections.abc import Callable
from math import isqrt

import numpy as np
from scipy import fft
from scipy.linalg import solve_toeplitz, solve_triangular, toeplitz

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.work import count_transforms
from toeplitz_mg.preconditioners.positivity import LAST_RESORT, require_positive_diagonal

LARGEST_BLOCK = 256  # Most steps that Levinson's recursion takes at once: more would take longer.


def schur_column(c: Array) -> tuple[Array, Array]:
    """Return A⁻¹ e₁ and the Schur parameters of the Toeplitz matrix A with the first column `c`.

    In O(n log² n) operations, as many as some 30 products with A, and without any condition on A
    but that it is positive definite: no symbol, no embedding, no iteration.

    Parameters
    ----------
    c : ndarray of float64 or complex128, of shape (n,)
        A is symmetric or Hermitian, and c₀ real.

    Returns
    -------
    x : ndarray of shape (n,)
        A⁻¹ e₁.
    gamma : ndarray of shape (n - 1,)
        The Schur parameters (reflection coefficients). All are smaller than 1, and
        det A = c₀ⁿ Π (1 - |γₖ|²)ⁿ⁻ᵏ, k = 1 … n - 1.

    Raises
    ------
    numpy.linalg.LinAlgError
        Where a Schur parameter is not smaller than 1, so that A is not positive definite; or is
        not so in the arithmetic of float64.

    Notes
    -----
    Levinson's recursion, for the polynomial a of the prediction error and its reversal a*, of
    conjugate coefficients,

        a ← a + γ z a*,      z a* ← z (γ̄ a + z a*),      γ = -e₀/g₀,

    takes γ from their residuals, the series e and g, which a step combines in the same way. The
    steps of half an interval depend on half of the coefficients only. So the second half starts
    when the first has been multiplied into e and g, and the products of polynomials are made by
    FFT. Small intervals are Toeplitz systems of their own, and solved as such.

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
    diagonal = float(c[0].real)
    require_positive_diagonal(diagonal)
    blocks: list[Array] = []
    a = np.ones(1, c.dtype)
    if len(c) > 1:
        # One part of the time goes as the number of blocks, another as their length.
        block = min(4 * isqrt(len(c)), LARGEST_BLOCK)
        try:
            P = _steps(np.stack([c[1:], c[:-1]]) / diagonal, block, blocks)
        except np.linalg.LinAlgError:
            _schur_parameters(blocks)  # It says after how many steps.
            raise
        a = np.append(P[0], 0.0)
        a[1:] += P[1]
        a[0] = 1.0  # It is that, but for rounding, which may be complex.
    gamma = _schur_parameters(blocks)
    return a / np.vdot(c, a).real, gamma


def _steps(EG: Array, block: int, blocks: list[Array]) -> Array:
    """Take the steps that the residuals e and g, the rows of `EG`, are long enough for.

    It returns the polynomials P₁, P₂ by which s steps turn a into P₁ a + P₂ z a*. They turn z a*
    into zˢ (P₂(1/z) a + P₁(1/z) z a*), with conjugate coefficients. The residuals that each
    block starts from are appended to `blocks`.
    """
    s = EG.shape[1]
    if s <= block:
        return _block(EG, blocks)
    forward, backward = _transforms(EG)
    length = 2 * fft.next_fast_len(-(-s // 2), real=forward is fft.rfft)
    half = length // 2  # Then zʰ is ±1 at the roots of unity of the length.
    count_transforms(10, length)
    P = _both_rows(forward(_steps(EG[:, :half], block, blocks), length))
    # What wraps around falls on the first half, where the residuals are zero now.
    EG = backward(_product(P, forward(EG, length)), length)[:, half:s]
    Q = _both_rows(forward(_steps(EG, block, blocks), length))
    return backward(_product(P.swapaxes(0, 1), Q[0]), length)[:, :s]


def _transforms(a: Array) -> tuple[Callable[..., Array], Callable[..., Array]]:
    """Return the transform, and its inverse, for numbers such as these."""
    return (fft.fft, fft.ifft) if a.dtype.kind == "c" else (fft.rfft, fft.irfft)


def _both_rows(P: Array) -> Array:
    """Return the transform of [[P₁, P₂], [zʰ P₂(1/z), zʰ P₁(1/z)]] from that of P₁, P₂.

    The coefficients of the second row are conjugate.
    """
    reverse = P[::-1].conj()
    reverse[:, 1::2] *= -1.0
    return np.stack([P, reverse])


def _product(P: Array, v: Array) -> Array:
    return P[:, 0] * v[0] + P[:, 1] * v[1]


def _block(EG: Array, blocks: list[Array]) -> Array:
    """Take the steps by Levinson's recursion, for the Toeplitz matrix that has these residuals."""
    blocks.append(EG)
    s = EG.shape[1]
    e, g = EG
    # The residuals at the start, e = (c₁ …) and g = (c₀ …), have g = c₀ + z e. So e and g are
    # proportional to those of c = g/(g - z e) to the s coefficients that matter.
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
    # The polynomial of the second kind is a (2 c - 1), cut to the degree s, and P₁ is the mean of
    # that and a.
    forward, backward = _transforms(EG)
    length = fft.next_fast_len(2 * s + 1, real=forward is fft.rfft)
    P1 = backward(forward(a, length) * forward(c, length), length)[:s]
    return np.stack([P1, a[1:] - np.append(P1[1:], 0.0)])


# A covariance needs what it is meant to have; of another matrix there are other methods.
ADVICE = f"add to c[0] (a nugget, as noise in the data makes it), or use {LAST_RESORT}"
_NOT_POSITIVE = (
    f"A is not positive definite, or so ill-conditioned that float64 cannot tell: {ADVICE}"
)


def _schur_parameters(blocks: list[Array]) -> Array:
    """Return the Schur parameters of all blocks, by Schur's recursion on all of them at once."""
    if not blocks:
        return np.zeros(0)
    steps = np.array([EG.shape[1] for EG in blocks])
    E, G = np.zeros((2, steps.max(), len(blocks)), blocks[0].dtype)  # Each column has a block.
    for k, EG in enumerate(blocks):
        E[: steps[k], k], G[: steps[k], k] = EG
    gamma = np.zeros_like(E)
    with np.errstate(all="ignore"):  # After a parameter that is not below 1 comes anything.
        for m in range(len(gamma)):
            gamma[m] = -E[0] / G[0]
            gamma[m, steps <= m] = 0.0
            change = gamma[m].conj() * E
            E += gamma[m] * G
            G += change
            # The first e is zero now, and z a* is shifted by one.
            E, G = E[1:], G[:-1]
    gamma = np.concatenate([g[:s] for g, s in zip(gamma.T, steps, strict=True)])
    if (n := int(np.argmin(np.append(np.abs(gamma) < 1.0, False)))) < len(gamma):
        raise np.linalg.LinAlgError(
            f"the leading {n + 2} x {n + 2} block of A is not positive definite, or so "
            f"ill-conditioned that float64 cannot tell: {ADVICE}"
        )
    return gamma
