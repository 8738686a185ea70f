"""What holds for every operator: it is its dense matrix, and a linear operator of SciPy."""

import inspect
import pickle

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.sparse.linalg import LinearOperator

import toeplitz_mg as tmg
from tests import cases
from tests.cases import PAIRS
from tests.systems import seeded


# Each pair is built once: pytest runs all laws of one pair before it goes on to the next.
@pytest.fixture(params=PAIRS, scope="module")
def case(request):
    return request.param


@pytest.fixture(scope="module")
def A(case):
    return case.operator(np.float64)


@pytest.fixture(scope="module")
def dense(case):
    return case.dense


def test_all_that_is_public_is_among_the_cases():
    kinds = ("Operator", "_preconditioner", "_inverse", "multigrid")
    builders = {name for name in tmg.__all__ if name.endswith(kinds)}
    builders.remove("select_preconditioner")  # It says what is taken, and is no operator.
    builders.remove("HankelOperator")  # It may be rectangular: `test_rectangular`.
    source = inspect.getsource(cases)
    assert len(builders) >= 17
    assert {name for name in builders if f"tmg.{name}" not in source} == set()


def assert_near(actual, expected, dtype=np.float64):
    """Check that arrays are equal up to rounding, relative to the largest entry."""
    scale = np.abs(expected).max(initial=1e-300)
    assert actual.shape == expected.shape
    assert_allclose(actual / scale, expected / scale, rtol=0, atol=2e3 * np.finfo(dtype).eps)


def test_equals_its_dense_matrix_in_both_precisions(case, A, dense):
    for dtype, B in ((np.float64, A), (np.float32, case.operator(np.float32))):
        X = seeded(A.shape[1], 3, dtype=dtype)
        assert isinstance(B, LinearOperator)
        assert B.shape == dense.shape
        assert B.dtype == (np.result_type(dtype, np.complex64) if np.iscomplexobj(dense) else dtype)
        for x in (X, X[:, :1], X[:, 0], X * X.dtype.type(2) + 1j * X[::-1]):
            y = B @ x
            assert y.dtype == np.result_type(x, B.dtype)
            assert_near(y, dense @ x, dtype)


def test_adjoint_and_transpose(A, dense):
    U, V = seeded(A.shape[1], 2, dtype=A.dtype), seeded(A.shape[0], 2, dtype=A.dtype, seed=1)
    adjoint = dense.conj().T
    assert_near(A.H @ V, adjoint @ V)
    assert_near(A.T @ V[:, 0], dense.T @ V[:, 0])
    assert_near(A.rmatvec(V[:, 0]), adjoint @ V[:, 0])
    assert_near(V.T @ A, V.T @ dense)
    assert_near(A.H.H @ U, dense @ U)
    assert_near(A.T.T @ U, dense @ U)
    assert_near(A.T.H @ U, dense.conj() @ U)
    assert_near(A.H.T @ U, dense.conj() @ U)
    assert_near(A.conjugate() @ U, dense.conj() @ U)
    for u, v in zip(U.T, V.T, strict=True):
        atol = 1e-11 * abs(dense).max() * len(u)
        assert_allclose(np.vdot(A @ u, v), np.vdot(u, A.H @ v), atol=atol)


@pytest.mark.parametrize("name", ["cgne", "cgnr"])
@pytest.mark.parametrize("turn", [0.0, 0.3])
def test_pyamg_solves_the_normal_equations(turn, name):
    krylov = pytest.importorskip("pyamg.krylov")
    k = np.arange(60)
    A = tmg.ToeplitzOperator(0.5**k * (np.exp(1j * turn * k) if turn else 1.0), 0.3**k)
    b = seeded(60, 1, dtype=A.dtype)[:, 0]
    x, _ = getattr(krylov, name)(A, b, tol=1e-10)
    assert np.linalg.norm(b - A @ x) <= 1e-8 * np.linalg.norm(b)


