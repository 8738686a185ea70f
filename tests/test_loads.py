"""Load curves have the answers of single loads, in fewer products; the stiffness is their slope."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

import toeplitz_mg as tmg
from tests.systems import refuses
from tests.test_friction import doubtful
from toeplitz_mg import halfspace
from toeplitz_mg.contact import (
    ContactWarning,
    Material,
    friction,
    hertz,
    interfacial_stiffness,
    load_curve,
    normal_contact,
    surfaces,
)

UNIT = Material.from_shear(0.7, 0.3)  # E* = G/(1-ν) = 1 of two equal bodies.
SINGLE = {"forces": "force", "approaches": "approach"}


def rough_gap(n, seed=1):
    h = 2.0 / n
    shortest = max(2.0 / 64, 4 * h)
    return surfaces.rough((n, n), (h, h), rms=0.01, longest=0.5, shortest=shortest, seed=seed)


def sphere_gap(n):
    return surfaces.sphere((n, n), (2.0 / n, 2.0 / n), radius=1.0)


# The answers --------------------------------------------------------------------------------


@doubtful
@pytest.mark.parametrize("loads", [[0.01, 0.05, 0.2, 0.3], [0.3, 0.1, 0.02], [0.1, 0.1, 0.1]])
@pytest.mark.parametrize("by", ["forces", "approaches"])
def test_the_answers_are_those_of_single_loads(loads, by):
    gap, h = rough_gap(64), 2.0 / 64
    if by == "approaches":
        loads = [0.1 * load for load in loads]
    curve = list(load_curve(gap, (h, h), material=UNIT, **{by: loads}))
    for load, result in zip(loads, curve, strict=True):
        single = {SINGLE[by]: load}
        alone = normal_contact(gap, (h, h), material=UNIT, **single)
        assert_allclose(result.force, alone.force, rtol=1e-6)
        assert_allclose(result.approach, alone.approach, rtol=1e-6)
        assert np.array_equal(result.contact, alone.contact)
        assert result.residual <= 1e-8


@doubtful
@pytest.mark.parametrize(
    ("make", "most"), [(rough_gap, 0.75), (sphere_gap, 1.2)], ids=["rough", "smooth"]
)
def test_a_curve_takes_fewer_products_than_single_loads(make, most):
    """Of smooth bodies hardly more: there coarser grids are the better first guess."""
    n, loads = 256, np.linspace(0.2, 0.28, 5)
    gap, element = make(n), (2.0 / n, 2.0 / n)
    curve = list(load_curve(gap, element, material=UNIT, forces=loads))
    alone = [normal_contact(gap, element, material=UNIT, force=load) for load in loads]
    products = sum(result.products for result in curve[2:])
    assert products <= most * sum(result.products for result in alone[2:])


@doubtful
def test_a_previous_result_is_a_first_guess():
    gap, element = rough_gap(128), (2.0 / 128, 2.0 / 128)
    near = normal_contact(gap, element, material=UNIT, force=0.1)
    alone = normal_contact(gap, element, material=UNIT, force=0.1001)
    guessed = normal_contact(gap, element, material=UNIT, force=0.1001, previous=near)
    assert_allclose(guessed.pressure, alone.pressure, atol=1e-5 * alone.max_pressure)
    assert guessed.work < alone.work
    # What is far off does no harm.
    far = normal_contact(gap[::-1], element, material=UNIT, force=0.001)
    guessed = normal_contact(gap, element, material=UNIT, force=0.1, previous=far)
    assert_allclose(guessed.approach, near.approach, rtol=1e-7)


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"forces": [1.0], "approaches": [1.0]}, ValueError, "one of the two must be given"),
        ({}, ValueError, "one of the two must be given"),
        ({"forces": [0.1, -1.0]}, ValueError, "force is -1.0, but must be at least zero"),
        ({"forces": 1.0}, ValueError, r"forces has shape \(\), but must be a list of numbers"),
        ({"forces": [np.inf]}, ValueError, "force is inf, but must be finite"),
        ({"approaches": [np.nan]}, ValueError, "approaches is not a number somewhere"),
        ({"forces": ["a"]}, TypeError, "forces has dtype"),
        ({"forces": [0.1], "tolerance": 2.0}, ValueError, "tolerance is 2.0"),
        ({"forces": [0.1, 1e3], "hardness": 1.0}, ValueError, "which all elements carry if"),
    ],
)
def test_refuses_what_makes_no_sense_before_any_work(change, error, message):
    refuses(error, message, load_curve, rough_gap(16), (0.1, 0.1), material=UNIT, **change)


def test_previous_must_be_of_the_same_grid():
    gap, element = sphere_gap(32), (2.0 / 32, 2.0 / 32)
    pressed = normal_contact(gap, element, material=UNIT, force=0.1)
    shifted = friction(
        bound=0.3 * pressed.pressure, element=element, material=UNIT, force=(0.01, 0.0)
    )
    with pytest.raises(TypeError, match="of type TangentialResult, but must be a NormalResult"):
        normal_contact(gap, element, material=UNIT, force=0.1, previous=shifted)
    with pytest.raises(ValueError, match=r"previous has \(32, 32\) elements of"):
        normal_contact(gap, (0.1, 0.1), material=UNIT, force=0.1, previous=pressed)


# No load ------------------------------------------------------------------------------------


def test_no_force_leaves_the_bodies_where_they_touch_first():
    gap = 3.0 + sphere_gap(33)
    result = normal_contact(gap, (2.0 / 33, 2.0 / 33), material=UNIT, force=0.0)
    assert result.force == result.area == result.stiffness == result.energy == 0.0
    assert result.approach == gap.min() == 3.0
    assert not result.contact.any()
    assert not result.pressure.any()
    assert_allclose(result.gap, gap - 3.0)
    assert result.warnings == ()


@doubtful
def test_a_curve_may_begin_and_end_without_load():
    gap, element = sphere_gap(64), (2.0 / 64, 2.0 / 64)
    curve = list(load_curve(gap, element, material=UNIT, forces=[0.0, 0.1, 0.2, 0.0, 0.1]))
    assert [r.force for r in curve] == pytest.approx([0.0, 0.1, 0.2, 0.0, 0.1])
    assert curve[0].approach == curve[3].approach == gap.min()
    assert_allclose(curve[4].pressure, curve[1].pressure, atol=1e-6)


# Stiffness ----------------------------------------------------------------------------------


@doubtful
@pytest.mark.parametrize("scale", [1.0, 1e5])  # The stiffness is as the modulus.
@pytest.mark.parametrize(
    ("gap", "element"),
    [(rough_gap(24), (2.0 / 24, 2.0 / 24)), (surfaces.cylinder(64, 0.05, radius=1.0), (0.05,))],
    ids=["rough", "line"],
)
def test_stiffness_is_that_of_the_dense_matrix(gap, element, scale):
    """In plane strain it is per length."""
    body = Material.from_shear(0.7 * scale, 0.3)
    result = normal_contact(gap, element, material=body, force=0.05 * scale)
    C = result.contact.ravel()
    A = halfspace.influence_matrix("z", gap.shape, element, body).toarray()[np.ix_(C, C)]
    exact = np.prod(element) * np.linalg.solve(A, np.ones(C.sum())).sum()
    assert_allclose(result.stiffness, exact, rtol=1e-6)


@doubtful
def test_stiffness_is_the_slope_of_the_curve():
    gap, element = rough_gap(64), (2.0 / 64, 2.0 / 64)
    loads = 0.2 * (1.0 + 1e-4 * np.arange(-1, 2))
    curve = list(load_curve(gap, element, material=UNIT, forces=loads, tolerance=1e-11))
    slope = (loads[2] - loads[0]) / (curve[2].approach - curve[0].approach)
    assert_allclose(curve[1].stiffness, slope, rtol=1e-3)


@doubtful
def test_conductance_is_the_inverse_of_holms_resistance():
    """(1/k₁ + 1/k₂)/(4 a) for a round spot; refused where the analogy ends."""
    element, bodies = (0.02, 0.02), (Material(E=120000.0, nu=0.34), Material(E=7e4, nu=0.2))
    gap = surfaces.sphere((64, 64), element, radius=10.0)

    def press(force=60.0, **more):
        return normal_contact(gap, element, material=bodies, force=force, **more)

    whole, a = press(), hertz(radii=10.0, material=bodies, force=60.0).half_axes[0]
    holm = (1 / 58e6 + 1 / 9e6) / (4e-3 * a)
    assert_allclose(whole.conductance(58e6, 9e6), 1 / holm, rtol=0.02)
    assert press(0.0).conductance(1.0, 1.0) == 0.0
    refuses(ValueError, "k1 is 0.0, but must be positive", whole.conductance, 0.0, 1.0)
    for result, message in (
        (press(periodic=(True, False)), "a line contact, but only an area has"),
        (press(hardness=0.5 * whole.max_pressure), "plastic is above zero in"),
        (replace(whole, stiffness=None), "stiffness is None, but"),
    ):
        refuses(ValueError, message, result.conductance, 1.0, 1.0)


@doubtful
@pytest.mark.parametrize("periodic", [False, True])
def test_the_interface_is_in_series_with_the_bodies(periodic):
    """Along it bodies that stick have Mindlin's ratio of stiffness."""
    case = {"element": (2.0 / 64, 2.0 / 64), "material": UNIT, "periodic": periodic, "force": 0.008}
    pressed, whole = (normal_contact(gap, **case) for gap in (rough_gap(64), np.zeros((64, 64))))
    k, kx, ky = interfacial_stiffness(pressed)
    assert_allclose(1 / pressed.stiffness, 1 / whole.stiffness + 1 / (4.0 * k), rtol=1e-5)
    assert_allclose((kx + ky) / (2.0 * k), 1.4 / 1.7, rtol=0.03)
    assert interfacial_stiffness(whole) == (np.inf, np.inf, np.inf)


def test_stiffness_is_computed_once_and_on_demand():
    n = 32
    with tmg.count_products() as pressing:
        result = normal_contact(sphere_gap(n), (2.0 / n, 2.0 / n), material=UNIT, force=0.1)
        repr(result)
    assert_allclose(pressing.units(n**2), result.work)  # Nothing has been spent on it so far.
    with tmg.count_products() as first:
        assert result.stiffness > 0.0
    with tmg.count_products() as second:
        assert pickle.loads(pickle.dumps(result)).stiffness == result.stiffness
    assert first.units(n**2) > second.units(n**2) == 0.0
    assert "stiffness" in result.summary()
    with pytest.raises(AttributeError):
        result.stiffness = 1.0


def test_each_load_warns_as_it_would_alone():
    h = 2.0 / 16
    curve = load_curve(sphere_gap(16), (h, h), material=UNIT, forces=[1e-4, 0.2])
    with pytest.warns(ContactWarning, match="only 2 elements across") as caught:
        first = next(curve)
    assert tuple(str(w.message) for w in caught) == first.warnings
