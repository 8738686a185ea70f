"""A Toeplitz matrix in the domain of a transform: products, entries and inverses are exact there.

Of the cosine transform, for symmetric matrices, the product, the entries and what approximates the
inverse are compared with C A Cᵀ, filled; of the Fourier transform, for all, with F A Fᴴ.
"""

import numpy as np
import pytest
import scipy.linalg
from numpy.testing import assert_allclose
from scipy import fft

import toeplitz_mg as tmg
from comparisons.systems.symbols import column
from tests.budgets import assert_within_budget
from tests.systems import autoregressive, averaged, random, refuses
from toeplitz_mg.preconditioners.circulant import chan_column, smooth_column
from toeplitz_mg.solvers.toeplitz.cosine_cg import CosineSolver
from toeplitz_mg.solvers.toeplitz.cosine_form import CosineForm, choose_points
from toeplitz_mg.solvers.toeplitz.cosine_inverse import ApproximateInverse, LowRankInverse
from toeplitz_mg.solvers.toeplitz.fourier_form import FourierForm

# Lengths that are fast, even and odd, and slow, even and odd.
LENGTHS = [256, 315, 262, 269]
NAMES = ["contact", "fGn, H = 0.9", "|θ|", "θ²", "2 + 2 cos θ", "exp(-k/1000)"]


def transform(m):
    return fft.dct(np.eye(m), axis=0, norm="ortho")


def transformed(form):
    """C A Cᵀ, of the long matrix where the length is slow."""
    C, lags = transform(form.m), fft.dct(form.samples, 1)[: form.m] / (2 * form.m)
    return C @ scipy.linalg.toeplitz(lags) @ C.T


def dense(M, m):
    rows = np.empty((m, m))
    M.apply(np.eye(m), out=rows)
    return rows


@pytest.mark.parametrize("n", LENGTHS)
def test_the_products_are_those_of_the_matrix(n):
    c = random(n)
    form, A, X = CosineForm(c), scipy.linalg.toeplitz(c), random(3, n)
    scale = abs(A).sum(axis=0).max()
    assert_allclose(form.multiply(X), X @ A, atol=1e-13 * scale)
    assert_allclose(form.multiply(X[0]), A @ X[0], atol=1e-13 * scale)
    assert_allclose(form.transform_back(form.transform(X)), X, atol=1e-13)
    Z = form.transform(X)
    Y = form.multiply_transformed(Z, np.empty_like(Z))
    assert_allclose(form.transform_back(Y), X @ A, atol=1e-13 * scale)


