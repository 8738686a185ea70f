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
    direct_below,
    half_space,
    iterations,
    operator,
)
from tests.test_fsai_update import kept
from toeplitz_mg.halfspace import all_offsets, influence_xx, influence_xy, influence_yy
from toeplitz_mg.operators import BlockDiagonal
from toeplitz_mg.preconditioners.fsai.build import build
from toeplitz_mg.preconditioners.fsai.coupled import strongly_coupled
from toeplitz_mg.preconditioners.fsai.levels import Cells, Patched
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
    with direct_below(4):
        eigenvalues = spectrum(A, fsai_preconditioner(A))
    assert eigenvalues[0] > 0.1
    assert eigenvalues[-1] < 3.0


@pytest.mark.slow
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("area", ["full", "rough 60 %", "random 50 %", "checkerboard"])
def test_its_eigenvalues_are_nearer_to_one_than_those_by_component(area, dtype):
    A = tmg.MaskedOperator(tangential((28, 28)), areas(28)[area])
    single = tmg.MaskedOperator(tangential((28, 28), dtype=dtype), A.mask)
    with direct_below(60):
        P, by_component = fsai_preconditioner(single), blocks(A)
    assert P.dtype == dtype
    dense = P @ np.eye(A.shape[0])
    assert np.linalg.eigvalsh((dense + dense.T) / 2.0)[0] > 0.0
    half = np.linalg.cholesky(A.toarray())
    new = np.linalg.eigvalsh(half.T @ (dense + dense.T) @ half / 2.0)
    old = spectrum(A, by_component)
    assert new[-1] / new[0] < 0.9 * old[-1] / old[0]
    assert new[-1] / new[0] < 2.0


def blocks(A):
    """The preconditioner of each component."""
    components = [tmg.MaskedOperator(A.full.component(a), A.mask[a]) for a in (0, 1)]
    return BlockDiagonal([fsai_preconditioner(B) for B in components], A.full.grid_shape)


@pytest.mark.parametrize("same", [True, False])
def test_aggregates_are_orthonormal_and_their_loads_known(same):
    """W = U (UᵀU)^(-1/2), U of the two columns G c on each aggregate."""
    stencil = strongly_coupled(tangential((20, 26)))
    masks = np.random.default_rng(0).random((2, 20, 26)) < 0.6
    masks[1] = masks[0] if same else masks[1]
    masks[1, :4, :4] = False
    with direct_below(4):
        level = build(stencil, Cells.of_mask(stencil, masks), np.dtype(float))
    assert len(level.sizes) >= 3
    totals = [load.sum() for load in stencil.full_load]
    while hasattr(level, "W"):
        G, W, cells = level.G.toarray(), level.W.toarray(), level.cells
        assert_allclose(W.T @ W, np.eye(W.shape[1]), atol=1e-12)
        c = cells.c[cells.contact].astype(float)
        first = np.count_nonzero(cells.contact[: stencil.grid.size])
        loads = np.stack([c[:first] @ (G.T @ W)[:first], c[first:] @ (G.T @ W)[first:]])
        coarse = level.coarse.cells
        component = np.repeat([0, 1], stencil.coarser.grid.size)[coarse.contact]
        own = loads[component, np.arange(len(component))]
        assert_allclose(own, coarse.c[coarse.contact] * np.array(totals)[component], rtol=1e-12)
        assert_array_equal(own > 0.0, True)
        stencil, level = stencil.coarser, level.coarse
        totals = [load.sum() for load in stencil.full_load]


def test_the_coarser_kernel_is_that_of_aggregates_in_full_contact():
    """Far away exactly the mean over pairs of cells, even or odd as the kernel itself."""
    stencil = strongly_coupled(tangential((32, 32)))
    T = stencil.coarser.T
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


# Which, and updates ---------------------------------------------------------------------------


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


