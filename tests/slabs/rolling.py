"""Rolling on slabs: its matrices, and the same tractions as on one machine."""

from functools import partial

import numpy as np
from numpy.testing import assert_allclose

from tests.slabs.pressing import STEEL, assert_same_work, doubts_ignored, grid_on
from tests.slabs.ranks import refuses
from tests.slabs.sliding import bound_of
from toeplitz_mg import contact, slabs


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


@doubts_ignored()
def test_bodies_roll(comm):
    creepages = {"longitudinal": -1e-4, "lateral": 5e-5, "spin": 1e-4}
    for n in (41, 50):
        g, element = bound_of(n)
        alone = contact.rolling(g, element, material=STEEL, **creepages)
        slab = slabs.Slab(comm, g.shape)
        own = slabs.rolling(g[slab.rows], slab, element, material=STEEL, **creepages)
        rows = (slice(None), slab.rows)
        size = np.abs(alone.traction).max()
        assert own.residual <= 1e-8
        assert_same_work(comm, own, alone)
        assert_allclose(own.force, alone.force, atol=1e-6 * np.abs(alone.force).max())
        assert_allclose(own.traction, alone.traction[rows], atol=1e-5 * size)
        assert_allclose(own.slip, alone.slip[rows], atol=1e-6 * np.abs(alone.slip).max())
        assert_allclose(own.displacement, alone.displacement[rows], rtol=1e-6, atol=1e-9)
        assert np.array_equal(own.rigid, alone.rigid)


@doubts_ignored()
def test_long_narrow_grids_take_as_many_products_as_on_one_machine(comm):
    """Of rough contacts, which one process too solves on the whole grid."""
    for shape in ((128, 32), (96, 12), (40, 64)):
        gap = 2e-3 * np.random.default_rng(5).random(shape)
        pressed = contact.normal_contact(gap, (0.01, 0.01), material=STEEL, force=0.02 * gap.size)
        g = 0.3 * pressed.pressure
        load = 0.5 * g.sum() * 1e-4, 0.0
        slab = slabs.Slab(comm, shape)
        for motion in ({"longitudinal": 1e-3}, {"force": load}):
            alone = contact.rolling(g, (0.01, 0.01), material=STEEL, **motion)
            own = slabs.rolling(g[slab.rows], slab, (0.01, 0.01), material=STEEL, **motion)
            assert own.products <= 1.2 * alone.products
            assert_allclose(own.force, alone.force, atol=1e-6 * g.sum() * 1e-4)


@doubts_ignored()
def test_bodies_roll_by_force(comm):
    g, element = bound_of(41)
    carried = g.sum() * element[0] * element[1]
    x, y = contact.surfaces.centres(g.shape, element)
    field = 1e-4 * np.stack(np.broadcast_arrays(y, -x))
    load = {"force": (0.3 * carried, None), "lateral": 5e-5, "moment": 0.0, "pole": (0.1, 0.0)}
    alone = contact.rolling(g, element, material=STEEL, slip=field, **load)
    slab = slabs.Slab(comm, g.shape)
    own = slabs.rolling(
        g[slab.rows], slab, element, material=STEEL, slip=field[:, slab.rows], **load
    )
    assert_allclose(own.force, alone.force, atol=1e-6 * carried)
    assert_allclose(own.rigid, alone.rigid, rtol=1e-5)
    size = np.abs(alone.traction).max()
    assert_allclose(own.traction, alone.traction[:, slab.rows], atol=1e-5 * size)


@doubts_ignored()
def test_bodies_roll_by_loads_near_those_of_sliding(comm):
    """The creepages to start from are the same on all ranks."""
    g, element = bound_of(50)
    fast = {"longitudinal": 2e-3, "lateral": 1e-3, "spin": 5e-3}
    alone = contact.rolling(g, element, material=STEEL, **fast)
    slab = slabs.Slab(comm, g.shape)
    carried = g.sum() * element[0] * element[1]
    for loads in (
        {"force": tuple(alone.force), "moment": alone.moment},
        {"force": tuple(alone.force), "spin": fast["spin"]},
    ):
        own = slabs.rolling(g[slab.rows], slab, element, material=STEEL, **loads)
        assert own.residual <= 1e-8
        assert own.products <= 2.5 * alone.products
        assert_allclose(own.force, alone.force, atol=1e-7 * carried)
        assert_allclose(own.moment, alone.moment, atol=1e-7 * carried)


