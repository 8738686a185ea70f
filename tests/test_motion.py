"""Rolling by force, moment and fields of slip: the same contacts as by creepage."""

import pickle
from itertools import product
from math import prod

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.budgets import assert_within_budget
from tests.systems import refuses
from tests.test_friction import assert_coulomb, doubtful, semi_ellipse
from tests.test_rolling import MU, NAMES, A, assert_rolls, circle
from toeplitz_mg.contact import (
    ContactError,
    ContactWarning,
    Material,
    friction,
    normal_contact,
    rolling,
    rolling_steps,
    surfaces,
)
from toeplitz_mg.halfspace import influence_matrix

CREEPAGES = [
    (0.1, 0.0, 0.0),
    (0.02, 0.0, 0.0),
    (0.0, 0.1, 0.0),
    (0.0, 0.0, 0.3),
    (0.02, 0.04, -0.1),
]
BODY = Material.from_shear(0.7, 0.3)  # Of line contact: G/(1-ν) = 1.


def line(n, **arguments):
    h = 2 * A / n
    (x,) = surfaces.centres(n + n // 2, h)
    g = MU * A / 2 * semi_ellipse(x, A)
    return x, g, rolling(bound=g, element=h, **({"material": BODY} | arguments))


def moment_of(result):
    """The moment about the middle, with the arm half an element behind: slip is that far ahead."""
    x, y = surfaces.centres(result.contact.shape, result.element)
    qx, qy = result.traction
    h1, h2 = result.element
    return float(((x - h1 / 2) * qy - y * qx).sum() * h1 * h2)


@doubtful
@pytest.mark.parametrize("creepages", CREEPAGES)
@pytest.mark.parametrize("n", [11, 24, 64])
def test_the_force_of_creepages_has_these_creepages(n, creepages):
    g, by_creepage = circle(n, creepages)
    force, spin = by_creepage.force, creepages[2]
    for loads, given in (
        ({"force": force}, (0.0, 0.0, spin)),
        ({"force": (force[0], None)}, (0.0, *creepages[1:])),
        ({"force": (None, force[1])}, (creepages[0], 0.0, spin)),
        ({"moment": moment_of(by_creepage)}, (*creepages[:2], 0.0)),
        ({"force": force, "moment": moment_of(by_creepage)}, (0.0, 0.0, 0.0)),
    ):
        _, result = circle(n, given, **loads)
        assert result.residual <= 1e-8
        assert_allclose(result.rigid, creepages, atol=1e-6 * np.abs(creepages).max())
        assert_allclose(result.force, force, atol=1e-7 * np.linalg.norm(force))
        assert_allclose(result.traction, by_creepage.traction, atol=1e-6 * g.max())
        assert result.products <= 2.5 * by_creepage.products


def test_moment_and_power_of_rolling():
    creepages, x, y = np.array([0.02, 0.04, -0.1]), 0.3, -0.2
    field = np.zeros((2, 48, 48))
    field[0] = 0.01
    _, result = circle(48, creepages)
    (Fx, Fy), M = result.force, moment_of(result)
    assert_allclose(result.moment, M, rtol=1e-12)
    assert_allclose(result.power, -(0.02 * Fx + 0.04 * Fy - 0.1 * M), rtol=1e-12)
    # About another pole the moment is another, and the power of the same slip is the same.
    _, about_pole = circle(48, creepages + np.array([0.1 * y, -0.1 * x, 0.0]), pole=(x, y))
    assert_allclose(about_pole.traction, result.traction, atol=1e-7 * result.bound.max())
    assert_allclose(about_pole.moment, M - x * Fy + y * Fx, rtol=1e-6)
    assert_allclose(about_pole.power, result.power, rtol=1e-6)
    _, by_field = circle(48, creepages - np.array([0.01, 0.0, 0.0]), slip=field)
    assert_allclose(by_field.power, result.power, rtol=1e-6)
    dissipated = -(result.traction * result.slip).sum() * (2 / 48) ** 2
    assert_allclose(result.power, dissipated, rtol=0.2)


def test_a_field_of_slip_is_what_the_creepages_are():
    creepages = np.array([0.02, 0.04, -0.1])
    x, y = surfaces.centres((32, 32), (2 / 32, 2 / 32))
    field = np.stack(np.broadcast_arrays(0.02 + 0.1 * y, 0.04 - 0.1 * x))
    g, by_creepages = circle(32, creepages)
    _, by_field = circle(32, (0.0, 0.0, 0.0), slip=field)
    _, by_both = circle(32, creepages / 2, slip=field / 2)
    _, by_force = circle(32, (0.0, 0.0, 0.0), slip=field, force=by_creepages.force)
    for result in (by_field, by_both, by_force):
        assert_allclose(result.traction, by_creepages.traction, atol=1e-7 * g.max())
        assert_allclose(result.slip, by_creepages.slip, atol=1e-7)
        assert_allclose(result.power, by_creepages.power, rtol=1e-6)
    assert_allclose(by_force.rigid, 0.0, atol=1e-8)


def test_lateral_creepage_of_a_line_without_compression_is_longitudinal():
    # For ν = 0 shear along the strips and across them is the same, in any direction.
    body = Material.from_shear(1.0, 0.0)
    _, g, along = line(100, longitudinal=-0.05, material=body)
    for angle in (0.0, 0.3, np.pi / 2):
        n = np.array([np.cos(angle), np.sin(angle)])
        creepages = dict(zip(NAMES, -0.05 * n, strict=False))
        _, _, result = line(100, material=body, **creepages)
        expected = along.traction if angle == 0.0 else n[:, None] * along.traction
        assert_allclose(result.traction, expected, atol=1e-7 * g.max())
        assert_allclose(result.slip.reshape(-1, 150)[0], n[0] * along.slip, atol=1e-8)


def test_in_line_contact_one_component_goes_with_two():
    """A guess, or tractions before, along x alone are of no lateral component, and go on so."""
    _, g, driven = line(20, longitudinal=-0.1)
    case = {"element": driven.element[0], "material": BODY}
    led = rolling(bound=g, lateral=-0.05, **case)
    along_x = np.stack([driven.traction, np.zeros(len(g))])
    atol = 1e-7 * g.max()
    guessed = rolling(bound=g, longitudinal=-0.1, guess=led, **case)
    assert_allclose(guessed.traction, along_x, atol=atol)
    assert_allclose(
        rolling(bound=g, lateral=-0.05, guess=driven, **case).traction, led.traction, atol=atol
    )
    at_rest = friction(bound=g, force=0.3 * driven.force, **case)
    for before, asked, steady in (
        (at_rest, {"lateral": -0.05}, led.traction),
        (led, {"longitudinal": -0.1}, along_x),
    ):
        *_, last = rolling_steps(bound=g, steps=100, previous=before, **asked, **case)
        assert_allclose(last.traction, steady, atol=1e-3 * g.max())
    halted = friction(bound=g, force=0.0, previous=led, **case)
    assert_allclose(halted.force, 0.0, atol=1e-12)
    shift, field = np.zeros(2), np.zeros((2, len(g)))
    for given in (0.0, shift, np.zeros(len(g)), field):
        kept = friction(bound=g, shift=given, previous=led, **case)
        assert_allclose(kept.traction, led.traction, atol=atol)
        assert np.shape(kept.shift) in (shift.shape, field.shape)


def test_a_longitudinal_field_of_slip_beside_lateral_creepage_is_longitudinal():
    x, g, _ = line(40, longitudinal=-0.1)
    case = {"element": 2 * A / 40, "material": BODY, "lateral": 0.05}
    along_x = rolling(bound=g, slip=0.1 * x, **case)
    both = rolling(bound=g, slip=np.stack([0.1 * x, 0.0 * x]), **case)
    assert np.array_equal(along_x.traction, both.traction)


def test_carter_is_softer_along_the_strips():
    # Antiplane shear has 1/G where plane strain has (1-ν)/G.
    _, g, across = line(200, longitudinal=-0.07)
    _, _, along = line(200, lateral=-0.07 / 0.7)
    assert_allclose(along.traction[0], 0.0, atol=1e-12)
    assert_allclose(along.traction[1], across.traction, atol=1e-6 * g.max())
    _, _, by_force = line(200, force=(0.0, along.force[1]))
    assert_allclose(by_force.rigid, along.rigid, atol=1e-8)


@pytest.mark.parametrize(
    ("solve", "load"),
    [
        (rolling, {"longitudinal": 0.02, "lateral": -0.03}),
        (friction, {"force": (0.02, -0.03)}),
        (friction, {"shift": (0.0, 0.05)}),
    ],
)
def test_strips_are_a_grid_of_one_column(solve, load):
    (x,) = surfaces.centres(20, 0.1)
    g, case = semi_ellipse(x, 0.9), {"element": (0.1, 3.0), "material": BODY} | load
    strips, grid = solve(bound=g, **case), solve(bound=g[:, None], **case)
    assert_allclose(strips.traction, grid.traction[..., 0], atol=1e-7)
    assert_allclose(strips.force, grid.force, atol=1e-6)
    assert_allclose(strips.rigid[:2], grid.rigid[:2], atol=1e-7)


def test_a_force_begins_to_creep():
    # From Cattaneo's tractions at rest to Carter's, in twice the length of the contact.
    n, force = 28, 0.5 * MU * np.pi * A**2 / 4
    _, g, steady = line(n, force=force)
    case = {"element": 2 * A / n, "material": BODY, "force": force}
    at_rest = friction(bound=g, **case)
    steps = list(rolling_steps(bound=g, steps=2 * n, previous=at_rest, **case))
    creepages = np.array([step.rigid for step in steps])
    assert_allclose([step.force for step in steps], force, rtol=1e-9)
    assert np.abs(creepages[0] - steady.rigid) > 0.1 * abs(steady.rigid)
    assert_allclose(creepages[-1], steady.rigid, rtol=1e-2)
    assert_allclose(steps[-1].traction, steady.traction, atol=1e-2 * g.max())


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"force": (0.1, 0.0), "longitudinal": 0.1}, "longitudinal is 0.1 and the force along x"),
        ({"moment": 0.1, "spin": 0.1}, "spin is 0.1 and the moment is 0.1"),
        ({"force": 0.1}, r"force is 0.1, but must be \(Fx, Fy\)"),
        ({"force": (np.nan, 0.0)}, "the force along x is nan"),
        ({"force": (3.0, 4.0)}, r"force is .*, of size 5, but friction carries at most 2\.5"),
        ({"moment": 9.0}, "moment is of size 9, but must be less than"),
        ({"slip": np.zeros((5, 5))}, r"slip has shape \(5, 5\), but must have \(2, 5, 5\)"),
        ({"slip": np.full((2, 5, 5), np.inf)}, "slip has values that are not finite"),
        ({"pole": 1.0}, r"pole is 1.0, but must be \(x, y\)"),
    ],
)
def test_refuses_what_makes_no_sense(change, message):
    with pytest.raises(ValueError, match=message):
        rolling(bound=np.full((5, 5), 0.1), element=(1.0, 1.0), material=BODY, **change)


