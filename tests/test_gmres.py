"""gmres: the least residual of each Krylov space, SciPy's iterates, failure that is told."""

import contextlib
import tracemalloc

import numpy as np
import pytest
import scipy.sparse
import scipy.sparse.linalg
from numpy.testing import assert_allclose

import toeplitz_mg as tmg
from tests.systems import count_iterations, seeded

DTYPES = [np.float32, np.float64, np.complex64, np.complex128]


def matrix(n, dtype=np.float64):
    """No symmetry, a condition number of some tens."""
    rng = np.random.default_rng(0)
    A = np.eye(n) + 0.6 / np.sqrt(n) * rng.standard_normal((n, n))
    if np.dtype(dtype).kind == "c":
        A = A + 0.4j / np.sqrt(n) * rng.standard_normal((n, n))
    return A.astype(dtype)


def vector(n, dtype=np.float64, seed=1):
    return seeded(n, dtype=dtype, seed=seed)


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("with_guess", [False, True])
@pytest.mark.parametrize("restart", [None, 5, 60])
def test_solves_to_the_true_residual(dtype, with_guess, restart):
    A, b = matrix(60, dtype), vector(60, dtype)
    M = np.diag(np.linspace(0.5, 2.0, 60)).astype(dtype)
    x0 = vector(60, dtype, seed=2) if with_guess else None
    rtol = 1e-4 if np.finfo(dtype).bits == 32 else 1e-11
    x, info = tmg.gmres(A, b, x0, M=M, rtol=rtol, restart=restart)
    assert info == 0
    assert x.dtype == dtype
    # 1.1: the residual that is computed has a rounding of its own.
    assert np.linalg.norm(b - A @ x) <= 1.1 * rtol * np.linalg.norm(b)


@pytest.mark.parametrize(("restart", "maxiter"), [(3, 4), (15, 2)])
def test_the_iterates_are_those_of_scipy(restart, maxiter):
    """Without a preconditioner left and right are the same."""
    A, b = matrix(50), vector(50)
    ours, theirs = [], []
    for gmres, iterates in ((tmg.gmres, ours), (scipy.sparse.linalg.gmres, theirs)):
        told = {"callback": lambda x, i=iterates: i.append(x.copy()), "callback_type": "x"}
        x, info = gmres(A, b, rtol=1e-13, restart=restart, maxiter=maxiter, **told)
        assert info == maxiter
        assert_allclose(x, iterates[-1])
    assert len(ours) == maxiter
    assert_allclose(ours, theirs, atol=1e-10)


@pytest.mark.parametrize("restart", [4, 30])
def test_callbacks_and_history(restart):
    A, b = matrix(50), vector(50)
    M = np.diag(np.linspace(0.5, 2.0, 50))
    norms, residuals = [], []
    told = {"callback": norms.append, "callback_type": "pr_norm", "residuals": residuals}
    x, info = tmg.gmres(A, b, M=M, rtol=1e-9, restart=restart, **told)
    assert info == 0
    size = np.linalg.norm(b)
    # The recurrence tells the true residual.
    assert_allclose(residuals[1:], size * np.array(norms), atol=1e-12 * size)
    assert_allclose(residuals[-1], np.linalg.norm(b - A @ x), rtol=1e-4)
    assert (np.diff(residuals) <= 1e-14 * size).all()
    # And it stops at once.
    assert residuals[-1] <= 1e-9 * size < residuals[-2]
    for k in (1, 3, 7):
        y, _ = tmg.gmres(A, b, M=M, rtol=residuals[k] * (1 + 1e-9) / size, restart=restart)
        assert_allclose(np.linalg.norm(b - A @ y), residuals[k], rtol=1e-9)


@pytest.mark.parametrize("callback_type", [None, "legacy"])
@pytest.mark.parametrize("maxiter", [3, 10, 33])
def test_a_callback_without_a_type_is_that_of_scipy(callback_type, maxiter):
    """Then `maxiter` counts iterations."""
    A, b, found = matrix(50), vector(50), []
    for gmres in (tmg.gmres, scipy.sparse.linalg.gmres):
        norms, told = [], {"rtol": 1e-13, "restart": 10, "callback_type": callback_type}
        expected = contextlib.nullcontext()
        if callback_type is None:
            expected = pytest.warns(DeprecationWarning, match="without specifying `callback_type`")
        with expected:
            x, info = gmres(A, b, maxiter=maxiter, callback=norms.append, **told)
        assert info == len(norms) == maxiter
        found.append([*x, *norms])
    assert_allclose(*found, atol=1e-10)
    # Without a callback its type has no effect.
    assert tmg.gmres(A, b, maxiter=maxiter, callback_type=callback_type)[1] == 0
    with pytest.raises(ValueError, match=r"callback_type is 'y', but must be 'x', to call"):
        tmg.gmres(A, b, callback_type="y")


K = np.arange(500)


@pytest.mark.parametrize(
    "arguments",
    [
        ((1.0 + K) ** -1.1, 0.5 * (1.0 + K) ** -2.0),
        (0.5**K * np.exp(0.7j * K), 0.4**K * np.exp(0.2j * K)),
        (0.5**K * np.exp(0.7j * K),),
    ],
    ids=["real", "complex", "Hermitian"],
)
def test_a_preconditioner_of_a_toeplitz_matrix_halves_the_iterations(arguments):
    A = tmg.ToeplitzOperator(*arguments)
    M = tmg.chan_preconditioner(A)
    for b in (vector(500), vector(500, np.complex128)):
        none, few = (count_iterations(tmg.gmres, A, b, M=N, rtol=1e-10) for N in (None, M))
        assert few <= none / 2


