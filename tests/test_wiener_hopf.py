"""The factors of a symbol give nearly the inverse of nonsymmetric, Hermitian, general matrices.

So few iterations are left, as many for any n; a symbol without factors is refused.
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import toeplitz_mg as tmg
from comparisons.systems.symbols import HERMITIAN, NONSYMMETRIC, random_pair
from tests.budgets import assert_within_budget
from tests.systems import count_iterations, refuses


def general(kind, n):
    """A real matrix that is not symmetric, or a complex one that is not Hermitian."""
    c, r = NONSYMMETRIC["1/(1+k) | (-1)^k/(1+k)"](n)
    turn = np.exp(0.7j * np.arange(n))
    return (c, r) if kind == "real" else ((1 + 2j) * c * turn, (1 + 2j) * r / turn)


def iterations(A, M):
    b = np.random.default_rng(1).standard_normal(A.shape[0]).astype(A.dtype)
    return count_iterations(tmg.cg if A.is_hermitian else tmg.gmres, A, b, M=M)


@pytest.mark.parametrize("is_complex", [False, True])
@pytest.mark.parametrize("winding", [-3, -1, 1, 2])
def test_refuses_what_winds_around_zero(winding, is_complex):
    """z to this power, and little else."""
    n = 50
    lags = np.zeros(2 * n - 1, complex if is_complex else float)
    lags[n - 1 + winding] = 2j if is_complex else -2.0
    lags[n - 1] = 0.5
    A = tmg.ToeplitzOperator.from_lags(lags)
    message = rf"winding number {winding}, but must have 0.*use chan_preconditioner\(A\) with gmres"
    refuses(np.linalg.LinAlgError, message, tmg.spectral_preconditioner, A)


def test_refuses_factors_that_are_no_use_and_zeros_on_the_circle():
    """(1 - a z)(1 - b/z) with zeros so near to the circle that n unknowns see little of them."""
    a, b = 0.9999, 0.9998
    A = tmg.ToeplitzOperator([1 + a * b, -a, *[0.0] * 8], [1 + a * b, -b, *[0.0] * 8])
    with pytest.raises(np.linalg.LinAlgError, match=r"a column .* residual .* at most 0\.25"):
        tmg.spectral_preconditioner(A)
    for c in ([1.0, 1.0, 0.0, 0.0], [1.0, 1.0j, 0.0, 0.0]):
        A = tmg.ToeplitzOperator(c, [1.0, 0.0, 0.0, 0.0])
        with pytest.raises(np.linalg.LinAlgError, match=r"sample .*, but none may be zero"):
            tmg.spectral_preconditioner(A)


@pytest.mark.parametrize("name", NONSYMMETRIC)
def test_takes_few_iterations_for_nonsymmetric_matrices(name):
    counts = []
    for n in (500, 2001, 8192):
        A = tmg.ToeplitzOperator(*NONSYMMETRIC[name](n))
        M = tmg.spectral_preconditioner(A)
        assert not M.is_hermitian
        counts.append(iterations(A, M))
    assert_within_budget("spectral, nonsymmetric", iterations=max(counts))
    assert counts[2] <= counts[0] + 1


@pytest.mark.parametrize("name", HERMITIAN)
@pytest.mark.parametrize("n", [3, 64, 301])
def test_is_positive_definite_for_hermitian_matrices(name, n):
    A = tmg.ToeplitzOperator(*HERMITIAN[name](n))
    M = tmg.spectral_preconditioner(A)
    dense = M @ np.eye(n)
    assert M.H is M
    assert_allclose(dense, dense.conj().T, atol=1e-12 * abs(dense).max())
    assert np.linalg.eigvalsh(dense)[0] > 0.0
    # The product is similar to a Hermitian matrix.
    assert np.linalg.eigvals(dense @ A.toarray()).real.min() > 0.2


@pytest.mark.parametrize("name", HERMITIAN)
def test_takes_few_iterations_for_hermitian_matrices(name):
    """Three plane waves and noise too, which T. Chan's circulant takes over 200 for."""
    for n in (500, 4001):
        A = tmg.ToeplitzOperator(*HERMITIAN[name](n))
        count = iterations(A, tmg.spectral_preconditioner(A))
        assert_within_budget("spectral, Hermitian", iterations=count)


def test_refuses_a_hermitian_matrix_that_is_not_positive_definite():
    A = tmg.ToeplitzOperator([1.0, 0.9j, 0.5, 0.0])
    assert np.linalg.eigvalsh(A.toarray())[0] < 0.0
    for function in (tmg.spectral_preconditioner, tmg.toeplitz_inverse):
        refuses(np.linalg.LinAlgError, "not positive definite", function, A)


@pytest.mark.parametrize("dtype", [np.float32, np.complex64])
def test_single_precision(dtype):
    A = tmg.ToeplitzOperator(*general("real" if dtype is np.float32 else "complex", 900))
    M = tmg.spectral_preconditioner(A, dtype=dtype)
    assert M.dtype == dtype
    V = np.random.default_rng(0).standard_normal((900, 2)).astype(dtype)
    assert (M @ V).dtype == dtype
    exact = tmg.spectral_preconditioner(A) @ V
    assert_allclose(M @ V, exact, atol=2e-5 * abs(exact).max())


@pytest.mark.parametrize("kind", ["real", "complex"])
def test_the_work_of_the_set_up_is_that_of_some_nine_products(kind):
    n = 2**14
    A = tmg.ToeplitzOperator(*general(kind, n))
    with tmg.count_products() as work:
        M = tmg.spectral_preconditioner(A)
    assert_within_budget("set-up of spectral, general, n = 2^14", work_units=work.units(n))
    with tmg.count_products() as work:
        M @ np.ones(n, A.dtype)
    assert work.units(n) == 2.0


def test_random_entries_have_no_factors():
    A = tmg.ToeplitzOperator(*random_pair(1000))
    for function in (tmg.spectral_preconditioner, tmg.toeplitz_inverse):
        refuses(np.linalg.LinAlgError, r"winding number .*solve_toeplitz", function, A)
    # Few unknowns are solved for directly.
    A = tmg.ToeplitzOperator(*random_pair(100))
    assert tmg.toeplitz_inverse(A).residual <= 1e-10


def test_one_axis_of_several():
    c, r = general("real", 40)
    line = tmg.ToeplitzOperator(c, r)
    lags = np.concatenate([r[:0:-1], c]).reshape(1, -1)
    M = tmg.spectral_preconditioner(tmg.ToeplitzOperator.from_lags(lags))
    v = np.random.default_rng(0).standard_normal(40)
    assert_allclose(M @ v, tmg.spectral_preconditioner(line) @ v, atol=1e-13)
    with pytest.raises(ValueError, match="must have one axis"):
        tmg.spectral_preconditioner(tmg.ToeplitzOperator.from_lags(np.arange(9.0).reshape(3, 3)))
