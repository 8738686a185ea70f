"""What the results of contact problems say: derived quantities, their names, and that they stay."""

import json
import pickle
from copy import copy, deepcopy
from dataclasses import FrozenInstanceError, fields, replace
from xml.etree import ElementTree

import numpy as np
import pytest
from numpy.testing import assert_allclose

from toeplitz_mg.contact import (
    ContactError,
    ContactResult,
    Material,
    NormalResult,
    TangentialResult,
    creep_curve,
    friction,
    frictional_contact,
    normal_contact,
    rolling,
    subsurface_stresses,
    surfaces,
)

SOFT = Material.from_shear(0.7, 0.3)  # Of both bodies: E* = 1.
H = (2.0 / 48, 2.0 / 32)


def press(force=0.1, **options):
    gap = surfaces.sphere((48, 32), H, radius=1.0)
    return normal_contact(gap, H, material=SOFT, force=force, **options)


def press_line(force=0.2):
    return normal_contact(surfaces.cylinder(64, 0.03, radius=1.0), 0.03, material=SOFT, force=force)


SPHERE = surfaces.sphere((32, 32), (0.05, 0.05), radius=1.0), (0.05, 0.05)


def press_unlike(surface, force, previous=None):
    bodies = Material(E=2.0, nu=0.1), Material.rigid()
    return frictional_contact(*surface, material=bodies, mu=0.2, force=force, previous=previous)


PRESSED, PRESSED_LINE = press(), press_line()
SHIFTED = friction(PRESSED, mu=0.3, force=(0.01, 0.005))
ROLLED = rolling(PRESSED, mu=0.3, longitudinal=1e-2, spin=0.01)
SHIFTED_LINE = friction(PRESSED_LINE, mu=0.3, shift=0.01)
ROLLED_LINE = rolling(PRESSED_LINE, mu=0.3, longitudinal=1e-2)
ALL = (PRESSED, PRESSED_LINE, SHIFTED, ROLLED, SHIFTED_LINE, ROLLED_LINE)
BOTH = press_unlike(SPHERE, 0.1, press_unlike(SPHERE, 0.05))
CURVE = creep_curve(PRESSED, mu=0.3, longitudinal=[-0.01, 0.02], tolerance=1e-4, max_products=100)
STRESSES = subsurface_stresses(PRESSED, depths=[0.1, 0.3, 0.4])
FROZEN = (*ALL, BOTH.before, CURVE, STRESSES)


def arrays(result):
    """Yield all arrays of a result."""
    for field in fields(result):
        value = getattr(result, field.name)
        for x in value if isinstance(value, tuple) else (value,):
            if isinstance(x, np.ndarray):
                yield x


@pytest.mark.parametrize("result", ALL)
def test_fields_have_the_shape_of_the_grid(result):
    assert isinstance(result, ContactResult)
    assert result.contact.shape == result.shape
    assert len(result.x) == result.shape[0]
    assert_allclose(np.diff(result.x), result.element[0], rtol=1e-12)
    assert_allclose(result.x.sum(), 0.0, atol=1e-12)
    if len(result.shape) == 1:
        assert result.y is None
    else:
        assert len(result.y) == result.shape[1]
        assert_allclose(np.diff(result.y), result.element[1], rtol=1e-12)
    assert_allclose(result.contact_fraction, result.contact.mean(), rtol=1e-12)
    assert_allclose(result.area, result.contact.sum() * np.prod(result.element), rtol=1e-12)


@pytest.mark.parametrize("result", [PRESSED, PRESSED_LINE])
def test_pressures_have_a_mean_and_a_largest_one(result):
    assert result.traction is result.pressure is result.magnitude
    assert result.rigid == result.approach
    assert result.max_pressure == result.pressure.max()
    assert_allclose(result.mean_pressure, result.pressure[result.contact].mean(), rtol=1e-9)


def test_friction_has_a_shift_and_rolling_has_creepages():
    for result in (SHIFTED, SHIFTED_LINE):
        assert result.creepages is None
        assert result.rigid is result.shift
        assert_allclose(result.stick_area, result.stick.sum() * np.prod(result.element), rtol=1e-12)
    for result in (ROLLED, ROLLED_LINE):
        assert result.shift is None
        assert result.rigid is result.creepages


def test_the_energy_is_the_work_of_the_load():
    """The energy of a Hertzian contact is 2/5 F δ, as F grows with δ to the power of 3/2."""
    assert_allclose(PRESSED.energy, 0.4 * PRESSED.force * PRESSED.approach, rtol=5e-3)
    # Were nothing to slide, the energy would be that of a spring.
    bonded = friction(PRESSED, mu=np.inf, shift=(0.01, 0.0))
    assert_allclose(bonded.energy, 0.5 * bonded.force[0] * 0.01, rtol=1e-6)


