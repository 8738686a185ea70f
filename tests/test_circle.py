"""Values of polynomials on the unit circle, against their definition, and the way back."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from toeplitz_mg.engine.circle import circle_of
from toeplitz_mg.engine.transforms import LONG

each_kind = pytest.mark.parametrize("kind", [np.float64, np.complex128])


def series(n, kind):
    x = np.random.default_rng(n).standard_normal((2, n))
    return x[0] + 1j * x[1] if kind is np.complex128 else x[0]


@each_kind
@pytest.mark.parametrize("n", [1, 2, 3, 5, 40, 127])
def test_the_path_has_the_values_at_equal_distances(n, kind):
    """From 1 to -1 of a real series, with both of them; and all around of a complex one."""
    x, circle = series(n, kind), circle_of(2 * n + 3, np.dtype(kind))
    path = circle.path(x, circle.values(x))
    step = 2 * np.pi / circle.points
    if kind is np.float64:
        angles = np.concatenate([[0.0], step * (np.arange(circle.points // 2) + 0.5), [np.pi]])
    else:
        angles = step * np.arange(circle.points + 1)
    expected = np.exp(-1j * np.outer(angles, np.arange(n))) @ x
    assert_allclose(path, expected, rtol=0, atol=1e-11 * n)


@each_kind
@pytest.mark.parametrize("n", [1, 2, 3, 40, LONG + 7])
@pytest.mark.parametrize("oversampling", [2, 5])
def test_coefficients_are_those_of_the_series_and_then_zeros(n, kind, oversampling):
    x, circle = series(n, kind), circle_of(oversampling * n, np.dtype(kind))
    found = circle.coefficients(circle.values(x), circle.points)
    assert_allclose(found[:n], x, rtol=0, atol=1e-11)
    assert_allclose(found[n:], 0.0, rtol=0, atol=1e-11)


@each_kind
@pytest.mark.parametrize("n", [1, 2, 40, LONG])
def test_squares_are_those_of_autocorrelations(n, kind):
    x, circle = series(n, kind), circle_of(2 * n - 1, np.dtype(kind))
    z = circle.values(x)
    found = circle.coefficients(z.real**2 + z.imag**2, n)
    for lag in {0, 1, n // 2, n - 1} - {n}:
        assert found[lag] == pytest.approx(np.vdot(x[: n - lag], x[lag:]), rel=0, abs=1e-10 * n)


@each_kind
def test_what_wraps_around_has_the_sign_of_the_power_of_the_points(kind):
    """Of z^(N + 3) the coefficient 3: zᴺ is -1 at the points for real series, and 1 at others."""
    circle = circle_of(16, np.dtype(kind))
    unit = np.eye(1, 4, 3)[0].astype(kind)
    turns = circle.values(np.eye(1, 2, 1)[0].astype(kind)) ** circle.points
    found = circle.coefficients(turns * circle.values(unit), circle.points)
    sign = -1.0 if kind is np.float64 else 1.0
    assert_allclose(found, sign * np.eye(1, circle.points, 3)[0], rtol=0, atol=1e-12)


def test_a_real_series_takes_no_more_points_than_twice_its_length():
    for n in (64, 1000, LONG, 10**5):
        assert circle_of(2 * n - 1, np.dtype(float)).points <= 2.1 * n