@pytest.mark.parametrize("n", LENGTHS)
def test_the_entries_are_those_of_the_transformed_matrix(n):
    form = CosineForm(column("contact", n))
    B = transformed(form)
    numbers = np.array([0, 1, 5, 40, n // 3, n // 2 - 1])
    frequencies = 2 * numbers + [[0], [1]]
    found = form.entries(choose_points(form.m, frequencies))
    for entries, own in zip(found, frequencies, strict=True):
        assert_allclose(entries, B[np.ix_(own, own)], atol=1e-12 * abs(B).max())
    # Even and odd frequencies, and so the even and the odd part of a vector, do not mix.
    assert_allclose(B[::2, 1::2], 0.0, atol=1e-12 * abs(B).max())


@pytest.mark.parametrize("n", LENGTHS)
@pytest.mark.parametrize("parity", [0, 1])
def test_rows_are_those_of_the_transformed_matrix(n, parity):
    form = CosineForm(column("contact", n))
    frequencies = np.array([0, 2, n // 3 // 2 * 2, (n - 2) // 2 * 2]) + parity
    expected = transformed(form)[frequencies]
    expected[np.arange(4), frequencies] = 0.0
    found = form.rows(frequencies)
    assert_allclose(found, expected[:, parity::2], atol=1e-12 * abs(expected).max())


@pytest.mark.parametrize("n", LENGTHS)
@pytest.mark.parametrize("name", NAMES)
def test_the_approximate_inverse_is_positive_definite(name, n):
    form = CosineForm(column(name, n))
    M = dense(ApproximateInverse(form.alternated() if form.has_zero_at_end else form), form.m)
    assert_allclose(M, M.T, rtol=1e-9, atol=1e-12 * abs(M).max())
    assert np.linalg.eigvalsh(M).min() > 0.0


@pytest.mark.parametrize("n", LENGTHS)
def test_for_the_lowest_frequencies_it_is_the_inverse_of_a_block(n):
    form = CosineForm(column("contact", n))
    M, B = dense(ApproximateInverse(form), form.m), transformed(form)
    lowest = np.flatnonzero(M - np.diag(np.diag(M))).max() // form.m + 1
    assert_allclose(M[:lowest, :lowest] @ B[:lowest, :lowest], np.eye(lowest), atol=1e-9)


@pytest.mark.parametrize("n", LENGTHS)
@pytest.mark.parametrize("name", NAMES)
def test_rows_are_solved_together_as_each_alone(name, n):
    c, B = column(name, n), random(2, n)
    A = tmg.ToeplitzOperator(c)
    solver = CosineSolver(CosineForm(c), float(abs(A.lags).sum()))
    X, iterations = solver.solve(B, 1e-8)
    assert_within_budget("short systems in the DCT domain", iterations=iterations)
    assert np.linalg.norm(A.apply(X) - B) <= 1e-7 * np.linalg.norm(B)
    x, of_one = solver.solve(B[0], 1e-8)
    assert of_one <= iterations
    assert_allclose(x, X[0], atol=1e-5 * abs(x).max())


@pytest.mark.parametrize("n", [600, 4096])
@pytest.mark.parametrize("ratio", [0.5, -0.7, 0.9])
def test_lags_that_decay_in_proportion_take_three_iterations(n, ratio):
    """C A Cᵀ differs from the symbol by a matrix of rank two, one of each parity."""
    c, b = ratio ** np.arange(n), random(n)
    x, iterations = CosineSolver(CosineForm(c), float(2.0 * abs(c).sum())).solve(b, 1e-12)
    assert iterations <= 3
    assert np.linalg.norm(scipy.linalg.toeplitz(c) @ x - b) <= 1e-11 * np.linalg.norm(b)


@pytest.mark.parametrize("n", [315, 600])
@pytest.mark.parametrize("roots", [[0.5], [0.5, -0.7], [0.8, 0.3 + 0.4j, 0.3 - 0.4j]])
def test_the_rank_of_an_autoregressive_process_is_its_order(n, roots):
    form = CosineForm(autoregressive(*roots)(n))
    M, inverse = LowRankInverse(form), np.linalg.inv(transformed(form))
    assert M.ranks == 2 * (len(roots),)
    assert_allclose(dense(M, n), inverse, atol=1e-6 * abs(inverse).max())


@pytest.mark.parametrize("n", [315, 600])
@pytest.mark.parametrize("order", [1, 2, 5])
def test_the_rank_of_a_moving_average_is_its_order_at_most(n, order):
    M = LowRankInverse(CosineForm(averaged(order)(n)))
    assert max(M.ranks) <= order
    rows = dense(M, n)
    assert_allclose(rows, rows.T, atol=1e-12 * abs(rows).max())
    assert np.linalg.eigvalsh(rows).min() > 0.0


def test_what_has_no_such_form_is_refused():
    refuses(np.linalg.LinAlgError, "low rank", LowRankInverse, CosineForm(averaged(60)(4096)))
    n = 512
    for c in (column("sinc", n), np.cos(np.arange(n)), -column("contact", n)):
        with pytest.raises(np.linalg.LinAlgError):
            CosineSolver(CosineForm(c), 1.0).solve(np.ones(n), 1e-8)
    # Their samples are positive all the same.
    for c in ([1.0, 0.2, -0.4], [1.0, 0.3, -0.3], [1.0, 0.2, 0.0, 0.6]):
        form = CosineForm(np.append(c, np.zeros(8 - len(c))))
        refuses(np.linalg.LinAlgError, "approximate inverse", LowRankInverse, form)
    form, _ = make(np.float64, 6)
    refuses(np.linalg.LinAlgError, "eigenvalue", form.inverse, np.array([1.0, 0.0, 1.0, 1.0]) + 0j)


def test_a_zero_on_the_grid_leaves_the_block_of_the_lowest_frequencies():
    n = 4096
    zero = np.cos(20.0 * np.pi / n)
    c = np.append([2.0 + 4.0 * zero**2, -4.0 * zero, 1.0], np.zeros(n - 3)) / 2.0
    refuses(np.linalg.LinAlgError, "sample", LowRankInverse, CosineForm(c))
    b = scipy.linalg.matmul_toeplitz(c, random(n))
    x, _ = CosineSolver(CosineForm(c), float(2.0 * abs(c).sum())).solve(b, 1e-8)
    assert np.linalg.norm(scipy.linalg.matmul_toeplitz(c, x) - b) <= 1e-7 * np.linalg.norm(b)


@pytest.mark.parametrize(("length", "nugget"), [(3.0, 1e-9), (10.66, 2.6e-8), (40.0, 1e-6)])
def test_pivots_as_small_as_rounding_leave_it_positive_definite(length, nugget):
    n = 4096
    c = np.exp(-((np.arange(n) / length) ** 2))
    c[0] += nugget
    form = CosineForm(c)
    M = LowRankInverse(form)
    assert min(M.ranks) >= 5
    b = random(n)
    x, iterations = CosineSolver(form, float(2.0 * abs(c).sum())).solve(b, 1e-8)
    assert_within_budget("Gaussians by low rank", iterations=iterations)
    rounding = 1e-15 * abs(c).sum() * np.linalg.norm(x)
    assert np.linalg.norm(form.multiply(x) - b) <= 1e-7 * np.linalg.norm(b) + rounding


# The Fourier transform --------------------------------------------------------------------------

SIZES = [2, 4, 6, 250, 512]
DTYPES = [np.float64, np.complex128]


def numbers(dtype, *shape):
    return random(*shape) + (1j * random(2, *shape)[1] if dtype == np.complex128 else 0.0)


def make(dtype, n):
    c, r = numbers(dtype, 2, n)
    r[0] = c[0]
    return FourierForm(c, r), scipy.linalg.toeplitz(c, r)


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("n", SIZES)
def test_products_of_any_matrix(dtype, n):
    form, A = make(dtype, n)
    X = numbers(dtype, 3, n)
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
def test_circulants_that_are_smooth_and_of_means_are_inverted(dtype, n):
    """The lags k and k - n have weights there whose sum is one: smooth ones, and T. Chan's."""
    form, A = make(dtype, n)
    x, k = numbers(dtype, n), np.arange(n)
    for first, w in (
        (smooth_column, 0.5 + 0.5 * np.cos(np.pi * k / n)),
        (chan_column, 1.0 - k / n),
    ):
        C = scipy.linalg.circulant(w * A[:, 0] + np.r_[0.0, (1 - w[1:]) * A[0, :0:-1]])
        Z = form.transform(C @ x)
        transform = np.fft.fft if form.A.dtype.kind == "c" else np.fft.rfft
        inverse = form.inverse(transform(first(A[:, 0], A[0])))
        found = form.transform_back(inverse.apply(Z, Z))
        assert_allclose(found, x, atol=1e-12 * np.linalg.cond(C))
