"""With the τ preconditioner Riesz derivatives have the spectrum (1/2, 3/2), whatever n is."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.sparse import diags_array, eye_array

import toeplitz_mg as tmg
from tests.cases import contact, dense_tau
from tests.systems import refuses

ORDERS = [1.1, 1.5, 1.9]


def riesz(order, n):
    """Coefficients of |2 sin θ/2|^order, but for a factor."""
    k = np.arange(1.0, n)
    return np.cumprod(np.r_[1.0, (k - 1.0 - order / 2.0) / (k + order / 2.0)])


def operator(order, *grid_shape):
    """The sum of the derivatives along each axis."""
    c = np.zeros(grid_shape)
    for axis, n in enumerate(grid_shape):
        along = [0] * len(grid_shape)
        along[axis] = slice(None)
        c[tuple(along)] += riesz(order, n)
    return tmg.ToeplitzOperator(c)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("grid_shape", [(31,), (99,), (255,), (15, 15), (7, 31), (7, 8, 9)])
def test_the_spectrum_lies_between_a_half_and_three_halves(order, grid_shape):
    A = operator(order, *grid_shape)
    half = np.linalg.cholesky(A.toarray())
    spectrum = np.linalg.eigvalsh(half.T @ (tmg.tau_preconditioner(A) @ half))
    assert spectrum[0] > 0.5
    assert spectrum[-1] < 1.5


@pytest.mark.parametrize("order", ORDERS)
def test_iterations_do_not_depend_on_n(order):
    """With that spectrum 15 iterations are enough for any n."""
    grids = [(2**k - 1,) for k in (6, 10, 14)] + [(1000,), (1021,), (63, 63), (255, 255)]
    for grid_shape in grids:
        A = operator(order, *grid_shape)
        for b in (np.ones(A.shape[0]), np.random.default_rng(0).standard_normal(A.shape[0])):
            _, info = tmg.cg(A, b, M=tmg.tau_preconditioner(A), rtol=1e-8, maxiter=15)
            assert info == 0


@pytest.mark.parametrize("shift", [0.1, 10.0])
def test_a_shift_is_one_of_the_eigenvalues(shift):
    c = riesz(1.5, 40)
    shifted = c.copy()
    shifted[0] += shift
    M = tmg.tau_preconditioner(tmg.ToeplitzOperator(c), shift=shift)
    assert_allclose(M @ np.eye(40), dense_tau(shifted), atol=1e-12)


def test_it_is_that_of_the_symmetric_part():
    c, r = 0.5 ** np.arange(20.0), 0.3 ** np.arange(20.0)
    G = tmg.ToeplitzOperator(c, r)
    expected = dense_tau((c + r) / 2)
    assert_allclose(tmg.tau_preconditioner(G) @ np.eye(20), expected, atol=1e-12)
    mask = np.arange(20) % 5 != 1
    M = tmg.tau_preconditioner(tmg.MaskedOperator(G, mask))
    assert_allclose(M @ np.eye(mask.sum()), expected[np.ix_(mask, mask)], atol=1e-12)


def test_a_shift_of_a_sum_is_one_of_its_terms():
    A = tmg.ToeplitzOperator(riesz(1.5, 40))
    S = diags_array(np.linspace(1.0, 2.0, 40)) @ A
    M = tmg.tau_preconditioner(S, shift=0.3)
    assert_allclose(
        M @ np.eye(40), tmg.tau_preconditioner(S + 0.3 * eye_array(40)) @ np.eye(40), atol=1e-12
    )


def test_what_is_not_positive_definite_is_refused():
    A = tmg.ToeplitzOperator(contact(16))
    refuses(np.linalg.LinAlgError, r"eigenvalue -.*: use ", tmg.tau_preconditioner, A)
    refuses(TypeError, "shift", tmg.tau_preconditioner, A, shift="1")
    refuses(ValueError, "shift", tmg.tau_preconditioner, A, shift=np.inf)
    A = tmg.ToeplitzOperator(contact(16))
    advice = r"with A \+ shift \* eye_array\(n\) instead of A"
    refuses(np.linalg.LinAlgError, advice, tmg.tau_preconditioner, A, shift=1e-9)
    with pytest.raises(np.linalg.LinAlgError) as error:
        tmg.tau_preconditioner(A)
    assert "eye_array" not in str(error.value)
