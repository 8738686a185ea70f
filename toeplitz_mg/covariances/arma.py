"""Autoregressive moving averages, and those of fractionally integrated noise."""

from collections.abc import Sequence
from decimal import Context, Decimal, localcontext
from math import cos, fsum, log, pi, sin
from typing import Any

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.covariances.base import LAGGED, Derivatives, Kernel, Lags
from toeplitz_mg.covariances.long_memory import fractional_difference

DIGITS = 60  # Of the first covariances: beside a unit root the equations for them lose many.
# Of the trapezoidal rule in log s: its ends, where the integrand is below rounding, and its step.
SHORTEST, LONGEST, STEP = 1e-30, 45.0, 0.125


class LinearProcess(Kernel):
    """A process with autoregressive and moving average coefficients."""

    def _check(self) -> None:
        """Refuse coefficients with a root in the unit circle."""
        for group, sign, kind in (("ar", "-", "stationary"), ("ma", "+", "invertible")):
            values = self._values(group)
            if any(abs(r) >= 1 for r in reflections([LAGGED[group] * c for c in values])):
                raise ValueError(
                    f"{group} is {values}, but must be {kind}: the roots of 1 {sign} {group}[0] z "
                    f"{sign} {group}[1] z² {sign} … must lie outside the unit circle"
                )


class ARMA(LinearProcess):
    """An autoregressive moving average, φ(B) y = θ(B) e with white noise e of variance σ².

    y[k] = φ₁ y[k-1] + … + φ_p y[k-p] + e[k] + θ₁ e[k-1] + … + θ_q e[k-q], as in statsmodels. It is
    a process on one axis, in steps: `spacing` does not change it.

    Parameters
    ----------
    sigma2 : float
        σ², of the innovations e.
    ar, ma : float, or sequence of float
        φ₁, …, φ_p and θ₁, …, θ_q, of a stationary and invertible process; their names are
        ``"ar.L1"``, ``"ar.L2"``, … and ``"ma.L1"``, …. Bounds of several coefficients are necessary
        for that, but not sufficient: `with_theta` refuses what is not stationary.

    See Also
    --------
    ARFIMA : with long memory.
    toeplitz_mg.reflection_coefficients : the partial autocorrelations.

    References
    ----------
    P. J. Brockwell, R. A. Davis, Time Series: Theory and Methods, Springer (1991), section 3.3.

    Examples
    --------
    >>> from toeplitz_mg.covariances import ARMA
    >>> ARMA(ar=[0.5], ma=[0.4])(4)
    array([2.08, 1.44, 0.72, 0.36])
    """

    def __init__(self, sigma2: Any = 1.0, ar: Any = (), ma: Any = ()) -> None:
        super().__init__(sigma2=sigma2, ar=ar, ma=ma)

    def _derive(self, lags: Lags, wanted: frozenset[str]) -> tuple[Array, Derivatives]:
        return arma(lags.steps("ARMA"), self._values("ar"), self._values("ma"), wanted)


class ARFIMA(LinearProcess):
    """A fractionally integrated moving average, φ(B) (1 - B)ᵈ y = θ(B) e: long memory for d > 0.

    It is a process on one axis, in steps: `spacing` does not change it.

    Parameters
    ----------
    sigma2 : float
        σ², of the innovations e.
    d : float
        Between -1 and ½; the Hurst exponent is d + ½.
    ar, ma : float, or sequence of float
        φ₁, …, φ_p and θ₁, …, θ_q, as of `ARMA`.

    See Also
    --------
    ARMA : with d = 0.
    FractionalGaussianNoise : long memory in another way.

    References
    ----------
    J. R. M. Hosking, Fractional differencing, Biometrika 68 (1981).

    Examples
    --------
    >>> from toeplitz_mg.covariances import ARFIMA
    >>> ARFIMA(d=0.3)(3).round(4)
    array([1.3165, 0.5642, 0.4314])
    """

    def __init__(self, sigma2: Any = 1.0, d: Any = 0.25, ar: Any = (), ma: Any = ()) -> None:
        super().__init__(sigma2=sigma2, d=d, ar=ar, ma=ma)

    def _derive(self, lags: Lags, wanted: frozenset[str]) -> tuple[Array, Derivatives]:
        n, (d,) = lags.steps("ARFIMA"), self._values("d")
        return arfima(n, d, self._values("ar"), self._values("ma"), wanted)


