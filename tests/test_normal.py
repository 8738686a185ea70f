"""Normal contact: Hertz's theory, complementarity on any surface, few products."""

import matplotlib as mpl
import numpy as np
import pytest
import scipy.linalg
import scipy.optimize
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.special import ellipe, ellipk

import toeplitz_mg as tmg
from toeplitz_mg.contact import Material, surfaces
from toeplitz_mg.contact.coarsening import coarsen, refine
from toeplitz_mg.contact.grid import Grid
from toeplitz_mg.contact.inverse import LocalInverse
from toeplitz_mg.contact.normal import active_set
from toeplitz_mg.contact.normal.problem import normal_contact
from toeplitz_mg.contact.products import Products
from toeplitz_mg.contact.result import ContactError
from toeplitz_mg.solvers.projected_gradients import descend

mpl.use("Agg")

STEEL = Material.from_shear(82000.0, 0.28)
UNIT = Material.from_shear(0.7, 0.3)  # G and ν of bodies with E* = G/(1-ν) = 1.
A = 0.6  # Radius of contact on grids of [-1, 1].

# Tests of what is solved, on grids that are meant to be small or strange.
doubtful = pytest.mark.filterwarnings("ignore::toeplitz_mg.contact.ContactWarning")


def assert_complementary(contact, tolerance=1e-8):
    scale = contact.rigid + (contact.displacement - contact.gap - contact.rigid).max()
    assert np.isfinite(contact.traction).all()
    assert contact.traction.min() >= 0.0
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
        assert_complementary(contact)
        assert_allclose(contact.force, force, rtol=1e-12)
        assert abs(contact.area - 2 * a) <= 2 * h
        # The constant of plane strain gives δ = 2 F (1-ν)/(πG) (ln(2 d/a) + 1/2).
        approach = 2 * force * (1 - nu) / (np.pi * G) * (np.log(2 * 20.0 / a) + 0.5)
        errors.append([abs(contact.traction.max() / p0 - 1), abs(contact.rigid / approach - 1)])
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
            [abs(by_force.rigid / A**2 - 1), abs(by_approach.force / force - 1),
             abs(by_force.traction.max() / p0 - 1)]
        )  # fmt: skip
    assert np.all(np.divide(errors[:-1], errors[1:]) > 2.0)
    assert np.max(errors[-1]) < 2e-4


def test_hertz_ellipse():
    # Johnson, Contact Mechanics, §4.2: half axes a > b, pressure p0, E* = 1.
    a, b, p0 = 0.6, 0.3, 0.2
    e2 = 1 - (b / a) ** 2
    K, E = ellipk(e2), ellipe(e2)
    common = 2 * p0 * b / (e2 * a**2)
    radii = 1 / (common * (K - E)), 1 / (common * ((a / b) ** 2 * E - K))
    h = 2.0 / 128
    gap = surfaces.ellipsoid((128, 64), (h, h), radii=radii)
    contact = normal_contact(gap, (h, h), material=UNIT, approach=p0 * b * K)
    assert_complementary(contact)
    assert_allclose(contact.force, 2 / 3 * np.pi * a * b * p0, rtol=2e-4)
    assert_allclose(contact.traction.max(), p0, rtol=1e-3)
    assert_allclose(contact.area, np.pi * a * b, rtol=0.02)


def test_long_strips_are_plane_strain():
    gap = surfaces.cylinder(60, 0.05, radius=10.0)
    infinite = normal_contact(gap, 0.05, material=UNIT, force=0.1)
    finite = normal_contact(gap, (0.05, 500.0), material=UNIT, force=0.1 * 500.0)
    column = normal_contact(gap[:, None], (0.05, 500.0), material=UNIT, force=0.1 * 500.0)
    assert_allclose(finite.traction, infinite.traction, atol=1e-4 * infinite.traction.max())
    assert_allclose(column.traction[:, 0], finite.traction, rtol=1e-6, atol=1e-8)


