"""Hertz's theory in closed form obeys its own equations in other integrals, and the solver it."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import quad
from scipy.special import ellipe, ellipk

from tests.systems import cells_of
from toeplitz_mg.contact import Material, hertz, normal_contact, surfaces

STEEL = Material(E=210000.0, nu=0.28)
RUBBER = Material(E=10.0, nu=0.5)
MODULUS = 1.7
UNIT = Material.from_shear(MODULUS * 0.7, 0.3)  # Of both bodies: E* is the modulus.


def test_an_ellipse():
    """The equations of Johnson's §4.2 hold, with Legendre's integrals."""
    a, b, p0 = 0.6, 0.3, 0.2
    e2 = 1 - (b / a) ** 2
    K, E = ellipk(e2), ellipe(e2)
    common = 2 * p0 * b / (e2 * a**2 * MODULUS)
    radii = 1 / (common * (K - E)), 1 / (common * ((a / b) ** 2 * E - K))
    force, approach = 2 / 3 * np.pi * a * b * p0, p0 * b * K / MODULUS
    for given in ({"force": force}, {"approach": approach}):
        theory = hertz(radii=radii, material=UNIT, **given)
        assert_allclose(theory.half_axes, (a, b))
        found = [theory.force, theory.approach, theory.max_pressure]
        assert_allclose(found, [force, approach, p0])
        assert_allclose(theory.area * theory.mean_pressure, force)
        turned = hertz(radii=radii[::-1], material=UNIT, **given)
        assert_allclose(turned.half_axes, (b, a))


def test_a_circle_is_a_sphere():
    circle = hertz(radii=2.0, material=UNIT, force=5.0)
    a = (3 * 5.0 * 2.0 / (4 * MODULUS)) ** (1 / 3)
    assert_allclose([*circle.half_axes, circle.approach], [a, a, a**2 / 2.0])
    assert circle == hertz(radii=(2.0, 2.0), material=UNIT, force=5.0)
    assert_allclose(hertz(radii=(2.0, 2.0001), material=UNIT, force=5.0).half_axes, a, rtol=1e-4)


def test_a_cylinder():
    steel = Material.from_shear(82000.0, 0.28)
    force = np.pi * 16 * 82000.0 / (4 * 500.0 * 0.72)
    line = hertz(radii=(500.0, np.inf), material=steel, force=force)
    assert_allclose(line.half_axes, (4.0, np.inf))
    assert_allclose(line.area, 8.0)
    assert line.approach is line.stiffness is None
    assert_allclose(quad(line.pressure_at, -4.0, 4.0)[0], force)
    along_x = hertz(radii=(np.inf, 500.0), material=steel, force=force)
    assert_allclose(along_x.half_axes, (np.inf, 4.0))
    assert_allclose(along_x.pressure_at(7.0, 1.0), line.pressure_at(1.0, 7.0))


@pytest.mark.parametrize(
    "given",
    [{"radii": 3.0}, {"radii": (3.0, 0.4)}, {"radii": (3.0, np.inf), "reference": 50.0}],
    ids=["sphere", "ellipsoid", "cylinder"],
)
def test_the_stiffness_is_a_derivative(given):
    less, here, more = (hertz(**given, material=UNIT, force=f) for f in (0.999, 1.0, 1.001))
    slope = (more.force - less.force) / (more.approach - less.approach)
    assert_allclose(here.stiffness, slope, rtol=1e-5)


def test_the_sum_of_the_pressures_is_the_force():
    contact = hertz(radii=(3.0, 0.4), material=UNIT, force=2.0)
    a, b = contact.half_axes
    element = (2.0 * a / 300, 2.0 * b / 300)
    x, y = surfaces.centres((300, 300), element)
    assert_allclose(contact.pressure_at(x, y).sum() * np.prod(element), 2.0, rtol=1e-3)


def test_curvatures_of_both_bodies_add_up():
    """A wheel on a rail, and a shaft in a bearing that is hardly wider."""
    both = hertz(radii=((460.0, -330.0), (np.inf, 300.0)), material=UNIT, force=2.0)
    R2 = 1.0 / (1.0 / 300.0 - 1.0 / 330.0)
    assert_allclose(both.half_axes, hertz(radii=(460.0, R2), material=UNIT, force=2.0).half_axes)
    shaft = hertz(radii=((10.0, np.inf), (-10.5, np.inf)), material=UNIT, force=0.02)
    assert_allclose(
        shaft.half_axes, hertz(radii=(210.0, np.inf), material=UNIT, force=0.02).half_axes
    )


@pytest.mark.parametrize("radii", [(7.0, 7.0), (20.0, 4.0), (4.0, 20.0)])
def test_the_solver_on_a_grid_agrees(radii):
    theory = hertz(radii=radii, material=(STEEL, RUBBER), approach=0.01)
    element = tuple(2.6 * axis / 64 for axis in theory.half_axes)
    gap = surfaces.ellipsoid((64, 64), element, radii=radii)
    contact = normal_contact(gap, element, material=(STEEL, RUBBER), force=theory.force)
    assert_allclose(contact.approach, theory.approach, rtol=2e-3)
    assert_allclose(contact.max_pressure, theory.max_pressure, rtol=5e-3)
    assert_allclose(contact.area, theory.area, rtol=2e-2)
    assert_allclose(contact.mean_pressure, theory.mean_pressure, rtol=2e-2)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"radii": (1.0, -2.0)}, r"radii is \(1.0, -2.0\), but the curvatures 1/R of both"),
        ({"radii": ((1.0, 2.0), (-0.5, 2.0))}, "must be positive along x and y"),
        ({"radii": (np.inf, np.inf)}, "along one of them zero"),
        ({"radii": 0.0}, "radii is 0.0, but must be positive"),
        ({"radii": (0.0, 1.0)}, "no radius of curvature is zero"),
        ({"radii": ((1.0, 2.0), (3.0,))}, "radii is .*, but its rows must be of the same length"),
        ({"radii": (1.0, 2.0, 3.0)}, r"but must be \(R1, R2\), or a pair of them"),
        ({"radii": (1.0, 1e5)}, "one may be at most 10000 times"),
        ({"force": None}, "one of the two must be given"),
        ({"approach": 0.1}, "one of the two must be given"),
        ({"force": -1.0}, "force is -1, but must be at least zero"),
        ({"force": 1e50}, "force is of size 1e.50"),
        ({"force": None, "approach": 0.0}, "approach is 0.0, but must be positive"),
        ({"reference": 1.0}, "reference is 1.0, but is for a cylinder"),
        ({"radii": (1.0, np.inf), "reference": 0.1}, "more than the half width"),
        ({"radii": (1.0, np.inf), "force": 0.0, "reference": -1.0}, "reference is -1.0, but must"),
        ({"radii": (1.0, np.inf), "force": None, "approach": 0.1}, "give the force"),
        ({"material": (Material.rigid(), Material.rigid())}, "both bodies are rigid"),
    ],
)
def test_what_makes_no_sense_is_refused(given, said):
    with pytest.raises(ValueError, match=said):
        hertz(**{"radii": 1.0, "material": UNIT, "force": 1.0} | given)


@pytest.mark.parametrize("radii", [10.0, (10.0, np.inf), (3.0, 7.0)])
def test_without_a_force_nothing_touches(radii):
    """As the limit of small forces."""
    none, little = (hertz(radii=radii, material=STEEL, force=F) for F in (0.0, 1e-20))
    assert none.force == none.area == none.max_pressure == none.mean_pressure == 0.0
    assert_allclose(none.half_axes, little.half_axes, atol=1e-5)
    assert none.approach == (0.0 if little.approach is not None else None)
    assert_array_equal(none.pressure_at([0.0, 1.0], 0.0), [0.0, 0.0])


@pytest.mark.parametrize(
    ("radii", "said"),
    [
        (10.0, {"force": "100 N", "stiffness": "43067 N/mm", "half axes": "(0.18663, 0.18663) mm"}),
        (
            (10.0, np.inf),
            {"force": "100 N/mm", "half width": "0.10505 mm", "contact": "0.21009 mm"},
        ),
    ],
)
def test_a_notebook_shows_the_figures_of_the_theory_with_units(radii, said):
    theory = hertz(radii=radii, material=Material(E=210000.0, nu=0.3), force=100.0)
    cells = cells_of(theory)
    assert said.items() <= cells.items()
    assert ("approach" in cells) == (theory.approach is not None)


def test_points_that_make_no_sense_are_refused_without_a_force_too():
    for force in (0.0, 1.0):
        ball = hertz(radii=1.0, material=UNIT, force=force)
        with pytest.raises(ValueError, match="x is not a number"):
            ball.pressure_at(np.nan)
        with pytest.raises(ValueError, match=r"x \(2,\), y \(3,\), but must broadcast"):
            ball.pressure_at([1.0, 2.0], [1.0, 2.0, 3.0])
