"""The stationary iteration: SciPy's conventions, the true residual, honest failure."""

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse

import toeplitz_mg as tmg
from toeplitz_mg.paper import problems

PROBLEM = problems.test1(500)
M = tmg.fft_rsm_preconditioner(PROBLEM.A)


@pytest.mark.parametrize("n", [100, 1000])
@pytest.mark.parametrize("test", [problems.test1, problems.test2, problems.test3])
def test_agrees_with_a_dense_cholesky_solve(test, n):
    problem = test(n)
    dense = scipy.linalg.cho_solve(scipy.linalg.cho_factor(problem.A.toarray()), problem.b)
    for M in (tmg.multigrid(problem.A, pre=0), tmg.fft_rsm_preconditioner(problem.A)):
        x, info = tmg.richardson(problem.A, problem.b, M=M, rtol=1e-12)
        assert info == 0
        assert np.linalg.norm(x - dense) <= 1e-7 * np.linalg.norm(dense)


def test_one_product_with_each_matrix_a_step():
    A, b = PROBLEM.A, PROBLEM.b
    for guess, extra in ((None, 0), (np.ones(500), 1)):
        steps = []
        with tmg.count_products() as work:
            tmg.richardson(A, b, guess, M=M, rtol=1e-6, callback=steps.append)
        assert work.products == 2 * len(steps) + extra


def test_work_of_the_paper():
    """A V(0,1) step costs at most 5 work units (the paper counts 7)."""
    problem = problems.test1(2**14)
    cycle = tmg.multigrid(problem.A, pre=0, coarsest=2)
    steps = []
    with tmg.count_products() as work:
        tmg.richardson(problem.A, problem.b, M=cycle, rtol=1e-8, callback=steps.append)
    assert work.units(2**14) <= 5 * len(steps)


@pytest.mark.parametrize("M", [None, tmg.fft_preconditioner(PROBLEM.A)], ids=["plain", "M"])
def test_divergence_is_reported_without_a_warning(M):
    A = 3.0e5 * PROBLEM.A if M is None else PROBLEM.A
    x, info = tmg.richardson(A, PROBLEM.b, M=M, rtol=1e-8, maxiter=10**6)
    assert 0 < info < 1000
    assert np.isfinite(x).all()


@pytest.mark.parametrize("factor", [1e150, np.inf])
def test_a_preconditioner_that_overflows(factor):
    A, M = 1e200 * np.eye(3), np.diag([factor, 1.0, 1.0])
    _, info = tmg.richardson(A, np.ones(3), M=M)
    assert info == 1


def test_divergence_in_float32():
    A = tmg.ToeplitzOperator(PROBLEM.A.c.astype(np.float32))
    x, info = tmg.richardson(A, PROBLEM.b.astype(np.float32), M=1e10 * tmg.fft_preconditioner(A))
    assert info > 0
    assert x.dtype == np.float32


def test_deflation_with_two_smoothing_steps_diverges_and_says_so():
    """Paper, §5.1: a V(1,1)-cycle does not converge."""
    problem = problems.test1(2**14)
    cycle = tmg.multigrid(
        problem.A,
        smoother=tmg.fft_sd_preconditioner,
        coarsest=2,
        coarsen=tmg.rediscretised(problem.operator_of_grid_shape),
    )
    _x, info = tmg.richardson(problem.A, problem.b, M=cycle, rtol=1e-8, maxiter=1000)
    assert 0 < info < 100


def test_stagnation_at_rounding_is_reported():
    x, info = tmg.richardson(PROBLEM.A, PROBLEM.b, M=M, rtol=1e-17)
    assert 0 < info < 1000
    assert np.linalg.norm(PROBLEM.b - PROBLEM.A @ x) <= 1e-12 * np.linalg.norm(PROBLEM.b)
