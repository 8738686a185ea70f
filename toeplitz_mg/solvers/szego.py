"""The log-determinant of a positive definite Toeplitz matrix, by recursions and by its inverse.

Let x = A⁻¹ e₁ and e = 1/x₀. The polynomial a(z) = Σ xₖ zᵏ/x₀ has no zero in the closed unit disc,
and the symbol e/|a|² has the lags of A up to n - 1, continued by those of an autoregressive process
(Bernstein and Szegő). For this symbol Szegő's strong limit theorem gives the determinant exactly,
because the limit is reached.
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
from toeplitz_mg.solvers.refined_column import RefinedColumn
from toeplitz_mg.solvers.reflection import levinson_column, step_down
from toeplitz_mg.solvers.szego_polynomial import MOST_SAMPLES
from toeplitz_mg.solvers.toeplitz.sizes import GENERAL, SHORT

GOAL = 1e-12  # Relative error of a log-determinant above which another method is tried.
SAFETY = 3.0  # Factor from the computed estimates of errors to the reported ones.
FEWEST = 64  # Fewest unknowns for which the cepstrum has enough terms to show how they decrease.
LONG_SAMPLES = 4.25  # Samples per unknown for long memory, after division by its real zero.
LONGEST = 2**22  # Most samples for a long column if no other method is exact.
WRAPPED = 1e-7  # Damping of a series over its length, which reduces its aliases.
CUT = 0.1  # The truncation error is bounded by the last eighth of the sum divided by this.
SPREAD = 50.0  # Largest observed ratio of an error to that of random rounding.
NEWTON_STEPS = 40  # Most steps for a zero, which usually takes about eight.
FAR = 10.0  # A zero further from the circle than this, divided by n, needs no special treatment.
ROUGH = 1e-11  # Error per unknown above which a Cholesky factorisation is worth its time.
INEXACT = 1e-10  # Estimated error per unknown above which a warning is given.


class LogDeterminant(NamedTuple):
    """The logarithm of a determinant, with a rather large estimate of its absolute error."""

    value: float
    error: float

    @property
    def is_exact(self) -> bool:
        """Whether the estimated error is within `GOAL`."""
        return self.error <= GOAL * abs(self.value)

    def is_within(self, error: float, n: int) -> bool:
        """Whether the estimated error is within `error` per unknown, for n unknowns."""
        return self.error <= error * max(n, abs(self.value))

    def doubt(self, n: int) -> str:
        """Return the text of a warning if the error is large, otherwise an empty string."""
        if self.is_within(INEXACT, n):
            return ""
        return (
            f"log det A is {self.value:.12g} with an error of up to {self.error:.1e}: A is "
            "ill-conditioned, for which a larger c[0] would help"
        )


def warn_of_error(found: LogDeterminant, n: int, stacklevel: int) -> None:
    """Warn if the estimated error of a log-determinant of n unknowns is large."""
    if doubt := found.doubt(n):
        warnings.warn(doubt, scipy.linalg.LinAlgWarning, stacklevel=stacklevel)


def log_determinant(
    A: ToeplitzOperator, find_column: Callable[[Array | None], RefinedColumn]
) -> LogDeterminant:
    """Return log det A from reflection coefficients, or from the column of its inverse.

    Methods are tried until one is exact; otherwise that with the smallest error is used.

    Parameters
    ----------
    A : ToeplitzOperator
        One axis, Hermitian, double precision.
    find_column : callable
        Returns the column, given an approximation or None; called only if it is needed.

    Raises
    ------
    numpy.linalg.LinAlgError
        If A is not positive definite, or float64 cannot tell.
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
    if best.error > n:  # No prediction error has a correct digit.
        schur_column(A.c)  # Its error names the leading block that is not positive definite.
        raise np.linalg.LinAlgError(
            f"the leading {n} x {n} block of A is not positive definite, exactly or numerically: "
            "use a larger c[0] (a nugget)"
        )
    return best


Way = Callable[[], LogDeterminant | None]


def _better(best: LogDeterminant, way: Way) -> LogDeterminant:
    """Return the log-determinant with the smaller error; the second one may be refused."""
    with suppress(np.linalg.LinAlgError):
        found = way()
        if found is not None and found.error < best.error:
            return found
    return best


def _ways(A: ToeplitzOperator, column: RefinedColumn) -> list[Way]:
    """Return the methods for the log-determinant that use the column, the fastest first."""
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


def _factor(A: ToeplitzOperator, column: RefinedColumn) -> LogDeterminant:
    """Return log det A by a Cholesky factorisation of the dense matrix."""
    n, diagonal = len(A.c), np.linalg.cholesky(A.toarray()).diagonal().real
    trace = abs(float(column.polynomial.diagonal_sums[0].real))
    error = EPS * (float(np.sqrt(2.0 / n)) * norm(A.c) * trace + n)
    return LogDeterminant(2.0 * float(np.log(diagonal).sum()), error)


def _sum_upwards(A: ToeplitzOperator, x: Array, gamma: Array) -> LogDeterminant:
    """Return log det A by Levinson's recursion, from its column and its coefficients.

    The derivative of log det A is A⁻¹; its trace bounds the effect of the rounding of c₀. The
    residual of the last column bounds the error of the last prediction error.
    """
    c, n = A.c, len(A.c)
    logs = np.log1p(-(gamma.real**2 + gamma.imag**2))
    of_variance, of_errors = n * log(c[0].real), float(np.arange(n - 1, 0, -1.0) @ logs)
    residual = np.eye(1, n)[0] - A.apply(x)
    trace = float((n - 2.0 * np.arange(n)) @ (x.real**2 + x.imag**2)) / x[0].real
    error = n * abs(np.vdot(x, residual)) / x[0].real
    error += EPS * (abs(c[0].real * trace) + abs(of_variance) - of_errors)
    return LogDeterminant(of_variance + of_errors, SAFETY * float(error))


