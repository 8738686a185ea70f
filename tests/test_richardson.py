"""The stationary iteration: SciPy's conventions, the true residual, honest failure."""

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse
from numpy.testing import assert_allclose

import toeplitz_mg as tmg
from toeplitz_mg.paper.problems import test1, test2, test3

PROBLEM = test1(500)
M = tmg.fft_rsm_preconditioner(PROBLEM.A)


@pytest.mark.parametrize("n", [100, 1000, pytest.param(4096, marks=pytest.mark.slow)])
@pytest.mark.parametrize("test", [test1, test2, test3])
def test_agrees_with_a_dense_cholesky_solve(test, n):
    problem = test(n)
    dense = scipy.linalg.cho_solve(scipy.linalg.cho_factor(problem.A.toarray()), problem.b)
    for M in (tmg.multigrid(problem.A, pre=0), tmg.fft_rsm_preconditioner(problem.A)):
        x, info = tmg.richardson(problem.A, problem.b, M=M, rtol=1e-12)
        assert info == 0
        assert np.linalg.norm(x - dense) <= 1e-7 * np.linalg.norm(dense)


@pytest.mark.parametrize("rtol", [1e-3, 1e-8, 1e-12])
def test_stops_at_the_true_residual_and_not_earlier(rtol):
    A, b = PROBLEM.A, PROBLEM.b
    residuals = [np.linalg.norm(b)]

    def callback(x):
        residuals.append(np.linalg.norm(b - A @ x))

    x, info = tmg.richardson(A, b, M=M, rtol=rtol, callback=callback)
    assert info == 0
    assert residuals[-1] <= rtol * residuals[0] < residuals[-2]
    assert residuals[-1] == np.linalg.norm(b - A @ x)


def test_absolute_tolerance_as_in_scipy():
    A, b = PROBLEM.A, PROBLEM.b
    for rtol, atol in ((0.0, 1e-7), (1e-3, 1e-12)):
        x, info = tmg.richardson(A, b, M=M, rtol=rtol, atol=atol)
        assert info == 0
        assert np.linalg.norm(b - A @ x) <= max(rtol * np.linalg.norm(b), atol)


def test_one_product_with_each_matrix_a_step():
    A, b = PROBLEM.A, PROBLEM.b
    for guess, extra in ((None, 0), (np.ones(500), 1)):
        steps = []
        with tmg.count_products() as work:
            tmg.richardson(A, b, guess, M=M, rtol=1e-6, callback=steps.append)
        assert work.products == 2 * len(steps) + extra


def test_work_of_the_paper():
    """A V(0,1) step costs at most 5 work units (the paper counts 7)."""
    problem = test1(2**14)
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


@pytest.mark.parametrize("scale", [1e-200, 1e-30, 1e30, 1e200])
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_tiny_and_huge_right_hand_sides(scale, dtype):
    """Their squares under- and overflow; the answer must not depend on it."""
    if dtype == np.float32 and not 1e-37 < scale < 1e37:
        scale = 1.0 if scale < 1 else 1e20
    A = tmg.ToeplitzOperator((0.5 ** np.arange(50)).astype(dtype))
    b = (scale * np.linspace(1, 2, 50)).astype(dtype)
    x, info = tmg.richardson(A, b, M=tmg.fft_rsm_preconditioner(A), rtol=1e-5)
    assert info == 0
    assert_allclose(A @ x / dtype(scale), b / dtype(scale), rtol=1e-4)


@pytest.mark.parametrize("power", [-1000, -700, 700, 1000])
@pytest.mark.parametrize("guess", [None, np.linspace(0.0, 1.0, 50)])
def test_a_power_of_two_scales_every_iterate_and_changes_no_digit(power, guess):
    A = tmg.ToeplitzOperator(0.5 ** np.arange(50))
    M = tmg.fft_rsm_preconditioner(A)
    ours, scaled = [], []
    for scale, iterates in ((1.0, ours), (2.0**power, scaled)):
        b, x0 = scale * np.linspace(1.0, 2.0, 50), None if guess is None else scale * guess
        _, info = tmg.richardson(
            A, b, x0, M=M, rtol=1e-9, callback=lambda x, i=iterates, s=scale: i.append(x / s)
        )
        assert info == 0
    assert np.array_equal(ours, scaled)


