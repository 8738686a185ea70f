"""Log-determinants and their derivatives are right to within the error that they say.

Against dense matrices, longer numbers, and matrices whose determinant is known.
"""

import math
from fractions import Fraction
from functools import partial

import numpy as np
import pytest
import scipy.linalg
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import toeplitz_mg as tmg
from comparisons.systems.symbols import HERMITIAN, NONSYMMETRIC, column
from tests.systems import in_long_numbers, refuses
from toeplitz_mg.covariances import FractionalGaussianNoise, Matern

# Of condition numbers up to 10⁷ at n = 1500.
NAMES = (
    *("θ⁴ + 1", "(1+k)^-1.1", "cos k/(k+1)", "0.9^k", "exp(-k/1000)", "Gaussian", "contact"),
    *("|θ|", "|θ|^1.5", "2 - 2 cos θ", "2 + 2 cos θ"),
)
COVARIANCES = {name: partial(column, name) for name in NAMES} | {
    "fGn, H = 0.3": FractionalGaussianNoise(hurst=0.3),
    "fGn, H = 0.75": FractionalGaussianNoise(hurst=0.75),
    "fGn, H = 0.99": FractionalGaussianNoise(hurst=0.99),
    "Matérn 3/2, ℓ = 5": Matern(length=5.0, nu=1.5),
    "Matérn 3/2, ℓ = 20": Matern(length=20.0, nu=1.5),
}
each_covariance = pytest.mark.parametrize("name", COVARIANCES)


def covariance(name, n):
    c = COVARIANCES[name](n)
    return c / c[0]


def dense_sums(A):
    """Σ_i (A⁻¹)_(i,i+k), by a dense inverse."""
    inverse = np.linalg.inv(A)
    return np.array([np.trace(inverse, k) for k in range(len(A))])


@each_covariance
def test_is_that_of_the_dense_matrix(name):
    for n in (1, 2, 3, 64, 65, 1500):
        c = covariance(name, n)
        factor = np.linalg.cholesky(scipy.linalg.toeplitz(c))
        dense = 2.0 * np.log(factor.diagonal()).sum()
        assert tmg.toeplitz_logdet(c) == pytest.approx(dense, rel=1e-12, abs=1e-14), f"n = {n}"


@each_covariance
def test_of_an_inverse_too_and_the_error_is_below_what_it_says(name):
    """A dense factorisation in float64 may be off by more than is said."""
    for n in (2, 100, 400):
        c = covariance(name, n)
        inverse, (determinant, *_) = (
            tmg.toeplitz_inverse(tmg.ToeplitzOperator(c)),
            in_long_numbers(c),
        )
        assert abs(inverse.logdet - determinant) <= inverse.logdet_error, f"n = {n}"
        assert inverse.logdet_error <= 1e-11 * abs(determinant), f"n = {n}"


@each_covariance
def test_diagonal_sums_are_those_of_the_dense_inverse(name):
    for n in (1, 2, 3, 100, 701):
        c = covariance(name, n)
        found = tmg.toeplitz_inverse(tmg.ToeplitzOperator(c)).diagonal_sums
        sums = dense_sums(scipy.linalg.toeplitz(c))
        assert_allclose(found, sums, rtol=0, atol=1e-10 * abs(sums).max(), err_msg=f"n = {n}")


@pytest.mark.parametrize("n", [2, 65, 600])
@pytest.mark.parametrize("name", HERMITIAN)
def test_of_hermitian_matrices(name, n):
    c, r = HERMITIAN[name](n)
    A = scipy.linalg.toeplitz(c, r)
    dense = np.linalg.slogdet(A)[1]
    assert tmg.toeplitz_logdet(c) == pytest.approx(dense, rel=1e-11, abs=1e-12)
    sums, exact = tmg.toeplitz_inverse(tmg.ToeplitzOperator(c)).diagonal_sums, dense_sums(A)
    assert_allclose(sums, exact, rtol=0, atol=1e-10 * abs(exact).max())


@pytest.mark.parametrize("phi", [0.5, -0.9, 0.999])
def test_of_long_autoregressive_series_is_that_of_their_prediction_errors(phi):
    n = 200_003
    exact = (n - 1) * np.log1p(-(phi**2))
    assert tmg.toeplitz_logdet(phi ** np.arange(n)) == pytest.approx(exact, rel=1e-12)


def sums_of(x):
    """Σ_i (A⁻¹)_(i,i+k) by the formula of Gohberg and Semencul, from the column x of A⁻¹."""
    n = len(x)
    weights = (n - 2.0 * np.arange(n)) * x / x[0]
    return np.array([(weights[: n - k] - k * x[: n - k] / x[0]) @ x[k:] for k in range(n)])