def _sum_downwards(column: RefinedColumn) -> LogDeterminant:
    """Return log det A by Levinson's steps backwards, from the last prediction error 1/x₀.

    They end at c₀, whose deviation shows the accumulated error.
    """
    n, last = len(column.x), -log(column.x[0].real)
    gamma = step_down(column.x)
    logs = np.log1p(-(gamma.real**2 + gamma.imag**2))
    of_errors = float(np.arange(1.0, n) @ logs)
    wrong = abs(log(column.A.c[0].real) - (last - float(logs.sum())))
    error = n * (wrong + column.error) + EPS * (abs(n * last) - of_errors)
    return LogDeterminant(n * last - of_errors, SAFETY * error)


def _sum_schur_parameters(column: RefinedColumn) -> LogDeterminant:
    c = column.A.c
    n = len(c)
    x, gamma = schur_column(c)
    logs = np.log1p(-(gamma.real**2 + gamma.imag**2))
    of_errors = float(np.arange(n - 1, 0, -1.0) @ logs)  # All terms are negative.
    of_variance = n * float(np.log(c[0].real))
    rounding = EPS * (abs(of_variance) - of_errors)
    # The last prediction error, 1/x₀, has the largest error. It may be right by chance, but hardly
    # all entries of x.
    wrong = float(np.abs(x - column.x).max()) / float(column.x[0].real)
    # If the column could not be corrected it is the same, and proves nothing.
    of_column = EPS if column.residual is None else column.error
    return LogDeterminant(of_variance + of_errors, SAFETY * (n * (wrong + of_column) + rounding))


def _sum_cepstrum(column: RefinedColumn, most: int) -> LogDeterminant | None:
    """Return log det A = n log e + Σ k |ℓₖ|² with log a = Σ ℓₖ zᵏ; None if A⁻¹ is not positive.

    The number of samples is increased, up to `most`, until the last terms of the series are small:
    they bound both the truncation and the aliasing error.
    """
    polynomial = column.polynomial
    if not polynomial.certify(most).positive:
        return None
    n = len(column.x)
    leading = -n * float(np.log(column.x[0].real))
    a, part, doubt = _divide_by_real_zero(polynomial.coefficients)
    if part:
        series = _Series.of(a, round(LONG_SAMPLES * n))
    else:  # The default samples suffice for smooth covariances.
        series = _Series.on(polynomial.circle, polynomial.slopes / polynomial.values)
    best = None
    while True:
        value = leading + part + series.total
        rounding = SPREAD * (n * column.error + EPS * (abs(leading) + abs(value)))
        rounding += (column.error + EPS) * doubt
        found = LogDeterminant(value, series.error + rounding)
        if best is not None and not found.error < 0.5 * best.error:
            return best  # The rest is rounding of the transforms.
        best, samples = found, 3 * series.samples // 2
        if series.error <= 0.1 * GOAL * abs(value) + rounding or samples > most:
            return best
        series = _Series.of(a, samples)


class _Series(NamedTuple):
    """The sum Σ |sₖ|²/k for the series z a'/a = Σ sₖ zᵏ, where sₖ = k ℓₖ, k = 1 … N - 1.

    Attributes
    ----------
    samples : int
        N.
    total : float
    error : float
        A bound of the truncation and aliasing errors.
    """

    samples: int
    total: float
    error: float

    @classmethod
    def of(cls, a: Array, samples: int) -> "_Series":
        """Compute the series on a circle of a radius r < 1, where the aliases are rᴺ sₖ₊ₙ."""
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
        """Compute the series from values of z a'/a on a circle, whose radius `growth` undoes."""
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
    """Return ã = a/(1 - ρ z), the difference of Σ k ℓₖ² between a and ã, and its sensitivity.

    1/ρ is the real zero of a nearest to the unit circle. Polynomials of long-memory covariances
    have one within 1/n of it, which makes the series long; its part -ρᵏ/k is known. If there is no
    such zero, a itself and 0 are returned. The sensitivity is the ratio of the error of the
    difference to the relative error of the entries of a: near the circle the distance of the zero
    is a difference of these.
    """
    if a.dtype.kind == "c":
        return a, 0.0, 0.0
    if a[1::2].sum() > 0.0:  # |a(-1)| < |a(1)|.
        a = a.copy()
        a[1::2] *= -1.0  # The zero is negative: reflect it. Only every second ℓ changes its sign.
    distance = _find_zero_beyond_one(a)
    if distance is None:
        return a, 0.0, 0.0
    doubt = 2.0 * float(np.abs(a).sum() / abs(a.sum()))
    powers = _powers(-distance, len(a))
    # These sums, from the last coefficient on, do not cancel if all but a₀ are negative.
    sums = np.cumsum((a / powers)[:0:-1])[::-1]
    a = -sums * powers[:-1]
    part = -2.0 * float(np.log(a @ powers[:-1])) - float(np.log(-np.expm1(-2.0 * distance)))
    return a, part, doubt


def _find_zero_beyond_one(a: Array) -> float | None:
    """Return the logarithm of the smallest real zero above 1, by Newton's method, or None.

    The polynomials of long-memory covariances are 1 minus a sum with positive coefficients, concave
    and decreasing for z > 0: the first step overshoots the zero, and the others converge to it.
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
        # Small steps that no longer shrink are rounding errors.
        if abs(step) <= (4.0 * EPS if abs(step) < 0.5 * last else 1e-6) * distance:
            break
        last = abs(step)
    return distance
