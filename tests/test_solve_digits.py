"""No wrong answer without an error: residuals are small, are told as they are, or are refused."""

import subprocess
import sys
import warnings
from fractions import Fraction

import numpy as np
import pytest
import scipy.linalg
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import toeplitz_mg as tmg
from comparisons.systems.symbols import COLUMNS, column, fourier
from tests.budgets import assert_within_budget
from tests.systems import random, residual

EPS = 2.0**-52
DOUBTFUL = 1e-8  # Residual of which the user is warned.


def left_as_it_is(n):
    """The backward error of a recursion that is corrected only where an `rtol` is given."""
    return 3e-12 if n <= 256 else 5e-12


@pytest.mark.parametrize("columns", [1, 3, 40])
@pytest.mark.parametrize("n", [150, 700, 2100])
@pytest.mark.parametrize("name", COLUMNS)
def test_the_backward_error_is_that_of_a_direct_method(name, n, columns):
    c = column(name, n)
    A = scipy.linalg.toeplitz(c)
    b = A @ random(n, columns)
    x, info = tmg.solve_toeplitz(c, b, full_output=True)
    residual = np.linalg.norm(b - A @ x, axis=0)
    scale = np.linalg.norm(A) * np.linalg.norm(x, axis=0)
    size = np.linalg.norm(b, axis=0)
    assert (residual <= np.maximum(1e-13 * scale, 1e-12 * size)).all()
    assert info.residual == pytest.approx((residual / size).max(), abs=1e-13)
    assert_within_budget("definite systems, rtol = 1e-12", iterations=info.iterations)


def rational(n, p, q):
    """Symbol |p(z)|²/|q(z)|² with poles and zeros at given radii."""
    theta = 2 * np.pi * np.arange(16 * n) / (16 * n)
    f = np.ones(16 * n)
    for radius, angle in p:
        f *= abs(1 - radius * np.exp(1j * (theta - angle))) ** 2
        f *= abs(1 - radius * np.exp(1j * (theta + angle))) ** 2
    for radius, angle in q:
        f /= abs(1 - radius * np.exp(1j * (theta - angle))) ** 2
        f /= abs(1 - radius * np.exp(1j * (theta + angle))) ** 2
    return np.fft.ifft(f).real[:n]


def fisher_hartwig(n, at_zero, at_pi):
    """Symbol |1 - z|^2α |1 + z|^2β, with zeros or (integrable) poles."""
    return fourier(
        lambda t: (
            np.maximum(2 * np.sin(t / 2), 0.05 / n) ** at_zero
            * np.maximum(2 * np.cos(t / 2), 0.05 / n) ** at_pi
        ),
        n,
    )


def covariance(n, length, power, nugget):
    k = np.arange(n)
    return np.exp(-((k / length) ** power)) + nugget * (k == 0)


radii_and_angles = st.lists(
    st.tuples(st.floats(0.0, 0.98), st.floats(0.0, np.pi)), min_size=0, max_size=3
)

families = st.integers(1, 2000).flatmap(
    lambda n: st.one_of(
        st.builds(rational, st.just(n), radii_and_angles, radii_and_angles),
        st.builds(fisher_hartwig, st.just(n), st.floats(-0.9, 3.0), st.floats(-0.9, 3.0)),
        st.builds(
            covariance,
            st.just(n),
            st.floats(0.1, 500.0),
            st.floats(0.3, 2.0),
            st.floats(0.0, 1.0).map(lambda t: t**8),
        ),
    )
)


@pytest.mark.slow
@settings(deadline=None, max_examples=100)
@given(families, st.sampled_from([1, 2, 5]), st.booleans(), st.integers(0, 99))
def test_against_cholesky(c, columns, rough, seed):
    """The error is within the condition number, or it is refused, or there is a warning."""
    n = len(c)
    A = scipy.linalg.toeplitz(c)
    try:
        factor = scipy.linalg.cho_factor(A, lower=True)
        reciprocal, _ = scipy.linalg.lapack.dpocon(factor[0], np.linalg.norm(A, 1), uplo="L")
        condition = 1 / max(reciprocal, 1e-300)
    except np.linalg.LinAlgError:
        factor, condition = None, np.inf
    b = np.random.default_rng(seed).standard_normal((n, columns)) if rough else np.ones((n, 1))
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", scipy.linalg.LinAlgWarning)
            x = tmg.solve_toeplitz(c, b)
    except np.linalg.LinAlgError:
        assert condition > 1e13
        return
    if condition < 1e13:
        expected = scipy.linalg.cho_solve(factor, b)
        error = np.linalg.norm(x - expected, axis=0) / np.linalg.norm(expected, axis=0)
        residual = np.linalg.norm(b - A @ x, axis=0)
        rounding = np.abs(c).sum() * np.linalg.norm(x, axis=0)
        assert np.all(residual <= 1.1e-12 * np.linalg.norm(b, axis=0) + 1e-14 * rounding)
        # The condition number is an estimate, which may be less than it is.
        assert error.max() <= 5e-12 * condition


