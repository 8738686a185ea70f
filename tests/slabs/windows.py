"""Windows around the contact: fields in them are those of one rank."""

import numpy as np
from numpy.testing import assert_allclose

from tests.slabs.pressing import STEEL, doubts_ignored, grid_on, surface
from toeplitz_mg import contact, slabs
from toeplitz_mg.slabs.grid import SlabGrid
from toeplitz_mg.slabs.window import SlabWindow


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


@doubts_ignored()
def bound_beside(comm):
    """A traction bound in the rows of one rank, what it carries, its slab, and the elements."""
    gap, element, force = surface("beside", 100)
    g = 0.3 * contact.normal_contact(gap, element, material=STEEL, force=force).traction
    return g, g.sum() * element[0] * element[1], slabs.Slab(comm, gap.shape), element


@doubts_ignored()
def test_contact_in_the_rows_of_one_rank(comm):
    """Few elements of it are solved as on one machine, with as many products."""
    g, carried, slab, element = bound_beside(comm)
    for function, motion in (
        ("friction", {"force": (0.4 * carried, 0.1 * carried)}),
        ("friction", {"shift": (1e-5, -2e-5)}),
        ("rolling", {"longitudinal": 1e-4, "spin": 1e-3}),
        ("rolling", {"force": (0.4 * carried, None)}),
    ):
        alone = getattr(contact, function)(g, element, material=STEEL, **motion)
        own = getattr(slabs, function)(g[slab.rows], slab, element, material=STEEL, **motion)
        assert own.products == alone.products
        assert_allclose(own.moment, alone.moment, rtol=1e-9, atol=1e-12 * carried)
        assert_allclose(own.power, alone.power, rtol=1e-9, atol=1e-15 * carried)
        for name in ("traction", "slip", "displacement"):
            one, other = getattr(own, name), getattr(alone, name)[:, slab.rows]
            assert_allclose(one, other, rtol=1e-12, atol=1e-12 * np.abs(other).max(initial=1e-300))
        assert np.array_equal(own.stick, alone.stick[slab.rows])
        assert own.warnings == alone.warnings


@doubts_ignored()
def test_a_force_after_another(comm):
    """Where all sticks the sum of the first guess stays."""
    for shape, bound in (((12, 12), 1e4), ((12, 12), np.inf), ((130, 70), 1e3)):
        g = np.zeros(shape)
        g[3:-3, 3:-3] = bound
        slab, case = slabs.Slab(comm, shape), {"material": STEEL}
        rows, element = g[slab.rows], (0.01, 0.01)
        alone = own = None
        for force in ((1.0, 0.0), (2.0, 0.5)):
            alone = contact.friction(g, element, force=force, previous=alone, **case)
            own = slabs.friction(rows, slab, element, force=force, previous=own, **case)
            assert_allclose(own.force, force, rtol=1e-9, atol=1e-9)
            assert_allclose(own.total_shift, alone.total_shift, rtol=1e-6, atol=1e-12)
            size = np.abs(alone.traction).max()
            assert_allclose(own.traction, alone.traction[:, slab.rows], atol=1e-5 * size)
        step = {"force": (2.0, 0.5), "steps": 2}
        expected = list(contact.rolling_steps(g, element, previous=alone, **step, **case))
        found = list(slabs.rolling_steps(rows, slab, element, previous=own, **step, **case))
        for one, other in zip(found, expected, strict=True):
            assert_allclose(one.force, other.force, rtol=1e-9, atol=1e-9)
            assert_allclose(one.power, other.power, rtol=1e-6, atol=1e-12)


@doubts_ignored()
def test_ranks_that_round_differently_have_the_same_numbers(comm):
    """What the others have found is that of the first, as processors of different kinds round."""
    g, carried, slab, element = bound_beside(comm)
    cut, noise = SlabWindow.cut, 1e-9 * comm.rank
    SlabWindow.cut = lambda self, x: cut(self, x) * (1.0 + noise)
    try:
        for function, motion in (
            (slabs.friction, {"force": (0.6 * carried, 0.1 * carried)}),
            (slabs.rolling, {"force": (0.6 * carried, None)}),
        ):
            own = function(g[slab.rows], slab, element, material=STEEL, **motion)
            numbers = [own.products, own.iterations, own.residual, own.energy, own.moment]
            numbers += [own.power, own.stick_area, *np.ravel(own.force), *np.ravel(own.rigid)]
            assert len({repr(told) for told in comm.allgather(numbers)}) == 1
    finally:
        SlabWindow.cut = cut
