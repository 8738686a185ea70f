"""The Wiener-Hopf factors of a symbol, and the columns of the inverse that they give."""

import numpy as np
from scipy import fft

from toeplitz_mg._typing import Array
from toeplitz_mg.columns.columns import Columns
from toeplitz_mg.engine.lengths import near_fast_length
from toeplitz_mg.engine.work import count_transforms
from toeplitz_mg.operators import ToeplitzOperator
from toeplitz_mg.operators.positivity import is_positive, rounding

OVERSAMPLING = 4  # Samples of the symbol for each unknown: its phase is not lost between two.
ADVICE = "use chan_preconditioner(A) with gmres, or solve_toeplitz, which needs no factors"


def factor_symbol(A: ToeplitzOperator) -> Columns:
    """Approximate A⁻¹ e₁ and A⁻ᴴ e₁ by the factors of the symbol of a matrix of any kind.

    The symbol f(θ) = Σ a_k exp(ikθ) is the product of exp(l₊) and exp(l₋), where l₊ has the
    frequencies k > 0 of log f and l₋ the others, if log f is a function on the circle: if f has no
    zero, and its winding number is 0. Then the inverse of the half-infinite matrix of f is that of
    exp(-l₊), which is lower triangular, times that of exp(-l₋), which is upper triangular.

    Parameters
    ----------
    A : ToeplitzOperator
        Of one axis, in double precision.

    Raises
    ------
    numpy.linalg.LinAlgError
        Where the symbol has a zero, or winds around it.

    References
    ----------
    A. Böttcher, B. Silbermann, Introduction to Large Truncated Toeplitz Matrices, Springer 1999,
    §1.5.
    """
    (n,) = A.grid_shape
    is_complex = A.dtype.kind == "c"
    forward, backward = (fft.fft, fft.ifft) if is_complex else (fft.rfft, fft.irfft)
    length = 2 * fft.next_fast_len(OVERSAMPLING // 2 * n, real=not is_complex)
    count_transforms(5, length)
    f = forward(A.circulant((length,)))
    logarithm = _logarithm(f, is_complex)
    cepstrum = backward(logarithm, length)
    mean = cepstrum[0]
    inverse = np.exp(-forward(_keep_causal(cepstrum)))
    x = backward(inverse, length)[:n]
    y = backward(1.0 / (f * inverse), length)
    row = np.concatenate([y[:1], y[:-n:-1]])
    scale = np.exp(-mean) / (f[0] if is_complex else f[0].real)
    # Both begin with 1, but for the frequencies that are beyond the samples.
    return Columns(A, x * (scale / x[0]), (row * (scale / row[0])).conj())


def factor_positive_symbol(A: ToeplitzOperator) -> Columns | None:
    """Approximate A⁻¹ e₁ of a complex Hermitian matrix, or return None: its symbol has a zero.

    With half as many samples: those that are positive where `factor_symbol` finds a zero between
    the coefficients that A has and those that it lacks.
    """
    (n,) = A.grid_shape
    length = 2 * near_fast_length(n)
    count_transforms(4, length)
    f = fft.fft(A.circulant((length,))).real
    if not is_positive(f, A.dtype):
        return None
    cepstrum = fft.ifft(np.log(f))
    scale = float(np.exp(-cepstrum[0].real))
    x = fft.ifft(np.exp(-fft.fft(_keep_causal(cepstrum))))[:n]
    x *= scale / x[0]
    x[0] = scale
    return Columns(A, x)


def _keep_causal(cepstrum: Array) -> Array:
    """Return the positive frequencies; that in the middle is half a positive one."""
    half = len(cepstrum) // 2
    causal = np.zeros_like(cepstrum)
    causal[1:half] = cepstrum[1:half]
    causal[half] = cepstrum[half] / 2.0
    return causal


def _logarithm(f: Array, is_complex: bool) -> Array:
    """Return the continuous logarithm of f/f₀, f given on the circle, or on half where it is even.

    On the other half a real sequence has the conjugate values.
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
            f"the symbol of A has the winding number {winding}, but needs 0 for its "
            f"Wiener-Hopf factors: {ADVICE}"
        )
    return np.asarray(np.log(sizes / sizes[0]) + 1j * phase)
