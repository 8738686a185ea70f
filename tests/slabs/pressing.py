"""Normal contact on slabs: the same areas as on one machine, with about as many products."""

import pickle
from contextlib import contextmanager
from copy import deepcopy
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from warnings import catch_warnings, simplefilter

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.slabs.ranks import refuses
from toeplitz_mg import contact, slabs
from toeplitz_mg.contact.grid import Grid
from toeplitz_mg.slabs.grid import SlabGrid

STEEL = contact.Material.from_shear(82000.0, 0.28)
SHAPES = [(40, 9), (41, 33), (130, 70), (150, 131), (257, 64)]


def grid_on(comm, shape, unit=None):
    """A grid in slabs, and that grid on one rank."""
    whole = Grid.of(shape, (0.02, 0.03), STEEL, None)
    return SlabGrid(whole, slabs.Slab(comm, shape, unit=unit)), whole


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


def test_a_grid_is_coarsened_until_every_rank_has_all_of_it(comm):
    grid, _ = grid_on(comm, (1024, 1024))
    sizes = []
    while isinstance(grid, SlabGrid):
        grid = grid.coarser()
        sizes.append(grid.shape[0])
    assert sizes == [512, 256, 128, 64]


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


def test_coefficients_are_those_of_the_rows(comm):
    grid, whole = grid_on(comm, (150, 33))
    A, unit = grid.scaled_normal()
    c = whole.normal_coefficients()
    assert unit == c[0, 0]
    x = np.random.default_rng(2).standard_normal(whole.shape)
    y = A.apply(x[grid.slab.rows].reshape(-1))
    expected = (whole.normal() @ x.ravel() / unit).reshape(whole.shape)[grid.slab.rows]
    assert_allclose(y, expected.ravel(), atol=1e-13 * np.abs(expected).max())


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
    assert abs(own.products - alone.products) <= 0.2 * alone.products
    assert len(set(comm.allgather(own.work))) == 1
    assert 0.7 * alone.work <= own.work <= (1.0 + 0.3 * comm.size) * alone.work


@doubts_ignored()
def assert_same(comm, kind, n, by, **options):
    """Assert that contact on slabs is that on one rank."""
    gap, element, force = surface(kind, n)
    alone = contact.normal_contact(gap, element, material=STEEL, force=force)
    load = {"force": force} if by == "force" else {"approach": alone.rigid}
    if by != "force":
        alone = contact.normal_contact(gap, element, material=STEEL, **load)
    slab = slabs.Slab(comm, gap.shape, **options)
    own = slabs.normal_contact(gap[slab.rows], slab, element, material=STEEL, **load)
    assert own.residual <= 1e-8
    assert_same_work(comm, own, alone)
    assert_allclose(own.area, alone.area, rtol=1e-5)
    assert_allclose(own.rigid, alone.rigid, rtol=1e-6)
    assert_allclose(own.force, alone.force, rtol=1e-6)
    assert_allclose(own.traction, alone.traction[slab.rows], atol=1e-5 * alone.traction.max())
    assert_allclose(own.gap, alone.gap[slab.rows], atol=1e-7 * np.ptp(gap))
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


def test_only_small_grids_are_gathered(comm):
    sizes = []

    def gather(sent, got):
        sizes.append(got[0].size)
        return type(comm).Allgatherv(comm, sent, got)

    comm.Allgatherv = gather
    try:
        assert_same(comm, "sphere", 200, "force")
    finally:
        del comm.Allgatherv
    assert max(sizes, default=50**2) == 50**2  # The coarser grid that every rank solves alone.


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
    element, case = (0.01, 0.01), {"material": STEEL, "force": 50.0}
    gap = contact.surfaces.sphere((64, 64), element, radius=10.0)
    gap[30:34, 20:28] = np.inf
    slab = slabs.Slab(comm, gap.shape)
    alone = contact.normal_contact(gap, element, **case)
    own = slabs.normal_contact(gap[slab.rows], slab, element, **case)
    assert own.area == pytest.approx(alone.area, rel=1e-5)
    size = alone.traction.max()
    assert_allclose(own.traction, alone.traction[slab.rows], atol=1e-5 * size)


def test_a_result_of_one_rank_is_not_taken_for_that_of_all(comm):
    gap, element, force = surface("sphere", 40)
    slab, case = slabs.Slab(comm, gap.shape), {"material": STEEL}
    own = slabs.normal_contact(gap[slab.rows], slab, element, force=force, **case)
    shifted = slabs.friction(0.3 * own.pressure, slab, element, shift=(1e-4, 0.0), **case)
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
    refuses(comm, ValueError, "one of the two must be given", press(approach=1.0, force=2.0))
    refuses(comm, ValueError, name + "force is", press(force=-1.0 if last else 1.0))
    line = slabs.Slab(comm, (40,))
    refuses(comm, ValueError, "contact on slabs has two axes", press(slab=line, element=0.1))
    if comm.size > 1:
        refuses(comm, ValueError, "force is 1.0 on rank 0 and", press(force=1.0 + last))
        refuses(comm, ValueError, "element is", press(element=(0.1, 0.1 + 0.1 * last)))


def test_failure_is_the_same_error_on_all_ranks(comm):
    gap, element, force = surface("sphere", 64)
    slab = slabs.Slab(comm, gap.shape)
    options = {"material": STEEL, "force": force, "nested": False, "max_products": 3}
    refuses(
        comm,
        contact.ContactError,
        "products the conditions of contact are violated by",
        lambda: slabs.normal_contact(gap[slab.rows], slab, element, **options),
    )
