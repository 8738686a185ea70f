"""The Fourier domain: the matrix, its samples and the circulants there are what they say."""

import numpy as np
import pytest
import scipy.linalg
from numpy.testing import assert_allclose

import toeplitz_mg as tmg
from toeplitz_mg.preconditioners.circulant import chan_eigenvalues, smooth_eigenvalues
from toeplitz_mg.solvers.fourier_form import LARGEST, FourierForm, has_fourier_form

SIZES = [2, 4, 6, 250, 512]
DTYPES = [np.float64, np.complex128]


def random(dtype, *shape):
    rng = np.random.default_rng([11, *shape])
    x = rng.standard_normal(shape)
    return x + 1j * rng.standard_normal(shape) if np.dtype(dtype).kind == "c" else x


def make(dtype, n):
    c, r = random(dtype, 2, n)
    r[0] = c[0]
    return FourierForm(c, r), scipy.linalg.toeplitz(c, r)


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("n", SIZES)
def test_the_transform_is_unitary(dtype, n):
    form, _ = make(dtype, n)
    X = random(dtype, 3, n)
    Z = form.transform(X)
    assert Z.shape == X.shape
    assert Z.dtype == X.dtype
    assert_allclose(form.transform_back(Z), X, atol=1e-13)
    assert_allclose(Z.conj() @ Z.T, X.conj() @ X.T, atol=1e-12 * n)
    assert_allclose(form.transform(X[0]), Z[0], atol=1e-13)


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("n", SIZES)
def test_the_products_are_those_of_the_matrix(dtype, n):
    form, A = make(dtype, n)
    X = random(dtype, 3, n)
    tolerance = 1e-13 * np.linalg.norm(A, 1)
    assert_allclose(form.multiply(X), X @ A.T, atol=tolerance)
    assert_allclose(form.multiply(X[0]), A @ X[0], atol=tolerance)
    Z = form.transform(X[0])
    before = Z.copy()
    Y = form.A.apply(Z)
    assert_allclose(form.transform_back(Y), A @ X[0], atol=tolerance)
    assert_allclose(Z, before, rtol=0, atol=0)
    # It may be written into the vector that is multiplied.
    assert form.A.apply(Z, Z) is Z
    assert_allclose(Z, Y, rtol=0, atol=0)


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("n", SIZES)
def test_the_samples_are_those_of_a_circulant_which_it_inverts(dtype, n):
    form, A = make(dtype, n)
    operator = tmg.ToeplitzOperator(A[:, 0], A[0])
    samples, means = smooth_eigenvalues(operator), chan_eigenvalues(operator)
    assert_allclose(form.samples, samples, atol=1e-12 * np.abs(samples).max())
    assert_allclose(form.means(), means, atol=1e-12 * np.abs(means).max())
    # The lags k and k - n of the circulant have weights whose sum is one.
    w = 0.5 + 0.5 * np.cos(np.pi * np.arange(n) / n)
    column = w * A[:, 0] + np.r_[0.0, (1 - w[1:]) * A[0, :0:-1]]
    C = scipy.linalg.circulant(column)
    b = random(dtype, n)
    Z = form.transform(C @ b)
    x = form.transform_back(form.inverse(form.samples).apply(Z, Z))
    assert_allclose(x, b, atol=1e-12 * np.linalg.cond(C))


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("n", SIZES)
def test_single_precision_is_the_same_but_for_rounding(dtype, n):
    form, _ = make(dtype, n)
    M = form.inverse(form.samples)
    X = random(dtype, 3, n)
    of_single = np.complex64 if np.dtype(dtype).kind == "c" else np.float32
    for operator, single in (
        (form.A, form.in_single_precision().A),
        (M, M.in_single_precision()),
    ):
        Y, Z = operator.apply(X), single.apply(X.astype(of_single))
        assert single.dtype == Z.dtype == of_single
        assert_allclose(Z, Y, atol=1e-5 * np.abs(Y).max() * np.log2(n))


def test_a_circulant_with_an_eigenvalue_of_zero_is_refused():
    form, _ = make(np.float64, 6)
    with pytest.raises(np.linalg.LinAlgError, match="eigenvalue"):
        form.inverse(np.array([1.0, 0.0, 1.0, 1.0]) + 0j)


def test_sizes_that_are_odd_slow_or_long_have_no_form():
    assert has_fourier_form(512)
    assert not has_fourier_form(511)
    assert not has_fourier_form(2 * 1021)
    assert not has_fourier_form(2 * LARGEST)
