"""Symmetric positive definite Toeplitz matrices by name: their first columns, of any length.

Those named after a function of θ are the Fourier coefficients of that symbol; θ², |θ|, |θ|^1.5 and
2 - 2 cos θ have a zero at θ = 0, 2 + 2 cos θ at π, and a condition number that grows with n.
"""

from collections.abc import Callable
from functools import partial

import numpy as np
from scipy import fft

from toeplitz_mg._typing import Array
from toeplitz_mg.paper.problems import test1

Column = Callable[[int], Array]  # Returns the first column of a length.


def fourier(f: Callable[[Array], Array], n: int) -> Array:
    """Return the first n Fourier coefficients of an even symbol, from 16 n samples."""
    theta = np.pi / (8 * n) * np.arange(8 * n + 1)  # The other half is the same.
    return fft.irfft(f(theta), 16 * n)[:n]


def _of_symbol(f: Callable[[Array], Array]) -> Column:
    return partial(fourier, f)


def _of_lags(a: Callable[[Array], Array], nugget: float = 0.0) -> Column:
    def column(n: int) -> Array:
        c = a(np.arange(n, dtype=float))
        c[0] += nugget
        return c

    return column


def _of_band(*coefficients: float) -> Column:
    def column(n: int) -> Array:
        c = np.zeros(max(n, len(coefficients)))
        c[: len(coefficients)] = coefficients
        return c[:n]

    return column


def _theta_squared(n: int) -> Array:
    k = np.arange(1.0, n)
    return np.concatenate([[np.pi**2 / 3], 2 * np.where(k % 2, -1.0, 1.0) / k**2])


def _matern(k: Array) -> Array:
    r = np.sqrt(3.0) * k / 50
    return (1 + r) * np.exp(-r)


def _wide_gaussian(n: int) -> Array:
    return _of_lags(lambda k: np.exp(-((4 * k / n) ** 2) / 2), 1e-6)(n)


def _fractional_gaussian_noise(k: Array) -> Array:
    H = 0.9
    return ((k + 1) ** (2 * H) - 2 * k ** (2 * H) + abs(k - 1) ** (2 * H)) / 2


def _contact(n: int) -> Array:
    problem = test1(n)
    return problem.A.c * problem.material.G


COLUMNS: dict[str, Column] = {
    "θ⁴ + 1": _of_symbol(lambda t: t**4 + 1),
    "|θ|³ + 0.01": _of_symbol(lambda t: t**3 + 0.01),
    "(1+k)^-1.1": _of_lags(lambda k: (1 + k) ** -1.1),
    "cos k/(k+1)": _of_lags(lambda k: np.cos(k) / (k + 1)),
    "0.9^k": _of_lags(lambda k: 0.9**k),
    "exp(-k/1000)": _of_lags(lambda k: np.exp(-k / 1000)),
    "Matérn 3/2": _of_lags(_matern, 1e-8),
    "Gaussian": _of_lags(lambda k: np.exp(-((k / 10) ** 2) / 2), 1e-4),
    "fGn, H = 0.9": _of_lags(_fractional_gaussian_noise),
    "contact": _contact,
    "|θ|": _of_symbol(lambda t: t),
    "|θ|^1.5": _of_symbol(lambda t: t**1.5),
    "θ²": _theta_squared,
    "2 - 2 cos θ": _of_band(2.0, -1.0),
    "2 + 2 cos θ": _of_band(2.0, 1.0),
    "|θ|³": _of_symbol(lambda t: t**3),
    "θ⁴": _of_symbol(lambda t: t**4),
    # The plain recipes find the next ones hard.
    "(2 - 2 cos θ)²": _of_band(6.0, -4.0, 1.0),
    "1/(1 + k²/100)": _of_lags(lambda k: 1 / (1 + k**2 / 100), 1e-6),
    "wide Gaussian": _wide_gaussian,
    "sinc": _of_lags(lambda k: np.sinc(k / 3), 1e-6),
}


def column(name: str, n: int) -> Array:
    """Return the first column of the matrix of that name and size."""
    return COLUMNS[name](n)