# Products -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("load", "most"), [({"force": 4 / 3 * A**3}, 17), ({"approach": A**2}, 18)]
)
def test_products_for_a_sphere(load, most):
    with tmg.count_products() as work:
        contact = sphere(512, **load)
    assert contact.products <= most
    assert contact.products < contact.work < 1.5 * most
    assert_allclose(work.units(512**2), contact.work)
    assert sum(contact.iterations) < contact.products


@doubtful  # A rough surface reaches the edge of its grid.
@pytest.mark.parametrize(
    ("force", "part", "most"), [(0.0123, 0.02, 19), (0.06, 0.1, 26), (0.2, 0.28, 31)]
)
def test_products_for_a_rough_surface(force, part, most):
    contact = rough(256, force=force)
    assert abs(contact.contact.mean() - part) < 0.005
    assert contact.products <= most


@doubtful  # A rough surface reaches the edge of its grid.
@pytest.mark.parametrize("n", [128, 256])
def test_single_precision_does_not_limit_the_accuracy(n):
    contact = rough(n, force=0.1, tolerance=1e-13)
    assert_complementary(contact, 1e-13)
    assert_allclose(contact.traction.sum() * (2.0 / n) ** 2, 0.1, rtol=1e-14)


@doubtful
@pytest.mark.parametrize("force", [0.005, 0.03, 0.1, 0.3])
def test_rough_surfaces_at_any_load(force):
    contact = rough(128, force=force)
    assert 0.005 < contact.contact.mean() < 0.5
    assert_complementary(contact)
    assert contact.gap.min() >= -1e-14  # The approach is free: nothing penetrates.
    assert_allclose(contact.force, force, rtol=1e-8)
    again = rough(128, approach=contact.rigid)  # Now it goes the other way round.
    assert_allclose(again.force, force, rtol=1e-5)


@pytest.mark.slow
@doubtful  # A rough surface reaches the edge of its grid.
@pytest.mark.parametrize(("n", "force"), [(512, 0.006), (512, 0.36), (1024, 0.06)])
def test_large_rough_surfaces(n, force):
    contact = rough(n, force=force)
    assert 0.005 < contact.contact.mean() < 0.45
    assert_complementary(contact)
    assert contact.gap.min() >= -1e-10 * np.ptp(contact.gap)
    assert_allclose(contact.force, force, rtol=1e-8)
    assert contact.products <= 40


# Any problem --------------------------------------------------------------------------------


@doubtful
def test_the_solution_is_that_of_non_negative_least_squares():
    rng = np.random.default_rng(3)
    z = rng.random((7, 9))
    grid = Grid.of(z.shape, (0.3, 0.2), UNIT, None)
    L = np.linalg.cholesky(grid.normal().toarray())
    p, _ = scipy.optimize.nnls(L.T, scipy.linalg.solve_triangular(L, 0.6 - z.ravel(), lower=True))
    contact = normal_contact(z, (0.3, 0.2), material=UNIT, approach=0.6, tolerance=1e-12)
    assert_allclose(contact.traction.ravel(), p, atol=1e-9)


@doubtful
@pytest.mark.parametrize("load", [{"force": 0.1}, {"approach": 0.03}])
def test_nested_grids_change_the_work_only(load):
    rng = np.random.default_rng(2)
    gap = rng.random((70, 45)) * 0.02
    results = [
        normal_contact(gap, (0.1, 0.07), material=UNIT, nested=nested, tolerance=1e-11, **load)
        for nested in (True, False)
    ]
    assert_allclose(results[0].traction, results[1].traction, rtol=1e-6, atol=1e-9)


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


def test_bodies_that_do_not_touch():
    contact = normal_contact(np.ones((4, 4)), (1.0, 1.0), material=STEEL, approach=1.0)
    assert not contact.traction.any()
    assert not contact.contact.any()
    assert contact.force == contact.area == 0.0
    assert_allclose(contact.gap, 0.0)


