"""The log-determinant of a positive definite Toeplitz matrix, by its recursions and its inverse.

With x = A⁻¹ e₁, e = 1/x₀ and the polynomial a(z) = Σ xₖ zᵏ/x₀, which has no zero in the closed unit
disc, the symbol e/|a|² has the lags of A up to n - 1, and those beyond that an autoregressive
process has (Bernstein and Szegő). Its matrices have determinants that Szegő's strong limit theorem
gives exactly, as it is one of those for which the limit is reached.
"""

import warnings
from collections.abc import Callable
from contextlib import suppress
from math import isqrt, log
from typing import NamedTuple

import numpy as np
import scipy.linalg

from toeplitz_mg._typing import Array
from toeplitz_mg.columns.circle import Circle, circle_of
from toeplitz_mg.columns.columns import EPS
from toeplitz_mg.columns.schur import schur_column
from toeplitz_mg.engine.vectors import norm
from toeplitz_mg.operators import ToeplitzOperator
from toeplitz_mg.solvers.reflection import levinson_column, step_down
from toeplitz_mg.solvers.sharp_column import SharpColumn
from toeplitz_mg.solvers.szego_polynomial import MOST_SAMPLES
from toeplitz_mg.solvers.toeplitz.sizes import GENERAL, SHORT

GOAL = 1e-12  # Relative error of a log-determinant above which the Schur algorithm may do better.
SAFETY = 3.0  # Estimates of errors are this many times what is known of them.
FEWEST = 64  # Unknowns from which on the cepstrum has terms enough to see how they decrease.
LONG_SAMPLES = 4.25  # Enough for each unknown for most of long memory, its real zero divided out.
LONGEST = 2**22  # Most samples that are taken of a long column where nothing else is exact.
WRAPPED = 1e-7  # How much a series is damped over its length: then less of it wraps around.
CUT = 0.1  # What is cut off of a sum is less than the last eighth of it over this.
SPREAD = 50.0  # Largest ratio of an error that was seen to the one of random rounding.
NEWTON_STEPS = 40  # Most steps for a zero, which takes some eight.
FAR = 10.0  # Distance of a zero from the circle, over 1/n, at which it makes no difference.
ROUGH = 1e-11  # The same where Cholesky's factorisation is worth its time.
INEXACT = 1e-10  # Estimated error for each unknown above which there is a warning.


class LogDeterminant(NamedTuple):
    """A logarithm of a determinant, and an estimate of its absolute error that is rather large."""

    value: float
    error: float

    @property
    def is_exact(self) -> bool:
        """Whether the estimate is within the goal."""
        return self.error <= GOAL * abs(self.value)

    def is_within(self, error: float, n: int) -> bool:
        """Whether the estimate is within this error for each of so many unknowns."""
        return self.error <= error * max(n, abs(self.value))

    def doubt(self, n: int) -> str:
        """Return what a warning says where it is inexact, and nothing where it is not."""
        if self.is_within(INEXACT, n):
            return ""
        return (
            f"log det A is {self.value:.12g} with an error of up to {self.error:.1e}: A is "
            "ill-conditioned, for which a larger c[0] would help"
        )


def warn_of_error(found: LogDeterminant, n: int, stacklevel: int) -> None:
    """Warn where the estimated error of a log-determinant of n unknowns is large."""
    if doubt := found.doubt(n):
        warnings.warn(doubt, scipy.linalg.LinAlgWarning, stacklevel=stacklevel)


def log_determinant(
    A: ToeplitzOperator, find_column: Callable[[Array | None], SharpColumn]
) -> LogDeterminant:
    """Return log det A from reflection coefficients, or from the column of its inverse.

    It is the first of several ways that is exact, or else the one with the least error.

    Parameters
    ----------
    A : ToeplitzOperator
        Of one axis, Hermitian, in double precision.
    find_column : callable
        Returns the column, given one that is nearly it or None, if it is needed.

    Raises
    ------
    numpy.linalg.LinAlgError
        Where A is not positive definite, or float64 cannot tell.
    """
    n, best, start = len(A.c), LogDeterminant(0.0, np.inf), None
    if n <= SHORT:
        with suppress(np.linalg.LinAlgError):
            start, gamma = levinson_column(A.c)
            best = _sum_upwards(A, start, gamma)
            if best.is_exact:
                return best
    column = find_column(start)
    for way in _ways(A, column):
        best = _better(best, way)
        if best.is_exact:
            return best
    if n <= GENERAL and not best.is_within(ROUGH, n):
        best = _better(best, lambda: _factor(A, column))
    if best.error > n:  # Then no prediction error has a digit.
        schur_column(A.c)  # It says which leading block is not positive definite.
        raise np.linalg.LinAlgError(
            f"the leading {n} x {n} block of A is not positive definite, exactly or numerically: "
            "with a larger c[0], a nugget, it is"
        )
    return best


Way = Callable[[], LogDeterminant | None]


