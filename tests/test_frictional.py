"""Unlike materials: pressures and friction at once, against their conditions and theory."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from tests.budgets import assert_within_budget
from tests.test_friction import assert_areas, assert_slip, doubtful
from tests.test_gaps import Topography
from toeplitz_mg import halfspace
from toeplitz_mg.contact import (
    ContactError,
    ContactWarning,
    Material,
    friction,
    frictional_contact,
    frictional_rolling,
    normal_contact,
    surfaces,
)

SOFT, RIGID = Material.from_shear(0.5, 0.0), Material.rigid()
BODIES = Material.from_shear(1.0, 0.1), Material.from_shear(3.0, 0.4)


def test_in_plane_strain_friction_lifts_one_side_and_lowers_the_other():
    """By the same, however far away; what pressures displace besides is as without friction."""
    n, h, bodies = 40, 0.05, (SOFT, RIGID)
    gap, both = surfaces.cylinder(n, h, radius=1.0), halfspace.combined_material(*bodies)
    result = frictional_contact(gap, h, material=bodies, mu=0.3, force=0.3)
    p, q = result.normal.pressure, result.tangential.traction
    u = halfspace.influence_matrix("z", (n,), (h,), bodies) @ p
    lifted = np.sign(np.subtract.outer(np.arange(n), np.arange(n))) @ q
    coupling = both.difference / both.G * h
    assert_allclose(result.normal.displacement - u, coupling * lifted, rtol=1e-9, atol=1e-12)


def sphere(n=24, **arguments):
    """A soft sphere on a rigid plane."""
    element = (2.0 / n, 2.0 / n)
    gap = surfaces.sphere((n, n), element, radius=1.0)
    given = {"material": (SOFT, RIGID), "mu": 0.3, "force": 0.2} | arguments
    return gap, element, frictional_contact(gap, element, **given)


@doubtful
@pytest.mark.parametrize("bodies", [BODIES, BODIES[::-1], (SOFT, RIGID)], ids=str)
def test_conditions_hold_with_all_displacements(bodies):
    """They are computed anew, from the matrix of all three directions, in two steps of a load."""
    result, before = None, 0.0
    for force, shift in ((0.1, (0.002, 0.001)), (0.2, (0.001, -0.002))):
        case = {"material": bodies, "force": force, "shift": shift, "previous": result}
        gap, element, result = sphere(tolerance=1e-8, **case)
        normal, tangential = result.normal, result.tangential
        t = np.stack([*tangential.traction, normal.pressure])
        A = halfspace.influence_matrix("xyz", gap.shape, element, bodies)
        u = (A @ t.ravel()).reshape(t.shape)
        assert_allclose(normal.displacement, u[2], rtol=0, atol=1e-12)
        w = gap + u[2] - normal.approach
        assert_allclose(normal.gap, w, rtol=0, atol=1e-12)
        interference = normal.approach - gap.min()
        assert np.abs(w[normal.contact]).max() <= 1.01e-8 * interference
        assert w.min() >= -1.01e-8 * interference
        assert (normal.pressure >= 0.0).all()
        assert_allclose(normal.force, force, rtol=1e-8)
        assert_array_equal(tangential.bound, 0.3 * normal.pressure)
        slip = u[:2] - before - np.reshape(shift, (2, 1, 1))
        assert_areas(tangential)
        assert_slip(tangential, u[:2], slip, 1e-9)
        assert tangential.stick.any()
        assert tangential.sliding.any()
        work = 0.5 * np.prod(element) * (t * u).sum()
        assert_allclose(normal.energy + tangential.energy, work, rtol=1e-10)
        before = u[:2]


def test_friction_hardens_and_draws_outwards():
    """The soft body contracts under pressure, and friction on it points outwards (Spence, 1968)."""
    gap, element, result = sphere()
    smooth = normal_contact(gap, element, material=(SOFT, RIGID), force=0.2)
    assert result.normal.area < smooth.area
    assert result.normal.max_pressure > 1.1 * smooth.max_pressure
    x, y = surfaces.centres(gap.shape, element)
    outwards = result.tangential.traction[0] * x + result.tangential.traction[1] * y
    assert (outwards[result.tangential.contact] > 0.0).all()


@pytest.mark.parametrize("shift", [None, (0.003, -0.001)])
def test_like_materials_are_two_problems_exactly(shift):
    gap, element, both = sphere(
        material=(SOFT, SOFT), shift=shift, tolerance=1e-6, tangential_force=None
    )
    normal = normal_contact(gap, element, material=SOFT, force=0.2, tolerance=1e-8)
    assert_array_equal(both.normal.pressure, normal.pressure)
    # Tractions change no gap, so that the stiffness is that without them.
    assert_allclose(both.normal.stiffness, normal.stiffness, rtol=1e-6)
    along = friction(
        bound=0.3 * normal.pressure,
        element=element,
        material=SOFT,
        shift=shift or (0.0, 0.0),
        tolerance=1e-8,
    )
    assert_array_equal(both.tangential.traction, along.traction)
    assert len(both.residuals) == 1


def test_by_approach_as_by_force_and_by_a_tangential_force_as_by_a_shift():
    _, _, one = sphere(shift=(0.01, 0.0), tolerance=1e-8)
    loads = {"approach": one.normal.approach, "tangential_force": one.tangential.force}
    _, _, two = sphere(force=None, tolerance=1e-8, **loads)
    assert_allclose(two.normal.force, 0.2, rtol=1e-6)
    assert_allclose(two.tangential.shift, (0.01, 0.0), atol=1e-7)
    assert_allclose(two.tangential.traction, one.tangential.traction, atol=1e-6)


def test_all_that_friction_carries_slides():
    _, _, result = sphere(tangential_force=(0.036, 0.048), tolerance=1e-8)
    tangential, normal = result.tangential, result.normal
    assert not tangential.stick.any()
    direction = np.reshape([0.6, 0.8], (2, 1, 1))
    assert_allclose(tangential.traction, 0.3 * normal.pressure * direction, rtol=1e-12)
    # It slides against the force, and one element only begins to.
    along = (tangential.slip * direction).sum(axis=0)
    assert_allclose(along[normal.contact].max(), 0.0, atol=1e-12)
    assert (along <= 1e-12).all()


@doubtful
@pytest.mark.parametrize("approach", [0.0625, 0.05, 0.1])
def test_steps_at_the_same_approach_are_those_of_friction_where_materials_are_alike(approach):
    """The load does not change, so that tractions are not extrapolated with it."""
    shifts = (1e-2, 5e-3), (-4e-3, 0.0), (2e-3, -2e-3), (0.0, 0.0)
    both, along, slid = None, None, []
    for shift in shifts:
        gap, element, both = sphere(
            material=(SOFT, SOFT), force=None, approach=approach, shift=shift, previous=both
        )
        normal = normal_contact(gap, element, material=SOFT, approach=approach, tolerance=1e-8)
        along = friction(normal, mu=0.3, shift=shift, previous=along)
        assert_allclose(
            both.tangential.traction, along.traction, rtol=0, atol=1e-5 * along.bound.max()
        )
        slid.append(along.sliding.any())
    assert any(slid)


def test_more_than_the_largest_coefficient_carries_is_refused_before_any_work():
    told = []
    with pytest.raises(ValueError, match=r"tangential_force is .* would slide off"):
        sphere(tangential_force=(0.07, 0.0), progress=lambda *args: told.append(args))
    assert not told


def test_the_energy_is_of_both_parts_and_the_stiffness_of_none():
    """A part has the work of its tractions on displacements that are of the other, too."""
    _, _, result = sphere(shift=(0.004, 0.0))
    normal, tangential = result.normal, result.tangential
    parts = (normal.traction[None], tangential.traction)
    moved = (normal.displacement[None], tangential.displacement)
    work = sum((q * u).sum() for q, u in zip(parts, moved, strict=True))
    assert_allclose(result.energy, 0.5 * work * np.prod(normal.element), rtol=1e-12)
    assert result.energy > 0.0
    assert result.summary().count("elastic energy") == 1
    assert normal.stiffness is None
    assert "stiffness" not in result.summary()


def test_heights_and_units_are_those_of_normal_contact():
    gap, element, known = sphere()
    case = {"material": known.normal.material.bodies, "mu": 0.3, "force": known.normal.force}
    pixel = tuple(1e3 * h for h in element)
    result = frictional_contact(heights=7.0 - 1e3 * gap, element=pixel, unit="um", **case)
    assert_allclose(result.normal.pressure, known.normal.pressure, atol=1e-6)
    assert_allclose(result.tangential.traction, known.tangential.traction, atol=1e-6)

    sizes = tuple(24 * h for h in pixel)
    with pytest.raises(ValueError, match="takes no periodic surfaces"):
        frictional_contact(heights=Topography(-1e3 * gap, sizes, "um", is_periodic=True), **case)
    same = frictional_contact(heights=Topography(-1e3 * gap, sizes, "um"), **case)
    assert_allclose(same.normal.pressure, known.normal.pressure, atol=1e-6)


def test_friction_of_each_element():
    mu = np.where(np.arange(24) < 12, 0.1, 0.3)[:, None] + np.zeros((24, 24))
    _, _, result = sphere(mu=mu, tolerance=1e-8)
    q, p = result.tangential.magnitude, result.normal.pressure
    assert (q <= mu * p * (1 + 1e-12)).all()
    slides = result.tangential.sliding
    assert slides[:12].any()
    assert slides[12:].any()
    assert_allclose(q[slides], (mu * p)[slides], rtol=1e-12)
    _, _, uniform = sphere(mu=np.full((24, 24), 0.3), tolerance=1e-8)
    _, _, number = sphere(mu=0.3, tolerance=1e-8)
    assert np.array_equal(uniform.tangential.traction, number.tangential.traction)


def test_line_contact_in_plane_strain():
    """Far longer strips are the same; friction makes the contact narrower."""
    (x,) = surfaces.centres(64, 0.05)
    gap = x**2 / 2
    arguments = {"material": (SOFT, RIGID), "mu": 0.3}
    plane = frictional_contact(gap, 0.05, force=0.3, **arguments)
    strips = frictional_contact(gap, (0.05, 1e4), force=0.3e4, **arguments)
    assert_allclose(plane.normal.pressure, strips.normal.pressure, rtol=0, atol=1e-4)
    assert_allclose(plane.tangential.traction, strips.tangential.traction, rtol=0, atol=1e-4)
    smooth = normal_contact(gap, 0.05, material=(SOFT, RIGID), force=0.3)
    assert plane.normal.area < smooth.area
    assert plane.tangential.traction[40] > 0.0 > plane.tangential.traction[23]


def test_bonded_punch():
    """Mossakovskii and Spence: ln(3 - 4ν)/(1 - 2ν) at ν = 0; the error falls with the element."""
    errors = []
    for n in (32, 64):
        x, y = surfaces.centres((n, n), (2.0 / n, 2.0 / n))
        gap = np.where(np.hypot(x, y) < 0.8, 0.0, 1.0)
        press = {"element": (2.0 / n, 2.0 / n), "material": (SOFT, RIGID), "approach": 1e-3}
        bonded = frictional_contact(gap, mu=np.inf, **press)
        assert bonded.tangential.stick[gap == 0.0].all()
        errors.append(bonded.normal.force / normal_contact(gap, **press).force / np.log(3.0) - 1.0)
    assert abs(errors[1]) < 0.7 * abs(errors[0]) < 0.003


@doubtful  # It begins with one element in contact.
@pytest.mark.slow
def test_a_sphere_pressed_in_35_steps():
    """Spence; Kalker 1990, Figure 5.25."""
    h = 0.2
    x = -4.3999 + h * np.arange(45)
    gap = 0.004116 * (x[:, None] ** 2 + x**2)
    bodies = SOFT, Material.from_shear(1e5, 0.0)
    result = None
    for k in range(1, 36):
        result = frictional_contact(
            gap, (h, h), material=bodies, mu=0.2986, force=(k / 45) ** 3, previous=result
        )
        assert_within_budget("a sphere in 35 steps", iterations=len(result.residuals))
    assert result.normal.contact.sum() == 921
    assert result.tangential.stick.sum() == 225
    assert result.tangential.sliding.sum() == 696
    assert f"{result.normal.max_pressure:.5f}" == "0.02392"
    assert f"{result.normal.approach:.5f}" == "0.09874"
    smooth = normal_contact(gap, (h, h), material=bodies, force=(35 / 45) ** 3)
    assert smooth.contact.sum() == 973
    assert f"{smooth.max_pressure:.5f}" == "0.01834"


@pytest.mark.parametrize("is_rolling", [False, True])
def test_products_and_warnings_are_those_of_both_parts(is_rolling):
    gap, told = surfaces.sphere((24, 24), (0.1, 0.1), radius=2.0), []
    solve = frictional_rolling if is_rolling else frictional_contact
    with pytest.warns(ContactWarning, match="the contact is only"):
        result = solve(
            gap, (0.1, 0.1), material=(SOFT, RIGID), mu=0.3, force=0.01,
            progress=lambda products, _: told.append(products),
        )  # fmt: skip
    assert "the contact is only" in " ".join(result.warnings)
    assert told == sorted(told)
    # What is told lacks a look at the end at most.
    assert told[-1] <= result.products <= told[-1] + 1
    assert min(result.normal.products, result.tangential.products) > 0


def test_without_contact_there_is_nothing():
    gap, _, result = sphere(force=None, approach=-0.1)
    assert not result.normal.pressure.any()
    assert not result.tangential.traction.any()
    assert_array_equal(result.normal.gap, gap - gap.min() + (gap.min() + 0.1))


def test_no_force_is_a_result_after_any_other():
    _, _, one = sphere()
    _, _, two = sphere(force=0.0, previous=one)
    assert not two.normal.pressure.any()
    assert not two.tangential.traction.any()
    _, _, three = sphere(force=0.2, previous=two)
    assert_allclose(three.normal.force, 0.2, rtol=1e-9)


def test_where_the_gap_is_infinite_there_is_no_material():
    """As where it is too large to close."""
    x, y = surfaces.centres((24, 24), (0.1, 0.1))
    gap = np.where(np.hypot(x, y) < 0.8, 0.1 * (x**2 + y**2), np.inf)
    press = {"element": (0.1, 0.1), "material": (SOFT, RIGID), "mu": 0.3, "force": 0.5}
    none = frictional_contact(gap, **press)
    far = frictional_contact(np.minimum(gap, 2.0), **press)
    assert_allclose(none.normal.pressure, far.normal.pressure, atol=1e-5)
    assert_allclose(none.tangential.traction, far.tangential.traction, atol=1e-5)
    with pytest.raises(ValueError, match="gap is infinite everywhere"):
        frictional_contact(np.full((4, 4), np.inf), **press)


@doubtful
@pytest.mark.parametrize("towards", [-1.0, 1.0])
def test_friction_in_one_contact_may_open_or_close_another(towards):
    """Its tractions change the gap elsewhere, where pressures alone do otherwise."""
    h, n = (0.1, 0.1), 16
    x, y = surfaces.centres((2 * n, n), h)
    case = {"material": (SOFT, RIGID), "approach": 0.05}

    def gap(height):
        return np.minimum((x + 0.8) ** 2, (x - 0.8) ** 2 + 2.0 * height) / 2 + y**2 / 2

    def shift(height):
        return frictional_contact(gap(height), h, mu=0.5, shift=(0.2 * towards, 0.0), **case)

    apex, other = np.s_[n + 7 : n + 9, n // 2 - 1 : n // 2 + 1], np.s_[n:]
    results = shift(1.0).normal, normal_contact(gap(1.0), h, **case)
    lowest = [(result.gap[apex] - 1.0).mean() for result in results]
    height = -np.mean(lowest)  # It touches in one of the two cases.
    both, alone = shift(height), normal_contact(gap(height), h, **case)
    assert both.normal.contact[other].any() != alone.contact[other].any()
    assert_array_equal(both.tangential.bound, 0.5 * both.normal.pressure)
    assert_array_equal(both.tangential.contact, both.normal.contact)


@pytest.mark.parametrize(
    ("change", "error", "match"),
    [
        ({"mu": -0.1}, ValueError, "mu is -0.1, but a coefficient of friction is at least zero"),
        ({"mu": np.nan}, ValueError, "mu is not a number somewhere"),
        ({"mu": [0.1, 0.2]}, ValueError, r"mu has shape \(2,\), but must be a number, or have"),
        ({"heights": np.ones((4, 4))}, ValueError, "either gap or heights must be given"),
        ({"force": None, "approach": 1e200}, ValueError, r"the interference is of size 1e\+200"),
        ({"shift": (0, 0), "tangential_force": (0, 0)}, ValueError, "at most one of the two may"),
        ({"tangential_force": (0.07, 0.0)}, ValueError, "tangential_force is .* would slide off"),
        ({"tangential_force": (0.07, 0), "force": None, "approach": 0.2}, ValueError, "slide off"),
        ({"previous": 1.0}, TypeError, "previous is of type float, but must be a FrictionalResult"),
        ({"max_iterations": 0}, ValueError, "max_iterations is 0"),
        ({"tolerance": 0.0}, ValueError, "tolerance is 0.0"),
        ({"max_iterations": 2}, ContactError, "after 2 iterations between pressures and friction"),
        ({"max_products": 5}, ContactError, "after . products Coulomb.*; max_products is 5: allow"),
    ],
)
def test_refuses_bad_arguments_and_says_where_it_does_not_converge(change, error, match):
    with pytest.raises(error, match=match):
        sphere(**change)


@doubtful
@pytest.mark.parametrize("force", [-1.43369, -1.4342, -1.4316])
def test_a_force_near_its_limit_along_one_axis_is_no_singular_matrix(force):
    element, bodies = (0.1, 0.1), (Material(E=1000.0, nu=0.0), RIGID)
    gap = surfaces.sphere((32, 32), element, radius=20.0)
    mu = np.where(surfaces.centres((32, 32), element)[0] + 0.0 * gap > 0.0, 0.8, 0.1)
    loads = {"force": 3.0, "tangential_force": (force, 0.0)}
    result = frictional_contact(gap, element, material=bodies, mu=mu, **loads)
    assert_allclose(result.tangential.force, (force, 0.0), atol=1e-9)


@doubtful
def test_in_line_contact_forces_and_histories_may_be_lateral():
    gap = surfaces.cylinder(64, 0.02, radius=30.0)
    alike = Material(E=210000.0, nu=0.28)
    pressed = {"mu": 0.3, "force": 50.0}
    both = frictional_contact(gap, 0.02, material=alike, **pressed, tangential_force=(3.0, 2.0))
    normal = normal_contact(gap, 0.02, material=alike, force=50.0)
    shifted = friction(normal, mu=0.3, force=(3.0, 2.0))
    assert_allclose(both.tangential.traction, shifted.traction, atol=1e-9 * shifted.bound.max())
    unlike = alike, Material(E=70000.0, nu=0.33)
    rolled = frictional_rolling(gap, 0.02, material=unlike, **pressed, lateral=1e-4)
    after = frictional_contact(gap, 0.02, material=unlike, **pressed, previous=rolled)
    assert after.tangential.traction.shape == (2, 64)
    # Of a history along x alone, the lateral tractions begin at zero.
    along = frictional_contact(gap, 0.02, material=unlike, **pressed)
    step = frictional_contact(
        gap, 0.02, material=unlike, mu=0.3, force=52.0, shift=(0.0, 1e-5), previous=along
    )
    more = frictional_contact(gap, 0.02, material=unlike, mu=0.3, force=54.0, previous=step)
    assert more.residual <= 1e-6
    lateral = more.tangential.traction[1]
    assert lateral.min() >= -1e-6 * lateral.max()
    assert lateral.max() > 0.0
