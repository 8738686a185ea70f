"""Inverses of Toeplitz matrices that are causal along an axis, by circulants and their factors.

A circulant's eigenvalues are split into factors of the lags from zero on and from zero down; the
inverse that is made of them is exact at both edges of what may change, and with an addition to the
diagonal it is interpolated. On fragmented areas the inverse is made of their runs.
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.fft import next_fast_len

from toeplitz_mg.contact import Material
from toeplitz_mg.halfspace import influence_matrix
from toeplitz_mg.operators import MaskedOperator
from toeplitz_mg.preconditioners.causal import (
    FieldTransform,
    ShiftedInverses,
    fade_rate,
    find_causal_factor,
    find_lengths,
    find_spectrum,
    interpolate,
)
from toeplitz_mg.preconditioners.runs import InverseOnRuns

BODY = Material.from_shear(2.0, 0.3)


def rolling_on(shape):
    """The matrix of rolling: displacements here, less those one element ahead."""
    asked = "xy"[: len(shape)], shape, (0.5, 0.8)[: len(shape)], BODY
    return influence_matrix(*asked) - influence_matrix(*asked, ahead=1)


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
    spectrum = find_spectrum(rolling_on(shape).component(0), FieldTransform(shape, np.float64))
    assert spectrum.real.min() >= 0.1 / shape[0] * np.abs(spectrum).max()


@pytest.mark.parametrize("shape", [(60,), (60, 6), (60, 700)])
def test_the_inverse_is_exact_at_both_edges_of_what_may_change(shape):
    """Of a product of factors of few lags along the rolling direction, of which little is far."""
    a, b, n = 0.4, 0.3, shape[0]
    lengths = length, *across = find_lengths(shape)
    w = np.exp(-2j * np.pi * np.arange(length) / length - fade_rate(length))
    spectrum = (1.0 - a * w) * (1.0 - b / w)
    if across:
        spectrum = np.tile(spectrum[:, None], across[0] // 2 + 1)
    else:
        spectrum = spectrum[None, : length // 2 + 1]
    causal = find_causal_factor(1.0 / spectrum, lengths)
    transform = FieldTransform(shape, np.float64)
    M = ShiftedInverses(transform, [spectrum], [causal], 1.0 + a * b)
    # The grid goes on behind either edge, by so much that it is as good as without an end.
    inside = np.zeros(shape, bool)
    inside[20:40] = True
    r = np.random.default_rng(0).standard_normal((1, *shape)) * inside
    found = M.at(np.zeros(shape))(r, lambda X: np.multiply(X, inside, out=X))
    # Nothing is coupled across.
    K = (1.0 + a * b) * np.eye(n) - a * np.eye(n, k=-1) - b * np.eye(n, k=1)
    expected = np.linalg.solve(K[20:40, 20:40], r[0, 20:40])
    assert_allclose(found[0, 20:40], expected, atol=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize("shape", [(70,), (40, 30), (50, 1)])
def test_in_each_place_the_inverse_is_that_of_its_own_addition(shape):
    rng, K = np.random.default_rng(0), rolling_on(shape)
    M = ShiftedInverses.of(K, FieldTransform(shape, np.float64))
    addition = 3.0 * rng.random(shape)
    r = rng.standard_normal((K.shape[0] // np.prod(shape), *shape))
    inside = rng.random(shape) < 0.7

    def project(X):
        X *= inside

    whole, uniform = (
        M.at(given)(r, project).reshape(len(r), -1)
        for given in (addition, np.full(shape, addition.flat[7]))
    )
    assert_allclose(uniform[:, 7], whole[:, 7])


def test_inverses_of_large_additions_are_right_to_second_order():
    K = rolling_on((9, 14))
    M, k0 = ShiftedInverses.of(K, FieldTransform((9, 14), np.float64)), K.component(0).c.flat[0]
    r, errors = np.random.default_rng(5).standard_normal((2, 9, 14)), []
    for nu in (1e3, 1e4):
        y = M.at(np.full((9, 14), nu * k0))(r, nothing)
        again = np.stack([(K.component(i) @ y[i].ravel()).reshape(9, 14) for i in range(2)])
        errors.append(np.abs(again + nu * k0 * y - r).max())
    # The fields are x - x² (K - k₀) + ..., with x = 1/ν, but for what bounds the inverse.
    assert errors[0] < 1e-3 * np.abs(r).max()
    assert errors[1] < 0.15 * errors[0]


def test_inverses_are_interpolated_over_what_the_diagonal_leaves_of_them():
    additions = np.array([0.0, 0.3, 2.0])
    at_nodes, local = interpolate(additions, np.float64, additions)
    assert_allclose(at_nodes, np.eye(3), atol=1e-15)
    assert_allclose(local, 0.0, atol=1e-15)
    # Where K is its diagonal, here 1, the inverse is known for any addition.
    given, nodes = np.geomspace(1e-3, 1e3, 40), 1.0 / (1.0 + additions)
    weights, local = interpolate(given, np.float64, additions)
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
            assert n <= length <= next_fast_len(2 * n - 1)


def eigenvalues_on_runs(area, i):
    """Those of the approximate inverse on an area times the matrix of rolling, of a component."""
    K, longer = rolling_on(area.shape), (area.shape[0] + 1, area.shape[1])
    A, m = influence_matrix("xy", longer, (0.5, 0.8), BODY), np.count_nonzero(area)
    inverse = InverseOnRuns(A.component(i), area, np.float64)
    units = np.zeros((m, *area.shape))
    units[:, area] = np.eye(m)
    P = np.array([inverse(unit)[area] for unit in units]).T
    return np.linalg.eigvals(P @ (MaskedOperator(K.component(i), area) @ np.eye(m)))


@pytest.mark.parametrize("rows", [slice(1, 13), slice(0, 16), slice(4, 5)])
def test_on_one_run_of_elements_the_inverse_is_exact(rows):
    area = np.zeros((16, 5), bool)
    area[rows, 2] = True
    for i in range(2):
        assert_allclose(eigenvalues_on_runs(area, i), 1.0, atol=1e-11)


@pytest.mark.parametrize("share", [0.2, 0.5, 0.8, 1.0])
def test_on_a_fragmented_area_corrections_by_the_inverse_converge(share):
    area = np.random.default_rng(0).random((18, 14)) < share
    for i in range(2):
        assert np.abs(eigenvalues_on_runs(area, i) - 1.0).max() < 0.9