def test_is_symmetric_and_positive_definite_as_the_case_says(case, A, dense):
    matrix = A @ np.eye(A.shape[0])
    if case.symmetric:
        assert A.H is A
        assert_near(matrix, matrix.conj().T)
    else:
        lopsided = abs(dense - dense.conj().T).max() > 1e-6 * abs(dense).max()
        # Deflation, P M, may be symmetric by chance, where there are few unknowns or one subdomain.
        assert lopsided or A.shape == (1, 1) or case.kind == "fft_sd"
    if case.positive:
        assert np.linalg.eigvalsh((matrix + matrix.conj().T) / 2).min() > 0.0


def test_linear_and_composed(A, dense):
    x, y = (seeded(A.shape[1], dtype=A.dtype, seed=seed) for seed in (0, 1))
    assert_near(A @ (2.0 * x - 3.0 * y), 2.0 * (dense @ x) - 3.0 * (dense @ y))
    assert_near((2 * A) @ x, 2 * dense @ x)
    assert_near((A @ A) @ x, dense @ dense @ x)
    assert_near((A + A.H) @ x, (dense + dense.conj().T) @ x)
    assert_near((-A) @ x, -dense @ x)
    assert_near((A**2) @ x, dense @ dense @ x)


def test_vectors_of_any_kind(A, dense):
    """Complex, integer and strided ones; rows and stacks, as SciPy hands them on since 1.18."""
    n = A.shape[1]
    z = seeded(n) + 1j * seeded(n, seed=1)
    assert_near(A @ z, dense @ z)
    integers = np.arange(n) - 3
    assert_near(A @ integers, dense @ integers.astype(float))
    wide = seeded(n, 6)
    assert_near(A @ wide[:, ::2], dense @ wide[:, ::2])
    assert_near(A @ wide[::-1, 1], dense @ wide[::-1, 1])
    assert (A @ wide[:, :0]).shape == (n, 0)
    rows = seeded(2, 3, n)
    assert_near(A._matvec(rows), rows @ dense.T)
    assert_near(A._matmat(rows.mT), dense @ rows.mT)
    assert_near(A.H._matvec(rows), rows @ dense.conj())


def test_entries_are_those_of_the_dense_matrix(A, dense):
    """Of those operators that have them at hand: the matrices themselves, and M."""
    if not hasattr(getattr(A, "full", A), "entries"):
        with pytest.raises(TypeError):
            A[0, 0]
        return
    n, size = len(dense), abs(dense).max()
    for i, j in ((0, 0), (-1, 0), (n // 2, n - 1), (np.int64(0), -n)):
        assert A[i, j].shape == ()
        assert_allclose(A[i, j], dense[i, j], rtol=0, atol=1e-12 * size)
    for part in (np.s_[:, 0], np.s_[-1, ::-2], np.s_[1:, :3], np.s_[:, :]):
        assert A[part].shape == dense[part].shape
        assert_allclose(A[part], dense[part], rtol=0, atol=1e-12 * size)
    assert_allclose(A.diagonal(), dense.diagonal(), rtol=0, atol=1e-12 * size)
    assert_allclose(A.trace(), dense.trace(), rtol=0, atol=1e-12 * n * size)
    for wrong in ((n, 0), (0, -n - 1), 0, (0, 0, 0), (0.5, 0), (None, 0)):
        with pytest.raises(IndexError, match="but must"):
            A[wrong]
    with pytest.raises(TypeError, match="not iterable"):
        iter(A)


def test_is_a_value(A):
    """It leaves its argument alone, returns what may be changed, pickles, and prints in a line."""
    x = seeded(A.shape[1])
    before, first = x.copy(), A @ x
    x.flags.writeable = False
    y = A @ x
    y += 1.0
    assert np.array_equal(x, before)
    assert np.array_equal(A @ x, first)
    assert np.array_equal(pickle.loads(pickle.dumps(A)) @ x, first)
    with pytest.raises(ValueError, match=r"[Dd]imension mismatch"):
        A @ np.ones(A.shape[1] + 1)
    assert repr(A).startswith("<")
    assert "\n" not in repr(A)
