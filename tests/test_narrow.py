"""Coefficients of elements that are narrow for their distance, beside the closed form."""

import numpy as np
import pytest

from tests.test_rectangles import CLOSED, assert_exact, influence
from toeplitz_mg import halfspace
from toeplitz_mg.halfspace.narrow import BEGINS, NEAR

LONG = [(1.0, 1e3), (1.0, 1e6), (2e4, 0.5), (1e9, 1.0)]
BESIDE = [0.0, 0.3, 0.5, 1.0, 2.4]  # Distances along the longer side, in lengths of it.


def at(element, across, along):
    """Return points so many widths away across the longer side, and so many lengths along it."""
    across, along = np.multiply(across, min(element)), np.multiply(along, max(element))
    return (across, along) if element[0] < element[1] else (along, across)


@pytest.mark.parametrize("element", LONG, ids=str)
@pytest.mark.parametrize("name", CLOSED)
def test_coefficients_are_exact_relative_to_themselves(name, element):
    reach = 3.0 * max(element) / min(element)
    across = np.geomspace(1.0, reach, 12).round()
    for along in BESIDE:
        assert_exact(name, *at(element, across, np.full(len(across), along)), element)


@pytest.mark.parametrize("element", LONG[1:], ids=str)
@pytest.mark.parametrize("name", CLOSED)
def test_rules_are_exact_from_where_they_begin(name, element):
    starts = [start for rule, start in BEGINS.items() if rule != NEAR and start < 1e5]
    across = np.outer(starts, [0.999999, 1.000001]).ravel()
    for along in BESIDE:
        assert_exact(name, *at(element, across, np.full(len(across), along)), element)


def test_coefficients_beyond_what_has_a_square():
    """An element far away is a point."""
    x, y, element = np.array([3e200, 0.0, 4e290]), np.array([4e200, 1e160, 3e290]), (1.0, 2.0)
    rho = np.hypot(x, y)
    area = element[0] * element[1]
    c, s = x / rho, y / rho
    exact = {"zz": 0.72 / rho, "xx": 0.72 / rho + 0.28 * c * c / rho, "xy": 0.28 * c * s / rho}
    exact |= {"xz": -0.28 * c / rho}
    for name, value in exact.items():
        expected = area / np.pi * value
        np.testing.assert_allclose(influence(name, x, y, element), expected, rtol=1e-14, atol=0)


@pytest.mark.parametrize("name", CLOSED)
def test_strips_side_by_side(name):
    """One by one, and as a grid that all rules are in."""
    element, n = (1.0, 3e4), 2**17
    x, y = halfspace.offsets((n, 1), element)
    grid = influence(name, x, y, element)[:, 0]
    some = np.array([0, 1, 2, 3, 16, 17, 100, 4000, 50000, 90000, n - 1])
    assert_exact(name, x[some, 0], np.zeros(len(some)), element)
    alone = [influence(name, x[i, 0], 0.0, element) for i in some]
    np.testing.assert_allclose(grid[some], alone, rtol=5e-15)
