"""Curves of forces over creepages: the points of `rolling`."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.test_friction import semi_ellipse
from tests.test_rolling import MU, A, circle
from toeplitz_mg.contact import Material, creep_curve, surfaces

BODY = Material.from_shear(0.7, 0.3)


def test_a_curve_is_carters():
    h = 2 * A / 400
    (x,) = surfaces.centres(440, h)
    g = MU * A / 2 * semi_ellipse(x, A)
    part = np.array([0.0, 0.2, 0.6, 1.0, 1.5])  # Creepage over that at which all slides.
    curve = creep_curve(g, h, material=BODY, longitudinal=-MU * A * part)
    carried = g.sum() * h
    assert_allclose(curve.force / carried, 1 - np.maximum(0, 1 - part) ** 2, atol=0.005)
    assert_allclose(curve.stick_share, np.maximum(0, 1 - part), atol=0.01)
    assert_allclose(curve.power, MU * A * part * curve.force, rtol=1e-12)
    assert curve.moment is None
    products = curve.products.sum()
    largest = f"{curve.force.max():.5g}"
    assert repr(curve) == f"<CreepCurve of 5 points: forces up to {largest}; {products} products>"


def test_points_of_a_curve_are_those_alone():
    g, alone = circle(24, (0.05, 0.02, 0.1))
    curve = creep_curve(
        g,
        alone.element,
        material=Material.from_shear(1.0, 0.25),
        longitudinal=[0.01, 0.05, 0.2],
        lateral=0.02,
        spin=0.1,
    )
    assert_allclose(curve.creepages, [[0.01, 0.02, 0.1], [0.05, 0.02, 0.1], [0.2, 0.02, 0.1]])
    assert_allclose(curve.force[1], alone.force, atol=1e-6 * np.linalg.norm(alone.force))
    assert_allclose(curve.moment[1], alone.moment, atol=1e-6)
    assert curve.products.shape == curve.power.shape == (3,)


def test_a_curve_of_a_line_may_begin_without_lateral_creepage():
    g, case = MU * A / 2 * semi_ellipse(surfaces.centres(60, 0.03)[0], A), {"material": BODY}
    curve = creep_curve(g, 0.03, longitudinal=-0.05, lateral=[0.0, 0.02], **case)
    back = creep_curve(g, 0.03, longitudinal=-0.05, lateral=[0.02, 0.0], **case)
    assert_allclose(curve.creepages, [[-0.05, 0.0, 0.0], [-0.05, 0.02, 0.0]])
    assert_allclose(back.force[::-1], curve.force, atol=1e-7 * g.sum() * 0.03)
    assert curve.force[0, 1] == 0.0


@pytest.mark.parametrize(
    "creepages", [{"longitudinal": [0.1, 0.2], "lateral": [0.1]}, {"spin": [[0.1]]}]
)
def test_refuses_what_is_no_curve(creepages):
    with pytest.raises(ValueError, match=r"has shape .*, but they must be numbers, and arrays"):
        creep_curve(np.ones((4, 4)), (1.0, 1.0), material=BODY, **creepages)
    with pytest.raises(ValueError, match="are numbers, but one at least must be an array"):
        creep_curve(np.ones((4, 4)), (1.0, 1.0), material=BODY, longitudinal=0.1)
