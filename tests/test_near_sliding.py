"""Creepages that belong to loads: where nearly all slides, little sticks, and in fields of slip."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.budgets import assert_within_budget
from tests.test_friction import doubtful, semi_ellipse
from tests.test_rolling import NAMES, assert_rolls
from toeplitz_mg.contact import (
    Material,
    frictional_rolling,
    hertz,
    normal_contact,
    rolling,
    surfaces,
)

BODY = Material.from_shear(1.0, 0.25)
STEEL = Material(E=210000.0, nu=0.28)
SOFT = Material(E=400.0, nu=0.3)
FLANGE = ((460.0, np.inf), (np.inf, 20.0))


def ellipse(n, h):
    """The bound of a contact of half width 1 on n x n elements."""
    x, y = surfaces.centres((n, n), h)
    return 3e-3 * semi_ellipse(np.hypot(x, y), 1.0)


@doubtful
@pytest.mark.parametrize("n", [10, 24, 60])
@pytest.mark.parametrize(
    ("creepages", "given"),
    [
        ((0.01, 0.04, -0.05), ("force", "moment")),  # Little sticks.
        ((0.03, 0.02, 0.1), ("force", "moment")),  # Nothing does.
        ((0.02, 0.01, 0.3), ("force",)),  # All slides by the spin, whatever the forces are.
        ((0.05, 0.02, 0.1), ("moment",)),
    ],
)
def test_loads_near_those_of_sliding_take_a_few_products_more_than_creepages(n, creepages, given):
    h = (2.0 / n, 2.0 / n)
    g, case = ellipse(n, h), {"material": BODY}
    known = rolling(bound=g, element=h, **dict(zip(NAMES, creepages, strict=True)), **case)
    assert known.stick_area < 0.02 * known.area
    loads = {name: getattr(known, name) for name in given}
    left = {"force": NAMES[:2], "moment": NAMES[2:]}
    rest = {name for kind in given for name in left[kind]}
    others = {n: c for n, c in zip(NAMES, creepages, strict=True) if n not in rest}
    result = rolling(bound=g, element=h, **loads, **others, **case)
    assert_rolls(result, BODY)
    carried = float(g.sum()) * h[0] * h[1]
    assert_allclose(result.force, known.force, rtol=0.0, atol=1e-7 * carried)
    assert_allclose(result.moment, known.moment, rtol=0.0, atol=1e-7 * carried)
    assert result.products <= 2.5 * known.products


@pytest.mark.parametrize("given", ["both", "longitudinal"])
@pytest.mark.parametrize("angle", [0.2, 0.7, 1.3])
@pytest.mark.parametrize("creepage", [0.004, 0.005])  # Of the elements a third at most sticks.
@pytest.mark.parametrize("n", [80, 140])
def test_a_line_that_nearly_slides_starts_from_a_coarser_one(n, creepage, angle, given):
    h = 2.5 / n
    (x,) = surfaces.centres(n, h)
    g = 3e-3 * semi_ellipse(x, 1.0)
    along, across = creepage * np.cos(angle), creepage * np.sin(angle)
    known = rolling(bound=g, element=h, longitudinal=along, lateral=across, material=BODY)
    assert known.stick_area < 0.35 * known.area
    if given == "both":
        result = rolling(bound=g, element=h, force=tuple(known.force), material=BODY)
    else:
        result = rolling(
            bound=g, element=h, force=(known.force[0], None), lateral=across, material=BODY
        )
    assert_rolls(result, BODY)
    assert_allclose(result.creepages[:2], (along, across), rtol=1e-4)
    assert result.products <= 2.5 * known.products


@pytest.mark.parametrize("n", [43, 80])
def test_an_element_or_two_that_stick_are_found_at_once(n):
    """Tractions of sliding along x alone are those of any creepage, so these say nothing of it."""
    h = 2.5 / n
    (x,) = surfaces.centres(n, h)
    g = 3e-3 * semi_ellipse(x, 1.0)
    known = rolling(bound=g, element=h, longitudinal=0.0042, material=BODY)
    assert 0.0 < known.stick_area < 2.5 * h
    result = rolling(bound=g, element=h, force=known.force, material=BODY)
    assert_rolls(result, BODY)
    assert result.creepages == pytest.approx(known.creepages, rel=1e-6)
    assert result.products <= 2.5 * known.products


@doubtful
@pytest.mark.parametrize(
    ("n", "spin", "given"),
    [(11, 0.02, ("moment",)), (11, 0.05, ("moment",)), (61, 0.3, ("force", "moment"))],
)
def test_slip_that_turns_around_an_element_that_sticks(n, spin, given):
    """No sliding tractions have the loads, as that element turns by any angle: some nearly do."""
    h = (2.2 / n, 2.2 / n)
    g, case = ellipse(n, h), {"material": BODY}
    known = rolling(bound=g, element=h, spin=spin, **case)
    result = rolling(bound=g, element=h, **{name: getattr(known, name) for name in given}, **case)
    assert_rolls(result, BODY)
    assert_allclose(result.traction, known.traction, atol=1e-5 * g.max())
    assert result.products <= 4 * known.products


def flange(n):
    """A wheel's flange on a rail."""
    a, b = hertz(radii=FLANGE, material=STEEL, force=60e3).half_axes
    element = (2.3 * a / n, 2.3 * b / n)
    gap = surfaces.ellipsoid((n, n), element, radii=FLANGE)
    return normal_contact(gap, element, material=STEEL, force=60e3)


