"""Doubts about contact problems: what is doubtful is said to the caller, what is not is silent."""

import copy
import pickle
import warnings

import numpy as np
import pytest

from tests.command_line import main
from toeplitz_mg import halfspace
from toeplitz_mg.contact import (
    ContactError,
    ContactWarning,
    Material,
    creep_curve,
    friction,
    frictional_contact,
    load_curve,
    normal_contact,
    rolling,
    rolling_steps,
    surfaces,
)

STEEL = Material.from_shear(82000.0, 0.28)
E_STAR = STEEL.E_star / 2.0
R, FORCE = 10.0, 100.0
RADIUS = (3.0 * FORCE * R / (4.0 * E_STAR)) ** (1.0 / 3.0)  # Radius of the contact by Hertz: 0.187.
LARGEST = 3.0 * FORCE / (2.0 * np.pi * RADIUS**2)  # Largest pressure by Hertz.

EDGE = "the contact reaches the edge of the grid along"
REVERSED = "the bodies touch at the edge of the grid, and are farthest apart in the middle"
COARSE = "the contact is only"
HARD = "the mean pressure is"
DEEP = "the gap varies by"
STEEP = "the gap has slopes"
UNLIKE = "the materials are unlike"


def sphere(n=64, h=0.01, unit=1.0):
    return unit * surfaces.sphere((n, n), (h, h), radius=R)


def pressed(gap, element=(0.01, 0.01), material=STEEL, **load):
    return normal_contact(gap, element, material=material, **(load or {"force": FORCE}))