@pytest.mark.parametrize("result", [ROLLED, ROLLED_LINE])
def test_the_energy_of_rolling_is_that_of_its_displacements(result):
    work = (result.traction * result.displacement).sum() * np.prod(result.element)
    assert_allclose(result.energy, 0.5 * work, rtol=1e-12)


@pytest.mark.filterwarnings("ignore::toeplitz_mg.contact.ContactWarning")
def test_contact_at_an_edge_is_told():
    assert not PRESSED.touches_edge
    assert not SHIFTED.touches_edge
    assert press(force=3.0).touches_edge
    bound = np.zeros(40)
    bound[:20] = 1.0
    assert friction(bound=bound, element=0.1, material=SOFT, shift=0.01).touches_edge


def test_nothing_in_contact_has_no_mean():
    apart = normal_contact(np.ones((8, 8)), (1.0, 1.0), material=SOFT, approach=0.5)
    assert apart.mean_pressure == apart.contact_fraction == apart.energy == 0.0


@pytest.mark.parametrize("result", FROZEN)
def test_nothing_of_a_result_can_be_written_nor_of_a_copy(result):
    for again in (result, copy(result), deepcopy(result), pickle.loads(pickle.dumps(result))):
        for one, x in zip(arrays(result), arrays(again), strict=True):
            assert np.array_equal(x, one)
            assert not x.flags.writeable
    name = fields(result)[-1].name
    with pytest.raises(FrozenInstanceError):
        setattr(result, name, 0.0)


def test_an_array_of_the_user_stays_his():
    bound = np.full((16, 16), 0.5)
    bound[0] = 0.0
    shift = np.zeros((2, 16, 16))
    friction(bound=bound, element=(0.1, 0.1), material=SOFT, shift=shift)
    bound[3, 3] = shift[0, 3, 3] = 1.0


def test_results_are_equal_to_themselves_alone():
    """A comparison of arrays would have no answer; and results can be in a set."""
    for result in FROZEN:
        assert result == result
        assert result != copy(result)
    assert len({*FROZEN}) == len(FROZEN)


def test_each_has_the_names_of_the_other():
    for result in ALL:
        for name in ("traction", "rigid", "gap", "slip", "stick", "sliding", "bound", "magnitude"):
            assert hasattr(result, name)
    assert PRESSED.slip is PRESSED.stick is PRESSED.sliding is PRESSED.bound is None
    assert SHIFTED.gap is None
    assert isinstance(PRESSED, NormalResult)
    assert isinstance(ROLLED, TangentialResult)


# Units and signs --------------------------------------------------------------------------------


def solve_all(L, F):
    """The results above, of problems whose lengths are L times as long, and forces F times."""
    soft, h, width = Material.from_shear(0.7 * F / L**2, 0.3), (L * H[0], L * H[1]), 0.03 * L
    gap, line = surfaces.sphere((48, 32), h, radius=L), surfaces.cylinder(64, width, radius=L)
    pressed = normal_contact(gap, h, material=soft, force=0.1 * F, hardness=0.25 * F / L**2)
    pressed_line = normal_contact(line, width, material=soft, force=0.2 * F / L)
    creepages = {"longitudinal": 1e-2, "spin": 0.01 / L}
    return (
        pressed,
        pressed_line,
        friction(pressed, mu=0.3, force=(0.01 * F, 0.005 * F)),
        rolling(bound=0.3 * pressed.pressure, element=h, material=soft, **creepages),
        friction(pressed_line, mu=0.3, shift=0.01 * L),
        rolling(bound=0.3 * pressed_line.pressure, element=width, material=soft, longitudinal=1e-2),
        normal_contact(gap, h, material=soft, force=0.1 * F, periodic=True),
    )


# Powers of N and of mm in each unit.
POWERS = {"1": (0, 0), "1/mm": (0, -1), "mm": (0, 1), "mm²": (0, 2), "N": (1, 0), "N mm": (1, 1)}
POWERS |= {"N/mm": (1, -1), "N/mm²": (1, -2)}
OF_NO_SIZE = {"material", "shape", "touches_edge", "periodic"}
COSTS = {"products", "work", "iterations", "residual", "warnings"}


