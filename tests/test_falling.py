"""Friction that falls with the slip: its bound belongs to its slip."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.test_rolling import assert_rolls, circle
from toeplitz_mg.contact import Material, rolling


def test_the_bound_is_that_of_the_slip():
    def falling(s):
        return 0.6 + 0.4 / (1 + s / 0.2)

    g, constant = circle(24, (0.1, 0.0, 0.1))
    _, result = circle(24, (0.1, 0.0, 0.1), falling=falling)
    size = np.hypot(*result.slip)
    assert_allclose(result.bound, g * falling(size), atol=1e-7 * g.max())
    assert (result.bound[result.sliding] < g[result.sliding]).all()
    assert_rolls(result, Material.from_shear(1.0, 0.25))
    assert abs(result.force[0]) < abs(constant.force[0])


def test_friction_that_does_not_depend_on_the_slip_is_a_factor():
    g, expected = circle(16, (0.1, 0.05, 0.0))
    _, result = circle(16, (0.1, 0.05, 0.0), falling=lambda s: np.ones_like(s))
    assert_allclose(result.traction, expected.traction, atol=1e-7 * g.max())


def test_large_creepage_has_the_friction_of_its_slip():
    g, result = circle(16, (30.0, 40.0, 0.0), falling=lambda s: 1 / (1 + s))
    total = g.sum() * result.element[0] ** 2
    assert_allclose(np.linalg.norm(result.force), total / 51, rtol=0.01)


@pytest.mark.parametrize(
    ("falling", "error", "message"),
    [
        (0.5, TypeError, "falling is 0.5, but must be a function"),
        (lambda s: -np.ones_like(s), ValueError, "falling has returned -1 to -1"),
        (lambda s: np.ones(3), ValueError, r"falling has returned the shape \(3,\)"),
    ],
)
def test_refuses_what_is_no_friction(falling, error, message):
    with pytest.raises(error, match=message):
        rolling(np.ones((4, 4)), (1.0, 1.0), material=Material.from_shear(1, 0.3), falling=falling)
