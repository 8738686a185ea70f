"""Theorems of the multilevel sparse approximate inverse of two coupled components."""

import pickle

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

import toeplitz_mg as tmg
from tests.test_fsai import (
    areas,
    both_iterations,
    fsai_direct_below,
    half_space,
    operator,
)
from toeplitz_mg.halfspace import all_offsets, influence_xx, influence_xy, influence_yy
from toeplitz_mg.operators import BlockDiagonal
from toeplitz_mg.preconditioners.fsai.aggregates import aggregate
from toeplitz_mg.preconditioners.fsai.build import Options, build, compute_rows
from toeplitz_mg.preconditioners.fsai.coupled import find_coupled_stencil
from toeplitz_mg.preconditioners.fsai.levels import Level, LevelMatrix
from toeplitz_mg.preconditioners.fsai.preconditioner import (
    MultilevelSparseInverse,
    fsai_preconditioner,
)
from toeplitz_mg.preconditioners.fsai.stencil import Stencil


def tangential(shape, nu=0.5, ratio=1.0, dtype=np.float64):
    element = (1.0, ratio)
    points = all_offsets(shape, element)
    xx, xy, yy = (
        tmg.ToeplitzOperator.from_lags(a(*points, element, G=1.0, nu=nu).astype(dtype))
        for a in (influence_xx, influence_xy, influence_yy)
    )
    return tmg.CoupledOperator([[xx, xy], [xy, yy]])


# Positive definite, and near the inverse -------------------------------------------------------


def spectrum(A, P):
    dense = P @ np.eye(A.shape[0])
    assert_allclose(dense, dense.T, atol=1e-12 * abs(dense).max())
    half = np.linalg.cholesky(A.toarray())
    return np.linalg.eigvalsh(half.T @ dense @ half)


@settings(deadline=None, max_examples=60)
@given(
    st.integers(2, 20),
    st.integers(2, 20),
    st.floats(0.0, 1.0),
    st.floats(0.2, 5.0),
    st.floats(0.36, 0.5),
    st.booleans(),
    st.integers(0, 999),
)
@example(2, 9, 1.0, 3.0, 0.5, False, 0)  # two shapes of aggregates reach beyond the grid
def test_half_space_matrices_are_never_refused(n1, n2, density, ratio, nu, same, seed):
    """Any grid and any masks, of one component or of both, alike or not."""
    A = tangential((n1, n2), nu, ratio)
    rng = np.random.default_rng(seed)
    mask = rng.random((1 if same else 2, n1, n2)) < density
    mask.flat[seed % mask.size] = True
    A = tmg.MaskedOperator(A, np.broadcast_to(mask, (2, n1, n2)))
    eigenvalues = spectrum(A, fsai_direct_below(A, 4))
    assert eigenvalues[0] > 0.1
    assert eigenvalues[-1] < 3.0


@pytest.mark.slow
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("area", ["full", "rough 60 %", "random 50 %", "checkerboard"])
def test_its_eigenvalues_are_nearer_to_one_than_those_by_component(area, dtype):
    A = tmg.MaskedOperator(tangential((28, 28)), areas(28)[area])
    single = tmg.MaskedOperator(tangential((28, 28), dtype=dtype), A.mask)
    P, by_component = fsai_direct_below(single, 60), blocks(A, 60)
    assert P.dtype == dtype
    dense = P @ np.eye(A.shape[0])
    assert np.linalg.eigvalsh((dense + dense.T) / 2.0)[0] > 0.0
    half = np.linalg.cholesky(A.toarray())
    new = np.linalg.eigvalsh(half.T @ (dense + dense.T) @ half / 2.0)
    old = spectrum(A, by_component)
    assert new[-1] / new[0] < 0.9 * old[-1] / old[0]
    assert new[-1] / new[0] < 2.0


def blocks(A, direct=600):
    """The preconditioner of each component."""
    components = [tmg.MaskedOperator(A.full.component(a), A.mask[a]) for a in (0, 1)]
    return BlockDiagonal([fsai_direct_below(B, direct) for B in components], A.full.grid_shape)


