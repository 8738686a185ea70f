"""Unlike materials in rolling: creepage without a tangential force, against theory."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from tests.test_friction import doubtful
from toeplitz_mg import halfspace
from toeplitz_mg.contact import (
    ContactError,
    Material,
    frictional_rolling,
    normal_contact,
    rolling,
    surfaces,
)

ALUMINIUM, STEEL = Material.from_shear(23000.0, 0.31), Material.from_shear(82000.0, 0.28)
ROLLERS = ALUMINIUM, STEEL
COMBINED = halfspace.combined_material(*ROLLERS)
BETA = COMBINED.difference / (1.0 - COMBINED.nu)  # Dundurs' parameter.
R = 25.0  # mm


def rollers(n=128, **arguments):
    """Two rollers in plane strain, half a width of contact of some 0.1 mm."""
    h = 0.256 / n
    gap = surfaces.cylinder(n, h, radius=R)
    given = {"material": ROLLERS, "mu": 0.05, "force": 16.2019, "tangential_force": 0.0}
    return gap, h, frictional_rolling(gap, h, **given | arguments)


def test_without_slip_it_is_the_exact_creepage():
    """Bufler, 1959; the error is of some elements, as the edge of the contact is."""
    for n in (64, 128, 512):
        _, _, result = rollers(n, mu=np.inf)
        # p + i q = k X, with γ = ln((1+β)/(1-β))/(2π) and the force π k a² (1+4γ²)/2.
        gamma = np.log((1 + BETA) / (1 - BETA)) / (2 * np.pi)
        k = COMBINED.E_star / (2 * R)
        a = np.sqrt(2 * 16.2019 / (np.pi * k * (1 + 4 * gamma**2)))
        assert_allclose(result.normal.area, 2 * a, atol=2 * 0.256 / n)
        assert result.tangential.stick.sum() == result.normal.contact.sum()
        error = 1.0 + result.tangential.creepages / (2 * gamma * a / R)
        assert abs(error) < 3 * (0.256 / n) / a


def test_the_less_friction_the_more_creepage():
    """From 2/π to 0.915 of β a/R (Bentall and Johnson, 1967), where β is small and h smaller."""
    creepages = []
    for ratio in (0.1, 1.0, 2.0, 4.0, 8.0, 16.0):
        _, _, result = rollers(mu=BETA / ratio)
        a = result.normal.area / 2
        creepages.append(-result.tangential.creepages * R / (BETA * a))
    assert (np.diff(creepages) > 0.0).all()
    assert 0.58 < creepages[0] < 2 / np.pi
    assert 0.86 < creepages[-1] < 0.915


def test_full_slip_has_the_creepage_of_a_balance():
    """All slides where the strain by Hertz's pressures is another: 0.9148 β a/R halves the force.

    The creepage is given, as the last element that sticks is hard to find by the force.
    """
    c = 0.9148 * BETA * 0.1 / R
    mu = 1e-4
    _, _, result = rollers(256, mu=mu, tangential_force=None, longitudinal=-c)
    assert abs(result.tangential.force) < 0.05 * mu * 16.2019
    assert result.tangential.stick.sum() <= 2


def test_conditions_hold_with_all_displacements():
    """They are computed anew, from the matrices here and one element ahead."""
    n, h, b = 96, 0.0027, 1000.0
    gap = surfaces.cylinder(n, (h, b), radius=R)
    result = frictional_rolling(
        gap, (h, b), material=ROLLERS, mu=0.05, force=16201.9, tangential_force=100.0
    )
    normal, tangential = result.normal, result.tangential
    A = halfspace.influence_matrix("xz", (n,), (h, b), ROLLERS)
    S = halfspace.influence_matrix("xz", (n,), (h, b), ROLLERS, ahead=1)
    t = np.stack([tangential.traction, normal.pressure])
    u, ahead = ((M @ t.ravel()).reshape(t.shape) for M in (A, S))
    w = gap + u[1] - normal.approach
    interference = normal.approach - gap.min()
    assert np.abs(w[normal.contact]).max() <= 1.01e-6 * interference
    assert w.min() >= -1.01e-6 * interference
    contact = tangential.contact
    assert_array_equal(tangential.bound, 0.05 * normal.pressure)
    assert (np.abs(tangential.traction) <= tangential.bound).all()
    slip = tangential.creepages + (u[0] - ahead[0]) / h
    assert_allclose(tangential.slip, np.where(contact, slip, 0.0), rtol=0, atol=1e-10)
    scale = 1e-8 * abs(tangential.creepages)
    assert np.abs(slip[tangential.stick]).max() <= 1e2 * scale
    assert (slip * tangential.traction)[tangential.sliding].max() <= 0.0
    assert_allclose(tangential.displacement, np.where(contact, u[0], 0.0), rtol=0, atol=1e-10)
    assert_allclose(tangential.force, 100.0, rtol=1e-6)


def test_like_rollers_are_two_problems_exactly():
    gap, h, both = rollers(material=STEEL, tangential_force=None, longitudinal=1e-4)
    normal = normal_contact(gap, h, material=STEEL, force=16.2019, tolerance=1e-8)
    assert_array_equal(both.normal.pressure, normal.pressure)
    alone = rolling(
        bound=0.05 * normal.pressure, element=h, material=STEEL, longitudinal=1e-4, tolerance=1e-8
    )
    assert_array_equal(both.tangential.traction, alone.traction)
    _, _, free = rollers(material=STEEL)
    assert_allclose(free.tangential.creepages, 0.0, atol=1e-15)
    assert_allclose(free.tangential.traction, 0.0, atol=1e-12)


def test_rollers_that_change_places_creep_the_other_way():
    _, _, one = rollers()
    _, _, two = rollers(material=ROLLERS[::-1])
    assert_allclose(two.tangential.creepages, -one.tangential.creepages, rtol=1e-6)
    assert_allclose(two.normal.pressure, one.normal.pressure, rtol=1e-5)


def test_a_ball_creeps_too_and_a_slip_that_is_given_adds():
    element = (0.1, 0.1)
    gap = surfaces.sphere((24, 24), element, radius=10.0)
    bodies = Material.from_shear(0.5, 0.0), Material.rigid()
    case = {"material": bodies, "mu": 0.3, "force": 0.05, "tolerance": 1e-8}
    free = frictional_rolling(gap, element, tangential_force=(0.0, 0.0), **case)
    assert free.tangential.creepages[0] < -1e-3
    assert_allclose(free.tangential.creepages[1], 0.0, atol=1e-9)
    assert_allclose(free.tangential.force, 0.0, atol=1e-8)
    field = np.zeros((2, 24, 24))
    field[0] = free.tangential.creepages[0]
    same = frictional_rolling(gap, element, slip=field, **case)
    assert_allclose(same.tangential.traction, free.tangential.traction, atol=1e-6)


@pytest.mark.parametrize(
    ("change", "error", "match"),
    [
        ({"longitudinal": 1e-3}, ValueError, "only one of the two can be given"),
        ({"tangential_force": 1.0}, ValueError, "force is of size 1, but must be less"),
        ({"spin": 1.0}, ValueError, "line contact has longitudinal and lateral creepage only"),
        ({"max_iterations": 1}, ContactError, "after 1 iterations between pressures and friction"),
    ],
)
def test_refuses_bad_arguments_and_says_where_it_does_not_converge(change, error, match):
    with pytest.raises(error, match=match):
        rollers(**change)


@doubtful
def test_loads_are_refused_for_the_pressures_that_friction_leaves():
    """Friction draws pressures to where it is high: more is carried than by those without it."""
    element, bodies = (0.1, 0.1), (Material(E=1000.0, nu=0.0), Material.rigid())
    gap = surfaces.sphere((32, 32), element, radius=20.0)
    mu = np.where(surfaces.centres((32, 32), element)[0] + 0.0 * gap > 0.0, 0.8, 0.1)
    pressed = {"material": bodies, "mu": mu, "force": 3.0}
    pressures = normal_contact(gap, element, material=bodies, force=3.0).pressure
    without = float((mu * pressures).sum()) * 0.01
    sliding = frictional_rolling(gap, element, **pressed, longitudinal=0.1).tangential.force[0]
    assert abs(sliding) > 1.1 * without
    force = np.array([0.5 * (sliding - without), 0.0])  # Between the two.
    rolled = frictional_rolling(gap, element, **pressed, tangential_force=force)
    assert_allclose(rolled.tangential.force, force, atol=1e-6)
    # All along, as the limit of the pressures that are found, and before any work.
    for factor, match in ((1.05, "the most that friction carries"), (2.0, "less than 2.4,")):
        with pytest.raises(ValueError, match=match):
            frictional_rolling(gap, element, **pressed, tangential_force=(factor * sliding, 0.0))