# Of condition numbers of 3 10⁶, 3 10⁷ and 3 10⁷.
@pytest.mark.parametrize("name", ["sinc", "Matérn 3/2", "1/(1 + k²/100)"])
@pytest.mark.parametrize("n", [100, 600])
def test_all_is_right_to_the_last_digits_however_large_the_condition_number(name, n):
    c = column(name, n)
    determinant, x, _ = in_long_numbers(c)
    assert tmg.toeplitz_logdet(c) == pytest.approx(determinant, rel=1e-12)
    inverse = tmg.toeplitz_inverse(tmg.ToeplitzOperator(c), rtol=1e-3)
    assert abs(inverse.logdet - determinant) <= inverse.logdet_error
    sums = sums_of(x)
    assert_allclose(inverse.diagonal_sums, sums, rtol=0, atol=1e-12 * abs(sums).max())


@pytest.mark.filterwarnings("ignore::scipy.linalg.LinAlgWarning")
@settings(deadline=None, max_examples=60)
@given(st.integers(1, 300), st.integers(0, 1000), st.floats(0.05, 1.5))
def test_refuses_what_is_not_positive_definite(n, seed, weight):
    """Some of these matrices are positive definite, some are not; it knows which."""
    c = weight * np.random.default_rng(seed).standard_normal(n) / (1 + np.arange(n))
    c[0] = 1.0
    eigenvalues = np.linalg.eigvalsh(scipy.linalg.toeplitz(c))
    if eigenvalues[0] > 1e-12:
        found = tmg.toeplitz_logdet(c)
        assert found == pytest.approx(np.log(eigenvalues).sum(), abs=1e-2)
    elif eigenvalues[0] < -1e-12:
        refuses(np.linalg.LinAlgError, "is not positive definite", tmg.toeplitz_logdet, c)


def test_what_float64_does_not_reach_is_said():
    k = np.arange(2000)
    c = np.exp(-((k / 50) ** 2)) + 1e-12 * (k == 0)
    with pytest.warns(scipy.linalg.LinAlgWarning, match=r"error of up to .*larger c\[0\]"):
        value = tmg.toeplitz_logdet(c)
    assert value == pytest.approx(-26032.0 * 2, rel=1e-3)


@pytest.mark.parametrize(
    ("c", "n"),
    [
        ([1.0, 2.0], 2),
        ([1.0, 0.5, 0.9, -0.9], 4),
        (np.r_[1.0, np.full(299, 0.2), 3.0, np.zeros(500)], 301),
        (np.r_[1.0, np.full(1999, 0.2), 3.0, np.zeros(500)], 2001),
        # The Laplacian of a ring: constants are in its kernel.
        *((np.r_[2.0, -1.0, np.zeros(n - 3), -1.0], n) for n in (101, 257)),
    ],
)
def test_refuses_what_is_not_positive_definite_and_says_by_which_n(c, n):
    message = rf"leading {n} x {n} block .* (nugget|use a larger c\[0\])"
    refuses(np.linalg.LinAlgError, message, tmg.toeplitz_logdet, c)


@pytest.mark.parametrize(
    ("c", "error", "message"),
    [
        ([-1.0], np.linalg.LinAlgError, "diagonal"),
        ([0.0, 0.0], np.linalg.LinAlgError, "diagonal"),
        # Not so in float64.
        (np.exp(-((np.arange(3e3) / 100) ** 2)), np.linalg.LinAlgError, r"leading \d+ x .* nugget"),
        (([2.0, 1.0], [2.0, 0.5]), ValueError, "c is a pair, but must be"),
        (scipy.linalg.toeplitz([4.0, 1.0, 0.5]), ValueError, "must have one axis"),
        ([2.0 + 1.0j, 1.0], ValueError, "must be real"),
        ([2.0, np.nan], ValueError, "finite"),
        (tmg.ToeplitzOperator([2.0, 1.0]), TypeError, r"use toeplitz_logdet\(A\.c\), or toepl"),
    ],
)
def test_refuses_bad_arguments(c, error, message):
    with pytest.raises(error, match=message):  # And no warning.
        tmg.toeplitz_logdet(c)


def test_refuses_arrays_of_other_libraries_and_general_inverses():
    xp = pytest.importorskip("array_api_strict")
    with pytest.raises(TypeError, match="array_api_strict, but must be one of numpy"):
        tmg.toeplitz_logdet(xp.asarray([2.0, 1.0]))
    general = tmg.toeplitz_inverse(tmg.ToeplitzOperator(*NONSYMMETRIC["convection-diffusion"](50)))
    for name in ("logdet", "logdet_error", "diagonal_sums"):
        refuses(TypeError, "positive definite", getattr, general, name)


