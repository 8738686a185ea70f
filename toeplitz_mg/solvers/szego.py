"""What the first column of its inverse says of a positive definite Toeplitz matrix.

With x = A⁻¹ e₁, e = 1/x₀ and the polynomial a(z) = Σ xₖ zᵏ/x₀, which has no zero in the closed unit
disc, the symbol e/|a|² has the lags of A up to n - 1, and those beyond that an autoregressive
process has (Bernstein and Szegő). Its matrices have determinants that Szegő's strong limit theorem
gives exactly, as it is one of those for which the limit is reached.
"""

from collections.abc import Callable
from math import isqrt, log
from typing import NamedTuple

import numpy as np
from scipy import fft

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.lengths import near_fast_length
from toeplitz_mg.engine.vectors import norm
from toeplitz_mg.engine.work import count_transforms
from toeplitz_mg.preconditioners.schur import schur_column
from toeplitz_mg.solvers.long_residual import EPS
from toeplitz_mg.solvers.sharp_column import LONGEST, SharpColumn

GOAL = 1e-12  # Relative error of a log-determinant above which the Schur algorithm may do better.
DENSE = 512  # Unknowns up to which Cholesky's factorisation takes no longer than that.
FEWEST = 64  # Unknowns from which on the cepstrum has terms enough to see how they decrease.
FEWEST_SAMPLES = 2.0  # Samples for each unknown, which are enough for smooth covariances.
LONG_SAMPLES = 4.25  # Those which are enough for most of long memory, their real zero divided out.
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


def log_determinant(column: SharpColumn) -> LogDeterminant:
    """Return log det A from the column of its inverse, or by the Schur algorithm.

    Raises
    ------
    numpy.linalg.LinAlgError
        Where A is not positive definite, or float64 cannot tell.
    """
    n = len(column.x)
    by_column = _sum_cepstrum(column, MOST_SAMPLES * n) if n >= FEWEST else None
    if by_column is not None and by_column.is_exact:
        return by_column
    other = _factor(column) if n <= DENSE else _sum_schur_parameters(column)
    if by_column is None or other.is_exact:
        return other
    found = (by_column, other, _sum_cepstrum(column, LONGEST) or other)
    return min(found, key=lambda determinant: determinant.error)


def _factor(column: SharpColumn) -> LogDeterminant:
    """Return log det A by Cholesky's factorisation of the dense matrix."""
    A, n = column.A, len(column.x)
    try:
        diagonal = np.linalg.cholesky(A.toarray()).diagonal().real
    except np.linalg.LinAlgError:
        schur_column(A.c)  # It says which leading block is not positive definite.
        raise
    trace = float(diagonal_sums(column.x)[0].real)
    error = EPS * (float(np.sqrt(2.0 / n)) * norm(A.c) * trace + n)
    return LogDeterminant(2.0 * float(np.log(diagonal).sum()), error)


def _sum_schur_parameters(column: SharpColumn) -> LogDeterminant:
    c = column.A.c
    n = len(c)
    x, gamma = schur_column(c)
    logs = np.log1p(-(gamma.real**2 + gamma.imag**2))
    value = n * float(np.log(c[0].real)) + float(np.arange(n - 1, 0, -1.0) @ logs)
    # No prediction error before the last one is more wrong than that.
    last = abs(float(np.log(x[0].real / column.x[0].real)))
    return LogDeterminant(value, 3.0 * n * (last + EPS))


def diagonal_sums(x: Array) -> Array:
    """Return Σ_i (A⁻¹)_(i,i+k), k = 0 … n - 1, from x = A⁻¹ e₁.

    By the Gohberg-Semencul formula it is Σ_p (n - k - 2p) x_p x̄_(p+k)/x₀. The weight is the mean of
    n - 2p and n - 2(p + k): so it is the mean of the correlations of (n - 2p) x_p with x and of x
    with that, whose transforms are conjugate to each other.
    """
    n = len(x)
    weighted = (n - 2.0 * np.arange(n)) * x
    return _correlate(lambda hat, other: (hat * other.conj()).real, x, weighted) / x[0].real


def autocorrelations(x: Array) -> Array:
    """Return Σ_p x_p x̄_(p+k), k = 0 … n - 1."""
    return _correlate(lambda hat: hat.real**2 + hat.imag**2, x)


