"""Hermitian positive definite block Toeplitz systems of several channels: solutions, log det A.

References
----------
P. Whittle, On the fitting of multivariate autoregressions, Biometrika 50 (1963); R. A. Wiggins,
E. A. Robinson, Recursive solution to the multichannel filtering problem, J. Geophys. Res. 70
(1965), for the recursion. I. C. Gohberg, G. Heinig, Inversion of finite Toeplitz matrices
consisting of elements of a noncommutative algebra, Rev. Roumaine Math. Pures Appl. 19 (1974), for
the inverse.
"""

import warnings
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import LinAlgWarning, cho_factor, cho_solve

from toeplitz_mg._typing import Array
from toeplitz_mg.columns.columns import EPS
from toeplitz_mg.engine import fourier
from toeplitz_mg.engine.vectors import norm
from toeplitz_mg.operators import CoupledOperator, ToeplitzOperator
from toeplitz_mg.operators.coefficients import check_finite
from toeplitz_mg.preconditioners import chan_preconditioner
from toeplitz_mg.solvers.cg import cg
from toeplitz_mg.solvers.checks import check_numbers
from toeplitz_mg.solvers.toeplitz.refinement import ILL_CONDITIONED, SolveInfo
from toeplitz_mg.values import positive, refuse_masked

# Measured with two to eight channels (`python -m comparisons.drop_in --channels 2 4 8`).
DENSE = 600  # Most unknowns for which a dense Cholesky factor is as fast as the recursion.
SHORT = 512  # Most blocks for which the recursion is tried before CG.
TRIED = 100  # Iterations of CG before the recursion is used, which takes longer than these.
LONGEST = 20_000  # Most blocks of a recursion; its time grows with their square.


NOT_DEFINITE = (
    "A is not positive definite, but must be: use a CoupledOperator and gmres with "
    "chan_preconditioner"
)


def solve_block_toeplitz(
    c: ArrayLike, b: ArrayLike, *, rtol: float = 1e-12, full_output: bool = False
) -> Any:
    """Solve A x = b for a Hermitian positive definite block Toeplitz matrix.

    Covariance matrices of several channels have this form: multichannel Wiener filters, vector
    autoregressions, stereo echo cancellation.

    Parameters
    ----------
    c : array_like of shape (n, k, k)
        First block column. The block in row i and column j is ``c[i - j]`` for i ≥ j, and the
        conjugate transpose of ``c[j - i]`` above the diagonal. For a vector-valued series y,
        ``c[l]`` is the mean of y[t + l] y[t]ᴴ.
    b : array_like of shape (n, k) or (n, k, m)
    rtol : float
        A solution with ‖b - A x‖ ≤ rtol ‖b‖ is not corrected further.
    full_output : bool
        Whether to return a `SolveInfo` as well.

    Returns
    -------
    x : ndarray of the shape of `b`, float64 or complex128
    info : SolveInfo
        Only with `full_output`.

    Raises
    ------
    numpy.linalg.LinAlgError
        If A is not positive definite, or has more than 20,000 blocks and is so ill-conditioned that
        CG does not converge.
    TypeError, ValueError
        If arguments are not finite numbers, shapes do not match, ``c[0]`` is not Hermitian, or
        `rtol` is not positive.

    Warns
    -----
    scipy.linalg.LinAlgWarning
        If the residual stays above 1e-8 ‖b‖: x may have few correct digits.

    See Also
    --------
    block_toeplitz_logdet : the log-determinant.
    solve_toeplitz : for one channel.
    CoupledOperator : for several axes, with iterative solvers.

    Notes
    -----
    Up to 600 unknowns are solved by a dense factorisation. Up to 512 blocks are solved by the
    recursion of Whittle, Wiggins and Robinson and one correction; the channels are first made
    orthonormal at lag zero, which makes the recursion backward stable. Larger systems are solved by
    conjugate gradients with T. Chan's block circulant, or by the recursion if these do not converge
    within 100 iterations.

    Examples
    --------
    >>> import numpy as np
    >>> import toeplitz_mg as tmg
    >>> c = np.array([[[2.0, 0.5], [0.5, 2.0]], [[0.5, 0.2], [0.0, 0.5]]])
    >>> tmg.solve_block_toeplitz(c, [[3.0, 3.2], [3.2, 3.0]]).round(12)
    array([[1., 1.],
           [1., 1.]])
    """
    c, B = _read(c), check_numbers("b", b)
    n, k, _ = c.shape
    tolerance = positive("rtol", rtol)
    if B.ndim not in (2, 3) or B.shape[:2] != (n, k):
        raise ValueError(f"b has shape {B.shape}, but must have {(n, k)}, or {(n, k)} + columns")
    if not np.isfinite(B).all():
        raise ValueError("b has entries that are not finite, but all must be")
    right = B.reshape(n, k, -1).astype(np.result_type(B, np.float64))
    hat = _embed(c)
    x, method, iterations = _solve(c, right, tolerance)
    size, error = norm(right.ravel()), norm((right - _multiply(hat, x, x.dtype)).ravel())
    bound = float(np.linalg.norm(hat, axis=(1, 2)).max()) * norm(x.ravel())  # Bounds ‖A‖ ‖x‖.
    error = max(error, EPS * bound)  # A smaller error is rounding.
    residual = error / size if size else 0.0
    backward = error / (bound + size) if size else 0.0
    info = SolveInfo(method, iterations, residual, backward)
    if not residual <= ILL_CONDITIONED:
        warnings.warn(
            f"‖b - A x‖/‖b‖ is {residual:.1e}: A is ill-conditioned, and x may have few correct "
            "digits",
            LinAlgWarning,
            stacklevel=2,
        )
    x = x.reshape(B.shape)
    return (x, info) if full_output else x


