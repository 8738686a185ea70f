"""A long transform in four steps, by panels and blocks of any size, is the transform.

Its lengths are fast, and hardly longer than they must be.
"""

import numpy as np
import pytest
import scipy.fft
from numpy.testing import assert_allclose
from scipy.fft import next_fast_len

from toeplitz_mg.engine.fourstep import FourStep
from toeplitz_mg.engine.lengths import embedding_lengths, near_fast_length, near_square

# Rows and columns, width of a panel and height of a block; even and odd, whole blocks or not.
PLANS = [(6, 8, 3, 4), (8, 6, 8, 8), (8, 5, 2, 3), (7, 9, 4, 2), (2, 7, 7, 1), (90, 6, 4, 1)]
each_plan = pytest.mark.parametrize("sizes", PLANS)


def plan(rows, columns, width, height):
    return FourStep(rows, columns, np.complex128, width=width, height=height)


def fourier(length, shift):
    """The matrix of the transform at the frequencies k + s."""
    k = np.arange(length)
    return np.exp(-2j * np.pi * np.outer(k + shift, k) / length)


def close(x, y):
    assert_allclose(x, y, rtol=0, atol=1e-10)


@each_plan
@pytest.mark.parametrize("shift", [0.0, 0.25, 0.5, -0.5])
def test_a_spectrum_is_the_transform_and_its_parts_are_the_vector(sizes, shift):
    panels = plan(*sizes)
    x, y = np.random.default_rng(0).standard_normal((2, panels.length))
    F = fourier(panels.length, shift)
    spectrum = panels.spectrum(x, y, shift).copy()
    close(panels.in_order(spectrum), F @ (x + 1j * y))
    for part, expected in zip(panels.parts(spectrum, shift), (x, y), strict=True):
        close(part, expected)
    close(panels.in_order(panels.spectrum(x, None, shift)), F @ x)


@each_plan
@pytest.mark.parametrize("is_complex", [False, True])
@pytest.mark.parametrize("shifts", [(0.0,), (0.5, 0.0), (0.25, 0.5, 0.0), (0.5, 0.25, -0.5, 0.0)])
def test_products_in_turn_are_those_of_the_matrices(sizes, is_complex, shifts):
    panels = plan(*sizes)
    L, rng = panels.length, np.random.default_rng(0)
    x, factors = rng.standard_normal((2, L)), []
    if is_complex:
        x = x + 1j * rng.standard_normal((2, L))
    expected = x
    for shift in shifts:
        first = rng.standard_normal((2, L)) / np.sqrt(L)
        F = fourier(L, shift)
        expected = (F.conj().T @ ((F @ (first[0] + 1j * first[1]))[:, None] * (F @ expected.T))).T
        expected = expected / L
        factors.append(((shift,), [panels.eigenvalues(panels.spectrum(*first, shift))]))
    out = np.empty_like(x)
    panels.multiply(x, factors, out)
    close(out, expected if is_complex else expected.real)


@each_plan
@pytest.mark.parametrize("missing", [0, 1, 6, 13])
def test_products_with_vectors_that_are_shorter(sizes, missing):
    """They are extended by zeros, and what comes out is cut."""
    panels = plan(*sizes)
    L, rng = panels.length, np.random.default_rng(0)
    n, first = L - missing, rng.standard_normal((3, L))
    matrices, eigenvalues = [], []
    for shift, column in zip((0.25, 0.0, 0.5), first, strict=True):
        F = fourier(L, shift)
        matrices.append((F.conj().T @ ((F @ column)[:, None] * F) / L)[:n, :n])
        eigenvalues.append(panels.eigenvalues(panels.spectrum(column, None, shift)))
    x, y = rng.standard_normal((2, 2, n))
    out = np.empty_like(x)
    panels.multiply(x, [((0.25,), eigenvalues[:1])], out)
    close(out, (x @ matrices[0].T).real)
    z, out = x + 1j * y, np.empty((2, n), np.complex128)
    panels.multiply(z, [((0.0, 0.5), eigenvalues[1:])], out)
    close(out, z @ (matrices[1] + matrices[2]).T)


def test_rounding_neither_grows_with_the_blocks_nor_depends_on_who_does_them():
    """Factors of a block are made from those before, whichever a thread has begun with."""
    panels = FourStep(2**11, 2**8, np.complex128, height=1)
    x = np.random.default_rng(0).standard_normal(panels.length)
    found = panels.spectrum(x, None, 0.0).copy()
    exact = scipy.fft.fft(x)
    assert np.abs(panels.in_order(found) - exact).max() <= 1e-14 * np.abs(exact).max()
    for workers in (2, 3):
        with scipy.fft.set_workers(workers):
            assert np.array_equal(panels.spectrum(x, None, 0.0), found)


@pytest.mark.parametrize("n", [2**17, 2**18, 2**20, 10**6 + 3, 2**24])
def test_a_plan_is_hardly_longer_and_its_panels_use_all_of_the_cache(n):
    """Neighbours in a column of a panel are an odd number of cache lines apart."""
    plan = FourStep(*near_square(n), np.complex128)
    assert n <= plan.length <= 1.02 * n
    assert plan.weights(0.25).nbytes <= 2**20
    assert plan.width * plan.dtype.itemsize // 64 % 2 == 1
    assert plan.width % 4 == 0


# Lengths ------------------------------------------------------------------------------------


def largest_prime_factor(n):
    p = 2
    while p * p <= n:
        if n % p:
            p += 1
        else:
            n //= p
    return n


def test_a_near_fast_length_is_the_next_without_a_prime_factor_above_61():
    for n in [*range(1, 700), 4093, 65537, 10**6 + 3]:
        m = near_fast_length(n)
        assert n <= m <= 1.06 * n
        assert largest_prime_factor(m) <= 61
        assert all(largest_prime_factor(k) > 61 for k in range(n, m))


@pytest.mark.parametrize("grid_shape", [(1,), (7, 1), (101, 64), (13, 4093, 33)], ids=str)
def test_all_axes_but_the_last_are_extended_by_zeros(grid_shape):
    *others, last = zip(grid_shape, embedding_lengths(grid_shape), strict=True)
    assert last[1] >= last[0]
    assert all(length >= 2 * n - 1 for n, length in others)
    assert all(next_fast_len(length) == length for _, length in (*others, last))


@pytest.mark.parametrize("length", [1, 2, 1000, 2**15, 99991, 10**6 + 3, 2**24])
def test_two_near_factors_are_fast_and_hardly_longer(length):
    rows, columns = near_square(length)
    assert length <= rows * columns <= max(1.02 * length, length + 1)
    assert all(next_fast_len(n) == n for n in (rows, columns))
    assert max(rows, columns) <= 5 * min(rows, columns) + 1