@pytest.mark.parametrize("mu", [0.02, 0.05, 0.1])
@pytest.mark.parametrize("share", [(0.0, -0.5), (0.0, 0.5), (0.3, 0.0), (0.0, 0.0), (0.6, -0.6)])
@pytest.mark.parametrize("spin", [2e-3, 4e-3])
def test_spin_with_little_friction(mu, share, spin):
    """By the creepages that are found rolling has the same forces."""
    pressed = flange(16)
    wanted = mu * pressed.force * np.array(share)
    found = rolling(pressed, mu=mu, spin=spin, force=wanted)
    assert_allclose(found.force, wanted, atol=1e-6 * mu * pressed.force)
    longitudinal, lateral, _ = found.creepages
    again = rolling(pressed, mu=mu, longitudinal=longitudinal, lateral=lateral, spin=spin)
    assert_allclose(again.force, wanted, atol=1e-4 * mu * pressed.force)


@pytest.mark.parametrize("power", [1, 2])
@pytest.mark.parametrize("share", [-0.95, 0.0, 0.5])
@pytest.mark.parametrize(
    ("mu", "size"),
    [
        (0.01, 0.05),
        (0.3, 0.001),
        pytest.param(0.01, 0.001, marks=pytest.mark.slow),
        pytest.param(0.3, 0.05, marks=pytest.mark.slow),
    ],
)
def test_a_field_of_slip_far_beyond_what_sticks(mu, share, size, power):
    """A cylinder on a groove slides almost everywhere, one way and the other (Heathcote)."""
    (x,) = surfaces.centres(24, 6.4 / 24)
    pressed = normal_contact(x**2 / 200.0, 6.4 / 24, material=SOFT, approach=0.02)
    wanted = share * mu * pressed.force
    found = rolling(pressed, mu=mu, force=wanted, slip=size * x**power)
    assert_allclose(found.force, wanted, atol=1e-6 * mu * pressed.force)


def test_free_rollers_that_are_as_unlike_as_can_be():
    (x,) = surfaces.centres(32, 0.2)
    bodies = SOFT, Material.rigid()
    for gap, mu in ((0.01 * np.abs(x), 0.05), (x**2 / 200.0, 0.02)):
        force = normal_contact(gap, 0.2, material=bodies, approach=0.025).force
        pressed = {"material": bodies, "mu": mu, "force": force}
        free = frictional_rolling(gap, 0.2, tangential_force=0.0, **pressed)
        assert abs(free.tangential.force) <= 1e-6 * mu * force
        again = frictional_rolling(gap, 0.2, longitudinal=free.tangential.creepages, **pressed)
        assert abs(again.tangential.force) <= 1e-3 * mu * force


@pytest.mark.parametrize("share", [0.001, 0.01, 0.05, 0.5])
def test_a_small_moment_of_a_contact_one_element_wide(share):
    """While all of it sticks it has none: the first creepages, zero too, change nothing."""
    shape, element = (16, 1), (0.04, 0.02)
    x, y = surfaces.centres(shape, element)
    g = 150.0 * np.sqrt(np.maximum(0.0, 1.0 - (x / 0.35) ** 2))
    most = (g * np.hypot(x - 0.02, y)).sum() * 0.04 * 0.02
    found = rolling(bound=g, element=element, material=STEEL, moment=share * most)
    assert_allclose(found.moment, share * most, rtol=1e-5)
    again = rolling(bound=g, element=element, material=STEEL, spin=found.creepages[2])
    assert_allclose(again.moment, share * most, atol=1e-4 * most)


@pytest.mark.parametrize("seed", range(181, 184))
def test_a_bracket_stays_one_whatever_the_search_comes_from(seed):
    """Of the same creepage the load, nearly zero here, is rounded in another way each time."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(20, 60))
    x = (np.arange(n) - (n - 1) / 2) / (n / 2)
    slip = rng.normal(0, 0.06, n)
    g = 1e-3 * np.sqrt(1 - x**2)
    found = rolling(
        bound=g, element=1.0, material=Material.from_shear(1.0, 0.0), force=0.0, slip=slip
    )
    assert abs(found.force) <= 1e-8 * g.sum()


@pytest.mark.filterwarnings("ignore:the contact is only 1 element across")
@pytest.mark.parametrize("angle", np.linspace(0.1, 6.2, 7))
@pytest.mark.parametrize("share", [0.0, 0.3, 0.95, 0.9999])
def test_a_single_element_sticks_whatever_slip_is_given(angle, share):
    """What it carries are the forces, so that it cannot slide."""
    force = 1e-3 * share * np.array([np.cos(angle), np.sin(angle)])
    slip = [[[-1e-2]], [[2e-2]]]
    material = Material.from_shear(1.0, 0.0)
    found = rolling(
        bound=[[1e-3]], element=(1.0, 1.0), material=material, slip=slip, force=force.tolist()
    )
    assert found.stick.all()
    assert_within_budget("one element in any slip", products=found.products)
    assert_allclose(found.force, force, atol=1e-12)