@pytest.mark.parametrize("restart", [None, 7])
def test_one_product_an_iteration_and_one_a_cycle(restart):
    A = tmg.ToeplitzOperator(0.6 ** np.arange(500), 0.3 ** np.arange(500))
    b = vector(500)
    for guess, first in ((None, 0), (np.ones(500), 1)):
        residuals, cycles = [], []
        with tmg.count_products() as work:
            told = {"callback": cycles.append, "callback_type": "x", "residuals": residuals}
            _, info = tmg.gmres(A, b, guess, rtol=1e-7, restart=restart, **told)
        assert info == 0
        assert work.products == len(residuals) - 1 + len(cycles) + first


def test_stagnation_is_reported():
    """A shift by one: GMRES finds nothing before the n-th iteration."""
    A, b = np.roll(np.eye(30), 1, axis=0), np.eye(30)[0]
    residuals = []
    x, info = tmg.gmres(A, b, restart=10, residuals=residuals)
    assert (info, len(residuals) - 1) == (1, 10)
    assert np.linalg.norm(b - A @ x) <= 1.0
    _, info = tmg.gmres(A, b, restart=30)
    assert info == 0


@pytest.mark.parametrize(("small", "cycles"), [(0.03, 1542), (0.01, None)])
def test_cycles_that_gain_little_together_gain_enough(small, cycles):
    """A turn by nearly a right angle: of one iteration each reduces by (1 + ε²)^(-1/2)."""
    A, residuals = np.array([[small, -1.0], [1.0, small]]), []
    _, info = tmg.gmres(A, [1.0, 0.0], rtol=0.5, restart=1, maxiter=2000, residuals=residuals)
    expected = (1.0 + small**2) ** (-0.5 * np.arange(len(residuals)))
    assert_allclose(residuals, expected, rtol=1e-9)
    if cycles is None:  # Ten of them reduce it by 0.05 %.
        assert info == len(residuals) - 1 == 10
    else:
        assert (info, len(residuals) - 1) == (0, cycles)


@pytest.mark.parametrize("dtype", DTYPES)
def test_stagnation_at_rounding_is_reported(dtype):
    A, b = matrix(60, dtype), vector(60, dtype)
    residuals = []
    x, info = tmg.gmres(A, b, rtol=1e-20, residuals=residuals)
    assert 0 < info < len(residuals) < 300
    assert_allclose(residuals[-1], np.linalg.norm(b - A @ x), rtol=0.5)
    assert residuals[-1] <= 100 * np.finfo(dtype).eps * np.linalg.norm(b)


def test_singular_matrices():
    A = np.diag([1.0, 2.0, 0.0])
    x, info = tmg.gmres(A, [1.0, 1.0, 0.0], rtol=1e-12)
    assert info == 0
    assert_allclose(x, [1.0, 0.5, 0.0], atol=1e-15)
    x, info = tmg.gmres(A, [1.0, 1.0, 1.0])
    assert info > 0
    assert_allclose(np.linalg.norm([1.0, 1.0, 1.0] - A @ x), 1.0)
    nilpotent = np.array([[0.0, 1.0], [0.0, 0.0]])
    for b in ([1.0, 0.0], [0.0, 1.0]):
        x, info = tmg.gmres(nilpotent, b)
        assert info > 0
        assert np.linalg.norm(b - nilpotent @ x) <= 1.0
    x, info = tmg.gmres(np.zeros((3, 3)), [1.0, 2.0, 3.0])
    assert info == 1
    assert not x.any()


def test_the_memory_is_bounded():
    n = 2**13
    A = tmg.ToeplitzOperator(0.9 ** np.arange(n), 0.8 ** np.arange(n))
    b = vector(n)
    A @ b  # Its memory for products is kept.
    tracemalloc.start()
    try:
        residuals = []
        tmg.gmres(A, b, rtol=1e-12, residuals=residuals)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert len(residuals) > 20
    assert peak <= 30 * b.nbytes


def test_norms_that_are_called_back_are_of_what_is_solved():
    norms = []
    tmg.gmres(np.ones((3, 3)), [1.0, 2.0, 3.0], callback=norms.append, callback_type="pr_norm")
    assert min(norms) > 0.3  # A singular matrix leaves that much of b.


def test_a_cycle_of_one_iteration_converges_as_slowly_as_its_bound():
    """Of a positive definite matrix each reduces the residual by (κ - 1)/(κ + 1), here 19/21."""
    rng = np.random.default_rng(0)
    A, b = np.diag([1.0, 20.0, *rng.uniform(1.0, 20.0, 48)]), rng.standard_normal(50)
    residuals = []
    x, info = tmg.gmres(A, b, restart=1, rtol=1e-6, residuals=residuals)
    assert info == 0
    assert np.linalg.norm(b - A @ x) <= 1.001e-6 * np.linalg.norm(b)
    ratios = np.array(residuals[1:]) / residuals[:-1]
    assert 0.6 < ratios.max() <= 19 / 21 + 1e-6


@pytest.mark.parametrize("power", [-900, -50, 50, 900])
def test_a_power_of_two_times_the_matrix_changes_no_digit_and_no_iteration(power):
    histories = []
    for scale in (1.0, 2.0**power):
        residuals = []
        x, info = tmg.gmres(
            scale * matrix(40), vector(40), rtol=1e-9, restart=8, residuals=residuals
        )
        assert info == 0
        histories.append([*(x * scale), *residuals])
    assert np.array_equal(*histories)
