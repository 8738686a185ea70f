"""Integrals of the modified Bessel functions over the elements of a line."""

import mpmath
import numpy as np
import pytest
from numpy.testing import assert_array_equal

from toeplitz_mg.halfspace.bessel import integrate_bessel

KERNELS = {
    "k0": lambda s: mpmath.besselk(0, s),
    "s_k1": lambda s: s * mpmath.besselk(1, s),
    "s_k0": lambda s: s * mpmath.besselk(0, s),
}
# Elements narrow and wide for the waves, alone and with many others of like and other widths.
WIDTHS = {
    "one": ([0.7], 6),
    "waves": (2.0 * np.pi / 64 * np.arange(1, 33), 40),
    "narrow": ([1e-7, 1.1e-7, 1e-5, 3e-3], 3000),
    "wide": ([2.5, 30.0, 60.0], 5),
}


def in_many_digits(name, w, j):
    if j == 0 and name == "s_k0":  # It is odd.
        return 0.0
    kernel, rule = KERNELS[name], {"method": "gauss-legendre", "maxdegree": 5}
    with mpmath.workdps(20):
        w = mpmath.mpf(w)
        if j == 0:  # In the sixth root the logarithm at zero is smooth enough.
            return float(6 * w * mpmath.quad(lambda t: t**5 * kernel(w / 2 * t**6), [0, 1], **rule))
        return float(mpmath.quad(kernel, [w * (j - 0.5), w * j, w * (j + 0.5)], **rule))


@pytest.mark.parametrize("name", KERNELS)
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
