"""Friction on slabs: the same areas as on one machine, with about as many products."""

import numpy as np
from numpy.testing import assert_allclose

from tests.slabs.pressing import (
    STEEL,
    assert_near,
    assert_same_work,
    doubts_ignored,
    on_both,
    surface,
)
from tests.slabs.ranks import refuses
from toeplitz_mg import contact, slabs


@doubts_ignored()
def bound_of(n):
    """The traction bound below a sphere, and the elements."""
    gap, element, force = surface("sphere", n)
    return 0.3 * contact.normal_contact(gap, element, material=STEEL, force=force).traction, element


def assert_same_friction(comm, n, rough=False, **case):
    """Assert that friction on slabs is that on one rank."""
    g, element = bound_of(n)
    if rough:
        g = g * (contact.surfaces.rough((n, n), element, rms=1.0) < 2.5)
    slab, own, alone = on_both(comm, "friction", g, element, **case)
    assert own.residual <= 1e-8
    assert_same_work(comm, own, alone)
    assert own.area == alone.area
    assert_near(slab, own, alone, force=2e-6, rigid=2e-6, traction=1e-5, slip=1e-6)
    differ = slab.vectors.count(own.stick != alone.stick[slab.rows])
    assert differ <= 1e-5 * np.count_nonzero(alone.contact)
    assert own.warnings == alone.warnings
    return g, slab, own, alone


def test_bodies_are_shifted_by_a_force(comm):
    assert_same_friction(comm, 61, force=(150.0, 60.0))


def test_bodies_are_shifted_as_given(comm):
    assert_same_friction(comm, 40, shift=(8e-4, 2e-4))
    assert_same_friction(comm, 67, rough=True, shift=(3e-4, -1e-4))


def test_a_rough_surface_is_shifted_with_fsai(comm):
    assert_same_friction(comm, 183, rough=True, shift=(3e-4, -1e-4))


@doubts_ignored()
def test_a_shift_after_another(comm):
    case = {"shift": (6e-4, 0.0)}
    g, slab, own, alone = assert_same_friction(comm, 40, **case)
    after = {"material": STEEL, "shift": (-4e-4, 3e-4)}
    expected = contact.friction(bound=g, element=alone.element, previous=alone, **after)
    found = slabs.friction(
        bound=g[slab.rows], slab=slab, element=own.element, previous=own, **after
    )
    assert_near(slab, found, expected, traction=1e-5)


@doubts_ignored()
def test_a_field_of_shifts_where_ranks_have_a_single_element(comm):
    g = np.full((5, 1), 100.0)
    field = 1e-4 * np.arange(10.0).reshape(2, 5, 1)
    element = (0.1, 0.1)
    for load in ({}, {"force": (0.5, 0.1)}):
        slab, own, alone = on_both(comm, "friction", g, element, shift=field, **load)
        assert_near(slab, own, alone, traction=1e-6, shift=1e-6)
        after = slabs.friction(
            bound=g[slab.rows],
            slab=slab,
            element=element,
            material=STEEL,
            shift=(1e-4, 0.0),
            previous=own,
        )
        expected = own.shift + np.array([1e-4, 0.0])[:, None, None]
        assert_allclose(after.total_shift, expected, atol=1e-9)


def test_friction_refuses_on_all_ranks(comm):
    slab = slabs.Slab(comm, (40, 40))
    last = comm.rank == comm.size - 1

    def shift(g=None, **case):
        g = np.ones(slab.local) if g is None else g
        return lambda: slabs.friction(
            bound=g, slab=slab, element=(0.1, 0.1), material=STEEL, **case
        )

    bad = np.ones(slab.local)
    bad[0, 0] = -1.0 if last else 1.0
    name = f"rank {comm.size - 1}: "
    refuses(comm, ValueError, name + "bound has the value -1", shift(bad, force=(1.0, 0.0)))
    refuses(comm, ValueError, "one of the two must be given", shift())
    refuses(comm, ValueError, "but friction carries", shift(force=(1e3, 0.0)))
    text = "force is not a number somewhere"
    refuses(comm, ValueError, text, shift(force=(np.nan, 0.0)))
    wrong = np.zeros((2, slab.local[0] + last, 40))
    refuses(comm, ValueError, name + "shift has shape", shift(shift=wrong))
    if comm.size > 1:
        refuses(comm, ValueError, "force is", shift(force=(1.0 + last, 0.0)))
        text = f"shift is [1.0, 0.0] on rank 0 and [2.0, 0.0] on rank {comm.size - 1}"
        refuses(comm, ValueError, text, shift(shift=(1.0 + last, 0.0)))
