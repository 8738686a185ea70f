"""What CONTACT, Kalker's and Vollebregt's program, prints for its examples, to the last digit.

E. A. H. Vollebregt, User guide for CONTACT; the printed numbers are those of its open version.
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.budgets import assert_within_budget
from toeplitz_mg import contact

pytestmark = pytest.mark.filterwarnings("ignore::toeplitz_mg.contact.ContactWarning")


def assert_printed(**numbers):
    """Assert that each number is what is printed, to one of the last digit."""
    for name, (value, printed) in numbers.items():
        mantissa, _, exponent = printed.partition("e")
        digits = len(mantissa.partition(".")[2])
        last = 10.0 ** (int(exponent or 0) - digits)
        assert abs(value - float(printed)) <= last, f"{name} is {value}, and printed {printed}"


def centres(first, h, n):
    return first + h * (np.arange(n) + 0.5)


def test_cattaneo():
    """A sphere is shifted by 7/8 of what friction carries."""
    mu, force, h = 0.4, 9.1954, 0.13333
    x = centres(-1.26667, h, 19)
    steel = contact.Material.from_shear(200.0, 0.42)
    pressed = contact.normal_contact(
        0.01 * (x[:, None] ** 2 + x**2), (h, h), material=steel, force=force
    )
    assert pressed.contact.sum() == 177
    assert_printed(
        approach=(pressed.approach, "1.998e-2"), pressure=(pressed.max_pressure, "4.393")
    )
    shifted = contact.friction(pressed, mu=mu, force=(-0.875 * mu * force, 0.0))
    assert (shifted.stick.sum(), shifted.sliding.sum()) == (45, 132)
    assert_printed(
        shift=(-shifted.shift[0], "8.155e-3"),  # The sign is the other one.
        work=(1e-3 * shifted.power, "2.750e-6"),
    )
    assert_printed(traction=(shifted.magnitude[2, 7], "0.361"))


def test_carter2d():
    """A cylinder rolls, of which the strips are 200 mm long."""
    x = centres(-1.07, 0.04, 55)
    steel = contact.Material.from_shear(82000.0, 0.28)
    pressed = contact.normal_contact(1e-3 * x**2, (0.04, 200.0), material=steel, force=35780.0)
    assert pressed.contact.sum() == 50
    assert_printed(
        approach=(pressed.approach, "6.492e-3"), pressure=(pressed.max_pressure, "113.9")
    )
    rolled = contact.rolling(pressed, mu=0.3, longitudinal=-2.4e-4)
    assert rolled.stick.sum() == 30
    lost = 30.0 * 0.04 * 200.0 * rolled.dissipation.sum()  # At 30 m/s.
    assert_printed(Fx=(rolled.force, "6955."), power=(lost, "47.62"))


@pytest.mark.parametrize(
    ("mu", "share", "creepage", "touch", "stick", "power"),
    [
        (10.0, 0.0, "3.591e-4", 200, 200, None),
        (0.05, 0.0, "4.294e-4", 200, 125, "9.475e-3"),
        (0.05, 0.75, "2.108e-4", 200, 36, "0.1955"),
        (0.05, -0.75, "5.392e-4", 201, 106, "0.04418"),
    ],
)
def test_bentall(mu, share, creepage, touch, stick, power):
    """Rollers of unlike materials, by a part of the force that friction carries.

    They roll the other way (CHI = 180°), so that creepages have the other sign.
    """
    x = centres(-0.108, 0.001, 216)
    bodies = contact.Material.from_shear(23000.0, 0.31), contact.Material.from_shear(82000.0, 0.28)
    force = 16201.9
    case = {"material": bodies, "mu": mu, "force": force, "tangential_force": -share * mu * force}
    result = contact.frictional_rolling(0.02 * x**2, (0.001, 1000.0), **case)
    rolled = result.tangential
    assert (result.normal.contact.sum(), rolled.stick.sum()) == (touch, stick)
    assert_printed(creepage=(-rolled.creepages, creepage))
    assert_allclose(rolled.force, -share * mu * force, atol=1e-6 * mu * force)
    assert_within_budget("rollers of unlike materials", iterations=len(result.residuals))
    if power:
        dissipated = 0.001 * 1000.0 * rolled.dissipation.sum()  # At 1 m/s.
        assert_printed(power=(dissipated, power))


def test_fastsim():
    """An ellipse rolls with spin, which CONTACT takes a sixth of an element ahead."""
    mu, force, element = 0.3, 82000.0, (0.4, 0.2)
    x, y = centres(-8.8, 0.4, 44), centres(-4.4, 0.2, 44)
    gap = 0.8464e-3 * x[:, None] ** 2 + 0.2406e-2 * y**2
    steel = contact.Material.from_shear(82000.0, 0.28)
    pressed = contact.normal_contact(gap, element, material=steel, force=force)
    pole = (-element[0] / 6.0, 0.0)
    rolled = contact.rolling(pressed, mu=mu, lateral=-6.25e-4, spin=6.25e-4, pole=pole)
    assert rolled.stick.sum() == 356
    qx, qy = rolled.traction
    moment = 0.08 * (x[:, None] * qy - y * qx).sum()
    assert_printed(
        Fy=(rolled.force[1] / (mu * force), "-0.6074"),
        Mz=(moment, "-4.821e4"),
        power=(30.0 * 0.08 * rolled.dissipation.sum(), "540.4"),
    )
    # The moment is about the pole, with an arm that is half an element less.
    about = moment - (pole[0] + element[0] / 2.0) * rolled.force[1]
    assert rolled.moment == pytest.approx(about, rel=1e-9)


def test_catt_to_cart():
    """A sphere that a force shifts begins to roll: the power is what slip dissipates."""
    soft, h, mu, force = contact.Material.from_shear(1.0, 0.28), 0.25, 0.4013, 0.4705
    x, y = centres(-4.125, h, 34), centres(-4.125, h, 33)
    pressed = contact.normal_contact(
        0.002963 * (x[:, None] ** 2 + y**2), (h, h), material=soft, force=force
    )
    load = -0.657 * mu * force
    shifted = contact.friction(pressed, mu=mu, force=(load, 0.0))
    assert (pressed.contact.sum(), shifted.stick.sum()) == (621, 305)
    assert_printed(shift=(-shifted.shift[0], "1.774e-2"))
    steps = contact.rolling_steps(
        pressed, mu=mu, force=(load, None), lateral=0.0, steps=56, previous=shifted
    )
    printed = {
        1: ("1.824e-3", 422, "1.188e-4"),
        7: ("2.334e-3", 390, None),
        56: ("3.101e-3", 346, "3.459e-4"),
    }
    for k, step in enumerate(steps, 1):
        assert step.power == pytest.approx(h**2 * step.dissipation.sum(), rel=1e-9)
        if k in printed:
            creepage, stick, power = printed[k]
            assert step.stick.sum() == stick
            assert_printed(creepage=(step.creepages[0], creepage))
            assert_printed(power=(step.power, power or f"{step.power:.3e}"))
