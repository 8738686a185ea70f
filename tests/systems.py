"""What tests of systems share: random numbers, first columns, residuals and iterations."""

import math
from fractions import Fraction
from xml.etree import ElementTree

import numpy as np
import pytest
import scipy.linalg
from scipy import fft

import toeplitz_mg as tmg

PRECONDITIONERS = [
    *(getattr(tmg, name) for name in sorted(tmg.__all__) if name.endswith("_preconditioner")),
    tmg.multigrid,
]
PRECONDITIONERS.remove(tmg.select_preconditioner)  # It says which is taken.


def preconditioners(names):
    """Return the functions for preconditioners, as "fft chan"."""
    return [getattr(tmg, f"{name}_preconditioner") for name in names.split()]


def random(*shape):
    """Numbers that depend on the shape alone, and not on which tests a process has run before."""
    return np.random.default_rng([3, *shape]).standard_normal(shape)


def seeded(*shape, dtype=np.float64, seed=0):
    """Standard normal numbers: with imaginary parts, where the dtype has some."""
    rng = np.random.default_rng(seed)
    x = rng.standard_normal(shape)
    return (x + 1j * rng.standard_normal(shape) if np.dtype(dtype).kind == "c" else x).astype(dtype)


def count_iterations(solver, A, b, rtol=1e-8, **options):
    """Solve, and return the number of iterations: the true residual is what was asked for."""
    residuals = []
    x, info = solver(A, b, rtol=rtol, residuals=residuals, **options)
    assert info == 0
    assert np.linalg.norm(b - A @ x) <= 1.1 * rtol * np.linalg.norm(b)
    return len(residuals) - 1


def refuses(error, match, call, /, *arguments, **options):
    """Check that a call with these arguments raises an error that says this."""
    with pytest.raises(error, match=match):
        call(*arguments, **options)


def cells_of(result):
    """Return names and values that a notebook shows, each of which the summary has too."""
    rows = ElementTree.fromstring(result._repr_html_()).findall("tr")
    cells = {row.find("th").text: row.find("td").text for row in rows}
    assert all(f"  {name:18s}{value}" in result.summary() for name, value in cells.items())
    return cells


def residual(c_or_cr, x, b):
    """Return ‖b - A x‖/‖b‖, the largest of all columns."""
    left = b - scipy.linalg.matmul_toeplitz(c_or_cr, x)
    return (np.linalg.norm(left, axis=0) / np.linalg.norm(b, axis=0)).max()


def in_long_numbers(c):
    """log det A, A⁻¹ e₁ and the reflection coefficients by Levinson's recursion on integers.

    They are numbers of 200 bits.
    """
    unit = 1 << 200
    lags = np.array([int(Fraction(float(lag)) * unit) for lag in c], dtype=object)
    a, error, reflections = np.array([unit], dtype=object), lags[0], []
    determinant = math.log(error / unit)
    for m in range(len(c) - 1):
        gamma = -int(a @ lags[m + 1 : 0 : -1]) // error
        a = np.append(a, 0) + gamma * np.append(0, a[::-1]) // unit
        error -= (gamma * gamma // unit) * error // unit
        determinant += math.log(error / unit)
        reflections.append(-gamma / unit)
    return determinant, (a / error).astype(float), np.array(reflections)


def of_symbol(f):
    """Return the first column of the matrix, of any size, whose symbol is this function of θ."""
    return lambda n: fft.dct(f(np.pi / (8 * n) * np.arange(8 * n + 1)), 1)[:n] / (16 * n)


def autoregressive(*roots):
    """Return covariances of the process whose polynomial has these roots, inside the circle."""
    roots = np.array(roots)[:, np.newaxis]
    return of_symbol(lambda t: abs(np.prod(1.0 - roots * np.exp(1j * t), axis=0)) ** -2.0)


def averaged(order):
    """Return covariances of a moving average of so many more values than one."""
    weights = np.random.default_rng(order).standard_normal(order + 1)
    weights[0] = 2.0 * order + 3.0  # So its roots are far from the circle.
    lags = np.correlate(weights, weights, "full")[order:]
    return lambda n: np.pad(lags, (0, n - order - 1))
