"""Contact in a small part of the grid, or in the rows of one rank: results are the same."""

import numpy as np
from numpy.testing import assert_allclose

from tests.slabs.counting import CountingCommunicator
from tests.slabs.pressing import STEEL, assert_near, doubts_ignored, on_both, surface
from toeplitz_mg import contact, slabs


@doubts_ignored()
def bound_beside(comm):
    """A traction bound in the rows of one rank, what it carries, its slab, and the elements."""
    gap, element, force = surface("beside", 100)
    g = 0.3 * contact.normal_contact(gap, element, material=STEEL, force=force).traction
    return g, g.sum() * element[0] * element[1], slabs.Slab(comm, gap.shape), element


def test_contact_in_the_rows_of_one_rank(comm):
    """Few elements of it are solved as on one machine, with as many products."""
    g, carried, _, element = bound_beside(comm)
    for function, motion in (
        ("friction", {"force": (0.4 * carried, 0.1 * carried)}),
        ("friction", {"shift": (1e-5, -2e-5)}),
        ("rolling", {"longitudinal": 1e-4, "spin": 1e-3}),
        ("rolling", {"force": (0.4 * carried, None)}),
    ):
        slab, own, alone = on_both(comm, function, g, element, **motion)
        assert own.products == alone.products
        assert_near(slab, own, alone, traction=1e-12, slip=1e-12, displacement=1e-12)
        assert_allclose(own.moment, alone.moment, rtol=1e-9, atol=1e-12 * carried)
        assert_allclose(own.power, alone.power, rtol=1e-9, atol=1e-15 * carried)
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
            alone = contact.friction(bound=g, element=element, force=force, previous=alone, **case)
            own = slabs.friction(
                bound=rows, slab=slab, element=element, force=force, previous=own, **case
            )
            assert_allclose(own.force, force, rtol=1e-9, atol=1e-9)
            assert_allclose(own.total_shift, alone.total_shift, rtol=1e-6, atol=1e-12)
            size = np.abs(alone.traction).max()
            assert_allclose(own.traction, alone.traction[:, slab.rows], atol=1e-5 * size)
        step = {"force": (2.0, 0.5), "steps": 2}
        expected = list(
            contact.rolling_steps(bound=g, element=element, previous=alone, **step, **case)
        )
        found = list(
            slabs.rolling_steps(
                bound=rows, slab=slab, element=element, previous=own, **step, **case
            )
        )
        for one, other in zip(found, expected, strict=True):
            assert_allclose(one.force, other.force, rtol=1e-9, atol=1e-9)
            assert_allclose(one.power, other.power, rtol=1e-6, atol=1e-12)


class RoundingCommunicator(CountingCommunicator):
    """The same ranks, which are sent numbers with other errors each."""

    def Alltoallv(self, sent, got):
        super().Alltoallv(sent, got)
        if got[0].dtype.kind == "f":
            got[0] *= 1.0 + 1e-9 * self.rank


@doubts_ignored()
def test_ranks_that_round_differently_have_the_same_numbers(comm):
    """What the others have found is that of the first, as processors of different kinds round."""
    g, carried, slab, element = bound_beside(RoundingCommunicator(comm))
    for function, motion in (
        (slabs.friction, {"force": (0.6 * carried, 0.1 * carried)}),
        (slabs.rolling, {"force": (0.6 * carried, None)}),
    ):
        own = function(bound=g[slab.rows], slab=slab, element=element, material=STEEL, **motion)
        numbers = [own.products, own.iterations, own.residual, own.energy, own.moment]
        numbers += [own.power, own.stick_area, *np.ravel(own.force), *np.ravel(own.rigid)]
        assert len({repr(told) for told in comm.allgather(numbers)}) == 1
