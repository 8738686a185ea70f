"""Transforms of small grids by matrices, and products and inverses that are made of them."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.test_direct import random_case
from tests.test_friction import doubtful
from tests.test_rolling import assert_rolls
from toeplitz_mg.contact import Material, circulants, rolling, surfaces
from toeplitz_mg.contact.circulants import Circulants
from toeplitz_mg.contact.grid import SHORT, Grid
from toeplitz_mg.contact.shifted_inverses import ShiftedInverses
from toeplitz_mg.contact.short_transforms import (
    SHORT_ADDITIONS,
    ShortCirculants,
    ShortProduct,
    ShortTransforms,
)
from toeplitz_mg.contact.steady_matrices import subtract_operators
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
    # Odd, whether more than half of it is zeros, or none.
    lengths = 2 * shape[0] - 1, shape[1] | 1
    transforms = ShortTransforms(shape, dtype, lengths)
    X = transforms.forward(x)
    expected = np.fft.rfft2(x, lengths)
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


@pytest.mark.parametrize("dtype", ROUNDING)
@pytest.mark.parametrize("shape", SHAPES)
def test_inverses_are_those_by_fast_transforms(shape, dtype, monkeypatch):
    K, rng = matrix_of(shape), np.random.default_rng(2)
    short = ShiftedInverses.of(K, dtype, ShortCirculants, SHORT_ADDITIONS)
    # Fast transforms have the same lengths here, which are odd.
    monkeypatch.setattr(circulants.fft, "next_fast_len", lambda n: n | 1)
    fast = ShiftedInverses.of(K, np.float64, Circulants, SHORT_ADDITIONS)
    r, addition = rng.standard_normal((2, *shape)), 3.0 * rng.random(shape)
    inside = rng.random(shape) < 0.7
    found, expected = (
        M.at(addition)(r, lambda X: np.multiply(X, inside, out=X)) for M in (short, fast)
    )
    assert found.dtype == dtype
    assert_allclose(found, expected, atol=ROUNDING[dtype] * np.abs(expected).max())


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
