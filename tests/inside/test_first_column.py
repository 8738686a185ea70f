"""The first column of the inverse of a Toeplitz matrix, from which all of it follows.

The Schur algorithm is Levinson's recursion in O(n log² n); the factors of a symbol give the column
but for the ends; a step of Newton's method squares the error; and residuals with more digits than
double precision make the last digits right.
"""

from fractions import Fraction

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import toeplitz

import toeplitz_mg as tmg
from comparisons.systems.symbols import COLUMNS, NONSYMMETRIC, column
from tests.budgets import assert_within_budget
from toeplitz_mg.columns.circle import circle_of
from toeplitz_mg.columns.columns import Columns
from toeplitz_mg.columns.schur import schur_column
from toeplitz_mg.columns.spectral_factor import factor_symbol
from toeplitz_mg.solvers.long_residual import LongResidual


def levinson(c):
    """Levinson's recursion as in any textbook: the predictor and the Schur parameters."""
    a, error, gamma = np.ones(1), c[0].real, []
    for m in range(len(c) - 1):
        gamma.append(-(a @ c[m + 1 : 0 : -1]) / error)
        a = np.append(a, 0.0) + gamma[-1] * np.append(0.0, a[::-1].conj())
        error *= 1.0 - abs(gamma[-1]) ** 2
    return a / error, np.array(gamma)


@pytest.mark.parametrize("name", ["of two lags", *COLUMNS])
def test_is_levinsons_recursion(name):
    """Of a real matrix, and of a Hermitian one, whose symbol is turned by one radian."""
    for n in (1, 2) if name == "of two lags" else (3, 33, 64, 65, 211, 600):
        real = np.array([2.0, 0.5])[:n] if n < 3 else column(name, n)
        eigenvalues = np.linalg.eigvalsh(toeplitz(real))  # The turn does not change them.
        condition = eigenvalues[-1] / abs(eigenvalues[0])
        for c in (real, real * np.exp(1j * np.arange(n))):
            (x, gamma), (x_levinson, gamma_levinson) = schur_column(c), levinson(c)
            atol, case = 1e-14 * condition * abs(x_levinson).max(), f"{c.dtype}, n = {n}"
            assert_allclose(x, x_levinson, atol=atol, rtol=1e-13, err_msg=case)
            atol = max(1e-13, 1e-15 * condition)
            assert_allclose(gamma, gamma_levinson, atol=atol, err_msg=case)
            scale = abs(c).sum() * np.linalg.norm(x)
            assert np.linalg.norm(toeplitz(c) @ x - np.eye(1, n)[0]) <= 1e-13 * scale, case


def test_the_schur_algorithm_takes_the_work_of_some_thirty_products():
    n = 2**14
    with tmg.count_products() as work:
        schur_column(column("2 - 2 cos θ", n))
    assert_within_budget("Schur algorithm, n = 2^14", work_units=work.units(n))


@pytest.mark.parametrize("n", [2, 40, 600])
@pytest.mark.parametrize(
    ("a", "b", "scale"),
    [(0.5, -0.4, 1.0), (0.0, 0.9, -3.0), (0.3 + 0.4j, 0.2 - 0.5j, 2.0j), (0.9j, 0.0, 1e-30)],
)
def test_columns_of_the_factors_of_a_symbol_are_those_of_the_factors(n, a, b, scale):
    """(1 - a z)(1 - b/z) has the inverse factors Σ aᵏ zᵏ and Σ bᵏ z⁻ᵏ."""
    c, r = np.zeros((2, n), np.result_type(a, b, scale))
    c[:2], r[:2] = (scale * (1 + a * b), -scale * a), (scale * (1 + a * b), -scale * b)
    columns = factor_symbol(tmg.ToeplitzOperator(c, r))
    k = np.arange(n)
    if n > 100:  # Before that the samples are too few for so slow a decay.
        assert_allclose(columns.x * scale, a**k, atol=1e-12)
        assert_allclose(columns.w.conj() * scale, np.asarray(b) ** k, atol=1e-12)
    assert_allclose(columns.x[0], columns.w[0].conj(), rtol=1e-13)


