"""Friction that falls with the slip: its bound belongs to its slip."""

import re

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.budgets import assert_within_budget
from tests.systems import refuses
from tests.test_friction import doubtful
from tests.test_rolling import assert_rolls, carter, circle
from toeplitz_mg.contact import (
    ContactError,
    ContactWarning,
    Material,
    normal_contact,
    rolling,
    surfaces,
)
from toeplitz_mg.halfspace import influence_matrix

MATERIAL = Material.from_shear(1.0, 0.25)
STIFFNESS = 1.38  # Of an element of `circle`, square and ν = 1/4, over G.


def assert_bound(result, g, falling, material=MATERIAL):
    """The bound is that of the slip, and the rest is rolling with this bound."""
    bound = g * falling(np.hypot(*result.slip))
    assert_allclose(result.bound, bound, atol=1e-7 * max(g.max(), bound.max()))
    assert_rolls(result, material)


@pytest.mark.parametrize(("fall", "rise"), [(0.2, None), (0.4, None), (None, 0.5), (None, 2.0)])
def test_the_bound_is_that_of_the_slip(fall, rise):
    """Up to friction that falls nearly as fast as bodies resist, or rises faster."""
    g, constant = circle(24, (0.1, 0.0, 0.1))
    slope = (rise or 0.0) * STIFFNESS / g.max()
    falling = steep(fall) if rise is None else lambda s: 1.0 + slope * s
    _, result = circle(24, (0.1, 0.0, 0.1), falling=falling)
    assert_bound(result, g, falling)
    assert result.warnings == ()
    assert (abs(result.force[0]) < abs(constant.force[0])) == (rise is None)
    assert ((result.bound < g)[result.sliding]).all() == (rise is None)


def test_friction_that_does_not_depend_on_the_slip_is_a_factor():
    g, expected = circle(16, (0.1, 0.05, 0.0))
    _, result = circle(16, (0.1, 0.05, 0.0), falling=lambda s: np.ones_like(s))
    assert_allclose(result.traction, expected.traction, atol=1e-7 * g.max())


def test_large_creepage_has_the_friction_of_its_slip():
    g, result = circle(16, (30.0, 40.0, 0.0), falling=lambda s: 1 / (1 + s))
    total = g.sum() * result.element[0] ** 2
    assert_allclose(np.linalg.norm(result.force), total / 51, rtol=0.01)


def steep(fall, least=0.5):
    """Friction that falls from 1 to `least`, at first by `fall` of the stiffness of an element."""
    g, _ = circle(24, (1.0, 0.0, 0.0))
    scale = (1.0 - least) * g.max() / (fall * STIFFNESS)
    return lambda s: least + (1.0 - least) * np.exp(-s / scale)


def test_friction_that_falls_by_more_than_bodies_resist_is_found_and_doubted():
    """They resist least on the wavelength on which a change of tractions slips most."""
    shape, element = (24, 24), (2.0 / 24,) * 2
    with pytest.warns(ContactWarning, match="there may be other answers") as told:
        g, result = circle(24, (0.1, 0.0, 0.1), falling=steep(20.0))
    assert_bound(result, g, steep(20.0))
    resists = float(re.search(r"as little as (\S+) N", str(told[-1].message))[1])
    A, S = (influence_matrix("xy", shape, element, MATERIAL, ahead=k) for k in (0, 1))
    largest = np.linalg.eigvalsh((A - S + (A - S).T).toarray())[-1] / 2.0
    assert 0.95 * element[0] / largest < resists < element[0] / largest


@doubtful
@pytest.mark.slow
@pytest.mark.parametrize("steepness", [2.0, 5.0])
def test_friction_that_falls_steeply_settles_on_fine_grids(steepness):
    g, _ = circle(64, (1.0, 0.0, 0.0))
    scale = 0.5 * g.max() / (steepness * STIFFNESS)

    def falling(s):
        return 0.5 + 0.5 / (1.0 + s / scale)

    _, result = circle(64, (0.1, 0.0, 0.1), falling=falling)
    assert_bound(result, g, falling)