def _better(best: LogDeterminant, way: Way) -> LogDeterminant:
    """Return the better one of two log-determinants, of which the second may be refused."""
    with suppress(np.linalg.LinAlgError):
        found = way()
        if found is not None and found.error < best.error:
            return found
    return best


def _ways(A: ToeplitzOperator, column: SharpColumn) -> list[Way]:
    """Return the ways to the log-determinant once the column is known, the fastest first."""
    n = len(A.c)
    ways: list[Way] = []
    if n >= FEWEST:
        ways.append(lambda: _sum_cepstrum(column, MOST_SAMPLES * n))
    if n > GENERAL:
        ways.append(lambda: _sum_schur_parameters(column))
        ways.append(lambda: _sum_cepstrum(column, LONGEST))
        return ways
    ways.append(lambda: _sum_downwards(column))
    if n > SHORT:
        ways.append(lambda: _sum_upwards(A, *levinson_column(A.c)))
    return ways


def _factor(A: ToeplitzOperator, column: SharpColumn) -> LogDeterminant:
    """Return log det A by Cholesky's factorisation of the dense matrix."""
    n, diagonal = len(A.c), np.linalg.cholesky(A.toarray()).diagonal().real
    trace = abs(float(column.polynomial.diagonal_sums[0].real))
    error = EPS * (float(np.sqrt(2.0 / n)) * norm(A.c) * trace + n)
    return LogDeterminant(2.0 * float(np.log(diagonal).sum()), error)


def _sum_upwards(A: ToeplitzOperator, x: Array, gamma: Array) -> LogDeterminant:
    """Return log det A by Levinson's recursion, from its column and its coefficients.

    The derivative of log det A is A⁻¹, whose trace says what the rounding of c₀ changes. How far
    the last prediction error is off, the residual of the last column tells.
    """
    c, n = A.c, len(A.c)
    logs = np.log1p(-(gamma.real**2 + gamma.imag**2))
    of_variance, of_errors = n * log(c[0].real), float(np.arange(n - 1, 0, -1.0) @ logs)
    residual = np.eye(1, n)[0] - A.apply(x)
    trace = float((n - 2.0 * np.arange(n)) @ (x.real**2 + x.imag**2)) / x[0].real
    error = n * abs(np.vdot(x, residual)) / x[0].real
    error += EPS * (abs(c[0].real * trace) + abs(of_variance) - of_errors)
    return LogDeterminant(of_variance + of_errors, SAFETY * float(error))


def _sum_downwards(column: SharpColumn) -> LogDeterminant:
    """Return log det A by Levinson's steps backwards, from the last prediction error 1/x₀.

    The first one has all errors of these steps: it is c₀.
    """
    n, last = len(column.x), -log(column.x[0].real)
    gamma = step_down(column.x)
    logs = np.log1p(-(gamma.real**2 + gamma.imag**2))
    of_errors = float(np.arange(1.0, n) @ logs)
    wrong = abs(log(column.A.c[0].real) - (last - float(logs.sum())))
    error = n * (wrong + column.error) + EPS * (abs(n * last) - of_errors)
    return LogDeterminant(n * last - of_errors, SAFETY * error)


def _sum_schur_parameters(column: SharpColumn) -> LogDeterminant:
    c = column.A.c
    n = len(c)
    x, gamma = schur_column(c)
    logs = np.log1p(-(gamma.real**2 + gamma.imag**2))
    of_errors = float(np.arange(n - 1, 0, -1.0) @ logs)  # All of them are negative.
    of_variance = n * float(np.log(c[0].real))
    rounding = EPS * (abs(of_variance) - of_errors)
    # No prediction error is more wrong than the last one, 1/x₀. That may be right by chance, but
    # hardly all numbers of x.
    wrong = float(np.abs(x - column.x).max()) / float(column.x[0].real)
    # Where the column could not be corrected it is this one, and proves nothing.
    of_column = EPS if column.residual is None else column.error
    return LogDeterminant(of_variance + of_errors, SAFETY * (n * (wrong + of_column) + rounding))


def _sum_cepstrum(column: SharpColumn, most: int) -> LogDeterminant | None:
    """Return log det A = n log e + Σ k |ℓₖ|², where log a = Σ ℓₖ zᵏ; None if A⁻¹ is not positive.

    The series is computed from so many samples that its last terms are small, as what is cut off is
    of their size, and what wraps around too; but from at most so many.
    """
    polynomial = column.polynomial
    if not polynomial.certify(most).positive:
        return None
    n = len(column.x)
    leading = -n * float(np.log(column.x[0].real))
    a, part, doubt = _divide_by_real_zero(polynomial.coefficients)
    if part:
        series = _Series.of(a, round(LONG_SAMPLES * n))
    else:  # Enough for smooth covariances, and taken already.
        series = _Series.on(polynomial.circle, polynomial.slopes / polynomial.values)
    best = None
    while True:
        value = leading + part + series.total
        rounding = SPREAD * (n * column.error + EPS * (abs(leading) + abs(value)))
        rounding += (column.error + EPS) * doubt
        found = LogDeterminant(value, series.error + rounding)
        if best is not None and not found.error < 0.5 * best.error:
            return best  # What is left is the rounding of the transforms.
        best, samples = found, 3 * series.samples // 2
        if series.error <= 0.1 * GOAL * abs(value) + rounding or samples > most:
            return best
        series = _Series.of(a, samples)