def test_a_step_of_newtons_method_squares_the_error():
    n = 300
    c, r = NONSYMMETRIC["1/(1+k) | (-1)^k/(1+k)"](n)
    turn = np.exp(0.7j * np.arange(n))
    A = tmg.ToeplitzOperator((1 + 2j) * c * turn, (1 + 2j) * r / turn)
    inverse = np.linalg.inv(A.toarray())
    exact = inverse[:, 0], inverse[0].conj()
    noise = 1 + 1e-3 * np.random.default_rng(0).standard_normal((2, n))
    columns = Columns(A, *(noise * exact))
    sizes = [columns.residual]
    for _ in range(3):
        columns = columns.improve()
        sizes.append(columns.residual)
    assert sizes[1] <= 1e-1 * sizes[0]
    assert sizes[2] <= 1e-3 * sizes[1]
    assert sizes[3] <= 1e-13
    assert_allclose([columns.x, columns.w], exact, atol=1e-13)
    assert_allclose(columns.inverse @ np.eye(n), inverse, atol=1e-12 * abs(inverse).max())


@pytest.mark.parametrize("turn", [0.0, 1.0])
def test_residuals_have_more_than_double_precision(turn):
    """Against fractions, of a real matrix and of a Hermitian one."""
    n = 30
    k, rng = np.arange(n), np.random.default_rng(0)
    c, b, x = (1.0 + k) ** -0.5, *rng.standard_normal((2, n))
    if turn:
        c, b, x = c * np.exp(1j * k), b + 1j * rng.standard_normal(n), x * np.exp(3j * k)

    def parts(numbers):
        return [[Fraction(float(v)) for v in part.ravel()] for part in (numbers.real, numbers.imag)]

    (b_real, b_imag), (x_real, x_imag) = parts(b), parts(x)
    found = LongResidual(c)(b, x)
    for i, row in enumerate(toeplitz(c)):
        real, imag = parts(row)
        exact_real = b_real[i] - sum(p * q for p, q in zip(real, x_real, strict=True))
        exact_real += sum(p * q for p, q in zip(imag, x_imag, strict=True))
        exact_imag = b_imag[i] - sum(p * q for p, q in zip(real, x_imag, strict=True))
        exact_imag -= sum(p * q for p, q in zip(imag, x_real, strict=True))
        # The result itself is in double precision; what it is made of has an error of 2⁻²⁰ ε.
        assert found[i].real == pytest.approx(float(exact_real), rel=1e-15, abs=1e-20)
        assert found[i].imag == pytest.approx(float(exact_imag), rel=1e-15, abs=1e-20)


# Values of polynomials on the unit circle ------------------------------------------------------

each_kind = pytest.mark.parametrize("kind", [np.float64, np.complex128])


def series(n, kind):
    x = np.random.default_rng(n).standard_normal((2, n))
    return x[0] + 1j * x[1] if kind is np.complex128 else x[0]


@each_kind
@pytest.mark.parametrize("n", [1, 2, 3, 40, 127])
def test_the_path_has_the_values_at_equal_distances(n, kind):
    """From 1 to -1 of a real series, with both of them; and all around of a complex one."""
    x, circle = series(n, kind), circle_of(2 * n + 3, np.dtype(kind))
    path = circle.path(x, circle.values(x))
    step = 2 * np.pi / circle.points
    angles = step * np.arange(circle.points + 1)
    if kind is np.float64:
        angles = np.r_[0.0, step * (np.arange(circle.points // 2) + 0.5), np.pi]
    expected = np.exp(-1j * np.outer(angles, np.arange(n))) @ x
    assert_allclose(path, expected, rtol=0, atol=1e-11 * n)


@each_kind
@pytest.mark.parametrize("n", [1, 2, 3, 40, 33_000])
@pytest.mark.parametrize("oversampling", [2, 5])
def test_coefficients_are_those_of_the_series_and_of_its_autocorrelations(n, kind, oversampling):
    x, circle = series(n, kind), circle_of(oversampling * n, np.dtype(kind))
    z = circle.values(x)
    found = circle.coefficients(z, circle.points)
    assert_allclose(found, np.append(x, np.zeros(circle.points - n)), rtol=0, atol=1e-11)
    squares = circle.coefficients(z.real**2 + z.imag**2, n)
    for lag in {0, 1, n // 2, n - 1} - {n}:
        assert squares[lag] == pytest.approx(np.vdot(x[: n - lag], x[lag:]), rel=0, abs=1e-10 * n)


@each_kind
def test_what_wraps_around_has_the_sign_of_the_power_of_the_points(kind):
    """Of z^(N + 3) the coefficient 3: zᴺ is -1 at the points for real series, and 1 at others."""
    circle = circle_of(16, np.dtype(kind))
    unit = np.eye(1, 4, 3)[0].astype(kind)
    turns = circle.values(np.eye(1, 2, 1)[0].astype(kind)) ** circle.points
    found = circle.coefficients(turns * circle.values(unit), circle.points)
    sign = -1.0 if kind is np.float64 else 1.0
    assert_allclose(found, sign * np.eye(1, circle.points, 3)[0], rtol=0, atol=1e-12)
