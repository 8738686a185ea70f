"""The engine: every product equals its definition, at every length, in any thread."""

import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import scipy.fft
import scipy.sparse.linalg
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.linalg import matmul_toeplitz, toeplitz

import toeplitz_mg as tmg
from tests.cases import CASES
from toeplitz_mg.engine import fourstep
from toeplitz_mg.engine.products import DENSE, ToeplitzProduct
from toeplitz_mg.engine.transforms import LONG
from toeplitz_mg.operators import DiagonalisedOperator
from toeplitz_mg.operators.gohberg_semencul import GohbergSemencul

# On both sides of every change of method, primes, squares, powers of 2.
LENGTHS = [1, 2, 3, DENSE, DENSE + 1, 1021, 4096, LONG - 1, LONG, LONG + 3, 40000, 2**16]


def random(*shape, seed=0):
    return np.random.default_rng(seed).standard_normal(shape)


def lags_of(n, symmetric):
    a = random(2 * n - 1)
    return a + a[::-1] if symmetric else a


def product_of(lags, dtype):
    n = (len(lags) + 1) // 2
    column, row = lags[n - 1 :], lags[n - 1 :: -1]
    return ToeplitzProduct.of(column, column if np.array_equal(column, row) else row, dtype)


def definition(lags, X):
    n = (len(lags) + 1) // 2
    return matmul_toeplitz((lags[n - 1 :], lags[n - 1 :: -1]), X.T).T


@pytest.mark.parametrize("symmetric", [True, False])
@pytest.mark.parametrize("n", LENGTHS)
def test_products_equal_their_definition_to_rounding(n, symmetric):
    lags, X = lags_of(n, symmetric), random(3, n, seed=1)
    product = product_of(lags, np.float64)
    exact = definition(lags, X)
    assert np.abs(product(X) - exact).max() <= 1e-14 * np.abs(exact).max()
    single = product_of(lags, np.float32)(X.astype(np.float32))
    assert single.dtype == np.float32
    assert np.abs(single - exact).max() <= 4e-6 * np.abs(exact).max()
    transposed = product.adjoint()
    exact = definition(lags[::-1], X)
    assert np.abs(transposed(X) - exact).max() <= 1e-14 * np.abs(exact).max()
    assert_allclose(transposed.adjoint()(X), product(X), rtol=0, atol=1e-14 * np.abs(exact).max())


@pytest.mark.parametrize("hermitian", [True, False])
@pytest.mark.parametrize("n", LENGTHS)
def test_complex_products_equal_their_definition_to_rounding(n, hermitian):
    lags = random(2 * n - 1) + 1j * random(2 * n - 1, seed=2)
    lags = lags + lags[::-1].conj() if hermitian else lags
    X = random(3, n, seed=1) + 1j * random(3, n, seed=3)
    product = product_of(lags, np.complex128)
    adjoint = product.adjoint()
    for of, a in ((product, lags), (adjoint, lags[::-1].conj())):
        for x in (X, X.real):
            exact = definition(a, x)
            assert np.abs(of(x) - exact).max() <= 2e-14 * np.abs(exact).max()
    exact = definition(lags, X)
    single = product_of(lags, np.complex64)(X.astype(np.complex64))
    assert single.dtype == np.complex64
    assert np.abs(single - exact).max() <= 4e-6 * np.abs(exact).max()
    assert np.array_equal(product.astype(np.complex64)(X.astype(np.complex64)), single)
    Y = X.copy()
    assert np.array_equal(product(Y, Y), product(X))  # It works in place.
    with pytest.raises(TypeError, match="out has dtype float64, but the product is complex"):
        product(X.real, np.empty((3, n)))


def test_complex_products_have_a_bound():
    for n in (7, 300):
        lags = random(2 * n - 1) + 1j * random(2 * n - 1, seed=2)
        product = product_of(lags, np.complex128)
        norm = np.linalg.norm(toeplitz(lags[n - 1 :], lags[n - 1 :: -1]), 2)
        assert norm <= product.norm_bound == pytest.approx(product.adjoint().norm_bound)