def applied(level):
    """What a level makes of some vector."""
    x = np.random.default_rng(0).standard_normal(level.sizes[0])
    y = np.empty_like(x)
    level.multiply(x, y)
    return y


@pytest.mark.parametrize("same", [True, False])
def test_aggregates_are_orthonormal_and_their_loads_known(same):
    """W = U (UᵀU)^(-1/2), U of the two columns G c on each aggregate."""
    stencil = find_coupled_stencil(tangential((20, 26)))
    masks = np.random.default_rng(0).random((2, 20, 26)) < 0.6
    masks[1] = masks[0] if same else masks[1]
    masks[1, :4, :4] = False
    matrix = LevelMatrix.of_mask(stencil, masks)
    options = np.dtype(float), Options(direct=4)
    level = build(stencil, matrix, *options)
    assert len(level.sizes) >= 3
    totals = [load.sum() for load in stencil.full_load]
    while isinstance(level, Level):
        G, W = level.G.toarray(), level.W.toarray()
        assert_allclose(W.T @ W, np.eye(W.shape[1]), atol=1e-12)
        at = np.flatnonzero(matrix.active)
        rows = compute_rows(stencil, matrix, at)
        E, _ = aggregate(stencil, stencil.coarser, matrix, rows, at)
        assert_array_equal(applied(level.coarse), applied(build(stencil.coarser, E, *options)))
        c = matrix.c[at].astype(float)
        first = np.count_nonzero(at < stencil.grid.size)
        loads = np.stack([c[:first] @ (G.T @ W)[:first], c[first:] @ (G.T @ W)[first:]])
        component = np.repeat([0, 1], stencil.coarser.grid.size)[E.active]
        own = loads[component, np.arange(len(component))]
        assert_allclose(own, E.c[E.active] * np.array(totals)[component], rtol=1e-12)
        assert_array_equal(own > 0.0, True)
        stencil, matrix, level = stencil.coarser, E, level.coarse
        totals = [load.sum() for load in stencil.full_load]


def test_the_coarser_kernel_is_that_of_aggregates_in_full_contact():
    """Far away exactly the mean over pairs of cells, even or odd as the kernel itself."""
    stencil = find_coupled_stencil(tangential((32, 32)))
    T = stencil.coarser.kernel
    assert_array_equal(T[0, 1], T[1, 0])
    assert_array_equal(T[0, 1, 0], 0.0)
    assert_array_equal(T[0, 1, :, 0], 0.0)
    block = np.indices((4, 4)).reshape(2, -1).T
    lags = np.array([12, 20]) + block[:, None] - block
    totals = [load.sum() for load in stencil.full_load]
    for a, b in ((0, 0), (0, 1), (1, 1)):
        mean = stencil.at(a, b, lags).mean()
        assert_allclose(T[a, b, 3, 5], totals[a] * totals[b] * mean, rtol=1e-12)


# Iterations -----------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [1.0, 4.0, 0.25])
@pytest.mark.parametrize("nu", [0.0, 0.28, 0.4, 0.5])
@pytest.mark.parametrize(
    "area",
    ["full", "circle", "rough 30 %", "random 50 %", "stripes", "stripes across", "checkerboard"],
)
def test_iterations_are_at_most_ten_and_eleven(area, nu, ratio):
    """The bounds of the normal kernel on square cells are 8 and 9."""
    A = tmg.MaskedOperator(tangential((128, 128), nu, ratio), areas(128)[area])
    constant, random = both_iterations(A)
    assert constant <= 10
    assert random <= 11


@pytest.mark.parametrize("shape", [(256, 256), (211, 97), (400, 30)], ids=str)
@pytest.mark.parametrize("density", [0.5, 1.0])
def test_iterations_do_not_depend_on_the_grid(shape, density):
    mask = np.random.default_rng(0).random(shape) < density
    A = tmg.MaskedOperator(tangential(shape), mask)
    constant, random = both_iterations(A)
    assert constant <= 10
    assert random <= 11
    by_component = both_iterations(A, blocks(A))
    assert constant < by_component[0]
    assert random < by_component[1]


