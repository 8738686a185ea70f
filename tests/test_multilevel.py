"""Products of several axes, and of several components, against their dense definition."""

from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

import numpy as np
import pytest
import scipy.fft
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import toeplitz_mg as tmg
from tests.cases import contact, dense_of_lags
from toeplitz_mg.engine import passes
from toeplitz_mg.engine.library import NUMPY
from toeplitz_mg.engine.multilevel import MultilevelProduct
from toeplitz_mg.operators.coefficients import Coefficients

shapes = st.lists(st.integers(1, 12), min_size=1, max_size=4)


def random(seed, *shape):
    return np.random.default_rng(seed).standard_normal(shape)


@settings(max_examples=40, deadline=None)
@given(
    shapes,
    st.integers(1, 3),
    st.sampled_from([np.float32, np.float64, np.complex64, np.complex128]),
    st.integers(0, 99),
)
def test_is_the_dense_matrix(shape, components, dtype, seed):
    rng = np.random.default_rng(seed)

    def of_normal(*shape):
        x = rng.standard_normal(shape)
        return x + 1j * rng.standard_normal(shape) if np.dtype(dtype).kind == "c" else x

    kernel = [
        [of_normal(*(2 * n - 1 for n in shape)) for _ in range(components)]
        for _ in range(components)
    ]
    kernel[-1][0] = kernel[0][-1] = None if components > 1 else kernel[0][0]
    if np.prod(shape) > 400:
        return
    zero = np.zeros((np.prod(shape),) * 2)
    dense = np.block(
        [[zero if lags is None else dense_of_lags(lags) for lags in row] for row in kernel]
    )
    blocks = [[None if a is None else Coefficients.of_lags(a) for a in row] for row in kernel]
    product = MultilevelProduct.of(NUMPY, blocks, dtype)
    X = of_normal(3, len(dense)).astype(dtype)
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


@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.complex128])
@pytest.mark.parametrize("shape", [(19, 23), (23, 19), (7, 5, 11)])
@pytest.mark.parametrize("components", [1, 2])
def test_panels_are_the_whole(monkeypatch, components, shape, dtype):
    """A field goes through the cache in panels, or stays there: the product is the same."""
    lags = [random(k, *(2 * n - 1 for n in shape)) for k in range(components**2)]
    blocks = [
        [Coefficients.of_lags(a.astype(dtype)) for a in lags[i::components]]
        for i in range(components)
    ]
    product = MultilevelProduct.of(NUMPY, blocks, dtype)
    X = random(9, 2, components * np.prod(shape)).astype(dtype)
    whole = product(X)
    for constant in ("WHOLE_BYTES", "PANEL_BYTES", "BLOCK_BYTES"):
        monkeypatch.setattr(passes, constant, 0)
    by_panels = product(X)
    error = 100 * np.finfo(dtype).eps * np.abs(whole).max()
    assert_allclose(by_panels, whole, rtol=0, atol=error)


@pytest.mark.parametrize("shape", [(700, 1), (1, 700), (1, 700, 1)])
def test_axes_of_one_element_are_none(shape):
    c = contact(700)
    A, line = tmg.ToeplitzOperator(c.reshape(shape)), tmg.ToeplitzOperator(c)
    x = random(0, 700)
    assert np.array_equal(A @ x, line @ x)
    lags = random(1, 1399)
    general = tmg.ToeplitzOperator.from_lags(lags.reshape([2 * n - 1 for n in shape]))
    line = tmg.ToeplitzOperator.from_lags(lags)
    assert np.array_equal(general @ x, line @ x)
    assert np.array_equal(general.H @ x, line.H @ x)


@pytest.mark.parametrize("shape", [(30, 17), (12, 5, 8), (20, 1, 20)], ids=str)
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
def test_large_grids_as_the_plain_transform(shape):
    c = np.exp(-np.sqrt(np.indices(shape).sum(axis=0)))
    A = tmg.ToeplitzOperator(c)
    X = random(2, 2, c.size)
    lengths = [scipy.fft.next_fast_len(2 * n - 1, real=True) for n in shape]
    spectrum = scipy.fft.rfftn(A.circulant(tuple(lengths)))
    cut = tuple(slice(n) for n in shape)
    for x, y in zip(X, A.apply(X), strict=True):
        hat = spectrum * scipy.fft.rfftn(x.reshape(shape), lengths)
        expected = scipy.fft.irfftn(hat, lengths)[cut].ravel()
        assert_allclose(y, expected, atol=1e-14 * np.abs(expected).max() * np.log2(c.size))
    single = A.astype(np.float32)
    assert_allclose(single @ X[0].astype(np.float32), A @ X[0], atol=1e-4 * abs(A @ X[0]).max())