@pytest.mark.parametrize("n", [DENSE, 1000, 40000])
def test_the_result_may_replace_the_vector(n):
    product = product_of(lags_of(n, True), np.float64)
    X = random(2, n)
    expected = product(X)
    out = np.empty_like(X)
    assert product(X, out) is out
    assert_allclose(out, expected, rtol=1e-14)
    product(X, X)
    assert_allclose(X, expected, rtol=1e-14)


@pytest.mark.parametrize("n", [DENSE, 1000, 40000])
def test_precision_is_that_of_the_matrix_and_dtype_that_of_numpy(n):
    x = random(n)
    for matrix, vector, result in (
        (np.float32, np.float64, np.float64),
        (np.float64, np.float32, np.float64),
        (np.float32, np.complex64, np.complex64),
    ):
        A = product_of(lags_of(n, True), matrix)
        y = A(x.astype(vector))
        assert y.dtype == result
        assert_allclose(y, definition(lags_of(n, True), x), atol=1e-6 * np.abs(y).max() * n**0.5)


@settings(deadline=None)
@given(st.integers(1, 30), st.integers(1, 30), st.sampled_from([0.0, 0.25, 0.5]))
def test_four_steps_are_one_transform(rows, columns, shift):
    # Several panels and blocks, the last one partial.
    plan = fourstep.FourStep(rows, columns, np.complex128, width=8, height=3)
    L = plan.length
    x = random(L) + 1j * random(L, seed=1)
    u = plan.weights(shift)

    def load(part, P):
        np.multiply(x.reshape(rows, columns)[:, part], u, out=P)

    spectrum = plan.spectrum(load, shift)
    j = np.arange(L)
    exact = np.exp(-2j * np.pi * np.outer(j + shift, j) / L) @ x  # Row k is the frequency k + s.
    assert_allclose(spectrum.T.ravel(), exact, atol=1e-13 * L)
    y = np.empty((rows, columns), complex)

    def store(part, Q):
        y[:, part] = (u * Q).conj()

    twice = [(shift, plan.eigenvalues(np.full(plan.shape, 2.0)))] * 2
    plan.multiply(load, twice, store)
    assert_allclose(y.ravel(), 4 * x, atol=1e-13 * L)


@pytest.mark.parametrize("n", [100, LONG, LONG + 1, 2**16, 49000])
def test_gohberg_semencul_of_long_vectors(n):
    rho = 0.9  # The inverse of ρ^|i-j| is tridiagonal.
    x = np.zeros(n)
    x[:2] = np.array([1.0, -rho]) / (1 - rho**2)
    V = random(2, n)
    expected = (1 + rho**2) * V
    expected[:, [0, -1]] = V[:, [0, -1]]
    expected[:, 1:] -= rho * V[:, :-1]
    expected[:, :-1] -= rho * V[:, 1:]
    assert_allclose(GohbergSemencul(x).apply(V), expected / (1 - rho**2), atol=1e-12)
    single = GohbergSemencul(x.astype(np.float32)).apply(V.astype(np.float32))
    assert_allclose(single, expected / (1 - rho**2), atol=1e-3)


# They are 1, 5, 7 and 9 short of a fast length.
@pytest.mark.parametrize("n", [67, 534, 785, 1601])
def test_gohberg_semencul_at_slow_lengths(n):
    c = (1.0 + np.arange(n)) ** -1.1
    inverse = np.linalg.inv(toeplitz(c))
    V = random(3, n)
    G = GohbergSemencul(inverse[0])
    assert_allclose(G.apply(V), V @ inverse, atol=1e-12)
    with tmg.count_products() as work:
        G.apply(V[0])
    assert work.units(n) <= 2.05


@pytest.mark.parametrize("n", [700, 40000])
def test_one_operator_in_many_threads(n):
    A = tmg.ToeplitzOperator(1.0 / (1.0 + np.arange(n)))
    M = tmg.spectral_preconditioner(A)
    X = random(8, n)
    expected = [M @ (A @ x) for x in X]
    with ThreadPoolExecutor(4) as pool:
        for _ in range(3):
            results = list(pool.map(lambda x: M @ (A @ x), X))
            assert all(np.array_equal(a, b) for a, b in zip(results, expected, strict=True))


