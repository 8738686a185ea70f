"""Curves of forces over creepages: the points of `rolling`."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.systems import cells_of, refuses
from tests.test_friction import semi_ellipse
from tests.test_rolling import MU, A, circle
from toeplitz_mg.contact import Material, creep_curve, normal_contact, rolling, surfaces

BODY = Material.from_shear(0.7, 0.3)


def test_points_of_a_curve_are_those_alone():
    g, alone = circle(24, (0.05, 0.02, 0.1))
    case = {"material": Material.from_shear(1.0, 0.25), "lateral": 0.02, "spin": 0.1}
    curve = creep_curve(bound=g, element=alone.element, longitudinal=[0.01, 0.05, 0.2], **case)
    assert_allclose(curve.creepages, [[0.01, 0.02, 0.1], [0.05, 0.02, 0.1], [0.2, 0.02, 0.1]])
    assert_allclose(curve.force[1], alone.force, atol=1e-6 * np.linalg.norm(alone.force))
    assert_allclose(curve.moment[1], alone.moment, atol=1e-6)
    assert curve.products.shape == curve.power.shape == (3,)
    guessed = creep_curve(bound=g, element=alone.element, longitudinal=[0.05], guess=alone, **case)
    assert guessed.products[0] < alone.products
    assert_allclose(guessed.force[0], alone.force, rtol=1e-6)


def test_points_on_fine_lines_take_as_many_products_as_alone():
    h = 2 * A / 2000
    g = MU * A / 2 * semi_ellipse(surfaces.centres(2100, h)[0], A)
    creepages = -MU * A * np.array([0.2, 0.4, 0.8])
    curve = creep_curve(bound=g, element=h, material=BODY, longitudinal=creepages)
    alone = [rolling(bound=g, element=h, material=BODY, longitudinal=c) for c in creepages.tolist()]
    assert curve.products.tolist() == [result.products for result in alone]


def test_a_curve_of_a_line_may_begin_without_lateral_creepage():
    g, case = MU * A / 2 * semi_ellipse(surfaces.centres(60, 0.03)[0], A), {"material": BODY}
    curve = creep_curve(bound=g, element=0.03, longitudinal=-0.05, lateral=[0.0, 0.02], **case)
    back = creep_curve(bound=g, element=0.03, longitudinal=-0.05, lateral=[0.02, 0.0], **case)
    assert_allclose(curve.creepages, [[-0.05, 0.0, 0.0], [-0.05, 0.02, 0.0]])
    assert_allclose(back.force[::-1], curve.force, atol=1e-7 * g.sum() * 0.03)
    assert curve.force[0, 1] == 0.0


@pytest.mark.parametrize(
    "creepages", [{"longitudinal": [0.1, 0.2], "lateral": [0.1]}, {"spin": [[0.1]]}]
)
def test_refuses_what_is_no_curve(creepages):
    case = {"element": (1.0, 1.0), "material": BODY, "bound": np.ones((4, 4))}
    refuses(ValueError, "has shape .* numbers, and arrays", creep_curve, **case, **creepages)
    message = "are numbers, but one at least must be an array"
    refuses(ValueError, message, creep_curve, **case, longitudinal=0.1)
    refuses(ValueError, "a curve has one point at least", creep_curve, **case, longitudinal=[])


def line_curve():
    h = 2 * A / 40
    (x,) = surfaces.centres(44, h)
    g = MU * A / 2 * semi_ellipse(x, A)
    return creep_curve(bound=g, element=h, material=BODY, longitudinal=[-0.02, -0.05, -0.1])


def surface_curve():
    g, alone = circle(16, (0.05, 0.02, 0.1))
    return creep_curve(
        bound=g, element=alone.element, material=BODY, lateral=[0.01, 0.02], spin=0.1
    )


@pytest.mark.parametrize(
    ("make", "varied", "name", "unit"),
    [
        (line_curve, [-0.02, -0.05, -0.1], "longitudinal creepage", "N/mm"),
        (surface_curve, [0.01, 0.02], "lateral creepage", "N"),
    ],
)
def test_a_curve_is_drawn_over_the_creepage_that_varies(make, varied, name, unit):
    figure = pytest.importorskip("matplotlib.figure").Figure()
    curve, ax = make(), figure.subplots()
    assert curve.plot(ax=ax) is ax
    assert (ax.get_xlabel(), ax.get_ylabel()) == (f"{name} [–]", f"force [{unit}]")
    forces = np.atleast_2d(curve.force.T)
    for line, force in zip(ax.lines, forces, strict=False):
        assert_allclose(line.get_xdata(), varied)
        assert_allclose(line.get_ydata(), force)
    assert len(ax.get_legend().get_texts()) == len(forces)
    scaled = curve.plot(ax=figure.add_subplot(), friction=2.0)
    assert_allclose(scaled.lines[0].get_ydata(), -forces[0] / 2.0)
    assert scaled.get_ylabel() == "-F/(μ P) [–]"
    refuses(ValueError, "friction is 0.0, but must be positive", curve.plot, friction=0.0)


@pytest.mark.parametrize("make", [line_curve, surface_curve])
def test_a_curve_is_told_by_its_first_and_its_last_point(make):
    curve = make()
    assert repr(curve).startswith(f"<CreepCurve {len(curve.force)} points: creepages ")
    assert "\n" not in repr(curve)
    cells = cells_of(curve)
    last = 100 * curve.stick_share[-1]
    assert cells["share that sticks"].endswith(f" to {last:.5g} %")
    assert cells["solved by"] == f"{curve.products.sum()} products"
    assert ("spin" in cells) == (make is surface_curve)


@pytest.mark.parametrize("bonded", [False, True])
def test_a_curve_through_zero_has_no_force_there(bonded):
    g, alone = circle(16, (0.05, 0.0, 0.0))
    g = np.where(g > 0.0, np.inf, 0.0) if bonded else g
    case = {"material": Material.from_shear(1.0, 0.25)}
    ends = [-0.05, 0.0, 0.05]
    curve = creep_curve(bound=g, element=alone.element, longitudinal=ends, **case)
    assert_allclose(curve.force[0], -curve.force[2], atol=1e-6 * abs(curve.force[0, 0]))
    assert np.array_equal(curve.force[1], [0.0, 0.0])
    assert curve.power[1] == 0.0


def test_the_forces_of_strips_of_a_length_are_whole_forces():
    gap, steel = surfaces.cylinder(32, 0.01, radius=25.0), Material(E=210000.0, nu=0.28)
    pressed = normal_contact(gap, (0.01, 50.0), material=steel, force=800.0)
    curve = creep_curve(pressed, mu=0.3, longitudinal=[-1e-4, -1e-2])
    rolled = rolling(pressed, mu=0.3, longitudinal=-1e-2)
    assert curve.force[-1] == pytest.approx(rolled.force)
    assert curve.units["force"] == curve.units["power"] == "N"
    assert "N/mm" not in repr(curve)


@pytest.mark.parametrize("shape", [(8,), (5, 4)])
def test_a_curve_without_contact_has_no_force_and_nothing_that_slips(shape):
    case = {"material": Material.from_shear(1.0, 0.25), "longitudinal": [0.01, 0.02]}
    curve = creep_curve(bound=np.zeros(shape), element=(0.1, 0.1), **case)
    assert not curve.force.any()
    assert not curve.power.any()
    assert np.array_equal(curve.stick_share, [1.0, 1.0])