def test_several_threads():
    c = np.exp(-np.sqrt(np.indices((500, 300)).sum(axis=0)))
    even = tmg.ToeplitzOperator(c)
    for A in (even, tmg.ToeplitzOperator.from_lags(even.lags * (1.0 + 0.5j))):
        X = random(3, 6, A.shape[1])
        expected = [A @ x for x in X]
        with scipy.fft.set_workers(2):
            assert all(np.array_equal(A @ x, y) for x, y in zip(X, expected, strict=True))
        with ThreadPoolExecutor(4) as pool:
            for y, z in zip(pool.map(A.dot, X), expected, strict=True):
                assert np.array_equal(y, z)


WITHOUT_TRANSFORMS_OF_GRIDS = (
    tmg.jacobi_preconditioner,
    tmg.spectral_preconditioner,
    tmg.fsai_preconditioner,
    tmg.default_preconditioner,
)


@pytest.mark.parametrize("shape", [(90, 1), (1, 90), (1, 90, 1)])
@pytest.mark.parametrize(
    "preconditioner",
    [
        tmg.fft_preconditioner,
        tmg.fft_rsm_preconditioner,
        tmg.fft_sd_preconditioner,
        tmg.cosine_preconditioner,
        tmg.sine_preconditioner,
        tmg.strang_preconditioner,
        tmg.chan_preconditioner,
        tmg.jacobi_preconditioner,
        tmg.spectral_preconditioner,
        tmg.fsai_preconditioner,
        tmg.default_preconditioner,
        tmg.multigrid,
    ],
)
@pytest.mark.parametrize("masked", [False, True])
def test_preconditioners_do_not_see_axes_of_one_element(preconditioner, shape, masked):
    for c in (contact(90), np.exp(-np.arange(90) / 30.0) + 0.1 * (np.arange(90) == 0)):
        A, line = tmg.ToeplitzOperator(c.reshape(shape)), tmg.ToeplitzOperator(c)
        if masked:
            mask = np.arange(90) % 30 > 1
            A, line = tmg.MaskedOperator(A, mask.reshape(shape)), tmg.MaskedOperator(line, mask)
        x = random(4, A.shape[0])
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
        if preconditioner in WITHOUT_TRANSFORMS_OF_GRIDS:
            assert np.array_equal(y, expected)


@pytest.mark.parametrize("shape", [(90, 1), (1, 90), (1, 90, 1)])
def test_the_inverse_does_not_see_axes_of_one_element(shape):
    A = tmg.ToeplitzOperator(contact(90).reshape(shape))
    x = random(5, 90)
    line = tmg.ToeplitzOperator(contact(90))
    assert np.array_equal(tmg.toeplitz_inverse(A) @ x, tmg.toeplitz_inverse(line) @ x)


def test_fsai_keeps_axes_of_one_element():
    A, line = (
        tmg.ToeplitzOperator(contact(900).reshape(900, 1, 1)),
        tmg.ToeplitzOperator(contact(900)),
    )
    mask = np.arange(900) % 30 > 1
    P, Q = (tmg.fsai_preconditioner(B) for B in (A, line))
    assert repr(P).replace(" x 1 x 1", "") == repr(Q)
    masks = mask.reshape(900, 1, 1), mask
    P, Q = (
        tmg.fsai_preconditioner(tmg.MaskedOperator(B, m))
        for B, m in zip((A, line), masks, strict=True)
    )
    x = random(7, P.shape[0])
    assert np.array_equal(P @ x, Q @ x)
    assert P.grid_shape == (900, 1, 1)


