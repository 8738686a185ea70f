"""CG in the domain of the DCT: the product, the block and the inverse are what they say."""

import numpy as np
import pytest
import scipy.linalg
from numpy.testing import assert_allclose
from scipy import fft

import toeplitz_mg as tmg
from comparisons.systems.symbols import column
from toeplitz_mg.solvers.cosine_cg import CosineSolver
from toeplitz_mg.solvers.cosine_form import LOWEST, ApproximateInverse, CosineForm, by_parity

# Lengths that are fast, even and odd, and slow, even and odd.
LENGTHS = [256, 315, 1000, 269, 262, 1021]
NAMES = ["contact", "fGn, H = 0.9", "|θ|", "θ²", "2 + 2 cos θ", "exp(-k/1000)"]


def random(*shape):
    return np.random.default_rng([7, *shape]).standard_normal(shape)


def transform(m):
    return fft.dct(np.eye(m), axis=0, norm="ortho")


@pytest.mark.parametrize("n", LENGTHS)
def test_the_products_are_those_of_the_matrix(n):
    c = random(n)
    form, A, X = CosineForm(c), scipy.linalg.toeplitz(c), random(3, n)
    scale = abs(A).sum(axis=0).max()
    assert_allclose(form.multiply(X), X @ A, atol=1e-13 * scale)
    assert_allclose(form.multiply(X[0]), A @ X[0], atol=1e-13 * scale)
    assert_allclose(form.transform_back(form.transform(X)), X, atol=1e-13)
    Z = form.transform(X)
    Y = np.empty_like(Z)
    form.multiply_transformed(Z, Y)
    assert_allclose(form.transform_back(Y), X @ A, atol=1e-13 * scale)


@pytest.mark.parametrize("n", LENGTHS)
def test_the_lowest_blocks_are_those_of_the_transformed_matrix(n):
    form = CosineForm(column("contact", n))
    lags = fft.dct(form.samples, 1)[: form.m] / (2 * form.m)
    C = transform(form.m)
    B = (C @ scipy.linalg.toeplitz(lags) @ C.T)[:LOWEST, :LOWEST]
    even, odd = form.lowest_blocks()
    assert_allclose(even, B[::2, ::2], atol=1e-12 * abs(B).max())
    assert_allclose(odd, B[1::2, 1::2], atol=1e-12 * abs(B).max())
    # The even and the odd part of a vector do not mix.
    assert_allclose(B[::2, 1::2], 0.0, atol=1e-12 * abs(B).max())


@pytest.mark.parametrize("n", LENGTHS)
@pytest.mark.parametrize("name", NAMES)
def test_the_approximate_inverse_is_positive_definite(name, n):
    form = CosineForm(column(name, n))
    M = ApproximateInverse(form.alternated() if form.has_zero_at_end else form)
    assert (M.diagonal[LOWEST:] > 0.0).all()
    for block in M.lowest:
        assert_allclose(block, block.T)
        assert np.linalg.eigvalsh(block).min() > 0.0


@pytest.mark.parametrize("n", LENGTHS)
@pytest.mark.parametrize("name", NAMES)
def test_a_system_is_solved_in_few_iterations(name, n):
    c, B = column(name, n), random(2, n)
    A = tmg.ToeplitzOperator(c)
    solver = CosineSolver(CosineForm(c), float(abs(A.lags).sum()))
    X, iterations = solver.solve(B, 1e-8)
    assert iterations <= 8
    assert np.linalg.norm(A.apply(X) - B) <= 1e-7 * np.linalg.norm(B)
    x, of_one = solver.solve(B[0], 1e-8)
    assert of_one <= iterations
    assert_allclose(x, X[0], atol=1e-5 * abs(x).max())


@pytest.mark.parametrize("n", [600, 4096])
@pytest.mark.parametrize("ratio", [0.5, -0.7, 0.9])
def test_of_lags_that_decay_in_proportion_a_few_iterations_are_all(n, ratio):
    # Between the higher frequencies C A Cᵀ differs from the symbol by a matrix of rank two, one of
    # each parity, and so do the couplings to the lowest.
    c, b = ratio ** np.arange(n), random(n)
    x, iterations = CosineSolver(CosineForm(c), float(2.0 * abs(c).sum())).solve(b, 1e-12)
    assert iterations <= 3
    assert np.linalg.norm(scipy.linalg.toeplitz(c) @ x - b) <= 1e-11 * np.linalg.norm(b)


def test_lags_that_are_zero_at_the_end_by_chance_have_not_ended():
    c = np.exp(-np.arange(600) / 1000.0)
    assert not CosineForm(c).has_ended
    c[1::2] = 0.0
    assert c[-1] == 0.0
    assert not CosineForm(c).has_ended
    c[-2] = 0.0
    assert CosineForm(c).has_ended


@pytest.mark.parametrize("n", [256, 269])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_part_that_the_right_hand_side_has_not_stays_zero(n, sign):
    c, b = column("contact", n), random(n)
    b = b + sign * b[::-1]
    x, _ = CosineSolver(CosineForm(c), float(abs(c).sum())).solve(b, 1e-10)
    assert_allclose(x, sign * x[::-1], atol=1e-12 * abs(x).max())
    assert_allclose(scipy.linalg.toeplitz(c) @ x, b, atol=1e-8)
    zero, iterations = CosineSolver(CosineForm(c), 1.0).solve(0.0 * b, 1e-10)
    assert iterations == 0
    assert not zero.any()


def test_what_is_not_positive_definite_is_refused():
    n = 512
    for c in (column("sinc", n), np.cos(np.arange(n)), -column("contact", n)):
        with pytest.raises(np.linalg.LinAlgError):
            CosineSolver(CosineForm(c), 1.0).solve(np.ones(n), 1e-8)


def test_the_frequencies_are_sorted_by_parity():
    X = random(3, 100)
    even, odd = by_parity(X)
    assert np.array_equal(even, X[:, :LOWEST:2])
    assert np.array_equal(odd, X[:, 1:LOWEST:2])