def test_the_better_of_two_methods_is_taken():
    """Levinson's recursion loses four digits here, LU none."""
    rng = np.random.default_rng(95)
    c = np.r_[1e-15, np.round(3 * rng.standard_normal(4))]
    r = np.r_[1e-15, np.round(3 * rng.standard_normal(4))]
    b = rng.standard_normal(5)
    _, info = tmg.solve_toeplitz((c, r), b, full_output=True)
    assert info.backward_error <= 1e-15


# Matrices without a symbol ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("n", "is_symmetric"),
    [(60, False), (60, True), (200, False), (200, True), (300, False), (300, True), (2000, False)],
)
def test_an_answer_without_a_symbol_is_that_of_scipy_unless_a_residual_is_asked_for(
    n, is_symmetric
):
    """Levinson's recursion loses some digits there, and to correct that takes as long again."""
    seen, accepted = 0, left_as_it_is(n)
    for seed in range(4):
        c, r, b = np.random.default_rng([seed, n]).standard_normal((3, n))
        if is_symmetric:
            c[0], r = 0.5 * c[0], c
        recursive = scipy.linalg.solve_toeplitz((c, r), b)
        size = np.abs(c).sum() + np.abs(r[1:]).sum()
        error = np.linalg.norm(b - scipy.linalg.matmul_toeplitz((c, r), recursive))
        error /= size * np.linalg.norm(recursive) + np.linalg.norm(b)
        x, info = tmg.solve_toeplitz((c, r), b, full_output=True)
        assert info.backward_error <= accepted
        if error < accepted / 3 and info.residual <= DOUBTFUL / 3:
            assert_allclose(x, recursive, rtol=1e-14)
            assert info.iterations == 1
            seen += 1
        _, info = tmg.solve_toeplitz((c, r), b, rtol=1e-12, full_output=True)
        assert info.residual <= 1e-12
    assert seen


def test_a_recursion_that_loses_digits_is_told_or_corrected():
    """Its backward error is in proportion to ε over the least leading block, here the first."""
    rng, outcomes = np.random.default_rng(3), set()
    for pivot in 10.0 ** -np.arange(3.0, 10.0):
        c, r, b = rng.standard_normal((3, 300))
        c[0] = pivot
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            _, info = tmg.solve_toeplitz((c, r), b, full_output=True)
        assert info.backward_error <= left_as_it_is(300)
        is_doubtful = info.residual > DOUBTFUL
        assert [warning.category for warning in told] == is_doubtful * [scipy.linalg.LinAlgWarning]
        outcomes.add(info.iterations > 1)
    assert outcomes == {False, True}


@pytest.mark.parametrize(("n", "seed"), [(200, 5088), (256, 1899), (1000, 38)])
def test_well_conditioned_random_matrices_are_not_warned_of(n, seed):
    """A small one is corrected where its residual would be; the condition numbers are below 1e5."""
    c, r, b = np.random.default_rng(seed).standard_normal((3, n))
    _, info = tmg.solve_toeplitz((c, r), b, full_output=True)
    assert info.residual <= DOUBTFUL
    assert info.backward_error <= left_as_it_is(n)


@pytest.mark.parametrize("n", [5, 100, 316, 1023])
def test_a_leading_block_that_is_nearly_singular_takes_few_recursions(n):
    for seed in range(3):
        c, r, b = np.random.default_rng(seed).standard_normal((3, n))
        c[0] = 1e-14
        _, info = tmg.solve_toeplitz((c, r), b, full_output=True)
        assert_within_budget("a leading block nearly singular", iterations=info.iterations)
        assert info.backward_error <= left_as_it_is(n)