@pytest.mark.parametrize("shape", [(30, 1, 20), (1, 30, 20), (30, 20, 1)])
def test_two_axes_among_three_are_two(shape):
    c = np.exp(-np.hypot(*np.indices((30, 20))) / 3.0)
    A, plane = tmg.ToeplitzOperator(c.reshape(shape)), tmg.ToeplitzOperator(c)
    mask = np.arange(600) % 7 > 2
    assert np.array_equal(plane.toarray(), A.squeezed.toarray())
    assert A.squeezed.grid_shape == (30, 20)
    assert plane.squeezed is plane
    for one, other in (
        (A, plane),
        (
            tmg.MaskedOperator(A, mask.reshape(shape)),
            tmg.MaskedOperator(plane, mask.reshape(30, 20)),
        ),
    ):
        x = random(6, one.shape[0])
        for preconditioner in (tmg.fsai_preconditioner, tmg.default_preconditioner):
            y, expected = preconditioner(one) @ x, preconditioner(other) @ x
            assert_allclose(y, expected, rtol=0, atol=1e-13 * abs(expected).max())


@pytest.mark.parametrize("shape", [(1,), (1, 1)])
def test_one_element(shape):
    A = tmg.ToeplitzOperator(np.full(shape, 4.0))
    assert A.squeezed.grid_shape == (1,)
    for inverse in (tmg.spectral_preconditioner, tmg.fsai_preconditioner, tmg.toeplitz_inverse):
        assert_allclose(inverse(A) @ [2.0], [0.5])


# What is zero, and parts of the frequencies ------------------------------------------------------


@pytest.mark.parametrize("is_complex", [False, True])
@pytest.mark.parametrize("large", [False, True])
def test_blocks_that_are_zero_give_zero(monkeypatch, is_complex, large):
    """That of a matrix alone, or all of a row or a column of them; from panels, or at once."""
    if large:
        for constant in ("WHOLE_BYTES", "PANEL_BYTES", "BLOCK_BYTES"):
            monkeypatch.setattr(passes, constant, 0)
    shape, dtype = (19, 23), np.complex128 if is_complex else np.float64
    lags = random(0, *(2 * n - 1 for n in shape)).astype(dtype)
    zero, some = Coefficients.of_lags(0.0 * lags), Coefficients.of_lags(lags)
    X = random(1, 3, np.prod(shape))
    assert not MultilevelProduct.of(NUMPY, [[zero]], dtype)(X).any()
    dense = dense_of_lags(lags)
    for nothing in (None, zero):
        product = MultilevelProduct.of(NUMPY, [[nothing, some], [nothing, nothing]], dtype)
        both = np.concatenate([X, X[::-1]], axis=1)
        for _ in range(2):  # Memory that is used again is not empty.
            y = product(both)
            expected = np.concatenate([X[::-1] @ dense.T, 0.0 * X], axis=1)
            assert_allclose(y, expected, rtol=0, atol=1e-10)
            y = product.adjoint()(both)
            expected = np.concatenate([0.0 * X, X @ dense.conj()], axis=1)
            assert_allclose(y, expected, rtol=0, atol=1e-10)


@pytest.mark.parametrize("components", [1, 2])
@pytest.mark.parametrize("parts", [1, 2, 5])
def test_frequencies_may_be_multiplied_in_parts(components, parts):
    """As processes do of which each has some of them."""
    shape, rng = (19, 23), np.random.default_rng(0)
    lags = [rng.standard_normal([2 * n - 1 for n in shape]) for _ in range(components**2)]
    blocks = [[Coefficients.of_lags(a) for a in lags[i::components]] for i in range(components)]
    product = MultilevelProduct.of(NUMPY, blocks, np.float64)
    X = rng.standard_normal((1, components * np.prod(shape)))
    Z = product.passes.rows_in(X.reshape(1, components, *shape)).copy()
    bounds = [product.lengths[-1] * k // parts for k in range(parts + 1)]
    made = [
        product.passes.columns_through(np.ascontiguousarray(Z[..., start:stop]), start)
        for start, stop in pairwise(bounds)
    ]
    y = product.passes.rows_out(np.concatenate(made, axis=-1), np.empty((1, components, *shape)))
    dense = np.block([[dense_of_lags(a) for a in lags[i::components]] for i in range(components)])
    assert_allclose(y.reshape(1, -1), X @ dense.T, rtol=0, atol=1e-10)
