"""What the first column of its inverse says of a positive definite Toeplitz matrix.

With x = A⁻¹ e₁, e = 1/x₀ and the polynomial a(z) = Σ xₖ zᵏ/x₀, which has no zero in the closed unit
disc, the symbol e/|a|² has the lags of A up to n - 1, and those beyond that an autoregressive
process has (Bernstein and Szegő). Its matrices have determinants that Szegő's strong limit theorem
gives exactly, as it is one of those for which the limit is reached.
"""

from typing import NamedTuple

import numpy as np
from scipy import fft

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.lengths import near_fast_length
from toeplitz_mg.engine.vectors import norm
from toeplitz_mg.engine.work import count_transforms
from toeplitz_mg.preconditioners.columns import Columns
from toeplitz_mg.preconditioners.schur import schur_column

GOAL = 1e-12  # Relative error of a log-determinant above which the Schur algorithm may do better.
DENSE = 512  # Unknowns up to which Cholesky's factorisation takes no longer than that.
FEWEST = 64  # Unknowns from which on the cepstrum has terms enough to see how they decrease.
EPS = float(np.finfo(np.float64).eps)
FEWEST_SAMPLES = 2.0  # Samples for each unknown, which are enough for smooth covariances.
MOST_SAMPLES = 16  # Samples for each unknown beyond which the Schur algorithm takes no longer.
WRAPPED = 1e-7  # How much a series is damped over its length: then less of it wraps around.
CUT = 0.1  # What is cut off of a sum is less than the last eighth of it over this.
SPREAD = 50.0  # Largest ratio of an error that was seen to the one of random rounding.
NEWTON_STEPS = 40  # Most steps for a zero, which takes some eight.
FAR = 10.0  # Distance of a zero from the circle, over 1/n, at which it makes no difference.


class LogDeterminant(NamedTuple):
    """A logarithm of a determinant, and an estimate of its absolute error that is rather large."""

    value: float
    error: float

    @property
    def is_exact(self) -> bool:
        """Whether the estimate is within the goal."""
        return self.error <= GOAL * abs(self.value)


def log_determinant(columns: Columns) -> LogDeterminant:
    """Return log det A from the column of its inverse, or by the Schur algorithm.

    Parameters
    ----------
    columns : Columns
        Of a Hermitian matrix in double precision, sharpened.

    Raises
    ------
    numpy.linalg.LinAlgError
        Where A is not positive definite, or float64 cannot tell.
    """
    n = len(columns.x)
    by_column = _sum_cepstrum(columns) if n >= FEWEST else None
    if by_column is not None and by_column.is_exact:
        return by_column
    return _factor(columns) if n <= DENSE else _sum_schur_parameters(columns)


def _factor(columns: Columns) -> LogDeterminant:
    """Return log det A by Cholesky's factorisation of the dense matrix."""
    A, n = columns.A, len(columns.x)
    try:
        diagonal = np.linalg.cholesky(A.toarray()).diagonal().real
    except np.linalg.LinAlgError:
        schur_column(A.c)  # It says which leading block is not positive definite.
        raise
    trace = float(diagonal_sums(columns.x)[0].real)
    error = EPS * (float(np.sqrt(2.0 / n)) * norm(A.c) * trace + n)
    return LogDeterminant(2.0 * float(np.log(diagonal).sum()), error)


def _sum_schur_parameters(columns: Columns) -> LogDeterminant:
    c = columns.A.c
    n = len(c)
    x, gamma = schur_column(c)
    logs = np.log1p(-(gamma.real**2 + gamma.imag**2))
    value = n * float(np.log(c[0].real)) + float(np.arange(n - 1, 0, -1.0) @ logs)
    # No prediction error before the last one is more wrong than that.
    last = abs(float(np.log(x[0].real / columns.x[0].real)))
    return LogDeterminant(value, 3.0 * n * (last + EPS))


def sharpen(columns: Columns) -> Columns:
    """Take steps of Newton's method until the residual is rounding, or decreases no more."""
    while columns.residual > _rounding(columns):
        better = columns.improve()
        if not better.residual < 0.5 * columns.residual:
            break
        columns = better
    return columns


def diagonal_sums(x: Array) -> Array:
    """Return Σ_i (A⁻¹)_(i,i+k), k = 0 … n - 1, from x = A⁻¹ e₁.

    By the Gohberg-Semencul formula it is Σ_p (n - k - 2p) x_p x̄_(p+k)/x₀: two correlations.
    """
    n = len(x)
    k = np.arange(n)
    weighted, plain = correlations(np.stack([(n - 2.0 * k) * x, x]), x)
    return (weighted - k * plain) / x[0].real


def correlations(Y: Array, x: Array) -> Array:
    """Return Σ_p y_p x̄_(p+k), k = 0 … n - 1, of each row y of `Y`."""
    n = x.shape[-1]
    length = fft.next_fast_len(2 * n - 1, real=True)
    count_transforms(2 * Y[..., 0].size + 1, length)
    if Y.dtype.kind == "c" or x.dtype.kind == "c":
        hat = fft.fft(Y, length).conj() * fft.fft(x, length)
        return fft.ifft(hat, length)[..., :n].conj()
    return fft.irfft(fft.rfft(Y, length).conj() * fft.rfft(x, length), length)[..., :n]


