"""A grid of elements in slabs, its windows and its matrices are those of one process.

`python -m tests.slabs tests.inside.slabs_grid` runs these cases on a rank (see `tests.slabs`).
"""

import numpy as np
from numpy.testing import assert_allclose

from tests.slabs.pressing import STEEL
from toeplitz_mg import slabs
from toeplitz_mg.contact.grid import Grid
from toeplitz_mg.slabs.grid import SlabGrid

SHAPES = [(40, 9), (41, 33), (130, 70), (150, 131), (257, 64)]


def grid_on(comm, shape, unit=None):
    """A grid in slabs, and that grid on one rank."""
    whole = Grid.of(shape, (0.02, 0.03), STEEL, None)
    return SlabGrid.of_rows(whole, slabs.Slab(comm, shape, unit=unit)), whole


def test_coarser_fields_are_those_of_one_rank(comm):
    rng = np.random.default_rng(0)
    for shape in SHAPES:
        for components in ((), (2,)):
            grid, whole = grid_on(comm, shape)
            while (coarse := grid.coarser()) is not None:
                coarser = whole.coarser()
                assert coarse.shape == coarser.shape
                assert coarse.element == coarser.element
                x = rng.random((*components, *whole.shape))
                y = rng.random((*components, *coarser.shape))
                of_rank = slice(None)
                if isinstance(coarse, SlabGrid):
                    of_rank = coarse.slab.rows
                mean = grid.coarsen(x[..., grid.slab.rows, :])
                assert np.array_equal(mean, whole.coarsen(x)[..., of_rank, :])
                fine = grid.refine(y[..., of_rank, :])
                assert np.array_equal(fine, whole.refine(y)[..., grid.slab.rows, :])
                if not isinstance(coarse, SlabGrid):
                    break
                grid, whole = coarse, coarser


def test_a_line_is_coarsened_as_far_as_on_one_rank(comm):
    x = np.random.default_rng(0).random((100, 1))
    grid, whole = grid_on(comm, x.shape)
    assert grid.coarser() is whole.coarser() is None
    coarse = grid.coarser(1)
    assert coarse.shape == whole.coarser(1).shape == (50, 1)
    mean = grid.coarsen(x[grid.slab.rows])
    assert np.array_equal(mean, whole.coarsen(x))
    assert np.array_equal(grid.refine(mean), whole.refine(mean)[grid.slab.rows])


def test_lines_and_edges_are_those_of_one_rank(comm):
    rng = np.random.default_rng(1)
    for shape in SHAPES:
        grid, whole = grid_on(comm, shape)
        C = rng.random(shape) < 0.4
        rows = grid.slab.rows
        assert grid.fragmentation(C[rows]) == whole.fragmentation(C)
        for axis in (0, 1):
            lines = grid.slab.everywhere(np.ascontiguousarray(grid.lines(C[rows], axis)))
            assert np.array_equal(lines, whole.lines(C, axis))


def test_matrices_of_rolling_are_those_of_the_rows(comm):
    for shape in ((40, 9), (41, 33)):
        grid, whole = grid_on(comm, shape)
        q = np.random.default_rng(3).standard_normal((2, *shape))
        own = np.ascontiguousarray(q[:, grid.slab.rows])
        A = whole.tangential()
        for of_rank, of_all in (
            (grid.upstream(), whole.upstream()),
            (grid.steady(grid.tangential()), whole.steady(A)),
        ):
            expected = (of_all @ q.ravel()).reshape(q.shape)[:, grid.slab.rows]
            y = of_rank.apply(own.reshape(-1)).reshape(own.shape)
            assert_allclose(y, expected, atol=1e-13 * np.abs(expected).max())
            assert grid.diagonal(of_rank) == whole.diagonal(of_all)


def assert_same_window(comm, shape, elements, margin):
    """Assert that fields are cut and extended as on one rank; return the grid of the window."""
    grid, whole = grid_on(comm, shape)
    rows, mask = grid.slab.rows, np.zeros(shape, bool)
    mask[elements] = True
    own, alone = grid.window(mask[rows], margin), whole.window(mask, margin)
    cut = alone.box
    if own.box != alone.box:  # Each rank has a row.
        assert isinstance(own.grid, SlabGrid)
        assert own.box[1] == cut[1]
        assert own.box[0].stop - own.box[0].start == comm.size > cut[0].stop - cut[0].start
        cut = own.box
    mine = own.grid.slab.rows if isinstance(own.grid, SlabGrid) else slice(None)
    for components, dtype in (((), bool), ((2,), float), ((3, 2), float)):
        x = np.random.default_rng(0).random((*components, *shape)).astype(dtype)
        y = own.cut(x[..., rows, :])
        assert y.flags.c_contiguous
        assert np.array_equal(y, x[(..., *cut)][..., mine, :])
        back = np.zeros_like(x)
        back[(..., *cut)] = x[(..., *cut)]
        assert np.array_equal(own.extend(y), back[..., rows, :])
    return own.grid


def test_fields_of_a_window_of_many_elements(comm):
    some = np.s_[40:200, 3:60]  # Some ranks have none of these rows.
    assert isinstance(assert_same_window(comm, (257, 64), some, 0.1), SlabGrid)
    assert isinstance(assert_same_window(comm, (257, 64), some, 0.0), SlabGrid)
    assert isinstance(assert_same_window(comm, (200, 80), np.s_[60:60, :], 0.0), SlabGrid)
    assert isinstance(assert_same_window(comm, (9, 9000), np.s_[8:, 2::3], 0.0), SlabGrid)
    assert isinstance(assert_same_window(comm, (9, 9000), np.s_[:1], 0.0), SlabGrid)


def test_every_rank_has_a_window_of_few_elements(comm):
    for elements in (np.s_[:20], np.s_[250:, 5], np.s_[100:130, 60:], np.s_[7, 7]):
        assert not isinstance(assert_same_window(comm, (257, 64), elements, 0.1), SlabGrid)
