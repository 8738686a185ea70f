"""Friction: Cattaneo and Mindlin, Coulomb's law for any load, bonded bodies, histories."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from tests.budgets import assert_within_budget
from toeplitz_mg.contact import (
    ContactError,
    FrictionalResult,
    Material,
    friction,
    normal_contact,
    problems,
    surfaces,
)
from toeplitz_mg.halfspace import influence_matrix

MU, A = 0.3, 0.6
BODY = Material.from_shear(1.0, 0.3)

# Tests of what is solved, on grids that are meant to be small or strange.
doubtful = pytest.mark.filterwarnings("ignore::toeplitz_mg.contact.ContactWarning")


def semi_ellipse(r, a):
    return np.sqrt(np.maximum(0.0, 1 - (r / a) ** 2))


def line(n, **arguments):
    """A Hertzian line contact on [-1, 1], R = 1, G/(1-ν) = 1: its bound g, and friction."""
    (x,) = surfaces.centres(n, 2.0 / n)
    g = MU * A / 2 * semi_ellipse(x, A)
    body = Material.from_shear(0.7, 0.3)
    return x, g, friction(bound=g, element=2.0 / n, material=body, **arguments)


def circle(n, nu, **arguments):
    """A Hertzian circular contact on [-1, 1]², R = 1, G = 1 - ν."""
    x, y = surfaces.centres((n, n), (2.0 / n, 2.0 / n))
    r, material = np.hypot(x, y), Material.from_shear(1.0 - nu, nu)
    g = MU * 2 * A / np.pi * semi_ellipse(r, A)
    return r, g, friction(bound=g, element=(2.0 / n, 2.0 / n), material=material, **arguments)


def assert_areas(result):
    """The tractions are within their bound, and on it where the bodies slide."""
    assert np.isfinite(result.traction).all()
    assert (result.magnitude <= result.bound).all()
    assert not (result.stick & result.sliding).any()
    assert np.array_equal(result.stick | result.sliding, result.contact)
    assert np.array_equal(result.contact, result.bound > 0.0)
    slide = result.sliding
    assert_allclose(result.magnitude[slide], result.bound[slide], rtol=1e-12)


def assert_slip(result, u, slip, scale):
    """What the result says is what its tractions do; it obeys Eq. 2 and 3 up to this scale."""
    m, contact = len(u), result.contact
    q, own_slip, own_u = (
        a.reshape(m, *contact.shape) for a in (result.traction, result.slip, result.displacement)
    )
    force = np.prod(result.element) * q.reshape(m, -1).sum(axis=1)
    rounding = 1e-10 * np.abs(force).max() + 1e-14 * np.abs(q).sum() * np.prod(result.element)
    assert_allclose(np.atleast_1d(result.force), force, rtol=0.0, atol=rounding)
    assert_allclose(own_u, np.where(contact, u, 0.0), rtol=0.0, atol=scale)
    assert_allclose(own_slip, np.where(contact, slip, 0.0), rtol=0.0, atol=scale)
    assert np.abs(slip[:, result.stick]).max(initial=0.0) <= scale
    n = q[:, result.sliding] / result.magnitude[result.sliding]
    against = (slip[:, result.sliding] * n).sum(axis=0)
    assert against.max(initial=0.0) <= scale
    assert np.abs(slip[:, result.sliding] - against * n).max(initial=0.0) <= scale


def assert_coulomb(result, material, previous=None, tolerance=1e-8):
    """Equations 2 and 3 hold for the displacements of the tractions."""
    assert_areas(result)
    assert result.residual <= tolerance
    shape = result.contact.shape
    m = len(shape)
    A = influence_matrix("xy"[:m], shape, result.element, material)

    def displacement(traction):
        return (A @ traction.ravel()).reshape(m, *shape)

    rigid = np.atleast_1d(result.rigid)
    rigid = rigid.reshape(m, *((1,) * m if rigid.size == m else shape))
    u = displacement(result.traction)
    before = np.zeros_like(u) if previous is None else displacement(previous.traction)
    largest = np.abs((before + rigid) * result.contact).max(initial=np.abs(before).max())
    assert_slip(result, u, u - before - rigid, 1.01 * np.sqrt(m) * tolerance * largest)


# Theory -------------------------------------------------------------------------------------


def test_cattaneo_in_line_contact():
    part = 0.6
    c = A * np.sqrt(1 - part)
    errors = []
    for n in (64, 256, 1024):
        x, g, result = line(n, force=part * MU * np.pi * A**2 / 4)
        assert_coulomb(result, Material.from_shear(0.7, 0.3))
        assert_allclose(result.force, part * MU * np.pi * A**2 / 4, rtol=1e-9)
        assert abs(result.stick.sum() * 2.0 / n - 2 * c) <= 4.0 / n
        theory = MU * A / 2 * (semi_ellipse(x, A) - c / A * semi_ellipse(x, c))
        errors.append(np.sqrt(np.mean((result.traction - theory) ** 2)) / g.max())
    assert errors[0] < 0.01
    assert errors[2] < errors[1] / 2 < errors[0] / 4


def test_cattaneo_and_mindlin_in_a_circle():
    c = 0.4
    theory_of = {0.0: 1e-3, 0.28: 1.3e-2}  # Mindlin's traction is exact for ν = 0 alone.
    for nu, error in theory_of.items():
        force = MU * 4 / 3 * A**3 * (1 - (c / A) ** 3)
        r, g, result = circle(128, nu, force=(force, 0.0))
        assert_coulomb(result, Material.from_shear(1.0 - nu, nu))
        assert_allclose(result.force, [force, 0.0], rtol=1e-9, atol=1e-9 * force)
        assert abs(np.sqrt(result.stick.sum() * (2 / 128) ** 2 / np.pi) - c) < 2 / 128
        theory = MU * 2 * A / np.pi * (semi_ellipse(r, A) - c / A * semi_ellipse(r, c))
        assert np.sqrt(np.mean((result.traction[0] - theory) ** 2)) < max(error, 4e-3) * g.max()
        # δ = μ (a² - c²)/R · (2 - ν)/(2 (1 - ν)), with E* = 1
        assert_allclose(result.rigid[0], MU * (A**2 - c**2) * (2 - nu) / (2 * (1 - nu)), rtol=2e-3)


@pytest.mark.parametrize("nu", [0.0, 0.28])
def test_without_coupling_the_traction_follows_the_shift(nu):
    _, g, result = circle(64, nu, shift=(0.04, 0.03))
    angle = result.traction[1] * 4 - result.traction[0] * 3
    assert_coulomb(result, Material.from_shear(1.0 - nu, nu))
    assert (np.abs(angle).max() < 1e-6 * g.max()) == (nu == 0.0)


@pytest.mark.parametrize("nu", [0.0, 0.28])
def test_products_in_a_circle(nu):
    shift = MU * (A**2 - 0.4**2) * (2 - nu) / (2 * (1 - nu))
    for n in (128, 256):
        _, _, result = circle(n, nu, shift=(shift, 0.0))
        assert_within_budget(
            f"friction in a circle, nu = {nu}, n = {n}",
            products=result.products,
            work_units=result.work,
        )


@doubtful  # A rough surface reaches the edge of its grid.
@pytest.mark.parametrize("nu", [0.0, 0.28])
def test_products_for_a_rough_surface(nu):
    n, h, force, material = 256, 2.0 / 256, 0.2, Material.from_shear(1.0 - nu, nu)
    gap = surfaces.rough((n, n), (h, h), rms=0.01, longest=0.5, shortest=4 * h, seed=1)
    g = MU * normal_contact(gap, (h, h), material=material, force=force).traction
    result = friction(bound=g, element=(h, h), material=material, force=(0.7 * MU * force, 0.0))
    assert_coulomb(result, material)
    assert_within_budget(f"friction on a rough surface, nu = {nu}", products=result.products)


@pytest.mark.parametrize("n", [512, 2048, 8192])
def test_products_in_line_contact(n):
    _, _, by_force = line(n, force=0.6 * MU * np.pi * A**2 / 4)
    _, _, by_shift = line(n, shift=by_force.rigid)
    for result in (by_force, by_shift):
        assert_within_budget(f"friction in line contact, n = {n}", products=result.products)
    assert_allclose(by_shift.force, by_force.force, rtol=1e-5)


# Of a normal result ---------------------------------------------------------------------------


def pressed_line(n=64):
    gap = surfaces.centres(n, 2.0 / n)[0] ** 2 / 2
    return normal_contact(gap, 2.0 / n, material=Material.from_shear(0.7, 0.3), force=0.28)


def pressed_sphere(n=48, nu=0.3):
    x, y = surfaces.centres((n, n), (2.0 / n, 2.0 / n))
    steel = Material.from_shear(1.0 - nu, nu)
    return normal_contact((x**2 + y**2) / 2, (2.0 / n, 2.0 / n), material=steel, force=0.28)


@pytest.mark.parametrize("pressed", [pressed_line(), pressed_sphere()], ids=["line", "sphere"])
def test_a_normal_result_has_the_bound_the_elements_and_the_material(pressed):
    rng = np.random.default_rng(7)
    force = 0.05 if pressed.contact.ndim == 1 else (0.05, 0.02)
    for mu in (0.4, rng.uniform(0.3, 0.5, pressed.shape)):
        bodies = {"element": pressed.element, "material": pressed.material}
        expected = friction(bound=mu * pressed.pressure, **bodies, force=force)
        result = friction(pressed, mu=mu, force=force)
        assert np.array_equal(result.traction, expected.traction)
    bonded = friction(pressed, mu=np.inf, force=force)
    assert np.array_equal(bonded.stick, pressed.contact)
    assert np.array_equal(np.isinf(bonded.bound), pressed.contact)


@pytest.mark.parametrize("pressed", [pressed_line(), pressed_sphere()], ids=["line", "sphere"])
@pytest.mark.parametrize("rounding", [1.0 - 1e-15, 1.0, 1.0 + 1e-15])
def test_a_force_of_all_that_the_bound_carries_lets_all_slide(pressed, rounding):
    is_line = pressed.contact.ndim == 1
    n = np.ones(1) if is_line else np.array([0.6, -0.8])
    force = 0.3 * pressed.force * rounding * n
    before = friction(pressed, mu=0.3, force=-0.5 * force[0] if is_line else -0.5 * force[::-1])
    for previous in (None, before):
        result = friction(pressed, mu=0.3, force=force, previous=previous)
        q = result.traction.reshape(len(n), *pressed.shape)
        assert_areas(result)
        assert not result.stick.any()
        assert_allclose(result.force, force, rtol=1e-12)
        assert_allclose(q, np.multiply.outer(n, 0.3 * pressed.pressure), rtol=1e-12, atol=1e-15)
        # The slip is against the traction, and zero in the element that was the last to slide.
        slip = result.slip.reshape(q.shape)
        against = np.tensordot(n, slip, 1)
        assert_allclose(slip, np.multiply.outer(n, against), atol=1e-15)
        assert against.max() <= 0.0
        assert against[result.contact].max() == 0.0
        # Displacements are given in contact only.
        assert not result.displacement.reshape(q.shape)[:, ~result.contact].any()


@pytest.mark.parametrize(
    ("pressed", "power"), [(pressed_line(), 1 / 2), (pressed_sphere(nu=0.0), 2 / 3)]
)
def test_the_shift_of_all_sliding_is_the_limit_of_that_of_almost_all(pressed, power):
    # Without coupling of x and y the shift falls short by (1 - F/μP)^power, in plane strain with a
    # logarithm, up to what elements of this size resolve.
    most = 0.3 * pressed.force
    n = 1.0 if pressed.contact.ndim == 1 else np.array([1.0, 0.0])
    full = friction(pressed, mu=0.3, force=most * n)
    for missing in (1e-1, 1e-2, 1e-3):
        almost = friction(pressed, mu=0.3, force=(1.0 - missing) * most * n)
        apart = np.max(np.abs(full.shift - almost.shift)) / np.max(np.abs(full.shift))
        assert apart < 2.0 * missing**power
    assert apart > 0.0


def test_shifts_add_up_over_a_history():
    pressed = pressed_sphere(24)
    a = friction(pressed, mu=0.3, force=(0.04, 0.01))
    b = friction(pressed, mu=0.3, force=(-0.02, 0.03), previous=a)
    field = np.zeros((2, 24, 24)) + 0.01
    c = friction(pressed, mu=0.3, shift=field, previous=b)
    assert_allclose(a.total_shift, a.shift)
    assert_allclose(b.total_shift, a.shift + b.shift)
    assert_allclose(c.total_shift, (a.shift + b.shift)[:, None, None] + field)
    # Without slip only the sum counts.
    bonded = friction(pressed, mu=np.inf, force=(0.04, 0.01))
    back = friction(pressed, mu=np.inf, force=(0.0, 0.0), previous=bonded)
    assert_allclose(back.total_shift, 0.0, atol=1e-7 * np.abs(bonded.shift).max())
    line = pressed_line()
    first = friction(line, mu=0.3, shift=0.01)
    second = friction(line, mu=0.3, shift=np.full(64, 0.005), previous=first)
    assert_allclose(second.total_shift, 0.015)


# The paper ----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["test1", "test2", "test3"])
def test_bonded_bodies_are_the_papers_problem(name):
    problem = getattr(problems, name)(300)
    A = problem.A
    mask = np.ones(300, bool) if A.shape == (300, 300) else A.mask
    shift = np.zeros(300)
    shift[mask] = problem.b
    bound = np.where(mask, np.inf, 0.0)
    result = friction(
        bound=bound, element=(problem.h, 100.0), material=problem.material, shift=shift
    )
    assert_allclose(result.traction[mask], np.linalg.solve(A.toarray(), problem.b), rtol=1e-5)
    assert not result.traction[~mask].any()
    assert np.array_equal(result.stick, mask)
    column = friction(  # It is in three dimensions, one element across.
        bound=bound[:, None], element=(problem.h, 100.0), material=problem.material,
        shift=np.stack([shift[:, None], np.zeros((300, 1))]),
    )  # fmt: skip
    assert_allclose(column.traction[0, :, 0], result.traction, rtol=1e-4, atol=1e-6)
    assert not column.traction[1].any()


# Any problem --------------------------------------------------------------------------------


@doubtful
@given(
    seed=st.integers(0, 2**32 - 1),
    shape=st.one_of(
        st.tuples(st.integers(1, 90)), st.tuples(st.integers(1, 36), st.integers(1, 36))
    ),
    nu=st.floats(-0.9, 0.5),
    mu=st.floats(1e-3, 3.0),
    load=st.floats(1e-4, 3.0),
    part=st.just(0.0) | st.floats(1e-9, 0.999),
    is_force=st.booleans(),
)
@settings(max_examples=60, deadline=None)
def test_coulombs_law_for_any_load_and_history(seed, shape, nu, mu, load, part, is_force):
    rng = np.random.default_rng(seed)
    G, h = 10.0 ** rng.uniform(-1, 5), 10.0 ** rng.uniform(-3, 1)
    element, material = (h, h * 10 ** rng.uniform(-1, 1)), Material.from_shear(G, nu)
    case = {"element": element, "material": material}
    contact = normal_contact(h * rng.random(shape), approach=h * rng.uniform(0.2, 2.0), **case)
    g = mu * contact.traction
    if not g.any():
        return
    angle = rng.uniform(0, 2 * np.pi)
    direction = np.array([np.cos(angle), np.sin(angle)])[: len(shape)]
    if is_force:
        force = direction * part * g.sum() * np.prod(element)
        result = friction(bound=g, force=force, **case)
        assert_allclose(result.force, force, rtol=1e-8, atol=1e-8 * np.abs(force).max())
    else:
        result = friction(bound=g, shift=direction * load * h, **case)
    assert_coulomb(result, material)
    g = g * rng.uniform(0.5, 1.5)  # The pressure changes, and comes back.
    shift = -rng.uniform(0, 2) * direction * load * h
    assert_coulomb(friction(bound=g, shift=shift, previous=result, **case), material, result)


# Histories ----------------------------------------------------------------------------------


def test_unloading_is_loading_backwards_with_twice_the_bound():
    # Mindlin and Deresiewicz (1953): exact for the discrete problem in one component too.
    full = MU * np.pi * A**2 / 4
    _, g, loaded = line(200, force=0.7 * full, tolerance=1e-11)
    case = {"element": 0.01, "material": Material.from_shear(0.7, 0.3), "tolerance": 1e-11}
    unloaded = friction(bound=g, force=0.1 * full, previous=loaded, **case)
    reverse = friction(bound=2 * g, force=0.6 * full, **case)
    assert_allclose(unloaded.traction, loaded.traction - reverse.traction, atol=1e-7 * g.max())


def test_nothing_moves_without_a_load():
    _, g, loaded = circle(24, 0.3, shift=(0.05, 0.02))
    case = {"material": Material.from_shear(0.7, 0.3), "shift": (0.0, 0.0)}
    again = friction(bound=g, element=loaded.element, previous=loaded, **case)
    assert_allclose(again.traction, loaded.traction, atol=1e-6 * g.max())
    still = friction(bound=g, element=loaded.element, **case)
    assert not still.traction.any()
    assert still.stick.sum() == (g > 0).sum()
    frictionless = friction(bound=0.0 * g, element=loaded.element, **(case | {"shift": (1.0, 0.0)}))
    assert not frictionless.traction.any()
    assert not frictionless.contact.any()


@pytest.mark.parametrize("is_line", [True, False])
@pytest.mark.parametrize("most", [np.inf, 200.0, 20.0, 6.0])
def test_a_contact_that_shrinks_keeps_nothing_outside(is_line, most):
    # The elements that leave the contact carry nothing, whether the others stick or not.
    shape, element = ((40,), 0.1) if is_line else ((24, 20), (0.1, 0.1))
    material = BODY
    r = np.sqrt(sum(x**2 for x in surfaces.centres(shape, element)))
    force = 10.0 if is_line else (6.0, 2.0)
    before = friction(
        bound=np.where(r < 0.9, most, 0.0), element=element, material=material, force=force
    )
    smaller = np.where(r < 0.6, 2.0 * most, 0.0)
    after = friction(
        bound=smaller, element=element, material=material, force=force, previous=before
    )
    assert_coulomb(after, material, before)
    assert_allclose(after.force, force, rtol=1e-10)
    assert (most < 7.0) == after.sliding.any()


@pytest.mark.parametrize("shape", [(40,), (24, 20)])
@pytest.mark.parametrize("seed", [1, 2])
def test_bodies_that_shift_back_to_where_they_were_carry_nothing(shape, seed):
    """Their violation is relative to the displacements before, of which nothing is left."""
    shift = np.random.default_rng(seed).standard_normal(len(shape))
    case = {"element": (0.1,) * len(shape), "material": BODY}
    g = np.full(shape, np.inf)
    there = friction(bound=g, shift=shift, **case)
    back = friction(bound=g, shift=-shift, previous=there, **case)
    assert_allclose(back.traction, 0.0, atol=1e-6 * np.abs(there.traction).max())
    assert_allclose(back.total_shift, 0.0, atol=1e-15)
    assert back.products < 1.5 * there.products + 5


@doubtful
@pytest.mark.parametrize("shape", [(60,), (14, 8)])
def test_a_bound_that_falls_far_below_the_tractions(shape):
    rng = np.random.default_rng(2)
    element, material = (0.1,) * len(shape), BODY
    for ratio in (1.5, 10.0, 100.0):
        g = np.maximum(0.0, rng.random(shape) - 0.3)
        force = 0.9 * g.sum() * np.prod(element) * np.eye(len(shape))
        before = friction(
            bound=ratio * g, element=element, material=material, force=0.9 * ratio * force[0]
        )
        after = friction(
            bound=g, element=element, material=material, force=-0.5 * force[-1], previous=before
        )
        assert_coulomb(after, material, before)
        assert_allclose(after.force, -0.5 * force[-1], rtol=1e-10, atol=1e-10)
        case = f"friction, a bound that falls far, {len(shape)} axes"
        assert_within_budget(case, products=after.products)


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("missing", [1e-2, 1e-4, 1e-6])
@pytest.mark.parametrize("decades", [0, 10])
def test_almost_all_slides(seed, missing, decades):
    rng = np.random.default_rng(seed)
    g = 10.0 ** rng.uniform(-decades, 0, (13, 11))
    element, material = (0.1, 0.1), Material.from_shear(1.0, 0.49)
    before = friction(
        bound=rng.random(g.shape), element=element, material=material, shift=(0.03, 0.01)
    )
    force = (1.0 - missing) * 0.01 * g.sum() * np.array([0.6, -0.8])
    after = friction(bound=g, element=element, material=material, force=force, previous=before)
    assert_coulomb(after, material, before)
    assert_allclose(after.force, force, rtol=1e-10)
    case = f"friction where almost all slides, {decades} decades"
    assert_within_budget(case, products=after.products)


@doubtful
def test_tiny_bounds_are_no_contact():
    """Those below 1e-15 of the largest."""
    g = np.random.default_rng(0).uniform(0.1, 1.0, (12, 9))
    g[::3], g[1] = 1e-17, 1e-13
    result = friction(bound=g, element=(1.0, 1.0), material=BODY, shift=(0.3, 0.1))
    assert_coulomb(result, BODY)
    assert not result.contact[::3].any()
    assert result.contact[1::3].all()


@doubtful
@pytest.mark.parametrize(
    "decades",
    [
        [[-40, -27, -17], [-27, -4, -22], [-11, -29, -8]],
        [[-31, -4, -18, -4, -26, -39, -25]],
        [[-13, -31, -20], [-35, -29, -20], [-35, -33, -23]],
        [[-48, -13, -8, -49, -43, -40, -43]],
    ],
)
def test_bounds_over_many_decades(decades):
    # What is left to solve is on elements of tiny bounds, whose search directions round to zero.
    g = 10.0 ** np.array(decades, float)
    element, material = (0.1, 0.1), BODY
    force = 0.999999 * 0.01 * g.sum() * np.array([0.6, -0.8])
    result = friction(bound=g, element=element, material=material, force=force)
    assert_coulomb(result, material)
    assert (result.magnitude <= g).all()


# Failures -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"bound": np.ma.ones(2)}, "bound is a masked array"),
        ({"shift": np.ma.ones(2)}, "shift is a masked array"),
        ({"shift": "a"}, "shift is 'a', but must be of real numbers"),
        ({"shift": None, "force": 1j}, "force is 1j, but must be of real numbers"),
        ({"previous": np.zeros(2)}, "previous is of type ndarray, but must be a TangentialResult"),
        ({"progress": 3}, "progress is 3"),
        ({"bound": [-1.0, 1.0]}, "bound has the value -1"),
        ({"bound": [np.nan, 1.0]}, "bound is not a number"),
        ({"shift": None}, "one of the two"),
        ({"force": 1.0}, "one of the two"),
        ({"shift": (1.0, 2.0, 3.0)}, "shift has shape"),
        ({"shift": np.inf}, "shift has values that are not finite"),
        ({"shift": None, "force": 2.1}, "of size 2.1, but friction carries at most 2"),
        ({"shift": None, "force": (1.0, 1.0, 1.0)}, "force is .*a number"),
        ({"bound": np.ones((2, 2)), "element": (1.0, 1.0)}, "shift has shape"),
        ({"bound": np.ones((2, 2)), "element": (1.0, 1.0), "shift": None, "force": 0.1}, "Fx, Fy"),
        ({"tolerance": 2.0}, "tolerance is 2"),
        ({"shift": 0.1, "force": 0.1}, "one of the two must be given, unless"),
    ],
)
def test_refuses_what_makes_no_sense(change, message):
    given = {"bound": np.ones(2), "element": 1.0, "material": BODY, "shift": 1.0} | change
    is_type = any(words in message for words in ("masked", "real numbers", "of type", "progress"))
    with pytest.raises(TypeError if is_type else ValueError, match=message):
        friction(**given)


def test_failure_is_an_error_that_says_what_is_violated():
    with pytest.raises(ContactError, match="products Coulomb's law is violated by") as error:
        circle(64, 0.3, shift=(0.05, 0.0), max_products=4, nested=False)
    result = error.value.result
    assert (result.magnitude <= result.bound).all()


@doubtful
def test_tractions_are_within_their_bound_however_their_size_is_rounded():
    """Where all slides, in all directions."""
    rng = np.random.default_rng(0)
    g, angle = rng.uniform(0.1, 1.0, (120, 110)), rng.uniform(0.0, 2.0 * np.pi, (120, 110))
    shift = 1e6 * np.stack([np.cos(angle), np.sin(angle)])
    result = friction(bound=g, element=(0.1, 0.1), material=BODY, shift=shift)
    assert_areas(result)
    assert result.sliding.all()
    assert (np.hypot(*result.traction) <= g).all()
    assert (np.sqrt((result.traction**2).sum(axis=0)) <= g).all()


PRESSED = pressed_line()
SHIFTED = friction(PRESSED, mu=0.3, shift=0.01)


@pytest.mark.parametrize(
    ("pressed", "given", "error", "message"),
    [
        (PRESSED, {}, TypeError, "mu is not given"),
        (PRESSED, {"mu": 0.3, "element": 0.1}, TypeError, "element is given, but the normal"),
        (PRESSED, {"mu": 0.3, "material": BODY}, TypeError, "material is given"),
        (PRESSED, {"mu": -0.1}, ValueError, r"mu is -0\.1, but a coefficient of friction"),
        (PRESSED, {"mu": [0.1, 0.2, 0.3]}, ValueError, r"mu has shape \(3,\), but must be a num"),
        (None, {"bound": np.ones(4), "mu": 0.1}, TypeError, "mu is given, but bound is μ p"),
        (None, {"bound": np.ones(4), "element": 1.0}, TypeError, "material is not given"),
        (None, {"bound": PRESSED}, TypeError, "bound is of type NormalResult, but must be an"),
        (None, {"mu": 0.3}, TypeError, "must be given: neither is"),
        (PRESSED, {"bound": np.ones(4)}, TypeError, "must be given: both are"),
        (np.ones(4), {"mu": 0.3}, TypeError, r"is an array of shape \(4,\), but .* as bound="),
        ("gap.npy", {"mu": 0.3}, TypeError, "first argument is 'gap.npy', but must be a result of"),
        (SHIFTED, {"mu": 0.3}, TypeError, "first argument is of type TangentialResult, but"),
        (FrictionalResult(PRESSED, SHIFTED, (0.0,)), {}, TypeError, "contact, as its `normal`"),
    ],
)
def test_a_normal_result_needs_a_coefficient_of_friction_alone(pressed, given, error, message):
    with pytest.raises(error, match=message):
        friction(pressed, force=0.1, **given)


def test_the_work_of_slip_is_that_of_the_force_less_the_energy():
    """Of the line of Mindlin and Deresiewicz, by steps: ∮F dδ = W + ΔE."""
    steps = np.linspace(0.0, 0.9, 46)[1:] * MU * np.pi * A**2 / 4
    before, work, lost = None, 0.0, 0.0
    for force in steps:
        _, _, now = line(256, force=force, previous=before)
        mean = force if before is None else force + before.force
        work += 0.5 * mean * now.shift
        lost += now.power
        assert now.power >= 0.0
        before = now
    assert_allclose(lost, work - now.energy, rtol=2e-3)
    _, _, at_once = line(256, force=steps[-1])
    assert_allclose(at_once.power, lost, rtol=2e-3)


@doubtful
@pytest.mark.parametrize("nu", [0.0, 0.3])
def test_the_moment_is_about_the_middle_of_the_grid(nu):
    _, _, result = circle(32, nu, force=(0.02, 0.01))
    assert_allclose(result.moment, 0.0, atol=1e-10)
    bound = np.zeros((8, 6))
    bound[1, 2] = np.inf
    one = friction(
        bound=bound, element=(0.1, 0.2), material=Material.from_shear(1.0, nu), force=(2.0, 3.0)
    )
    x, y = surfaces.centres((8, 6), (0.1, 0.2))
    assert_allclose(one.moment, x[1, 0] * 3.0 - y[0, 2] * 2.0, rtol=1e-9)
    assert one.power == 0.0


@pytest.mark.parametrize("missing", [1e-12, 1e-10, 2e-9])
def test_a_force_just_below_the_bound_is_solved(missing):
    _, g, _ = circle(24, 0.3, force=(0.0, 0.0))
    carried = g.sum() * (2.0 / 24) ** 2
    _, _, result = circle(24, 0.3, force=((1.0 - missing) * carried, 0.0))
    assert not result.stick.any()
    assert_allclose(result.force, (carried, 0.0), rtol=1e-8, atol=1e-8 * carried)
    assert_within_budget("friction by a force just below the bound", products=result.products)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"material": Material.from_shear(0.7, 0.25)}, "previous is of .*: a history is of the s"),
        ({"material": Material.from_shear(0.8, 0.3)}, "previous is of .*: a history is of the s"),
        ({"force": (1.0, None)}, r"force is \(1.0, None\), but must be \(Fx, Fy\): only"),
        ({"periodic": True}, r"previous repeats along the axes \(False, False\), but"),
        ({"bound": np.ones((4, 4))}, r"previous has \(24, 24\) elements"),
        ({"previous": pressed_sphere(24)}, "previous is a normal contact"),
    ],
)
def test_a_history_is_of_one_surface(change, message):
    _, g, before = circle(24, 0.3, force=(1e-3, 0.0))
    case = {"bound": g, "element": before.element, "force": (0.0, 0.0), "previous": before}
    case["material"] = Material.from_shear(0.7, 0.3)
    assert friction(**case).residual <= 1e-8
    with pytest.raises(ValueError, match=message):
        friction(**(case | change))


def test_a_lateral_force_on_infinite_strips_slides_by_antiplane_shear():
    """The displacement of a strip that sticks is softer along x by 1 - ν, at the same length."""
    (x,) = surfaces.centres(40, 0.05)
    g, nu = np.where(np.abs(x) < 0.8, np.inf, 0.0), 0.3
    case = {"element": 0.05, "material": Material.from_shear(1.0, nu), "reference": 2.0}
    across = friction(bound=g, force=(1.0, 0.0), **case)
    along = friction(bound=g, force=(0.0, 1.0), **case)
    assert_allclose(along.traction[1], across.traction[0], atol=1e-6)


def test_a_body_that_is_stretched_shifts_the_stick_zone():
    """Nowell and Hills: by e = σ a/(4 μ p₀) at a small strain σ/E', under a force as without."""
    a, mu, nu, share = 1.0, 0.5, 0.3, 0.5
    x, h = surfaces.centres(400, 0.0055)[0], 0.0055
    g = mu * semi_ellipse(x, a)  # p₀ is 1.
    material = Material.from_shear(1.0 - nu, nu)  # E* is 1, of two bodies with E' = 2.
    force = share * g.sum() * h
    strain = 0.05
    case = {"element": h, "material": material, "force": force}
    plain, stretched = friction(bound=g, **case), friction(bound=g, shift=strain * x, **case)
    middle = x[stretched.stick].mean()
    c = 0.5 * np.ptp(x[plain.stick])
    assert_allclose(stretched.force, force, rtol=1e-9)
    assert_allclose(0.5 * np.ptp(x[stretched.stick]), c, atol=2 * h)
    assert_allclose(abs(middle), strain * a / (2 * mu), atol=2 * h)
    assert stretched.shift.shape == x.shape


@pytest.mark.parametrize("angle", [0.0, 0.7, 2.0, 4.0])
@pytest.mark.parametrize("nu", [0.0, 0.45])
def test_where_all_slides_the_shift_across_is_what_the_elements_do(angle, nu):
    """An ellipse does not move along a force that is not along its axes."""
    h, n = (0.1, 0.05), np.array([np.cos(angle), np.sin(angle)])
    x, y = surfaces.centres((32, 40), h)
    g = semi_ellipse(np.hypot(x, 2 * y), 1.2)
    force = n * g.sum() * np.prod(h)
    result = friction(bound=g, element=h, material=Material.from_shear(1.0, nu), force=force)
    assert result.sliding[result.contact].all()
    u = result.displacement[:, result.contact]
    along, across = n, np.array([-n[1], n[0]])
    assert_allclose(result.shift @ across, (across @ u).mean(), rtol=0, atol=1e-6 * np.abs(u).max())
    assert_allclose(result.shift @ along, (along @ u).max(), rtol=1e-6)
