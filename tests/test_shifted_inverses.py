"""Approximate inverses of the matrix of steady rolling: circulants, their factors, and edges."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from toeplitz_mg.contact import Material, circulants
from toeplitz_mg.contact.circulants import find_causal_factor, find_lengths, find_spectrum
from toeplitz_mg.contact.grid import Grid
from toeplitz_mg.contact.shifted_inverses import ADDITIONS, ShiftedInverses, interpolate
from toeplitz_mg.operators import ToeplitzOperator

SHAPES = [(70,), (40, 30), (50, 1)]


def rolling_on(shape):
    grid = Grid.of(shape, (0.5,) * len(shape), Material.from_shear(2.0, 0.3), None)
    return grid, grid.steady(grid.tangential())


def nothing(X):
    """Project no field: tractions may change everywhere."""


@pytest.mark.parametrize("length", [90, 91])
def test_the_causal_factor_has_the_lags_from_zero_on(length):
    a, b = np.array([[0.5, -0.3, 0.1], [0.2, 0.4, -0.6]])
    z = np.exp(-2j * np.pi * np.arange(length) / length)[:, None]
    of_grid = find_causal_factor((1.0 - a * z) * (1.0 - b / z), (length, 5))
    assert_allclose(of_grid, 1.0 - a * z, atol=1e-12)
    # Of a single axis there are the frequencies up to the middle, along the last of two.
    half = z[: length // 2 + 1, 0]
    of_line = find_causal_factor(((1.0 - a[0] * half) / (1.0 - b[0] / half))[None], (length,))
    assert_allclose(of_line, (1.0 - a[0] * half)[None], atol=1e-12)


def test_both_factors_share_what_depends_on_the_frequency_across():
    across = np.array([0.25, 1.0, 9.0])
    assert_allclose(find_causal_factor(np.tile(across, (8, 1)), (8, 5)), np.sqrt([across] * 8))


@pytest.mark.parametrize("shape", [(300, 20), (20, 300), (52, 14)])
def test_no_eigenvalue_is_near_zero_or_negative(shape):
    # Of the lags on long and narrow grids alone some would be.
    _, K = rolling_on(shape)
    spectrum = find_spectrum(K.component(0), find_lengths(shape))
    assert spectrum.real.min() >= 0.9 * circulants.LEAST / shape[0] * np.abs(spectrum).max()


@pytest.mark.parametrize("shape", [(60,), (60, 6)])
def test_the_inverse_is_exact_at_both_edges_of_what_may_change(shape, monkeypatch):
    """Of a product of factors of few lags along the rolling direction, of which little is far."""
    monkeypatch.setattr(circulants, "LEAST", 0.0)
    a, b, n = 0.4, 0.3, shape[0]
    lags = np.zeros([2 * m - 1 for m in shape])
    middle = tuple(m - 1 for m in shape)[1:]
    for lag, value in ((-1, -b), (0, 1.0 + a * b), (1, -a)):
        lags[(n - 1 + lag, *middle)] = value
    K = ToeplitzOperator.from_lags(lags)
    # The grid goes on behind either edge, by so much that it is as good as without an end.
    inside = np.zeros(shape, bool)
    inside[20:40] = True
    r = np.random.default_rng(0).standard_normal((1, *shape)) * inside
    found = ShiftedInverses.of(K, np.float64).at(np.zeros(shape))(
        r, lambda X: np.multiply(X, inside, out=X)
    )
    own = np.flatnonzero(inside)
    expected = np.linalg.solve(K.toarray()[np.ix_(own, own)], r.ravel()[own])
    assert_allclose(found.ravel()[own], expected, atol=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize("shape", SHAPES)
def test_inverses_are_the_same_in_panels_of_any_size(shape, monkeypatch):
    rng = np.random.default_rng(0)
    grid, K = rolling_on(shape)
    M = ShiftedInverses.of(K, np.float64)
    addition, r = 3.0 * rng.random(shape), rng.standard_normal((grid.components, *shape))
    inside = rng.random(shape) < 0.7

    def project(X):
        X *= inside

    whole = M.at(addition)(r, project)
    monkeypatch.setattr(circulants, "PANEL_BYTES", 1)
    assert_allclose(M.at(addition)(r, project), whole, atol=1e-12 * np.abs(whole).max())
    # In each place it is that of its own addition alone.
    uniform = M.at(np.full(shape, addition.flat[7]))(r, project)
    assert_allclose(uniform.reshape(len(r), -1)[:, 7], whole.reshape(len(r), -1)[:, 7])


def test_inverses_of_large_additions_are_right_to_second_order():
    grid, K = rolling_on((9, 14))
    M, k0 = ShiftedInverses.of(K, np.float64), grid.diagonal(K)
    r, errors = np.random.default_rng(5).standard_normal((2, 9, 14)), []
    for nu in (1e3, 1e4):
        y = M.at(np.full((9, 14), nu * k0))(r, nothing)
        again = np.stack([(K.component(i) @ y[i].ravel()).reshape(9, 14) for i in range(2)])
        errors.append(np.abs(again + nu * k0 * y - r).max())
    # The fields are x - x² (K - k₀) + ..., with x = 1/ν, but for what bounds the inverse.
    assert errors[0] < 1e-3 * np.abs(r).max()
    assert errors[1] < 0.15 * errors[0]


def test_inverses_are_interpolated_over_what_the_diagonal_leaves_of_them():
    at_nodes, local = interpolate(ADDITIONS, np.float64)
    assert_allclose(at_nodes, np.eye(len(ADDITIONS)), atol=1e-15)
    assert_allclose(local, 0.0, atol=1e-15)
    # Where K is its diagonal, here 1, the inverse is known for any addition.
    given, nodes = np.geomspace(1e-3, 1e3, 40), 1.0 / (1.0 + ADDITIONS)
    weights, local = interpolate(given, np.float64)
    x = 1.0 / (1.0 + given)
    assert_allclose(nodes @ weights + local, x, rtol=1e-12)
    # What an inverse is more than x, over x², is linear in x from one node to the next, and beyond
    # the last one constant.
    more = weights / x**2
    for k, node in enumerate(nodes):
        hat = np.interp(x, nodes[::-1], (np.arange(len(nodes)) == k).astype(float)[::-1])
        assert_allclose(more[k] * node**2, hat, atol=1e-12)


def test_lengths_are_no_longer_than_all_lags():
    for n in range(1, 30):
        for length in find_lengths((n, n)):
            assert n <= length <= 2 * n - 1
    assert find_lengths((400, 400)) == (600, 799)
