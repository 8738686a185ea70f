"""Normal contact on slabs: the same areas as on one machine, with about as many products."""

import pickle
from contextlib import contextmanager
from copy import deepcopy
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from warnings import catch_warnings, simplefilter

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.slabs.ranks import refuses
from toeplitz_mg import contact, slabs

STEEL = contact.Material.from_shear(82000.0, 0.28)


def surface(kind, n):
    """A gap on a square of n × n elements, its elements, and a force on it."""
    element = (2.0 / n, 2.0 / n)
    if kind == "sphere":
        return contact.surfaces.sphere((n, n), element, radius=50.0), element, 1000.0
    if kind == "beside":  # All contact is in the rows of the first rank.
        gap = contact.surfaces.sphere((n, n), element, radius=50.0)
        return np.roll(gap, n // 8 - n // 2, axis=0), element, 1.0
    return contact.surfaces.rough((n, n), element, rms=0.002), element, 300.0


@contextmanager
def doubts_ignored():
    """A context, or a decorator, of contacts that reach the edge of the grid, or are coarse."""
    with catch_warnings():
        simplefilter("ignore", contact.ContactWarning)
        yield


def assert_same_work(comm, own, alone):
    """Assert that all ranks say the same work, and as many products as one rank, or about so.

    Each does all that there is on small grids, where a nested search has many of its products.
    """
    # By rounding the last step may be one more, of two products.
    assert abs(own.products - alone.products) <= max(2, 0.2 * alone.products)
    assert len(set(comm.allgather(own.work))) == 1
    assert 0.7 * alone.work <= own.work <= (1.0 + 0.3 * comm.size) * alone.work


@doubts_ignored()
def on_both(comm, function, field, element, **case):
    """What a function of `contact` returns on these ranks, and on one, with the slab before."""
    slab = slabs.Slab(comm, field.shape, unit=case.pop("unit", None))
    name, common = "gap" if function == "normal_contact" else "bound", {"material": STEEL}
    alone = getattr(contact, function)(element=element, **{name: field}, **common, **case)
    rows = {name: x[..., slab.rows, :] if np.ndim(x) > 1 else x for name, x in case.items()}
    common |= {name: field[slab.rows], "slab": slab, "element": element}
    own = getattr(slabs, function)(**common, **rows)
    return slab, own, alone


def assert_near(slab, own, alone, **tolerances):
    """Assert that numbers and fields are those of one rank, relative to the largest."""
    for name, tolerance in tolerances.items():
        x, y = np.array(getattr(own, name)), np.array(getattr(alone, name))
        here = y[..., slab.rows, :] if y.ndim > 1 else y
        assert_allclose(x, here, rtol=0, atol=tolerance * np.abs(y).max(), err_msg=name)


@doubts_ignored()
def assert_same(comm, kind, n, by, **options):
    """Assert that contact on slabs is that on one rank."""
    gap, element, force = surface(kind, n)
    load = {"force": force}
    if by != "force":
        pressed = contact.normal_contact(gap, element, material=STEEL, **load)
        load = {"approach": 1.1 * pressed.rigid}  # At 1.0 rounding decides on a solve more.
    slab, own, alone = on_both(comm, "normal_contact", gap, element, **load, **options)
    assert own.residual <= 1e-8
    assert_same_work(comm, own, alone)
    assert_near(slab, own, alone, area=1e-5, rigid=1e-6, force=1e-6, traction=1e-5, gap=1e-7)
    assert own.warnings == alone.warnings
    assert slab.vectors.count(own.contact) == np.count_nonzero(alone.contact)
    return slab, own


def test_a_sphere_is_pressed(comm):
    assert_same(comm, "sphere", 100, "force")
    assert_same(comm, "sphere", 64, "approach")


def test_a_rough_surface_is_pressed(comm):
    assert_same(comm, "rough", 185, "force", unit=1)


def test_ranks_may_be_without_contact(comm):
    slab, own = assert_same(comm, "beside", 100, "force")
    touching = slab.gather(np.count_nonzero(own.contact))
    assert touching[0] > 0
    assert sum(touching[1 : max(1, comm.size - 1)]) == 0


def test_doubts_are_told_on_every_rank(comm):
    gap, element, force = surface("sphere", 20)
    slab = slabs.Slab(comm, gap.shape)
    with pytest.warns(
        contact.ContactWarning, match="reaches the edge of the grid along x and y"
    ) as told:
        slabs.normal_contact(gap[slab.rows], slab, element, material=STEEL, force=20.0 * force)
    assert told[0].filename == __file__


def test_a_progress_that_raises_on_one_rank_does_on_all(comm):
    """Also in a window of which every rank has all."""
    gap, element, force = surface("sphere", 40)
    slab, is_last = slabs.Slab(comm, gap.shape), comm.rank == comm.size - 1

    def stop(products, residual):
        raise LookupError("enough")

    case = {"bound": np.full(slab.local, 9.0), "slab": slab, "element": element}
    for solve in (
        partial(slabs.normal_contact, gap[slab.rows], slab, element, force=force),
        partial(slabs.friction, **case, force=(0.1, 0.0)),
        lambda **more: next(slabs.rolling_steps(**case, longitudinal=1e-3, steps=1, **more)),
    ):
        with pytest.raises(LookupError if is_last else RuntimeError, match="enough"):
            solve(material=STEEL, progress=stop if is_last else None)
        wrong = partial(solve, material=STEEL, progress=3 if is_last else None)
        refuses(comm, TypeError, "progress is 3, but must be a function", wrong)


def test_only_small_grids_are_gathered(comm):
    """As those within, on which every rank solves alone."""
    sizes = []

    def gather(sent, got):
        sizes.append(got[0].size)
        return type(comm).Allgatherv(comm, sent, got)

    comm.Allgatherv = gather
    try:
        assert_same(comm, "sphere", 200, "force")
    finally:
        del comm.Allgatherv
    assert max(sizes, default=0) <= 200**2 / 4


def test_a_rough_surface_is_pressed_with_fsai(comm):
    assert_same(comm, "rough", 256, "force")


def test_nothing_touches(comm):
    gap, element, _ = surface("sphere", 40)
    slab = slabs.Slab(comm, gap.shape)
    own = slabs.normal_contact(1.0 + gap[slab.rows], slab, element, material=STEEL, approach=0.5)
    assert own.area == own.force == 0.0
    assert own.products == 0


def test_where_there_is_no_material(comm):
    """A hole may be in the rows of some ranks alone."""
    element = (0.01, 0.01)
    gap = contact.surfaces.sphere((64, 64), element, radius=10.0)
    gap[30:34, 20:28] = np.inf
    slab, own, alone = on_both(comm, "normal_contact", gap, element, force=50.0)
    assert_near(slab, own, alone, area=1e-5, traction=1e-5)


def test_a_result_of_one_rank_is_not_taken_for_that_of_all(comm):
    gap, element, force = surface("sphere", 40)
    slab, case = slabs.Slab(comm, gap.shape), {"material": STEEL}
    own = slabs.normal_contact(gap[slab.rows], slab, element, force=force, **case)
    shifted = slabs.friction(own, slab, mu=0.3, shift=(1e-4, 0.0))
    by_bound = {"bound": 0.3 * own.pressure, "element": element, "shift": (1e-4, 0.0), **case}
    again = slabs.friction(slab=slab, **by_bound)
    assert np.array_equal(shifted.traction, again.traction)
    with TemporaryDirectory() as there:
        path = Path(there) / "result"
        uses = (
            lambda: own.save(path.with_suffix(".npz")),
            *([own.to_xarray] if find_spec("xarray") else ()),
            lambda: own.to_vtk(path.with_suffix(".vti")),
            lambda: shifted.save(path.with_suffix(".npz")),
            lambda: own.plot(),
            lambda: contact.subsurface_stresses(own, depths=1.0),
            lambda: contact.friction(own, mu=0.3, force=(1.0, 0.0)),
            lambda: contact.normal_contact(gap, element, force=force, previous=own, **case),
        )
        for use in uses if comm.size > 1 else ():
            with pytest.raises(ValueError, match=r"rows of one rank, .*slab\.save"):
                use()
        assert not list(Path(there).iterdir())
    assert "stiffness" not in own.summary() or comm.size == 1
    # Pickled, it is without what all ranks have to compute together.
    again = pickle.loads(pickle.dumps(own))
    assert np.array_equal(again.pressure, own.pressure)
    stiffness = own.stiffness
    assert again.stiffness == (stiffness if comm.size == 1 else None)
    assert deepcopy(own).stiffness == stiffness


def test_bad_input_is_refused_on_all_ranks(comm):
    slab = slabs.Slab(comm, (40, 40))
    last = comm.rank == comm.size - 1

    def press(gap=None, slab=slab, element=(0.1, 0.1), material=STEEL, **load):
        gap = np.zeros(slab.local) if gap is None else gap
        load = load or {"force": 1.0}
        return lambda: slabs.normal_contact(gap, slab, element, material=material, **load)

    bad = np.zeros(slab.local)
    bad[0, 0] = np.nan if last else 0.0
    name = f"rank {comm.size - 1}: "
    unknown = {"force": 1.0} | ({"hardness": 2.0} if last else {})
    refuses(comm, TypeError, name + "hardness is given, but normal_contact", press(**unknown))
    refuses(comm, TypeError, "slab is 3, but must be a Slab", press(bad, slab=3))
    refuses(comm, ValueError, name + "gap is not a number somewhere", press(bad))
    short = np.zeros((slab.local[0] - last, 40))
    refuses(comm, ValueError, name + "gap has shape", press(short))
    refuses(comm, ValueError, "just one of force", press(approach=1.0, force=2.0))
    refuses(comm, ValueError, name + "force is", press(force=-1.0 if last else 1.0))
    line = slabs.Slab(comm, (40,))
    refuses(comm, ValueError, "contact on slabs must have two axes", press(slab=line, element=0.1))
    if comm.size > 1:
        refuses(comm, ValueError, "force is 1.0 on rank 0 and", press(force=1.0 + last))
        refuses(comm, ValueError, "element is", press(element=(0.1, 0.1 + 0.1 * last)))


def test_failure_is_the_same_error_on_all_ranks(comm):
    gap, element, force = surface("sphere", 64)
    slab = slabs.Slab(comm, gap.shape)
    options = {"material": STEEL, "force": force, "nested": False, "max_products": 3}
    text = "products the conditions of contact are violated by"
    press = partial(slabs.normal_contact, gap[slab.rows], slab, element, **options)
    refuses(comm, contact.ContactError, text, press)
