"""Rolling on slabs: the same tractions as on one machine, with about as many products."""

from functools import partial

import numpy as np
from numpy.testing import assert_allclose

from tests.slabs.pressing import (
    STEEL,
    assert_near,
    assert_same_work,
    doubts_ignored,
    on_both,
)
from tests.slabs.ranks import refuses
from tests.slabs.sliding import bound_of
from toeplitz_mg import contact, slabs


def test_bodies_roll(comm):
    creepages = {"longitudinal": -1e-4, "lateral": 5e-5, "spin": 1e-4}
    for n in (41, 50):
        slab, own, alone = on_both(comm, "rolling", *bound_of(n), **creepages)
        assert own.residual <= 1e-8
        assert_same_work(comm, own, alone)
        assert_near(slab, own, alone, force=1e-6, traction=1e-5, slip=1e-6, displacement=2e-6)
        assert np.array_equal(own.rigid, alone.rigid)


@doubts_ignored()
def test_long_narrow_grids_take_as_many_products_as_on_one_machine(comm):
    """Of rough contacts, which one process too solves on the whole grid."""
    for shape in ((128, 32), (96, 12), (40, 64)):
        gap, element = 2e-3 * np.random.default_rng(5).random(shape), (0.01, 0.01)
        pressed = contact.normal_contact(gap, element, material=STEEL, force=0.02 * gap.size)
        g = 0.3 * pressed.pressure
        for motion in ({"longitudinal": 1e-3}, {"force": (0.5 * g.sum() * 1e-4, 0.0)}):
            _, own, alone = on_both(comm, "rolling", g, element, **motion)
            assert own.products <= 1.2 * alone.products
            assert_allclose(own.force, alone.force, atol=1e-6 * g.sum() * 1e-4)


def test_bodies_roll_by_force(comm):
    g, element = bound_of(41)
    x, y = contact.surfaces.centres(g.shape, element)
    field = 1e-4 * np.stack(np.broadcast_arrays(y, -x))
    load = (0.3 * g.sum() * element[0] * element[1], None)
    motion = {"force": load, "lateral": 5e-5, "moment": 0.0, "pole": (0.1, 0.0), "slip": field}
    slab, own, alone = on_both(comm, "rolling", g, element, **motion)
    assert_near(slab, own, alone, force=3e-6, traction=1e-5)
    assert_allclose(own.rigid, alone.rigid, rtol=1e-5)


@doubts_ignored()
def test_bodies_roll_by_loads_near_those_of_sliding(comm):
    """The creepages to start from are the same on all ranks."""
    g, element = bound_of(50)
    fast = {"longitudinal": 2e-3, "lateral": 1e-3, "spin": 5e-3}
    slab, _, alone = on_both(comm, "rolling", g, element, **fast)
    carried = g.sum() * element[0] * element[1]
    for other in ({"moment": alone.moment}, {"spin": fast["spin"]}):
        loads = {"material": STEEL, "force": tuple(alone.force), **other}
        own = slabs.rolling(bound=g[slab.rows], slab=slab, element=element, **loads)
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
    at_rest = contact.friction(bound=g, element=element, material=STEEL, force=load)
    on_rows = slabs.friction(bound=rows, slab=slab, element=element, material=STEEL, force=load)
    alone, own = {"previous": at_rest}, {"previous": on_rows}
    for motion, before, mine in (
        ({"longitudinal": -1e-4, "spin": 1e-4}, {}, {}),
        ({"force": load}, alone, own),
        ({"force": (load[0], None), "lateral": -1e-4}, alone, own),
    ):
        expected = list(contact.rolling_steps(bound=g, element=element, **case, **motion, **before))
        found = list(
            slabs.rolling_steps(bound=rows, slab=slab, element=element, **case, **motion, **mine)
        )
        assert len(found) == case["steps"]
        for one, other in zip(found, expected, strict=True):
            size = np.abs(other.traction).max()
            assert one.residual <= 1e-8
            assert_allclose(one.traction, other.traction[:, slab.rows], atol=1e-5 * size)
            assert_allclose(one.force, other.force, atol=1e-5 * load[0])
            assert_allclose(one.rigid, other.rigid, rtol=1e-4, atol=1e-9)


def test_what_ranks_roll_by_differently_is_refused(comm):
    slab, last = slabs.Slab(comm, (24, 16)), comm.size - 1
    field = None if comm.rank else np.full((2, *slab.local), 1e-5)
    for motion, text in (
        ({"slip": field}, "slip is given on rank 0 and None on rank 1"),
        ({"longitudinal": 1e-4 if comm.rank == last else 2e-4}, "creepages is (0.0002, 0.0,"),
    ):
        for function, more in ((slabs.rolling, {}), (slabs.rolling_steps, {"steps": 1})):
            case = {"material": STEEL, "longitudinal": 1e-4, **motion, **more}
            work = partial(
                function, bound=np.full(slab.local, 9.0), slab=slab, element=(0.02, 0.03), **case
            )
            if last:
                refuses(comm, ValueError, text, work)


def test_strips_of_one_element_roll(comm):
    """Grids of one axis, along which they roll or across it, whose products are those of a line."""
    for shape, bound in (((30, 1), False), ((400, 1), True), ((1, 400), True)):
        if shape[0] < comm.size:
            continue
        x = np.linspace(-1.1, 1.1, max(shape)).reshape(shape)
        g = 100.0 * (np.sqrt(np.maximum(1.0 - x**2, 0.0)) if bound else np.ones(shape))
        motion = {"longitudinal": 1e-4, "lateral": 5e-5}
        slab, own, alone = on_both(comm, "rolling", g, (0.02, 0.03), **motion)
        assert own.residual <= 1e-8
        # One process solves with few elements directly.
        assert own.products <= 1.2 * alone.products
        assert_near(slab, own, alone, traction=1e-7, force=1e-6)


def test_steps_are_refused_by_all(comm):
    g, element = bound_of(41)
    slab = slabs.Slab(comm, g.shape)
    last = comm.size - 1

    def steps(**case):
        return lambda: slabs.rolling_steps(
            bound=g[slab.rows], slab=slab, element=element, material=STEEL, **case
        )

    refuses(comm, ValueError, "steps is 0", steps(steps=0))
    refuses(comm, ValueError, "the most that friction carries", steps(steps=1, force=(1e9, None)))
    if last:
        wrong = steps(steps=1 + (comm.rank == last))
        refuses(comm, ValueError, f"steps is 1 on rank 0 and 2 on rank {last}", wrong)


def test_an_error_has_what_is_reached_of_the_loads(comm):
    slab = slabs.Slab(comm, (24, 16))
    case = {"material": STEEL, "force": (0.1, 0.1), "max_products": 3}
    work = partial(
        slabs.rolling, bound=np.full(slab.local, 9.0), slab=slab, element=(0.02, 0.03), **case
    )
    refuses(comm, contact.ContactError, r"; of the force (0.1, 0.1) it has [", work)
