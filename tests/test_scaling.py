"""Systems that are scaled by powers of two: what is in the range of float64 is returned."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import toeplitz_mg as tmg


@pytest.mark.parametrize("n", [4, 300])
def test_a_solution_in_range_although_the_quotient_of_the_sizes_is_not(n):
    """A is (1 + J)/2, J all ones: a constant is (n + 1)/2 times itself, the size of A is 1."""
    c = 2.0**-520 * np.where(np.arange(n) > 0, 0.5, 1.0)
    x = tmg.solve_toeplitz(c, np.full(n, 2.0**504 * 1.5))
    assert_allclose(x / 2.0**1000, 3.0 / (n + 1.0) * 2.0**24, rtol=1e-12)


def test_a_subnormal_solution_although_the_quotient_of_the_sizes_is_zero():
    """A has the eigenvalue 2^-20, of a vector on which no digit is lost."""
    c, b = 2.0**100 * np.array([1.0, 1.0 - 2.0**-20]), np.array([1.0, -1.0])
    assert np.array_equal(tmg.solve_toeplitz(c, 2.0**-980 * b), 2.0**-1060 * b)


@pytest.mark.parametrize("n", [3, 300])
@pytest.mark.parametrize("small", ["real", "imag"])
def test_one_part_may_lose_its_digits_where_the_other_has_them(n, small):
    c = np.where(np.arange(n) > 0, 0.0, 3.0)
    c[1] = 1.0
    u, v = np.random.default_rng(0).standard_normal((2, n))
    u, v = 1e-290 * u, 1e-319 * v
    x = tmg.solve_toeplitz(c, u + 1j * v if small == "imag" else v + 1j * u)
    large, lost = (x.real, x.imag) if small == "imag" else (x.imag, x.real)
    assert_allclose(large, tmg.solve_toeplitz(c, u), rtol=1e-10)
    assert np.abs(lost).max() <= 1e-317


def test_small_entries_beside_large_ones_may_underflow():
    """Those of the inverse decay as 0.38 to the power of the distance."""
    c, b = np.eye(1, 100)[0] * 3.0 + np.eye(1, 100, 1)[0], np.eye(1, 100)[0]
    x = tmg.solve_toeplitz(1e200 * c, 1e-90 * b)
    assert_allclose(x * 1e290, tmg.solve_toeplitz(c, b), rtol=0, atol=1e-12)


@pytest.mark.parametrize(("of_c", "of_b", "size"), [(200, -150, "-350"), (-200, 150, "[+]350")])
@pytest.mark.parametrize("column", [0, 1])
def test_an_error_names_the_size_that_is_out_of_range(of_c, of_b, size, column):
    """It is that of the column of which it is told."""
    B = np.ones((3, 2)) * 10.0 ** (of_c // 2)
    B[:, column] = 10.0**of_b
    with pytest.raises(np.linalg.LinAlgError, match=f"the solution is of size 1e{size}, but must"):
        tmg.solve_toeplitz(10.0**of_c * np.eye(1, 3)[0], B)


@pytest.mark.parametrize("kind", [float, complex])
def test_both_parts_may_be_as_large_as_float64_has_numbers(kind):
    """Though the absolute value of such a complex number overflows."""
    c, b = np.array([1, 0], kind), np.array([1.5e308 * (1 + 1j), 0])
    np.testing.assert_array_equal(tmg.solve_toeplitz(c, b), b)