def test_a_large_distance_does_no_harm():
    gap = surfaces.sphere((20, 20), (0.1, 0.1), radius=1.0)
    near = normal_contact(gap, (0.1, 0.1), material=UNIT, approach=1e-6 * 2**-3)
    far = normal_contact(gap + 2.0**10, (0.1, 0.1), material=UNIT, approach=2.0**10 + 1e-6 * 2**-3)
    assert_allclose(far.traction, near.traction, rtol=1e-5)


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
    assert_allclose(contact.traction / G, expected.traction, rtol=1e-6, atol=1e-12)


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
    assert contact.products < 200


@doubtful
def test_the_order_in_memory_does_not_matter():
    gap = 0.01 * np.random.default_rng(0).random((40, 30))
    results = [
        normal_contact(z, (0.1, 0.1), material=UNIT, force=0.01)
        for z in (gap, np.asfortranarray(gap))
    ]
    assert results[0].products == results[1].products
    assert_allclose(results[0].traction, results[1].traction, rtol=1e-12)


@doubtful
def test_one_element():
    contact = normal_contact([[0.0]], (1.0, 1.0), material=UNIT, force=2.0)
    assert_allclose(contact.traction, 2.0)


# Failures -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"gap": [[0.0, np.nan]]}, "gap is not a number"),
        ({"gap": [[0.0, -np.inf]]}, "gap has the value -inf"),
        ({"gap": 0.0}, "the grid has shape"),
        ({"gap": np.zeros((2, 0))}, "the grid has shape"),
        ({"gap": np.zeros((2, 2, 2))}, "the grid has shape"),
        ({"element": (1.0, 0.0)}, "element is"),
        ({"element": 1.0}, "element is 1.0, but the grid"),
        ({"element": (1.0, 1.0, 1.0)}, "element is"),
        ({"element": [[1.0], [1.0]]}, "element is"),
        ({"element": (1.0, np.inf)}, "element is"),
        ({"material": (Material.rigid(), Material.rigid())}, "both bodies are rigid"),
        ({"force": None}, "one of the two"),
        ({"approach": 1.0}, "one of the two"),
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
)
def test_refuses_what_makes_no_sense(change, message):
    arguments = {
        "gap": np.zeros((2, 3)), "element": (1.0, 1.0), "material": STEEL, "force": 1.0
    } | change  # fmt: skip
    with pytest.raises(ValueError, match=message):
        normal_contact(arguments.pop("gap"), arguments.pop("element"), **arguments)


def test_refuses_other_types():
    with pytest.raises(TypeError, match="gap has dtype complex128"):
        normal_contact(np.zeros((2, 2), complex), (1.0, 1.0), material=STEEL, force=1.0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"gap": np.ma.masked_greater(np.zeros((2, 3)), 1.0)}, "gap is a masked array"),
        ({"element": "a"}, "element is 'a', but must be of real numbers"),
        ({"element": None}, "element is missing"),
        ({"material": 82000.0}, r"material is 82000.0, but must be a contact.Material"),
        ({"material": "steel"}, r"material is 'steel', but must be a contact.Material"),
        ({"material": (82000.0, 0.28)}, r"use contact.Material\(E=82000.0, nu=0.28\) for Young"),
        ({"material": (82000.0, 0.28)}, r"contact.Material.from_shear\(82000.0, 0.28\) for the sh"),
        ({"material": (STEEL, 0.28)}, "material is 0.28, but must be a contact.Material"),
        ({"material": (STEEL,) * 3}, "but must be a contact.Material, or two of them"),
        ({"force": "10"}, "force is '10', but must be a real number"),
        ({"force": 1j}, "force is 1j, but must be a real number"),
        ({"force": [1.0]}, r"force is \[1.0\], but must be a real number"),
        ({"force": None, "approach": "1"}, "approach is '1', but must be a real number"),
        ({"tolerance": "a"}, "tolerance is 'a', but must be a real number"),
        ({"max_products": 1.5}, "max_products is 1.5, but must be an integer"),
        ({"gap": [np.ma.masked_greater([0.0, 2.0], 1.0)] * 2}, "gap is a masked array"),
        ({"element": (1.0, np.ma.masked)}, "element is a masked array"),
        ({"material": np.ma.masked_less([1.0, 0.3], 0.5)}, "material is a masked array"),
        ({"force": np.ma.masked_greater(2.0, 1.0)}, "force is a masked array"),
        ({"force": None, "approach": np.ma.masked}, "approach is a masked array"),
        ({"tolerance": np.ma.masked}, "tolerance is a masked array"),
        ({"max_products": np.ma.masked_greater(2, 1)}, "max_products is a masked array"),
        ({"progress": 3}, "progress is 3, but must be a function"),
    ],
)
def test_refuses_what_is_no_number(change, message):
    arguments = {
        "gap": np.zeros((2, 3)), "element": (1.0, 1.0), "material": STEEL, "force": 1.0
    } | change  # fmt: skip
    with pytest.raises(TypeError, match=message):
        normal_contact(arguments.pop("gap"), arguments.pop("element"), **arguments)


