"""Transforms of small grids by matrices, and products and inverses that are made of them."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.test_direct import random_case
from tests.test_friction import doubtful
from tests.test_rolling import assert_rolls
from toeplitz_mg.contact import Material, rolling, surfaces
from toeplitz_mg.contact.grid import SHORT, Grid
from toeplitz_mg.contact.short_transforms import (
    ADDITIONS,
    ShortCirculants,
    ShortProduct,
    ShortTransforms,
)
from toeplitz_mg.contact.steady_matrices import (
    LEAST,
    ShiftedInverses,
    fade_rate,
    subtract_operators,
)
from toeplitz_mg.operators import CoupledOperator

SHAPES = [(6, 5), (1, 4), (7, 1), (9, 14)]
ROUNDING = {np.float32: 1e-5, np.float64: 1e-13}


def matrix_of(shape):
    grid = Grid.of(shape, (0.5, 0.8), Material.from_shear(2.0, 0.3), None)
    return subtract_operators(grid.tangential(), grid.upstream())


@pytest.mark.parametrize("dtype", ROUNDING)
@pytest.mark.parametrize("shape", SHAPES)
def test_transforms_are_those_of_the_padded_fields_and_back(shape, dtype):
    x = np.random.default_rng(0).standard_normal((3, *shape)).astype(dtype)
    transforms = ShortTransforms(shape, dtype)
    X = transforms.forward(x)
    expected = np.fft.rfft2(x, transforms.lengths)
    atol = ROUNDING[dtype] * np.abs(expected).max()
    assert_allclose(X, expected, atol=atol)
    assert_allclose(transforms.back(X), x, atol=ROUNDING[dtype] * np.abs(x).max())
    assert X.dtype == np.result_type(dtype, np.complex64)


@pytest.mark.parametrize("dtype", ROUNDING)
@pytest.mark.parametrize("shape", SHAPES)
def test_products_are_those_of_the_matrix(shape, dtype):
    K = matrix_of(shape)
    short = CoupledOperator(K.blocks, product=ShortProduct.of(K)).astype(dtype)
    X = np.random.default_rng(1).standard_normal((K.shape[0], 3)).astype(dtype)
    expected = K.toarray() @ X
    assert_allclose(short @ X, expected, atol=ROUNDING[dtype] * np.abs(expected).max())
    assert (short @ X).dtype == dtype
    expected = K.toarray().T @ X
    assert_allclose(short.H @ X, expected, atol=ROUNDING[dtype] * np.abs(expected).max())
    # The circulant that embeds the matrix is larger than it.
    assert short.norm_bound >= np.linalg.norm(K.toarray(), 2) * (1.0 - ROUNDING[dtype])


def test_small_grids_have_these_products_whatever_they_are_for():
    grid = Grid.of((9, 14), (0.5, 0.8), Material.from_shear(2.0, 0.3), None)
    plain = replace(grid, shape=(SHORT + 1, SHORT + 1))
    assert type(grid.tangential()._product) is ShortProduct
    assert type(plain.tangential()._product) is not ShortProduct
    q = np.random.default_rng(4).standard_normal(grid.tangential().shape[0])
    expected = grid.tangential().toarray() @ q
    assert_allclose(grid.tangential() @ q, expected, atol=1e-13 * np.abs(expected).max())


@pytest.mark.parametrize("shape", [(6, 5), (9, 14)])
def test_inverses_are_of_the_circulant_that_embeds_the_matrix(shape):
    K, rng = matrix_of(shape), np.random.default_rng(2)
    short = ShiftedInverses(K, np.float64, ShortCirculants)
    r, k0 = rng.standard_normal((2, *shape)), K.component(0).c.flat[0]
    lengths = [2 * n - 1 for n in shape]
    fade = np.exp(fade_rate(lengths[0]) * np.arange(1 - shape[0], shape[0]))[:, None]
    for i in range(2):
        of_nodes = []
        for nu in ADDITIONS:
            a = K.component(i)
            symbol = np.fft.fft2(np.fft.ifftshift(a.lags / fade))
            symbol += k0 * nu + LEAST / shape[0] * np.abs(symbol).max()
            padded = np.zeros(lengths)
            padded[: shape[0], : shape[1]] = r[i] / fade[shape[0] - 1 :]
            y = np.fft.ifft2(np.fft.fft2(padded) / symbol).real
            of_nodes.append(y[: shape[0], : shape[1]] * fade[shape[0] - 1 :])
        # In x = 1/(1 + ν) what the inverse is more than x/k₀, over x², is linear between two ν:
        # 2 k₀ is between 0 and 3 k₀, with 1/3 = 1/9 · 1 + 8/9 · 1/4.
        y = short.at(np.full(shape, 2.0 * k0))(r)[i]
        first, second = (
            (of_node - x * r[i] / k0) / x**2
            for of_node, x in zip(of_nodes, (1.0, 0.25), strict=True)
        )
        more = (first / 9.0 + second * 8.0 / 9.0) / 9.0
        assert_allclose(y, r[i] / 3.0 / k0 + more, atol=1e-12)


def test_inverses_of_large_additions_are_right_to_second_order():
    K, rng = matrix_of((9, 14)), np.random.default_rng(5)
    M, k0 = ShiftedInverses(K, np.float64), K.component(0).c.flat[0]
    r, errors = rng.standard_normal((2, 9, 14)), []
    for nu in (1e3, 1e4):
        y = M.at(np.full((9, 14), nu * k0))(r)
        again = np.stack([(K.component(i) @ y[i].ravel()).reshape(9, 14) for i in range(2)])
        errors.append(np.abs(again + nu * k0 * y - r).max())
    # The fields are x - x² (K - k₀) + ..., with x = 1/ν, but for what bounds the inverse.
    assert errors[0] < 1e-3 * np.abs(r).max()
    assert errors[1] < 0.15 * errors[0]


@doubtful
@pytest.mark.parametrize("seed", range(8))
def test_small_grids_roll_as_with_fast_transforms(seed, monkeypatch):
    g, case = random_case(seed)
    n = g.shape[0]
    fine = 3 * n
    element = tuple(h / 3.0 for h in case["element"])
    a, b = (0.5 * n * h for h in case["element"])
    x, y = surfaces.centres((fine, fine), element)
    g = g.max() * np.sqrt(np.maximum(0.0, 1.0 - (x / a) ** 2 - (y / b) ** 2))
    case = case | {"element": element}
    assert fine <= SHORT
    by_matrices = rolling(g, **case)
    assert_rolls(by_matrices, case["material"])
    monkeypatch.setattr(Grid, "is_short", False)
    by_transforms = rolling(g, **case | {"tolerance": 1e-9})
    assert_allclose(by_matrices.traction, by_transforms.traction, rtol=0, atol=1e-5 * g.max())
