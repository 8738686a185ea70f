"""Systems of every kind that `solve_toeplitz` takes, of sizes at which it has a choice."""

import warnings
from collections.abc import Callable

import numpy as np
import scipy.linalg
from numpy.lib.stride_tricks import sliding_window_view
from numpy.random import Generator

import toeplitz_mg as tmg
from comparisons.harness.inside import smooth_column
from comparisons.reliability.systems import BACKWARD, ILL
from comparisons.reliability.trials import FAILED, REFUSED, RIGHT, TOLD, Outcome
from comparisons.systems import symbols
from comparisons.systems.random_matrices import log_uniform, random_column
from toeplitz_mg._typing import Array

REGULAR = 1e10  # Condition number up to which no matrix may be refused.
DENSE = 1000  # Most unknowns where that is known: it takes the time of a thousand products.
CHUNK = 500  # Rows at once, of 48 MiB.
LARGEST = 6000  # Unknowns: what is solved by Levinson's recursion takes a tenth of a second.

Line = tuple[Array, Array]  # First column and first row.
Kind = Callable[[Generator, int], Line]


def positive_definite(rng: Generator, n: int) -> Line:
    """Return a symmetric positive definite matrix."""
    _, c = random_column(rng, (n,))
    return c, c


def indefinite(rng: Generator, n: int) -> Line:
    """Return a symmetric matrix less a multiple of the identity that is among its eigenvalues."""
    _, c = random_column(rng, (n,))
    c[0] -= rng.uniform(0.0, 1.0) * np.abs(c).sum()
    return c, c


def decaying(rng: Generator, n: int) -> Line:
    """Return a matrix whose coefficients decay on each side as powers, or as exponentials."""
    k = np.arange(n)
    c, r = (
        (1.0 + k) ** -rng.uniform(0.7, 3.0) * rng.choice([-1.0, 1.0]) ** k
        if rng.random() < 0.5
        else np.exp(-k * rng.uniform(0.001, 1.0)) * np.cos(k * rng.uniform(0.0, 3.0))
        for _ in range(2)
    )
    c = c * rng.uniform(0.2, 2.0)
    c[0] = log_uniform(rng, 0.3, 3.0)
    return c, r * rng.uniform(0.2, 2.0)


def fractional(rng: Generator, n: int) -> Line:
    """Return a two-sided fractional derivative by shifted Grünwald differences, and a part of I."""
    alpha, weight = rng.uniform(1.05, 1.95), rng.uniform(0.0, 1.0)
    return symbols.fractional(alpha, 1.0 - weight, log_uniform(rng, 1e-6, 1.0))(n)


def convolution(rng: Generator, n: int) -> Line:
    """Return a band of random coefficients on a diagonal that dominates it, or does not."""
    c, r = np.zeros((2, n))
    for a in (c, r):
        width = int(rng.integers(1, min(n, 40) + 1))
        a[:width] = rng.standard_normal(width)
    c[0] = rng.uniform(0.1, 1.5) * (np.abs(c[1:]).sum() + np.abs(r[1:]).sum()) + 1e-3
    return c, r


def without_symbol(rng: Generator, n: int) -> Line:
    """Return random coefficients that do not decay."""
    return rng.standard_normal(n), rng.standard_normal(n)


def hermitian(rng: Generator, n: int) -> Line:
    """Return a positive definite matrix with its symbol shifted by a phase, or plane waves."""
    k = np.arange(n)
    if rng.random() < 0.6:
        _, c = random_column(rng, (n,))
        c = c * np.exp(1j * k * rng.uniform(-np.pi, np.pi))
    else:
        c = np.zeros(n, complex)
        for _ in range(rng.integers(1, 6)):
            c += rng.exponential() * np.exp((1j * rng.uniform(-np.pi, np.pi)) * k)
        c[0] += log_uniform(rng, 1e-4, 10.0)
    return c, c.conj()


def complex_decaying(rng: Generator, n: int) -> Line:
    """Return a complex matrix whose coefficients decay on each side."""
    k = np.arange(n)
    c, r = decaying(rng, n)
    turn = np.exp(1j * rng.uniform(-np.pi, np.pi, (2, 1)) * k)
    return c * turn[0] * np.exp(1j * rng.uniform(-3.0, 3.0)), r * turn[1]


def skew_symmetric(rng: Generator, n: int) -> Line:
    """Return a matrix A = -Aᵀ with decaying coefficients; of an even size: others are singular."""
    c, _ = decaying(rng, n + n % 2)
    c[0] = 0.0
    return c, -c


def zero_diagonal(rng: Generator, n: int) -> Line:
    """Return a matrix without a diagonal, with a symbol or without, symmetric or not."""
    c, r = (decaying if rng.random() < 0.5 else without_symbol)(rng, n)
    c[0] = 0.0
    return (c, c) if rng.random() < 0.5 else (c, r)