def test_failure_is_an_error_that_says_what_is_violated():
    with pytest.raises(ContactError, match=r"after \d products the conditions of contact") as error:
        sphere(64, force=0.1, max_products=3, nested=False)
    assert error.value.result.residual > 1e-8
    assert error.value.result.traction.min() >= 0.0


# Parts --------------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", [(6, 6), (4, 7), (7, 4), (1, 5), (5, 1)])
def test_coefficients_on_square_elements(shape):
    x, y = tmg.halfspace.offsets(shape, (0.3, 0.3))
    expected = tmg.halfspace.influence_zz(x, y, (0.3, 0.3), G=0.7, nu=0.3)
    grid = Grid.of(shape, (0.3, 0.3), UNIT, None)
    assert_allclose(grid.normal_coefficients(), expected, rtol=1e-15)


def test_the_inverse_of_a_set_is_positive_definite_on_another():
    grid = Grid.of((16, 16), (0.1, 0.1), UNIT, None)
    c = grid.normal_coefficients()
    A = tmg.ToeplitzOperator(c / c[0, 0])
    rng = np.random.default_rng(0)
    C = rng.random((16, 16)) < 0.5
    M = LocalInverse(grid.invert_by_fsai(A, C), C)
    other = rng.random((16, 16)) < 0.5
    units = np.eye(256)[other.ravel()].reshape(-1, 16, 16)
    P = np.stack([M(e)[other] for e in units])
    assert_allclose(P, P.T, atol=1e-14)
    assert np.linalg.eigvalsh(P).min() > 0.0
    P_A = P @ A.block(np.flatnonzero(other))
    assert np.linalg.cond(P_A) < np.linalg.cond(A.block(np.flatnonzero(other)))


def test_fields_are_multiplied_in_their_precision():
    A = Grid.of((9, 7), (0.1, 0.1), UNIT, None).normal()
    product = Products(A, 10)
    x = np.random.default_rng(0).random((9, 7))
    assert product(x).dtype == np.float64
    single = product(x.astype(np.float32))
    assert single.dtype == np.float32
    assert_allclose(single, product(x), rtol=1e-5)
    assert product.count == 3


@pytest.mark.parametrize("load", [{"force": 0.3}, {"approach": 0.3}])
def test_projected_gradients_descend_to_the_solution(load):
    contact = sphere(16, tolerance=1e-12, **load)
    grid = Grid.of((16, 16), contact.element, UNIT, None)
    product = Products(grid.normal(), 10**6)
    z = surfaces.sphere((16, 16), contact.element, radius=1.0)
    b = contact.rigid - z
    p, u = descend(
        product, b, np.zeros_like(z), lambda x: np.maximum(x, 0.0), product.A.norm_bound, 500
    )
    assert_allclose(u, product(p), atol=1e-12)
    assert_allclose(p, contact.traction, atol=1e-3)