@pytest.mark.parametrize("given", [(True, True), (True, False), (False, True)])
def test_steps_by_a_force_are_steps_by_the_creepages_that_belong_to_it(given):
    creepages = (0.03, -0.02, 0.1)
    g, result = circle(16, creepages)
    wanted = [float(0.8 * F) if by else None for F, by in zip(result.force, given, strict=True)]
    case = {"element": result.element, "material": Material.from_shear(1.0, 0.25)}
    free = {
        name: 0.0 if by else value
        for name, value, by in zip(NAMES, creepages, (*given, False), strict=True)
    }
    mixed = list(rolling_steps(bound=g, steps=2, previous=result, force=wanted, **free, **case))
    for step, before in zip(mixed, [result, mixed[0]], strict=True):
        for force, found, creepage, asked in zip(
            wanted, step.force, step.rigid[:2], creepages[:2], strict=True
        ):
            if force is None:
                assert creepage == asked
            else:
                assert_allclose(found, force, rtol=1e-9)
        by_creepage = dict(zip(NAMES, step.rigid.tolist(), strict=True))
        (again,) = rolling_steps(bound=g, steps=1, previous=before, **by_creepage, **case)
        assert_allclose(again.traction, step.traction, atol=1e-6 * g.max())


@doubtful
def test_all_products_of_a_direct_solution_count():
    told = []
    _, result = circle(11, CREEPAGES[-1], progress=lambda products, _: told.append(products))
    assert result.products == told[-1] + 1 > 3