@pytest.mark.parametrize("n", [700, 2**17, 150001])
def test_a_product_by_several_threads(n):
    A = tmg.ToeplitzOperator(1.0 / (1.0 + np.arange(n)))
    M = tmg.spectral_preconditioner(A)
    C = tmg.ToeplitzOperator(np.exp(1j * np.arange(n)) / (1.0 + np.arange(n)))
    x = random(n)
    expected = [B @ x for B in (A, M, C)]
    with scipy.fft.set_workers(3):
        for B, y in zip((A, M, C), expected, strict=True):
            assert_allclose(B @ x, y, rtol=0, atol=1e-13 * np.abs(y).max())


def test_operators_pickle():
    for n in (5, 1000, 40000):
        A = tmg.ToeplitzOperator(1.0 / (1.0 + np.arange(n)))
        x = random(n)
        assert np.array_equal(pickle.loads(pickle.dumps(A)) @ x, A @ x)


def test_a_product_maps_no_new_memory():
    resource = pytest.importorskip("resource")
    n = 2**18
    product = product_of(lags_of(n, True), np.float64)
    x, out = random(n), np.empty(n)
    product(x, out)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(4):
        product(x, out)
    pages = resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before
    assert pages <= 100  # A page has 4 kB; the vectors have 512 pages each.


@pytest.mark.parametrize("n", [LONG, 2**20, 10**6 + 3, 2**24])
def test_the_tables_are_small(n):
    plan = fourstep.four_step(n, np.complex128)
    assert n <= plan.length <= 1.02 * n
    tables = fourstep._twiddles(*plan.shape, plan.height, 0.25, plan.dtype)
    assert sum(t.nbytes for t in tables) + plan.weights(0.25).nbytes <= 2**20


@pytest.mark.parametrize("n", [2**17, 2**18, 2**20, 10**6 + 3, 2**24])
def test_neighbours_in_a_column_of_a_panel_are_an_odd_number_of_cache_lines_apart(n):
    plan = fourstep.four_step(n, np.complex128)
    assert plan.width * plan.dtype.itemsize // 64 % 2 == 1
    assert plan.width % 4 == 0


def test_a_dense_matrix_is_the_matrix():
    c = random(7)
    assert_allclose(tmg.ToeplitzOperator(c) @ np.eye(7), toeplitz(c), rtol=1e-15)


@pytest.mark.parametrize("n", [7, 300, 3000])
@pytest.mark.parametrize("size", [1e-300, 1e-60, 1e-30, 1e30, 1e60, 1e300])
@pytest.mark.parametrize("is_complex", [False, True])
def test_a_matrix_in_single_precision_takes_vectors_of_any_size_in_double(n, size, is_complex):
    k = np.arange(n)
    c = (0.9**k * np.exp(1j * k)).astype("F") if is_complex else (0.9**k).astype("f")
    A = tmg.ToeplitzOperator(c)
    x = np.random.default_rng(0).standard_normal((3, n)) * (1.0 + 1j if is_complex else 1.0)
    x[1] = 0.0
    expected = A.apply(x)
    assert_allclose(A.apply(size * x) / size, expected, atol=1e-5 * np.abs(expected).max())
    assert np.isnan(A.apply(np.full((1, n), np.nan))).all()


@pytest.mark.parametrize(
    "make", [tmg.chan_preconditioner, tmg.cosine_preconditioner, tmg.fsai_preconditioner]
)
def test_scipy_may_iterate_in_double_precision_on_any_size(make):
    A, b = tmg.ToeplitzOperator(1.0 / (1.0 + np.arange(700))), np.ones(700)
    M = make(A, dtype=np.float32)
    x, info = scipy.sparse.linalg.cg(A, 1e-40 * b, M=M, rtol=1e-8)
    assert info == 0
    assert np.linalg.norm(b - A @ (1e40 * x)) <= 1e-7 * np.linalg.norm(b)


def test_the_bound_of_the_norm_holds_for_every_circulant():
    """Also where eigenvalues are complex."""
    seen = 0
    for case in CASES:
        if not case.name.startswith(("strang", "chan", "sine", "cosine")):
            continue
        A = case.operator(np.float64)
        if isinstance(A, DiagonalisedOperator):
            assert np.linalg.norm(case.dense, 2) <= A.product.norm_bound * (1 + 1e-10)
            seen += np.iscomplexobj(case.dense)
    assert seen > 5
