"""Theorems of the sparse approximate inverse of a whole line."""

import pickle

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import toeplitz_mg as tmg
from toeplitz_mg.paper.problems import test1
from toeplitz_mg.preconditioners.fsai.build import DEFAULT, Options, build
from toeplitz_mg.preconditioners.fsai.levels import LevelMatrix
from toeplitz_mg.preconditioners.fsai.line import BLOCK, LineMatrix, build_line
from toeplitz_mg.preconditioners.fsai.stencil import Stencil
from toeplitz_mg.preconditioners.traits import decays_slowly

DENSE = DEFAULT.direct_on_line


def contact(n):
    return test1(n).A.c


def power(exponent):
    return lambda n: (1.0 + np.arange(n)) ** -exponent


def long_memory(n):
    """Of fractional Gaussian noise, H = 0.9."""
    k = np.arange(n, dtype=float)
    return 0.5 * ((k + 1) ** 1.8 - 2 * k**1.8 + np.abs(k - 1) ** 1.8)


SLOW = {"contact": contact, "1/(1+k)": power(1.0), "1/(1+k)²": power(2.0), "fGn": long_memory}


def apply(P, X):
    out = np.empty_like(X)
    P.multiply(X, out)
    return out


def random(*shape):
    return np.random.default_rng(0).standard_normal(shape)


@pytest.mark.parametrize("n", [129, 130, 143, 144, 145, 1000, 2049, 4097, 20_000])
@pytest.mark.parametrize("column", [contact, lambda n: 0.9 ** np.arange(n)])
def test_it_is_the_inverse_of_any_area_on_a_whole_line(column, n):
    kernel = column(n)
    stencil = Stencil(kernel[np.newaxis, np.newaxis, np.newaxis], BLOCK - 1, BLOCK - 1)
    matrix = LevelMatrix.of_mask(stencil, np.ones((1, n), bool))
    general = build(stencil, matrix, np.dtype(float), Options(direct=DENSE))
    P = build_line(LineMatrix.of_kernel(kernel), np.dtype(float))
    assert P.sizes == general.sizes
    x = random(1, n)
    expected = general(x[0])
    assert_allclose(apply(P, x)[0], expected, rtol=0, atol=1e-13 * abs(expected).max())


@pytest.mark.parametrize("n", [1, 2, 16, DENSE])
def test_a_short_line_is_inverted(n):
    A = tmg.ToeplitzOperator(contact(n))
    assert_allclose(tmg.fsai_preconditioner(A) @ A.toarray(), np.eye(n), rtol=0, atol=1e-11)


@pytest.mark.parametrize("n", [129, 200, 500, 521])
@pytest.mark.parametrize("name", SLOW)
def test_symmetric_positive_definite(name, n):
    P = tmg.fsai_preconditioner(tmg.ToeplitzOperator(SLOW[name](n))) @ np.eye(n)
    assert_allclose(P, P.T, rtol=0, atol=1e-13 * abs(P).max())
    assert np.linalg.eigvalsh(P).min() > 0.0


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("name", SLOW)
def test_iterations_hardly_depend_on_n(name, dtype):
    for n in (130, 1000, 4099, 2**14, 2**17 - 1):
        A = tmg.ToeplitzOperator(SLOW[name](n))
        P = tmg.fsai_preconditioner(A, dtype=dtype)
        for b, most in ((np.ones(n), 6), (random(n), 8)):
            x, info = tmg.cg(A, b, M=P, rtol=1e-8, maxiter=most)
            assert info == 0
            assert np.linalg.norm(b - A @ x) <= 1.1e-8 * np.linalg.norm(b)


def test_rows_in_place_and_chunks():
    n = 3 * 2**14 + 5  # of cells: some chunks, and a last block that is not whole
    P = build_line(LineMatrix.of_kernel(contact(n)), np.dtype(float))
    X = random(3, n)
    each = np.concatenate([apply(P, x[np.newaxis]) for x in X])
    assert_allclose(apply(P, X), each, rtol=0, atol=1e-13 * abs(each).max())
    P.multiply(X, X)
    assert_allclose(X, each, rtol=0, atol=1e-13 * abs(each).max())


@pytest.mark.parametrize("shape", [(1, 700), (700, 1)])
def test_a_grid_of_one_line_is_a_line(shape):
    c = contact(700)
    P = tmg.fsai_preconditioner(tmg.ToeplitzOperator(c))
    Q = tmg.fsai_preconditioner(tmg.ToeplitzOperator(c.reshape(shape)))
    x = random(700)
    assert_array_equal(P @ x, Q @ x)
    everything = tmg.MaskedOperator(tmg.ToeplitzOperator(c), np.ones(700, bool))
    assert_array_equal(P @ x, tmg.fsai_preconditioner(everything) @ x)
    assert_array_equal(P @ x, pickle.loads(pickle.dumps(P)) @ x)


def test_many_threads_and_many_columns():
    A = tmg.ToeplitzOperator(contact(5000))
    P = tmg.fsai_preconditioner(A)
    X = random(5000, 4)
    columns = np.stack([P @ x for x in X.T], axis=1)
    assert_allclose(P @ X, columns, rtol=0, atol=1e-13 * abs(columns).max())


@pytest.mark.parametrize("scale", [1e-30, 1e30])
def test_the_scale_of_the_coefficients_does_not_matter(scale):
    A = tmg.ToeplitzOperator(contact(1000))
    scaled = tmg.ToeplitzOperator(scale * contact(1000))
    x = random(1000)
    P, Q = (tmg.fsai_preconditioner(each) for each in (A, scaled))
    assert_allclose(scale * (Q @ x), P @ x, rtol=1e-10)


@pytest.mark.parametrize(
    "column",
    [
        lambda n: -1.0 / (1.0 + np.arange(n)),
        lambda n: np.exp(-((np.arange(n) / 300.0) ** 2)),
        lambda n: np.r_[1.0, 0.9, np.zeros(n - 2)],
    ],
)
def test_what_is_indefinite_or_too_smooth_is_refused(column):
    A = tmg.ToeplitzOperator(column(1000))
    with pytest.raises(np.linalg.LinAlgError, match="sparse approximate inverse, but must be pos"):
        tmg.fsai_preconditioner(A)


@pytest.mark.parametrize("n", [600, 4096, 2**17])
def test_slow_decay(n):
    k = np.arange(n)
    for column in SLOW.values():
        assert decays_slowly(column(n))
    assert decays_slowly(1.0 / (1.0 + k / 10.0))
    for other in (
        0.9**k,
        np.exp(-k / 1000.0),
        np.exp(-((k / 10.0) ** 2)),
        np.exp(-((k / n) ** 2)),
        1.0 / (1.0 + (k / 10.0) ** 2) + 1e-6 * (k == 0),
        np.cos(k) / (k + 1.0),
        np.r_[2.0, -1.0, np.zeros(n - 2)],
        np.r_[1.0, np.zeros(n - 1)],
        np.ones(n),
        -1.0 / (1.0 + k),
    ):
        assert not decays_slowly(other)
