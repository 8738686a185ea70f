"""Curves of forces over creepages, loads and steps: points, tables, pictures and files."""

import functools

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.systems import cells_of, refuses
from tests.test_friction import semi_ellipse
from tests.test_rolling import MU, A, circle
from toeplitz_mg import contact
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
    refuses(ValueError, "has shape .* numbers, or arrays", creep_curve, **case, **creepages)
    message = "are numbers, but at least one must be an array"
    refuses(ValueError, message, creep_curve, **case, longitudinal=0.1)
    refuses(
        ValueError, "are empty, but a curve needs a point", creep_curve, **case, longitudinal=[]
    )


def line_curve():
    h = 2 * A / 40
    g = MU * A / 2 * semi_ellipse(surfaces.centres(44, h)[0], A)
    return creep_curve(bound=g, element=h, material=BODY, longitudinal=[-0.02, -0.05, -0.1])


def surface_curve():
    g, alone = circle(16, (0.05, 0.02, 0.1))
    case = {"element": alone.element, "material": BODY}
    return creep_curve(bound=g, **case, lateral=[0.01, 0.02], spin=0.1)


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
    pytest.importorskip("pandas")
    table, scaled = curve.to_dataframe(), curve.to_dataframe(friction=2.0)
    names = [name for name in table if name.startswith("force")]
    assert_allclose(scaled[names], -table[names] / 2.0)
    assert_allclose(table[names].T, forces)
    assert [table.attrs["units"][name] for name in names] == [unit] * len(forces)


@pytest.mark.parametrize("make", [line_curve, surface_curve])
def test_a_curve_is_told_by_its_first_and_its_last_point(make):
    curve = make()
    assert repr(curve).startswith(f"<CreepCurve {len(curve.force)} points: creepages ")
    assert "\n" not in repr(curve)
    cells = cells_of(curve)
    assert cells["stick_share"].endswith(f" to {curve.stick_share[-1]:.5g}")
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


# Loads and steps ----------------------------------------------------------------------------------

H = 0.005
SPHERE = {"gap": surfaces.sphere((40, 40), (H, H), radius=0.1), "element": (H, H), "material": BODY}
PRESSED = normal_contact(**SPHERE, force=1e-3)
PRESS = functools.partial(contact.load_curve, **SPHERE, forces=[2e-4, 4e-4, 8e-4])
ROLL = functools.partial(contact.rolling_steps, PRESSED, mu=0.3, steps=3, longitudinal=-0.01)


@pytest.mark.parametrize("make", [PRESS, ROLL])
def test_a_curve_computes_what_is_asked_for_and_that_once(make):
    reports = []
    curve = make(progress=lambda *now: reports.append(now))
    assert not reports
    first, cost = next(curve), len(reports)
    assert "1 of 3 points" in repr(curve) + curve.summary()
    rest = list(curve)
    assert len(reports) > cost > 0
    reports.clear()
    assert all(a is b for a, b in zip(curve, [first, *rest], strict=True))
    assert next(curve, None) is None
    assert not reports


@pytest.mark.parametrize("make", [PRESS, ROLL])
def test_a_curve_is_a_table_a_dataset_and_a_file_of_its_results(make, tmp_path):
    pytest.importorskip("xarray")
    curve, results, bare = make(), list(make()), make(keep=False)
    table, fields = curve.to_dataframe(), curve.to_xarray()
    force = "force" if make is PRESS else "force_x"
    assert table[force].tolist() == [np.ravel(result.force)[0] for result in results]
    assert table.products.tolist() == [result.products for result in results]
    curve.save(tmp_path / "x.npz")
    again = contact.load(tmp_path / "x.npz")
    field = "pressure" if make is PRESS else "traction"
    for values in ([getattr(one, field) for one in again], fields[field]):
        assert np.array_equal(values, [result.traction for result in results])
    for same in (again.to_dataframe(), fields[[*table]].to_dataframe(), bare.to_dataframe()):
        assert same.equals(table)
    for call in (bare.to_xarray, lambda: bare.save(tmp_path / "y.npz"), lambda: next(bare)):
        refuses(ValueError, "use keep=True", call)


def test_a_load_curve_has_the_exponent_of_hertz_and_steps_their_creepages():
    curve, figure = PRESS(), pytest.importorskip("matplotlib.figure").Figure()
    (line, *_) = curve.plot(curve.plot(figure.subplots())).lines
    assert_allclose(
        np.diff(np.log(line.get_ydata())), 1.5 * np.diff(np.log(line.get_xdata())), 0.02
    )
    refuses(ValueError, "a load curve has no tangential forces", curve.plot, friction=1.0)
    ax = ROLL(longitudinal=0.0, force=(1e-4, 0.0)).plot(figure.add_subplot())
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("distance [µm]", "creepage [–]")
    assert_allclose(ax.lines[0].get_xdata(), H * np.arange(1, 4))


def test_a_load_that_fails_comes_after_those_that_do_not_and_fails_again():
    curve = contact.load_curve(**SPHERE, forces=[0.0, 1e-3], max_products=2)
    assert next(curve).force == 0.0
    refuses(contact.ContactError, "products the conditions of contact", next, curve)
    refuses(RuntimeError, "no more than 1 of 2 points are there, as .*ContactError", curve.plot)