def test_all_that_a_result_has_changes_as_its_unit(tmp_path):
    """By powers of two, so that no digit changes but the exponent."""
    L, F, path = 2.0**7, 2.0**-9, tmp_path / "x.npz"
    for one, other in zip(solve_all(1.0, 1.0), solve_all(L, F), strict=True):
        one.save(path, overwrite=True)
        with np.load(path) as file:
            units = json.loads(str(file["about"]))["units"]
        for field in fields(one):
            is_there = getattr(one, field.name) is not None
            assert field.name in {*units, *OF_NO_SIZE, *COSTS} or not is_there
        units |= {"contact_fraction": "1"}
        if isinstance(one, NormalResult):
            stiffness = "N/mm²" if len(one.element) == 1 else "N/mm"
            units |= {"mean_pressure": "N/mm²", "stiffness": stiffness}
        for name in units.keys() - {"centres"}:
            powers = [POWERS[unit] for unit in units[name].split(", ")]
            factors = np.array([F**a * L**b for a, b in powers])
            expected = np.multiply(getattr(one, name), factors if len(factors) > 1 else factors[0])
            rounding = 1e-12 * np.abs(expected).max()
            assert_allclose(getattr(other, name), expected, rtol=1e-9, atol=rounding, err_msg=name)


def test_signs():
    assert PRESSED.pressure.min() == 0.0
    assert PRESSED.gap.min() >= -1e-8 * PRESSED.approach
    for result in (PRESSED, PRESSED_LINE):
        assert min(result.force, result.approach, result.stiffness, result.energy) > 0.0
    # Tractions, their sum and the shift point one way; slip is against them.
    assert_allclose(SHIFTED.force, (0.01, 0.005))
    assert (np.asarray(SHIFTED.shift) > 0.0).all()
    assert SHIFTED_LINE.force > 0.0
    for result in (SHIFTED, ROLLED):
        work = (result.slip * result.traction).sum(axis=0)
        assert work.max() <= 1e-7 * np.abs(work).max()
        assert (work < 0.0)[result.sliding].any()
    # A body that turns too slowly is pulled back; a spin turns against itself.
    assert ROLLED.force[0] < 0.0
    assert ROLLED_LINE.force < 0.0
    assert ROLLED.moment * ROLLED.creepages[2] < 0.0
    assert_allclose(
        ROLLED.power, -(ROLLED.force @ ROLLED.creepages[:2]) - ROLLED.moment * ROLLED.creepages[2]
    )


# In words -------------------------------------------------------------------------------------


def test_a_repr_is_one_short_line():
    assert repr(PRESSED).startswith("<NormalResult 48 x 32: force 0.1 N, approach 0.177")
    assert repr(ROLLED_LINE).startswith("<TangentialResult 64: force -0.00")
    for result in ALL:
        assert len(repr(result)) < 130
        assert "\n" not in repr(result)


def test_a_summary_has_figures_with_units():
    lines = PRESSED.summary().splitlines()[1:]
    found = {line[2:20].strip(): line[20:] for line in lines}
    assert PRESSED.summary().startswith("Normal contact, 48 x 32 elements of 0.041667 x 0.0625 mm")
    assert [*found][:4] == ["force", "approach", "stiffness", "contact"]
    assert found["force"] == "0.1 N"
    assert found["contact"] == f"{PRESSED.area:.5g} mm²"
    assert found["share of the grid"] == f"{100.0 * PRESSED.contact.mean():.5g} %"
    assert found["mean pressure"] == f"{PRESSED.pressure[PRESSED.contact].mean():.5g} N/mm²"
    assert found["largest pressure"] == f"{PRESSED.pressure.max():.5g} N/mm²"
    assert found["stiffness"] == f"{PRESSED.stiffness:.5g} N/mm"
    for text in ("0.2 N/mm", "1.02 mm\n", f"{PRESSED_LINE.energy:.5g} N\n"):  # Per length.
        assert text in PRESSED_LINE.summary()


def test_a_summary_tells_what_moves():
    assert "spin              0.01 1/mm" in ROLLED.summary()
    assert "creepages         (0.01, 0)\n" in ROLLED.summary()
    assert "shift             0.01 mm" in SHIFTED_LINE.summary()
    for bound in (0.3 * PRESSED.pressure, np.zeros((1, 1))):
        field = friction(bound=bound, element=H, material=SOFT, shift=np.zeros((2, *bound.shape)))
        assert "shift             a field\n" in field.summary()


def test_warnings_are_in_the_summary():
    doubtful = replace(PRESSED, warnings=("a contact < 10 elements",))
    assert doubtful.summary().endswith("\n  warning: a contact < 10 elements")
    assert "a contact &lt; 10 elements" in doubtful._repr_html_()


