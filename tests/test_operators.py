"""What holds for every operator: it is its dense matrix, and a linear operator of SciPy."""

import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.sparse.linalg import LinearOperator

from tests.cases import CASES

each_case = pytest.mark.parametrize("case", CASES, ids=str)
each_dtype = pytest.mark.parametrize("dtype", [np.float64, np.float32])


def random(*shape, dtype=np.float64, seed=0):
    return np.random.default_rng(seed).standard_normal(shape).astype(dtype)


def assert_near(actual, expected, dtype=np.float64):
    """Equal up to rounding, relative to the largest entry."""
    scale = np.abs(expected).max(initial=1e-300)
    assert actual.shape == expected.shape
    assert_allclose(actual / scale, expected / scale, rtol=0, atol=2e3 * np.finfo(dtype).eps)


@each_dtype
@each_case
def test_equals_its_dense_matrix(case, dtype):
    A, dense = case.operator(dtype), case.dense()
    X = random(A.shape[1], 3, dtype=dtype)
    assert isinstance(A, LinearOperator)
    assert A.shape == dense.shape
    assert A.dtype == dtype
    for x in (X, X[:, :1], X[:, 0]):
        y = A @ x
        assert y.dtype == dtype
        assert_near(y, dense @ x, dtype)


@each_case
def test_adjoint_and_transpose(case):
    A, dense = case.operator(np.float64), case.dense()
    U, V = random(A.shape[1], 2), random(A.shape[0], 2, seed=1)
    assert_near(A.H @ V, dense.T @ V)
    assert_near(A.T @ V[:, 0], dense.T @ V[:, 0])
    assert_near(A.rmatvec(V[:, 0]), dense.T @ V[:, 0])
    assert_near(V.T @ A, V.T @ dense)
    assert_near(A.H.H @ U, dense @ U)
    for u, v in zip(U.T, V.T, strict=True):
        assert_allclose((A @ u) @ v, u @ (A.H @ v), atol=1e-11 * abs(dense).max() * len(u))


@each_case
def test_symmetric_operators_are_their_own_adjoint(case):
    A = case.operator(np.float64)
    if case.symmetric:
        assert A.H is A
        dense = A @ np.eye(A.shape[0])
        assert_near(dense, dense.T)
    else:
        dense = case.dense()
        lopsided = abs(dense - dense.T).max() > 1e-6 * abs(dense).max()
        # P M may be symmetric by chance, where there are few unknowns or one subdomain.
        assert lopsided or A.shape == (1, 1) or case.name.startswith("P M")


@each_case
def test_positive_definite(case):
    if case.positive:
        dense = case.operator(np.float64) @ np.eye(len(case.dense()))
        assert np.linalg.eigvalsh((dense + dense.T) / 2).min() > 0.0


@each_case
def test_linear_and_composed(case):
    A, dense = case.operator(np.float64), case.dense()
    x, y = random(A.shape[1]), random(A.shape[1], seed=1)
    assert_near(A @ (2.0 * x - 3.0 * y), 2.0 * (dense @ x) - 3.0 * (dense @ y))
    assert_near((2 * A) @ x, 2 * dense @ x)
    assert_near((A @ A) @ x, dense @ dense @ x)
    assert_near((A + A.H) @ x, (dense + dense.T) @ x)
    assert_near((-A) @ x, -dense @ x)
    assert_near((A**2) @ x, dense @ dense @ x)


@each_case
def test_complex_integer_and_strided_vectors(case):
    A, dense = case.operator(np.float64), case.dense()
    n = A.shape[1]
    z = random(n) + 1j * random(n, seed=1)
    assert_near(A @ z, dense @ z)
    integers = np.arange(n) - 3
    assert_near(A @ integers, dense @ integers.astype(float))
    wide = random(n, 6)
    assert_near(A @ wide[:, ::2], dense @ wide[:, ::2])
    assert_near(A @ wide[::-1, 1], dense @ wide[::-1, 1])


@each_case
def test_batches(case):
    """Rows of vectors, and stacks of matrices, as SciPy hands them on since 1.18."""
    A, dense = case.operator(np.float64), case.dense()
    rows = random(2, 3, A.shape[1])
    assert_near(A._matvec(rows), rows @ dense.T)
    assert_near(A._matmat(rows.mT), dense @ rows.mT)
    assert_near(A.H._matvec(rows), rows @ dense)


@each_case
def test_leaves_its_argument_alone_and_returns_what_may_be_changed(case):
    A = case.operator(np.float64)
    x = random(A.shape[1])
    before, first = x.copy(), A @ x
    x.flags.writeable = False
    y = A @ x
    y += 1.0
    assert np.array_equal(x, before)
    assert np.array_equal(A @ x, first)


@each_case
def test_pickles(case):
    A = case.operator(np.float64)
    x = random(A.shape[1])
    assert np.array_equal(pickle.loads(pickle.dumps(A)) @ x, A @ x)


@each_case
def test_refuses_vectors_of_another_length(case):
    A = case.operator(np.float64)
    with pytest.raises(ValueError, match=r"[Dd]imension mismatch"):
        A @ np.ones(A.shape[1] + 1)


@each_case
def test_has_a_repr_of_one_line(case):
    text = repr(case.operator(np.float64))
    assert text.startswith("<")
    assert "\n" not in text


def test_many_threads_may_share_an_operator():
    for case in CASES[:: len(CASES) // 20]:
        A = case.operator(np.float64)
        X = random(40, A.shape[1])
        with ThreadPoolExecutor(4) as pool:
            Y = list(pool.map(lambda x, A=A: A @ x, X))
        assert np.array_equal(Y, [A @ x for x in X])
