"""A product with a line equals its definition, at every length, in any thread and precision."""

import numpy as np
import pytest
import scipy.sparse.linalg
from numpy.testing import assert_allclose
from scipy.linalg import matmul_toeplitz, toeplitz

import toeplitz_mg as tmg
from tests.systems import seeded

# On both sides of every change of method, primes, squares, powers of 2.
LENGTHS = [1, 2, 3, 256, 257, 1021, 4096, 2**15 - 1, 2**15, 2**15 + 3, 40000, 2**16]


def definition(lags, X):
    n = len(X)
    return matmul_toeplitz((lags[n - 1 :], lags[n - 1 :: -1]), X)


def assert_near(actual, exact, rounding):
    assert np.abs(actual - exact).max() <= rounding * np.abs(exact).max()


@pytest.mark.parametrize(("double", "single"), [("d", "f"), ("D", "F")])
@pytest.mark.parametrize("hermitian", [True, False])
@pytest.mark.parametrize("n", LENGTHS)
def test_products_equal_their_definition_to_rounding(n, hermitian, double, single):
    lags, X = seeded(2 * n - 1, dtype=double), seeded(n, 3, dtype=double, seed=1)
    lags = lags + lags[::-1].conj() if hermitian else lags
    A = tmg.ToeplitzOperator.from_lags(lags)
    for of, a in ((A, lags), (A.H, lags[::-1].conj()), (A.T, lags[::-1])):
        for x in (X, X.real):
            assert_near(of @ x, definition(a, x), 1e-14 if double == "d" else 2e-14)
    y = A.astype(single) @ X.astype(single)
    assert y.dtype == single
    assert_near(y, definition(lags, X), 4e-6)


@pytest.mark.parametrize("n", [256, 1000, 40000])
def test_precision_is_that_of_the_matrix_and_dtype_that_of_numpy(n):
    x, c = seeded(n), seeded(n, seed=1)
    exact = definition(np.r_[c[:0:-1], c], x)
    for matrix, vector, result in (
        (np.float32, np.float64, np.float64),
        (np.float64, np.float32, np.float64),
        (np.float32, np.complex64, np.complex64),
    ):
        y = tmg.ToeplitzOperator(c.astype(matrix)) @ x.astype(vector)
        assert y.dtype == result
        assert_allclose(y, exact, atol=1e-6 * np.abs(y).max() * n**0.5)


@pytest.mark.parametrize("n", [100, 2**15, 2**15 + 1, 49000])
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_the_inverse_of_an_exponential_is_tridiagonal(n, dtype):
    rho = 0.9
    V = seeded(n, 2).astype(dtype)
    expected = (1 + rho**2) * V
    expected[[0, -1]] = V[[0, -1]]
    expected[1:] -= rho * V[:-1]
    expected[:-1] -= rho * V[1:]
    inverse = tmg.toeplitz_inverse(tmg.ToeplitzOperator((rho ** np.arange(n)).astype(dtype)))
    atol = 1e-10 if dtype is np.float64 else 1e-3
    assert_allclose(inverse @ V, expected / (1 - rho**2), atol=atol)


# They are 1, 5, 7 and 9 short of a fast length.
@pytest.mark.parametrize("n", [67, 534, 785, 1601])
def test_an_inverse_takes_two_products_at_slow_lengths_too(n):
    c = (1.0 + np.arange(n)) ** -1.1
    V = seeded(n, 3)
    inverse = tmg.toeplitz_inverse(tmg.ToeplitzOperator(c))
    assert_allclose(inverse @ V, np.linalg.solve(toeplitz(c), V), atol=1e-11)
    with tmg.count_products() as work:
        inverse @ V[:, 0]
    assert work.units(n) <= 2.05


def test_a_product_maps_no_new_memory_but_for_its_result():
    resource = pytest.importorskip("resource")
    A, x = tmg.ToeplitzOperator(seeded(2**18)), seeded(2**18)
    A @ x
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(4):
        A @ x
    pages = resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before
    assert pages <= 4 * 512 + 100  # A page has 4 kB; the vectors have 512 pages each.


@pytest.mark.parametrize("n", [7, 300, 3000])
@pytest.mark.parametrize("size", [1e-300, 1e-60, 1e-30, 1e30, 1e60, 1e300])
@pytest.mark.parametrize("is_complex", [False, True])
def test_a_matrix_in_single_precision_takes_vectors_of_any_size_in_double(n, size, is_complex):
    k = np.arange(n)
    c = (0.9**k * np.exp(1j * k)).astype("F") if is_complex else (0.9**k).astype("f")
    A = tmg.ToeplitzOperator(c)
    x = seeded(n, 3) * (1.0 + 1j if is_complex else 1.0)
    x[:, 1] = 0.0
    expected = A @ x
    assert_allclose(A @ (size * x) / size, expected, atol=1e-5 * np.abs(expected).max())
    assert np.isnan(A @ np.full(n, np.nan)).all()


@pytest.mark.parametrize(
    "make", [tmg.chan_preconditioner, tmg.cosine_preconditioner, tmg.fsai_preconditioner]
)
def test_scipy_may_iterate_in_double_precision_on_any_size(make):
    A, b = tmg.ToeplitzOperator(1.0 / (1.0 + np.arange(700))), np.ones(700)
    M = make(A, dtype=np.float32)
    x, info = scipy.sparse.linalg.cg(A, 1e-40 * b, M=M, rtol=1e-8)
    assert info == 0
    assert np.linalg.norm(b - A @ (1e40 * x)) <= 1e-7 * np.linalg.norm(b)
