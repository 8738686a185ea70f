"""What tests of systems share: random numbers, first columns, and a residual by SciPy."""

import numpy as np
import scipy.linalg
from scipy import fft


def random(*shape):
    """Numbers that depend on the shape alone, and not on which tests a process has run before."""
    return np.random.default_rng([3, *shape]).standard_normal(shape)


def residual(c_or_cr, x, b):
    """Return ‖b - A x‖/‖b‖, the largest of all columns."""
    left = b - scipy.linalg.matmul_toeplitz(c_or_cr, x)
    return (np.linalg.norm(left, axis=0) / np.linalg.norm(b, axis=0)).max()


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
