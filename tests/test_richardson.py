"""The stationary iteration: SciPy's conventions, the true residual, honest failure."""

import numpy as np
import pytest

import toeplitz_mg as tmg
from toeplitz_mg.paper import problems

PROBLEM = problems.test1(500)
M = tmg.fft_rsm_preconditioner(PROBLEM.A)


def test_one_product_with_each_matrix_a_step():
    A, b = PROBLEM.A, PROBLEM.b
    for guess, extra in ((None, 0), (np.ones(500), 1)):
        steps = []
        with tmg.count_products() as work:
            tmg.richardson(A, b, guess, M=M, rtol=1e-6, callback=steps.append)
        assert work.products == 2 * len(steps) + extra


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


def test_stagnation_at_rounding_is_reported():
    x, info = tmg.richardson(PROBLEM.A, PROBLEM.b, M=M, rtol=1e-17)
    assert 0 < info < 1000
    assert np.linalg.norm(PROBLEM.b - PROBLEM.A @ x) <= 1e-12 * np.linalg.norm(PROBLEM.b)
