"""Pressures converge to Hertz's theory, and obey the conditions of contact on any surface."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import toeplitz_mg as tmg
from tests.budgets import assert_within_budget
from tests.test_friction import doubtful
from toeplitz_mg import halfspace
from toeplitz_mg.contact import ContactError, Material, normal_contact, surfaces

STEEL = Material.from_shear(82000.0, 0.28)
UNIT = Material.from_shear(0.7, 0.3)  # G and ν of bodies with E* = G/(1-ν) = 1.
A = 0.6  # Radius of contact on grids of [-1, 1].


def assert_complementary(contact, tolerance=1e-8, reference=None):
    """Pressures and gap are, with the displacements of a product of our own."""
    A = halfspace.influence_matrix(
        "z", contact.shape, contact.element, contact.material, reference=reference
    )
    u = (A @ contact.pressure.ravel()).reshape(contact.shape)
    assert_allclose(contact.displacement, u, rtol=0, atol=1e-13 * np.abs(u).max())
    scale = contact.approach + (contact.displacement - contact.gap - contact.approach).max()
    assert np.isfinite(contact.pressure).all()
    assert contact.pressure.min() >= 0.0
    assert contact.gap.min() >= -1.01 * tolerance * scale
    assert np.abs(contact.gap[contact.contact]).max(initial=0.0) <= 1.01 * tolerance * scale
    assert contact.residual <= tolerance


def sphere(n, **load):
    h = 2.0 / n
    gap = surfaces.sphere((n, n), (h, h), radius=1.0)
    return normal_contact(gap, (h, h), material=UNIT, **load)


def rough(n, **load):
    h = 2.0 / n
    gap = surfaces.rough(
        (n, n), (h, h), rms=0.01, longest=0.5, shortest=max(2.0 / 64, 4 * h), seed=1
    )
    return normal_contact(gap, (h, h), material=UNIT, **load)


# Hertz --------------------------------------------------------------------------------------


def test_hertz_line_contact():
    G, nu, R, a = STEEL.G, STEEL.nu, 500.0, 4.0
    force = np.pi * a**2 * G / (4 * R * (1 - nu))
    p0 = 2 * force / (np.pi * a)
    errors = []
    for n in (50, 100, 200):
        h = 10.0 / n
        gap = surfaces.cylinder(n, h, radius=R)
        contact = normal_contact(gap, h, material=STEEL, force=force, reference=20.0)
        assert_complementary(contact, reference=20.0)
        assert_allclose(contact.force, force, rtol=1e-12)
        assert abs(contact.area - 2 * a) <= 2 * h
        # The constant of plane strain gives δ = 2 F (1-ν)/(πG) (ln(2 d/a) + 1/2).
        approach = 2 * force * (1 - nu) / (np.pi * G) * (np.log(2 * 20.0 / a) + 0.5)
        errors.append([abs(contact.pressure.max() / p0 - 1), abs(contact.approach / approach - 1)])
    assert np.all(np.divide(errors[:-1], errors[1:]) > 3.0)  # The error is of second order.
    assert np.max(errors[0]) < 1e-3


def test_hertz_sphere():
    force, p0 = 4 / 3 * A**3, 2 * A / np.pi
    errors = []
    for n in (32, 64, 128):
        by_force, by_approach = sphere(n, force=force), sphere(n, approach=A**2)
        assert_complementary(by_force)
        assert_complementary(by_approach)
        assert abs(np.sqrt(by_force.area / np.pi) / A - 1) < 2.0 / n
        errors.append(
            [abs(by_force.approach / A**2 - 1), abs(by_approach.force / force - 1),
             abs(by_force.pressure.max() / p0 - 1)]
        )  # fmt: skip
    assert np.all(np.divide(errors[:-1], errors[1:]) > 2.0)
    assert np.max(errors[-1]) < 2e-4


def test_long_strips_are_plane_strain():
    gap = surfaces.cylinder(60, 0.05, radius=10.0)
    infinite = normal_contact(gap, 0.05, material=UNIT, force=0.1)
    finite = normal_contact(gap, (0.05, 500.0), material=UNIT, force=0.1 * 500.0)
    column = normal_contact(gap[:, None], (0.05, 500.0), material=UNIT, force=0.1 * 500.0)
    assert_allclose(finite.pressure, infinite.pressure, atol=1e-4 * infinite.pressure.max())
    assert_allclose(column.pressure[:, 0], finite.pressure, rtol=1e-6, atol=1e-8)


# Products -----------------------------------------------------------------------------------


@pytest.mark.parametrize("load", [{"force": 4 / 3 * A**3}, {"approach": A**2}])
def test_products_for_a_sphere(load):
    with tmg.count_products() as work:
        contact = sphere(512, **load)
    assert_within_budget("sphere, n = 512", products=contact.products, work_units=contact.work)
    assert contact.products < contact.work
    assert_allclose(work.units(512**2), contact.work)
    assert sum(contact.iterations) < contact.products


@doubtful  # A rough surface reaches the edge of its grid.
@pytest.mark.parametrize(("force", "part"), [(0.0123, 0.02), (0.06, 0.1), (0.2, 0.28)])
def test_products_for_a_rough_surface(force, part):
    contact = rough(256, force=force)
    assert abs(contact.contact.mean() - part) < 0.005
    assert_within_budget(f"rough surface, {part:.0%} in contact", products=contact.products)


@doubtful  # A rough profile reaches the ends of its grid.
@pytest.mark.parametrize("n", [4000, 16000])
def test_products_for_a_rough_profile(n):
    gap, load = np.random.default_rng(8).standard_normal(n), 0.3e-2 * n
    for periodic in (False, True):
        contact = normal_contact(gap, 0.1, material=UNIT, force=load, periodic=periodic)
        assert_within_budget("rough profile", products=contact.products)
        assert contact.residual <= 1e-8
        if not periodic:
            assert_complementary(contact)


@doubtful  # A rough surface reaches the edge of its grid.
@pytest.mark.parametrize("n", [128, 256])
def test_single_precision_does_not_limit_the_accuracy(n):
    contact = rough(n, force=0.1, tolerance=1e-13)
    assert_complementary(contact, 1e-13)
    assert_allclose(contact.pressure.sum() * (2.0 / n) ** 2, 0.1, rtol=1e-14)


@pytest.mark.slow
@doubtful  # A rough surface reaches the edge of its grid.
@pytest.mark.parametrize(("n", "force"), [(512, 0.006), (512, 0.36), (1024, 0.06)])
def test_large_rough_surfaces(n, force):
    contact = rough(n, force=force)
    assert 0.005 < contact.contact.mean() < 0.45
    assert_complementary(contact)
    assert contact.gap.min() >= -1e-10 * np.ptp(contact.gap)
    assert_allclose(contact.force, force, rtol=1e-8)
    assert_within_budget("large rough surface", products=contact.products)


# Any problem --------------------------------------------------------------------------------


@doubtful
@pytest.mark.parametrize("load", [{"force": 0.1}, {"approach": 0.03}])
def test_nested_grids_change_the_work_only(load):
    rng = np.random.default_rng(2)
    gap = rng.random((70, 45)) * 0.02
    results = [
        normal_contact(gap, (0.1, 0.07), material=UNIT, nested=nested, tolerance=1e-11, **load)
        for nested in (True, False)
    ]
    assert_allclose(results[0].pressure, results[1].pressure, rtol=1e-6, atol=1e-9)


@doubtful
@given(
    seed=st.integers(0, 2**32 - 1),
    shape=st.one_of(
        st.tuples(st.integers(1, 90)), st.tuples(st.integers(1, 40), st.integers(1, 40))
    ),
    G=st.floats(0.1, 1e5),
    nu=st.floats(-0.9, 0.5, exclude_max=True),
    roughness=st.floats(1e-4, 1.0),
    load=st.floats(1e-6, 10.0),
    is_force=st.booleans(),
)
@settings(max_examples=60, deadline=None)
def test_any_surface_and_load(seed, shape, G, nu, roughness, load, is_force):
    rng = np.random.default_rng(seed)
    h = 10.0 ** rng.uniform(-3, 1)
    element = (h, h * 10 ** rng.uniform(-1, 1))
    length = h * max(shape)
    gap = roughness * length * rng.standard_normal(shape)
    if is_force:
        arguments = {"force": load * G * length**2}
    else:
        arguments = {"approach": gap.min() + load * roughness * length}
    contact = normal_contact(gap, element, material=Material.from_shear(G, nu), **arguments)
    assert_complementary(contact)
    if is_force:
        assert_allclose(contact.force, arguments["force"], rtol=1e-8)


def test_a_large_distance_does_no_harm():
    gap = surfaces.sphere((20, 20), (0.1, 0.1), radius=1.0)
    near = normal_contact(gap, (0.1, 0.1), material=UNIT, approach=1e-6 * 2**-3)
    far = normal_contact(gap + 2.0**10, (0.1, 0.1), material=UNIT, approach=2.0**10 + 1e-6 * 2**-3)
    assert_allclose(far.pressure, near.pressure, rtol=1e-5)


@pytest.mark.parametrize(("G", "length"), [(1e-40, 1.0), (1e35, 1.0), (1e-30, 1e30), (1e30, 1e-30)])
def test_units_beyond_single_precision(G, length):
    def pressed(G, length):
        element = (0.05 * length, 0.05 * length)
        gap = surfaces.sphere((40, 40), element, radius=length)
        return normal_contact(
            gap, element, material=Material.from_shear(G, 0.3), approach=0.3 * length
        )

    contact, expected = pressed(G, length), pressed(1.0, 1.0)
    assert contact.products == expected.products
    assert_allclose(contact.pressure / G, expected.pressure, rtol=1e-6, atol=1e-12)


@doubtful
@pytest.mark.parametrize("scale", [1e-30, 1e-15, 1.0, 1e15, 1e30])
def test_any_ratio_of_gap_and_force(scale):
    # Where the gap is far larger than the displacements, only the nearest elements touch; where it
    # is far smaller, it is a punch.
    rng = np.random.default_rng(0)
    surface = sum(x**2 for x in surfaces.centres((40, 40), (0.1, 0.1)))
    for gap in (surface, rng.random((40, 40)), 10.0 ** rng.uniform(-35, 0, (40, 40))):
        gap -= gap.min()
        contact = normal_contact(scale * gap, (0.1, 0.1), material=UNIT, force=1e-3)
        assert_complementary(contact)
        assert_allclose(contact.force, 1e-3)
        assert not contact.contact[scale * gap > 0.1].any()
        if scale == 1e-30:
            assert contact.contact.all()


@doubtful
@pytest.mark.parametrize("ratio", [1e-8, 1e4, 1e8])
def test_long_elements(ratio):
    gap = 0.01 * np.random.default_rng(0).random((40, 30))
    contact = normal_contact(gap, (0.03, 0.03 * ratio), material=UNIT, approach=0.005)
    assert_complementary(contact)
    assert_within_budget("pressure on long elements", products=contact.products)


@doubtful
def test_the_order_in_memory_does_not_matter():
    gap = 0.01 * np.random.default_rng(0).random((40, 30))
    results = [
        normal_contact(z, (0.1, 0.1), material=UNIT, force=0.01)
        for z in (gap, np.asfortranarray(gap))
    ]
    assert results[0].products == results[1].products
    assert_allclose(results[0].pressure, results[1].pressure, rtol=1e-12)


# Failures -----------------------------------------------------------------------------------


REFUSED = {
    ValueError: [
        ({"gap": [[0.0, np.nan]]}, "gap is nan somewhere"),
        ({"gap": [[0.0, -np.inf]]}, "gap has the value -inf"),
        ({"gap": 0.0}, "the grid has shape"),
        ({"gap": np.zeros((2, 0))}, "the grid has shape"),
        ({"gap": np.zeros((2, 2, 2))}, "the grid has shape"),
        ({"element": (1.0, 0.0)}, "element is"),
        ({"element": 1.0}, "element is 1.0, but must be two"),
        ({"element": (1.0, 1.0, 1.0)}, "element is"),
        ({"element": [[1.0], [1.0]]}, "element is"),
        ({"element": (1.0, np.inf)}, "element is"),
        ({"material": (Material.rigid(), Material.rigid())}, "both bodies are rigid"),
        ({"force": None}, "just one of force"),
        ({"approach": 1.0}, "just one of force"),
        ({"force": -1.0}, "force is -1"),
        ({"force": np.nan}, "force is nan"),
        ({"force": None, "approach": np.inf}, "approach is inf"),
        ({"reference": 1.0}, "reference is 1.0"),
        ({"gap": np.full((2, 3), 1e-300)}, "gap is of size 1e-300"),
        ({"force": 1e200}, "force is of size 1e"),
        ({"material": Material.from_shear(1e-300, 0.3)}, "G is of size 1e-300"),
        ({"tolerance": 0.0}, "tolerance is 0"),
        ({"max_products": 0}, "max_products is 0"),
    ],
    TypeError: [
        ({"gap": np.zeros((2, 2), complex)}, "gap has dtype complex128"),
        ({"gap": np.ma.masked_greater(np.zeros((2, 3)), 1.0)}, "gap is a masked array"),
        ({"element": "a"}, "element is 'a', but must be of real numbers"),
        ({"element": None}, "element is missing"),
        ({"material": 82000.0}, r"material is 82000.0, but must be a contact.Material"),
        ({"material": "steel"}, r"material is 'steel', but must be a contact.Material"),
        ({"material": (STEEL, 0.28)}, "material is 0.28, but must be a contact.Material"),
        ({"material": (STEEL,) * 3}, "but must be a contact.Material, or two of them"),
        ({"force": "10"}, "force is '10', but must be a real number"),
        ({"force": 1j}, "force is 1j, but must be a real number"),
        ({"force": [1.0]}, r"force is \[1.0\], but must be a real number"),
        ({"force": None, "approach": "1"}, "approach is '1', but must be a real number"),
        ({"tolerance": "a"}, "tolerance is 'a', but must be a real number"),
        ({"max_products": 1.5}, "max_products is 1.5, but must be an integer"),
        ({"progress": 3}, "progress is 3, but must be a function"),
    ],
}


@pytest.mark.parametrize(
    ("error", "change", "message"),
    [(error, *case) for error, cases in REFUSED.items() for case in cases],
)
def test_refuses_what_makes_no_sense(error, change, message):
    arguments = {"gap": np.zeros((2, 3)), "element": (1.0, 1.0), "material": STEEL, "force": 1.0}
    with pytest.raises(error, match=message):
        normal_contact(**arguments | change)


def test_failure_is_an_error_that_says_what_is_violated():
    with pytest.raises(ContactError, match=r"after \d products the conditions of contact") as error:
        sphere(64, force=0.1, max_products=3, nested=False)
    assert error.value.result.residual > 1e-8
    assert error.value.result.pressure.min() >= 0.0


# Surfaces -----------------------------------------------------------------------------------