@settings(deadline=None, max_examples=40)
@given(
    st.sampled_from([(18, 22), (40, 7), (1, 30), (26, 26)]),
    st.floats(0.0, 1.0),
    st.floats(0.0, 0.3),
    st.floats(0.5, 4.0),
    st.integers(0, 999),
)
def test_an_update_that_keeps_nothing_is_what_a_new_one_is(shape, density, change, ratio, seed):
    """Of masks that are alike in both components, or not, or nowhere true in one."""
    rng = np.random.default_rng(seed)
    mask, flipped = rng.random((2, *shape)) < density, rng.random((2, *shape)) < change
    mask[seed % 2] &= seed % 3 > 0
    mask[seed % 2 - 1].flat[0] = True
    other = mask ^ flipped
    other[seed % 2].flat[1] = True
    A = tangential(shape, 0.5, ratio)
    with direct_below(4), kept(0.0):
        P = fsai_preconditioner(tmg.MaskedOperator(A, mask))
        if not isinstance(P, MultilevelSparseInverse):  # one axis
            return
        before = P @ np.eye(P.shape[0])
        for masks in (other, mask):
            Q = P.updated(masks)
            fresh = fsai_preconditioner(tmg.MaskedOperator(A, masks))
            assert Q.sizes == fresh.sizes
            assert Q._stencil is P._stencil
            expected = fresh @ np.eye(fresh.shape[0])
            assert_allclose(Q @ np.eye(Q.shape[0]), expected, atol=1e-12 * abs(before).max())
    assert_array_equal(P @ np.eye(P.shape[0]), before)  # it has not changed


@pytest.mark.slow
@settings(deadline=None, max_examples=15)
@given(st.sampled_from([(26, 26), (18, 40)]), st.floats(0.3, 1.0), st.integers(0, 999))
def test_updates_one_after_the_other_are_what_a_new_one_is(shape, density, seed):
    """Of which one clears a component, and one brings it back."""
    rng, full = np.random.default_rng(seed), tangential(shape)
    mask = rng.random((2, *shape)) < density
    mask[:, 0, 0] = True
    with direct_below(4), kept(0.0):
        P = fsai_preconditioner(tmg.MaskedOperator(full, mask))
        for k in range(8):
            i, j = (rng.integers(n) for n in shape)
            mask = mask.copy()
            mask[k % 2, i : i + 5, j : j + 5] ^= True
            mask[1, 0, 0] = True
            mask[0] = mask[1] if k == 5 else mask[0] & (k != 4)
            P = P.updated(mask)
            A = tmg.MaskedOperator(full, mask)
            fresh = fsai_preconditioner(A)
            assert P.sizes == fresh.sizes
            x = rng.standard_normal(A.shape[0])
            assert_allclose(P @ x, fresh @ x, rtol=0, atol=1e-11 * abs(fresh @ x).max())
            P = pickle.loads(pickle.dumps(P)) if k == 6 else P


@pytest.mark.parametrize("area", ["rough 30 %", "random 50 %", "circle"])
def test_an_update_takes_the_iterations_of_a_new_one(area):
    """At most one more, after three updates too; and each has less to compute."""
    n, rng = 128, np.random.default_rng(0)
    full, mask = tangential((n, n)), np.stack([areas(n)[area]] * 2)
    P = fsai_preconditioner(tmg.MaskedOperator(full, mask))
    for _ in range(3):
        mask = mask ^ (rng.random(mask.shape) < 0.003)
        P = P.updated(mask)
        assert isinstance(P._level, Patched)
        A = tmg.MaskedOperator(full, mask)
        b = rng.standard_normal(A.shape[0])
        assert iterations(A, P, b) <= iterations(A, fsai_preconditioner(A), b) + 1


@pytest.mark.parametrize("nu", [0.28, 0.5])
def test_updates_take_the_masks_that_a_masked_operator_takes(nu):
    P = fsai_preconditioner(tangential((12, 12), nu))
    mask = np.random.default_rng(0).random((12, 12)) < 0.4
    x = np.ones(2 * mask.sum())
    assert_array_equal(P.updated(mask) @ x, P.updated(np.stack([mask, mask])) @ x)
    for shape in ((12,), (1, 12, 12), (3, 12, 12)):
        with pytest.raises(ValueError, match="but A lives on the grid"):
            P.updated(np.ones(shape, bool))


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
    stencil = strongly_coupled(tangential((40, 40)))
    strong = stencil.T.copy()
    strong[[0, 1], [1, 0]] *= 4.0
    stencil = Stencil(strong)
    cells = Cells.of_mask(stencil, np.ones((2, 40, 40), bool))
    with pytest.raises(np.linalg.LinAlgError, match=r"-.* must be positive: A is not"):
        build(stencil, cells, np.dtype(float))


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