@doubtful
def test_an_element_slides_slowly_or_fast_where_friction_falls_steeper_than_it_is_stiff():
    g, case = np.ones((1, 1)), {"element": (1.0, 1.0), "material": MATERIAL}

    def falling(s):
        return np.clip(1.75 - 2.5 * STIFFNESS * s, 0.5, 1.0)

    for factor, slip in ((1.0, 0.25), (0.5, 0.75)):
        result = rolling(bound=factor * g, lateral=1.25 / STIFFNESS, **case)
        assert_allclose(np.hypot(*result.slip), slip / STIFFNESS, rtol=0.01)
        assert_allclose(falling(np.hypot(*result.slip)), factor)  # Each is an answer.


@doubtful
@pytest.mark.parametrize("n", [128, 512])
def test_friction_that_falls_from_a_higher_bound_has_the_same_tractions(n):
    """Those of Carter, where the bound at rest is higher by what it falls in their slip."""

    def falling(s):
        return 0.6 + 0.4 / (1.0 + s / 0.05)

    _, g, known = carter(n)
    at_rest = g / falling(np.abs(known.slip))
    case = {"material": Material.from_shear(0.7, 0.3), "longitudinal": known.creepages}
    result = rolling(bound=at_rest, element=known.element, falling=falling, **case)
    assert_allclose(result.traction, known.traction, atol=1e-6 * g.max())


def test_no_friction_at_all_where_it_slips_fast():
    with pytest.warns(ContactWarning, match="there may be other answers"):
        _, result = circle(24, (0.1, 0.0, 0.1), falling=lambda s: np.clip(1.0 - s / 1e-3, 0, 1))
    slip = np.hypot(*result.slip)
    assert_allclose(result.bound[slip > 1e-3], 0.0, atol=1e-9)


def test_says_how_steep_friction_is_where_it_does_not_settle():
    """An element slips slowly by much friction and fast by little, which are those of the other."""
    case = {"material": MATERIAL, "lateral": 1.25 / STIFFNESS}
    case["falling"] = lambda s: np.where(s < 0.5 / STIFFNESS, 0.5, 1.0)
    with pytest.raises(ContactError, match=r"after .* jumps: it rises by up to") as caught:
        rolling(bound=np.ones((1, 1)), element=(1.0, 1.0), **case)
    assert caught.value.result.residual > 1e-8


@pytest.mark.parametrize("k", [1e-2, 1e-5])
def test_friction_that_rises_has_one_answer_however_steeply(k):
    g, result = circle(32, (0.1, 0.0, 0.1), falling=lambda s: 1.0 + s / k)
    assert_rolls(result, MATERIAL)
    slides = result.sliding
    slip = k * (result.bound[slides] / g[slides] - 1.0)
    assert_allclose(np.hypot(*result.slip)[slides], slip, atol=1e-7)
    assert_within_budget(f"rising friction {k:g}", products=result.products)


@pytest.mark.parametrize(
    ("falling", "error", "message"),
    [
        (0.5, TypeError, "falling is 0.5, but must be a function"),
        ((0.3, 0.2), ValueError, r"falling has shape \(2,\)"),
        ((0.0, 0.2, 0.1), ValueError, "mu_s of falling is 0.0, but must be positive"),
        ((0.3, -0.2, 0.1), ValueError, "mu_k of falling is -0.2, but must be at least zero"),
        ((0.3, 0.2, 0.0), ValueError, "s0 of falling is 0.0, but must be positive"),
        (lambda s: -np.ones_like(s), ValueError, "falling has returned -1 to -1"),
        (lambda s: np.ones(3), ValueError, r"falling has returned the shape \(3,\)"),
    ],
)
def test_refuses_what_is_no_friction(falling, error, message):
    case = {"element": (1.0, 1.0), "material": MATERIAL, "falling": falling}
    refuses(error, message, rolling, bound=np.ones((4, 4)), **case)