def circulant(rng: Generator, n: int) -> Line:
    """Return a circulant of random numbers, or a permutation, and little beside it, or nothing."""
    c = rng.standard_normal(n) if rng.random() < 0.5 else np.eye(1, n, int(rng.integers(n)))[0]
    c[0] += rng.choice([0.0, 0.3])
    r = np.concatenate([c[:1], c[:0:-1]])
    return c, r * (1.0 + rng.choice([0.0, 1e-4]) * rng.standard_normal(n))


def every_other(rng: Generator, n: int) -> Line:
    """Return a matrix of odd lags alone: every second leading block is singular, not the whole."""
    c, r = (decaying if rng.random() < 0.5 else without_symbol)(rng, n + n % 2)
    c, r = c * (np.arange(len(c)) % 2), r * (np.arange(len(r)) % 2)
    return (c, c) if rng.random() < 0.5 else (c, r)


def less_a_sample(rng: Generator, n: int) -> Line:
    """Return a symmetric matrix less a sample of its symbol, which so is zero there, or nearly."""
    _, c = random_column(rng, (n,))
    c[0] -= rng.choice(np.fft.rfft(smooth_column(c, c)).real) * rng.choice([1.0, 1.0 - 1e-9])
    return c, c


def complex_symmetric(rng: Generator, n: int) -> Line:
    """Return a complex matrix A = Aᵀ, which is not Hermitian."""
    c, r = decaying(rng, n)
    c = c + 1j * rng.uniform(0.1, 3.0) * r
    return c, c


KINDS: list[Kind] = [
    *(positive_definite, indefinite, decaying, fractional, convolution, without_symbol, hermitian),
    *(complex_decaying, skew_symmetric, circulant, zero_diagonal, every_other, less_a_sample),
    complex_symmetric,
]


def every_kind(rng: Generator) -> Outcome:
    """Try a system of any kind: its backward error is small, or the user is told."""
    kind = KINDS[rng.integers(len(KINDS))]
    n = int(log_uniform(rng, 2.0, LARGEST))
    c, r = kind(rng, n)
    n = len(c)
    columns = int(rng.choice([1, 1, 1, 1, 3]))
    B = rng.standard_normal((n, columns))
    if rng.random() < 0.2:
        B = np.ones((n, columns)) * np.arange(1.0, columns + 1)
    if rng.random() < 0.2:
        B = B + 1j * rng.standard_normal((n, columns))
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        try:
            X, info = tmg.solve_toeplitz((c, r), B, full_output=True)
        except np.linalg.LinAlgError as error:
            is_known = n <= DENSE
            condition = float(np.linalg.cond(scipy.linalg.toeplitz(c, r))) if is_known else np.inf
            verdict = FAILED if condition < REGULAR else REFUSED
            return Outcome(kind.__name__, verdict, f"n = {n}, condition {condition:.0e}: {error}")
    errors = np.linalg.norm(B - scipy.linalg.matmul_toeplitz((c, r), X), axis=0)
    sizes = np.linalg.norm(B, axis=0)
    norm = np.abs(c).sum() + np.abs(r[1:]).sum()
    backward = float((errors / (norm * np.linalg.norm(X, axis=0) + sizes)).max())
    residual = float((errors / sizes).max())
    if residual > ILL and not told:  # It may be rounding of the transforms.
        errors, of_terms = _measure_by_definition(c, r, X, B)
        residual = float((errors / sizes).max())
        if not (c[1:].any() and r[1:].any()):
            # The solution of a triangular system is as exact as each row is, however it grows.
            residual = min(residual, of_terms)
    note = f"n = {n}, {info.method}: residual {residual:.0e}, backward error {backward:.0e}"
    if not backward <= BACKWARD or residual > ILL:
        return Outcome(kind.__name__, TOLD if told else FAILED, note)
    return Outcome(kind.__name__, TOLD if told else RIGHT, note)


def _measure_by_definition(c: Array, r: Array, X: Array, B: Array) -> tuple[Array, float]:
    """Return ‖b - A x‖ of each column, and the largest error of a row over the size of its terms.

    Each entry is from a sum of n terms in long doubles.
    """
    n, lags = len(c), np.concatenate([r[:0:-1], c])
    wide = np.result_type(lags, X, np.longdouble)
    A, x = sliding_window_view(lags, n)[:, ::-1], X.astype(wide)
    R, terms = np.empty(X.shape, wide), np.empty(X.shape, np.longdouble)
    for k in range(0, n, CHUNK):
        rows = A[k : k + CHUNK].astype(wide)
        R[k : k + CHUNK] = B[k : k + CHUNK] - rows @ x
        terms[k : k + CHUNK] = np.abs(B[k : k + CHUNK]) + np.abs(rows) @ np.abs(x)
    errors: Array = np.sqrt(np.square(np.abs(R)).sum(axis=0)).astype(np.float64)
    return errors, float((np.abs(R) / np.where(terms > 0.0, terms, 1.0)).max())