@pytest.mark.parametrize("solver", [tmg.cg, tmg.richardson])
@pytest.mark.parametrize(("of_A", "of_b"), [(1e-300, 1e10), (1e200, 1e-200), (1.0, 5e-324)])
def test_a_solution_out_of_range_has_not_converged(solver, of_A, of_b):
    """It would be inf or 0, or a number with the digits of 5e-324."""
    A = tmg.ToeplitzOperator(of_A * 0.5 ** np.arange(10))
    b = of_b * np.linspace(1.0, 2.0, 10)
    _, info = solver(A, b, M=tmg.chan_preconditioner(A), maxiter=50)
    assert info > 0


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
    problem = test1(2**14)
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


def test_too_few_iterations_are_reported():
    steps = []
    _x, info = tmg.richardson(
        PROBLEM.A, PROBLEM.b, M=M, rtol=1e-12, maxiter=5, callback=steps.append
    )
    assert (info, len(steps)) == (5, 5)


def test_takes_what_scipy_takes():
    dense = np.diag([2.0, 3.0, 4.0])
    b = [1, 2, 3]
    for A in (dense, scipy.sparse.csr_array(dense)):
        for rhs in (b, np.array(b)[:, None]):
            x, info = tmg.richardson(A, rhs, M=np.diag([0.5, 0.3, 0.2]), rtol=1e-12)
            assert info == 0
            assert_allclose(x, [0.5, 2 / 3, 0.75])
    z, info = tmg.richardson(np.eye(2), [1.0, 2.0], M=np.diag([1.0 + 0j, 1.0]))
    assert info == 0
    assert_allclose(z, [1.0, 2.0])
    z, info = tmg.richardson(np.diag([1.0, 1j]), [1j, 1.0], M=np.diag([1.0, -1j]))
    assert info == 0
    assert_allclose(z, [1j, -1j])


def test_the_first_guess_is_not_changed_and_may_be_the_solution():
    x0 = np.ones(500)
    tmg.richardson(PROBLEM.A, PROBLEM.b, x0, M=M)
    assert (x0 == 1).all()
    x, info = tmg.richardson(PROBLEM.A, PROBLEM.A @ x0, x0, M=M, maxiter=1)
    assert info == 0
    assert np.array_equal(x, x0)
    zero, info = tmg.richardson(PROBLEM.A, np.zeros(500), x0, M=M)
    assert info == 0
    assert not zero.any()


@pytest.mark.parametrize(
    ("arguments", "error", "match"),
    [
        ({"b": np.ones(4)}, ValueError, r"b has shape \(4,\), but A has \(3, 3\)"),
        ({"x0": np.ones(4)}, ValueError, r"x0 has shape \(4,\)"),
        ({"b": [1.0, np.nan, 0.0]}, ValueError, "b has entries that are not finite"),
        ({"b": ["a", "b", "c"]}, TypeError, "b has dtype"),
        ({"rtol": -1e-8}, ValueError, "rtol is -1e-08, but must be finite and not negative"),
        ({"atol": np.inf}, ValueError, "atol is inf"),
        ({"rtol": np.nan}, ValueError, "rtol is nan"),
        ({"maxiter": 0}, ValueError, "maxiter is 0, but must be at least 1"),
        ({"atol": None}, TypeError, "atol is None, but must be a real number"),
        ({"maxiter": 1.5}, TypeError, "maxiter is 1.5, but must be an integer"),
        ({"M": np.eye(2)}, ValueError, r"M has shape \(2, 2\), but A has \(3, 3\)"),
        ({"A": np.ones((3, 2))}, ValueError, "must be square"),
    ],
)
def test_refuses_bad_arguments(arguments, error, match):
    arguments = {"A": np.eye(3), "b": np.ones(3)} | arguments
    with pytest.raises(error, match=match):
        tmg.richardson(arguments.pop("A"), arguments.pop("b"), **arguments)
