"""Stresses below a contact are the sum of those of its elements, and converge to theory."""

import dataclasses
import warnings

import numpy as np
import pytest
from numpy.testing import assert_allclose

from comparisons.theory import below
from comparisons.theory.solved import grids, order
from tests.systems import cells_of, refuses
from toeplitz_mg import halfspace
from toeplitz_mg.contact import (
    ContactWarning,
    Material,
    Stresses,
    friction,
    frictional_contact,
    normal_contact,
    rolling,
    subsurface_stresses,
    surfaces,
)
from toeplitz_mg.halfspace import CombinedMaterial

# Tests of what is solved, on grids that are meant to be small, and of unlike materials.
pytestmark = pytest.mark.filterwarnings("ignore::toeplitz_mg.contact.ContactWarning")

A = 0.6  # The half width of the contacts, whose E* is 1.
STEEL = Material.from_shear(0.7, 0.3)
SOFT, HARD = Material.from_shear(1.0, 0.2), Material.from_shear(3.0, 0.4)
# The components xx, yy, zz, yz, xz, xy as a matrix.
VOIGT = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])


def sphere(n, material=STEEL, force=1.0, **options):
    """The force is over that of a contact of radius A, where E* is 1."""
    h = 2.0 / n
    gap = surfaces.sphere((n, n), (h, h), radius=1.0)
    return normal_contact(gap, (h, h), material=material, force=force * 4 / 3 * A**3, **options)


def line(n, material=STEEL):
    h = 2.0 / n
    gap = surfaces.cylinder(n, h, radius=1.0)
    return normal_contact(gap, h, material=material, force=np.pi * A**2 / 4)


# Theory -------------------------------------------------------------------------------------


def test_below_a_line_the_largest_shear_is_where_johnson_has_it():
    pressed = line(257)
    depths = np.linspace(0.6, 1.0, 41) * A
    stresses = subsurface_stresses(pressed, depths=depths)
    k, i = np.unravel_index(stresses.max_shear.argmax(), stresses.max_shear.shape)
    assert i == 128
    assert abs(stresses.max_shear.max() / (A / 2) - 0.300) < 0.001
    assert abs(depths[k] / A - 0.786) <= 0.01
    assert_allclose(stresses.yy, STEEL.nu * (stresses.xx + stresses.zz), atol=1e-14)


@pytest.mark.parametrize(("mu", "at_surface"), [(0.2, False), (0.25, False), (0.35, True)])
def test_the_largest_shear_below_a_sphere_rises_to_the_surface(mu, at_surface):
    pressed = sphere(65)
    slid = friction(pressed, mu=mu, force=(mu * pressed.force, 0.0))
    stresses = subsurface_stresses(pressed, slid, depths=np.linspace(0.0, 0.6, 13) * A)
    deepest = stresses.max_shear.max(axis=(1, 2)).argmax()
    assert (deepest == 0) == at_surface


@pytest.mark.parametrize(
    ("solve", "coarse", "fine"),
    [
        (below.sliding_line, 64, 512),
        pytest.param(below.sliding_sphere, 32, 128, marks=pytest.mark.slow),
    ],
)
def test_stresses_below_what_slides_converge_to_theory(solve, coarse, fine):
    def error(N):
        return np.sqrt(np.mean([solve(n).errors["σxx"] ** 2 for n in grids(N)]))

    errors = error(coarse), error(fine)
    assert errors[1] < 1e-4
    assert order(errors, (coarse, fine)) > 1.3


# Exact for the tractions that there are -----------------------------------------------------


def sum_of_elements(depth, pressed, shifted, nu, sign=1.0):
    """The stresses at all centres, element by element; the second body has the tractions' sign."""
    x, y = (axis.ravel() for axis in np.meshgrid(*pressed.centres, indexing="ij"))
    at = x[:, None] - x, y[:, None] - y, depth, pressed.element
    q = sign * shifted.traction.reshape(2, -1)
    total = halfspace.stresses_z(*at, nu=nu) @ pressed.pressure.flat
    return total + halfspace.stresses_x(*at, nu=nu) @ q[0] + halfspace.stresses_y(*at, nu=nu) @ q[1]


