"""Rectangular Toeplitz matrices, convolutions and least squares, against dense definitions."""

import pickle

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import LinAlgWarning, hankel, matmul_toeplitz, toeplitz
from scipy.signal import convolve, lfilter
from scipy.sparse import eye_array
from scipy.sparse.linalg import eigsh, lsmr, lsqr, svds

import toeplitz_mg as tmg
from tests.systems import seeded

MODES = "full", "same", "valid"
FIELDS = (((300,), (17,)), ((9,), (40,)), ((40, 31), (5, 8)), ((8, 7, 9), (3, 2, 4)))
CONVOLUTIONS = [
    (shape, size, mode, dtype)
    for shape, size in FIELDS
    for mode in MODES
    for dtype in (np.float32, np.float64, np.complex128)
    if mode != "valid" or size <= shape
]


def kernel(size, dtype):
    h = seeded(*size)
    return (h + 1j * seeded(*size, seed=1) if np.dtype(dtype).kind == "c" else h).astype(dtype)


@pytest.mark.parametrize(("shape", "size", "mode", "dtype"), CONVOLUTIONS)
def test_convolution_is_that_of_scipy_and_linear(shape, size, mode, dtype):
    h, x = kernel(size, dtype), seeded(*shape).astype(np.dtype(dtype).char.lower())
    A = tmg.ToeplitzOperator.convolution(h, shape, mode)
    expected = convolve(x, h, "full" if mode == "same" else mode, method="direct")
    if mode == "same":
        middle = zip(shape, size, strict=True)
        expected = expected[tuple(slice((p - 1) // 2, (p - 1) // 2 + n) for n, p in middle)]
    y, dense = A @ x.ravel(), A.toarray()
    assert y.dtype == np.result_type(A.dtype, x)
    scale = np.abs(dense).sum(axis=1).max()
    bound = 200 * np.finfo(dtype).eps * scale
    assert_allclose(y, expected.ravel(), rtol=0, atol=bound)
    assert_allclose(dense @ x.ravel(), expected.ravel(), rtol=0, atol=bound)
    Y = np.stack([y, y[::-1]], axis=1)
    for B, D in ((A.H, dense.conj().T), (A.T, dense.T), (2 * A.H - A.H / 2, 1.5 * dense.conj().T)):
        assert_allclose(pickle.loads(pickle.dumps(B)) @ Y, D @ Y, rtol=0, atol=10 * bound * scale)
    assert_allclose(y @ A, y @ dense, rtol=0, atol=10 * bound * scale)
    assert A[1, 2] == dense[1, 2]
    assert_allclose(A.diagonal(), dense.diagonal())


@pytest.mark.parametrize(("shape", "size", "mode", "dtype"), CONVOLUTIONS)
def test_normal_equations_are_dense_and_toeplitz_where_they_say_so(shape, size, mode, dtype):
    A = tmg.ToeplitzOperator.convolution(kernel(size, dtype), shape, mode)
    G = 2 * (A.H @ A) + 3 * eye_array(A.shape[1])
    dense = 2 * A.toarray().conj().T @ A.toarray() + 3 * np.eye(A.shape[1])
    X = seeded(A.shape[1], 2).astype(np.dtype(dtype).char.lower())
    bound = 500 * np.finfo(dtype).eps * np.abs(dense).sum(axis=1).max()
    assert_allclose(G @ X, dense @ X, rtol=0, atol=bound)
    assert_allclose(G.H @ X, dense @ X, rtol=0, atol=bound)
    stands_for = tmg.ToeplitzOperator.from_lags(G.lags).toarray()
    assert G.is_toeplitz == (mode == "full")
    if G.is_toeplitz:
        assert_allclose(stands_for, dense, rtol=0, atol=bound)
    else:  # The rows that are missing add a positive semidefinite matrix.
        assert np.linalg.eigvalsh(stands_for - dense).min() > -bound


def test_first_column_and_row_of_different_lengths():
    c, r = seeded(7), seeded(4)
    A = tmg.ToeplitzOperator(c, r)
    assert A.shape == (7, 4)
    assert_allclose(A.toarray(), toeplitz(c, r))
    B = tmg.ToeplitzOperator.from_lags(A.lags, A.shape)
    assert_allclose((A + B).toarray(), 2 * A.toarray())
    assert A.astype(np.float32).dtype == np.float32


@pytest.mark.parametrize("c", [(50,), (3, 1), (2, 3, 40)])
@pytest.mark.parametrize("x", [(40,), (40, 1), (40, 5), (3, 40, 2)])
def test_matmul_is_dense_with_batches_too(c, x):
    c, X = seeded(*c), seeded(*x)
    r = seeded(*c.shape[:-1], 40)
    columns = X[:, np.newaxis] if X.ndim == 1 else X
    batch = np.broadcast_shapes(c.shape[:-1], columns.shape[:-2])
    of = np.vectorize(toeplitz, signature="(m),(n)->(m,n)")
    expected = np.broadcast_to(of(c, r), (*batch, c.shape[-1], 40)) @ columns
    expected = expected[..., 0] if X.ndim == 1 else expected
    actual = tmg.matmul_toeplitz((c, r), X)
    assert actual.shape == expected.shape
    assert_allclose(actual, expected, rtol=0, atol=1e-12)
    if batch == ():
        assert_allclose(actual, matmul_toeplitz((c, r), X), rtol=0, atol=1e-12)


PROBLEMS = ["line", "least norm", "filter", "covariance method", "same", "image", "wide", "motion"]
PROBLEMS += ["complex"]


@pytest.mark.parametrize("shape", [(7, 7), (40, 9), ((3, 4), (5, 2)), ((4, 5), (4, 5))])
@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.complex128])
def test_hankel_is_dense_and_linear(shape, dtype):
    rows, columns = ((n,) if isinstance(n, int) else n for n in shape)
    h = kernel([m + n - 1 for m, n in zip(rows, columns, strict=True)], dtype)
    H = tmg.HankelOperator.from_values(h, shape)
    i, j = (np.indices(grid).reshape(len(grid), -1) for grid in (rows, columns))
    dense = h[tuple(i[:, :, np.newaxis] + j[:, np.newaxis])]
    assert_allclose(H.toarray(), dense)
    assert_allclose(H.diagonal(), dense.diagonal())
    assert H.is_symmetric == bool(dense.shape[0] == dense.shape[1] and (dense == dense.T).all())
    bound = 500 * np.finfo(dtype).eps * np.abs(dense).sum()
    X, Y = seeded(H.shape[1], 3), seeded(H.shape[0], 3)
    assert_allclose(pickle.loads(pickle.dumps(2 * H - H / 2)) @ X, 1.5 * dense @ X, atol=bound)
    assert_allclose(H.H @ Y, dense.conj().T @ Y, rtol=0, atol=bound)
    assert_allclose(H.T @ Y, dense.T @ Y, rtol=0, atol=bound)


def test_toeplitz_plus_hankel_is_solved_and_has_eigenvalues():
    c, h = 0.5 ** np.arange(200.0), 0.1 * 0.9 ** np.arange(399.0)
    T, H = tmg.ToeplitzOperator(c), tmg.HankelOperator.from_values(h, (200, 200))
    dense = toeplitz(c) + hankel(h[:200], h[199:])
    b = seeded(200)
    x, info = tmg.cg(T + H, b, M=tmg.default_preconditioner(T), rtol=1e-12)
    assert info == 0
    assert_allclose(x, np.linalg.solve(dense, b), rtol=0, atol=1e-9)
    x, info = tmg.gmres(T + H, b, rtol=1e-12)
    assert info == 0
    assert_allclose(x, np.linalg.solve(dense, b), rtol=0, atol=1e-9)
    largest = np.linalg.eigvalsh(dense)[-3:]
    assert_allclose(np.sort(eigsh(T + H, 3)[0]), largest, rtol=1e-9)
    assert_allclose(np.sort(svds(H, 2)[1])[-1], np.linalg.norm(hankel(h[:200], h[199:]), 2))


def problem(name):
    """Return a matrix and a right-hand side."""
    gaussian = np.exp(-0.5 * (np.arange(-6, 7) / 2.0) ** 2)
    motion = np.eye(7)
    motion[2, 4] = 0.5
    h, shape, mode = {
        "line": (seeded(20), (300,), "full"),
        "least norm": (0.5 ** np.arange(9.0), (60,), "valid"),
        "filter": (seeded(400), (30,), "full"),
        "covariance method": (seeded(400), (30,), "valid"),
        "same": (0.9 ** np.arange(30.0), (300,), "same"),
        "image": (np.outer(gaussian, gaussian), (24, 20), "same"),
        "wide": (np.outer(gaussian, gaussian), (24, 20), "valid"),
        "motion": (motion, (24, 20), "same"),
        "complex": (seeded(20) + 1j * seeded(20, seed=2), (200,), "same"),
    }[name]
    if name == "covariance method":  # The columns are the filter, and the rows those of data alone.
        A = tmg.ToeplitzOperator.from_lags(h, (371, 30))
    else:
        A = tmg.ToeplitzOperator.convolution(h, shape, mode)
    return A, seeded(A.shape[0])


@pytest.mark.parametrize("damp", [0.0, 0.1])
@pytest.mark.parametrize("name", PROBLEMS)
def test_least_squares_are_those_of_a_dense_solve(name, damp):
    A, b = problem(name)
    if damp == 0.0 and name in ("image", "wide"):
        damp = 1e-3  # A Gaussian alone is singular to rounding.
    dense, n = A.toarray(), A.shape[1]
    stacked = np.concatenate([dense, damp * np.eye(n)]) if damp else dense
    expected = np.linalg.lstsq(stacked, np.concatenate([b, np.zeros(n if damp else 0)]))[0]
    x, info = tmg.toeplitz_lstsq(A, b, damp, rtol=1e-11, full_output=True)
    assert info.error <= 1e-11
    bound = 1e-9 * max(1.0, np.linalg.cond(stacked)) * np.linalg.norm(expected)
    assert np.linalg.norm(x - expected) <= bound
    assert_allclose(info.residual, np.linalg.norm(dense @ x - b), rtol=1e-6, atol=1e-11)
    X = tmg.toeplitz_lstsq(A, np.stack([b, 2 * b], axis=1), damp, rtol=1e-11)
    assert_allclose(X[:, 1], 2 * x, rtol=0, atol=bound)


@pytest.mark.parametrize(("of_A", "of_b"), [(1e-200, 1e-220), (1e200, 1e180), (1.0, 1e-290)])
def test_least_squares_of_any_size(of_A, of_b):
    c, r, b = np.array([2.0, 1.0, 0.5, 0.0, 0.0]), np.array([2.0, 0.0, 0.0]), seeded(5)
    expected = tmg.toeplitz_lstsq((c, r), b, 0.1)
    x = tmg.toeplitz_lstsq((of_A * c, of_A * r), of_b * b, 0.1 * of_A)
    assert_allclose(x / (of_b / of_A), expected, rtol=1e-9)
    with pytest.raises(np.linalg.LinAlgError, match="x is beyond the largest float64"):
        tmg.toeplitz_lstsq((1e-200 * c, 1e-200 * r), 1e200 * b)
    assert not tmg.toeplitz_lstsq((0 * c, 0 * r), b).any()


def test_an_ill_conditioned_filter_keeps_the_digits_of_a_dense_solve():
    """Normal equations alone would lose twice as many."""
    signal = lfilter([1.0], np.poly([0.98] * 3), seeded(3000))
    A = tmg.ToeplitzOperator.from_lags(signal / np.abs(signal).max(), (2971, 30))
    taps, dense = seeded(30), A.toarray()
    condition = np.linalg.cond(dense)
    assert condition > 1e5
    x = tmg.toeplitz_lstsq(A, dense @ taps, rtol=1e-13)
    assert np.linalg.norm(x - taps) <= 1e-12 * condition * np.linalg.norm(taps)


def test_lsqr_with_a_right_preconditioner_solves_the_damped_problem():
    A, b = problem("image")
    M = tmg.cosine_preconditioner(A.H @ A + 0.01 * eye_array(A.shape[1]))
    K = tmg.RightPreconditioned(A, M, damp=0.1)
    expected = tmg.toeplitz_lstsq(A, b, 0.1, rtol=1e-12)
    for solver in (lsqr, lsmr):
        y, _, steps, *_ = solver(K, K.extend(b), atol=1e-12, btol=1e-12)
        assert_allclose(K.solution(y), expected, rtol=0, atol=1e-8 * np.abs(expected).max())
        assert steps < solver(A, b, damp=0.1, atol=1e-12, btol=1e-12)[2]


def test_least_squares_that_cannot_be_had_are_warned_of():
    A = tmg.ToeplitzOperator.convolution(np.exp(-0.5 * (np.arange(-9, 10) / 3.0) ** 2), 200, "same")
    with pytest.warns(LinAlgWarning, match="use a larger damp, rtol or maxiter"):
        _, info = tmg.toeplitz_lstsq(A, seeded(200), maxiter=3, full_output=True)
    assert info.iterations == 3


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda A: tmg.toeplitz_lstsq(np.eye(3), np.ones(3)), "must be a Toeplitz matrix"),
        (lambda A: tmg.toeplitz_lstsq(A, np.ones(3)), r"must have the 4 rows of A"),
        (lambda A: tmg.toeplitz_lstsq(A, np.ones(4), -1.0), "damp is -1.0, but must not be neg"),
        (lambda A: tmg.toeplitz_lstsq(A, np.full(4, np.nan)), "not finite"),
        (lambda A: tmg.toeplitz_lstsq(A, np.ones(4), rtol=0.0), "rtol is 0.0, but must be pos"),
        (lambda A: tmg.ToeplitzOperator.from_lags(np.ones(4), (2, 2)), "odd"),
        (lambda A: tmg.ToeplitzOperator.from_lags(np.ones(4), (3, 4)), r"must have \(6,\)"),
        (lambda A: tmg.ToeplitzOperator.convolution([1.0], 3, "all"), "mode is 'all'"),
        (lambda A: tmg.ToeplitzOperator.convolution(np.ones(4), 3, "valid"), "no larger than"),
        (lambda A: tmg.matmul_toeplitz(([1.0], [1.0, 2.0]), [1.0]), "must have 2 rows: the matrix"),
        (lambda A: tmg.RightPreconditioned(A, tmg.jacobi_preconditioner(A.H @ A)), "square root"),
    ],
)
def test_what_is_wrong_is_named(call, message):
    with pytest.raises((TypeError, ValueError), match=message):
        call(tmg.ToeplitzOperator(np.ones(4), np.ones(2)))
