"""What a system tells of itself: its kind, its products, and the sizes of its terms."""

import numpy as np
import pytest
import scipy.linalg
from numpy.testing import assert_allclose

import toeplitz_mg as tmg
from toeplitz_mg.solvers.system import ToeplitzSystem


def numbers(rng, is_complex, *shape):
    x = rng.standard_normal(shape)
    return x + 1j * rng.standard_normal(shape) if is_complex else x


@pytest.mark.parametrize("is_complex", [False, True])
@pytest.mark.parametrize("n", [1, 2, 9, 300, 600])
def test_the_sizes_of_terms_are_above_what_the_sums_can_be_and_below_that_of_any(n, is_complex):
    """‖|A| |x|‖ is at most the sum of |a| times what each meets of x, and that ‖a‖₁ ‖x‖."""
    rng = np.random.default_rng(0)
    decay = np.exp(-np.linspace(0.0, 20.0, n))
    for left, right in ((1.0, decay), (decay, 1.0), (decay[::-1], 1.0), (1.0, 1.0)):
        c, r = left * numbers(rng, is_complex, n), right * numbers(rng, is_complex, n)
        r[0] = c[0]
        for weight in (1.0, decay, decay[::-1]):
            X = weight * numbers(rng, is_complex, 2, n)
            system = ToeplitzSystem(c, r, X)
            k = np.arange(n)
            exact = [
                abs(c[0]) * np.linalg.norm(x)
                + sum(abs(c[j]) * np.linalg.norm(x[: n - j]) for j in k[1:])
                + sum(abs(r[j]) * np.linalg.norm(x[j:]) for j in k[1:])
                for x in X
            ]
            assert_allclose(system.sizes_of_terms(X), exact, rtol=1e-10)
            assert_allclose(system.sizes_of_terms(X[0]), exact[0], rtol=1e-10)
            assert (system.least_size_of_terms(X) <= np.array(exact) * (1.0 + 1e-10)).all()
            of_one = ToeplitzSystem(c, r, X[0]).least_size_of_terms(X[0])
            assert_allclose(of_one, system.least_size_of_terms(X)[0], rtol=1e-10)
            terms = np.linalg.norm(np.abs(X) @ np.abs(scipy.linalg.toeplitz(c, r)).T, axis=1)
            assert (terms <= np.array(exact) * (1.0 + 1e-10)).all()


@pytest.mark.parametrize("n", [3, 300])
def test_a_hermitian_matrix_has_a_real_diagonal(n):
    rng = np.random.default_rng(0)
    c, b = numbers(rng, True, n), numbers(rng, True, n)
    for turn, is_hermitian in ((1.0, True), (1.0 + 1e-3j, False), (1j, False)):
        c[0] = turn
        for r, is_conjugate in ((c.conj(), True), (c, False)):
            system = ToeplitzSystem(c, r, b)
            assert system.is_hermitian == (is_hermitian and is_conjugate)
            assert not system.is_symmetric


@pytest.mark.parametrize("n", [2050, 3001])
def test_a_complex_diagonal_beside_hermitian_lags_is_solved_for(n):
    """A + i s I is regular for any Hermitian A, and its numerical range far from zero."""
    rng = np.random.default_rng(0)
    k = np.arange(n)
    c = 1.0 / (1.0 + k) ** 2 * np.exp(0.3j * k)
    r, b = c.conj(), numbers(rng, True, n)
    c[0] = r[0] = 1.0 + 2.0j
    x, info = tmg.solve_toeplitz((c, r), b, rtol=1e-10, full_output=True)
    residual = np.linalg.norm(b - scipy.linalg.matmul_toeplitz((c, r), x))
    assert residual <= 1.1e-10 * np.linalg.norm(b)
    assert info.method.startswith("gmres")
    assert info.iterations <= 15


@pytest.mark.parametrize("weights", [None, np.array([2.0, 3.0, 0.5, 0.25])])
def test_the_size_of_a_complex_number_has_both_parts(weights):
    rng = np.random.default_rng(0)
    X = rng.standard_normal((4, 5))
    system = ToeplitzSystem(np.ones(5), np.ones(5), X, 2, weights)
    parts = X if weights is None else X * weights[:, None]
    expected = np.linalg.norm(parts[:2] + 1j * parts[2:], axis=1)
    assert_allclose(system.measure(X), [*expected, *expected])
    assert_allclose(system.sizes, [*expected, *expected])


@pytest.mark.parametrize("size", [1e-150, 1e-100, 1e100, 1e150])
@pytest.mark.parametrize("of", ["A", "b", "one column of b"])
def test_what_squares_would_lose_is_no_usual_size(size, of):
    rng = np.random.default_rng(0)
    c, B = rng.standard_normal(9), rng.standard_normal((3, 9))
    assert ToeplitzSystem(c, c, B).is_of_usual_size
    assert ToeplitzSystem(c, c, B[0]).is_of_usual_size
    if of == "A":
        c = size * c
    elif of == "b":
        B = size * B
    else:
        B[1] *= size
    assert not ToeplitzSystem(c, c, B).is_of_usual_size
    assert of != "b" or not ToeplitzSystem(c, c, B[0]).is_of_usual_size


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
    residual = np.linalg.norm(b - scipy.linalg.matmul_toeplitz(c, x))
    assert residual <= 1.1e-9 * np.linalg.norm(b)


@pytest.mark.parametrize("upper", [False, True])
@pytest.mark.parametrize("n", [4, 2100])
def test_an_error_says_that_the_diagonal_of_a_triangular_matrix_is_zero(n, upper):
    c, r = np.zeros((2, n))
    (r if upper else c)[1:3] = 1.0, 0.5
    with pytest.raises(np.linalg.LinAlgError, match="substitution fails: the diagonal is zero"):
        tmg.solve_toeplitz((c, r), np.ones(n))
