"""Operations with vectors, part by part, and the steps of conjugate gradients."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from toeplitz_mg.engine.conjugate_gradients import ConjugateGradients
from toeplitz_mg.engine.vectors import PART, axpy, combine, dot, dots, norm

SHAPES = [(1,), (3, 4, 5), (PART,), (PART + 1,), (2, PART, 3)]


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_sums_over_all_parts(shape, dtype):
    X = np.random.default_rng(0).random((3, *shape)).astype(dtype)
    flat = X.reshape(3, -1).astype(np.float64)
    rtol = 1e-6 if dtype == np.float32 else 1e-12
    assert_allclose(dot(X[0], X[1]), flat[0] @ flat[1], rtol=rtol)
    assert_allclose(dots(X, X[2]), flat @ flat[2], rtol=rtol)
    assert_allclose(norm(X[0]), np.linalg.norm(flat[0]), rtol=rtol)
    assert_allclose(combine(np.arange(3.0), X), X[1] + 2.0 * X[2], rtol=rtol)
    assert combine(np.arange(3.0), X).dtype == dtype


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_an_update_changes_one_vector_in_place(shape, dtype):
    x, y = np.random.default_rng(0).random((2, *shape)).astype(dtype)
    x0, y0 = x.copy(), y.copy()
    axpy(0.5, x, y)
    assert_allclose(y, y0 + 0.5 * x0, rtol=1e-6)
    assert np.array_equal(x, x0)
    x = np.asfortranarray(x)
    axpy(-0.5, x, y)
    assert_allclose(y, y0, atol=1e-6)


def test_what_cannot_be_changed_in_place_is_refused():
    with pytest.raises(ValueError, match="y is not C-contiguous"):
        axpy(1.0, np.ones((2, 3)), np.asfortranarray(np.ones((2, 3))))
    with pytest.raises(ValueError, match="y is not C-contiguous"):
        axpy(1.0, np.ones(3), np.ones(6)[::2])


@pytest.mark.parametrize("size", [1e-250, 1e250])
@pytest.mark.parametrize("n", [5, PART + 5])
def test_no_square_over_or_underflows_in_a_norm(n, size):
    x = np.full(n, size)
    assert_allclose(norm(x), np.sqrt(n) * size)
    assert_allclose(norm(1j * x), np.sqrt(n) * size)


def test_steps_lead_to_the_solution_and_leave_the_residual_alone():
    rng = np.random.default_rng(0)
    X = rng.standard_normal((12, 12))
    A, M = X @ X.T + np.eye(12), np.diag(rng.uniform(0.5, 2.0, 12))
    x, b = np.zeros((3, 4)), rng.standard_normal((3, 4))
    iteration = ConjugateGradients(
        lambda d, out: (A @ d.ravel()).reshape(3, 4), lambda r, out: (M @ r.ravel()).reshape(3, 4)
    )
    r = b.copy()
    for _ in range(12):
        before = r.copy()
        length = iteration.step(r)
        assert np.array_equal(r, before)
        x += length * iteration.direction
        r -= length * iteration.product
        assert_allclose(r.ravel(), b.ravel() - A @ x.ravel(), atol=1e-9)
    assert_allclose(x.ravel(), np.linalg.solve(A, b.ravel()), rtol=1e-6)


@pytest.mark.parametrize("bad", [-1.0, 0.0, np.nan, np.inf])
def test_a_step_has_no_length_where_a_matrix_is_not_positive_definite(bad):
    r = np.ones(3)
    of_A = ConjugateGradients(lambda d, out: bad * d, lambda r, out: r)
    assert of_A.step(r) == 0.0
    assert_allclose(of_A.curvature, 3 * bad)
    of_M = ConjugateGradients(lambda d, out: d, lambda r, out: bad * r)
    assert of_M.step(r) == 0.0
    assert_allclose(of_M.rho, 3 * bad)
