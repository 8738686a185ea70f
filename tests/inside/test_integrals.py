"""Integrals over the elements of a line, of the logarithm and of Bessel functions, are exact.

So are the eigenvalues of the displacements by waves along an axis of which the other one ends.
"""

import mpmath
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import quad
from scipy.special import k0, k1

from toeplitz_mg.halfspace.integrals import integral_log
from toeplitz_mg.halfspace.periodic import (
    integrate_bessel,
    strip_eigenvalues,
    strip_length,
)

# What has the derivative K_ν(s), times s, where exp(-s c) cosh νt stands for K_ν(s), c = cosh t.
INTEGRALS = {
    "k0": lambda s, c: -mpmath.exp(-s * c) / c,
    "s_k1": lambda s, c: -(s + 1 / c) * mpmath.exp(-s * c),
    "s_k0": lambda s, c: -(s + 1 / c) * mpmath.exp(-s * c) / c,
}
# Elements narrow and wide for the waves, alone and with many others of like and other widths.
WIDTHS = {
    "one": ([0.7], 6),
    "waves": (2.0 * np.pi / 64 * np.arange(1, 33), 40),
    "narrow": ([1e-7, 1.1e-7, 1e-5, 3e-3], 3000),
    "wide": ([2.5, 30.0, 60.0], 5),
}


def in_many_digits(name, w, j):
    """K_ν(s) is the integral of exp(-s cosh t) cosh νt over t > 0 (Abramowitz and Stegun, 9.6.24).

    The integrand is even and analytic for |Im t| < π/2: by the trapezoidal rule of this step it is
    off by exp(-π²/0.2), in the 22nd digit.
    """
    if j == 0 and name == "s_k0":  # It is odd.
        return 0.0
    with mpmath.workdps(40):
        of, step = INTEGRALS[name], mpmath.mpf("0.2")
        a, b = mpmath.mpf(w) * max(j - 0.5, 0.0), mpmath.mpf(w) * (j + 0.5)
        total = (of(b, mpmath.mpf(1)) - of(a, mpmath.mpf(1))) / 2
        for c in (mpmath.cosh(step * k) for k in range(1, 400)):
            more = of(b, c) - of(a, c)
            total += more
            if abs(more) < 1e-30 * abs(total):
                break
        return float(step * total * (1 if j else 2))


@pytest.mark.parametrize("name", INTEGRALS)
@pytest.mark.parametrize(("width", "n"), WIDTHS.values(), ids=WIDTHS)
def test_integrals_are_exact_relative_to_the_largest_of_a_width(name, width, n):
    found = integrate_bessel(np.array(width), n, **{name: 1.0})
    assert found.shape == (len(width), n)
    for k in {0, len(width) // 2, len(width) - 1}:
        largest = max(in_many_digits(name, width[k], j) for j in (0, 1))
        for j in {0, 1, 2, 3, 4, 9, n // 2, n - 1} & set(range(n)):
            exact = in_many_digits(name, width[k], j)
            # Of wide elements all but the first are next to nothing beside it.
            rounding = 2e-14 * max(largest, exact) + 1e-17 * min(width[k], 1.0)
            assert abs(found[k, j] - exact) <= rounding


def test_weights_add_up():
    width = np.array([0.2, 0.3, 2.0])
    both = integrate_bessel(width, 20, k0=0.7, s_k1=0.3)
    first, second = (integrate_bessel(width, 20, **{name: 1.0}) for name in ("k0", "s_k1"))
    assert_allclose(both, 0.7 * first + 0.3 * second, rtol=1e-13, atol=1e-15)


def test_an_integral_does_not_depend_on_the_elements_beside_it():
    """But for rounding: what is computed at once differs."""
    width = 2.0 * np.pi / 512 * np.arange(1, 257)
    many = integrate_bessel(width, 700, k0=1.0)
    for k in (0, 17, 255):
        alone = integrate_bessel(width[k : k + 1], 100, k0=1.0)
        assert_allclose(many[k, :100], alone[0], rtol=1e-12, atol=1e-15 * alone.max())


def test_no_widths_and_one_element():
    assert integrate_bessel(np.array([]), 4, k0=1.0).shape == (0, 4)
    assert_array_equal(integrate_bessel(np.array([0.5]), 1, s_k0=1.0), [[0.0]])


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


@pytest.mark.parametrize("directions", ["zz", "xx", "xy", "yy"])
@pytest.mark.parametrize("axis", [0, 1])
def test_the_eigenvalues_along_an_axis_that_ends(directions, axis):
    """They are those of a circulant of what a wave displaces, by the Bessel functions."""
    nu, G, n, h = 0.3, 1.7, 3, (0.5, 0.4)
    along, across = h[axis], h[1 - axis]
    shape = (5, n) if axis == 0 else (n, 5)
    arguments = {"G": G, "nu": nu, "reference": 20.0}
    found = strip_eigenvalues(shape, h, axis, directions, **arguments)
    is_odd, is_along = directions == "xy", directions == 2 * "xy"[axis]

    def displacement(t, q):
        x = abs(q * t)
        if directions == "zz":
            return (1.0 - nu) * k0(x)
        if is_odd:
            return -nu * q * t * k0(x)
        return k0(x) - nu * x * k1(x) if is_along else (1.0 - nu) * k0(x) + nu * x * k1(x)

    length = strip_length(n)
    for k in range(1, 5):
        q = 2.0 * np.pi * np.fft.fftfreq(5, along)[k]
        column = np.zeros(length)
        for j in range(1 - n, n):
            edges = (j - 0.5) * across, (j + 0.5) * across
            exact, _ = quad(displacement, *edges, args=(q,), points=[0.0] * (j == 0), epsabs=1e-13)
            column[j] = 2.0 / (np.pi * G) * exact
        hat = np.fft.fft(column)
        expected = -hat.imag if is_odd else hat.real
        line = found[k] if axis == 0 else found[:, k] if k < 3 else found[:, 5 - k]
        if axis == 1 and k >= 3 and is_odd:
            line = -line
        assert_allclose(line, expected[: len(line)], rtol=0, atol=1e-11 * abs(expected).max())