# Which, and what fails -------------------------------------------------------------------------


def test_a_weak_coupling_or_one_of_another_kind_is_left_out():
    assert isinstance(fsai_preconditioner(tangential((12, 12), 0.36)), MultilevelSparseInverse)
    assert isinstance(fsai_preconditioner(tangential((12, 12), 0.3)), BlockDiagonal)
    xx = tmg.ToeplitzOperator(half_space(12))
    even = tmg.ToeplitzOperator(0.3 * half_space(12))
    for others in (None, even):
        A = tmg.CoupledOperator([[xx, others], [others, xx]])
        assert isinstance(fsai_preconditioner(A), BlockDiagonal)
    line = tangential((1, 12))
    assert isinstance(fsai_preconditioner(line), BlockDiagonal)


def test_copies_rows_and_work():
    A = tmg.MaskedOperator(tangential((128, 128)), areas(128)["circle"])
    P = fsai_preconditioner(A)
    X = np.random.default_rng(0).standard_normal((A.shape[0], 3))
    columns = np.stack([P @ x for x in X.T], axis=1)
    assert_allclose(P @ X, columns, rtol=1e-12, atol=1e-12 * abs(columns).max())
    assert_array_equal(pickle.loads(pickle.dumps(P)) @ X[:, 0], columns[:, 0])
    single = fsai_preconditioner(A, dtype=np.float32) @ X
    assert_allclose(single, columns, atol=1e-5 * abs(columns).max())
    normal = fsai_preconditioner(operator(half_space(128), areas(128)["circle"]))
    assert P.points / P.mask.size < 1.4 * normal.points / normal.mask.size


def test_it_says_what_fails():
    stencil = find_coupled_stencil(tangential((40, 40)))
    strong = stencil.kernel.copy()
    strong[[0, 1], [1, 0]] *= 4.0
    stencil = Stencil(strong)
    matrix = LevelMatrix.of_mask(stencil, np.ones((2, 40, 40), bool))
    with pytest.raises(np.linalg.LinAlgError, match=r"-.* must be positive: A is not"):
        build(stencil, matrix, np.dtype(float))


@pytest.mark.parametrize("scale", [1e-200, 1e-30, 1e200])
def test_any_scale(scale):
    A = tangential((40, 40))
    scaled = tmg.CoupledOperator(
        [[tmg.ToeplitzOperator.from_lags(scale * t.lags) for t in row] for row in A.blocks]
    )
    b = np.random.default_rng(0).standard_normal(A.shape[0])
    P = fsai_preconditioner(scaled)
    assert isinstance(P, MultilevelSparseInverse)
    expected = fsai_preconditioner(A) @ b
    assert_allclose(scale * (P @ b), expected, rtol=0, atol=1e-10 * abs(expected).max())


def test_a_coupling_of_another_size_is_left_out():
    """Stronger than any of a half-space, or of components that need more neighbours."""
    A = tangential((40, 40))
    (xx, xy), (_, yy) = A.blocks
    strong = tmg.ToeplitzOperator.from_lags(1.5 * xy.lags)
    A = tmg.CoupledOperator([[xx, strong], [strong, yy]])
    assert isinstance(fsai_preconditioner(A), BlockDiagonal)
    k = np.arange(-39.0, 40.0)
    r = np.hypot(*np.ix_(k, k)) / 1.2
    smooth = tmg.ToeplitzOperator.from_lags((1.0 + r) * np.exp(-r))
    between = tmg.ToeplitzOperator.from_lags(
        np.outer(np.sign(k), np.sign(k)) * 0.25 * (r > 0.0) * np.exp(-r)
    )
    A = tmg.CoupledOperator([[smooth, between], [between, smooth]])
    assert isinstance(fsai_preconditioner(A), BlockDiagonal)
