"""The sparse approximate inverse is what it is defined to be, on grids small enough to compare.

On all its levels the rows of G, the aggregates, their loads and the coarser kernel are those of
the definition, a whole line is the same in its own form, and a trial tells the iterations.
"""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

import toeplitz_mg as tmg
from tests.cases import contact, exponential
from tests.test_fsai import both_iterations, half_space, matern, operator, spectrum, tangential
from toeplitz_mg import fsai_preconditioner
from toeplitz_mg.halfspace import influence_zz, offsets
from toeplitz_mg.preconditioners.fsai.aggregates import aggregate
from toeplitz_mg.preconditioners.fsai.build import Options, build, compute_rows
from toeplitz_mg.preconditioners.fsai.cellgrid import AGGREGATE
from toeplitz_mg.preconditioners.fsai.coupled import find_coupled_stencil
from toeplitz_mg.preconditioners.fsai.levels import Level, LevelMatrix
from toeplitz_mg.preconditioners.fsai.line import LineMatrix, build_line
from toeplitz_mg.preconditioners.fsai.neighbours import count_iterations
from toeplitz_mg.preconditioners.fsai.preconditioner import fsai_with_options
from toeplitz_mg.preconditioners.fsai.rows import solve_rows
from toeplitz_mg.preconditioners.fsai.stencil import Stencil


def fsai_direct_below(A, n):
    """Grids small enough for dense matrices have several levels then."""
    return fsai_with_options(A, Options(direct=n))


# The definition, cell by cell -----------------------------------------------------------------


def at(T, lags):
    """Coefficients at lags: even in both axes, and beyond the grid that of its last lag."""
    k = np.minimum(np.abs(lags), np.subtract(T.shape, 1))
    return T[k[..., 0], k[..., 1]]


def neighbours_of(T):
    """The lags of the cells that a row of G sees, its own first, and τ, farther than they are."""
    lags = [(i, j) for i in range(13) for j in range(-12, 13) if (i, j) > (0, 0)]
    lags = [k for k in lags if k[0] < T.shape[0] and abs(k[1]) < T.shape[1]]
    lags.sort(key=lambda k: (-abs(T[k[0], abs(k[1])]), k[0] + abs(k[1])))
    lags = np.array([(0, 0), *lags[:12]])
    i, j = np.minimum(2 * np.abs(lags).max(axis=0) + 2, np.subtract(T.shape, 1))
    return lags, min(T[k] for k in ((i, 0), (0, j)) if k != (0, 0))


