"""The Wiener-Hopf factors of a symbol from its cepstrum, and the columns of the inverse."""

import numpy as np
from scipy.fft import next_fast_len

from toeplitz_mg._typing import Array
from toeplitz_mg.columns.circle import OVERSAMPLING
from toeplitz_mg.columns.columns import Columns
from toeplitz_mg.engine import fourier
from toeplitz_mg.engine.lengths import near_fast_length
from toeplitz_mg.engine.work import count_transforms
from toeplitz_mg.operators import ToeplitzOperator
from toeplitz_mg.operators.positivity import require_positive, rounding
from toeplitz_mg.operators.symbol import symbol_of_line

ADVICE = "use chan_preconditioner(A) with gmres, or solve_toeplitz, which needs no factors"


def factor_symbol(A: ToeplitzOperator, samples: Array | None = None) -> Columns:
    """Return approximations of A⁻¹ e₁, and of A⁻ᴴ e₁ unless A is Hermitian, from the symbol.

    The symbol f(θ) = Σ a_k exp(ikθ) factors into exp(l₊) exp(l₋): l₊ has the frequencies k > 0 of
    log f (the cepstrum), l₋ the others. This requires that log f is a function on the circle: f has
    no zeros and the winding number 0. The inverse of the half-infinite matrix of f is then the
    lower triangular matrix of exp(-l₊) times the upper triangular one of exp(-l₋). If f is real,
    the two are adjoint to each other up to the mean of log f.

    Parameters
    ----------
    A : ToeplitzOperator
        One axis, double precision.
    samples : ndarray, optional
        `symbol_of_line(A)` of a symmetric A, if it is known.

    Raises
    ------
    numpy.linalg.LinAlgError
        If the symbol has a zero or a winding number other than 0, or if A is Hermitian and its
        symbol is not positive.

    References
    ----------
    A. Böttcher, B. Silbermann, Introduction to Large Truncated Toeplitz Matrices, Springer 1999,
    §1.5.
    """
    (n,) = A.grid_shape
    is_complex = A.dtype.kind == "c"
    forward, backward = (fourier.fft, fourier.ifft) if is_complex else (fourier.rfft, fourier.irfft)
    if not A.is_hermitian:
        length = 2 * next_fast_len(OVERSAMPLING // 2 * n, real=not is_complex)
        f = forward(A.circulant((length,)))
        logarithm = _logarithm(f, is_complex)
    else:
        # More samples may find a zero in the interpolation between the coefficients of A and the
        # missing ones, where so few samples are all positive.
        length = 2 * near_fast_length(n)
        if is_complex:
            f = forward(A.circulant((length,))).real
        else:
            f = symbol_of_line(A) if samples is None else samples
        require_positive(f, A.dtype, "the symbol of A has the sample", ADVICE)
        logarithm = np.log(f)
    count_transforms(3 if A.is_hermitian else 5, length)
    cepstrum = backward(logarithm, length)
    inverse = np.exp(-forward(_keep_causal(cepstrum)))
    x = backward(inverse, length)[:n]
    # The first entry is 1 up to aliasing of the frequencies beyond the samples.
    if A.is_hermitian:
        scale = np.exp(-cepstrum[0].real)
        x *= scale / x[0] if is_complex else scale * x[0]
        x[0] = x[0].real
        return Columns(A, x)
    y = backward(1.0 / (f * inverse), length)
    row = np.concatenate([y[:1], y[:-n:-1]])
    scale = np.exp(-cepstrum[0]) / (f[0] if is_complex else f[0].real)
    return Columns(A, x * (scale / x[0]), (row * (scale / row[0])).conj())


def _keep_causal(cepstrum: Array) -> Array:
    """Return the cepstrum at positive frequencies; the middle one counts half."""
    half = len(cepstrum) // 2
    causal = np.zeros_like(cepstrum)
    causal[1:half] = cepstrum[1:half]
    causal[half] = cepstrum[half] / 2.0
    return causal


def _logarithm(f: Array, is_complex: bool) -> Array:
    """Return the continuous logarithm of f/f₀, for f given on the circle.

    For a real sequence f is given on half of it; the other half has the conjugate values.
    """
    sizes = np.abs(f)
    smallest = float(sizes.min())
    if not smallest > rounding(f, np.float64):
        raise np.linalg.LinAlgError(
            f"the symbol of A has the sample {smallest:.3g}, but none may be zero within the "
            f"rounding of the largest, {sizes.max():.3g}: {ADVICE}"
        )
    unit = f / sizes
    turns = np.angle(unit[1:] * unit[:-1].conj())
    phase = np.append(0.0, np.cumsum(turns))
    whole = phase[-1] + np.angle(unit[0] * unit[-1].conj()) if is_complex else 2.0 * phase[-1]
    winding = -round(whole / (2.0 * np.pi))  # The transform has the frequencies -θ.
    if winding:
        raise np.linalg.LinAlgError(
            f"the symbol of A has the winding number {winding}, but must have 0 for its "
            f"Wiener-Hopf factors: {ADVICE}"
        )
    return np.asarray(np.log(sizes / sizes[0]) + 1j * phase)