@doubtful
def test_three_numbers_are_the_function():
    """μ_k + (μ_s - μ_k) exp(-s/s₀): of pressures, with `mu` or without, and of a bound μ_s p."""
    mu_s, mu_k, s0 = law = (0.4, 0.3, 0.02)
    case = {"element": (0.2, 0.2), "material": MATERIAL}
    pressed = normal_contact(surfaces.sphere((16, 16), (0.2, 0.2), radius=5.0), **case, force=0.3)
    by = {"falling": lambda s: (mu_k + (mu_s - mu_k) * np.exp(-s / s0)) / mu_s}
    known = rolling(pressed, mu=mu_s, longitudinal=0.05, **by)
    bound = {"bound": mu_s * pressed.pressure} | case
    for given in ({"pressed": pressed}, {"pressed": pressed, "mu": mu_s}, bound):
        found = rolling(**given, falling=law, longitudinal=0.05)
        assert_allclose(found.traction, known.traction, atol=1e-12)
    refuses(ValueError, "mu is 0.3, but falling has mu_s", rolling, pressed, mu=0.3, falling=law)


def oil(s):
    """Friction that is none without slip."""
    return s / (s + 0.1)


def rising(s):
    """Friction that is more the more it slips."""
    return 1.0 + 2.0 * s


@pytest.mark.parametrize(
    ("falling", "creepages", "given"),
    [
        (oil, (0.1, 0.0, 0.0), ("x",)),
        (oil, (-0.05, 0.1, 0.0), ("x",)),
        (oil, (0.1, -0.05, 0.0), ("x", "y")),
        (oil, (0.0, 0.0, 0.2), ("moment",)),
        (rising, (0.5, 0.0, 0.0), ("x",)),
    ],
)
def test_loads_that_friction_without_slip_does_not_carry_have_their_creepages(
    falling, creepages, given
):
    g, expected = circle(16, creepages, falling=falling)
    (fx, fy), moment = expected.force, expected.moment
    loads = {"force": (fx if "x" in given else None, fy if "y" in given else None)}
    loads |= {"moment": moment} if "moment" in given else {}
    left = [c * (k not in given) for k, c in zip(("x", "y", "moment"), creepages, strict=True)]
    _, found = circle(16, left, falling=falling, **loads)
    scale = max(abs(fx), abs(fy), abs(moment))
    assert_allclose(found.creepages, creepages, atol=1e-5)
    assert_allclose(found.force, expected.force, atol=1e-5 * scale)
    assert_bound(found, g, falling)


def test_loads_that_friction_of_no_slip_carries_are_refused():
    g, _ = circle(16, (0.0, 0.0, 0.0))
    most = g.sum() * (2.0 / 16) ** 2
    loads, slips = {"falling": oil, "force": (1.01 * most, None)}, (0.0, 0.0, 0.0)
    refuses(ValueError, "the most that friction at any slip carries", circle, 16, slips, **loads)
    _, sliding = circle(16, (1e3, 0.0, 0.0))
    _, spinning = circle(16, (0.0, 0.0, 1e3))
    loads |= {"force": (0.9 * sliding.force[0], None), "moment": 0.9 * spinning.moment}
    message = r"the loads together are 1\.\d+ times what friction at any slip carries"
    refuses(ValueError, message, circle, 16, slips, **loads)
    # Between friction that elements slide slowly by, and hardly any, where they slide fast.
    case = {"falling": lambda s: np.maximum(0.0, 1.0 - s / 0.07), "max_products": 200}
    refuses(ContactError, "friction falls too steeply", circle, 24, (0.1, 0.0, 0.1), **case)


@pytest.mark.parametrize("across", [None, 0.0])
@doubtful
def test_loads_that_friction_falls_too_soon_to_carry_are_refused(across):
    """It would carry them without any slip."""
    given = {"falling": lambda s: 0.5 + 0.5 / (1.0 + s / 0.002), "max_products": 150}
    g, _ = circle(12, (0.0, 0.0, 0.0))
    most = g.sum() * (2.0 / 12) ** 2
    message = r"a load is missed by.* the nearest found|friction falls too steeply"
    given["force"] = (-0.9 * most, across)
    refuses(ContactError, message, circle, 12, (0.0, 0.0, 0.0), **given)


