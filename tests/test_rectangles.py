"""The coefficients of a rectangle are exact relative to themselves, at any distance and shape."""

import tracemalloc

import mpmath
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from toeplitz_mg import halfspace

NU = K = 0.28
ELEMENTS = [(1.0, 1.0), (1.0, 50.0), (50.0, 1.0), (0.3, 0.7), (2e-7, 5e-7), (1e5, 5.1e6)]


def asinh_term(a, b):
    return a * mpmath.asinh(b / abs(a)) if a else mpmath.mpf(0)


def log_term(X, Y):
    total = Y * mpmath.log(X**2 + Y**2) / 2 if Y else mpmath.mpf(0)
    return total + X * mpmath.atan(Y / X) if X else total


def inverse(X, Y):
    return (1 - mpmath.mpf(NU)) * (asinh_term(Y, X) + asinh_term(X, Y))


# What the closed form takes the differences of, over the corners.
CLOSED = {
    "zz": inverse,
    "xx": lambda X, Y: inverse(X, Y) + NU * asinh_term(Y, X),
    "yy": lambda X, Y: inverse(X, Y) + NU * asinh_term(X, Y),
    "xy": lambda X, Y: -NU * mpmath.hypot(X, Y),
    "xz": lambda X, Y: -K * log_term(X, Y),
    "yz": lambda X, Y: -K * log_term(Y, X),
}


def influence(name, x, y, element):
    constant = {"K": K} if name in ("xz", "yz") else {"nu": NU}
    return getattr(halfspace, f"influence_{name}")(x, y, element, G=1.0, **constant)


def in_many_digits(name, x, y, element):
    """The closed form, in so many digits that its cancellation does not matter."""
    with mpmath.workdps(60):
        x, y, h1, h2 = (mpmath.mpf(float(v)) for v in (x, y, *element))
        corners = ((i, j) for i in (-1, 1) for j in (-1, 1))
        total = sum(i * j * CLOSED[name](x + i * h1 / 2, y + j * h2 / 2) for i, j in corners)
        return float(total / mpmath.pi)


def assert_exact(name, x, y, element, rtol=1e-14):
    # A few roundings, relative to each coefficient itself.
    for a, b, value in zip(x, y, influence(name, x, y, element), strict=True):
        if (a == 0 and name in ("xy", "xz")) or (b == 0 and name in ("xy", "yz")):
            assert value == 0.0  # It is odd.
        else:
            expected = in_many_digits(name, a, b, element)
            assert_allclose(value, expected, rtol=rtol, atol=0, err_msg=f"{name} at {a, b}")


@pytest.mark.parametrize("element", ELEMENTS, ids=str)
@pytest.mark.parametrize("name", CLOSED)
def test_coefficients_are_exact_relative_to_themselves(name, element):
    """On a grid of 1024²: at random, near the load, on the axes and beside them, in the corner."""
    rng = np.random.default_rng(3)
    far = rng.integers(0, 1024, (2, 40))
    near = rng.integers(0, 12, (2, 25))
    ends = np.array([[0, 1023, 1, 1023, 1023, 0, 200], [1023, 0, 1023, 1, 1023, 200, 0]])
    i, j = np.concatenate([far, near, ends], axis=1)
    assert_exact(name, element[0] * i, element[1] * j, element)


@pytest.mark.parametrize("element", ELEMENTS[:4], ids=str)
@pytest.mark.parametrize("name", CLOSED)
def test_coefficients_are_exact_at_all_distances(name, element):
    """Wherever one formula ends and another begins, from near to far."""
    angle = np.array([0.0, 1e-9, 1e-3, 0.4, np.pi / 4, 1.2, np.pi / 2 - 1e-3, np.pi / 2 - 1e-9])
    rho = np.geomspace(1.5, 700.0, 200) * np.hypot(*element) / 2.0
    angle = np.resize(angle, len(rho))
    assert_exact(name, rho * np.cos(angle), rho * np.sin(angle), element)


@pytest.mark.parametrize("name", CLOSED)
def test_coefficients_are_exact_at_any_point(name):
    """Of all shapes, at all distances, on the edges and on the axis."""
    rng = np.random.default_rng(0)
    for _ in range(60):
        sign, wide = rng.choice([-1.0, 1.0], 2), 10 ** rng.uniform(-8, 8)
        near_edge = 0.5 + rng.choice([-0.5, 0.0, 1.0], 2) * 10 ** rng.uniform(-16, 0, 2)
        points = sign * 10 ** rng.uniform(-10, 5, 2), rng.uniform(-3, 3, 2), sign * near_edge
        x, y = np.transpose(points)
        assert_exact(name, x, y * wide, (1.0, wide), rtol=3e-14)


