"""Grids of several axes: products are plain convolutions, axes of one element are none."""

import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import scipy.fft
from numpy.testing import assert_allclose
from scipy.signal import fftconvolve

import toeplitz_mg as tmg
from tests.cases import contact, lags_of
from tests.systems import PRECONDITIONERS, seeded


@pytest.mark.parametrize("shape", [(30, 17), (190, 230), (12, 5, 8), (20, 1, 20)], ids=str)
def test_coupled_components_of_any_grid(shape):
    """What is known of a block alone is used only where it was made for the same grid."""
    rng = np.random.default_rng(0)
    lags = rng.standard_normal([2 * n - 1 for n in shape])
    for first in (lags, lags + 1j):
        blocks = [tmg.ToeplitzOperator.from_lags(a) for a in (first, lags)]
        A = tmg.CoupledOperator([[blocks[0], None], [blocks[1], blocks[1]]])
        X = rng.standard_normal((2, A.shape[1] // 2))
        expected = [blocks[0] @ X[0], blocks[1] @ (X[0] + X[1])]
        y = A @ X.ravel()
        assert_allclose(y, np.ravel(expected), rtol=0, atol=1e-12 * np.abs(y).max())
        y = A.T @ X.ravel()
        expected = [blocks[0].T @ X[0] + blocks[1].T @ X[1], blocks[1].T @ X[1]]
        assert_allclose(y, np.ravel(expected), rtol=0, atol=1e-12 * np.abs(y).max())


@pytest.mark.parametrize("shape", [(300, 700), (4, 30011), (30011, 4), (40, 50, 60)])
def test_products_of_large_grids_are_convolutions(shape):
    c = np.exp(-np.sqrt(np.indices(shape).sum(axis=0)))
    X = seeded(c.size, 2, seed=2)
    for lags in (seeded(*(2 * n - 1 for n in shape)), lags_of(c)):
        A = tmg.ToeplitzOperator.from_lags(lags)
        for x, y in zip(X.T, (A @ X).T, strict=True):
            expected = fftconvolve(lags, x.reshape(shape), mode="valid").ravel()
            assert_allclose(y, expected, atol=1e-14 * np.abs(expected).max() * np.log2(c.size))
    y, single = A @ X[:, 0], A.astype(np.float32) @ X[:, 0].astype(np.float32)
    assert_allclose(single, y, atol=1e-4 * abs(y).max())


def test_several_threads_may_multiply_at_once():
    c = np.exp(-np.sqrt(np.indices((500, 300)).sum(axis=0)))
    even = tmg.ToeplitzOperator(c)
    line = tmg.ToeplitzOperator(1.0 / (1.0 + np.arange(40_000)))
    of_complex = tmg.ToeplitzOperator.from_lags(even.lags * (1.0 + 0.5j))
    for A in (even, of_complex, line, tmg.spectral_preconditioner(line)):
        X = seeded(6, A.shape[1], seed=3)
        expected = [A @ x for x in X]
        with scipy.fft.set_workers(2):
            assert all(np.array_equal(A @ x, y) for x, y in zip(X, expected, strict=True))
        with ThreadPoolExecutor(4) as pool:
            for y, z in zip(pool.map(A.dot, X), expected, strict=True):
                assert np.array_equal(y, z)
        assert np.array_equal(pickle.loads(pickle.dumps(A)) @ X[0], expected[0])


@pytest.mark.parametrize("shape", [(90, 1), (1, 90), (1, 90, 1)])
@pytest.mark.parametrize("preconditioner", [*PRECONDITIONERS, tmg.toeplitz_inverse])
@pytest.mark.parametrize("masked", [False, True])
def test_preconditioners_do_not_see_axes_of_one_element(preconditioner, shape, masked):
    for c in (contact(90), np.exp(-np.arange(90) / 30.0) + 0.1 * (np.arange(90) == 0)):
        A, line = tmg.ToeplitzOperator(c.reshape(shape)), tmg.ToeplitzOperator(c)
        if masked and preconditioner is not tmg.toeplitz_inverse:
            mask = np.arange(90) % 30 > 1
            A, line = tmg.MaskedOperator(A, mask.reshape(shape)), tmg.MaskedOperator(line, mask)
        x = seeded(A.shape[0], seed=4)
        try:
            M = preconditioner(line)
        except np.linalg.LinAlgError:
            with pytest.raises(np.linalg.LinAlgError):
                preconditioner(A)
            continue
        with tmg.count_products() as work_of_line:
            expected = M @ x
        M = preconditioner(A)
        with tmg.count_products() as work:
            y = M @ x
        assert_allclose(y, expected, rtol=0, atol=1e-13 * abs(expected).max())
        assert work.points == work_of_line.points


@pytest.mark.parametrize("shape", [(30, 1, 20), (1, 30, 20), (30, 20, 1)])
def test_two_axes_among_three_are_two(shape):
    c = np.exp(-np.hypot(*np.indices((30, 20))) / 3.0)
    A, plane = tmg.ToeplitzOperator(c.reshape(shape)), tmg.ToeplitzOperator(c)
    mask = np.arange(600) % 7 > 2
    assert np.array_equal(plane.toarray(), A.toarray())
    on_masks = [tmg.MaskedOperator(B, mask.reshape(B.grid_shape)) for B in (A, plane)]
    for one, other in ((A, plane), on_masks):
        x = seeded(one.shape[0], seed=6)
        for preconditioner in (tmg.fsai_preconditioner, tmg.default_preconditioner):
            y, expected = preconditioner(one) @ x, preconditioner(other) @ x
            assert_allclose(y, expected, rtol=0, atol=1e-13 * abs(expected).max())