@pytest.mark.parametrize("n", [300, 1500, 4500])
def test_a_leading_block_that_is_singular_is_no_obstacle(n):
    """Levinson's recursion divides by zero there, and there is no symbol."""
    for c0 in (0.0, 1.0):
        c, r = random(2, n)
        c[0] = c0
        if c0 == 1.0:
            c[1] = r[1] = 1.0
        for row in (r, c, r * 1j):
            check_residual(c, row)


@pytest.mark.parametrize("n", [300, 1500, 4500])
def test_nor_is_every_second_leading_block(n):
    """Of these matrices each is singular that has an odd number of unknowns."""
    k = np.arange(n)
    odd = k % 2 * random(2, n)
    skew = np.cos(k**2) / (1.0 + k)
    skew[0] = 0.0
    for c, r in (odd, (odd[0], odd[0]), (skew, -skew), (1j * skew, -1j * skew)):
        check_residual(c, r)


def check_residual(c, r):
    """The solution for a random vector has the residual that is asked for."""
    b = random(len(c))
    x, info = tmg.solve_toeplitz((c, r), b, rtol=1e-10, full_output=True)
    assert max(residual((c, r), x, b), info.residual) <= 2e-10


def test_a_residual_is_corrected_wherever_rounding_allows_a_smaller_one():
    """Of nearly singular matrices that of Levinson's recursion is 1e-5 ‖b‖, of 1e-9 to be had."""
    seen = 0
    for seed in range(4):
        c, r, b = np.random.default_rng([seed, 300]).standard_normal((3, 300))
        r[0] = c[0]
        eigenvalues = np.linalg.eigvals(scipy.linalg.toeplitz(c, r))
        real = eigenvalues[eigenvalues.imag == 0.0].real
        if not len(real):
            continue
        c[0] -= real[np.abs(real).argmin()] - 1e-6
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            x, info = tmg.solve_toeplitz((c, r), b, full_output=True)
        assert max(residual((c, r), x, b), info.residual) <= 1e-6
        seen += 1
    assert seen


# Ill-conditioned and singular ones --------------------------------------------------------------


def test_an_ill_conditioned_system_is_solved_with_a_warning():
    """Any direct method in float64 leaves a residual of 1e-4 to 1e-2, for θ⁴ and n = 4096."""
    c = column("θ⁴", 4096)
    with pytest.warns(scipy.linalg.LinAlgWarning, match="A is ill-conditioned"):
        _, info = tmg.solve_toeplitz(c, random(4096), full_output=True)
    assert info.residual <= 1e-2
    assert info.backward_error <= 1e-14


def test_a_loose_tolerance_is_no_reason_to_warn():
    n = 3000
    b = random(n)
    _, info = tmg.solve_toeplitz(column("contact", n), b, rtol=1e-4, full_output=True)
    assert 1e-8 < info.residual <= 1e-4


def nearly_singular(power):
    """The matrix of ones but for 2^-power, and a right-hand side of which x is 2^power b."""
    return np.array([1.0, 1.0 - 2.0**-power]), np.array([1.0, -1.0])


@pytest.mark.parametrize("power", range(24, 46))
def test_a_residual_is_not_told_to_be_below_its_rounding(power):
    """Where rounding of A x may be above 1e-8 ‖b‖ the residual that is told has its size."""
    c, b = nearly_singular(power)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        x, info = tmg.solve_toeplitz(c, b, full_output=True)
    assert_allclose(x, 2.0**power * b, rtol=4.0 * EPS * 2.0**power)
    lags = np.append(c[1], c)
    rounding = EPS * np.linalg.norm(x) / np.linalg.norm(b)
    if rounding * lags.sum() > 1.001e-8:
        assert info.residual >= 0.999 * rounding * np.linalg.norm(lags)
    if rounding * np.linalg.norm(lags) > 1.001e-8:
        assert [warning.category for warning in told] == [scipy.linalg.LinAlgWarning]