class _Series(NamedTuple):
    """The sum Σ |sₖ|²/k of the series z a'/a = Σ sₖ zᵏ, where sₖ = k ℓₖ, k = 1 … N - 1.

    Attributes
    ----------
    samples : int
        N.
    total : float
    error : float
        A bound of what is cut off, and of what wraps around.
    """

    samples: int
    total: float
    error: float

    @classmethod
    def of(cls, a: Array, samples: int) -> "_Series":
        """Compute the series on a circle of a radius r < 1, on which it wraps around as rᴺ sₖ₊ₙ."""
        n, circle = len(a), circle_of(samples, a.dtype)
        growth = _powers(-log(WRAPPED) / circle.points, circle.points)
        damped = a / growth[:n]
        values = circle.values(np.arange(float(n)) * damped)
        values /= circle.values(damped)
        return cls.on(circle, values, growth, WRAPPED)

    @classmethod
    def on(
        cls, circle: Circle, values: Array, growth: Array | float = 1.0, wrapped: float = 1.0
    ) -> "_Series":
        """Compute the series from values of z a'/a, on a circle on which it does not grow so."""
        length = circle.points
        k, eighth = np.arange(float(length)), max((length - 1) // 8, 1)
        s = circle.coefficients(values, length)
        if s.dtype.kind == "c":
            s = np.abs(s)
        s *= growth
        terms = s * s
        terms[1:] /= k[1:]
        total, last = float(terms[1:].sum()), float(terms[-eighth:].sum())
        # Σ |sₖ|/k is at most √(Σ |sₖ|²/k) √(1 + log N).
        sizes = float(np.sqrt(total * (1.0 + log(length))))
        wrapped *= 2.0 * sizes * float(np.abs(s[-eighth:]).max())
        return cls(length, total, last / CUT + wrapped)


def _powers(exponent: float, number: int) -> Array:
    """Return exp(exponent k), k = 0 … number - 1."""
    width = isqrt(number) + 1
    rows = np.exp(exponent * width * np.arange(-(-number // width)))
    return np.outer(rows, np.exp(exponent * np.arange(width))).ravel()[:number]


def _divide_by_real_zero(a: Array) -> tuple[Array, float, float]:
    """Return ã = a/(1 - ρ z) and what Σ k ℓₖ² has more for a than for ã; a itself and 0 if none.

    The third is by how much larger the error of that is than the relative error of the numbers a:
    next to the circle it is that of the distance of the zero, which is a difference of them.

    1/ρ is the real zero of a next to the unit circle. The polynomials of covariances of long memory
    have one within 1/n of it, which makes the series long; but its part -ρᵏ/k is known.
    """
    if a.dtype.kind == "c":
        return a, 0.0, 0.0
    if a[1::2].sum() > 0.0:  # Then |a(-1)| < |a(1)|.
        a = a.copy()
        a[1::2] *= -1.0  # The zero is negative. This changes the signs of every second ℓ only.
    distance = _find_zero_beyond_one(a)
    if distance is None:
        return a, 0.0, 0.0
    doubt = 2.0 * float(np.abs(a).sum() / abs(a.sum()))
    powers = _powers(-distance, len(a))
    # These sums of coefficients from the last one on do not cancel, where all but a₀ are negative.
    sums = np.cumsum((a / powers)[:0:-1])[::-1]
    a = -sums * powers[:-1]
    part = -2.0 * float(np.log(a @ powers[:-1])) - float(np.log(-np.expm1(-2.0 * distance)))
    return a, part, doubt


def _find_zero_beyond_one(a: Array) -> float | None:
    """Return the logarithm of the real zero above 1 next to it, by Newton's method, or None.

    The polynomials of covariances of long memory are 1 minus a sum with positive coefficients,
    concave and decreasing for z > 0: the first step goes beyond the zero, and the others come back.
    """
    k = np.arange(float(len(a)))
    distance, last = 0.0, np.inf
    for _ in range(NEWTON_STEPS):
        terms = a * _powers(distance, len(a))
        slope = float(k @ terms)
        if not slope < 0.0:
            return None
        step = -float(terms.sum()) / slope
        if not 0.0 < distance + step < FAR / len(a):
            return None
        distance += step
        # Steps that are small and shrink no more are rounding.
        if abs(step) <= (4.0 * EPS if abs(step) < 0.5 * last else 1e-6) * distance:
            break
        last = abs(step)
    return distance
