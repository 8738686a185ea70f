"""Toeplitz matrices by name, of any size.

`COLUMNS` has the first columns of symmetric positive definite ones. `NONSYMMETRIC`, `HERMITIAN` and
`INDEFINITE` have first columns and first rows of others, for `scipy.linalg.toeplitz`.

Those named after a function of θ are the Fourier coefficients of that symbol; θ², |θ|, |θ|^1.5 and
2 - 2 cos θ have a zero at θ = 0, 2 + 2 cos θ at π, and a condition number that grows with n.
"""

from collections.abc import Callable
from functools import partial

import numpy as np
from scipy import fft

from toeplitz_mg._typing import Array
from toeplitz_mg.covariances import FractionalGaussianNoise
from toeplitz_mg.fractional import grunwald_coefficients
from toeplitz_mg.paper.problems import test1

Column = Callable[[int], Array]  # Returns the first column of a length.
Pair = Callable[[int], tuple[Array, Array]]  # Returns the first column and the first row.


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
    "fGn, H = 0.9": FractionalGaussianNoise(hurst=0.9),
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
    "wide Gaussian": lambda n: _of_lags(lambda k: np.exp(-((4 * k / n) ** 2) / 2), 1e-6)(n),
    "sinc": _of_lags(lambda k: np.sinc(k / 3), 1e-6),
}


def column(name: str, n: int) -> Array:
    """Return the first column of the matrix of that name and size."""
    return COLUMNS[name](n)


# Nonsymmetric, with a symbol of winding number 0 --------------------------------------------


def fractional(alpha: float, left: float, diagonal: float = 1e-3) -> Pair:
    """Discretise a fractional diffusion by Grünwald's formula, of such a weight on the left."""

    def pair(n: int) -> tuple[Array, Array]:
        column, row = grunwald_coefficients(alpha, n)
        c, r = left * column + (1 - left) * row, left * row + (1 - left) * column
        c[0] = r[0] = column[0] + diagonal
        return c, r

    return pair


def _of_two_sides(column: Callable[[Array], Array], row: Callable[[Array], Array]) -> Pair:
    def pair(n: int) -> tuple[Array, Array]:
        k = np.arange(n, dtype=float)
        c, r = column(k), row(k)
        r[0] = c[0]
        return c, r

    return pair


NONSYMMETRIC: dict[str, Pair] = {
    "fractional, α = 1.5": fractional(1.5, 0.7),
    "fractional, α = 1.8, one-sided": fractional(1.8, 1.0),
    "(1+k)^-1.1 | ½(1+k)^-2": _of_two_sides(
        lambda k: (1 + k) ** -1.1, lambda k: (1 + k) ** -2.0 / 2
    ),
    "convection-diffusion": lambda n: (_of_band(2.05, -1.3)(n), _of_band(2.05, -0.7)(n)),
    "1/(1+k) | (-1)^k/(1+k)": _of_two_sides(lambda k: 1 / (1 + k), lambda k: (-1.0) ** k / (1 + k)),
    "deconvolution + 0.1": _of_two_sides(
        lambda k: 0.97**k * np.cos(0.3 * k) + 0.1 * (k == 0), lambda k: 0.6**k
    ),
}


def random_pair(n: int) -> tuple[Array, Array]:
    """Return entries without a symbol, whose winding number is not 0."""
    c, r = np.random.default_rng(1).random((2, n))
    r[0] = c[0]
    return c, r


# Hermitian positive definite ----------------------------------------------------------------


def _hermitian(column: Column) -> Pair:
    def pair(n: int) -> tuple[Array, Array]:
        c = column(n).astype(complex)
        c[0] = c[0].real
        return c, c.conj()

    return pair


def _of_real_symbol(f: Callable[[Array], Array]) -> Pair:
    """Take the Fourier coefficients of a real symbol that is not even, from 16 n samples."""

    def column(n: int) -> Array:
        theta = np.pi / (8 * n) * np.arange(16 * n)
        return fft.ifft(f(theta))[:n]

    return _hermitian(column)


def _distance(theta: Array) -> Array:
    """The distance from 1 on the circle."""
    return np.abs(np.angle(np.exp(1j * (theta - 1.0))))


def _plane_waves(k: Array) -> Array:
    waves = ((10.0, 0.3), (5.0, 1.1), (1.0, -2.0))
    return sum((power * np.exp(1j * f * k) for power, f in waves), 1.0 * (k == 0))


def _nonuniform_fourier(n: int) -> Array:
    """The normal equations of nonuniform Fourier sums, c_k = Σ exp(i k t_j)/2n, 2n jittered times.

    By Gaussian gridding to 4 n points (L. Greengard, J.-Y. Lee, SIAM Rev. 46 (2004)).
    """
    jitter = np.random.default_rng(3).uniform(-0.9, 0.9, 2 * n)
    t = np.pi / n * (np.arange(2 * n) + jitter)
    points, reach, width = 4 * n, 12, np.pi / n**2
    nearest = np.round(t * points / (2 * np.pi)).astype(int)
    grid = np.zeros(points)
    for j in nearest + np.arange(-reach, reach + 1)[:, np.newaxis]:
        distance = t - 2 * np.pi / points * j
        np.add.at(grid, j % points, np.exp(-(distance**2) / (4 * width)))
    k = np.arange(n)
    return np.sqrt(np.pi / width) * np.exp(width * k**2) * fft.ifft(grid)[:n] / (2 * n)


HERMITIAN: dict[str, Pair] = {
    "exp(sin θ + cos 3θ)": _of_real_symbol(lambda t: np.exp(np.sin(t) + np.cos(3 * t))),
    "0.99^k, modulated": _hermitian(_of_lags(lambda k: 0.99**k * np.exp(0.7j * k), 0.01)),
    "|θ - 1|": _of_real_symbol(_distance),
    "|θ - 1|^1.5": _of_real_symbol(lambda t: _distance(t) ** 1.5),
    "three plane waves + noise": _hermitian(_of_lags(_plane_waves)),
    "fGn, modulated": _hermitian(lambda n: column("fGn, H = 0.9", n) * np.exp(1j * np.arange(n))),
    "nonuniform Fourier": _hermitian(_nonuniform_fourier),
}


# Symmetric and indefinite -------------------------------------------------------------------


def _shifted(name: str, shift: float) -> Pair:
    """Take a shift off a matrix, scaled so that its diagonal is that of the others."""

    def pair(n: int) -> tuple[Array, Array]:
        c = column(name, n)
        c = c / c[0] if name == "contact" else c.copy()
        c[0] -= shift
        return c, c

    return pair


SHIFTS = {"2 - 2 cos θ": (1.01, 0.1), "|θ|": (1.0,), "contact": (0.3,), "0.9^k": (0.5, 0.06)}
INDEFINITE: dict[str, Pair] = {
    f"{name} - {shift:g}": _shifted(name, shift) for name in SHIFTS for shift in SHIFTS[name]
}
