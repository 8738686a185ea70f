"""Friction remembers: cycles of the tangential force, and bounds that change, against theory.

Mindlin and Deresiewicz (1953), and Jäger's superposition: under monotonic loads the tractions of a
sphere, with ν = 0, are μ p(a) - μ p(c), where p(a) are the pressures of a contact of radius a and
c is the radius at which the sphere carries P - Q/μ. What turns back starts from there.
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from toeplitz_mg.contact import Material, friction, load_curve, normal_contact, surfaces

N, H, MU = 64, 2.0 / 64, 0.3
BODY = Material.from_shear(1.0, 0.0)  # E* = 1 of two equal bodies.
ELEMENT = (H, H)
GAP = surfaces.sphere((N, N), ELEMENT, radius=1.0)
R = np.hypot(*surfaces.centres((N, N), ELEMENT))


def pressures(load):
    """Hertz's pressures of a sphere of radius 1."""
    a = (0.75 * load) ** (1 / 3)
    return 2.0 * a / np.pi * np.sqrt(np.maximum(0.0, 1.0 - (R / a) ** 2)) if load else 0.0 * R


def shift_of(load, force):
    """Mindlin's shift of two spheres, as the difference of two approaches: a² - c² times μ."""
    return MU * ((0.75 * load) ** (2 / 3) - (0.75 * (load - force / MU)) ** (2 / 3))


def press(load):
    return normal_contact(GAP, ELEMENT, material=BODY, force=load)


def drag(pressed, force, previous=None):
    return friction(pressed, mu=MU, force=(force, 0.0), previous=previous)


def error(result, theory):
    return np.linalg.norm(result.traction[0] - theory) / np.linalg.norm(theory)


def test_the_loop_of_mindlin_and_deresiewicz():
    load = 0.288
    pressed, most = press(load), 0.6 * MU * load
    # Up, down past zero, and up again: each turn is a step of twice the friction on what was.
    path = [0.5, 1.0, 0.4, -0.4, -1.0, -0.4, 0.4, 1.0]
    top = shift_of(load, most)
    expected = [shift_of(load, 0.5 * most), top]
    expected += [top - 2.0 * shift_of(load, 0.5 * (1.0 - q) * most) for q in path[2:5]]
    expected += [2.0 * shift_of(load, 0.5 * (q + 1.0) * most) - top for q in path[5:]]
    shifts, now = [], None
    for part in path:
        now = drag(pressed, part * most, now)
        shifts.append(now.total_shift[0])
    # 0.3 % is the error of the grid: that of a single step is the same.
    assert_allclose(shifts, expected, atol=3e-3 * top)
    # The loop is closed, and symmetric, beyond that: by the tolerance of the solutions.
    assert_allclose(shifts[-1], shifts[1], rtol=1e-6)
    assert_allclose(shifts[4], -shifts[1], rtol=1e-6)
    assert_allclose(shifts[5:7], np.negative(shifts[2:4]), rtol=1e-6)


def test_more_pressure_moves_nothing():
    first = drag(press(0.15), 0.5 * MU * 0.15)
    held = drag(press(0.288), 0.5 * MU * 0.15, first)
    assert_allclose(held.traction, first.traction, atol=1e-7 * first.magnitude.max())
    assert_allclose(held.shift, 0.0, atol=1e-7 * first.shift[0])
    assert np.array_equal(held.stick, held.contact)


@pytest.mark.parametrize("is_overtaken", [True, False])
def test_a_force_after_more_pressure(is_overtaken):
    P1, P2 = 0.15, 0.288
    Q1 = 0.5 * MU * P1
    Q2 = Q1 + MU * (P2 - P1) * (1.3 if is_overtaken else 0.5)
    pressed = press(P2)
    now = drag(pressed, Q2, drag(press(P1), Q1))
    at_once = drag(pressed, Q2)
    # Slip comes to where it was before only if the force has grown by more than μ times the load:
    # from then on the way there is forgotten.
    if is_overtaken:
        assert_allclose(now.traction, at_once.traction, atol=0.02 * pressed.max_pressure * MU)
        assert_allclose(now.total_shift, at_once.total_shift, rtol=3e-3, atol=1e-9)
    else:
        c1 = P1 - Q1 / MU
        ring = P2 - (Q2 - Q1) / MU  # Where the increment sticks.
        theory = pressures(P2) - pressures(ring) + pressures(P1) - pressures(c1)
        assert error(now, MU * theory) < 0.05
        assert np.abs(now.traction - at_once.traction).max() > 0.05 * MU * pressed.max_pressure


def test_loads_in_proportion_stick():
    # Both grow together, below friction: nothing slips, and the tractions are as the pressures.
    # What a step takes in at once has been in contact for a part of it only: an error of the step.
    part, errors = 0.5, []
    for steps in (3, 6, 12):
        now = None
        for pressed in load_curve(
            GAP, ELEMENT, material=BODY, forces=np.linspace(0.0, 0.288, steps + 1)[1:]
        ):
            now = drag(pressed, part * MU * pressed.force, now)
        errors.append(error(now, part * MU * pressures(0.288)))
    assert errors[1] < 0.7 * errors[0]
    assert errors[2] < 0.7 * errors[1]


def test_a_contact_that_is_unloaded_has_no_tractions_left():
    now = None
    for pressed in load_curve(
        GAP, ELEMENT, material=BODY, forces=[0.1, 0.288, 0.1, 0.0, 0.1], tolerance=1e-8
    ):
        force = 0.3 * MU * pressed.force
        now = friction(pressed, mu=MU, force=(force, 0.0), previous=now)
        assert (now.magnitude <= MU * pressed.pressure).all()
        assert_allclose(now.force, (force, 0.0), atol=1e-9)
        if not pressed.force:
            assert not now.traction.any()
    fresh = drag(press(0.1), 0.3 * MU * 0.1)
    assert_allclose(now.traction, fresh.traction, atol=1e-5 * MU)