def test_too_few_products_are_an_error_wherever_they_end():
    """In a round, or between two: then the tractions are right, for a bound of another slip."""
    _, found = circle(24, (0.1, 0.0, 0.1), falling=steep(0.4))
    for most in range(2, found.products - 2):
        told = []
        case = {"progress": lambda products, _, told=told: told.append(products)}
        with pytest.raises(ContactError, match=r"after .* products") as caught:
            circle(24, (0.1, 0.0, 0.1), falling=steep(0.4), max_products=most, **case)
        assert caught.value.result.residual > 1e-8
        assert caught.value.result.products <= most + 1
        assert max(told) <= most
        assert (np.diff(told) >= 0).all()


@pytest.mark.parametrize("given", [("x",), ("x", "y")])
def test_too_few_products_for_loads_are_an_error_wherever_they_end(given):
    _, expected = circle(16, (0.1, -0.05, 0.0), falling=oil)
    force = tuple(expected.force) if "y" in given else (expected.force[0], None)
    lateral = 0.0 if "y" in given else -0.05
    _, found = circle(16, (0.0, lateral, 0.0), falling=oil, force=force)
    for most in range(4, min(found.products, 40) - 2, 2):
        with pytest.raises(ContactError) as caught:
            circle(16, (0.0, lateral, 0.0), falling=oil, force=force, max_products=most)
        assert caught.value.result.products <= most + 1


@pytest.mark.parametrize("unit", [1e-9, 1e9])
def test_the_bound_is_that_of_the_slip_in_any_unit(unit):
    case = {"longitudinal": 0.1, "spin": 0.1, "falling": steep(0.4)}
    g, one = circle(24, (0.1, 0.0, 0.1), falling=steep(0.4))
    material = Material.from_shear(unit, 0.25)
    result = rolling(bound=unit * g, element=one.element, material=material, **case)
    assert_allclose(result.traction, unit * one.traction, atol=1e-6 * unit * g.max())
    assert_bound(result, unit * g, steep(0.4), material)


def test_friction_falls_beside_what_is_bonded():
    g, _ = circle(24, (0.1, 0.0, 0.0))
    bonded = (g > 0.0) & (np.arange(24)[:, np.newaxis] < 10)
    g[bonded] = np.inf
    case = {"material": MATERIAL, "longitudinal": 0.5}
    result = rolling(bound=g, element=(2.0 / 24,) * 2, falling=steep(0.4), **case)
    slides = result.sliding
    assert slides.any()
    assert not slides[bonded].any()
    assert np.isinf(result.bound[bonded]).all()
    slip = np.hypot(*result.slip)[~bonded]
    assert_allclose(result.bound[~bonded], g[~bonded] * steep(0.4)(slip), atol=1e-7)


def test_says_how_near_loads_are_that_no_creepage_has():
    """Friction has its peak at one slip, which the elements do not all have at once."""
    g, _ = circle(16, (0.0, 0.0, 0.0))
    most = g.sum() * (2.0 / 16) ** 2
    case = {"falling": lambda s: 1.0 / (1.0 + ((s - 0.1) / 0.06) ** 2)}
    message = r"the force along x must be .* the nearest found is"
    with pytest.raises(ContactError, match=message) as caught:
        circle(16, (0.0, 0.0, 0.0), force=(0.99 * most, None), **case)
    assert caught.value.result.force[0] < 0.98 * most


def test_friction_may_fall_until_it_underflows():
    """Steeply, so that there may be other answers."""
    with pytest.warns(ContactWarning, match="other answers"):
        _, result = circle(16, (0.3, 0.0, 0.0), falling=lambda s: np.exp(-((s / 0.01) ** 2)))
    sizes = np.hypot(*result.slip)[result.contact]
    assert np.exp(-((sizes / 0.01) ** 2)).min() < 1e-40
    assert_rolls(result, MATERIAL)
