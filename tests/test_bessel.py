"""Integrals of the modified Bessel functions over the elements of a line."""

import mpmath
import numpy as np
import pytest
from numpy.testing import assert_array_equal

from toeplitz_mg.halfspace.bessel import integrate_bessel

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
    np.testing.assert_allclose(both, 0.7 * first + 0.3 * second, rtol=1e-13, atol=1e-15)


def test_an_integral_does_not_depend_on_the_elements_beside_it():
    """But for rounding: what is computed at once differs."""
    width = 2.0 * np.pi / 512 * np.arange(1, 257)
    many = integrate_bessel(width, 700, k0=1.0)
    for k in (0, 17, 255):
        alone = integrate_bessel(width[k : k + 1], 100, k0=1.0)
        np.testing.assert_allclose(many[k, :100], alone[0], rtol=1e-12, atol=1e-15 * alone.max())


def test_no_widths_and_one_element():
    assert integrate_bessel(np.array([]), 4, k0=1.0).shape == (0, 4)
    assert_array_equal(integrate_bessel(np.array([0.5]), 1, s_k0=1.0), [[0.0]])