def block_toeplitz_logdet(c: ArrayLike) -> float:
    """Return log det A for a Hermitian positive definite block Toeplitz matrix.

    Parameters
    ----------
    c : array_like of shape (n, k, k)
        First block column (see `solve_block_toeplitz`).

    Raises
    ------
    numpy.linalg.LinAlgError
        If A is not positive definite.
    TypeError, ValueError
        As for `solve_block_toeplitz`, and for more than 20,000 blocks.

    See Also
    --------
    solve_block_toeplitz, toeplitz_logdet

    Examples
    --------
    >>> import numpy as np
    >>> import toeplitz_mg as tmg
    >>> c = np.array([[[2.0, 0.5], [0.5, 2.0]], [[0.5, 0.2], [0.0, 0.5]]])
    >>> A = np.block([[c[0], c[1].T], [c[1], c[0]]])
    >>> bool(np.isclose(tmg.block_toeplitz_logdet(c), np.linalg.slogdet(A)[1]))
    True
    """
    c = _read(c)
    n, k, _ = c.shape
    if n > LONGEST:
        raise ValueError(f"c has {n} blocks, but for the recursion must have at most {LONGEST}")
    if n * k <= DENSE:
        return float(2.0 * np.log(np.diag(_factor(c)[0]).real).sum())
    return _recursion(c, np.zeros((n, k, 0), c.dtype))[1]


def _read(values: ArrayLike) -> Array:
    """Return the first block column, in double precision."""
    c = check_finite(refuse_masked("c", values), "c")
    if c.ndim != 3 or c.shape[1] != c.shape[2]:
        raise ValueError(
            f"c has shape {c.shape}, but must have (n, k, k), n blocks of k channels: for one "
            "channel use solve_toeplitz"
        )
    c = c.astype(np.result_type(c, np.float64))
    adjoint = c[0].conj().T
    if np.abs(c[0] - adjoint).max() > 1e-12 * np.abs(c[0]).max():
        raise ValueError("c[0] is not Hermitian, but must be, because it is a diagonal block")
    c[0] = (c[0] + adjoint) / 2
    return c


def _lags(c: Array) -> Array:
    """Return all blocks, with lag zero in the middle."""
    return np.concatenate([c[:0:-1].conj().swapaxes(1, 2), c])


def _embed(c: Array) -> Array:
    """Return the transform of the block circulant of 2 n blocks that embeds the matrix."""
    n, k, _ = c.shape
    column = np.zeros((2 * n, k, k), c.dtype)
    column[:n], column[n + 1 :] = c, c[:0:-1].conj().swapaxes(1, 2)
    return fourier.fft(column, axis=0)


def _multiply(hat: Array, x: Array, dtype: np.dtype[Any]) -> Array:
    """Multiply by a block Toeplitz matrix, given the transform of its embedding."""
    y = fourier.ifft(hat @ fourier.fft(x, len(hat), axis=0), axis=0)[: len(x)]
    return y if dtype.kind == "c" else y.real


def _solve(c: Array, b: Array, rtol: float) -> tuple[Array, str, int]:
    """Return x, the name of the method, and the number of its iterations."""
    n, k, m = b.shape
    if n * k <= DENSE:
        x = cho_solve(_factor(c), b.reshape(n * k, m))
        return x.reshape(b.shape), "Cholesky factor", 1
    if n > SHORT and (found := _iterate(c, b, rtol)) is not None:
        return found
    if n > LONGEST:
        raise np.linalg.LinAlgError(
            f"conjugate gradients have not converged in {TRIED} iterations, and {n} blocks are too "
            f"many for a recursion, which takes at most {LONGEST}: A is ill-conditioned"
        )
    return _recursion(c, b)[0], "block levinson", 1