def _rounding(columns: Columns) -> float:
    """Return the rounding error that the residual of a column has, if that is random."""
    c, x = columns.A.c, columns.x
    return EPS * np.sqrt(2.0) * norm(c) * norm(x)


def _sum_cepstrum(columns: Columns) -> LogDeterminant | None:
    """Return log det A = n log e + Σ k |ℓₖ|², where log a = Σ ℓₖ zᵏ, or None where it fails.

    The series is computed from so many samples that its last terms are small: what is cut off is
    of their size, and so is what wraps around.
    """
    x = columns.x
    if not columns.certificate.positive:
        return None
    n, size = len(x), x[0].real
    # The residual would change x₀, which is 1/e, by xᴴ (e₁ - A x).
    change = abs(np.vdot(x, columns.errors[0])) + _rounding(columns) * norm(x) / np.sqrt(n)
    leading = -n * float(np.log(size))
    a, part, samples, is_first = x / size, 0.0, FEWEST_SAMPLES, True
    while samples <= MOST_SAMPLES:
        series = _Series.of(a, near_fast_length(round(samples * n)))
        value = leading + part + series.total
        rounding = SPREAD * (n * change / size + EPS * (abs(leading) + abs(value)))
        excess = series.missing / (0.1 * GOAL * abs(value) + rounding)
        if excess <= 1.0:
            return LogDeterminant(value, series.missing + rounding)
        if is_first:
            is_first = False
            if a.dtype.kind != "c" and (divided := _divide_by_real_zero(a)) is not None:
                a, part = divided
                samples *= 2.0
                continue
        if not series.decay > 1.0:
            break
        # The terms decrease by `decay` in half of the samples.
        samples *= 1.0 + max(0.5 * 1.4 * np.log(excess) / np.log(series.decay), 0.25)
    return None


class _Series(NamedTuple):
    """The sum Σ |sₖ|²/k of the series z a'/a = Σ sₖ zᵏ, where sₖ = k ℓₖ, k = 1 … N - 1.

    Attributes
    ----------
    total : float
    missing : float
        A bound of what is cut off, and of what wraps around.
    decay : float
        How much the last terms are smaller than those in the middle.
    """

    total: float
    missing: float
    decay: float

    @classmethod
    def of(cls, a: Array, length: int) -> "_Series":
        """Compute the series on a circle of a radius r < 1, on which it wraps around as rᴺ sₖ₊ₙ."""
        n = len(a)
        k = np.arange(float(length))
        growth = np.exp(-np.log(WRAPPED) / length * k)
        damped = a / growth[:n]
        count_transforms(3, length)
        is_complex = a.dtype.kind == "c"
        forward, backward = (fft.fft, fft.ifft) if is_complex else (fft.rfft, fft.irfft)
        hat = forward(k[:n] * damped, length)
        hat /= forward(damped, length)
        s = np.abs(backward(hat, length)[1:])
        s *= growth[1:]
        relative = s / k[1:]
        terms = relative * s
        eighth = max(len(s) // 8, 1)
        last, middle = (float(terms[e - eighth : e].sum()) for e in (len(s), len(s) // 2))
        wrapped = 2.0 * WRAPPED * float(relative.sum() * s[-eighth:].max())
        return cls(float(terms.sum()), last / CUT + wrapped, middle / last if last else np.inf)


def _divide_by_real_zero(a: Array) -> tuple[Array, float] | None:
    """Return ã = a/(1 - ρ z) and what Σ k ℓₖ² has more for a than for ã, or None.

    1/ρ is the real zero of a next to the unit circle. The polynomials of covariances of long memory
    have one within 1/n of it, which makes the series long; but its part -ρᵏ/k is known.
    """
    signs = np.where(np.arange(len(a)) % 2 == 1, -1.0, 1.0)
    if a.sum() > signs @ a:
        a = signs * a  # The zero is negative. This changes the signs of every second ℓ only.
    distance = _find_zero_beyond_one(a)
    if distance is None:
        return None
    powers = np.exp(-distance * np.arange(len(a)))
    # These sums of coefficients from the last one on do not cancel, where all but a₀ are negative.
    sums = np.cumsum((a / powers)[:0:-1])[::-1]
    a = -sums * powers[:-1]
    part = -2.0 * float(np.log(a @ powers[:-1])) - float(np.log(-np.expm1(-2.0 * distance)))
    return a, part


def _find_zero_beyond_one(a: Array) -> float | None:
    """Return the logarithm of the real zero above 1 next to it, by Newton's method, or None.

    The polynomials of covariances of long memory are 1 minus a sum with positive coefficients,
    concave and decreasing for z > 0: the first step goes beyond the zero, and the others come back.
    """
    k = np.arange(len(a))
    distance = 0.0
    for _ in range(NEWTON_STEPS):
        terms = a * np.exp(distance * k)
        slope = float(k @ terms)
        if not slope < 0.0:
            return None
        step = -float(terms.sum()) / slope
        if not 0.0 < distance + step < FAR / len(a):
            return None
        distance += step
        if abs(step) <= 4.0 * EPS * distance:
            break
    return distance
