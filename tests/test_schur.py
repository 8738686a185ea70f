"""The superfast generalised Schur algorithm: A⁻¹ e₁ of any positive definite Toeplitz matrix."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.linalg import toeplitz

import toeplitz_mg as tmg
from comparisons.systems.symbols import COLUMNS, HERMITIAN, column
from toeplitz_mg.preconditioners.schur import schur_column, whiten_rows

SLOW = pytest.mark.slow  # The condition number of a dense matrix takes nearly all the time.


def levinson(c):
    """Levinson's recursion as in any textbook: the predictor and the Schur parameters."""
    a, error, gamma = np.ones(1), c[0].real, []
    for m in range(len(c) - 1):
        gamma.append(-(a @ c[m + 1 : 0 : -1]) / error)
        a = np.append(a, 0.0) + gamma[-1] * np.append(0.0, a[::-1].conj())
        error *= 1.0 - abs(gamma[-1]) ** 2
    return a / error, np.array(gamma)


@pytest.mark.parametrize("n", [1, 2, 3, 33, 64, 65, 211, 600, pytest.param(1009, marks=SLOW)])
@pytest.mark.parametrize("turn", [0.0, 1.0])
@pytest.mark.parametrize("name", COLUMNS)
def test_is_levinsons_recursion(name, turn, n):
    """Of a real matrix, and of a Hermitian one, whose symbol is turned by one radian."""
    c = np.array([2.0, 0.5])[:n] if n < 3 else column(name, n)
    eigenvalues = np.linalg.eigvalsh(toeplitz(c))  # The turn does not change them.
    condition = eigenvalues[-1] / abs(eigenvalues[0])
    if turn:
        c = c * np.exp(1j * turn * np.arange(n))
    x, gamma = schur_column(c)
    x_levinson, gamma_levinson = levinson(c)
    assert_allclose(x, x_levinson, atol=1e-14 * condition * abs(x_levinson).max(), rtol=1e-13)
    assert_allclose(gamma, gamma_levinson, atol=max(1e-13, 1e-15 * condition))
    unit = np.eye(1, n)[0]
    scale = abs(c).sum() * np.linalg.norm(x)
    assert np.linalg.norm(toeplitz(c) @ x - unit) <= 1e-13 * scale


def test_the_schur_parameters_give_the_determinant():
    c = column("contact", 700)
    _, gamma = schur_column(c)
    k = np.arange(1, 700)
    log_determinant = 700 * np.log(c[0]) + np.sum((700 - k) * np.log1p(-(gamma**2)))
    assert log_determinant == pytest.approx(np.linalg.slogdet(toeplitz(c))[1], rel=1e-12)


@pytest.mark.parametrize("n", [1, 2, 65, 600])
def test_whitening_of_a_hermitian_matrix(n):
    """The matrix turned by one radian has the factor turned in the same way."""
    turn = np.exp(1j * np.arange(n))
    c = column("contact", n) * turn if n > 2 else np.array([2.0, 0.5])[:n] * turn
    Y = np.random.default_rng(n).standard_normal((3, n)) * turn[::-1]
    factor = np.linalg.cholesky(toeplitz(c))
    assert_allclose(whiten_rows(c, Y), np.linalg.solve(factor, Y.T).T, rtol=0, atol=1e-11)


@settings(deadline=None, max_examples=60)
@given(st.integers(1, 300), st.integers(0, 1000), st.floats(0.05, 1.5))
def test_refuses_what_is_not_positive_definite(n, seed, weight):
    """Some of these matrices are positive definite, some are not; it knows which."""
    c = weight * np.random.default_rng(seed).standard_normal(n) / (1 + np.arange(n))
    c[0] = 1.0
    smallest = np.linalg.eigvalsh(toeplitz(c)).min()
    if smallest > 1e-12:
        schur_column(c)
    elif smallest < -1e-12:
        with pytest.raises(np.linalg.LinAlgError, match="is not positive definite"):
            schur_column(c)


@pytest.mark.parametrize("c", [[0.0], [-1.0, 0.5], [1.0, 1.0], [1.0, 2.0, 3.0, 4.0], [1.0, -2.0]])
def test_refuses_small_ones(c):
    with pytest.raises(np.linalg.LinAlgError, match="positive"):
        schur_column(np.array(c))


@pytest.mark.slow
def test_three_plane_waves_and_noise():
    """No circulant has their eigenvalues: T. Chan's takes CG over 200 iterations."""
    n = 3000
    c = HERMITIAN["three plane waves + noise"](n)[0]
    x, gamma = schur_column(c)
    assert x.dtype == gamma.dtype == np.complex128
    scale = abs(c).sum() * np.linalg.norm(x)
    assert np.linalg.norm(toeplitz(c) @ x - np.eye(1, n)[0]) <= 1e-13 * scale
    k = np.arange(1, n)
    log_determinant = n * np.log(c[0].real) + np.sum((n - k) * np.log1p(-(abs(gamma) ** 2)))
    assert log_determinant == pytest.approx(np.linalg.slogdet(toeplitz(c))[1], rel=1e-9)


def test_takes_the_work_of_some_thirty_products():
    n = 2**18
    with tmg.count_products() as work:
        schur_column(column("2 - 2 cos θ", n))
    assert work.units(n) <= 26.0