@pytest.mark.parametrize("n", [1, 2, 5, 50, 300, 520, 1836, 2048])
@pytest.mark.parametrize("name", ["0.9^k", "contact", "fGn, H = 0.9", "θ²", "three lags"])
def test_a_residual_is_at_most_twice_what_is_told(name, n):
    c = np.array([2.0, -1.0] + n * [0.0])[:n] if name == "three lags" else column(name, n)
    for b in (random(n), np.ones(n)):
        x, info = tmg.solve_toeplitz(c, b, full_output=True)
        A = scipy.linalg.toeplitz(c.astype(np.longdouble))
        assert np.linalg.norm(b - A @ x) <= 2.0 * info.residual * np.linalg.norm(b)


@pytest.mark.parametrize("dtype", [float, complex])
@pytest.mark.parametrize("n", [1, 2, 100, 2001])
def test_a_matrix_that_is_symmetric_but_for_rounding_is_solved_as_that(dtype, n):
    c = column("0.9^k", n) * (np.exp(0.3j * np.arange(n)) if dtype is complex else 1.0)
    r, b = c.conj() * (1.0 + EPS * random(n).clip(-1.0, 1.0)), random(n)
    x, info = tmg.solve_toeplitz((c, r), b, full_output=True)
    assert_allclose(x, tmg.solve_toeplitz((c, c.conj()), b), atol=1e-12 * np.abs(x).max())
    assert info.residual <= 1e-13


