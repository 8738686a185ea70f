"""Contact with a hardness: p ≤ H, and where p = H the bodies are pressed into each other."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from tests.budgets import assert_within_budget
from tests.repeating import sum_of_waves
from tests.test_friction import doubtful
from tests.test_periodic import UNIT, assert_complementary
from toeplitz_mg.contact import load_curve, normal_contact, surfaces

A = 0.6  # Radius of contact without a hardness, on grids of [-1, 1].
P0 = 2 * A / np.pi


def sphere(n, **options):
    h = 2.0 / n
    gap = surfaces.sphere((n, n), (h, h), radius=1.0)
    return gap, normal_contact(gap, (h, h), material=UNIT, **options)


def test_hertz_with_a_hardness_on_a_finer_grid():
    hardness = 0.6 * P0
    gap, result = sphere(256, hardness=hardness, force=4 / 3 * A**3)
    assert_complementary(result, gap, hardness=hardness)
    assert_within_budget("sphere with a hardness, n = 256", products=result.products)
    _, elastic = sphere(256, force=4 / 3 * A**3)
    assert result.area > elastic.area
    assert result.approach > elastic.approach
    assert result.plastic.max() == result.plastic[128, 128] > 0.0
    assert_allclose(result.plastic, result.plastic[::-1, ::-1], atol=1e-7)


@doubtful
@pytest.mark.parametrize("periodic", [False, True])
def test_a_force_that_all_elements_carry_but_for_rounding_is_carried(periodic):
    gap, hardness, h = 0.01 * np.random.default_rng(3).standard_normal(5), 0.109375, 0.177084250429
    force = 5 * h * hardness * (1.0 + 4e-16)
    options = {"material": UNIT, "hardness": hardness, "periodic": periodic}
    result = normal_contact(gap, (h,), force=force, **options)
    assert_allclose(result.force, force, rtol=1e-14)
    assert_allclose(result.pressure, hardness, rtol=1e-14)


def test_a_force_a_little_above_the_hardness_of_all_elements_is_told_apart_from_it():
    gap, options = np.zeros((16, 16)), {"material": UNIT, "hardness": 0.1}
    result = normal_contact(gap, (0.5, 0.5), force=6.4, **options)
    assert result.pressure.min() == 0.1
    assert not np.signbit(result.residual)
    with pytest.raises(ValueError, match=r"force is 6\.40000064, but must be at most 6\.4, "):
        normal_contact(gap, (0.5, 0.5), force=6.4 * (1.0 + 1e-7), **options)


def test_a_hardness_that_is_not_reached_changes_nothing():
    _, elastic = sphere(64, force=4 / 3 * A**3, tolerance=1e-11)
    _, result = sphere(64, force=4 / 3 * A**3, tolerance=1e-11, hardness=1.2 * P0)
    assert_allclose(result.pressure, elastic.pressure, atol=1e-9)
    assert not result.plastic.any()
    assert elastic.plastic is None


@doubtful
@pytest.mark.parametrize("periodic", [False, True, (True, False)])
@pytest.mark.parametrize("share", [0.3, 0.9, 0.999, 1.0])
def test_up_to_full_contact_at_the_hardness(periodic, share):
    """A force that is the hardness times the area makes it the pressure everywhere."""
    gap = 0.01 * np.random.default_rng(0).random((24, 20))
    hardness, element = 0.02, (0.1, 0.1)
    force = share * hardness * 0.01 * gap.size
    options = {"force": force, "hardness": hardness, "periodic": periodic}
    result = normal_contact(gap, element, material=UNIT, **options)
    assert_complementary(result, gap, hardness=hardness)
    assert_allclose(result.force, force, rtol=1e-12)
    if share == 1.0:
        assert (result.pressure == hardness).all()
        assert_allclose(result.gap, 0.0, atol=1e-14)


@doubtful
@given(
    seed=st.integers(0, 2**32 - 1),
    shape=st.one_of(
        st.tuples(st.integers(1, 60)), st.tuples(st.integers(1, 20), st.integers(1, 20))
    ),
    load=st.floats(1e-3, 1.0),
    hardness=st.floats(1e-3, 1.0) | st.none(),
    is_force=st.booleans(),
    is_periodic=st.booleans(),
)
@settings(max_examples=120, deadline=None)
def test_any_surface_and_load(seed, shape, load, hardness, is_force, is_periodic):
    rng = np.random.default_rng(seed)
    element = tuple(rng.uniform(0.1, 1.0, len(shape)))
    gap = 0.01 * rng.standard_normal(shape)
    if is_force:
        arguments = {"force": load * (hardness or 0.03) * np.prod(shape) * np.prod(element)}
    else:
        arguments = {"approach": gap.min() + (gap.mean() - gap.min()) * 0.99 * load + 1e-9}
        is_periodic = is_periodic and gap.size > 2
    periodic = is_periodic and gap.size > 1
    arguments |= {"hardness": hardness, "periodic": periodic}
    result = normal_contact(gap, element, material=UNIT, **arguments)
    waves = sum_of_waves("z", shape, element) if periodic else None
    assert_complementary(result, gap, waves, hardness=hardness or np.inf)
    if periodic:
        assert_allclose(result.displacement.mean(), 0.0, atol=1e-15)
    if is_force:
        assert_allclose(result.force, arguments["force"], rtol=1e-8)


@pytest.mark.parametrize("share", [0.5, 0.9, 0.99, 0.999])
def test_rough_surfaces_near_full_contact(share):
    """A mean pressure near the hardness, of a surface that repeats: most of it yields."""
    n, hardness = 128, 0.03
    gap = surfaces.rough((n, n), (0.1, 0.1), rms=0.02, seed=1)
    force = share * hardness * (0.1 * n) ** 2
    result = normal_contact(
        gap, (0.1, 0.1), material=UNIT, force=force, hardness=hardness, periodic=True
    )
    assert_complementary(result, gap, hardness=hardness)
    assert_within_budget("near full contact at the hardness", products=result.products)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"hardness": 0.0}, "hardness is 0.0, but must be positive"),
        ({"hardness": np.nan}, "hardness is nan"),
        ({"hardness": 0.2}, "force is 1, but must be at most 0.8, which all elements carry"),
    ],
)
def test_refuses_what_makes_no_sense(change, message):
    with pytest.raises(ValueError, match=message):
        normal_contact(np.zeros((2, 2)), (1.0, 1.0), material=UNIT, force=1.0, **change)


def test_a_result_says_how_many_elements_yield():
    gap = surfaces.sphere((32, 32), (2 / 32, 2 / 32), radius=1.0)
    case = {"element": (2 / 32, 2 / 32), "material": UNIT, "force": 4 / 3 * A**3}
    soft = normal_contact(gap, hardness=0.8 * P0, **case)
    count = (soft.plastic > 0.0).sum()
    assert f"yields            {count} elements, by {soft.plastic.max():.5g} mm" in soft.summary()
    assert "yields" not in normal_contact(gap, **case).summary()


def test_what_has_yielded_stays_pressed_in():
    """Under less load the bodies meet as if the gap had the dents from the first."""
    gap, element = surfaces.sphere((24, 24), (0.1, 0.1), radius=1.0), (0.1, 0.1)
    case = {"material": UNIT, "hardness": 0.4}
    first, less, again, none = load_curve(gap, element, forces=[1.0, 0.2, 1.0, 0.0], **case)
    dents = gap + first.plastic
    expected = normal_contact(dents, element, force=0.2, **case)
    assert first.plastic.max() > 0.0
    assert_allclose(less.pressure, expected.pressure, atol=1e-6)
    assert_allclose(less.approach, expected.approach, rtol=1e-6)
    assert_allclose(less.gap[less.contact], 0.0, atol=1e-7)
    for later in (less, again, none):
        assert_allclose(later.plastic, first.plastic, atol=1e-7)
    assert_allclose(again.pressure, first.pressure, atol=1e-6)