def aggregate_of(T):
    """16 cells over whose sides the kernel decays alike."""
    n1, n2 = T.shape
    shapes = [(h, 16 // h) for h in (1, 2, 4, 8, 16) if h < 2 * n1 and 16 // h < 2 * n2]
    ends = {h: (at(T, np.array([h[0], 0])), at(T, np.array([0, h[1]]))) for h in shapes or [(4, 4)]}
    return min(ends, key=lambda h: abs(ends[h][0] - ends[h][1]))


def row_of(S):
    x = np.linalg.inv(S)[0]
    return x / np.sqrt(x[0])


def coarser_kernel(T, row, lags, block):
    """The coefficients of aggregates in full contact, and the load of one."""
    inside = np.indices(block).reshape(2, -1).T
    seen, load = (inside[:, None] - lags).reshape(-1, 2), np.tile(row, len(inside)) / 4.0
    coarse = np.empty([-(-n // h) for n, h in zip(T.shape, block, strict=True)])
    for K in np.ndindex(coarse.shape):
        shifts = [np.multiply(K, block) * sign for sign in ((1, 1), (1, -1))]
        if max(K) < 3:
            coarse[K] = np.mean([load @ at(T, seen[:, None] - seen + s) @ load for s in shifts])
        else:
            coarse[K] = load.sum() ** 2 * at(T, inside[:, None] - inside + shifts[0]).mean()
    return coarse, load.sum()


def dense_P(T, cells, c, d, smooth, direct):
    """P for cells, shape (N, 2), with the weights c, the diagonal d, and a smooth vector."""
    A = c[:, None] * at(T, cells[:, None] - cells) * c
    np.fill_diagonal(A, d)
    if len(cells) <= direct:
        return np.linalg.inv(A)
    lags, tau = neighbours_of(T)
    places = {tuple(cell): p for p, cell in enumerate(cells.tolist())}
    G = np.zeros(A.shape)
    for p, cell in enumerate(cells):
        near = [places[k] for k in map(tuple, (cell - lags).tolist()) if k in places]
        G[p, near] = row_of(A[np.ix_(near, near)] - tau * np.outer(c[near], c[near]))
    blocks, member = np.unique(cells // aggregate_of(T), axis=0, return_inverse=True)
    W = (G @ smooth)[:, None] * np.equal.outer(member.ravel(), np.arange(len(blocks)))
    norms = np.linalg.norm(W, axis=0)
    W /= norms
    loads = G.T @ W
    full = row_of(at(T, lags[:, None] - lags) - tau)
    T_H, total = coarser_kernel(T, full, lags, aggregate_of(T))
    d_H = np.einsum("ij,ik,kj->j", loads, A, loads, optimize=True)
    E_inverse = dense_P(T_H, blocks, loads.T @ c / total, d_H, norms, direct)
    return G.T @ (np.eye(len(cells)) - W @ W.T + W @ E_inverse @ W.T) @ G


DEFINED = {
    "square cells": (contact(26, 23), 1.0, (4, 4)),
    "masked": (contact(26, 23), 0.4, (4, 4)),
    "stretched": (half_space(24, 4.0), 0.6, (8, 2)),
    "stretched the other way": (half_space(24, 0.25), 0.6, (2, 8)),
    "one level": (exponential(200), 0.7, (1, 16)),
    "1 x n": (exponential(1, 200), 0.7, (1, 16)),
    "n x 1": (exponential(200, 1), 0.7, (16, 1)),
    "2 x n": (contact(2, 120), 0.7, (2, 8)),
}


@pytest.mark.parametrize("name", DEFINED)
def test_it_is_what_it_is_defined_to_be(name):
    column, density, block = DEFINED[name]
    mask = np.random.default_rng(0).random(column.shape) < density
    T, cells = np.atleast_2d(column), np.argwhere(np.atleast_2d(mask))
    assert aggregate_of(T) == block
    ones = np.ones(len(cells))
    expected = dense_P(T, cells, ones, T[0, 0] * ones, ones, 5)
    P = fsai_direct_below(operator(column, mask), 5)
    assert len(P.sizes) >= 3
    assert_allclose(P @ np.eye(P.shape[0]), expected, rtol=1e-9, atol=1e-10 * abs(expected).max())


def test_the_table_of_rows_is_what_each_pattern_gives():
    stencil = Stencil.of_one(contact(20, 30))
    bits = np.arange(4096) >> np.arange(12)[:, None] & 1
    c = np.vstack([np.ones((1, 4096)), bits])
    expected = solve_rows(stencil.near[0], c, np.where(c == 1.0, stencil.zero[0], 1.0))
    assert_allclose(stencil.table, expected, rtol=1e-12, atol=1e-13 * abs(expected).max())


def test_rows_are_those_of_the_table_without_it():
    """As they are computed where there are too many neighbours for a table of patterns."""
    stencil = Stencil.of_one(contact(40, 50))
    mask = np.random.default_rng(0).random((40, 50)) < 0.6
    matrix, options = LevelMatrix.of_mask(stencil, mask), Options(direct=20)
    assert matrix.by_table
    by_table = build(stencil, matrix, np.dtype(float), options)
    without = build(stencil, matrix.without_table(), np.dtype(float), options)
    x = np.random.default_rng(1).standard_normal(mask.sum())
    assert len(without.sizes) == 3
    assert_allclose(without(x), by_table(x), rtol=1e-10, atol=1e-12)


# Small grids of many levels --------------------------------------------------------------------


@pytest.mark.slow
@settings(deadline=None, max_examples=80)
@given(
    st.integers(1, 25),
    st.integers(1, 25),
    st.floats(0.0, 1.0),
    st.floats(0.2, 5.0),
    st.sampled_from(["one", "two, alike", "two"]),
    st.integers(0, 999),
)
@example(2, 9, 1.0, 3.0, "two, alike", 0)  # two shapes of aggregates reach beyond the grid
def test_any_grid_and_masks_from_one_cell_to_all(n1, n2, density, ratio, components, seed):
    """Of one component, or of two with the same mask or others."""
    rng = np.random.default_rng(seed)
    mask = rng.random((2 if components == "two" else 1, n1, n2)) < density
    mask.flat[seed % mask.size] = True
    A, element = tangential((n1, n2), 0.5 - 0.14 * (seed % 2), ratio), (1.0, ratio)
    if components == "one":
        c = influence_zz(*offsets((n1, n2), element), element, G=1.0, nu=0.28)
        A, mask = tmg.ToeplitzOperator(c), mask[0]
    A = tmg.MaskedOperator(A, np.broadcast_to(mask, A.grid_shape))
    eigenvalues = spectrum(A, fsai_direct_below(A, 4))
    assert eigenvalues[0] > 0.1
    assert eigenvalues[-1] < 3.0


# Two components --------------------------------------------------------------------------------


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


def test_components_that_are_coupled_too_strongly_are_refused():
    stencil = find_coupled_stencil(tangential((40, 40)))
    strong = stencil.kernel.copy()
    strong[[0, 1], [1, 0]] *= 4.0
    stencil = Stencil(strong)
    matrix = LevelMatrix.of_mask(stencil, np.ones((2, 40, 40), bool))
    with pytest.raises(np.linalg.LinAlgError, match=r"-.* must be positive: A is not"):
        build(stencil, matrix, np.dtype(float))


# A whole line, and the trial --------------------------------------------------------------------


@pytest.mark.parametrize("n", [129, 130, 143, 144, 145, 1000, 2049, 4097, 20_000])
@pytest.mark.parametrize("column", [contact, lambda n: 0.9 ** np.arange(n)])
def test_it_is_the_inverse_of_any_area_on_a_whole_line(column, n):
    kernel = column(n)
    stencil = Stencil(kernel[np.newaxis, np.newaxis, np.newaxis], AGGREGATE - 1, AGGREGATE - 1)
    matrix = LevelMatrix.of_mask(stencil, np.ones((1, n), bool))
    general = build(stencil, matrix, np.dtype(float), Options(direct=Options().direct_on_line))
    P = build_line(LineMatrix.of_kernel(kernel), np.dtype(float))
    assert P.sizes == general.sizes
    x = np.random.default_rng(0).standard_normal(n)
    expected = general(x)
    assert_allclose(P(x), expected, rtol=0, atol=1e-13 * abs(expected).max())


@pytest.mark.slow
def test_a_trial_tells_how_many_iterations_larger_grids_take():
    """Of kernels that need few neighbours, or many, or are stretched, and of each number."""
    kernels = [matern((128, 128), 0.5, length) for length in (1.0, 3.0, 5.0)]
    kernels += [matern((128, 128), 1.5, 2.0), matern((128, 128), 2.5, 1.5)]
    kernels += [half_space(128), half_space(128, 50.0)]
    few = np.random.default_rng(3).random((128, 128)) < 0.1
    for c in kernels:
        for number in (12, 24, 40):
            found = count_iterations(Stencil.of_one(c, number))
            taken = 0
            for A in (operator(c, few), operator(c, ~few)):
                taken = max(taken, *both_iterations(A, fsai_preconditioner(A, neighbours=number)))
            # It counts a fraction of the last iteration, and up to 1.2 times as many are expected.
            assert found / 1.1 <= taken <= 1.2 * found + 1.0
