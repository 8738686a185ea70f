"""Products by transforms: of blocks and of parts of the frequencies, in place, and their norms.

That an operator multiplies as its dense matrix does is said through public names; here is what an
operator has no words for. Small dense matrices are multiplied and factorised by blocks, as LAPACK
does at once.
"""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.linalg import toeplitz

from tests.cases import CASES, dense_of_kernel
from tests.systems import seeded
from toeplitz_mg.engine.arrays.library import NUMPY
from toeplitz_mg.engine.multilevel import MultilevelProduct
from toeplitz_mg.engine.products import ToeplitzProduct
from toeplitz_mg.engine.small_matrices import BLOCK, factorise, multiply
from toeplitz_mg.operators.coefficients import Coefficients

LENGTHS = [100, 1000, 40000]  # By the matrix, by one transform, by one in panels.


# One axis -----------------------------------------------------------------------------------


@pytest.mark.parametrize("dtype", [np.float64, np.complex128])
@pytest.mark.parametrize("n", LENGTHS)
def test_the_result_may_replace_the_vector(n, dtype):
    lags = seeded(2 * n - 1, dtype=dtype)
    product = ToeplitzProduct.of(lags[n - 1 :], lags[n - 1 :: -1], dtype)
    X = seeded(2, n, dtype=dtype)
    expected = product(X)
    out = np.empty_like(X)
    assert product(X, out) is out
    assert_array_equal(out, expected)
    product(X, X)
    assert_array_equal(X, expected)
    if dtype is np.complex128:
        with pytest.raises(TypeError, match="out has dtype float64, but the product is complex"):
            product(X.real, np.empty((2, n)))


@pytest.mark.parametrize("n", [7, 300])
@pytest.mark.parametrize("dtype", [np.float64, np.complex128])
def test_the_bound_of_the_norm_holds_for_general_matrices(n, dtype):
    lags = seeded(2 * n - 1, dtype=dtype)
    product = ToeplitzProduct.of(lags[n - 1 :], lags[n - 1 :: -1], dtype)
    norm = np.linalg.norm(toeplitz(lags[n - 1 :], lags[n - 1 :: -1]), 2)
    assert norm <= product.norm_bound == pytest.approx(product.adjoint().norm_bound)


def test_the_bound_of_the_norm_holds_for_every_circulant():
    """Also where eigenvalues are complex."""
    seen = 0
    for case in CASES:
        if case.kind in ("strang", "chan", "sine", "cosine"):
            product = getattr(case.operator(np.float64), "product", None)
            if product is not None:
                assert np.linalg.norm(case.dense, 2) <= product.norm_bound * (1 + 1e-10)
                seen += np.iscomplexobj(case.dense)
    assert seen > 5


# Several axes and components ----------------------------------------------------------------


def product_of(kernel, dtype):
    blocks = [[None if a is None else Coefficients.of_lags(a) for a in row] for row in kernel]
    return MultilevelProduct.of(NUMPY, blocks, dtype)


@settings(max_examples=40, deadline=None)
@given(
    st.lists(st.integers(1, 12), min_size=1, max_size=4),
    st.integers(1, 3),
    st.sampled_from([np.float32, np.float64, np.complex64, np.complex128]),
    st.integers(0, 99),
)
def test_it_is_the_dense_matrix(shape, components, dtype, seed):
    if np.prod(shape) > 400:
        return
    lags = seeded(components**2, *(2 * n - 1 for n in shape), dtype=dtype, seed=seed)
    kernel = [list(lags[i::components]) for i in range(components)]
    if components > 1:
        kernel[-1][0] = kernel[0][-1] = None
    dense = dense_of_kernel(kernel)
    product = product_of(kernel, dtype)
    X = seeded(3, len(dense), dtype=dtype)
    tolerance = {"atol": 2000 * np.finfo(dtype).eps}
    assert_allclose(product(X), X @ dense.T, **tolerance)
    assert product(X).dtype == dtype
    adjoint = product.adjoint()
    assert_allclose(adjoint(X), X @ dense.conj(), **tolerance)
    assert np.linalg.norm(dense, 2) <= (1 + 1e-6) * product.norm_bound
    assert product.norm_bound == pytest.approx(adjoint.norm_bound)
    expected = product(X)
    assert np.array_equal(product(X, X), expected)  # It works in place.
    assert np.array_equal(X, expected)


@pytest.mark.parametrize("components", [1, 2])
@pytest.mark.parametrize("parts", [1, 2, 5])
def test_frequencies_may_be_multiplied_in_parts(components, parts):
    """As processes do of which each has some of them."""
    shape = (19, 23)
    lags = seeded(components**2, *(2 * n - 1 for n in shape))
    kernel = [list(lags[i::components]) for i in range(components)]
    product = product_of(kernel, np.float64)
    X = seeded(1, components * np.prod(shape), seed=1)
    Z = product.passes.rows_in(X.reshape(1, components, *shape)).copy()
    bounds = [product.lengths[-1] * k // parts for k in range(parts + 1)]
    made = [
        product.passes.columns_through(np.ascontiguousarray(Z[..., start:stop]), start)
        for start, stop in pairwise(bounds)
    ]
    y = product.passes.rows_out(np.concatenate(made, axis=-1), np.empty((1, components, *shape)))
    assert_allclose(y.reshape(1, -1), X @ dense_of_kernel(kernel).T, rtol=0, atol=1e-10)


# Small matrices -----------------------------------------------------------------------------

SIZES = 1, 2, BLOCK - 1, BLOCK, BLOCK + 1, 3 * BLOCK, 3 * BLOCK + 7


def definite(n):
    X = seeded(n, n, seed=n)
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
    A[-1, -1] = -1.0
    with pytest.raises(np.linalg.LinAlgError, match=f"pivot {n - 1} "):
        factorise(A)


@pytest.mark.parametrize("shape", [(1, 1, 1), (7, 7, 50_000), (40, 30, 1), (40, 30, 1000)])
def test_the_product_is_that_of_numpy(shape):
    m, k, n = shape
    A, X = seeded(m, k), seeded(k, n, seed=1)
    assert_allclose(multiply(A, X), A @ X, rtol=0, atol=1e-13 * k * np.abs(A).max())