def _iterate(c: Array, b: Array, rtol: float) -> tuple[Array, str, int] | None:
    """Return x by conjugate gradients, on the unknowns sorted by channel; None if that fails."""
    lags, (n, k, m) = _lags(c), b.shape
    A = CoupledOperator(
        [[ToeplitzOperator.from_lags(lags[:, i, j]) for j in range(k)] for i in range(k)]
    )
    M = chan_preconditioner(A)  # Raises an error if A is not positive definite.
    x, iterations = np.empty((k, n, m), np.result_type(c, b)), 0
    for j in range(m):
        residuals: list[float] = []
        right = np.ascontiguousarray(b[:, :, j].T).ravel()
        y, info = cg(A, right, M=M, rtol=rtol, maxiter=TRIED, residuals=residuals)
        iterations = max(iterations, len(residuals) - 1)
        if info:
            return None
        x[:, :, j] = y.reshape(k, n)
    return x.swapaxes(0, 1), "cg, block circulant", iterations


def _factor(c: Array) -> tuple[Array, bool]:
    """Return the Cholesky factor of the dense matrix."""
    n, k, _ = c.shape
    i = np.arange(n)
    dense = _lags(c)[i[:, np.newaxis] - i + n - 1].swapaxes(1, 2).reshape(n * k, n * k)
    try:
        return cho_factor(dense, lower=True, overwrite_a=True, check_finite=False)
    except np.linalg.LinAlgError:
        raise np.linalg.LinAlgError(NOT_DEFINITE) from None


def _recursion(c: Array, b: Array) -> tuple[Array, float]:
    """Return x and log det A, by the block version of Levinson's recursion.

    It runs in channels made orthonormal by c[0], for which it is stable. For the leading matrix of
    j blocks it has the forward predictor, A U = (Ef, 0, …, 0) with U_0 = I, and the backward one,
    A V = (0, …, 0, Eb) with V_(j-1) = I. Then log det A is the sum of all log det Eb.
    """
    (n, k, m), inverse = b.shape, np.linalg.inv
    try:
        L = np.linalg.cholesky(c[0])
        half = np.linalg.solve(L, c).conj().swapaxes(1, 2)
        R = np.linalg.solve(L, half).conj().swapaxes(1, 2)  # L⁻¹ c L⁻ᴴ.
        R[0] = np.eye(k)
        g = np.linalg.solve(L, b)
        dtype = np.result_type(R, g)
        P = np.zeros((n * k, k + m), dtype)  # U and x, side by side.
        V, W = np.zeros((n * k, k), dtype), np.empty((n * k, k), dtype)
        row = np.ascontiguousarray(R[::-1].swapaxes(0, 1).reshape(k, n * k), dtype)
        E = np.empty((n, 2, k, k), dtype)  # Ef and Eb for each step.
        E[0] = P[:k, :k] = V[:k] = R[0]
        P[:k, k:] = g[0]
        for j in range(1, n):
            D = row[:, (n - 1 - j) * k : (n - 1) * k] @ P[: j * k]
            Df, rest = D[:, :k], g[j] - D[:, k:]
            Ff, Fb = inverse(E[j - 1])
            Kf, Kb = Fb @ Df, Ff @ Df.conj().T
            W[:k] = 0.0
            W[k : (j + 1) * k] = V[: j * k]
            W[: j * k] -= P[: j * k, :k] @ Kb
            P[k : (j + 1) * k, :k] -= V[: j * k] @ Kf
            E[j, 0] = E[j - 1, 0] - Df.conj().T @ Kf
            E[j, 1] = E[j - 1, 1] - Df @ Kb
            E[j] = (E[j] + E[j].conj().swapaxes(-1, -2)) / 2
            V, W = W, V
            if m:
                P[: (j + 1) * k, k:] += V[: (j + 1) * k] @ (inverse(E[j, 1]) @ rest)
        factors = np.linalg.cholesky(np.append(E[:, 1], E[-1:, 0], axis=0))
    except np.linalg.LinAlgError:
        raise np.linalg.LinAlgError(NOT_DEFINITE) from None
    logs = np.log(np.einsum("jii->ji", factors[:n]).real).sum()
    logdet = 2.0 * float(logs + n * np.log(np.diag(L).real).sum())
    if not m:
        return b, logdet
    x, U = P[:, k:].reshape(n, k, m), P[:, :k].reshape(n, k, k)
    # Correct x by the formula of Gohberg and Heinig, where T is block lower triangular Toeplitz:
    # A⁻¹ = T(U) Ef⁻¹ T(U)ᴴ - T(0, V) Eb⁻¹ T(0, V)ᴴ with these first block columns.
    r = g - _multiply(_embed(R), x, dtype)
    behind = np.append(np.zeros((1, k, k)), V.reshape(n, k, k)[:-1], axis=0)
    for column, F, sign in zip((U, behind), inverse(E[-1]), (1.0, -1.0), strict=True):
        hat = fourier.fft(column, 2 * n, axis=0)
        change = F @ _multiply(hat.conj().swapaxes(1, 2), r, dtype)
        x = x + sign * _multiply(hat, change, dtype)
    return np.linalg.solve(L.conj().T, x), logdet