def said(solve):
    """Return what a function does; the warnings that its caller sees are those of the result."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        result = solve()
    assert all(w.category is ContactWarning and w.filename == __file__ for w in caught)
    assert tuple(str(w.message) for w in caught) == result.warnings
    return result


def assert_doubts(result, *beginnings):
    assert len(result.warnings) == len(beginnings), result.warnings
    for doubt, beginning in zip(result.warnings, beginnings, strict=True):
        assert doubt.startswith(beginning)


# What is doubtful -----------------------------------------------------------------------------


def test_a_contact_that_fills_the_grid():
    h = 0.1 * RADIUS / 16
    result = said(lambda: pressed(sphere(64, h), (h, h)))
    assert result.contact.all()
    assert result.traction.max() > 16.0 * LARGEST
    assert_doubts(result, f"{EDGE} x and y")


def test_four_elements_in_contact():
    h = 3.0 * RADIUS
    result = said(lambda: pressed(sphere(12, h), (h, h)))
    assert result.contact.sum() == 4
    assert result.traction.max() < LARGEST / 12.0
    assert_doubts(result, f"{COARSE} 2 elements across")


@pytest.mark.parametrize("force", [1e-4, 1.0, FORCE])
def test_heights_in_micrometres_and_elements_in_millimetres(force):
    result = said(lambda: pressed(sphere(unit=1e3), force=force))
    assert result.warnings[0].startswith(DEEP)
    assert result.warnings[1].startswith(STEEP)


def test_the_sign_of_the_gap_reversed():
    result = said(lambda: pressed(sphere(unit=-1.0)))
    assert not result.contact[16:48, 16:48].any()
    assert_doubts(result, REVERSED)


@pytest.mark.parametrize(("sign", "doubt"), [(1.0, f"{EDGE} x,"), (-1.0, REVERSED)])
def test_a_line_contact_that_reaches_the_edge(sign, doubt):
    gap = sign * surfaces.cylinder(64, 0.01, radius=R)
    assert_doubts(said(lambda: pressed(gap, 0.01, force=1e3)), doubt)
    assert_doubts(said(lambda: pressed(gap, 0.01, approach=gap.min() + 0.02)), doubt)


@pytest.mark.parametrize("shape", [(1.0, 0.0), (0.0, 1.0), (0.3, -1.0)])
def test_the_axis_along_which_a_contact_reaches_the_edge(shape):
    x, y = surfaces.centres((48, 40), (0.01, 0.01))
    result = said(lambda: pressed((shape[0] * x**2 + shape[1] * y**2) / (2 * R), force=1000.0))
    along = "x," if shape[0] == 1.0 else "y," if shape[0] == 0.0 else "x and y,"
    assert_doubts(result, f"{EDGE} {along}")


def test_a_round_gap_need_not_be_smooth_nor_in_the_middle():
    rough = surfaces.rough((64, 64), (0.01, 0.01), rms=1e-4)
    moved = np.roll(sphere(128, 0.01), 32, axis=0)[:64, 32:96]  # Its crest is at the edge.
    for gap in (sphere() + rough, moved, np.sqrt(2.0 * R * sphere()) * 1e-2):  # The last is a cone.
        assert EDGE in "".join(said(lambda gap=gap: pressed(gap, force=5000.0)).warnings)


def test_a_pressure_beyond_linear_elasticity():
    E, area = 2.0 * STEEL.G * (1.0 + STEEL.nu), 0.16**2
    for bodies in (STEEL, (STEEL, Material.rigid()), (Material(E=9.0 * E, nu=0.1), STEEL)):
        case = {"gap": np.zeros((16, 16)), "material": bodies}
        assert_doubts(said(lambda c=case: pressed(force=0.11 * E * area, **c)), f"{HARD} 0.11 E")
        assert_doubts(pressed(force=0.09 * E * area, **case))


def test_slopes_in_contact():
    gap = np.abs(surfaces.centres(64, 0.01)[0])
    for slope, doubts in ((0.9, [HARD]), (1.1, [f"{STEEP} up to 1.1 in contact", HARD])):
        result = said(lambda s=slope: pressed(s * gap, 0.01, approach=0.2))
        assert result.traction[result.contact].mean() == pytest.approx(
            0.5 * slope * E_STAR, rel=0.1
        )
        assert_doubts(result, *doubts)  # Under a wedge the mean pressure is slope E*/2.


@pytest.mark.parametrize("across", [1, 5, 9, 10])
def test_elements_across_the_largest_spot(across):
    shape = (40, 30)
    bound = np.zeros(shape)
    bound[3 : 3 + across, 4:28] = 0.3  # This is long, but narrow.
    bound[20::2, 1::2] = 0.3  # This is more, but in small spots.
    doubts = (f"{COARSE} {across} element",) if across < 10 else ()
    arguments = {"element": (0.1, 0.1), "material": Material.from_shear(1.0, 0.3)}
    creepage = {"longitudinal": 0.01}
    for g in (bound, bound.T):
        assert_doubts(said(lambda g=g: friction(bound=g, shift=(1e-3, 0), **arguments)), *doubts)
        assert_doubts(said(lambda g=g: rolling(bound=g, **creepage, **arguments)), *doubts)


@pytest.mark.parametrize("n", [40, 300])
def test_a_contact_cut_off_by_the_edge_is_doubted_on_any_grid(n):
    h = 2.0 * RADIUS / n
    x, y = surfaces.centres((n, n), (h, h))
    gap = ((x - RADIUS) ** 2 + y**2) / (2.0 * R)  # Its crest is at the edge.
    assert_doubts(said(lambda: pressed(gap, (h, h), force=0.3 * FORCE)), f"{EDGE} x,")


def test_where_spots_of_a_few_elements_are_many_neither_they_nor_the_edge_are_doubted():
    n, h = 256, 0.001
    gap = surfaces.rough((n, n), (h, h), rms=2e-4, roll_off=0.0128, seed=3)
    result = said(lambda: pressed(gap, (h, h), force=10.0))
    assert 0.02 < result.contact.mean() < 0.05
    assert result.contact[0].any()
    assert_doubts(result)


def test_creepages_of_another_unit():
    g = np.zeros((24, 24))
    g[4:20, 4:20] = 0.3  # The radius of a circle of this area is 0.9 mm.
    case = {"bound": g, "element": (0.1, 0.1), "material": Material.from_shear(1.0, 0.3)}
    for given, doubts in (
        ({"longitudinal": 0.1, "lateral": -0.1, "spin": 0.1}, ()),
        ({"longitudinal": -0.11}, ["the longitudinal creepage is -0.11, but creepages"]),
        ({"lateral": 3.0, "spin": -0.12}, ["the lateral creepage is 3", "the spin is -0.12 per"]),
    ):
        rolled = said(lambda given=given: rolling(**case, **given))
        assert_doubts(rolled, *doubts)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            *_, last = rolling_steps(**case, **given, steps=3)
        assert tuple(str(w.message) for w in caught) == last.warnings == rolled.warnings
    # Those that are found are judged too, and of a curve it is said once.
    by_force = rolling(**case, longitudinal=0.05)
    assert_doubts(said(lambda: rolling(**case, force=tuple(by_force.force), spin=-0.2)), "the spin")
    with pytest.warns(ContactWarning) as caught:
        creep_curve(**case, lateral=[0.05, 0.2, 0.3])
    assert [str(w.message)[:27] for w in caught] == ["the lateral creepage is 0.2"]
    assert caught[0].filename == __file__


def test_friction_of_another_unit_and_what_is_known_of_the_pressures():
    fine, coarse = pressed(sphere()), said(lambda: pressed(sphere(12, 0.1), (0.1, 0.1)))
    for mu in (2.0, np.inf, np.where(sphere() < 1e-4, np.inf, 0.3)):
        assert_doubts(said(lambda mu=mu: friction(fine, mu=mu, shift=(1e-5, 0.0))))
    assert_doubts(said(lambda: friction(fine, mu=30.0, shift=(1e-5, 0.0))), "mu is 30, but coef")
    assert_doubts(said(lambda: rolling(fine, mu=30.0, lateral=1e-3)), "mu is 30")
    with pytest.warns(ContactWarning, match="mu is 3, but") as caught:
        result = friction(coarse, mu=3.0, shift=(1e-5, 0.0))
    assert len(caught) == 1  # Of the pressures it was said before.
    assert_doubts(result, COARSE, "mu is 3, but")


# What is not ----------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [64, 128, 200])
def test_spheres_are_silent_on_all_their_grids(n):
    h = 0.64 / n  # Coarser grids, from which the first guess comes, have only a few in contact.
    normal = said(lambda: pressed(sphere(n, h), (h, h)))
    g = 0.3 * normal.traction
    arguments = {"element": (h, h), "material": STEEL}
    shifted = said(lambda: friction(bound=g, force=(15.0, 0.0), **arguments))
    again = said(lambda: friction(bound=g, force=(0.0, 0.0), previous=shifted, **arguments))
    rolled = said(lambda: rolling(bound=g, longitudinal=1e-3, **arguments))
    for result in (normal, shifted, again, rolled):
        assert_doubts(result)


@pytest.mark.parametrize("force", [0.1, 0.2])  # The spots have more than ten elements.
def test_rough_surfaces_end_where_the_grid_ends(force):
    """The edge of a part of a larger surface is in doubt; where it is set back, it is not."""
    n, h = 128, 2.0 / 128
    gap = surfaces.rough((n, n), (h, h), rms=0.01, longest=0.5, seed=1)
    result = said(lambda: pressed(gap, (h, h), Material.from_shear(0.7, 0.3), force=force))
    assert_doubts(result, f"{EDGE} x and y")
    gap[0] = gap[-1] = gap[:, 0] = gap[:, -1] = 0.3
    assert_doubts(said(lambda: pressed(gap, (h, h), Material.from_shear(0.7, 0.3), force=force)))


def test_punches_are_silent():
    x, y = surfaces.centres((40, 30), (0.01, 0.01))
    disc = np.where(np.hypot(x, y) < 0.1, 0.0, 0.05)  # A step beside a contact is no slope in it.
    for gap in (0.0 * x, 1e-4 * x - 2e-4 * y, x**2 / (2 * R), disc, np.full(x.shape, 3.0)):
        result = said(lambda gap=gap: pressed(gap, force=50.0))
        assert gap is disc or result.contact[:, 0].any()
        assert_doubts(result)
    assert_doubts(said(lambda: pressed(np.zeros(20), 0.01)))


def test_bodies_apart_are_silent_unless_the_gap_is_strange():
    assert_doubts(said(lambda: pressed(sphere(), approach=-1.0)))
    assert_doubts(said(lambda: pressed(sphere(unit=1e3), approach=-1.0)), DEEP, STEEP)


def test_where_a_bound_ends_is_no_matter():
    (x,) = surfaces.centres(20, 0.1)
    arguments = {"element": 0.1, "material": Material.from_shear(1.0, 0.3)}
    assert_doubts(said(lambda: friction(bound=np.sqrt(1 - x**2), shift=0.01, **arguments)))
    assert_doubts(said(lambda: friction(bound=np.full(20, np.inf), shift=0.01, **arguments)))
    assert_doubts(said(lambda: friction(bound=np.zeros(20), shift=0.01, **arguments)))


# Unlike materials -----------------------------------------------------------------------------

RUBBER = Material.from_shear(3.0, 0.45)


def test_friction_of_unlike_materials_leaves_the_coupling_out():
    g = np.full((12, 12), 0.3)
    unlike = halfspace.combined_material(STEEL, RUBBER)
    for material in (unlike, pickle.loads(pickle.dumps(unlike)), copy.deepcopy(unlike)):
        arguments = {"element": (0.1, 0.1), "material": material}
        shifted = said(lambda a=arguments: friction(bound=g, shift=(1e-3, 0.0), **a))
        assert_doubts(shifted, f"{UNLIKE} (difference parameter -0.05)")
        assert_doubts(said(lambda a=arguments: rolling(bound=g, lateral=1e-3, **a)), UNLIKE)
    # Without friction there is nothing to couple with.
    assert_doubts(said(lambda: pressed(np.zeros((12, 12)), material=unlike, force=1e-3)))


def test_friction_of_like_materials_is_not_coupled():
    g = np.full((12, 12), 0.3)
    incompressible = Material.from_shear(3.0, 0.5), Material.from_shear(1.0, 0.5)
    alike = STEEL, Material.from_shear(82001.0, 0.28)
    for bodies in ((STEEL, STEEL), incompressible, alike):
        case = {"bound": g, "element": (0.1, 0.1)}
        case["material"] = halfspace.combined_material(*bodies)
        assert_doubts(said(lambda c=case: friction(**c, shift=(1e-3, 0.0))))


# How it is said -------------------------------------------------------------------------------


def test_steps_warn_once_and_all_have_it():
    g, material = np.full(5, 0.3), Material.from_shear(1.0, 0.3)
    arguments = {"element": 0.1, "material": material, "longitudinal": 0.1}
    with pytest.warns(ContactWarning) as caught:
        results = list(rolling_steps(bound=g, steps=3, **arguments))
    assert len(caught) == 1
    assert caught[0].filename == __file__
    for result in results:
        assert_doubts(result, f"{COARSE} 5 elements across")


def test_an_error_has_the_doubts_and_is_an_error():
    with pytest.raises(ContactError) as error:  # No warning comes, though those are errors here.
        normal_contact(
            sphere(unit=1e3), (0.01, 0.01), material=STEEL, force=1.0, max_products=1, nested=False
        )
    assert any(doubt.startswith(DEEP) for doubt in error.value.result.warnings)


@pytest.mark.parametrize(
    "options", [["hertz", "-n", "8"], ["shift", "-n", "8"], ["rolling", "-n", "8"], ["hertz"]]
)
def test_the_command_line_says_what_the_results_say(options, tmp_path, capsys):
    path = tmp_path / "x.npz"
    assert main(["contact", *options, "-o", str(path)]) == 0
    printed = capsys.readouterr()
    notes = [line for line in printed.out.splitlines() if line.startswith("note: ")]
    with np.load(path) as fields:
        n, element = len(fields["contact"]), tuple(fields["element"])
    gap = surfaces.sphere((n, n), element, radius=10.0)
    assert notes == [f"note: {doubt}" for doubt in said(lambda: pressed(gap, element)).warnings]
    assert len(notes) == (n == 8)
    assert "Warning" not in printed.err


CALLS = {
    "normal_contact": "normal_contact(gap, (1.0, 1.0), material=STEEL, force=100.0)",
    "load_curve": "next(load_curve(gap, (1.0, 1.0), material=STEEL, forces=[100.0]))",
    "friction": "friction(bound=bound, element=(1.0, 1.0), material=STEEL, shift=(1e-3, 0.0))",
    "rolling": "rolling(bound=bound, element=(1.0, 1.0), material=STEEL, lateral=1e-3)",
    "frictional_contact": (
        "frictional_contact(gap, (1.0, 1.0), material=STEEL, mu=0.1, force=100.0)"
    ),
}


@pytest.mark.parametrize("name", CALLS)
def test_a_warning_is_of_the_line_that_calls_the_function(name):
    """Neither of the package, nor of what calls that line."""
    bound = np.zeros((12, 12))
    bound[4:6, 4:8] = 0.3
    functions = normal_contact, load_curve, friction, rolling, frictional_contact
    given = {function.__name__: function for function in functions}
    given |= {"gap": surfaces.sphere((12, 12), (1.0, 1.0), radius=10.0), "bound": bound}
    with pytest.warns(ContactWarning) as caught:
        exec(compile(CALLS[name], "the user's file", "exec"), given | {"STEEL": STEEL})
    assert {warning.filename for warning in caught} == {"the user's file"}
