"""Coefficients of fractional derivatives: their formulas, what they tend to, and iterations."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.sparse import diags_array, eye_array
from scipy.special import binom, gamma, rgamma

import toeplitz_mg as tmg
from tests.budgets import assert_within_budget
from tests.systems import count_iterations, refuses
from toeplitz_mg.fractional import grunwald_coefficients, riesz_coefficients

ORDERS = [1.0, 1.1, 1.5, 1.9, 2.0]


@pytest.mark.parametrize("order", [0.3, *ORDERS])
@pytest.mark.parametrize("n", [1, 2, 30])
def test_riesz_coefficients_are_the_formula(order, n):
    k = np.arange(n)
    expected = (
        (-1.0) ** k * gamma(order + 1) * rgamma(order / 2 - k + 1) * rgamma(order / 2 + k + 1)
    )
    assert_allclose(riesz_coefficients(order, n), expected, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("n", [1, 2, 30])
def test_grunwald_coefficients_are_binomial(order, n):
    k = np.arange(n + 1)
    weights = (-1.0) ** k * binom(order, k)
    c, r = grunwald_coefficients(order, n)
    assert_allclose(c, -weights[1:], rtol=1e-12, atol=1e-15)
    assert_allclose(r, [order, *[-1.0] * (n > 1), *[0.0] * (n - 2)])


def test_their_matrices_are_positive_definite():
    for order in ORDERS:
        for A in (
            tmg.ToeplitzOperator(riesz_coefficients(order, 50)),
            tmg.ToeplitzOperator(*grunwald_coefficients(order, 50)),
        ):
            dense = A.toarray()
            assert np.linalg.eigvalsh(dense + dense.T)[0] > 0.0


@pytest.mark.parametrize("order", [1.2, 1.5, 1.8])
def test_grunwald_tends_to_the_derivative_as_h_does(order):
    """The left derivative of x³ is Γ(4)/Γ(4 - α) x^(3 - α)."""
    errors = []
    for n in (99, 199, 399):
        h = 1.0 / (n + 1)
        x = h * np.arange(1, n + 1)
        A = tmg.ToeplitzOperator(*grunwald_coefficients(order, n))
        derivative = -(A @ x**3) / h**order
        inside = x < 0.9  # The function is not zero at the other end.
        exact = gamma(4.0) / gamma(4.0 - order) * x ** (3.0 - order)
        errors.append(abs(derivative - exact)[inside].max())
    assert errors[1] < 0.6 * errors[0]
    assert errors[2] < 0.6 * errors[1]


def test_riesz_tends_to_the_derivative():
    """The steady solution for a constant load on (-1, 1) is (1 - x²)^(α/2)/Γ(α + 1) of it."""
    order, errors = 1.5, []
    for n in (127, 255, 511):
        h = 2.0 / (n + 1)
        x = -1.0 + h * np.arange(1, n + 1)
        A = tmg.ToeplitzOperator(riesz_coefficients(order, n))
        M = tmg.tau_preconditioner(A)
        u, info = tmg.cg(A, np.full(n, h**order * gamma(order + 1.0)), M=M, rtol=1e-12)
        assert info == 0
        errors.append(abs(u - (1.0 - x**2) ** (order / 2))[abs(x) < 0.5].max())
    assert errors[1] < 0.6 * errors[0]
    assert errors[2] < 0.6 * errors[1]


@pytest.mark.parametrize("order", [1.1, 1.5, 1.9])
def test_variable_coefficients_take_as_many_iterations_on_any_grid(order):
    counts = []
    for n in (2**8 - 1, 2**11 - 1, 2**14 - 1):
        x = np.arange(1, n + 1) / (n + 1)
        A = tmg.ToeplitzOperator(*grunwald_coefficients(order, n))
        D1, D2 = diags_array(1.0 + x**2), diags_array(1.0 + (1.0 - x) ** 2)
        S = D1 @ A + D2 @ A.T + (n + 1) ** (1.0 - order) * eye_array(n)
        counts.append(count_iterations(tmg.gmres, S, np.ones(n), M=tmg.tau_preconditioner(S)))
    assert max(counts) - min(counts) <= 3
    assert_within_budget("τ of variable fractional diffusion", iterations=max(counts))


def test_what_is_no_order_or_number_of_points_is_refused():
    for function, wrong in (
        (riesz_coefficients, (0.0, 2.5, -1.0)),
        (grunwald_coefficients, (0.5, 2.1)),
    ):
        for order in wrong:
            refuses(ValueError, f"order is {order}, but must", function, order, 5)
        refuses(TypeError, "order is 'a', but must be a real number", function, "a", 5)
        refuses(ValueError, "n is 0, but must be at least 1", function, 1.5, 0)
        refuses(TypeError, r"n is 2\.5, but must be an integer", function, 1.5, 2.5)