@pytest.mark.parametrize("result", ALL)
def test_a_notebook_shows_a_short_table(result):
    table = ElementTree.fromstring(result._repr_html_())
    assert 6 <= len(table.findall("tr")) <= 12
    for row in table.findall("tr"):
        assert row.find("th").text
        assert row.find("td").text


def test_a_notebook_shows_both_results_of_contact_with_friction():
    tables = ElementTree.fromstring(f"<all>{BOTH._repr_html_()}</all>").findall("table")
    assert len(tables) == 3
    rows = [row for table in tables for row in table.findall("tr")]
    energies = [row.find("td").text for row in rows if row.find("th").text == "elastic energy"]
    assert energies == [f"{BOTH.energy:.5g} N mm"]
    assert repr(BOTH) == f"<FrictionalResult: {BOTH.normal!r}, {BOTH.tangential!r}>"
    assert all(row.find("td").text in BOTH.summary() for row in rows)


def test_an_error_of_another_process_has_its_result():
    with pytest.raises(ContactError) as caught:
        press(max_products=1)
    again = pickle.loads(pickle.dumps(caught.value))
    assert str(again) == str(caught.value)
    assert np.array_equal(again.result.pressure, caught.value.result.pressure)


def test_what_is_infinite_is_not_told_as_nothing():
    wave = 1e-6 * np.cos(2.0 * np.pi * np.arange(16) / 16)
    full = normal_contact(wave, 1.0 / 16, material=SOFT, force=0.1, periodic=True)
    assert full.stiffness == np.inf
    assert "stiffness         inf N/mm" in full.summary()


def test_an_element_is_the_same_but_for_rounding():
    """A length over a number of pixels is not what one types."""
    element = (H[0] * (1.0 + 4e-16), H[1])
    assert element != H
    case = {"material": SOFT, "force": (0.01, 0.0)}
    again = friction(bound=0.3 * PRESSED.pressure, element=element, previous=SHIFTED, **case)
    assert_allclose(again.force, (0.01, 0.0), atol=1e-12)
    gap = surfaces.sphere((48, 32), H, radius=1.0)
    assert normal_contact(gap, element, material=SOFT, force=0.1, previous=PRESSED).products


def test_one_product_is_one():
    assert repr(replace(PRESSED, products=1)).endswith("; 1 product>")
    several = replace(PRESSED, products=2, residual=1e-9).summary()
    assert "solved by         2 products, violation 1.0e-09\n" in several + "\n"


@pytest.mark.parametrize(("small", "shown"), [(1e-9, "1e-09"), (1e-11, "0")])
def test_only_what_is_rounding_beside_the_largest_is_shown_as_zero(small, shown):
    shifted = friction(PRESSED, mu=0.3, force=(0.01, small))
    assert f"force             (0.01, {shown}) N\n" in shifted.summary()


# As input ---------------------------------------------------------------------------------------


def test_what_contradicts_the_fields_is_refused():
    """No copy has a wrong number: what follows from the fields does, or is refused by name."""
    for result, changes in (
        (PRESSED, {"pressure": 2.0 * PRESSED.pressure, "area": 0.0, "gap": PRESSED.gap + np.inf}),
        *((PRESSED, {"pressure": PRESSED.pressure + x}) for x in (np.nan, np.inf, -1.0)),
        (PRESSED, {"force": 1.0, "approach": np.nan, "energy": "a", "shape": (32, 48)}),
        (PRESSED, {"touches_edge": True, "max_pressure": 1.0, "contact": ~PRESSED.contact}),
        (SHIFTED, {"stick_area": 0.1, "moment": 1.0, "slip": -SHIFTED.slip, "stick": np.ones(3)}),
        (ROLLED, {"shift": 1.0, "creepages": 1j, "bound": -ROLLED.bound, "periodic": (1, 0)}),
        (BOTH, {"tangential": SHIFTED, "normal": None, "residuals": (), "before": 1}),
        (CURVE, {"stick_share": 2.0 + CURVE.stick_share, "moment": 1.0, "force": CURVE.power}),
        (STRESSES, {"body": "third", "depths": -STRESSES.depths, "components": np.zeros(6)}),
    ):
        for name, value in changes.items():
            with pytest.raises((ValueError, TypeError), match=name if name != "slip" else "power"):
                replace(result, **{name: value})


def test_a_stiffness_is_of_its_own_bodies_and_pressures():
    assert replace(PRESSED, warnings=("a",)).stiffness == PRESSED.stiffness
    assert replace(PRESSED, periodic=(True, True)).stiffness is None
    assert replace(PRESSED, material=BOTH.normal.material).stiffness is None
