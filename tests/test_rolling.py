"""Steady rolling: Carter, Kalker's coefficients, Coulomb's law, and the limit of many steps."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from tests.budgets import assert_within_budget
from tests.test_friction import assert_areas, assert_slip, doubtful, semi_ellipse
from toeplitz_mg.contact import (
    ContactError,
    Material,
    SteadyOptions,
    creep_curve,
    normal_contact,
    rolling,
    rolling_steps,
    surfaces,
)
from toeplitz_mg.halfspace import influence_matrix

MU, A = 0.3, 0.6
NAMES = ("longitudinal", "lateral", "spin")


def carter(n, part=0.6, **arguments):
    """n elements in a contact [-a, a], R = 1, G/(1-ν) = 1, that sticks in part of its length."""
    h = 2 * A / n
    (x,) = surfaces.centres(n + n // 2, h)
    g = MU * A / 2 * semi_ellipse(x, A)
    result = rolling(
        bound=g,
        element=h,
        material=Material.from_shear(0.7, 0.3),
        longitudinal=-MU * (A - part * A),
        **arguments,
    )
    return x, g, result


def circle(n, creepages, nu=0.25, bound=None, **arguments):
    h = 2.0 / n
    x, y = surfaces.centres((n, n), (h, h))
    r = np.hypot(x, y)
    g = MU * 2 * A / np.pi * semi_ellipse(r, A) if bound is None else np.where(r < A, bound, 0.0)
    creepages = dict(zip(NAMES, creepages, strict=True))
    return g, rolling(
        bound=g, element=(h, h), material=Material.from_shear(1.0, nu), **creepages, **arguments
    )


@doubtful
def test_bounds_that_decay_far_below_rounding():
    material, element = Material(E=210000.0, nu=0.28), (0.05, 0.05)
    corner = np.full((3, 3), 30.0)
    corner[2, 2] = 1e-16
    creepages = {"longitudinal": 1e-3, "lateral": 5e-4}
    assert_rolls(rolling(bound=corner, element=element, material=material, **creepages), material)
    x, y = surfaces.centres((40, 40), element)
    g = 300.0 * np.exp(-(x**2 + y**2) / 0.2**2)
    creepages = {"longitudinal": 1e-3, "spin": 2e-3}
    rolled = rolling(bound=g, element=element, material=material, **creepages)
    assert_rolls(rolled, material)
    assert not rolled.contact[g < 1e-16 * g.max()].any()
    by_force = rolling(
        bound=g, element=element, material=material, force=(0.5 * 0.05**2 * g.sum(), 0.0)
    )
    assert_rolls(by_force, material)
    *_, last = rolling_steps(
        bound=corner, element=element, material=material, longitudinal=1e-3, steps=2
    )
    assert last.contact.sum() == 8


def assert_rolls(result, material, before=None, tolerance=1e-8):
    """Equations 2, 3 and 8, in the steady state or after a step from other tractions."""
    assert_areas(result)
    assert result.residual <= tolerance
    shape, h = result.contact.shape, result.element[0]
    if len(shape) == 1:
        moving = np.ravel(result.rigid)[:2]  # Along x alone, or across it too.
        w = np.tile(moving[:, None], shape)
    else:
        x, y = surfaces.centres(shape, result.element)
        longitudinal, lateral, spin = result.rigid
        w = np.stack([longitudinal - spin * y, lateral + spin * x])
    A, S = (
        influence_matrix("xy"[: len(w)], shape, result.element, material, ahead=ahead)
        for ahead in (0, 1)
    )
    q = result.traction
    u = (A @ q.ravel()).reshape(w.shape)
    ahead = (S @ (q if before is None else before).ravel()).reshape(w.shape)
    scale = 2 * tolerance * h * np.abs(w * result.contact).max()
    in_units = replace(result, slip=result.slip * h)
    assert_slip(in_units, u, w * h + u - ahead, scale)


def test_carter():
    errors = []
    for n in (50, 200, 800):
        x, g, result = carter(n)
        assert_rolls(result, Material.from_shear(0.7, 0.3))
        errors.append(abs(result.force / (MU * np.pi * A**2 / 4) - 0.64))
        ahead = A - 2 * 0.6 * A  # It sticks from the leading edge to here.
        assert_allclose(x[result.stick].min(), ahead, atol=2 * 2 * A / n)
        assert_allclose(x[result.stick].max(), A, atol=3 * A / n)
        theory = MU * A / 2 * (semi_ellipse(x, A) - 0.6 * semi_ellipse(x - 0.4 * A, 0.6 * A))
        assert np.sqrt(np.mean((result.traction - theory) ** 2)) < 0.1 * g.max() / np.sqrt(n / 50)
    assert errors[0] < 0.02 * 0.64
    assert errors[2] < 0.3 * errors[0]


def test_small_creepage_is_without_slip_but_at_the_trailing_edge():
    _, bonded = circle(48, (3e-3, 0.0, 0.0), bound=np.inf)
    _, result = circle(48, (3e-3, 0.0, 0.0))
    assert 0 < result.sliding.sum() < 0.05 * result.contact.sum()
    x, _ = surfaces.centres((48, 48), (1 / 24, 1 / 24))
    assert x[result.sliding].max() < 0.0
    assert_allclose(result.force[0], bonded.force[0], rtol=0.01)


def test_large_creepage_slides_everywhere():
    g, result = circle(32, (3.0, 4.0, 0.0))
    assert not result.stick.any()
    total = g.sum() * result.element[0] ** 2
    assert_allclose(result.force, [-0.6 * total, -0.8 * total], rtol=0.01)


@pytest.mark.parametrize(
    "creepages", [(0.1, 0.0, 0.0), (0.0, 0.1, 0.0), (0.0, 0.0, 0.3), (0.06, 0.04, 0.2)]
)
def test_products_do_not_depend_on_the_number_of_elements(creepages):
    of_few, of_many = (circle(n, creepages)[1] for n in (64, 256))
    assert_rolls(of_many, Material.from_shear(1.0, 0.25))
    assert of_many.products <= 1.2 * of_few.products
    case = "rolling of a circle, n = 256"
    assert_within_budget(case, products=of_many.products, work_units=of_many.work)


@doubtful
@pytest.mark.parametrize("creepages", [(0.005, 0.0), (0.002, 0.003), (0.05, 0.0)])
def test_products_on_a_fragmented_area(creepages):
    h, material = (1 / 96, 1 / 96), Material.from_shear(0.75, 0.25)
    rough = surfaces.rough((192, 192), h, rms=0.01, longest=0.5, shortest=1 / 24, seed=1)
    pressed = normal_contact(rough, h, material=material, force=0.2)
    result = rolling(pressed, mu=MU, longitudinal=creepages[0], lateral=creepages[1])
    assert_rolls(result, material)
    assert_within_budget("rolling of rough surfaces, n = 192", products=result.products)


def test_a_start_from_coarser_grids_is_nearly_right():
    """Few elements are in the wrong one of stick and slip, so that 1 % takes few products."""
    creepages = [(c, 0.0, 0.0) for c in (0.02, 0.03, 0.05, 0.1)]
    creepages += [(0.0, 0.03, 0.0), (0.02, 0.02, 0.05)]
    products = sum(circle(128, given, tolerance=0.01)[1].products for given in creepages)
    assert_within_budget("rolling to 1 % on coarser grids first, 6 cases", products=products)


def test_a_long_narrow_contact_of_elements_that_are_longer_than_wide_converges():
    x, y = surfaces.centres((240, 24), (1.0, 0.3))
    g = 1e-3 * semi_ellipse(np.hypot(x / 120.0, y / 3.6), 1.0)
    case = {"longitudinal": 2.1e-5, "lateral": 1.25e-5}
    result = rolling(bound=g, element=(1.0, 0.3), material=Material.from_shear(1.0, 0.3), **case)
    assert result.residual <= 1e-8
    assert_within_budget("rolling, long and narrow", products=result.products)


def test_products_of_a_line_in_pieces_of_few_elements():
    (x,) = surfaces.centres(2000, 1e-3)
    g = 1e-3 * semi_ellipse(x, 1.0) * (np.random.default_rng(1).random(2000) < 0.7)
    result = rolling(
        bound=g, element=1e-3, material=Material.from_shear(1.0, 0.3), longitudinal=-2e-4
    )
    assert_within_budget("rolling of a line in pieces", products=result.products)


def test_products_in_line_contact():
    few, many = (carter(n)[2].products for n in (1229, 19_660))
    assert_within_budget("rolling of a line, n = 1229", products=few)
    assert many <= 1.2 * few + 1


def test_nested_grids_change_the_work_only():
    results = [circle(48, (0.05, 0.02, 0.1), nested=n, tolerance=1e-10)[1] for n in (True, False)]
    assert_allclose(results[0].traction, results[1].traction, atol=1e-7)


def test_the_steady_state_is_the_limit_of_many_steps():
    g, result = circle(16, (0.05, 0.03, 0.1))
    case = {"longitudinal": 0.05, "lateral": 0.03, "spin": 0.1}
    case |= {"element": result.element, "material": Material.from_shear(1.0, 0.25)}
    steps = list(rolling_steps(bound=g, steps=80, **case))
    away = [np.abs(step.traction - result.traction).max() for step in steps]
    assert away[-1] < 1e-6 * g.max()
    assert away[0] > 0.1 * g.max()
    assert_allclose(steps[-1].slip, result.slip, atol=1e-6)
    assert_allclose(steps[-1].displacement, result.displacement, atol=1e-6)
    # The steady state stays.
    (after,) = rolling_steps(bound=g, steps=1, previous=result, **case)
    assert_allclose(after.traction, result.traction, atol=1e-6 * g.max())


@doubtful
@pytest.mark.parametrize(
    "contact", [np.s_[:, :], np.s_[20:21, 10:30]], ids=["a row", "a row of a grid"]
)
@pytest.mark.parametrize("bound", [0.3, np.inf])
def test_a_contact_one_element_long(contact, bound):
    # Its elements do not couple x and y, but those that were there one element ago do.
    g = np.zeros((40, 40) if contact[0].start else (1, 9))
    g[contact] = bound
    case = {"material": Material.from_shear(1.0, 0.3), "longitudinal": 0.02, "lateral": 0.1}
    result = rolling(bound=g, element=(1.0, 1.0), **case)
    assert_rolls(result, Material.from_shear(1.0, 0.3))
    *_, last = rolling_steps(bound=g, element=(1.0, 1.0), steps=100, **case)
    assert_allclose(last.traction, result.traction, atol=1e-6 * np.abs(result.traction).max())


def test_what_is_around_the_contact_is_not_multiplied():
    g, alone = circle(40, (0.05, 0.02, 0.1))
    around = np.pad(g, 30)
    case = {"longitudinal": 0.05, "lateral": 0.02, "spin": 0.1}
    result = rolling(
        bound=around, element=alone.element, material=Material.from_shear(1.0, 0.25), **case
    )
    assert np.array_equal(result.traction[:, 30:-30, 30:-30], alone.traction)
    assert (result.products, result.work) == (alone.products, alone.work)


def test_a_step_obeys_coulombs_law_in_time():
    x, g, _ = carter(40)
    h, material = x[1] - x[0], Material.from_shear(0.7, 0.3)
    A, S = (influence_matrix("x", g.shape, (h,), material, ahead=ahead) for ahead in (0, 1))
    before = np.zeros_like(g)
    for step in rolling_steps(bound=g, element=h, material=material, longitudinal=-0.1, steps=3):
        # Equation 8, at the points that move with the material
        slip = -0.1 * h + step.displacement - S @ before
        u = A @ step.traction
        assert_allclose(step.slip[g > 0], slip[g > 0] / h, atol=1e-12)
        assert_allclose(step.displacement[g > 0], u[g > 0], atol=1e-9)
        assert_rolls(step, material, before)
        before = step.traction


@pytest.mark.parametrize("is_line", [True, False])
@pytest.mark.parametrize("part", [0.5, 0.8])
def test_a_step_knows_what_was_outside_the_contact_that_it_leads_to(is_line, part):
    """Tractions displaced the bodies there before, and nothing carries that any more."""
    material = Material.from_shear(1.0, 0.25)
    shape, h = ((64,), 2.0 / 64) if is_line else ((32, 32), 2.0 / 32)
    r = np.sqrt(sum(x**2 for x in surfaces.centres(shape, (h,) * len(shape))))
    case = {"element": (h, h) if not is_line else h, "material": material, "longitudinal": -0.05}
    before = rolling(bound=MU * semi_ellipse(r, A), **case)
    for towards in (-1, 1):
        g = MU * semi_ellipse(r, part * A)
        g = np.roll(g, towards * int((1 - part) * A / h), axis=0)
        (step,) = rolling_steps(bound=g, steps=1, previous=before, **case)
        # Its violation is relative to displacements before, which are larger than the slip.
        assert_rolls(step, material, before.traction, tolerance=1e-6)


def test_a_step_that_takes_too_many_products_is_an_error():
    x, g, _ = carter(40)
    case = {"material": Material.from_shear(0.7, 0.3), "longitudinal": -0.1}
    steps = rolling_steps(bound=g, element=x[1] - x[0], steps=2, max_products=1, **case)
    with pytest.raises(ContactError, match="after 2 products Coulomb's law is violated by"):
        next(steps)


@doubtful
@pytest.mark.parametrize("nu", [0.0, 0.28])
def test_a_narrow_contact_that_sticks_nearly_everywhere(nu):
    """Its elements are longer than wide: the sets of stick and slip get stuck once."""
    x, y = surfaces.centres((100, 7), (1.0, 0.1))
    g = 1e-2 * np.sqrt(np.maximum(1.0 - (x / 50.0) ** 2 - (y / 0.35) ** 2, 0.0))
    material = Material.from_shear(1.0, nu)
    result = rolling(
        bound=g, element=(1.0, 0.1), material=material, longitudinal=5e-5, lateral=4e-5
    )
    assert_rolls(result, material)
    case = "rolling, narrow and sticking nearly everywhere"
    assert_within_budget(case, products=result.products)


@doubtful
@pytest.mark.parametrize("n", [28, 36])
def test_without_patience_it_rolls_on_to_the_same_steady_state(n):
    impatient = SteadyOptions(iterations=20, patience=1)  # Too little to settle.
    creepages = (0.05, 0.03, 0.1)
    _, result = circle(n, creepages, nested=False, options=impatient)
    assert_rolls(result, Material.from_shear(1.0, 0.25))
    assert_allclose(result.traction, circle(n, creepages)[1].traction, atol=1e-7)


@doubtful
@given(
    seed=st.integers(0, 2**32 - 1),
    shape=st.one_of(
        st.tuples(st.integers(1, 80)), st.tuples(st.integers(1, 30), st.integers(1, 30))
    ),
    nu=st.floats(-0.9, 0.5),
    creepages=st.tuples(*[st.floats(1e-6, 0.1) | st.floats(-0.1, -1e-6) | st.just(0.0)] * 3),
)
@settings(max_examples=40, deadline=None)
@example(0, (1, 2), 1.1125369292536007e-308, (0.0, 0.1, 0.0))  # Its couplings underflow.
@example(0, (1, 5), 1.175494351e-38, (0.0625, 0.0, 0.0))
def test_coulombs_law_for_any_creepage(seed, shape, nu, creepages):
    rng = np.random.default_rng(seed)
    h = 10.0 ** rng.uniform(-2, 1)
    g = np.maximum(0.0, rng.random(shape) - 0.3) * 10.0 ** rng.uniform(-3, 1)
    creepages = creepages[0] if len(shape) == 1 else np.array(creepages) / [1, 1, h * max(shape)]
    given = dict(zip(NAMES, np.atleast_1d(creepages).tolist(), strict=False))
    result = rolling(bound=g, element=(h, 2 * h), material=Material.from_shear(1.0, nu), **given)
    assert_rolls(result, Material.from_shear(1.0, nu))


@doubtful
@pytest.mark.parametrize("finer", [1, 3])
@pytest.mark.parametrize("seed", range(24))
def test_any_ellipse_of_few_elements(seed, finer):
    """Of any shape, with any friction, that rolls by any creepages with some slip."""
    rng = np.random.default_rng(seed)
    n = finer * int(rng.integers(5, 13))
    a, b = np.exp(rng.uniform(-1.0, 1.0, 2))
    element, bound = (2 * a / n, 2 * b / n), 10.0 ** rng.uniform(-3, -1)
    x, y = surfaces.centres((n, n), element)
    g = bound * semi_ellipse(np.hypot(x / a, y / b), 1.0)
    sizes = bound * 10.0 ** rng.uniform(-1, 1) * rng.standard_normal(3)
    creepages = dict(zip(NAMES, sizes.tolist(), strict=True))
    material = Material.from_shear(1.0, float(rng.uniform(0.0, 0.5)))
    assert_rolls(rolling(bound=g, element=element, material=material, **creepages), material)


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"longitudinal": np.nan}, ValueError, "longitudinal is nan"),
        ({"moment": 0.1}, ValueError, "moment is 0.1, but line contact"),
        ({"spin": 0.1}, ValueError, "spin is 0.1, but line contact"),
        ({"longitudinal": 1e-300}, ValueError, "longitudinal is of size 1e-300"),
        ({"tolerance": 0.0}, ValueError, "tolerance is 0"),
        *(
            ({"longitudinal": value}, TypeError, "longitudinal is .*, but must be a real number")
            for value in ("a", 1j, None, [1e-3])
        ),
        ({"options": 3}, TypeError, r"options is 3, but must be contact\.SteadyOptions"),
    ],
)
def test_refuses_what_makes_no_sense(change, error, message):
    with pytest.raises(error, match=message):
        rolling(bound=np.ones(4), element=1.0, material=Material.from_shear(1.0, 0.3), **change)


@doubtful
def test_a_normal_result_has_the_bound_the_elements_and_the_material():
    gap, steel = surfaces.sphere((16, 12), (0.1, 0.1), radius=10.0), Material.from_shear(1.0, 0.3)
    pressed = normal_contact(gap, (0.1, 0.1), material=steel, force=0.01)
    case = {"element": (0.1, 0.1), "material": steel}
    for mu in (0.3, np.linspace(0.2, 0.4, 12) + np.zeros((16, 1))):
        g, creepage = mu * pressed.pressure, -1e-3
        expected = rolling(bound=g, **case, longitudinal=creepage)
        result = rolling(pressed, mu=mu, longitudinal=creepage)
        assert_array_equal(result.traction, expected.traction)
        *_, last = rolling_steps(pressed, mu=mu, longitudinal=creepage, steps=2)
        *_, expected = rolling_steps(bound=g, **case, longitudinal=creepage, steps=2)
        assert_array_equal(last.traction, expected.traction)
        curve = creep_curve(pressed, mu=mu, longitudinal=[-1e-3, -2e-3])
        expected = creep_curve(bound=g, **case, longitudinal=[-1e-3, -2e-3])
        assert_array_equal(curve.force, expected.force)


@doubtful
def test_surfaces_that_repeat_do_not_roll():
    wave = np.cos(2.0 * np.pi * np.arange(32) / 32)
    steel = Material.from_shear(1.0, 0.3)
    repeats = normal_contact(wave, 0.1, material=steel, force=0.5, periodic=True)
    with pytest.raises(ValueError, match="surfaces that roll do not repeat"):
        rolling(repeats, mu=0.3, longitudinal=1e-3)


def test_refuses_options_that_are_none():
    with pytest.raises(ValueError, match="iterations is 0, but must be"):
        SteadyOptions(iterations=0)
    with pytest.raises(TypeError, match=r"patience is 1\.5, but must be an"):
        SteadyOptions(patience=1.5)


def test_refuses_bad_steps():
    with pytest.raises(ValueError, match="steps is 0"):
        rolling_steps(
            bound=np.ones(4), element=1.0, material=Material.from_shear(1.0, 0.3), steps=0
        )
    with pytest.raises(TypeError, match=r"steps is 1\.5, but must be an integer"):
        rolling_steps(
            bound=np.ones(4), element=1.0, material=Material.from_shear(1.0, 0.3), steps=1.5
        )


def test_failure_is_an_error_that_says_what_is_violated():
    with pytest.raises(ContactError, match="products Coulomb's law is violated by"):
        circle(32, (0.1, 0.0, 0.0), max_products=2, nested=False)


def test_a_failure_has_the_best_of_what_was_found():
    """The tolerance is within rounding: what comes after that is tried is worse."""
    with pytest.raises(ContactError) as failure:
        circle(24, (0.02, 0.0, 0.0), max_products=200, tolerance=1e-17)
    assert failure.value.result.residual < 1e-12
