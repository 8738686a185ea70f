"""Reflection coefficients are the last numbers of the best linear predictions of all orders.

They are right to the digits that the condition number leaves, of real and of Hermitian matrices.
"""

import numpy as np
import pytest
import scipy.linalg
from numpy.testing import assert_allclose

import toeplitz_mg as tmg
from comparisons.systems.symbols import HERMITIAN, column
from tests.budgets import assert_within_budget
from tests.systems import in_long_numbers, refuses

COVARIANCES = [
    *("θ⁴ + 1", "(1+k)^-1.1", "cos k/(k+1)", "exp(-k/1000)", "contact", "|θ|", "2 + 2 cos θ")
]


@pytest.mark.parametrize("n", [1, 2, 3, 40])
@pytest.mark.parametrize("name", [*COVARIANCES, *HERMITIAN])
def test_each_is_the_last_number_of_a_prediction(name, n):
    c = HERMITIAN[name](max(n, 3))[0][:n] if name in HERMITIAN else column(name, max(n, 3))[:n]
    orders = range(1, n)
    expected = [np.linalg.solve(scipy.linalg.toeplitz(c[:k]), c[1 : k + 1])[-1] for k in orders]
    assert_allclose(tmg.reflection_coefficients(c), expected, rtol=0, atol=1e-11)


@pytest.mark.parametrize(
    ("name", "n", "turn"),
    [(name, 300, turn) for name in COVARIANCES for turn in (0.0, 1.0)] + [("contact", 2100, 0.0)],
)
def test_they_are_the_ratios_of_the_prediction_errors(name, turn, n):
    """Which are the squares of the diagonal of Cholesky's factor."""
    c = column(name, n) * (np.exp(1j * turn * np.arange(n)) if turn else 1.0)
    errors = np.linalg.cholesky(scipy.linalg.toeplitz(c)).diagonal().real ** 2
    gamma = tmg.reflection_coefficients(c)
    assert_allclose(1.0 - np.abs(gamma) ** 2, errors[1:] / errors[:-1], rtol=1e-9)
    logdet = n * np.log(c[0].real) + np.arange(n - 1, 0, -1) @ np.log1p(-(np.abs(gamma) ** 2))
    assert logdet == pytest.approx(tmg.toeplitz_logdet(c), rel=1e-11, abs=1e-13 * n)


@pytest.mark.parametrize("n", [100, 600])
@pytest.mark.parametrize("name", [*COVARIANCES, "sinc", "Matérn 3/2"])
def test_they_have_the_digits_that_the_condition_number_leaves(name, n):
    c = column(name, n)
    eigenvalues = np.linalg.eigvalsh(scipy.linalg.toeplitz(c))
    *_, expected = in_long_numbers(c)
    atol = 1e-14 * eigenvalues[-1] / eigenvalues[0]
    assert_allclose(tmg.reflection_coefficients(c), expected, rtol=0, atol=max(atol, 1e-13))


@pytest.mark.parametrize("n", [30, 2000, 10_000])
def test_of_an_autoregressive_process_they_are_zero_from_its_order_on(n):
    c = np.empty(n)
    c[:2] = 1.0, 0.5
    for k in range(2, n):
        c[k] = 0.4 * c[k - 1] + 0.2 * c[k - 2]
    gamma = tmg.reflection_coefficients(c)
    assert_allclose(gamma[:2], [0.5, 0.2], rtol=1e-13)
    assert_allclose(gamma[2:], 0.0, atol=1e-13)


def test_the_unit_of_the_covariances_makes_no_difference():
    c = column("contact", 50)
    expected = tmg.reflection_coefficients(c)
    for power in (-900, 900):
        assert_allclose(tmg.reflection_coefficients(c * 2.0**power), expected, rtol=1e-14)


@pytest.mark.parametrize("dtype", [np.float32, np.complex64])
def test_single_precision_stays_single(dtype):
    c = column("contact", 50).astype(dtype)
    gamma = tmg.reflection_coefficients(c)
    assert gamma.dtype == dtype
    expected = tmg.reflection_coefficients(c.astype(np.result_type(dtype, np.float64)))
    assert_allclose(gamma, expected, rtol=1e-6)


@pytest.mark.parametrize(
    ("c", "n"), [([1.0, 2.0], 2), ([1.0, 1.0, 1.0], 2), ([1.0, 0.5, 0.9, -0.9], 4)]
)
def test_the_block_that_is_not_positive_definite_is_named(c, n):
    for padding in (0, 3000):
        with pytest.raises(np.linalg.LinAlgError, match=rf"leading {n} x {n} block"):
            tmg.reflection_coefficients([*c, *[0.0] * padding])


def test_refuses_bad_arguments():
    refuses(np.linalg.LinAlgError, "diagonal", tmg.reflection_coefficients, [-1.0, 0.0])
    refuses(ValueError, "must have one axis", tmg.reflection_coefficients, [[2.0, 1.0], [0.5, 0.1]])
    refuses(ValueError, "must be real", tmg.reflection_coefficients, [2.0 + 1.0j, 1.0])
    with pytest.raises(TypeError, match=r"use reflection_coefficients\(A\.c\)"):
        tmg.reflection_coefficients(tmg.ToeplitzOperator([2.0, 1.0]))


def spectral_lines(n):
    """Autocovariances of a detector's noise: three lines in a spectrum of eight decades."""
    f = np.maximum(np.fft.rfftfreq(32768, 1 / 4096), 5.0)
    floor = 1e-46 * ((20 / f) ** 14 + 1 + (f / 300) ** 2)
    lines = sum(1e-42 * np.exp(-0.5 * ((f - center) / 0.05) ** 2) for center in (60, 180, 500))
    return np.fft.irfft(floor + lines)[:n] * 2.0**133


@pytest.mark.parametrize("n", [100, 512, 600])
def test_no_digits_of_a_determinant_are_lost_where_the_spectrum_has_lines(n):
    c = spectral_lines(n)
    logdet, *_ = in_long_numbers(c)
    assert tmg.toeplitz_logdet(c) == pytest.approx(logdet, rel=1e-12)
    assert abs(tmg.toeplitz_logdet(c) - logdet) <= tmg.ToeplitzNormal(c).logdet_error


def test_lines_in_the_spectrum_take_no_longer_series():
    """The series of the cepstrum would take thousands of samples for each unknown."""
    n = 2048
    with tmg.count_products() as work:
        found = tmg.toeplitz_logdet(spectral_lines(n))
    assert_within_budget("toeplitz_logdet, lines, n = 2048", work_units=work.units(n))
    dense = np.linalg.cholesky(scipy.linalg.toeplitz(spectral_lines(n))).diagonal()
    assert found == pytest.approx(2.0 * np.log(dense).sum(), rel=1e-11)