def _correlate(combine: Callable[..., Array], *series: Array) -> Array:
    """Return the lags 0 … n - 1 of what real combinations of the transforms of series stand for."""
    n = len(series[0])
    length = fft.next_fast_len(2 * n - 1, real=True)
    count_transforms(len(series) + 1, length)
    if any(x.dtype.kind == "c" for x in series):
        return fft.ifft(combine(*(fft.fft(x, length) for x in series)))[:n].conj()
    return fft.irfft(combine(*(fft.rfft(x, length) for x in series)), length)[:n]


def _sum_cepstrum(column: SharpColumn, most: int) -> LogDeterminant | None:
    """Return log det A = n log e + Σ k |ℓₖ|², where log a = Σ ℓₖ zᵏ; None if A⁻¹ is not positive.

    The series is computed from so many samples that its last terms are small, as what is cut off is
    of their size, and what wraps around too; but from at most so many.
    """
    x = column.x
    if not column.certificate.positive:
        return None
    n, size = len(x), x[0].real
    leading = -n * float(np.log(size))
    a, part = _divide_by_real_zero(x / size)
    samples = (LONG_SAMPLES if part else FEWEST_SAMPLES) * n
    best = None
    while samples <= most:
        series = _Series.of(a, near_fast_length(round(samples)))
        value = leading + part + series.total
        rounding = SPREAD * (n * column.error + EPS * (abs(leading) + abs(value)))
        found = LogDeterminant(value, series.missing + rounding)
        if best is not None and not found.error < 0.5 * best.error:
            break  # What is left is the rounding of the transforms.
        best = found
        excess = series.missing / (0.1 * GOAL * abs(value) + rounding)
        if excess <= 1.0:
            break
        growth = 1.0
        if series.decay > 1.0:  # In half of the samples.
            growth = max(0.5 * 1.4 * np.log(excess) / np.log(series.decay), 0.25)
        samples *= 1.0 + growth
    return best


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
        n, eighth = len(a), max((length - 1) // 8, 1)
        k = np.arange(float(length))
        growth = _powers(-log(WRAPPED) / length, length)
        damped = a / growth[:n]
        count_transforms(3, length)
        is_complex = a.dtype.kind == "c"
        forward, backward = (fft.fft, fft.ifft) if is_complex else (fft.rfft, fft.irfft)
        hat = forward(k[:n] * damped, length)
        hat /= forward(damped, length)
        s = backward(hat, length)
        if is_complex:
            s = np.abs(s)
        s *= growth
        terms = s * s
        terms[1:] /= k[1:]
        total, half = float(terms[1:].sum()), length // 2
        last, middle = (float(terms[e - eighth : e].sum()) for e in (length, half))
        # Σ |sₖ|/k is at most √(Σ |sₖ|²/k) √(1 + log N).
        sizes = float(np.sqrt(total * (1.0 + log(length))))
        wrapped = 2.0 * WRAPPED * sizes * float(np.abs(s[-eighth:]).max())
        return cls(total, last / CUT + wrapped, middle / last if last else np.inf)


def _powers(exponent: float, number: int) -> Array:
    """Return exp(exponent k), k = 0 … number - 1."""
    width = isqrt(number) + 1
    rows = np.exp(exponent * width * np.arange(-(-number // width)))
    return np.outer(rows, np.exp(exponent * np.arange(width))).ravel()[:number]


def _divide_by_real_zero(a: Array) -> tuple[Array, float]:
    """Return ã = a/(1 - ρ z) and what Σ k ℓₖ² has more for a than for ã; a itself and 0 if none.

    1/ρ is the real zero of a next to the unit circle. The polynomials of covariances of long memory
    have one within 1/n of it, which makes the series long; but its part -ρᵏ/k is known.
    """
    if a.dtype.kind == "c":
        return a, 0.0
    if a[1::2].sum() > 0.0:  # Then |a(-1)| < |a(1)|.
        a = a.copy()
        a[1::2] *= -1.0  # The zero is negative. This changes the signs of every second ℓ only.
    distance = _find_zero_beyond_one(a)
    if distance is None:
        return a, 0.0
    powers = _powers(-distance, len(a))
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
    k = np.arange(float(len(a)))
    distance = 0.0
    for _ in range(NEWTON_STEPS):
        terms = a * _powers(distance, len(a))
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
