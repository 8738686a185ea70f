"""Rolling of few elements, directly: the same answers as by iteration, and where it starts."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from tests.test_friction import doubtful
from tests.test_rolling import assert_rolls, influences
from toeplitz_mg.contact import Material, rolling, surfaces
from toeplitz_mg.contact.grid import Grid
from toeplitz_mg.contact.steady_matrices import SteadyArray
from toeplitz_mg.contact.tangential.leading_edge import NEARLY, roll_backwards


def random_case(seed):
    """An ellipse of any shape, with any friction, that rolls by any creepages with some slip."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(5, 13))
    a, b = np.exp(rng.uniform(-1.0, 1.0, 2))
    element = 2 * a / n, 2 * b / n
    x, y = surfaces.centres((n, n), element)
    bound = 10.0 ** rng.uniform(-3, -1)
    g = bound * np.sqrt(np.maximum(0.0, 1.0 - (x / a) ** 2 - (y / b) ** 2))
    sizes = bound * 10.0 ** rng.uniform(-1, 1) * rng.standard_normal(3)
    creepages = dict(zip(("longitudinal", "lateral", "spin"), sizes.tolist(), strict=True))
    material = Material.from_shear(1.0, float(rng.uniform(0.0, 0.5)))
    return g, {"element": element, "material": material} | creepages


@doubtful
@pytest.mark.parametrize("seed", range(40))
def test_few_elements_roll_directly_as_by_iteration(seed, monkeypatch):
    g, case = random_case(seed)
    directly = rolling(g, **case)
    assert_rolls(directly, case["material"])
    monkeypatch.setattr(Grid, "steady_array", lambda self, contact: None)
    by_iteration = rolling(g, **case)
    assert len(directly.iterations) == 1  # It settles, without an iteration after it.
    # The slip where they stick is within the tolerance; what tractions make of that is more.
    assert_allclose(directly.traction, by_iteration.traction, rtol=0, atol=1e-5 * g.max())


@doubtful
def test_the_start_is_the_answer_where_nothing_slips():
    bonded = np.random.default_rng(0).standard_normal((2, 6, 5))
    q, slide = roll_backwards(bonded, np.full((6, 5), 100.0))
    assert_allclose(q, bonded, atol=1e-12)
    assert not slide.any()
    g, case = random_case(1)
    small = case | {"longitudinal": 1e-3, "lateral": 0.0, "spin": 0.0}
    result = rolling(np.where(g > 0.0, np.inf, 0.0), **small)
    assert sum(result.iterations) == 0


def test_the_start_grows_from_the_leading_edge_and_is_cut_to_the_bound():
    # In one component that is a recursion of numbers, each of the element before.
    rng = np.random.default_rng(1)
    bonded, g = rng.standard_normal((1, 30)), np.abs(rng.standard_normal(30))
    q, slide = roll_backwards(bonded, g)
    before, of_bonded = 0.0, 0.0
    for i in reversed(range(30)):
        free = before + bonded[0, i] - of_bonded
        before, of_bonded = np.clip(free, -g[i], g[i]), bonded[0, i]
        assert slide[i] == (abs(free) > NEARLY * g[i])
        assert_allclose(q[0, i], before)


def test_in_two_components_the_start_keeps_its_direction_at_the_bound():
    rng = np.random.default_rng(2)
    q, slide = roll_backwards(rng.standard_normal((2, 9, 4)), g := rng.random((9, 4)))
    assert (np.hypot(*q) <= g * (1 + 1e-12)).all()
    assert_array_equal(slide, np.hypot(*q) > NEARLY * g)
    assert slide.any()


def test_the_array_is_the_matrix_of_the_elements_in_contact():
    grid = Grid.of((4, 3), (0.5, 0.8), Material.from_shear(2.0, 0.3), None)
    contact = np.random.default_rng(3).random((4, 3)) < 0.6
    K = influences(grid, 0.0) - influences(grid, 0.5)
    both = np.tile(contact.ravel(), 2)
    array = SteadyArray(grid.steady(grid.tangential()), contact)
    assert_allclose(array.array, K[np.ix_(both, both)], atol=1e-14)
    u = np.arange(float(both.sum()))
    assert_allclose(array.array @ array.solve(u), u, atol=1e-10)
    assert_array_equal(array.apply(u), array.array @ u)