@doubtful
def test_cases_that_differ_in_one_thing_only_are_each_solved_for_what_they_are():
    """One after the other: what is kept of the one before is not taken for that of the next."""
    for n, nu, h2 in product((10, 12), (0.1, 0.4), (0.1, 0.2)):
        x, y = surfaces.centres((n, n), (0.1, 0.1))
        body, element = Material.from_shear(1.0, nu), (0.1, h2)
        pressed = normal_contact(x**2 + y**2, element, material=body, approach=0.1)
        A = influence_matrix("z", (n, n), element, body)
        u = (A @ pressed.pressure.ravel()).reshape(n, n)
        assert_allclose((x**2 + y**2 + u)[pressed.contact] - pressed.approach, 0.0, atol=1e-7)
        moved = friction(pressed, mu=0.3, force=(0.1 * pressed.force, 0.0))
        rolled = rolling(pressed, mu=0.3, longitudinal=0.1, spin=0.1)
        assert_coulomb(moved, body)
        assert_rolls(rolled, body)
        assert max(len(pickle.dumps(result)) for result in (moved, rolled)) < 20_000


@doubtful
@pytest.mark.parametrize(("shape", "seed"), [((9, 7), 0), ((5, 12), 1)])
def test_few_bonded_elements_roll_by_a_force_as_exactly_as_a_dense_solution(shape, seed):
    """Without slip it is one linear system, with the creepages: of any tolerance, all digits."""
    h, force = (0.3, 0.2), [0.3, -0.1]
    bound = np.where(np.random.default_rng(seed).random(shape) < 0.8, np.inf, 0.0)
    moves = np.tile(bound.ravel() > 0.0, 2)
    A, S = (
        influence_matrix("xy", shape, h, BODY, ahead=ahead).toarray()[np.ix_(moves, moves)]
        for ahead in (0, 1)
    )
    units = np.kron(np.eye(2), np.ones((len(A) // 2, 1)))
    system = np.block([[A - S, h[0] * units], [h[0] * h[1] * units.T, np.zeros((2, 2))]])
    *tractions, longitudinal, lateral = np.linalg.solve(system, [*np.zeros(len(A)), *force])
    creepages = {"longitudinal": longitudinal, "lateral": lateral}
    close = {"rtol": 0.0, "atol": 1e-10 * np.abs(tractions).max()}
    for given in ({"force": force}, creepages):
        result = rolling(bound=bound, element=h, material=BODY, tolerance=1e-5, **given)
        assert_allclose(result.traction.ravel()[moves], tractions, **close)
        assert_allclose(result.creepages, (longitudinal, lateral, 0.0), rtol=1e-10)


def test_no_force_is_no_creepage():
    g, result = circle(24, (0.0, 0.0, 0.0), force=(0.0, 0.0), moment=0.0)
    assert_allclose(result.rigid, 0.0, atol=1e-12)
    assert_allclose(result.traction, 0.0, atol=1e-9 * g.max())
    for shape, element, force in (((4, 5), (1.0, 1.0), (0.0, 0.0)), ((8,), 0.1, 0.0)):
        apart = {"bound": np.zeros(shape), "element": element, "material": BODY, "force": force}
        assert_allclose(rolling(**apart).rigid, 0.0)
        for step in rolling_steps(**apart, steps=2):
            assert not step.traction.any()


@pytest.mark.parametrize("angle", range(0, 360, 45))
def test_elements_that_bear_next_to_nothing_do_not_spoil_a_force(angle):
    """What carries the loads is in proportion to the bound there, so that they need not turn."""
    g, _ = circle(24, (0.0, 0.0, 0.0))
    edge = (g == 0.0) & (np.roll(g, 1, 0) + np.roll(g, 1, 1) + np.roll(g, -1, 1) > 0.0)
    g = np.where(edge, 1e-5 * g.max(), g)
    case = {"element": (2.0 / 24,) * 2, "material": Material.from_shear(1.0, 0.25), "spin": 0.3}
    carried = 0.6 * g.sum() * (2.0 / 24) ** 2
    force = carried * np.cos(np.radians(angle)), carried * np.sin(np.radians(angle))
    result = rolling(bound=g, force=force, **case)
    case_name = "rolling by force, elements that bear next to nothing"
    assert_within_budget(case_name, products=result.products)
    assert_allclose(result.force, force, atol=1e-8 * carried)
    assert_rolls(result, case["material"])


@pytest.mark.parametrize("loads", [{"moment": 1e-4}, {"moment": 1e-4, "force": (0.01, None)}])
def test_no_spin_about_the_only_element_gives_a_moment(loads):
    """It slips nothing there; about any other pole it does."""
    g = np.zeros((9, 9))
    g[4, 4] = 100.0
    for pole in ((0.0, 0.0), (0.0, 1e-17)):  # As the centre of an element may be rounded.
        with pytest.raises(ValueError, match="makes nothing in the contact slip"):
            rolling(bound=g, element=(0.02, 0.02), material=BODY, pole=pole, **loads)
    with pytest.warns(ContactWarning, match="only 1 element across"):
        result = rolling(bound=g, element=(0.02, 0.02), material=BODY, pole=(0.02, 0.0), **loads)
    assert_allclose(result.moment, 1e-4, rtol=1e-6)


@pytest.mark.parametrize("lateral", [{"force": (0.0, 0.01)}, {"lateral": 0.01}])
def test_creepages_and_loads_without_an_answer_are_refused(lateral):
    """Slip is half an element ahead of the tractions, whose lateral force has a moment by that."""
    g = np.zeros((9, 9))
    g[4, 4] = 100.0
    with pytest.raises(ValueError, match=r"moment is 0, but a spin .* makes nothing in the"):
        rolling(bound=g, element=(0.02, 0.02), material=BODY, moment=0.0, **lateral)
    case = {"element": (0.1, 0.1), "material": BODY}
    for name in NAMES:
        rule = rf"{name} is -1e\+16, but must be at most 1e\+15"
        refuses(ValueError, rule, rolling, bound=np.full((12, 12), 0.3), **case, **{name: -1e16})
    rule = "no tractions in the contact have these forces"
    for seed in range(10):
        F, g = np.random.default_rng(seed).uniform(-0.006, 0.006, 2), np.zeros((5, 5))
        g[2, 2] = 1.0
        loads = {"force": F, "moment": 1e-5, "pole": (0.35, 0.35)}
        refuses(ValueError, rule, rolling, bound=g, **case, **loads)


@doubtful
@pytest.mark.parametrize("seed", range(20))
def test_one_element_carries_a_force_with_the_moment_that_it_has_there(seed):
    """The three loads depend on each other, and so do their creepages, of which any will do."""
    rng = np.random.default_rng(seed)
    g, h, pole = np.zeros((9, 9)), 0.1, rng.uniform(-0.4, 0.4, 2)
    g[4, 4] = 1.0
    force = rng.uniform(-0.6, 0.6, 2) * h**2
    moment = -(pole[0] + h / 2) * force[1] + pole[1] * force[0]
    for given in (force, (force[0], None)):
        result = rolling(
            bound=g, element=(h, h), material=BODY, force=given, moment=moment, pole=tuple(pole)
        )
        assert_allclose(result.force, force, rtol=0.0, atol=1e-6 * h**2)
        assert_allclose(result.moment, moment, rtol=0.0, atol=1e-6 * h**2)
        assert result.stick.sum() == 1
        assert_within_budget("one element by loads, and a moment", products=result.products)


@pytest.mark.parametrize("shape", [(12,), (11, 10)])
def test_a_force_that_is_all_that_is_carried_lets_all_slide(shape):
    g = np.linspace(0.1, 0.3, prod(shape)).reshape(shape)
    most = g.sum() if len(shape) == 1 else g.sum() * np.array([0.6, -0.8])
    with pytest.warns(ContactWarning, match="all that friction carries"):
        rolled = rolling(bound=g, element=(1.0, 1.0), material=BODY, force=most)
    shifted = friction(bound=g, element=(1.0, 1.0), material=BODY, force=most)
    assert_allclose(rolled.traction, shifted.traction, rtol=1e-14)
    assert not rolled.stick.any()
    assert np.isnan(np.ravel(rolled.creepages)[: np.size(most)]).all()
    assert "nan" in rolled.summary()
    for function in (rolling, friction):
        with pytest.raises(ValueError, match="the bodies would slide off"):
            function(bound=g, element=(1.0, 1.0), material=BODY, force=1.001 * most)


@pytest.mark.parametrize("shape", [(9,), (5, 4)])
def test_steps_refuse_all_that_the_bound_carries_before_any_work(shape):
    g = np.full(shape, 0.25)
    force = 0.25 * g.size if len(shape) == 1 else (0.25 * g.size, 0.0)  # μP exactly.
    case = {"bound": g, "element": (1.0, 1.0), "material": BODY, "steps": 1}
    for part in (1.0, 2.0):
        load = {"force": np.multiply(part, force)}
        refuses(ValueError, "the most that friction carries", rolling_steps, **case, **load)


@pytest.mark.parametrize("part", [0.98, 1.02])
def test_loads_together_are_refused_beyond_what_slides(part):
    """Those of any creepages without end are the most that is carried in their proportion."""
    g, sliding = circle(24, (2e3, -1e3, 5e3))
    case = {"element": sliding.element, "material": Material.from_shear(1.0, 0.25)}
    loads = {"force": tuple(part * sliding.force), "moment": part * sliding.moment}
    if part < 1.0:
        assert_rolls(rolling(bound=g, **loads, **case), case["material"])
    else:
        with pytest.raises(ValueError, match=r"the loads together are 1\.02 times what"):
            rolling(bound=g, **loads, **case)


@doubtful
@pytest.mark.parametrize("distance", [0.2, 0.5])
def test_loads_that_drag_each_other_along_are_refused_together(distance):
    """A force beside the pole brings a moment, beyond what the tractions about it can undo."""
    n, h = 48, 0.04
    x, y = surfaces.centres((n, n), (h, h))
    r = np.hypot(x, y - distance)
    g = MU * semi_ellipse(r, 0.16)
    carried = float(g.sum()) * h**2
    with pytest.raises(ValueError, match="the loads together are"):
        rolling(bound=g, element=(h, h), material=BODY, force=(0.5 * carried, 0.0), moment=0.0)
    # About the middle of the contact the same loads are carried, and little elsewhere too.
    about = {"force": (0.5 * carried, 0.0), "moment": 0.0, "pole": (0.0, distance)}
    little = {"force": (0.1 * carried, 0.0), "moment": 0.0}
    for loads in (about, little):
        result = rolling(bound=g, element=(h, h), material=BODY, **loads)
        assert_allclose(result.force, loads["force"], atol=1e-7 * carried)
        assert abs(result.moment) <= 1e-7 * carried


def roll_asymmetric(length=1.0, modulus=1.0, side=1.0):
    """Roll without any symmetry, in other units or mirrored: all digits stay, and some signs."""
    n, h = 24, 0.05
    x, y = surfaces.centres((n, n), (h, h))
    y = side * y
    g = modulus * MU * semi_ellipse(np.hypot(x / 0.5, y / 0.4), 1.0) * (1.0 + 0.3 * x + 0.5 * y)
    carried = float(g.sum()) * (length * h) ** 2
    result = rolling(
        bound=g,
        element=(length * h, length * h),
        material=Material.from_shear(modulus * BODY.G, BODY.nu),
        force=(0.4 * carried, side * -0.2 * carried),
        moment=side * 0.02 * carried * length,
        pole=(0.1 * length, side * -0.05 * length),
        slip=1e-3 * MU * np.stack([x + 0.0 * y, side * x * y]),
    )
    return g, result


@pytest.mark.parametrize(("length", "modulus"), [(1e3, 1.0), (1.0, 1e6), (1e-3, 1e-3)])
def test_units_of_loads_moment_power_pole_and_slip(length, modulus):
    (g, result), (_, scaled) = roll_asymmetric(), roll_asymmetric(length, modulus)
    of_force = modulus * length**2
    assert_allclose(scaled.traction / modulus, result.traction, rtol=1e-6, atol=1e-6 * g.max())
    assert_allclose(scaled.creepages * [1.0, 1.0, length], result.creepages, rtol=1e-5)
    assert_allclose(scaled.slip, result.slip, rtol=0.0, atol=1e-6 * np.abs(result.slip).max())
    assert_allclose(scaled.force / of_force, result.force, rtol=1e-6)
    assert_allclose(scaled.moment / (of_force * length), result.moment, rtol=1e-6)
    assert_allclose(scaled.power / of_force, result.power, rtol=1e-5)
    assert result.power > 0.0


def test_signs_where_everything_is_mirrored():
    """What is lateral, spins or turns changes its sign, and nothing else."""
    (g, result), (_, mirrored) = roll_asymmetric(), roll_asymmetric(side=-1.0)
    signs = np.array([1.0, -1.0])[:, None, None]
    close = {"rtol": 0.0, "atol": 1e-6 * g.max()}
    assert_allclose(mirrored.traction[:, :, ::-1], signs * result.traction, **close)
    assert_allclose(mirrored.creepages, result.creepages * [1.0, -1.0, -1.0], rtol=1e-5)
    assert_allclose(mirrored.moment, -result.moment, rtol=1e-6)
    assert_allclose(mirrored.power, result.power, rtol=1e-5)


@doubtful
@pytest.mark.parametrize("n", [8, 24])
def test_a_moment_that_no_spin_gives_is_refused(n):
    """Its arm ends half an element behind: a spin about there needs a lateral creepage."""
    h = 1.0 / n
    x, y = surfaces.centres((n, n), (h, h))
    g = MU * semi_ellipse(np.hypot(x, y), 0.5)
    most = float((g * np.hypot(x, y)).sum()) * h**2
    for moment in (1.001 * most, -1.001 * most):
        with pytest.raises(ValueError, match="with the creepages that are given"):
            rolling(bound=g, element=(h, h), material=BODY, moment=moment)
    for moment in (0.99 * most, -0.99 * most):
        assert_allclose(
            rolling(bound=g, element=(h, h), material=BODY, moment=moment).moment, moment, rtol=1e-6
        )
    for lateral in (0.1 * n, -0.1 * n):
        moment = np.sign(lateral) * 1.001 * most
        found = rolling(bound=g, element=(h, h), material=BODY, moment=moment, lateral=lateral)
        assert_allclose(found.moment, moment, rtol=1e-6)


def test_a_moment_beside_much_of_a_lateral_force_is_doubted_and_what_is_reached_is_said():
    h, g = 0.05, MU * semi_ellipse(np.hypot(*surfaces.centres((24, 24), (0.05, 0.05))), 0.5)
    with pytest.warns(ContactWarning, match="half an element times the lateral force"):
        found = rolling(bound=g, element=(h, h), material=BODY, lateral=1.0, moment=0.0)
    assert sum(doubt.startswith("the moment is 0, but") for doubt in found.warnings) == 1
    other = rolling(bound=g, element=(h, h), material=BODY, longitudinal=1.0, moment=0.0)
    assert not any(doubt.startswith("the moment") for doubt in other.warnings)
    loads = {"force": (0.5 * float(g.sum()) * h**2, 0.0), "moment": 0.01}
    with pytest.raises(ContactError, match=r"of the force .* it has .*; of the moment"):
        rolling(bound=g, element=(h, h), material=BODY, max_products=2, **loads)


def test_the_power_of_a_field_is_that_of_the_same_spin_where_the_contact_reaches_the_edge():
    """The slip half an element behind the first one is that of the line through the others."""
    n, h, spin = 12, 0.1, 0.3
    g = np.full((n, n), 0.3)
    x, y = surfaces.centres((n, n), (h, h))
    by_spin = rolling(bound=g, element=(h, h), material=BODY, spin=spin)
    by_field = rolling(
        bound=g, element=(h, h), material=BODY, slip=spin * np.stack([-y + 0 * x, x + 0 * y])
    )
    assert_allclose(by_field.traction, by_spin.traction, atol=1e-6 * g.max())
    assert_allclose(by_field.power, by_spin.power, rtol=1e-6)


@pytest.mark.parametrize("size", [0.01, 1 / 3, 7.0])
@pytest.mark.parametrize("n", [16, 40])
def test_bodies_that_need_not_slip_carry_nothing(n, size):
    """What creepages leave of such a field is its rounding, of which nothing is to be solved."""
    h = (2 * A / n, 2 * A / n)
    x, y = np.broadcast_arrays(*surfaces.centres((n, n), h))
    g, body = MU * A * semi_ellipse(np.hypot(x, y), A), Material.from_shear(1.0, 0.25)
    uniform, spin = np.stack([np.ones_like(x), 0 * x]), np.stack([-y, x])
    for field, loads, undone in (
        (uniform, {"force": (0.0, 0.0)}, (-size, 0.0, 0.0)),
        (uniform, {"longitudinal": -size}, (-size, 0.0, 0.0)),
        (spin, {"moment": 0.0}, (0.0, 0.0, -size)),
        (spin + uniform, {"moment": 0.0, "force": (0.0, 0.0)}, (-size, 0.0, -size)),
        (spin + uniform, {"spin": -size, "force": (0.0, None)}, (-size, 0.0, -size)),
    ):
        result = rolling(bound=g, element=h, material=body, slip=size * field, **loads)
        assert_allclose(result.creepages, undone, atol=1e-12 * size)
        assert np.abs(result.traction).max() <= 1e-9 * size
