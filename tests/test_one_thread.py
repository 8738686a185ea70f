"""Products and factors of small matrices, without the threads of BLAS."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from toeplitz_mg.engine.one_thread import BLOCK, factorise, multiply

SIZES = 1, 2, BLOCK - 1, BLOCK, BLOCK + 1, 3 * BLOCK, 3 * BLOCK + 7


def definite(n):
    X = np.random.default_rng(n).standard_normal((n, n))
    return X @ X.T + np.eye(n)


@pytest.mark.parametrize("n", SIZES)
def test_the_factor_is_that_of_lapack(n):
    A = definite(n)
    before = A.copy()
    U = factorise(A)
    assert_array_equal(U, np.triu(U))
    assert_allclose(U.T @ U, A, rtol=0, atol=1e-12 * np.abs(A).max())
    assert_allclose(U, np.linalg.cholesky(A).T, rtol=0, atol=1e-9 * np.abs(U).max())
    assert_array_equal(A, before)


@pytest.mark.parametrize("n", SIZES)
def test_a_matrix_that_is_not_definite_has_none(n):
    A = definite(n)
    A[-1, -1] = -1.0
    with pytest.raises(np.linalg.LinAlgError, match=f"pivot {n - 1} "):
        factorise(A)


@pytest.mark.parametrize("shape", [(1, 1, 1), (7, 7, 50_000), (40, 30, 1), (40, 30, 1000)])
def test_the_product_is_that_of_numpy(shape):
    m, k, n = shape
    rng = np.random.default_rng(0)
    A, X = rng.standard_normal((m, k)), rng.standard_normal((k, n))
    assert_allclose(multiply(A, X), A @ X, rtol=0, atol=1e-13 * k * np.abs(A).max())