def reflections(coefficients: Sequence[float] | Array) -> list[Decimal]:
    """Return the reflection coefficients of 1 + c₁ z + c₂ z² + …, by Schur and Cohn.

    Its roots lie outside the unit circle if all are between -1 and 1; else only the last are found.
    """
    found: list[Decimal] = []
    with localcontext(Context(prec=DIGITS)):
        c = [Decimal(value) for value in coefficients]
        while c and all(abs(r) < 1 for r in found[:1]):
            *c, last = c
            found.insert(0, last)
            if abs(last) < 1:
                c = [(x - last * y) / (1 - last * last) for x, y in zip(c, c[::-1], strict=True)]
    return found


def with_reflections(r: Array) -> tuple[Array, Array]:
    """Return the coefficients c of 1 + c₁ z + c₂ z² + … from `reflections`, and ∂c/∂r."""
    c, slopes = np.empty(0), np.empty((0, len(r)))
    for last, row in zip(r, np.eye(len(r)), strict=True):
        slopes = np.vstack([slopes + last * slopes[::-1] + np.outer(c[::-1], row), row])
        c = np.append(c + last * c[::-1], last)
    return c, slopes


def arma(
    n: int, ar: Sequence[float], ma: Sequence[float], wanted: frozenset[str] = frozenset()
) -> tuple[Array, Derivatives]:
    """Return n covariances of ARMA with innovations of variance 1, and derivatives.

    With the impulse response ψ = θ/φ they are γ_k = Σ φ_j γ_|k-j| + Σ θ_i ψ_(i-k), i ≥ k.
    """
    p, q = len(ar), len(ma)
    size = max(p, q) + 1
    with localcontext(Context(prec=DIGITS)):
        phi = [Decimal(1), *(-Decimal(c) for c in ar)]
        theta = [Decimal(1), *map(Decimal, ma)]
        psi = divide(theta, phi, q + 1)
        series = psi, divide(psi, phi, q + 1), divide([Decimal(1)], phi, q + 1)
        values, by_phi, by_theta = (correlate(theta, x, 2 * size) for x in series)
        right = {"": values[:size]}  # The sums over i, and their derivatives.
        for j in range(1, p + 1):
            right[f"ar.L{j}"] = by_phi[j : j + size].copy()
        for j in range(1, q + 1):
            right[f"ma.L{j}"] = by_theta[j : j + size].copy()
            right[f"ma.L{j}"][: j + 1] += psi[j::-1]
    return solve_even(n, ar, {name: right[name] for name in right if name in {"", *wanted}})


def arfima(
    n: int, d: float, ar: Sequence[float], ma: Sequence[float], wanted: frozenset[str]
) -> tuple[Array, Derivatives]:
    """Return n covariances of ARFIMA with innovations of variance 1, and derivatives.

    Let f be the covariances of fractional differences, and g = θ(B) θ(B⁻¹) f. The covariances γ are
    even and solve φ(B) γ = w, φ(B⁻¹) w = g. The recursion for w runs backwards from the lags m, …,
    m + p, where w is the integral f_k = sin(πd)/π ∫ tᵏ⁺ᵈ⁻¹ (1 - t)⁻²ᵈ dt, 0 < t < 1, with a factor
    θ(t) θ(1/t)/φ(t) of the integrand. The trapezoidal rule in log s, t = exp(-s), evaluates it.
    """
    p, q = len(ar), len(ma)
    m = max(n, p + 1, q + 2)
    f, by_d = fractional_difference(m + p + q + 1, d)
    theta = np.append(1.0, ma)
    s = np.exp(np.arange(log(SHORTEST / m), log(LONGEST / (m - q + d)), STEP))
    weights = STEP * s * np.exp(-(m - q + d) * s) * (-np.expm1(-s)) ** (-2.0 * d)
    by_weights = weights * (cos(pi * d) - sin(pi * d) / pi * (s + 2.0 * np.log(-np.expm1(-s))))
    weights *= sin(pi * d) / pi
    powers = np.exp(-np.arange(p, -1.0, -1.0)[:, np.newaxis] * s)
    t, s = np.append(np.exp(-s), 1.0), np.append(s, 0.0)
    phi = fsum([1.0, *np.negative(ar)]) - sum(c * np.expm1(-j * s) for j, c in enumerate(ar, 1))
    w: Derivatives = {}
    for name in ("", *wanted - {"sigma2"}):
        group, _, j = name.partition(".L")
        g, measure = (by_d, by_weights) if group == "d" else (f, weights)
        taps = np.correlate(np.eye(q + 1)[int(j)] if group == "ma" else theta, theta, "full")
        taps = taps + taps[::-1] if group == "ma" else taps
        factor = np.polyval(taps, t) / phi  # θ(t) θ(1/t)/φ(t) with a power of t, or its derivative.
        factor = factor * t ** int(j) / phi if group == "ar" else factor
        limit = factor[-1] if d > 0.0 else 0.0  # Its integral is known; the rest decays faster.
        first = powers @ (measure * (factor[:-1] - limit)) + limit * g[m + p - q : m - q - 1 : -1]
        drive = np.convolve(np.append(g[q:0:-1], g[: m + q]), taps, "valid")
        drive = w[""][int(j) : int(j) + m] if group == "ar" else drive
        w[name] = recur(first, np.append(np.zeros(p + 1), drive[::-1]), ar)[::-1]
    return solve_even(n, ar, {name: w[name][:m] for name in w})