def test_takes_single_precision_for_what_it_is():
    c = covariance("fGn, H = 0.75", 300).astype(np.float32)
    exact = np.linalg.slogdet(scipy.linalg.toeplitz(c.astype(float)))[1]
    assert tmg.toeplitz_logdet(c) == pytest.approx(exact, rel=1e-12)
    assert tmg.toeplitz_inverse(tmg.ToeplitzOperator(c)).logdet == pytest.approx(exact, rel=1e-12)


@pytest.mark.parametrize("n", [5, 300, 3000])
@pytest.mark.parametrize("power", [-900, -400, 400, 900])
def test_a_unit_adds_its_logarithm_for_each_unknown(n, power):
    c = 0.9 ** np.arange(n)
    expected = tmg.toeplitz_logdet(c) + n * power * np.log(2.0)
    assert tmg.toeplitz_logdet(c * 2.0**power) == pytest.approx(expected, rel=1e-13)


@pytest.mark.parametrize("number", [1e-60, 1.0, 2.0 + 0j, 1e60 + 0j])
def test_of_a_single_unknown_it_is_the_logarithm_of_a_number(number):
    value = math.log(abs(number))
    assert_allclose(tmg.toeplitz_logdet([number]), value, rtol=1e-15, atol=1e-15)
    inverse = tmg.toeplitz_inverse(tmg.ToeplitzOperator([number]))
    assert_allclose(inverse.logdet, value, rtol=1e-15, atol=1e-15)
    assert_allclose(inverse.diagonal_sums, [1.0 / number], rtol=1e-13)


@pytest.mark.parametrize("n", [100, 300, 1000])
@pytest.mark.parametrize("condition", [1e3, 1e6, 1e9, 1e12])
@pytest.mark.filterwarnings("ignore::scipy.linalg.LinAlgWarning")
def test_the_error_of_a_constant_and_a_nugget_is_below_what_it_says(n, condition):
    """The zero of its polynomial is a difference of numbers, next to the circle."""
    c = np.ones(n)
    c[0] += n / condition
    rest = float(Fraction(float(c[0])) - 1)
    exact = (n - 1) * np.log(rest) + np.log(rest + n)
    process = tmg.ToeplitzNormal(c)
    assert abs(process.logdet - exact) <= process.logdet_error


def test_that_of_an_inverse_is_warned_of_too():
    k = np.arange(300)
    c = np.exp(-((k / 6.0) ** 2)) + 1e-14 * (k == 0)
    inverse = tmg.toeplitz_inverse(tmg.ToeplitzOperator(c), rtol=0.5)
    with pytest.warns(scipy.linalg.LinAlgWarning, match="with an error of up to") as told:
        _ = inverse.logdet
    assert told[0].filename == __file__


@pytest.mark.parametrize(
    ("n", "width", "exact"),
    [
        (24, 0.5022729872720268, -182.053),
        (37, 0.6200866646266424, -236.377),
        (28, 0.5094624538603201, -235.131),
    ],
)
def test_the_last_matrices_that_are_definite_in_float64_are_warned_of(n, width, exact):
    """Prolate matrices, with condition numbers of some 1e15; exact is by 80 digits."""
    c = np.sinc(np.arange(n) * width)
    with pytest.warns(scipy.linalg.LinAlgWarning, match="with an error of up to"):
        value = tmg.toeplitz_logdet(c)
    assert abs(value - exact) <= tmg.ToeplitzNormal(c).logdet_error


@pytest.mark.parametrize(("n", "most"), [(513, 3e-11), (1024, 3e-11), (4096, 1e-6)])
@pytest.mark.parametrize("noise", [1.0, 1e-2])
@pytest.mark.filterwarnings("ignore::scipy.linalg.LinAlgWarning")
def test_of_plane_waves_in_noise_the_error_is_below_what_it_says(n, most, noise):
    """Their frequencies are such that each number is exact, as is Woodbury's determinant."""
    k = np.arange(float(n))
    frequencies, powers = np.array([0.3125, 1.125, -2.0]), np.array([10.0, 5.0, 100.0])
    waves = np.exp(1j * np.outer(k, frequencies))
    c = waves @ powers
    c[0] += noise
    small = np.eye(3) + powers[:, None] * (waves.conj().T @ waves) / noise
    exact = n * np.log(noise) + np.linalg.slogdet(small)[1]
    inverse = tmg.toeplitz_inverse(tmg.ToeplitzOperator(c), rtol=1e-3)
    assert abs(inverse.logdet - exact) <= inverse.logdet_error <= most * n