def test_the_stresses_are_the_sum_of_those_of_all_elements():
    pressed = sphere(12)
    shifted = friction(pressed, mu=0.3, force=(0.03, 0.02))
    stresses = subsurface_stresses(pressed, shifted, depths=[0.0, 0.2])
    for k, depth in enumerate(stresses.depths):
        expected = sum_of_elements(depth, pressed, shifted, nu=0.3)
        assert_allclose(stresses.components[:, k].reshape(6, -1), expected, atol=1e-13)


def test_the_stresses_below_strips_are_the_sum_of_those_of_all_strips():
    pressed = line(16)
    rolled = rolling(pressed, mu=0.3, longitudinal=-0.01, lateral=-0.02)
    stresses = subsurface_stresses(pressed, rolled, depths=[0.0, 0.2])
    at = pressed.x[:, None] - pressed.x
    for k, depth in enumerate(stresses.depths):
        z, x, y = (
            function(at, depth, pressed.element[0], nu=0.3)
            for function in (
                halfspace.line_stresses_z, halfspace.line_stresses_x, halfspace.line_stresses_y
            )
        )  # fmt: skip
        expected = z @ pressed.pressure + x @ rolled.traction[0] + y @ rolled.traction[1]
        assert_allclose(stresses.components[:, k], expected, atol=1e-13)


def test_each_body_has_its_own_ratio_and_its_own_side_of_the_tractions():
    pressed = sphere(12, material=(SOFT, HARD))
    shifted = friction(pressed, mu=0.3, shift=(1e-3, 0.0))
    for body, nu, sign in (("first", SOFT.nu, 1.0), ("second", HARD.nu, -1.0)):
        below = subsurface_stresses(pressed, shifted, depths=0.2, body=body)
        assert below.body == body
        expected = sum_of_elements(0.2, pressed, shifted, nu, sign)
        assert_allclose(below.components.reshape(6, -1), expected, atol=1e-13)


# What they are compared by ------------------------------------------------------------------


def test_stresses_of_von_mises_and_tresca_are_those_of_the_principal_stresses():
    rng = np.random.default_rng(1)
    components = rng.standard_normal((6, 3, 5, 4))
    components[:, 0] = 0.0
    components[:3, 0] = rng.standard_normal()  # A pressure all round: no shear at all.
    components[3:, 1] = 0.0
    centres = np.arange(-2.0, 3.0), np.arange(-1.5, 2.0)
    stresses = Stresses("first", np.zeros(3), centres, components)
    principal = np.linalg.eigvalsh(np.moveaxis(components[VOIGT], (0, 1), (-2, -1)))
    low, middle, high = np.moveaxis(principal, -1, 0)
    squares = (high - low) ** 2 + (high - middle) ** 2 + (middle - low) ** 2
    assert_allclose(stresses.von_mises, np.sqrt(squares / 2), rtol=1e-12, atol=1e-14)
    assert_allclose(stresses.max_shear, (high - low) / 2, rtol=1e-7, atol=1e-14)
    names = ("xx", "yy", "zz", "yz", "xz", "xy")
    for name, component in zip(names, components, strict=True):
        assert np.array_equal(getattr(stresses, name), component)


def test_stresses_are_in_proportion_to_tractions_of_any_size():
    one = subsurface_stresses(sphere(16), depths=0.2)
    for scale in (1e-30, 1e30):
        material = Material.from_shear(0.7 * scale, 0.3)
        other = subsurface_stresses(sphere(16, material, scale), depths=0.2)
        assert_allclose(other.von_mises / scale, one.von_mises, rtol=1e-5)
        assert_allclose(other.max_shear / scale, one.max_shear, rtol=1e-5)


# Failures -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"depths": -0.1}, r"depths has the value -0\.1, but a depth is at least zero"),
        ({"depths": [[0.1]]}, "depths is .*but must be a number, or a list"),
        ({"depths": np.inf}, "a list of finite ones"),
        ({"depths": []}, r"depths is \[\], but must be a number, or a list"),
        ({"body": "third"}, "body is 'third', but must be 'first' or 'second'"),
        ({"results": 0}, "there are 0 results"),
        ({"results": 2}, "there are 2 results, but there must be"),
    ],
)
def test_refuses_what_makes_no_sense(change, message):
    arguments = {"depths": 0.1, "body": "first"} | change
    results = [line(16)] * arguments.pop("results", 1)
    refuses(ValueError, message, subsurface_stresses, *results, **arguments)