def solve_even(n: int, ar: Sequence[float], right: Derivatives) -> tuple[Array, Derivatives]:
    """Return γ_k = Σ φ_j γ_|k-j| + right_k, k = 0, …, n - 1, and derivatives.

    p + 1 equations give the first ones, a recursion the others. Derivatives have the same form.
    """
    p, size = len(ar), len(right[""])
    many = max(n, size)
    with localcontext(Context(prec=DIGITS)):
        phi = [Decimal(1), *(-Decimal(c) for c in ar)]
        equations = np.full((p + 1, p + 1), Decimal(0))
        for k, j in np.ndindex(p + 1, p + 1):
            equations[k, abs(k - j)] += phi[j]
        solution = invert(equations)
        first = {name: np.array([*map(Decimal, x[: p + 1].tolist())]) for name, x in right.items()}
        start = solution @ first[""]
        for j in range(1, p + 1):
            if (name := f"ar.L{j}") in first:
                first[name] += start[abs(np.arange(p + 1) - j)]
        first = {name: solution @ first[name] for name in first}

    found: Derivatives = {}
    for name, beginning in right.items():
        drive = np.zeros(many)
        drive[:size] = beginning
        if name.startswith("ar"):
            j = int(name.removeprefix("ar.L"))
            drive[p + 1 :] += found[""][p + 1 - j : many - j]
        found[name] = recur(first[name].astype(float), drive, ar)
    return found.pop("")[:n], {name: found[name][:n] for name in found}


def recur(first: Array, drive: Array, ar: Sequence[float]) -> Array:
    """Continue y by y_k = Σ φ_j y_(k-j) + drive_k after its first p + 1 values."""
    if not ar:
        return drive
    from scipy.signal import lfilter, lfiltic

    phi = np.append(1.0, np.negative(ar))
    state = lfiltic([1.0], phi, first[:0:-1])
    return np.append(first, lfilter([1.0], phi, drive[len(first) :], zi=state)[0])


def divide(x: Sequence[Decimal] | Array, phi: Sequence[Decimal], n: int) -> Array:
    """Return the first n terms of the series x/φ."""
    y = np.full(n, Decimal(0))
    y[: len(x)] = x
    for k in range(n):
        for j in range(1, min(k, len(phi) - 1) + 1):
            y[k] -= phi[j] * y[k - j]
    return y


def correlate(theta: Sequence[Decimal], x: Array, n: int) -> Array:
    """Return Σ_i θ_i x_(i-k), k = 0, …, n - 1."""
    sums = np.full(n, Decimal(0))
    for k in range(len(theta)):
        sums[k] = np.dot(np.array(theta[k:]), x[: len(theta) - k])
    return sums


def invert(matrix: Array) -> Array:
    """Return the inverse of a matrix of decimals, by Gauss-Jordan elimination with pivots."""
    m = len(matrix)
    rows = np.full((m, 2 * m), Decimal(0))
    rows[:, :m], rows[range(m), range(m, 2 * m)] = matrix, Decimal(1)
    for k in range(m):
        pivot = k + int(np.argmax(abs(rows[k:, k])))
        rows[[k, pivot]] = rows[[pivot, k]]
        rows[k] /= rows[k, k]
        others = np.arange(m) != k
        rows[others] -= np.outer(rows[others, k], rows[k])
    return rows[:, m:]