@pytest.mark.parametrize("shape", [(1,), (7,), (8,), (5, 8), (1, 6), (3, 1)])
def test_transfers_keep_constants(shape):
    coarse = coarsen(np.full(shape, 3.0), (True,) * len(shape))
    assert coarse.shape == tuple(-(-n // 2) for n in shape)
    assert_allclose(coarse, 3.0)
    assert_allclose(refine(np.stack([coarse, coarse]), shape), np.full((2, *shape), 3.0))


@doubtful
def test_a_wavy_surface_touches_at_its_crests():
    gap = surfaces.wavy((64, 64), (0.05, 0.05), amplitude=0.01, wavelength=1.6)
    contact = normal_contact(gap, (0.05, 0.05), material=UNIT, approach=0.003)
    assert_complementary(contact)
    assert contact.contact[gap < 0.0005].all()
    assert_allclose(contact.traction, contact.traction[::-1, ::-1], atol=1e-6)


def test_rough_surface_has_its_spectrum():
    gap = surfaces.rough((128, 128), (1.0, 1.0), rms=0.5, hurst=0.7, longest=64.0, shortest=8.0)
    assert_allclose(gap.std(), 0.5)
    assert gap.min() == 0.0
    power = np.abs(np.fft.fft2(gap)) ** 2
    k = np.hypot(*np.meshgrid(*[np.fft.fftfreq(128)] * 2))
    outside = (k > 0) & ((k < 1 / 65) | (k > 1 / 7.9))
    assert power[outside].max() < 1e-16 * power.max()
    inside = (k > 1 / 60) & (k < 1 / 8.2)
    slope = np.polyfit(np.log(k[inside]), np.log(power[inside]), 1)[0]
    assert abs(slope + 2 * (1 + 0.7)) < 0.3


@pytest.mark.parametrize(
    "options", [{"hurst": 0.0}, {"longest": 1.0, "shortest": 0.9}, {"rms": 0.0}]
)
def test_surfaces_refuse_what_makes_no_sense(options):
    with pytest.raises(ValueError, match=r"hurst is|no wavelength|rms is"):
        surfaces.rough((8, 8), (1.0, 1.0), **({"rms": 1.0} | options))
    with pytest.raises(ValueError, match="radius is"):
        surfaces.sphere((8, 8), (1.0, 1.0), radius=-1.0)
    with pytest.raises(ValueError, match=r"radii is .* must be \(R1, R2\)"):
        surfaces.ellipsoid((8, 8), (1.0, 1.0), radii=(1.0, 2.0, 3.0))


@pytest.mark.parametrize(
    ("shape", "error", "message"),
    [
        (4, ValueError, r"shape is 4, but must be \(n1, n2\)"),
        ((-4, 4), ValueError, "shape is -4, but must be at least 1"),
        ((4.0, 4), TypeError, "shape is 4.0, but must be an integer"),
    ],
)
def test_surfaces_refuse_other_shapes(shape, error, message):
    with pytest.raises(error, match=message):
        surfaces.sphere(shape, (1.0, 1.0), radius=1.0)


@doubtful
@pytest.mark.parametrize("shape", [(8, 8), (8,)])
def test_plot(shape):
    gap = sum(x**2 for x in surfaces.centres(shape, (1.0, 1.0)))
    axes = normal_contact(gap, (1.0, 1.0), material=UNIT, approach=5.0).plot()
    assert axes.get_xlabel() == "x [mm]"
    mpl.pyplot.close(axes.figure)


@doubtful
@pytest.mark.parametrize("periodic", [False, True, (True, False)])
def test_a_part_of_the_elements_is_enough(periodic, monkeypatch):
    """The pressures do not depend on whether the iterations know elements that cannot touch."""
    gap = surfaces.rough((64, 64), (0.1, 0.1), rms=0.01, shortest=0.8, seed=4)
    found = []
    for share in (0.0, 1.0):
        monkeypatch.setattr(active_set, "SPARSE", share)
        result = normal_contact(
            gap, (0.1, 0.1), material=UNIT, force=0.02, periodic=periodic, tolerance=1e-11
        )
        assert 0.0 < result.contact_fraction < 0.2
        found.append(result)
    assert np.array_equal(found[0].contact, found[1].contact)
    assert_allclose(found[0].pressure, found[1].pressure, atol=1e-9 * found[0].max_pressure)