def test_refuses_results_that_do_not_belong_together_or_repeat_or_are_of_one_rank():
    with pytest.raises(ValueError, match=r"shape is .* in one result and .* in the other"):
        subsurface_stresses(line(16), friction(line(18), mu=0.1, shift=1e-3), depths=0.1)
    other = friction(line(16, material=SOFT), mu=0.1, shift=1e-3)
    with pytest.raises(ValueError, match=r"material is .* in one result"):
        subsurface_stresses(line(16), other, depths=0.1)
    refuses(TypeError, r"a result is 3\.0", subsurface_stresses, 3.0, depths=0.1)
    for periodic in ((True, False), (False, True), True):
        with pytest.raises(ValueError, match=r"a result has periodic="):
            subsurface_stresses(sphere(16, periodic=periodic), depths=0.1)
    rows = dataclasses.replace(sphere(24), shape=(48, 24))
    with pytest.raises(ValueError, match=r"a result has the rows of one rank, \(24, 24\) of"):
        subsurface_stresses(rows, depths=0.1)
    on_rigid = line(16, material=(SOFT, Material.rigid()))
    assert subsurface_stresses(on_rigid, depths=0.1).body == "first"
    with pytest.raises(ValueError, match="the second body is rigid"):
        subsurface_stresses(on_rigid, depths=0.1, body="second")
    with pytest.raises(ValueError, match="which does not tell the two"):
        subsurface_stresses(line(16, material=CombinedMaterial(1.0, 0.3)), depths=0.1)


def test_tractions_without_a_pressure_are_doubted():
    larger, smaller = (sphere(24, force=F) for F in (1.0, 0.2))
    shifted = friction(larger, mu=0.3, force=(0.01, 0.0))
    text = r"\d+ elements have tangential tractions, but no pr"
    with pytest.warns(ContactWarning, match=text) as caught:
        subsurface_stresses(smaller, shifted, depths=0.1)
    assert caught[0].filename == __file__
    with warnings.catch_warnings(action="error"):
        subsurface_stresses(larger, shifted, depths=0.1)


@pytest.mark.parametrize("make", [sphere, line])
def test_a_notebook_shows_where_it_yields_first(make):
    stresses = subsurface_stresses(make(33), depths=np.array([0.1, 0.3, 0.5]))
    assert repr(stresses).startswith("<Stresses: first body, below 33 ")
    cells = cells_of(stresses)
    assert cells["largest von Mises"] == f"{stresses.von_mises.max():.5g} N/mm²"
    assert cells["largest shear"] == f"{stresses.max_shear.max():.5g} N/mm²"
    k = np.unravel_index(stresses.von_mises.argmax(), stresses.von_mises.shape)[0]
    assert cells["at a depth of"] == f"{stresses.depths[k]:.5g} mm"


@pytest.mark.filterwarnings("error")
def test_far_below_nothing_is_taken_for_a_dense_matrix():
    """There all coefficients are alike, but for rounding."""
    pressed = sphere(32)
    stresses = subsurface_stresses(pressed, depths=1e6)
    # A point load: the stress along the depth is -3 F/(2π z²).
    assert_allclose(stresses.zz, -3.0 * pressed.force / (2.0 * np.pi * 1e12), rtol=1e-6)


def test_bodies_pressed_with_friction_have_the_stresses_of_both_parts():
    n, h = 24, 0.1
    gap = surfaces.sphere((n, n), (h, h), radius=20.0)
    both = frictional_contact(gap, (h, h), material=(SOFT, HARD), mu=0.2, force=0.02)
    for body in ("first", "second"):
        at_once = subsurface_stresses(both, depths=[0.0, 0.3], body=body)
        parts = subsurface_stresses(both.normal, both.tangential, depths=[0.0, 0.3], body=body)
        assert np.array_equal(at_once.von_mises, parts.von_mises)
    refuses(ValueError, "there are 3 results", subsurface_stresses, both, both.normal, depths=0.1)