@pytest.mark.parametrize("element", [(1.0, 1.0), (50.0, 1.0)], ids=str)
@pytest.mark.parametrize("name", CLOSED)
def test_a_coefficient_hardly_depends_on_the_points_beside_it(name, element):
    """A block takes the series that its nearest point needs; a longer one changes no digit."""
    x, y = halfspace.offsets((300, 200), element)
    grid = influence(name, x, y, element)
    rng = np.random.default_rng(1)
    for i, j in zip(rng.integers(0, 300, 50), rng.integers(0, 200, 50), strict=True):
        alone = influence(name, x[i, 0], y[0, j], element)
        assert alone.shape == ()
        assert_allclose(grid[i, j], alone, rtol=5e-15)


@pytest.mark.parametrize("name", CLOSED)
def test_points_of_any_shape_and_number(name):
    element = (0.5, 0.25)
    x, y = np.arange(3.0)[:, None, None], np.arange(20.0)[None, :, None]
    values = influence(name, x, y + np.zeros(2), element)
    assert values.shape == (3, 20, 2)
    assert_array_equal(values[..., 0], values[..., 1])
    assert influence(name, np.zeros((0, 4)), 1.0, element).shape == (0, 4)


@pytest.mark.parametrize("name", CLOSED)
@pytest.mark.parametrize("element", [(1e-180, 3e-180), (1e150, 2e150)], ids=str)
def test_lengths_whose_squares_over_or_underflow(name, element):
    """The integrals are of degree 1 in all lengths."""
    x, y = np.array([0.0, 1.0, 7.0, 100.0, 1e5])[:, None], np.array([0.0, 3.0, 50.0])
    unit = influence(name, x, y, (1.0, element[1] / element[0]))
    scaled = influence(name, x * element[0], y * element[0], element)
    assert_allclose(scaled, unit * element[0], rtol=2e-14)


@pytest.mark.parametrize("name", CLOSED)
def test_coefficients_take_the_memory_of_less_than_two_grids_beside_themselves(name):
    n = 1024
    x, y = halfspace.offsets((n, n), (1.0, 1.0))
    tracemalloc.start()
    try:
        influence(name, x, y, (1.0, 1.0))
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 3 * 8 * n**2


@pytest.mark.parametrize("shape", [(256, 256), (90, 411)])
@pytest.mark.parametrize("element", [(1.0, 1.0), (1.0, 4.0), (50.0, 1.0)])
def test_points_that_mirror_each_other_have_the_same_coefficients(shape, element):
    """To the last bit, but for the sign: it is odd along an axis that is one of its two."""
    x, y = halfspace.all_offsets(shape, element)
    for name in CLOSED:
        lags = influence(name, x, y, element)
        assert np.array_equal(lags, (-1.0) ** name.count("x") * lags[::-1]), name
        assert np.array_equal(lags, (-1.0) ** name.count("y") * lags[:, ::-1]), name


# Elements that are narrow for their distance -------------------------------------------------

LONG = [(1.0, 1e3), (1.0, 1e6), (2e4, 0.5), (1e9, 1.0)]
BESIDE = [0.0, 0.3, 0.5, 1.0, 2.4]  # Distances along the longer side, in lengths of it.


def at(element, across, along):
    """Return points so many widths away across the longer side, and so many lengths along it."""
    across, along = np.multiply(across, min(element)), np.multiply(along, max(element))
    return (across, along) if element[0] < element[1] else (along, across)


@pytest.mark.parametrize("element", LONG, ids=str)
@pytest.mark.parametrize("name", CLOSED)
def test_coefficients_of_long_elements_are_exact_at_all_distances(name, element):
    across = np.geomspace(1.0, 3.0 * max(element) / min(element), 12).round()
    for along in BESIDE:
        assert_exact(name, *at(element, across, np.full(len(across), along)), element)
    across = np.geomspace(1.5, 5000.0, 120)
    assert_exact(name, *at(element, across, np.resize(BESIDE, len(across))), element, rtol=2e-14)


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
        assert_allclose(influence(name, x, y, element), expected, rtol=1e-14, atol=0)


@pytest.mark.parametrize("name", CLOSED)
def test_strips_side_by_side(name):
    """One by one, and as a grid that all rules are in."""
    element, n = (1.0, 3e4), 2**17
    x, y = halfspace.offsets((n, 1), element)
    grid = influence(name, x, y, element)[:, 0]
    some = np.array([0, 1, 2, 3, 16, 17, 100, 4000, 50000, 90000, n - 1])
    assert_exact(name, x[some, 0], np.zeros(len(some)), element)
    alone = [influence(name, x[i, 0], 0.0, element) for i in some]
    assert_allclose(grid[some], alone, rtol=5e-15)