@doubts_ignored()
def test_bodies_roll_step_by_step(comm):
    """By creepages from no tractions, and by a force, or one of its parts, from friction's."""
    g, element = bound_of(41)
    slab = slabs.Slab(comm, g.shape)
    rows, case = g[slab.rows], {"material": STEEL, "steps": 3}
    load = (0.3 * g.sum() * element[0] * element[1], 0.0)
    at_rest = contact.friction(g, element, material=STEEL, force=load)
    on_rows = slabs.friction(rows, slab, element, material=STEEL, force=load)
    alone, own = {"previous": at_rest}, {"previous": on_rows}
    for motion, before, mine in (
        ({"longitudinal": -1e-4, "spin": 1e-4}, {}, {}),
        ({"force": load}, alone, own),
        ({"force": (load[0], None), "lateral": -1e-4}, alone, own),
    ):
        expected = list(contact.rolling_steps(g, element, **case, **motion, **before))
        found = list(slabs.rolling_steps(rows, slab, element, **case, **motion, **mine))
        assert len(found) == case["steps"]
        for one, other in zip(found, expected, strict=True):
            size = np.abs(other.traction).max()
            assert one.residual <= 1e-8
            assert_allclose(one.traction, other.traction[:, slab.rows], atol=1e-5 * size)
            assert_allclose(one.force, other.force, atol=1e-5 * load[0])
            assert_allclose(one.rigid, other.rigid, rtol=1e-4, atol=1e-9)


def test_a_field_of_slip_on_some_ranks_only_is_refused(comm):
    slab = slabs.Slab(comm, (24, 16))
    field = None if comm.rank else np.full((2, *slab.local), 1e-5)
    case = {"material": STEEL, "longitudinal": 1e-4, "slip": field}
    rolled = (slabs.rolling, {}), (slabs.rolling_steps, {"steps": 1})
    for function, more in rolled if comm.size > 1 else ():
        work = partial(function, np.full(slab.local, 9.0), slab, (0.02, 0.03), **case, **more)
        text = "whether there is a field of slip is True on rank 0 and False on rank 1"
        refuses(comm, ValueError, text, work)


def test_ranks_that_roll_by_different_creepages_are_refused(comm):
    slab, last = slabs.Slab(comm, (24, 16)), comm.size - 1
    if not last:
        return
    case = {"material": STEEL, "longitudinal": 1e-4 if comm.rank == last else 2e-4}
    for function, more in ((slabs.rolling, {}), (slabs.rolling_steps, {"steps": 1})):
        work = partial(function, np.full(slab.local, 9.0), slab, (0.02, 0.03), **case, **more)
        refuses(comm, ValueError, "the creepages is (0.0002, 0.0, 0.0) on rank 0 and", work)


@doubts_ignored()
def test_strips_of_one_element_roll(comm):
    """Grids of one axis, along which they roll or across it, whose products are those of a line."""
    for shape, bound in (((30, 1), False), ((400, 1), True), ((1, 400), True)):
        if shape[0] < comm.size:
            continue
        x = np.linspace(-1.1, 1.1, max(shape)).reshape(shape)
        g = 100.0 * (np.sqrt(np.maximum(1.0 - x**2, 0.0)) if bound else np.ones(shape))
        case = {"material": STEEL, "longitudinal": 1e-4, "lateral": 5e-5}
        alone = contact.rolling(g, (0.02, 0.03), **case)
        slab = slabs.Slab(comm, shape)
        own = slabs.rolling(g[slab.rows], slab, (0.02, 0.03), **case)
        assert own.residual <= 1e-8
        # One process solves with few elements directly.
        assert own.products <= 1.2 * alone.products
        assert_allclose(own.traction, alone.traction[:, slab.rows], atol=1e-6)
        assert_allclose(own.force, alone.force, rtol=1e-6)


def test_steps_are_refused_by_all(comm):
    g, element = bound_of(41)
    slab = slabs.Slab(comm, g.shape)
    last = comm.size - 1

    def steps(**case):
        return lambda: slabs.rolling_steps(g[slab.rows], slab, element, material=STEEL, **case)

    refuses(comm, ValueError, "steps is 0", steps(steps=0))
    refuses(comm, ValueError, "less than the traction bound", steps(steps=1, force=(1e9, None)))
    if last:
        wrong = steps(steps=1 + (comm.rank == last))
        refuses(comm, ValueError, f"steps is 1 on rank 0 and 2 on rank {last}", wrong)


def test_an_error_has_what_is_reached_of_the_loads(comm):
    slab = slabs.Slab(comm, (24, 16))
    case = {"material": STEEL, "force": (0.1, 0.1), "max_products": 3}
    work = partial(slabs.rolling, np.full(slab.local, 9.0), slab, (0.02, 0.03), **case)
    refuses(comm, contact.ContactError, r"; of the force (0.1, 0.1) it has [", work)
