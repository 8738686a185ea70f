"""Integrals over a rectangle, by series from afar and closed forms from near, in any grid."""

import tracemalloc

import mpmath
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from toeplitz_mg import halfspace
from toeplitz_mg.halfspace.expansion import REACH
from toeplitz_mg.halfspace.integrals import integral_log

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


def assert_exact(name, x, y, element):
    # A few roundings, relative to each coefficient itself.
    for a, b, value in zip(x, y, influence(name, x, y, element), strict=True):
        if (a == 0 and name in ("xy", "xz")) or (b == 0 and name in ("xy", "yz")):
            assert value == 0.0  # It is odd.
        else:
            expected = in_many_digits(name, a, b, element)
            assert_allclose(value, expected, rtol=1e-14, atol=0, err_msg=f"{name} at {a, b}")


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
def test_series_are_exact_from_where_they_begin(name, element):
    angle = np.array([0.0, 1e-9, 1e-3, 0.4, np.pi / 4, 1.2, np.pi / 2 - 1e-3, np.pi / 2 - 1e-9])
    for reach in REACH.values():
        for distance in (0.9999 * reach, 1.0001 * reach):
            rho = distance * np.hypot(*element) / 2.0
            assert_exact(name, rho * np.cos(angle), rho * np.sin(angle), element)


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


def test_the_integral_of_the_logarithm_is_exact():
    """Beside ln k, of which the integral is a small part near k = 1."""
    integral = integral_log(20000)
    with mpmath.workdps(40):
        for k in [*range(40), 100, 8191, 8192, 8207, 8208, 19999]:
            right, left = mpmath.mpf(k) + 0.5, mpmath.mpf(k) - 0.5
            exact = right * mpmath.log(right) - left * mpmath.log(abs(left)) - 1
            assert abs(integral[k] - exact) <= 1e-15 * max(1, exact)
    for n in (1, 2, 15, 16, 17):
        assert_array_equal(integral_log(n), integral[:n])


@pytest.mark.parametrize("shape", [(256, 256), (90, 411)])
@pytest.mark.parametrize("element", [(1.0, 1.0), (1.0, 4.0), (50.0, 1.0)])
def test_points_that_mirror_each_other_have_the_same_coefficients(shape, element):
    """To the last bit, as a matrix is symmetric or not."""
    x, y = halfspace.all_offsets(shape, element)
    elastic, unlike = {"G": 1.0, "nu": 0.28}, {"G": 1.0, "K": 0.3}
    for influence, constants, along_x, along_y in (
        (halfspace.influence_zz, elastic, 1.0, 1.0),
        (halfspace.influence_xx, elastic, 1.0, 1.0),
        (halfspace.influence_yy, elastic, 1.0, 1.0),
        (halfspace.influence_xy, elastic, -1.0, -1.0),
        (halfspace.influence_xz, unlike, -1.0, 1.0),
        (halfspace.influence_yz, unlike, 1.0, -1.0),
    ):
        lags = influence(x, y, element, **constants)
        assert np.array_equal(lags, along_x * lags[::-1])
        assert np.array_equal(lags, along_y * lags[:, ::-1])
