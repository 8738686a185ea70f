"""Kalker's coefficients, against his tables and their own symmetries."""

from xml.etree import ElementTree

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.systems import refuses
from toeplitz_mg import contact
from toeplitz_mg.contact import Material, kalker_coefficients, rolling, surfaces


@pytest.mark.parametrize(
    ("ratio", "table"),
    [(1.0, (4.12, 3.67, 1.47, 1.19)), (0.1, (3.31, 2.52, 0.473, 8.28))],
)
def test_coefficients_are_those_of_kalkers_tables(ratio, table):
    # Kalker, Three-Dimensional Elastic Bodies in Rolling Contact (1990), ν = 1/4.
    assert_allclose(kalker_coefficients(ratio, 0.25), table, rtol=0.01)


def test_a_result_has_the_coefficients_of_the_ellipse_in_contact():
    case = {"material": Material(E=210000.0, nu=0.25), "force": 60000.0}
    gap = surfaces.ellipsoid((96, 96), (0.2, 0.2), radii=(460.0, 100.0))
    pressed = contact.normal_contact(gap, (0.2, 0.2), **case)
    a, b = contact.hertz(radii=(460.0, 100.0), **case).half_axes
    exact = kalker_coefficients(a / b, 0.25, n=16)
    assert_allclose(kalker_coefficients(pressed, n=16), exact, rtol=0.03)
    refuses(ValueError, "nu is 0.3, but the normal result has", kalker_coefficients, pressed, 0.3)
    i, j = np.indices((32, 32)) - 4
    inside = (i >= 0) & (j >= 0) & (i < 24) & (j < 24)
    for punch, why in [(i + j < 20, "fills only 0."), ((i < 12) ^ (i > 13), "has 2 patches")]:
        other = contact.normal_contact(np.where(punch & inside, 0.0, 1.0), (0.2, 0.2), **case)
        refuses(ValueError, why, kalker_coefficients, other)


def test_without_compression_along_and_across_are_the_same():
    # For ν = 0 the displacement is along the traction, and the same in all directions.
    found = kalker_coefficients(1.0, 0.0, n=32)
    assert_allclose(found.C11, found.C22, rtol=1e-5)


def test_coefficients_are_those_of_bodies_that_hardly_creep():
    n, ratio, creepages = 64, 0.5, {"longitudinal": 2e-4, "lateral": 1e-4, "spin": -1e-4}
    a, b = ratio**0.5, ratio**-0.5
    element = 2.0 * a / n, 2.0 * b / n
    x, y = surfaces.centres((n, n), element)
    g = np.sqrt(np.maximum(0.0, 1.0 - (x / a) ** 2 - (y / b) ** 2))
    result = rolling(bound=g, element=element, material=Material.from_shear(1.0, 0.3), **creepages)
    C = kalker_coefficients(ratio, 0.3)
    force = [-C.C11 * 2e-4, -C.C22 * 1e-4 + C.C23 * 1e-4]
    assert_allclose(result.force, force, rtol=0.03)
    assert_allclose(result.moment, C.C23 * 1e-4 + C.C33 * 1e-4, rtol=0.06)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((1e-3, 0.25), "ratio is 0.001, but must be 0.01 to 100"),
        ((1.0, 0.6), "nu is 0.6"),
        ((-1.0, 0.25), "ratio is -1.0, but must be positive"),
    ],
)
def test_refuses_what_makes_no_sense(arguments, message):
    with pytest.raises(ValueError, match=message):
        kalker_coefficients(*arguments)
    with pytest.raises(ValueError, match="n is 9, but must be even"):
        kalker_coefficients(1.0, 0.25, n=9)


def test_a_notebook_shows_the_coefficients():
    found = kalker_coefficients(1.0, 0.25, n=8)
    cells = ElementTree.fromstring(found._repr_html_()).findall("tr/td")
    assert_allclose([float(cell.text) for cell in cells], found, rtol=1e-4)