@pytest.mark.parametrize("power", range(44, 52))
def test_no_residual_beyond_the_largest_is_returned_however_exact_x_seems(power):
    """Of this matrix rounding of A x may be more than what is measured of it."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", scipy.linalg.LinAlgWarning)
        try:
            _, info = tmg.solve_toeplitz(*nearly_singular(power), full_output=True)
        except np.linalg.LinAlgError:
            assert power > 45  # The residual may be 2^power ε.
        else:
            assert info.residual <= 0.1


def test_a_residual_that_is_small_by_chance_is_not_believed():
    """Rounding of A x is larger than its difference to b, as measured in float64: 3e-16 ‖b‖."""
    c, r = [0.7769513306110662, -58526404924396.21, -1.0285366648357602e-12], [0.0] * 3
    r[1:] = -83930371413307.45, 0.0031347323222615238
    b = [-8.15073034368816e-05, -9.456447495685684e-10, -885356591.2550571]
    with pytest.warns(scipy.linalg.LinAlgWarning, match="A is ill-conditioned"):
        x, info = tmg.solve_toeplitz((c, r), b, full_output=True)
    A = [[Fraction(a) for a in row] for row in scipy.linalg.toeplitz(c, r).tolist()]
    exact = [
        float(Fraction(right) - sum(a * Fraction(y) for a, y in zip(row, x.tolist(), strict=True)))
        for row, right in zip(A, b, strict=True)
    ]
    assert 1e-4 <= np.linalg.norm(exact) / np.linalg.norm(b) <= info.residual <= 0.1


@pytest.mark.parametrize("n", [5, 300, 2100])
def test_a_backward_error_is_in_proportion_to_all_coefficients_and_all_unknowns(n):
    """Also where the largest ones of both do not meet."""
    c = np.eye(1, n)[0] + 1e12 * np.eye(1, n, n - 1)[0]
    b = np.random.default_rng(0).standard_normal(n)
    x, info = tmg.solve_toeplitz((c, 0.3 * c), b, full_output=True)
    terms = np.abs(np.r_[c, 0.3 * c[1:]]).sum() * np.linalg.norm(x) / np.linalg.norm(b)
    assert info.backward_error <= 1.001 * info.residual / (1.0 + terms)


@pytest.mark.parametrize("n", [2500, 3001, 5000])
def test_a_matrix_that_is_not_positive_although_its_circulant_is(n):
    """The matrix of -u'', and a shift between its two least eigenvalues, below 2/n."""
    c = np.zeros(n)
    c[:2] = 2.0 - 2.5 * (np.pi / (n + 1)) ** 2, -1.0
    b = np.random.default_rng(0).standard_normal(n)
    x = tmg.solve_toeplitz(c, b, rtol=1e-9)
    assert residual(c, x, b) <= 1.1e-9


@pytest.mark.parametrize("n", [4, 300, 2100, pytest.param(40000, marks=pytest.mark.slow)])
def test_a_singular_system_is_an_error(n):
    for c in (np.zeros(n), np.ones(n), np.exp(-((np.arange(n) / (0.1 * n)) ** 2) / 2)):
        if n == 4 and 0 < c[1] < 1:
            continue  # It is not so singular.
        with pytest.raises(np.linalg.LinAlgError, match="A is singular"):
            tmg.solve_toeplitz(c, random(n))


def test_an_error_says_what_was_tried_and_none_is_hidden_by_rounding():
    with pytest.raises(np.linalg.LinAlgError, match=r"A is singular.*; .* fails: A is"):
        tmg.solve_toeplitz(([0.0, 0.0], [0.0, 1.0]), [1.0, 1.0])
    for n, is_told in ((4, False), (5000, True)):
        with pytest.raises(np.linalg.LinAlgError, match="A is singular") as error:
            tmg.solve_toeplitz(np.ones(n), np.arange(float(n)))
        assert ("none of the methods for more than" in str(error.value)) is is_told
    for upper in (False, True):
        for n in (4, 2100):
            c, r = np.zeros((2, n))
            (r if upper else c)[1:3] = 1.0, 0.5
            with pytest.raises(np.linalg.LinAlgError, match="fails: the diagonal is zero"):
                tmg.solve_toeplitz((c, r), np.ones(n))
    for systems in (1, 100):
        for power in (-40, 0, 40):
            # Of ones but for rounding ‖A‖ ‖x‖ is over ‖b‖/ε: the residual tells nothing.
            c = np.ones((systems, 2))
            c[:, 1] -= 2.0**-53
            with pytest.raises(np.linalg.LinAlgError, match="A is singular"):
                tmg.solve_toeplitz(2.0**power * c, np.tile([[1.0], [-1.0]], (systems, 1, 1)))


@pytest.mark.filterwarnings("ignore:.*A is ill-conditioned")
def test_of_all_answers_the_one_with_the_least_residual_is_returned():
    n, k = 200, np.arange(1.0, 200.0)
    c, b = np.concatenate([[0.5], np.sin(0.5 * np.pi * k) / (np.pi * k)]), np.ones(n)
    by_lu = np.linalg.solve(scipy.linalg.toeplitz(c), b)
    found, expected = (residual(c, x, b) for x in (tmg.solve_toeplitz(c, b), by_lu))
    assert found <= 30.0 * expected <= 1e-5


def test_an_ill_conditioned_system_is_solved_as_by_scipy_with_a_warning():
    k = np.arange(5000.0)
    c, b = np.exp(-0.5 * (k / 5.0) ** 2), np.sin(k)
    with pytest.warns(scipy.linalg.LinAlgWarning, match="A is ill-conditioned"):
        x = tmg.solve_toeplitz(c, b)
    assert residual(c, x, b) <= 3.0 * residual(c, scipy.linalg.solve_toeplitz(c, b), b)


@pytest.mark.parametrize("n", [1500, 2000, 5000])
def test_a_singular_system_is_refused_unless_the_right_hand_side_is_in_the_range(n):
    c = np.zeros(n)
    c[[0, -1]] = 1.0  # The first and the last equation are the same.
    with pytest.raises(np.linalg.LinAlgError, match="A is singular"):
        tmg.solve_toeplitz(c, random(n))
    x = tmg.solve_toeplitz(c, np.ones(n))
    assert residual(c, x, np.ones(n)) <= 1e-10


# Without what SciPy has compiled ----------------------------------------------------------------

SOLVE_WITHOUT = """
import sys, types
import numpy as np
import scipy.linalg

changed = types.SimpleNamespace(levinson=lambda a, b: (2.0 * b, None))
sys.modules["scipy.linalg._solve_toeplitz"] = None if sys.argv[1] == "gone" else changed

import toeplitz_mg as tmg

for n in (5, 300):
    c, B = 1.0 / (1.0 + np.arange(n)), np.ones((n, 2))
    for matrix in (c, (c, c**2), (1j * c, c**2), c - 0.3 * np.eye(1, n)[0]):
        X = tmg.solve_toeplitz(matrix, B)
        assert np.abs(scipy.linalg.matmul_toeplitz(matrix, X) - B).max() <= 1e-10
"""


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["gone", "changed"])
def test_whatever_private_functions_scipy_has_a_system_is_solved(kind):
    subprocess.run([sys.executable, "-c", SOLVE_WITHOUT, kind], check=True)
